"""What a vehicle has strayed out of while it travels."""

from __future__ import annotations

from math import hypot
from typing import Any

import pytest

from volery.base.errors import OutOfBounds, UsageError
from volery.base.frames import HomeFrame, LocalFrame, Vector
from volery.base.position import AMSL, AboveHome, Position
from volery.kernel.virtual import VirtualKernel
from volery.vehicles import Fence, Limits, Zone
from volery.vehicles.limits import FLOOR, Bounds
from volery.vehicles.monitors import BoundsMonitor
from volery.vehicles.telemetry import Telemetry

HOME = Position(46.0825, -103.8995, AMSL(900.0))
FRAME = LocalFrame(HOME.latitude, HOME.longitude, 900.0)


def place(east: float, north: float, up: float = 10.0) -> Position:
    latitude, longitude, _ = FRAME.from_enu((east, north, 0.0))
    return Position(latitude, longitude, AMSL(900.0 + up))


def square(half: float, east: float = 0.0) -> tuple[tuple[float, float], ...]:
    corners = ((-half, -half), (half, -half), (half, half), (-half, half))
    found = (place(east + x, y) for x, y in corners)
    return tuple((one.latitude, one.longitude) for one in found)


FENCED = Fence(square(50.0), AboveHome(5.0), AboveHome(40.0), (Zone("mast", square(10.0, 30.0)),))


@pytest.mark.parametrize(
    ("where", "keys"),
    [
        (place(0, 0), []),
        (place(0, 52), []),  # on the way to a stop
        (place(0, 60), ["polygon"]),
        (place(0, 0, 42), []),
        (place(0, 0, 45), ["ceiling"]),
        (place(0, 0, 1), [FLOOR]),
        (place(0, 0, 130), ["highest", "ceiling"]),
        (place(0, 0, -7), ["lowest", FLOOR]),
        (place(31, 0), ["zone mast"]),
        (place(21, 0), []),  # at its edge
        (place(0, 300), ["farthest", "polygon"]),
    ],
)
def test_what_it_is_out_of(where: Position, keys: list[str]) -> None:
    assert list(Bounds(HomeFrame(HOME), Limits(farthest=200.0), FENCED).violations(where)) == keys


def test_a_small_zone_is_not_overlooked() -> None:
    fence = Fence(no_fly=(Zone("post", square(1.0)),))
    assert list(Bounds(HomeFrame(HOME), Limits(), fence).violations(place(0, 0))) == ["zone post"]


def telemetry(where: Position) -> Telemetry:
    seen = Telemetry(VirtualKernel(), "craft_1")
    seen.position = where
    return seen


def test_who_is_outside_may_come_back_but_not_leave_again() -> None:
    seen = telemetry(place(0, 80))
    watch = BoundsMonitor(seen, Bounds(HomeFrame(HOME), Limits(), FENCED))
    for north in (70, 60, 10):
        seen.update_position(place(0, north))
        assert watch.check("go", 0) is None
    seen.update_position(place(0, 60))
    error = watch.check("go", 0)
    assert isinstance(error, OutOfBounds)
    assert "10 m outside the fence" in str(error)


def test_the_floor_is_crossed_on_the_way_up_and_may_be_excused() -> None:
    for excused, expected in ((frozenset[str](), True), (frozenset({FLOOR}), False)):
        seen = telemetry(place(0, 0, 0))
        watch = BoundsMonitor(seen, Bounds(HomeFrame(HOME), Limits(), FENCED), excused)
        for up in (0.5, 20.0):
            seen.update_position(place(0, 0, up))
            assert watch.check("up", 0) is None
        seen.update_position(place(0, 0, 1.0))
        assert (watch.check("down", 0) is not None) is expected


@pytest.mark.parametrize(
    ("fence", "says"),
    [
        (FENCED, ""),  # its floor is above home: that is crossed on the way up
        (Fence(square(50.0, 100.0)), "outside the fence's polygon"),
        (Fence(ceiling=AMSL(880.0)), "not below the fence's ceiling of 880 m AMSL"),
        (Fence(no_fly=(Zone("park", square(20.0)),)), "in the no-fly zone 'park'"),
        (Fence(no_fly=(Zone("approach", square(20.0), AboveHome(30.0)),)), ""),
    ],
)
def test_a_fence_that_excludes_home(fence: Fence, says: str) -> None:
    found = Bounds(HomeFrame(HOME), Limits(), fence).home_violation
    assert (says in found) if says else found == ""


def test_swapped_corners_are_recognised() -> None:
    home = Position(46.0, 7.0, AMSL(900.0))
    turned = ((6.9, 45.9), (7.1, 45.9), (7.1, 46.1), (6.9, 46.1))
    assert "are they swapped?" in Bounds(HomeFrame(home), Limits(), Fence(turned)).home_violation


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Limits(battery_reserve=20), "a share from 0 to below 1"),
        (lambda: Limits(battery_reserve=float("nan")), "a share from 0 to below 1"),
        (lambda: Limits(highest=float("nan")), "no room to fly"),
        (lambda: Fence(floor=AboveHome(30), ceiling=AboveHome(10)), "not below its ceiling"),
        (lambda: Fence(((0.0, 0.0), (1.0, 1.0))), "2 corners; it takes at least 3"),
        (lambda: Fence(((float("nan"), 0.0), (1.0, 1.0), (1.0, 0.0))), "off the globe"),
    ],
)
def test_bounds_that_make_no_sense(make: Any, says: str) -> None:
    with pytest.raises(UsageError, match=says):
        make()


def test_one_report_of_a_position_is_converted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    converted: list[float] = []
    to_enu = LocalFrame.to_enu

    def counted(frame: LocalFrame, latitude: float, longitude: float, amsl: float) -> Vector:
        converted.append(latitude)
        return to_enu(frame, latitude, longitude, amsl)

    bounds, here, goal = Bounds(HomeFrame(HOME), Limits(farthest=50.0), None), place(0, 60), place(0, 40)
    monkeypatch.setattr(LocalFrame, "to_enu", counted)
    start, end = bounds.path(here, goal)
    assert list(bounds.violations(here)) == ["farthest"]
    assert (start[1], end[1]) == (pytest.approx(60.0, abs=0.01), pytest.approx(40.0, abs=0.01))
    assert sorted(converted) == sorted([here.latitude, goal.latitude])
    assert not bounds.violations(place(0, 40))
    assert len(converted) == 3


def test_what_is_exactly_at_a_limit_is_within_it() -> None:
    goal = place(30, 40)
    east, north, up = HomeFrame(HOME).local(goal)
    distance = hypot(east, north)
    bounds = Bounds(HomeFrame(HOME), Limits(farthest=distance, highest=up), None)
    assert bounds.path_violation(((0.0, 0.0, 1.0), (east, north, up)), goal) == ""
    assert "0.9 km from home, but the limit is 0.8 km" in Bounds(
        HomeFrame(HOME), Limits(farthest=800.0), None
    ).path_violation(((0.0, 0.0, 1.0), (900.0, 0.0, 1.0)), goal)
