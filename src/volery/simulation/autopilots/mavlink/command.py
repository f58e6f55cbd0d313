"""MAVLink commands in one form, whether they arrive as COMMAND_LONG or as COMMAND_INT."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, nan
from typing import TYPE_CHECKING, Any, NamedTuple

from volery.simulation.autopilots.mavlink.message_fields import finite
from volery.simulation.autopilots.onboard_mission import GLOBAL_RELATIVE

if TYPE_CHECKING:
    from volery.simulation.autopilots.vehicle_state import Vehicle

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = 0, 1, 2, 3, 4
"""MAV_RESULT."""

NOT_GIVEN = 2_147_483_647
"""A coordinate of COMMAND_INT that is none."""


class Command(NamedTuple):
    """A command, whichever form it came in. ``x`` and ``y`` are degrees where they are a place.

    All are numbers, but ``param4``, where a NaN may mean: leave the heading alone; and the others where the
    firmware reads a NaN as: not given.
    """

    number: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: float
    y: float
    z: float
    frame: int
    is_int: bool


Handler = Callable[["Vehicle", Command], int]
"""Does it and returns a MAV_RESULT."""


def from_long(fields: dict[str, Any], reads_nan: bool = False) -> Command:
    """COMMAND_LONG. *reads_nan*: what is no number stays none."""
    read = _number_or_nan if reads_nan else finite
    return Command(
        fields["command"],
        read(fields["param1"]),
        read(fields["param2"]),
        read(fields["param3"]),
        _number_or_nan(fields["param4"]),
        read(fields["param5"]),
        read(fields["param6"]),
        read(fields["param7"]),
        GLOBAL_RELATIVE,
        is_int=False,
    )


def from_int(fields: dict[str, Any], reads_nan: bool = False) -> Command:
    """COMMAND_INT. *reads_nan*: what is no number stays none, and the largest integer is none."""
    read = _number_or_nan if reads_nan else finite
    x, y = (nan if reads_nan and value == NOT_GIVEN else value / 1e7 for value in (fields["x"], fields["y"]))
    return Command(
        fields["command"],
        read(fields["param1"]),
        read(fields["param2"]),
        read(fields["param3"]),
        _number_or_nan(fields["param4"]),
        x,
        y,
        read(fields["z"]),
        fields["frame"],
        is_int=True,
    )


def _number_or_nan(value: float) -> float:
    return finite(value) if isfinite(value) else nan
