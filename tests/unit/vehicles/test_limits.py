from __future__ import annotations

from dataclasses import FrozenInstanceError

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from volery.base.errors import UsageError
from volery.base.frames import HomeFrame, LocalFrame
from volery.base.position import AMSL, AboveGround, AboveHome, Ellipsoidal, Position
from volery.vehicles.limits import Bounds, Fence, Limits, Zone, height_violation

HOME = Position(46.0828, -103.8990, AMSL(900.0))
FRAME = LocalFrame(HOME.latitude, HOME.longitude, 900.0)


def at(east: float, north: float, up: float = 10.0) -> Position:
    latitude, longitude, _ = FRAME.from_enu((east, north, up))
    return Position(latitude, longitude, AMSL(900.0 + up))


def corners(*points: tuple[float, float]) -> tuple[tuple[float, float], ...]:
    return tuple((at(*point).latitude, at(*point).longitude) for point in points)


SQUARE = corners((-50, 20), (50, 20), (50, 120), (-50, 120))


def check(start: Position, goal: Position, fence: Fence | None = None, limits: Limits | None = None) -> str:
    bounds = Bounds(HomeFrame(HOME), limits or Limits(), fence)
    return bounds.path_violation(bounds.path(start, goal), goal)


def test_within_everything() -> None:
    assert check(at(0, 0), at(100, 100)) == ""


def test_limits_about_home() -> None:
    assert "10.1 km from home" in check(at(0, 0), at(0, 10_100))
    assert check(at(0, 0), at(0, 10_100), limits=Limits(farthest=11_000)) == ""
    assert "underground" in check(at(0, 0), at(0, 10, -3))
    assert check(at(0, 0), at(0, 10, -3), limits=Limits(lowest=-50)) == ""
    assert "121.0 m above home" in check(at(0, 0), at(0, 10, 121))
    assert "150.0 m above home" in check(at(0, 0), Position(46.083, -103.899, AboveGround(150)))


def test_hints_for_who_mixed_up_altitudes() -> None:
    mixed = Position(46.083, -103.899, AboveHome(940))
    assert "did you mean AMSL(940)? Home is 900 m AMSL" in check(at(0, 0), mixed)
    assert "did you mean AboveHome(40)?" in check(at(0, 0), Position(46.083, -103.899, AMSL(40)))
    assert "did you mean" not in height_violation(5000.0, Limits(), HOME)
    assert "did you mean" not in height_violation(940.0, Limits())


def test_a_fence_is_not_left_by_the_goal_nor_on_the_way() -> None:
    bent = Fence(polygon=corners((-10, -10), (100, -10), (100, 100), (90, 100), (90, 10), (-10, 10)))
    assert check(at(0, 0), at(95, 0), bent) == ""
    assert "outside the fence" in check(at(0, 0), at(0, 50), bent)
    assert "leaves the fence" in check(at(0, 0), at(95, 95), bent)


def test_a_fence_has_a_floor_and_a_ceiling() -> None:
    fence = Fence(floor=AboveHome(5), ceiling=AMSL(930))
    assert check(at(0, 0), at(0, 50, 20), fence) == ""
    assert "below the fence's floor of 5 m above home" in check(at(0, 0), at(0, 50, 3), fence)
    assert "above the fence's ceiling of 930 m AMSL" in check(at(0, 0), at(0, 50, 31), fence)


def test_a_zone_is_neither_entered_nor_crossed() -> None:
    fence = Fence(no_fly=(Zone("school", SQUARE),))
    assert "no-fly zone 'school'" in check(at(0, 0), at(0, 60), fence)
    assert "no-fly zone 'school'" in check(at(0, 0), at(0, 200), fence)
    assert check(at(0, 0), at(100, 0), fence) == ""
    assert "school" in check(at(-60, 10), at(60, 130), fence)  # through two of its corners


