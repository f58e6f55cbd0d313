"""Where a vehicle may go: limits about home, a fence, and the checks of both before and during an operation.

All checks use the local frame about home (``HomeFrame``). ``Bounds`` computes the areas of the fence in it
once for one home, because every command and every position report is checked. A goal is checked along the
straight path before anything is sent; while the vehicle travels, ``monitors.BoundsMonitor`` checks each
reported position.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import hypot, inf, isfinite, sqrt
from numbers import Real
from typing import NamedTuple, TypeGuard

from shapely import LineString, Point, Polygon, get_parts, make_valid, prepare
from shapely.geometry.base import BaseGeometry

from volery.base.errors import UsageError
from volery.base.frames import HomeFrame, Vector
from volery.base.position import AMSL, AboveHome, Altitude, Position

Corner = tuple[float, float]
"""Latitude and longitude in degrees."""
Path = tuple[Vector, Vector]
"""Start and end of a straight path: metres east and north of home, metres above home."""

TOLERANCE_M = 3.0
"""A vehicle in flight may exceed a bound by this: the error of a usual GPS receiver, and the overshoot of a
multirotor when it stops.
"""
DEFAULT_RESERVE = 0.15
"""Battery reserve where none is stated and the battery is measured: PX4's threshold for a low battery."""
DEFAULT_LANDING_RESERVE = 0.02
"""Share left at touch-down: two steps of a battery that is reported in whole percent."""
FLOOR = "floor"
"""Key of the floor's violation. Operations that end on the ground ignore it."""


@dataclass(frozen=True)
class Limits:
    """Limits about home.

    Args:
        farthest: greatest horizontal distance from home, m.
        highest: greatest height above home, m. The default is the height above ground to which drones may fly
            without a permit in the EU and in many other countries.
        lowest: least height above home, m. The default leaves 2 m for the error of the estimate; state a
            lower value if a goal lies below home.
        battery_reserve: share of the battery, 0 to below 1, below which only landing, returning and holding
            are allowed. 0 means no reserve; ``None`` means 15 %, if the autopilot reports the battery at all;
            where it reports volts only, 3.6 V per lithium-polymer cell.
        landing_reserve: share of the battery, 0 to below 1, that shall be left at touch-down: a drone is
            landed where it is once the rest only suffices for the landing. 0 means never.
        off_track: greatest distance from the commanded path or place that a drone may be blown or drift, m.
        clearance: least distance from what the autopilot's range sensors measure, m. 0 means that they are
            not monitored.
    """

    farthest: float = 10_000.0
    highest: float = 120.0
    lowest: float = -2.0
    battery_reserve: float | None = None
    landing_reserve: float = DEFAULT_LANDING_RESERVE
    off_track: float = 15.0
    clearance: float = 0.0

    def __post_init__(self) -> None:
        if not (self.farthest > 0 and self.highest > self.lowest):
            raise UsageError(f"{self} leaves no room to fly: farthest > 0 and highest > lowest")
        if self.battery_reserve is not None and not 0.0 <= self.battery_reserve < 1.0:
            raise UsageError(
                f"battery_reserve={self.battery_reserve:g}: give a share from 0 to below 1, as 0.2"
            )
        if not 0.0 <= self.landing_reserve < 1.0:
            raise UsageError(
                f"landing_reserve={self.landing_reserve:g}: give a share from 0 to below 1, as 0.02"
            )
        if not self.off_track > 0.0:
            raise UsageError(f"off_track={self.off_track:g}: give metres, above 0")
        if not 0.0 <= self.clearance < inf:
            raise UsageError(f"clearance={self.clearance:g}: give metres, or 0 for none")

    @property
    def reserve(self) -> float:
        """The battery reserve, stated or by default."""
        return DEFAULT_RESERVE if self.battery_reserve is None else self.battery_reserve


def is_number(value: object) -> TypeGuard[float]:
    """Return whether *value* is a finite number, of Python or of numpy."""
    return not isinstance(value, bool) and isinstance(value, Real) and isfinite(value)


