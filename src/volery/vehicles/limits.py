"""Where a vehicle may go: stated limits about home, and a fence. Here: checked before a command, by straight
paths. ``bounds`` looks at them while it travels.

Everything is judged in the local frame about home: metres east, north and up of it.

Limits and fence while a vehicle travels: what it has strayed out of, by its own estimate.

What counts is more than a stop may overshoot and an estimate may wander: ``TOLERANCE_M`` metres beyond.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import hypot, inf, isfinite, sqrt
from typing import NamedTuple

from shapely import LineString, Point, Polygon, get_parts, make_valid, prepare
from shapely.geometry.base import BaseGeometry

from volery.base.errors import LowBattery, OutOfBounds, UsageError, VehicleError
from volery.base.frames import LocalFrame, Vector
from volery.base.position import AMSL, AboveHome, Altitude, Position
from volery.base.time import Ns, S
from volery.vehicles.telemetry import Telemetry

Corner = tuple[float, float]
"""Latitude and longitude in degrees."""


@dataclass(frozen=True)
class Limits:
    """How far and how high, in metres about home; and how much of the battery is kept, 0..1.

    ``highest`` is the 120 m above ground to which drones may fly without a permit in the EU and much of the
    world. ``lowest`` leaves 2 m for the error of an estimate: where a goal is lower than home, state it.
    Below ``battery_reserve`` nothing but the way down or home is begun; 0 is no reserve.
    """

    farthest: float = 10_000.0
    highest: float = 120.0
    lowest: float = -2.0
    battery_reserve: float = 0.0

    def __post_init__(self) -> None:
        if not (self.farthest > 0 and self.highest > self.lowest):
            raise UsageError(f"{self} leaves no room to fly: farthest > 0 and highest > lowest")
        if not 0.0 <= self.battery_reserve < 1.0:
            raise UsageError(
                f"battery_reserve={self.battery_reserve:g}: give a share from 0 to below 1, as 0.2"
            )


@dataclass(frozen=True)
class Zone:
    """An area over which nothing may fly between ``floor`` and ``ceiling``; without these at any height.

    ``corners`` are at least three (latitude, longitude) in degrees, in order around it.
    """

    name: str
    corners: tuple[Corner, ...]
    floor: Altitude | None = None
    ceiling: Altitude | None = None

    def __post_init__(self) -> None:
        _check_corners(f"zone {self.name!r}", self.corners)
        _check_heights(f"zone {self.name!r}", self.floor, self.ceiling)


@dataclass(frozen=True)
class Fence:
    """Stay inside ``polygon`` (if it is given), between floor and ceiling, and out of every no-fly zone."""

    polygon: tuple[Corner, ...] = ()
    floor: Altitude | None = None
    ceiling: Altitude | None = None
    no_fly: tuple[Zone, ...] = ()

    def __post_init__(self) -> None:
        if self.polygon:
            _check_corners("the fence", self.polygon)
        _check_heights("the fence", self.floor, self.ceiling)


def _check_corners(what: str, corners: Sequence[Corner]) -> None:
    if len(corners) < 3:
        raise UsageError(f"{what} has {len(corners)} corners; it takes at least 3")
    for latitude, longitude in corners:
        Position(latitude, longitude, AMSL(0.0))


def _check_heights(what: str, low: Altitude | None, high: Altitude | None) -> None:
    for height in (low, high):
        if height is not None and not isinstance(height, AMSL | AboveHome):
            raise UsageError(f"{what}: {height} cannot be compared; give AMSL or AboveHome")
    if low is not None and high is not None and type(low) is type(high) and low.metres >= high.metres:
        raise UsageError(f"{what}: its floor of {low} is not below its ceiling of {high}")


class HomeFrame(NamedTuple):
    """Home, and the local frame about it."""

    amsl: float
    frame: LocalFrame

    @classmethod
    def at(cls, position: Position) -> HomeFrame:
        """*position* has an AMSL altitude."""
        amsl = position.altitude.metres
        return cls(amsl, LocalFrame(position.latitude, position.longitude, amsl))

    def above(self, altitude: Altitude) -> float | None:
        """Metres above home; ``None`` for kinds that take more than home to convert."""
        if isinstance(altitude, AboveHome):
            return altitude.metres
        if isinstance(altitude, AMSL):
            return altitude.metres - self.amsl
        return None

    def local(self, position: Position) -> Vector:
        """East, north of home and metres above home. Up is the stated altitude's, not the tangent plane's.

        Of an altitude of another kind the metres are taken as they are: the best guess without terrain.
        """
        up = self.above(position.altitude)
        height = position.altitude.metres if up is None else up
        east, north, _ = self.frame.to_enu(position.latitude, position.longitude, self.amsl + height)
        return east, north, height


def path_violation(
    start: Position, goal: Position, home: Position, limits: Limits, fence: Fence | None
) -> str:
    """Why one must not go straight from *start* to *goal*; empty if one may. *start*, *home* are AMSL."""
    about = HomeFrame.at(home)
    there = about.local(goal)
    found = _beyond_limits(goal, there, about, limits)
    if not found and fence is not None:
        found = _beyond_fence((about.local(start), there), about, fence)
    return found


def home_violation(fence: Fence, home: Position) -> str:
    """Why nobody could start from *home* (AMSL) within the fence; empty if one can.

    The floor does not count: it is for the flight, and crossed on the way up and down.
    """
    about = HomeFrame.at(home)
    if fence.polygon and not area_of(fence.polygon, about).covers(Point(0.0, 0.0)):
        return f"home ({home}) is outside the fence's polygon{_swapped(fence.polygon, about)}"
    if band_of(fence.floor, fence.ceiling, about)[1] <= 0.0:
        return f"home ({home}) is not below the fence's ceiling of {fence.ceiling}"
    for zone in fence.no_fly:
        low, high = band_of(zone.floor, zone.ceiling, about)
        if low <= 0.0 <= high and area_of(zone.corners, about).contains(Point(0.0, 0.0)):
            return f"home ({home}) is in the no-fly zone {zone.name!r}"
    return ""


def _swapped(corners: Sequence[Corner], home: HomeFrame) -> str:
    """The usual reason: longitude before latitude."""
    if any(abs(longitude) > 90.0 for _, longitude in corners):
        return ""
    turned = tuple((longitude, latitude) for latitude, longitude in corners)
    inside = area_of(turned, home).covers(Point(0.0, 0.0))
    return "; corners are (latitude, longitude): are they swapped?" if inside else ""


def height_violation(height: float, limits: Limits, home: Position | None = None) -> str:
    """Why *height* metres above home is out of bounds; with the hint for one who meant AMSL. Else empty."""
    if height <= limits.highest:
        return ""
    hint = ""
    if home is None:
        hint = "; heights count from home, not from the sea"
    elif limits.lowest <= height - home.altitude.metres <= limits.highest:
        hint = f"; did you mean AMSL({height:g})? Home is {home.altitude.metres:g} m AMSL"
    return f"{height:g} m above home asked, but the limit is {limits.highest:g} m (Limits.highest){hint}"


def _beyond_limits(goal: Position, there: Vector, home: HomeFrame, limits: Limits) -> str:
    far = hypot(there[0], there[1])
    if far > limits.farthest:
        return (
            f"{goal} is {far / 1000:.1f} km from home, but the limit is "
            f"{limits.farthest / 1000:g} km (Limits.farthest)"
        )
    up = there[2]
    if up < limits.lowest:
        return (
            f"{goal} is {-up:.1f} m below home, underground as far as is known; the limit is "
            f"{-limits.lowest:g} m below (Limits.lowest){_home_hint(goal, home, limits)}"
        )
    if isinstance(goal.altitude, AboveHome):
        return height_violation(
            up, limits, Position(home.frame.latitude, home.frame.longitude, AMSL(home.amsl))
        )
    if up > limits.highest:
        return f"{goal} is {up:.1f} m above home, but the limit is {limits.highest:g} m (Limits.highest)"
    return ""


def _home_hint(goal: Position, home: HomeFrame, limits: Limits) -> str:
    if isinstance(goal.altitude, AMSL) and 0.0 <= goal.altitude.metres <= limits.highest:
        height = goal.altitude.metres
        return f"; did you mean AboveHome({height:g})? Home is {home.amsl:g} m AMSL"
    return ""


# -- areas, in metres about home

Segment = tuple[Vector, Vector]


def _beyond_fence(path: Segment, home: HomeFrame, fence: Fence) -> str:
    if fence.polygon:
        area, (start, goal) = area_of(fence.polygon, home), path
        if not area.covers(Point(goal[:2])):
            return "the goal is outside the fence"
        if area.covers(Point(start[:2])) and not area.covers(_track(path)):
            return "the straight way there leaves the fence"
    low, high = band_of(fence.floor, fence.ceiling, home)
    if path[1][2] < low:
        return f"the goal is below the fence's floor of {fence.floor}"
    if path[1][2] > high:
        return f"the goal is above the fence's ceiling of {fence.ceiling}"
    for zone in fence.no_fly:
        if _passes(path, zone, home):
            return f"the straight way there leads through the no-fly zone {zone.name!r}"
    return ""


def band_of(floor: Altitude | None, ceiling: Altitude | None, home: HomeFrame) -> tuple[float, float]:
    """Metres above home from, to; infinite where not stated."""
    low = None if floor is None else home.above(floor)
    high = None if ceiling is None else home.above(ceiling)
    return (-inf if low is None else low, inf if high is None else high)


def area_of(corners: Sequence[Corner], home: HomeFrame) -> BaseGeometry:
    """What the corners enclose; both halves of an outline that crosses itself."""
    outline = Polygon([home.local(Position(*corner, AMSL(home.amsl)))[:2] for corner in corners])
    return make_valid(outline, method="structure", keep_collapsed=False)


def _track(path: Segment) -> BaseGeometry:
    """The path seen from above."""
    start, end = path[0][:2], path[1][:2]
    return Point(start) if start == end else LineString([start, end])


def _passes(path: Segment, zone: Zone, home: HomeFrame) -> bool:
    """The path leads through the zone. Straight out of one in which it starts, it may go."""
    part = _clipped(path, *band_of(zone.floor, zone.ceiling, home))
    if part is None:
        return False
    area, track = area_of(zone.corners, home), _track(part)
    if not area.intersects(track) or area.touches(track):
        return False
    starts_inside = part[0] == path[0] and area.contains(Point(part[0][:2]))
    if not starts_inside or area.contains(Point(part[1][:2])):
        return True
    stretches = [piece for piece in get_parts(area.intersection(track)) if piece.length > 0.0]
    return len(stretches) > 1


def _clipped(path: Segment, low: float, high: float) -> Segment | None:
    """The part of *path* between two heights; ``None`` if there is none."""
    start, end = path
    rise = end[2] - start[2]
    if abs(rise) < 1e-9:
        return path if low <= start[2] <= high else None
    shares = sorted(((low - start[2]) / rise, (high - start[2]) / rise))
    first, last = max(0.0, shares[0]), min(1.0, shares[1])
    if first > last:
        return None
    return _along(path, first), _along(path, last)


def _along(path: Segment, share: float) -> Vector:
    if share in {0.0, 1.0}:
        return path[int(share)]
    (x0, y0, z0), (x1, y1, z1) = path
    return x0 + share * (x1 - x0), y0 + share * (y1 - y0), z0 + share * (z1 - z0)


TOLERANCE_M = 3.0
"""Metres: the error of a usual GPS receiver, and what a multirotor overshoots when it stops."""

LOW_FOR: Ns = 3 * S
"""So long it must be below the reserve: a voltage that sags when the motors pull comes back."""


class Bounds:
    """Limits and fence about one *home* (AMSL), made ready for being looked at often."""

    def __init__(self, home: Position, limits: Limits, fence: Fence | None) -> None:
        self.home = home
        self._about = about = HomeFrame.at(home)
        self._limits = limits
        self._fence = fence = fence or Fence()
        self._polygon = _prepared(area_of(fence.polygon, about)) if fence.polygon else None
        self._band = band_of(fence.floor, fence.ceiling, about)
        self._zones = [
            (
                zone.name,
                _prepared(
                    area_of(zone.corners, about).buffer(-_zone_tolerance(area_of(zone.corners, about)))
                ),
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
        if far > limits.farthest + TOLERANCE_M:
            found["farthest"] = f"it is {far:.0f} m from home, beyond {limits.farthest:g} m (Limits.farthest)"
        if up > limits.highest + TOLERANCE_M:
            found["highest"] = f"it is {up:.1f} m above home, beyond {limits.highest:g} m (Limits.highest)"
        if up < limits.lowest - TOLERANCE_M:
            found["lowest"] = f"it is {-up:.1f} m below home, beyond {-limits.lowest:g} m (Limits.lowest)"

    def _beyond_fence(self, found: dict[str, str], there: Point, up: float) -> None:
        if self._polygon is not None and not self._polygon.contains(there):
            off = float(self._polygon.distance(there))
            if off > TOLERANCE_M:
                found["polygon"] = f"it is {off:.0f} m outside the fence"
        low, high = self._band
        if up > high + TOLERANCE_M:
            found["ceiling"] = f"it is {up - high:.1f} m above the fence's ceiling of {self._fence.ceiling}"
        if up < low - TOLERANCE_M:
            found[FLOOR] = f"it is {low - up:.1f} m below the fence's floor of {self._fence.floor}"


FLOOR = "floor"
"""What an operation that ends on the ground is excused from."""


def _prepared(area: BaseGeometry) -> BaseGeometry:
    prepare(area)
    return area


def _zone_tolerance(area: BaseGeometry) -> float:
    """A zone is entered well inside it; a small one nearer to its edge."""
    return min(TOLERANCE_M, sqrt(float(area.area)) / 4.0)


class BoundsMonitor:
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
