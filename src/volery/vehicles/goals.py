"""What an operation is measured against at its end."""

from __future__ import annotations

from math import hypot, nan
from typing import NamedTuple

from volery.base.frames import LocalFrame
from volery.base.position import Position


class Goal(NamedTuple):
    """What an operation is measured against at its end. NaN: not this coordinate."""

    latitude: float
    longitude: float
    amsl: float


NOWHERE = Goal(nan, nan, nan)


def offset(position: Position | None, goal: Goal) -> tuple[float, float]:
    """How far *position* (AMSL) is from *goal*: horizontally and vertically, metres; NaN where unknown."""
    if position is None:
        return nan, nan
    vertical = abs(position.altitude.metres - goal.amsl)
    if goal.latitude != goal.latitude:
        return nan, vertical
    height = position.altitude.metres
    east, north, _ = LocalFrame(goal.latitude, goal.longitude, height).to_enu(
        position.latitude, position.longitude, height
    )
    return hypot(east, north), vertical
