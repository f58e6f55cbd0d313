"""How firmwares differ in the parts of MAVLink that all of them speak: texts, parameters, missions."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from volery.base.time import MS, Ns


def _always_plain(_number: int) -> str:
    return "MISSION_REQUEST"


class Texts(NamedTuple):
    """How words become STATUSTEXT."""

    numbered: bool = False
    """Whether a text that fits into one message has an id, too."""
    to_stations: bool = False
    """Whether they wait, four at most, until a ground station is heard on the link."""
    spacing: Ns = 0
    """Least time between two texts on a link."""


class ParameterHabits(NamedTuple):
    """How parameters are listed, read and written.

    The values are those of ArduPilot: 1390 parameters in 0.61 s, about 230 each tenth of a second; a
    parameter read by name is answered after 55 to 100 ms, a list and a set at once.
    """

    burst: int = 200
    period: Ns = 100 * MS
    read_delay: Ns = 50 * MS
    bytewise: bool = False
    """Whether an integer travels as its bytes in the place of the number; else as the number."""
    keeps_index: bool = False
    """Whether a value that nobody listed carries its own index; else 65535."""
    typed: bool = False
    """Whether a set of another type than the parameter's is ignored."""
    checksum: str = ""
    """Name of a value over all of them that is sent first; none if empty."""


class UploadHabits(NamedTuple):
    """How a mission is taken."""

    asks_with: Callable[[int], str] = _always_plain
    """The message that asks for an item, by its number."""
    received: str = "Flight plan received"
    """Said when it is complete; nothing if empty."""
    turns_to_integers: bool = False
    """Whether a peer that acknowledges a question as unsupported is asked by MISSION_REQUEST_INT instead."""
    keeps_old: bool = False
    """Whether the mission on board stays until the new one is complete."""
