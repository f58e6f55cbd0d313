"""A mission that is flown by the autopilot itself: items in order, uploaded before it starts."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan

from volery.base.position import Position


@dataclass(frozen=True)
class TakeOff:
    """Climb to ``height`` metres above home."""

    height: float


@dataclass(frozen=True)
class Waypoint:
    """Fly to ``position``, stay ``stay_s`` seconds; heading in degrees clockwise from north, or NaN for
    any.
    """

    position: Position
    stay_s: float = 0.0
    heading: float = nan


@dataclass(frozen=True)
class ChangeSpeed:
    """From here on ``speed`` m/s over ground."""

    speed: float


@dataclass(frozen=True)
class Land:
    """Land here, or where ``position`` says."""

    position: Position | None = None


@dataclass(frozen=True)
class ReturnHome:
    """Return home and land."""


MissionItem = TakeOff | Waypoint | ChangeSpeed | Land | ReturnHome