def test_a_zone_may_be_passed_above_and_left() -> None:
    fence = Fence(no_fly=(Zone("school", SQUARE, ceiling=AboveHome(30)),))
    assert check(at(0, 0, 40), at(0, 200, 40), fence) == ""
    assert "school" in check(at(0, 0, 40), at(0, 200, 10), fence)
    assert check(at(0, 10, 40), at(0, 10, 10), fence) == ""
    assert check(at(0, 60, 10), at(0, 0, 10), fence) == ""  # it starts inside, and leaves
    assert "school" in check(at(0, 60, 40), at(0, 60, 10), fence)


def test_a_zone_that_is_left_is_not_entered_again() -> None:
    outline = corners((0, 0), (30, 0), (30, 40), (20, 40), (20, 10), (10, 10), (10, 40), (0, 40))
    fence = Fence(no_fly=(Zone("school", outline),))  # a horseshoe
    assert check(at(5, 30), at(15, 30), fence) == ""
    assert "school" in check(at(5, 30), at(40, 30), fence)


def test_straight_up_in_a_zone_that_begins_higher() -> None:
    fence = Fence(no_fly=(Zone("glide path", SQUARE, floor=AboveHome(30)),))
    assert check(at(0, 60, 10), at(0, 60, 20), fence) == ""
    assert "glide path" in check(at(0, 60, 10), at(0, 60, 40), fence)


def test_both_halves_of_an_outline_that_crosses_itself_are_inside() -> None:
    bow = Fence(polygon=corners((-20, -10), (20, 10), (20, -10), (-20, 10)))
    assert check(at(-19, 0), at(-10, 2), bow) == ""
    assert check(at(19, 0), at(10, 2), bow) == ""
    assert "outside the fence" in check(at(-15, 0), at(0, 8), bow)
    assert "leaves the fence" in check(at(-18, 8), at(18, 8), bow)


def test_what_makes_no_sense_as_a_fence() -> None:
    with pytest.raises(UsageError, match="zone 'x' has 2 corners"):
        Zone("x", SQUARE[:2])
    with pytest.raises(UsageError, match="the fence has 1 corners"):
        Fence(polygon=SQUARE[:1])
    with pytest.raises(UsageError, match="cannot be compared"):
        Fence(ceiling=Ellipsoidal(900))
    with pytest.raises(UsageError, match="off the globe"):
        Zone("x", ((0, 0), (0, 1), (95, 1)))
    with pytest.raises(UsageError, match="no room to fly"):
        Limits(highest=-5)


metres = st.floats(-300, 300)


@given(metres, metres, metres, metres)
@example(-174.0, 167.0, 113.0, -173.0)  # just past a corner
def test_against_a_path_taken_in_small_steps(x0: float, y0: float, x1: float, y1: float) -> None:
    """A path is refused if one of its points is clearly inside the zone, and not if none is even near."""
    fence = Fence(no_fly=(Zone("school", SQUARE),))
    refused = bool(check(at(x0, y0), at(x1, y1), fence))
    points = [(x0 + (x1 - x0) * k / 1000, y0 + (y1 - y0) * k / 1000) for k in range(1001)]  # 85 cm at most
    depths = [min(50 - abs(x), 50 - abs(y - 70)) for x, y in points]
    starts_inside = depths[0] > 0
    if max(depths) > 0.5 and not starts_inside:
        assert refused
    if max(depths) < -0.5:
        assert not refused


@given(metres, metres)
def test_home_is_where_the_local_frame_begins(east: float, north: float) -> None:
    local = HomeFrame(HOME).local(at(east, north, 25.0))
    assert local[0] == pytest.approx(east, abs=0.01)
    assert local[1] == pytest.approx(north, abs=0.01)
    assert local[2] == pytest.approx(25.0)