@dataclass(frozen=True)
class Zone:
    """A no-fly zone.

    Args:
        name: name used in error messages.
        corners: at least three (latitude, longitude) in degrees, in order around the zone.
        floor: lower boundary; ``None`` means without one.
        ceiling: upper boundary; ``None`` means without one.
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
    """A geofence: the vehicle stays inside the polygon, between floor and ceiling, and outside all zones.

    Args:
        polygon: corners as (latitude, longitude) in degrees; empty means no horizontal boundary.
        floor: lowest altitude, AMSL or above home.
        ceiling: highest altitude, AMSL or above home.
        no_fly: zones inside the fence that must not be entered.
    """

    polygon: tuple[Corner, ...] = ()
    floor: Altitude | None = None
    ceiling: Altitude | None = None
    no_fly: tuple[Zone, ...] = ()

    def __post_init__(self) -> None:
        if self.polygon:
            _check_corners("the fence", self.polygon)
        _check_heights("the fence", self.floor, self.ceiling)


def states_amsl(fence: Fence) -> bool:
    """Return whether a boundary of the fence or of a zone is an altitude AMSL."""
    areas: tuple[Fence | Zone, ...] = (fence, *fence.no_fly)
    return any(isinstance(height, AMSL) for area in areas for height in (area.floor, area.ceiling))


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


NO_FENCE = Fence()


class _ZoneArea(NamedTuple):
    """A no-fly zone in the local frame. ``inner`` is smaller by the tolerance of a vehicle in flight."""

    name: str
    area: BaseGeometry
    inner: BaseGeometry
    low: float
    high: float


class Bounds:
    """Limits and fence about one home, prepared for repeated checks.

    Args:
        frame: local frame about home.
        limits: limits about home.
        fence: geofence, or ``None``.
    """

    def __init__(self, frame: HomeFrame, limits: Limits, fence: Fence | None) -> None:
        self.frame, self.limits, self.fence = frame, limits, fence
        self._stated = stated = fence or NO_FENCE
        self._polygon = self._area(stated.polygon) if stated.polygon else None
        self._low, self._high = self._band(stated)
        self._zones = tuple(map(self._zone_area, stated.no_fly))
        self.home_violation = self._find_home_violation()
        """Why no flight can start at home within the fence; empty if one can."""

    def _band(self, area: Fence | Zone) -> tuple[float, float]:
        """Return floor and ceiling in metres above home; infinite where not stated."""
        low = -inf if area.floor is None else self.frame.above_home(area.floor)
        return low, inf if area.ceiling is None else self.frame.above_home(area.ceiling)

    def _area(self, corners: Sequence[Corner]) -> BaseGeometry:
        """Return the enclosed area in metres; both halves of an outline that crosses itself."""
        outline = Polygon(
            [self.frame.local(Position(*corner, self.frame.home.altitude))[:2] for corner in corners]
        )
        area = make_valid(outline, method="structure", keep_collapsed=False)
        prepare(area)
        return area

    def _zone_area(self, zone: Zone) -> _ZoneArea:
        """Return the areas of a zone; a small zone gets a smaller tolerance, or nothing would be left."""
        area = self._area(zone.corners)
        inner = area.buffer(-min(TOLERANCE_M, sqrt(float(area.area)) / 4.0))
        prepare(inner)
        return _ZoneArea(zone.name, area, inner, *self._band(zone))

    # -- home

    def _find_home_violation(self) -> str:
        """Return why no flight can start at home; the floor is crossed on the way and not checked."""
        if self._polygon is not None and not self._polygon.covers(Point(0.0, 0.0)):
            return f"home ({self.frame.home}) is outside the fence's polygon{self._hint_if_swapped()}"
        if self._high <= 0.0:
            return f"home ({self.frame.home}) is not below the fence's ceiling of {self._stated.ceiling}"
        for zone in self._zones:
            if zone.low <= 0.0 <= zone.high and zone.area.contains(Point(0.0, 0.0)):
                return f"home ({self.frame.home}) is in the no-fly zone {zone.name!r}"
        return ""

    def _hint_if_swapped(self) -> str:
        """Return a hint if the usual mistake explains the violation: longitude before latitude."""
        corners = self._stated.polygon
        if any(abs(longitude) > 90.0 for _, longitude in corners):
            return ""
        swapped = self._area([(longitude, latitude) for latitude, longitude in corners])
        inside = swapped.covers(Point(0.0, 0.0))
        return "; corners are (latitude, longitude): are they swapped?" if inside else ""

    # -- before a command

    def path(self, start: Position, goal: Position) -> Path:
        """Return the straight path from *start* to *goal* in the local frame about home."""
        end = self.frame.local(goal)
        return self.frame.local(start), end

    def path_violation(self, path: Path, goal: Position) -> str:
        """Return why the vehicle must not go along *path*, which ends at *goal*; empty if it may."""
        east, north, up = path[1]
        limits, home = self.limits, self.frame.home
        distance = hypot(east, north)
        if distance > limits.farthest:
            return (
                f"{goal} is {distance / 1000:.1f} km from home, but the limit is "
                f"{limits.farthest / 1000:g} km (Limits.farthest)"
            )
        if up < limits.lowest:
            hint = ""
            if isinstance(goal.altitude, AMSL) and 0.0 <= goal.altitude.metres <= limits.highest:
                hint = (
                    f"; did you mean AboveHome({goal.altitude.metres:g})? "
                    f"Home is {home.altitude.metres:g} m AMSL"
                )
            return (
                f"{goal} is {-up:.1f} m below home, underground as far as is known; the limit is "
                f"{-limits.lowest:g} m below (Limits.lowest){hint}"
            )
        if up > limits.highest:
            if isinstance(goal.altitude, AboveHome):
                return height_violation(up, limits, home)
            return f"{goal} is {up:.1f} m above home, but the limit is {limits.highest:g} m (Limits.highest)"
        return self._fence_violation(path) if self.fence is not None else ""

    def _fence_violation(self, path: Path) -> str:
        start, end = path
        if self._polygon is not None:
            if not self._polygon.covers(Point(end[:2])):
                return "the goal is outside the fence"
            if self._polygon.covers(Point(start[:2])) and not self._polygon.covers(_track(path)):
                return "the straight path there leaves the fence"
        if end[2] < self._low:
            return f"the goal is below the fence's floor of {self._stated.floor}"
        if end[2] > self._high:
            return f"the goal is above the fence's ceiling of {self._stated.ceiling}"
        for zone in self._zones:
            if _passes_through(path, zone):
                return f"the straight path there leads through the no-fly zone {zone.name!r}"
        return ""

    # -- while the vehicle travels

    def violations(self, position: Position) -> Mapping[str, str]:
        """Return the bounds that *position* (AMSL) violates as {name: message}."""
        east, north, up = self.frame.local(position)
        limits, found, distance = self.limits, dict[str, str](), hypot(east, north)
        if distance > limits.farthest + TOLERANCE_M:
            found["farthest"] = (
                f"it is {distance:.0f} m from home, beyond {limits.farthest:g} m (Limits.farthest)"
            )
        if up > limits.highest + TOLERANCE_M:
            found["highest"] = f"it is {up:.1f} m above home, beyond {limits.highest:g} m (Limits.highest)"
        if up < limits.lowest - TOLERANCE_M:
            found["lowest"] = f"it is {-up:.1f} m below home, beyond {-limits.lowest:g} m (Limits.lowest)"
        point = Point(east, north) if self.fence is not None else None
        if self._polygon is not None and not self._polygon.contains(point):
            outside = float(self._polygon.distance(point))
            if outside > TOLERANCE_M:
                found["polygon"] = f"it is {outside:.0f} m outside the fence"
        if up > self._high + TOLERANCE_M:
            above = up - self._high
            found["ceiling"] = f"it is {above:.1f} m above the fence's ceiling of {self._stated.ceiling}"
        if up < self._low - TOLERANCE_M:
            found[FLOOR] = f"it is {self._low - up:.1f} m below the fence's floor of {self._stated.floor}"
        for zone in self._zones:
            if zone.low <= up <= zone.high and zone.inner.contains(point):
                found[f"zone {zone.name}"] = f"it is in the no-fly zone {zone.name!r}"
        return found


def height_violation(height: float, limits: Limits, home: Position | None = None) -> str:
    """Return why *height* (m above home) is too high, with a hint if AMSL may have been meant; else empty."""
    if height <= limits.highest:
        return ""
    hint = ""
    if home is None:
        hint = "; heights count from home, not from the sea"
    elif limits.lowest <= height - home.altitude.metres <= limits.highest:
        hint = f"; did you mean AMSL({height:g})? Home is {home.altitude.metres:g} m AMSL"
    return f"{height:g} m above home asked, but the limit is {limits.highest:g} m (Limits.highest){hint}"


def _track(path: Path) -> BaseGeometry:
    """Return the horizontal projection of the path."""
    start, end = path[0][:2], path[1][:2]
    return Point(start) if start == end else LineString([start, end])


def _passes_through(path: Path, zone: _ZoneArea) -> bool:
    """Return whether the path enters the zone. A path that starts inside may leave straight."""
    part = _clipped(path, zone.low, zone.high)
    if part is None:
        return False
    track = _track(part)
    if not zone.area.intersects(track) or zone.area.touches(track):
        return False
    starts_inside = part[0] == path[0] and zone.area.contains(Point(part[0][:2]))
    if not starts_inside or zone.area.contains(Point(part[1][:2])):
        return True
    stretches = [piece for piece in get_parts(zone.area.intersection(track)) if piece.length > 0.0]
    return len(stretches) > 1


def _clipped(path: Path, low: float, high: float) -> Path | None:
    """Return the part of *path* between two heights, or ``None`` if there is none."""
    start, end = path
    rise = end[2] - start[2]
    if abs(rise) < 1e-9:
        return path if low <= start[2] <= high else None
    shares = sorted(((low - start[2]) / rise, (high - start[2]) / rise))
    first, last = max(0.0, shares[0]), min(1.0, shares[1])
    if first > last:
        return None
    return _along(path, first), _along(path, last)


def _along(path: Path, share: float) -> Vector:
    if share in {0.0, 1.0}:
        return path[int(share)]
    (x0, y0, z0), (x1, y1, z1) = path
    return x0 + share * (x1 - x0), y0 + share * (y1 - y0), z0 + share * (z1 - z0)
