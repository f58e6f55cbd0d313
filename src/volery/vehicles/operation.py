"""What an operation is measured against at its end, and the policies under which operations are allowed."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, nan
from typing import NamedTuple

from volery.base.frames import LocalFrame
from volery.base.position import Position
from volery.vehicles.limits import FLOOR


class Goal(NamedTuple):
    """Where an operation should end; NaN for a coordinate that does not matter."""

    latitude: float
    longitude: float
    amsl: float


NO_GOAL = Goal(nan, nan, nan)


@dataclass(frozen=True, kw_only=True)
class OperationPolicy:
    """When a kind of operation is allowed and what is monitored meanwhile.

    Args:
        needs_control: refuse the operation while another station has control.
        recorded: record every one; otherwise only failures (set-points come in loops).
        bounded: monitor limits and fence.
        goes_on: keep monitoring after the call has returned, until the next operation.
        travels: refuse the operation below the battery reserve.
        manual: keep the age of the last manual control.
        to_safety: brings the vehicle to safety, so it aborts the operation of another task.
        ignored: bounds that are not monitored.
    """

    needs_control: bool = True
    recorded: bool = True
    bounded: bool = False
    goes_on: bool = False
    travels: bool = False
    manual: bool = False
    to_safety: bool = False
    ignored: frozenset[str] = frozenset()


PLAIN = OperationPolicy(manual=True)
UNGUARDED = OperationPolicy(manual=True, needs_control=False)
TURN = OperationPolicy(bounded=True)
TRAVEL = OperationPolicy(bounded=True, travels=True)
FLY_MISSION = OperationPolicy(bounded=True, travels=True, ignored=frozenset({FLOOR}))
STREAM = OperationPolicy(bounded=True, travels=True, goes_on=True, recorded=False)
MANUAL = OperationPolicy(bounded=True, goes_on=True, manual=True)
TO_SAFETY = OperationPolicy(to_safety=True)
LAST_RESORT = OperationPolicy(to_safety=True, needs_control=False)


def distance_to(goal: Goal, position: Position | None) -> tuple[float, float]:
    """Return horizontal and vertical distance (m) of *position* (AMSL) from *goal*; NaN where unknown."""
    if position is None:
        return nan, nan
    height = position.altitude.metres
    vertical = abs(height - goal.amsl)
    if goal.latitude != goal.latitude:
        return nan, vertical
    frame = LocalFrame(goal.latitude, goal.longitude, height)
    east, north, _ = frame.to_enu(position.latitude, position.longitude, height)
    return hypot(east, north), vertical
