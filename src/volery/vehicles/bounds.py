"""Limits and fence while a vehicle travels: what it has strayed out of, by its own estimate.

What counts is more than a stop may overshoot and an estimate may wander: ``LEEWAY`` metres beyond.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import hypot, isfinite, sqrt

from shapely import Point, prepare
from shapely.geometry.base import BaseGeometry

from volery.base.errors import LowBattery, OutOfBounds, VehicleError
from volery.base.position import Position
from volery.base.time import Ns, S
from volery.vehicles.limits import Fence, Home, Limits, area_of, band_of
from volery.vehicles.telemetry import Telemetry

LEEWAY = 3.0
"""Metres: the error of a usual GPS receiver, and what a multirotor overshoots when it stops."""

LOW_FOR: Ns = 3 * S
"""So long it must be below the reserve: a voltage that sags when the motors pull comes back."""


class Bounds:
    """Limits and fence about one *home* (AMSL), made ready for being looked at often."""

    def __init__(self, home: Position, limits: Limits, fence: Fence | None) -> None:
        self.home = home
        self._about = about = Home.at(home)
        self._limits = limits
        self._fence = fence = fence or Fence()
        self._polygon = _prepared(area_of(fence.polygon, about)) if fence.polygon else None
        self._band = band_of(fence.floor, fence.ceiling, about)
        self._zones = [
            (
                zone.name,
                _prepared(area_of(zone.corners, about).buffer(-_leeway(area_of(zone.corners, about)))),
                band_of(zone.floor, zone.ceiling, about),
            )
            for zone in fence.no_fly
        ]

    def left(self, position: Position) -> Mapping[str, str]:
        """What *position* (AMSL) is out of, by name, and in words. Empty: it is where it may be."""
        east, north, up = self._about.local(position)
        found: dict[str, str] = {}
        self._beyond_limits(found, hypot(east, north), up)
        self._beyond_fence(found, Point(east, north), up)
        for name, area, (low, high) in self._zones:
            if low <= up <= high and area.contains(Point(east, north)):
                found[f"zone {name}"] = f"it is in the no-fly zone {name!r}"
        return found

    def _beyond_limits(self, found: dict[str, str], far: float, up: float) -> None:
        limits = self._limits
        if far > limits.farthest + LEEWAY:
            found["farthest"] = f"it is {far:.0f} m from home, beyond {limits.farthest:g} m (Limits.farthest)"
        if up > limits.highest + LEEWAY:
            found["highest"] = f"it is {up:.1f} m above home, beyond {limits.highest:g} m (Limits.highest)"
        if up < limits.lowest - LEEWAY:
            found["lowest"] = f"it is {-up:.1f} m below home, beyond {-limits.lowest:g} m (Limits.lowest)"

    def _beyond_fence(self, found: dict[str, str], there: Point, up: float) -> None:
        if self._polygon is not None and not self._polygon.contains(there):
            off = float(self._polygon.distance(there))
            if off > LEEWAY:
                found["polygon"] = f"it is {off:.0f} m outside the fence"
        low, high = self._band
        if up > high + LEEWAY:
            found["ceiling"] = f"it is {up - high:.1f} m above the fence's ceiling of {self._fence.ceiling}"
        if up < low - LEEWAY:
            found[FLOOR] = f"it is {low - up:.1f} m below the fence's floor of {self._fence.floor}"


FLOOR = "floor"
"""What an operation that ends on the ground is excused from."""


def _prepared(area: BaseGeometry) -> BaseGeometry:
    prepare(area)
    return area


def _leeway(area: BaseGeometry) -> float:
    """A zone is entered well inside it; a small one nearer to its edge."""
    return min(LEEWAY, sqrt(float(area.area)) / 4.0)


class Watch:
    """One operation's eye on bounds and battery. What was wrong when it began is excused until it has been
    right once: so a vehicle that is outside may come back in.
    """

    def __init__(
        self, seen: Telemetry, bounds: Bounds | None, reserve: float, excused: frozenset[str] = frozenset()
    ) -> None:
        self._seen = seen
        self._bounds = bounds
        self._reserve = reserve
        self._always = excused
        self._looked_at: Position | None = None
        self._low_since: Ns | None = None
        here = seen.position
        at_first = bounds.left(here) if bounds is not None and here is not None else {}
        self._excused = set(at_first)

    def look(self, asked: str, now: Ns) -> VehicleError | None:
        """What ends the operation; ``None`` if nothing does."""
        return self._strayed(asked) or self._exhausted(asked, now)

    def _strayed(self, asked: str) -> OutOfBounds | None:
        here = self._seen.position
        if self._bounds is None or here is None or here is self._looked_at:
            return None
        self._looked_at = here
        left = self._bounds.left(here)
        self._excused.intersection_update(left)
        wrong = [text for key, text in left.items() if key not in self._excused and key not in self._always]
        return OutOfBounds(self._seen.name, asked, " and ".join(wrong)) if wrong else None

    def _exhausted(self, asked: str, now: Ns) -> LowBattery | None:
        remaining = self._seen.battery.remaining
        if not isfinite(remaining) or remaining >= self._reserve:
            self._low_since = None
            return None
        if self._low_since is None:
            self._low_since = now
        if now - self._low_since < LOW_FOR:
            return None
        return low_battery(self._seen.name, asked, remaining, self._reserve)


def low_battery(vehicle: str, asked: str, remaining: float, reserve: float) -> LowBattery:
    """The error, with what is still allowed."""
    what = f"the battery is at {remaining:.0%}, below the reserve of {reserve:.0%} (Limits.battery_reserve)"
    return LowBattery(vehicle, asked, f"{what}; return_home(), land() and hold() are still possible")
