"""Missions that the autopilot flies by itself: items in order, uploaded before the start."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, nan

from volery.base.position import Position


@dataclass(frozen=True)
class TakeOff:
    """Climb to ``height`` metres above home."""

    height: float


@dataclass(frozen=True)
class Waypoint:
    """Fly to a position and stay there.

    Args:
        position: where to fly.
        stay_s: time to stay, s.
        heading: heading in degrees clockwise from north; NaN means any.
    """

    position: Position
    stay_s: float = 0.0
    heading: float = nan


@dataclass(frozen=True)
class ChangeSpeed:
    """Fly at ``speed`` m/s over ground from this item on."""

    speed: float


@dataclass(frozen=True)
class Land:
    """Land at ``position``, or in place if there is none."""

    position: Position | None = None


@dataclass(frozen=True)
class ReturnHome:
    """Return home and land."""


MissionItem = TakeOff | Waypoint | ChangeSpeed | Land | ReturnHome


def item_problem(item: MissionItem) -> str:
    """Return which number of *item* is out of range, and the remedy; empty if all are valid."""
    if isinstance(item, ChangeSpeed) and not (isfinite(item.speed) and item.speed > 0):
        return f"a speed of {item.speed:g} m/s; give one above 0"
    if isinstance(item, TakeOff) and not (isfinite(item.height) and item.height > 0):
        return f"a height of {item.height:g} m; give one above 0"
    if isinstance(item, Waypoint) and not (isfinite(item.stay_s) and item.stay_s >= 0):
        return f"a stay of {item.stay_s:g} s; give 0 or more"
    return ""
