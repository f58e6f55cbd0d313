"""Where a vehicle may go: stated limits about home, and a fence. Here: checked before a command, by straight
paths. ``bounds`` looks at them while it travels.

Everything is judged in the local frame about home: metres east, north and up of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, inf
from typing import NamedTuple

from shapely import LineString, Point, Polygon, get_parts, make_valid
from shapely.geometry.base import BaseGeometry

from volery.base.errors import UsageError
from volery.base.frames import LocalFrame, Vector
from volery.base.position import AMSL, AboveHome, Altitude, Position

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


class Home(NamedTuple):
    """Home, and the local frame about it."""

    amsl: float
    frame: LocalFrame

    @classmethod
    def at(cls, position: Position) -> Home:
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


def violation(start: Position, goal: Position, home: Position, limits: Limits, fence: Fence | None) -> str:
    """Why one must not go straight from *start* to *goal*; empty if one may. *start*, *home* are AMSL."""
    about = Home.at(home)
    there = about.local(goal)
    found = _beyond_limits(goal, there, about, limits)
    if not found and fence is not None:
        found = _beyond_fence((about.local(start), there), about, fence)
    return found


def excludes_home(fence: Fence, home: Position) -> str:
    """Why nobody could start from *home* (AMSL) within the fence; empty if one can.

    The floor does not count: it is for the flight, and crossed on the way up and down.
    """
    about = Home.at(home)
    if fence.polygon and not area_of(fence.polygon, about).covers(Point(0.0, 0.0)):
        return f"home ({home}) is outside the fence's polygon{_swapped(fence.polygon, about)}"
    if band_of(fence.floor, fence.ceiling, about)[1] <= 0.0:
        return f"home ({home}) is not below the fence's ceiling of {fence.ceiling}"
    for zone in fence.no_fly:
        low, high = band_of(zone.floor, zone.ceiling, about)
        if low <= 0.0 <= high and area_of(zone.corners, about).contains(Point(0.0, 0.0)):
            return f"home ({home}) is in the no-fly zone {zone.name!r}"
    return ""


def _swapped(corners: Sequence[Corner], home: Home) -> str:
    """The usual reason: longitude before latitude."""
    if any(abs(longitude) > 90.0 for _, longitude in corners):
        return ""
    turned = tuple((longitude, latitude) for latitude, longitude in corners)
    inside = area_of(turned, home).covers(Point(0.0, 0.0))
    return "; corners are (latitude, longitude): are they swapped?" if inside else ""


def too_high(height: float, limits: Limits, home: Position | None = None) -> str:
    """Why *height* metres above home is out of bounds; with the hint for one who meant AMSL. Else empty."""
    if height <= limits.highest:
        return ""
    hint = ""
    if home is None:
        hint = "; heights count from home, not from the sea"
    elif limits.lowest <= height - home.altitude.metres <= limits.highest:
        hint = f"; did you mean AMSL({height:g})? Home is {home.altitude.metres:g} m AMSL"
    return f"{height:g} m above home asked, but the limit is {limits.highest:g} m (Limits.highest){hint}"


def _beyond_limits(goal: Position, there: Vector, home: Home, limits: Limits) -> str:
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
        return too_high(up, limits, Position(home.frame.latitude, home.frame.longitude, AMSL(home.amsl)))
    if up > limits.highest:
        return f"{goal} is {up:.1f} m above home, but the limit is {limits.highest:g} m (Limits.highest)"
    return ""


def _home_hint(goal: Position, home: Home, limits: Limits) -> str:
    if isinstance(goal.altitude, AMSL) and 0.0 <= goal.altitude.metres <= limits.highest:
        height = goal.altitude.metres
        return f"; did you mean AboveHome({height:g})? Home is {home.amsl:g} m AMSL"
    return ""


# -- areas, in metres about home

Segment = tuple[Vector, Vector]


def _beyond_fence(path: Segment, home: Home, fence: Fence) -> str:
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


def band_of(floor: Altitude | None, ceiling: Altitude | None, home: Home) -> tuple[float, float]:
    """Metres above home from, to; infinite where not stated."""
    low = None if floor is None else home.above(floor)
    high = None if ceiling is None else home.above(ceiling)
    return (-inf if low is None else low, inf if high is None else high)


def area_of(corners: Sequence[Corner], home: Home) -> BaseGeometry:
    """What the corners enclose; both halves of an outline that crosses itself."""
    outline = Polygon([home.local(Position(*corner, AMSL(home.amsl)))[:2] for corner in corners])
    return make_valid(outline, method="structure", keep_collapsed=False)


def _track(path: Segment) -> BaseGeometry:
    """The path seen from above."""
    start, end = path[0][:2], path[1][:2]
    return Point(start) if start == end else LineString([start, end])


def _passes(path: Segment, zone: Zone, home: Home) -> bool:
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
