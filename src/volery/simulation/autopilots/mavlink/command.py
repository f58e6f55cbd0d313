"""MAVLink commands in one form, whether they arrive as COMMAND_LONG or as COMMAND_INT."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, nan
from typing import Any, NamedTuple

from volery.simulation.autopilots.mavlink.message_fields import finite
from volery.simulation.autopilots.onboard_mission import GLOBAL_RELATIVE
from volery.simulation.autopilots.vehicle_state import Vehicle

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = 0, 1, 2, 3, 4
"""MAV_RESULT."""

NOT_GIVEN = 2_147_483_647
"""Value of a coordinate of COMMAND_INT that is not given."""


class Command(NamedTuple):
    """One command.

    Args:
        number: MAV_CMD.
        param1: First parameter; likewise ``param2`` and ``param3``.
        param4: Fourth parameter; NaN may mean to keep the heading.
        x: Fifth parameter; degrees where it is a latitude. Likewise ``y`` for the longitude.
        z: Seventh parameter.
        frame: MAV_FRAME.
        is_int: Whether it arrived as COMMAND_INT.

    The others are NaN only for firmwares that read NaN as "not given".
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


Handler = Callable[[Vehicle, Command], int]
"""Executes a command and returns a MAV_RESULT."""


def from_long(fields: dict[str, Any], reads_nan: bool = False) -> Command:
    """Return the command of a COMMAND_LONG; with *reads_nan*, NaN parameters stay NaN."""
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
    """Return the command of a COMMAND_INT.

    With *reads_nan*, NaN parameters stay NaN and the largest integer becomes NaN.
    """
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