def test_a_fence_with_longitude_before_latitude_is_named_only_if_that_is_the_mistake() -> None:
    home = Position(46.0, 8.0, AMSL(900.0))
    around = ((45.99, 7.99), (45.99, 8.01), (46.01, 8.01), (46.01, 7.99))
    swapped = tuple((longitude, latitude) for latitude, longitude in around)
    elsewhere = tuple((latitude + 1.0, longitude) for latitude, longitude in around)
    hints = {}
    for name, polygon in (("swapped", swapped), ("elsewhere", elsewhere)):
        said = Bounds(HomeFrame(home), Limits(), Fence(polygon)).home_violation
        assert "outside the fence's polygon" in said
        hints[name] = "are they swapped?" in said
    assert hints == {"swapped": True, "elsewhere": False}
    beyond = tuple((latitude, longitude + 82.5) for latitude, longitude in around)  # no latitude if swapped
    assert "are they swapped?" not in Bounds(HomeFrame(home), Limits(), Fence(beyond)).home_violation


def test_limits_and_fences_do_not_change() -> None:
    for stated in (Limits(), Fence(SQUARE)):
        with pytest.raises(FrozenInstanceError):
            stated.lowest = -1000.0  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("where", "bound"),
    [
        ((0, 0, 4), ""),
        ((0, 0, 30), ""),
        ((54, 70, 10), "polygon"),
        ((52.5, 70, 10), ""),
        ((0, 70, 33.5), "ceiling"),
        ((0, 70, 32.5), ""),
        ((0, 70, 1.5), "floor"),
        ((0, 70, 2.5), ""),
        ((0, 100, 10), "zone masts"),
        ((0, 100, 20), "zone masts"),
        ((0, 100, 20.5), ""),
    ],
)
def test_bounds_in_flight_have_three_metres_of_tolerance(
    where: tuple[float, float, float], bound: str
) -> None:
    area = corners((-50, -20), (50, -20), (50, 120), (-50, 120))
    masts = Zone("masts", corners((-20, 90), (20, 90), (20, 110), (-20, 110)), ceiling=AboveHome(20))
    fence = Fence(polygon=area, floor=AboveHome(5), ceiling=AboveHome(30), no_fly=(masts,))
    assert list(Bounds(HomeFrame(HOME), Limits(), fence).violations(at(*where))) == ([bound] if bound else [])


@pytest.mark.parametrize(
    ("where", "bound"),
    [
        ((0, 202.5, 10), ""),
        ((0, 203.5, 10), "farthest"),
        ((0, 0, 52.5), ""),
        ((0, 0, 53.5), "highest"),
        ((0, 0, -12.5), ""),
        ((0, 0, -13.5), "lowest"),
    ],
)
def test_limits_in_flight_have_three_metres_of_tolerance(
    where: tuple[float, float, float], bound: str
) -> None:
    limits = Limits(farthest=200.0, highest=50.0, lowest=-10.0)
    assert list(Bounds(HomeFrame(HOME), limits, None).violations(at(*where))) == ([bound] if bound else [])


def test_home_is_below_the_ceiling_and_outside_the_zones_or_no_flight_starts() -> None:
    around = corners((-20, -20), (20, -20), (20, 20), (-20, 20))
    for ceiling, low, high, said in (
        (AMSL(900.0), 50, 60, "is not below the fence's ceiling"),
        (AMSL(901.0), 0, 60, "is in the no-fly zone 'here'"),
        (AMSL(901.0), 1, 60, ""),
        (AMSL(901.0), -9, 0, "is in the no-fly zone 'here'"),
    ):
        zone = Zone("here", around, floor=AMSL(900.0 + low), ceiling=AMSL(900.0 + high))
        bounds = Bounds(HomeFrame(HOME), Limits(), Fence(ceiling=ceiling, no_fly=(zone,)))
        assert said in bounds.home_violation
        assert bool(said) == bool(bounds.home_violation)


def test_a_slanted_path_meets_a_zone_only_between_its_floor_and_its_ceiling() -> None:
    high = Zone("high", corners((40, -10), (60, -10), (60, 10), (40, 10)), floor=AboveHome(40))
    fence = Fence(no_fly=(high,))
    assert "no-fly zone 'high'" in check(at(0, 0, 0), at(100, 0, 90), fence)
    assert "no-fly zone 'high'" in check(at(100, 0, 90), at(0, 0, 0), fence)
    assert check(at(0, 0, 0), at(100, 0, 60), fence) == ""  # 24 to 36 m
