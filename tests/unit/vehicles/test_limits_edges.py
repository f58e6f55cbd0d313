"""At, just inside and just outside of each bound; what a monitor does with a position that is lost."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan
from typing import Any

import numpy as np
import pytest

from volery.base.errors import OutOfBounds, PositionLost, UsageError
from volery.base.frames import HomeFrame, LocalFrame
from volery.base.position import AMSL, AboveGround, AboveHome, Altitude, Position
from volery.base.time import S
from volery.kernel.virtual import VirtualKernel
from volery.vehicles.limits import (
    DEFAULT_LANDING_RESERVE,
    DEFAULT_RESERVE,
    Bounds,
    Fence,
    Limits,
    Zone,
    height_violation,
    is_number,
    states_amsl,
)
from volery.vehicles.monitors import BoundsMonitor
from volery.vehicles.telemetry import Telemetry

HOME = Position(46.0825, -103.8995, AMSL(900.0))
FRAME = LocalFrame(HOME.latitude, HOME.longitude, 900.0)
AT_HOME = Position(HOME.latitude, HOME.longitude, AMSL(910.0))


def place(east: float, north: float, altitude: Altitude) -> Position:
    latitude, longitude, _ = FRAME.from_enu((east, north, 0.0))
    return Position(latitude, longitude, altitude)


def square(half: float, east: float = 0.0) -> tuple[tuple[float, float], ...]:
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    found = [FRAME.from_enu((east + x * half, y * half, 0.0)) for x, y in signs]
    return tuple((latitude, longitude) for latitude, longitude, _ in found)


def above(up: float) -> Position:
    return Position(HOME.latitude, HOME.longitude, AMSL(900.0 + up))


def goal(where: Position, fence: Fence | None = None, **limits: float) -> str:
    bounds = Bounds(HomeFrame(HOME), Limits(**limits), fence)
    return bounds.path_violation(bounds.path(AT_HOME, where), where)


# -- what is stated


@pytest.mark.parametrize(
    ("stated", "says"),
    [
        ({"farthest": 0.0}, "no room to fly"),
        ({"highest": 5.0, "lowest": 5.0}, "no room to fly"),
        ({"battery_reserve": -0.01}, r"battery_reserve=-0.01: give a share from 0 to below 1, as 0.2"),
        ({"battery_reserve": 1.0}, "battery_reserve=1: "),
        ({"landing_reserve": -0.01}, "landing_reserve=-0.01: give a share from 0 to below 1, as 0.02"),
        ({"landing_reserve": 1.0}, "landing_reserve=1: "),
        ({"off_track": 0.0}, "off_track=0: give metres, above 0"),
        ({"off_track": nan}, "off_track=nan"),
    ],
)
def test_limits_out_of_range(stated: dict[str, float], says: str) -> None:
    with pytest.raises(UsageError, match=says):
        Limits(**stated)


def test_limits_at_the_end_of_their_range() -> None:
    least = Limits(
        farthest=0.1, highest=0.1, lowest=0.0, battery_reserve=0.0, landing_reserve=0.0, off_track=0.1
    )
    assert least.reserve == 0.0
    assert Limits(battery_reserve=0.99, landing_reserve=0.99).reserve == 0.99


def test_defaults_that_pages_state() -> None:
    limits = Limits()
    assert (limits.farthest, limits.highest, limits.lowest, limits.off_track) == (10_000.0, 120.0, -2.0, 15.0)
    assert (
        (limits.reserve, limits.landing_reserve) == (DEFAULT_RESERVE, DEFAULT_LANDING_RESERVE) == (0.15, 0.02)
    )
    assert (Fence().polygon, Fence().floor, Fence().ceiling, Fence().no_fly) == ((), None, None, ())


@pytest.mark.parametrize("number", [0, 1.5, -3, np.float32(2.0), np.int64(4)])
def test_numbers(number: object) -> None:
    assert is_number(number)


@pytest.mark.parametrize("other", [True, "10", None, nan, inf, 1j])
def test_no_numbers(other: object) -> None:
    assert not is_number(other)


AREAS: tuple[Callable[[Any, Any], object], ...] = (
    lambda low, high: Fence(floor=low, ceiling=high),
    lambda low, high: Zone("z", square(9), low, high),
)


@pytest.mark.parametrize("area", AREAS)
@pytest.mark.parametrize("kind", [AMSL, AboveHome])
def test_a_floor_is_below_its_ceiling(kind: Any, area: Callable[[Any, Any], object]) -> None:
    area(kind(10), kind(10.1))
    with pytest.raises(UsageError, match=r"floor of .* is not below its ceiling of"):
        area(kind(10), kind(10))
    with pytest.raises(UsageError, match="cannot be compared; give AMSL or AboveHome"):
        area(None, AboveGround(10))
    with pytest.raises(UsageError, match="cannot be compared"):
        area(AboveGround(10), kind(10))


def test_heights_of_two_kinds_are_not_compared_before_home_is_known() -> None:
    assert Fence(floor=AMSL(910), ceiling=AboveHome(40)).floor == AMSL(910)


def test_an_area_has_three_corners_on_the_globe() -> None:
    corners = square(10)
    assert len(Zone("z", corners[:3]).corners) == 3
    with pytest.raises(UsageError, match="zone 'z' has 2 corners; it takes at least 3"):
        Zone("z", corners[:2])
    with pytest.raises(UsageError):
        Zone("z", (*corners, (91.0, 0.0)))


@pytest.mark.parametrize(
    ("fence", "stated"),
    [
        (Fence(), False),
        (Fence(floor=AboveHome(1), ceiling=AboveHome(9)), False),
        (Fence(floor=AMSL(1)), True),
        (Fence(ceiling=AMSL(1)), True),
        (Fence(no_fly=(Zone("z", square(9)),)), False),
        (Fence(no_fly=(Zone("z", square(9), ceiling=AMSL(1)),)), True),
    ],
)
def test_whether_a_fence_states_altitudes_above_the_sea(fence: Fence, stated: bool) -> None:
    assert states_amsl(fence) is stated


# -- goals


@pytest.mark.parametrize(
    ("up", "says"), [(120.0, ""), (120.1, "120.1 m above home"), (-2.0, ""), (-2.1, "2.1 m below home")]
)
def test_heights_at_the_limits(up: float, says: str) -> None:
    assert says in goal(above(up))
    assert bool(goal(above(up))) is bool(says)


def test_the_hint_to_above_home_is_given_only_where_that_would_do() -> None:
    assert "did you mean AboveHome(0)? Home is 900 m AMSL" in goal(Position(46.0825, -103.8995, AMSL(0.0)))
    assert "did you mean AboveHome(120)?" in goal(Position(46.0825, -103.8995, AMSL(120.0)))
    assert "did you mean" not in goal(Position(46.0825, -103.8995, AMSL(121.0)))
    assert "did you mean" not in goal(Position(46.0825, -103.8995, AMSL(-1.0)))
    assert "did you mean" not in goal(Position(46.0825, -103.8995, AboveHome(-9.0)))


def test_the_hint_to_amsl_is_given_only_where_that_would_do() -> None:
    assert height_violation(120.0, Limits(), HOME) == ""
    assert "did you mean AMSL(898)?" in height_violation(898.0, Limits(), HOME)
    assert "did you mean AMSL(1020)?" in height_violation(1020.0, Limits(), HOME)
    assert "did you mean" not in height_violation(897.0, Limits(), HOME)
    assert "did you mean" not in height_violation(1021.0, Limits(), HOME)
    assert "heights count from home" in height_violation(121.0, Limits())


def test_a_goal_at_floor_and_ceiling_of_the_fence() -> None:
    fence = Fence(floor=AboveHome(5.0), ceiling=AMSL(940.0))
    assert goal(above(5.0), fence) == goal(above(40.0), fence) == ""
    assert goal(above(4.9), fence) == "the goal is below the fence's floor of 5 m above home"
    assert goal(above(40.1), fence) == "the goal is above the fence's ceiling of 940 m AMSL"


def test_a_goal_with_a_height_above_ground_counts_from_home() -> None:
    assert goal(place(0, 0, AboveGround(100.0))) == ""
    assert goal(place(0, 0, AboveHome(100.0))) == ""


def test_a_level_path_at_the_edges_of_a_zone() -> None:
    fence = Fence(no_fly=(Zone("mast", square(10.0, 30.0), AboveHome(20.0), AboveHome(40.0)),))
    bounds = Bounds(HomeFrame(HOME), Limits(), fence)

    def through(up: float) -> bool:
        start, end = place(0, 0, AMSL(900.0 + up)), place(60, 0, AMSL(900.0 + up))
        return bool(bounds.path_violation(bounds.path(start, end), end))

    assert [through(up) for up in (19.9, 20.0, 30.0, 40.0, 40.1)] == [False, True, True, True, False]


def test_a_rising_path_meets_a_zone_where_both_heights_agree() -> None:
    fence = Fence(no_fly=(Zone("mast", square(10.0, 30.0), AboveHome(20.0), AboveHome(40.0)),))
    bounds = Bounds(HomeFrame(HOME), Limits(), fence)

    def through(start_up: float, end_up: float) -> bool:
        start, end = place(0, 0, AMSL(900.0 + start_up)), place(60, 0, AMSL(900.0 + end_up))
        return bool(bounds.path_violation(bounds.path(start, end), end))

    assert through(10.0, 40.0)  # 20 to 30 m above the zone's ground
    assert through(60.0, 0.0)
    assert not through(0.0, 29.0)  # 19.3 m where it leaves the zone
    assert not through(38.0, 68.0)  # 48 m where it enters
    assert not through(45.0, 100.0)


# -- home


@pytest.mark.parametrize(("up", "excludes"), [(0.1, False), (0.0, True)])
def test_a_ceiling_at_the_height_of_home_excludes_it(up: float, excludes: bool) -> None:
    assert bool(Bounds(HomeFrame(HOME), Limits(), Fence(ceiling=AboveHome(up))).home_violation) is excludes


@pytest.mark.parametrize(
    ("low", "high", "excludes"),
    [(0.0, 10.0, True), (0.1, 10.0, False), (-10.0, 0.0, True), (-10.0, -0.1, False)],
)
def test_a_zone_at_home_excludes_it_at_its_height(low: float, high: float, excludes: bool) -> None:
    zone = Zone("z", square(20.0), AboveHome(low), AboveHome(high))
    assert bool(Bounds(HomeFrame(HOME), Limits(), Fence(no_fly=(zone,))).home_violation) is excludes


# -- in flight


@pytest.mark.parametrize(("up", "keys"), [(9.9, []), (10.0, ["zone z"]), (30.0, ["zone z"]), (30.1, [])])
def test_a_zone_in_flight_at_its_heights(up: float, keys: list[str]) -> None:
    fence = Fence(no_fly=(Zone("z", square(20.0), AboveHome(10.0), AboveHome(30.0)),))
    assert list(Bounds(HomeFrame(HOME), Limits(), fence).violations(above(up))) == keys


def test_what_is_said_in_flight_has_the_distances() -> None:
    fence = Fence(square(50.0), AboveHome(5.0), AboveHome(40.0))
    bounds = Bounds(HomeFrame(HOME), Limits(farthest=200.0, highest=60.0, lowest=-1.0), fence)
    high = bounds.violations(above(70.0))
    assert "70.0 m above home, beyond 60 m" in high["highest"]
    assert "30.0 m above the fence's ceiling of 40 m above home" in high["ceiling"]
    low = bounds.violations(above(-5.0))
    assert "5.0 m below home, beyond 1 m" in low["lowest"]
    assert "10.0 m below the fence's floor of 5 m above home" in low["floor"]
    assert "250 m from home, beyond 200 m" in bounds.violations(place(0, 250, AMSL(910.0)))["farthest"]


# -- the monitor


class Flown:
    """Telemetry that the test writes, and a monitor that needs a position."""

    def __init__(self, *, needed: bool = True) -> None:
        self.kernel = VirtualKernel()
        self.seen = Telemetry(self.kernel, "craft")
        self.seen.detects_silence = False
        self.seen.flying = True
        self.seen.note_message(0)
        self.seen.update_position(AT_HOME)
        self.monitor = BoundsMonitor(
            self.seen, Bounds(HomeFrame(HOME), Limits(), None), needs_position=needed
        )

    def after(self, seconds: float) -> PositionLost | None:
        error = self.monitor.check("goto", round(seconds * S))
        assert error is None or isinstance(error, PositionLost)
        return error


def test_a_position_that_is_not_reported_for_ten_seconds_is_lost() -> None:
    flown = Flown()
    assert flown.after(9.99) is None
    error = flown.after(10.0)
    assert error is not None
    assert "no position for 10 s (none is reported); land() needs none" in str(error)


def test_the_gps_or_the_estimator_is_named() -> None:
    flown = Flown()
    flown.seen.fix = "no_fix"
    assert "its GPS reports no_fix" in str(flown.after(12.0))
    flown.seen.note_estimate(True)
    flown.seen.note_estimate(False)
    assert "its estimator reports none" in str(flown.after(12.0))


def test_nothing_is_lost_where_no_position_is_needed_or_none_was_known() -> None:
    assert Flown(needed=False).after(20.0) is None
    landed = Flown()
    landed.seen.flying = False
    assert landed.after(20.0) is None
    stale = Flown()
    stale.seen.last_message_ns = -1
    assert stale.after(20.0) is None


def test_one_report_is_judged_once() -> None:
    flown = Flown()
    flown.seen.update_position(above(130.0))
    assert isinstance(flown.monitor.check("goto", 0), OutOfBounds)
    assert flown.monitor.check("goto", 0) is None


def test_without_a_home_nothing_is_out_of_bounds() -> None:
    flown = Flown()
    flown.seen.update_position(above(500.0))
    assert BoundsMonitor(flown.seen, None).check("goto", 0) is None


# -- within a metre


def outline(*points: tuple[float, float]) -> tuple[tuple[float, float], ...]:
    found = [FRAME.from_enu((east, north, 0.0)) for east, north in points]
    return tuple((latitude, longitude) for latitude, longitude, _ in found)


def home_violation(*zones: Zone, **fence: Any) -> str:
    return Bounds(HomeFrame(HOME), Limits(), Fence(no_fly=zones, **fence)).home_violation


def test_home_is_checked_to_a_fraction_of_a_metre() -> None:
    near = square(10.0, east=10.5)
    assert home_violation(Zone("z", square(0.5), ceiling=AboveHome(0.5))).endswith("in the no-fly zone 'z'")
    assert home_violation(Zone("z", square(0.5), floor=AboveHome(-0.5))).endswith("in the no-fly zone 'z'")
    assert home_violation(Zone("z", square(0.5), floor=AboveHome(0.5), ceiling=AboveHome(9))) == ""
    assert home_violation(Zone("z", square(0.5), floor=AboveHome(-9), ceiling=AboveHome(-0.5))) == ""
    assert home_violation(Zone("z", near)) == ""
    assert home_violation(polygon=square(0.5)) == ""
    assert "is outside the fence's polygon" in home_violation(polygon=near)
    assert home_violation(polygon=square(50.0), ceiling=AboveHome(0.5)) == ""
    assert "is not below" in home_violation(polygon=square(50.0), ceiling=AboveHome(-0.5))
    for east, north in ((0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)):
        beside = outline(
            *((east + x, north + y) for x, y in ((-0.4, -0.4), (0.4, -0.4), (0.4, 0.4), (-0.4, 0.4)))
        )
        assert home_violation(Zone("z", beside)) == ""
        assert "outside" in home_violation(polygon=beside)


def test_a_small_zone_has_a_tolerance_of_a_quarter_of_its_width() -> None:
    bounds = Bounds(HomeFrame(HOME), Limits(), Fence(no_fly=(Zone("z", square(2.0, east=20.0)),)))
    assert bounds.violations(place(18.9, 0.0, AMSL(910.0))) == {}
    assert list(bounds.violations(place(19.2, 0.0, AMSL(910.0)))) == ["zone z"]


def test_a_zone_that_is_left_may_not_be_grazed_by_half_a_metre() -> None:
    hook = outline((-5, -5), (5, -5), (5, 5), (20, 5), (20, -0.1), (20.5, -0.1), (20.5, 10), (-5, 10))
    fence = Fence(no_fly=(Zone("hook", hook),))
    bounds = Bounds(HomeFrame(HOME), Limits(), fence)
    out, beyond = place(12.0, 0.0, AMSL(910.0)), place(30.0, 0.0, AMSL(910.0))
    assert bounds.path_violation(bounds.path(AT_HOME, out), out) == ""
    assert "no-fly zone 'hook'" in bounds.path_violation(bounds.path(AT_HOME, beyond), beyond)


def test_what_is_violated_at_the_start_counts_once_it_has_been_met() -> None:
    telemetry = Telemetry(VirtualKernel(), "craft")
    bounds = Bounds(HomeFrame(HOME), Limits(highest=50.0), None)
    telemetry.position = above(60.0)
    monitor = BoundsMonitor(telemetry, bounds)
    seen = []
    for up in (61.0, 52.0, 40.0, 60.0):
        telemetry.position = above(up)
        seen.append(monitor.check("go to a place", 0))
    assert seen[:3] == [None, None, None]
    assert isinstance(seen[3], OutOfBounds)
    telemetry.position = above(60.0)
    ignoring = BoundsMonitor(telemetry, bounds, frozenset({"highest"}))
    for up in (40.0, 60.0):
        telemetry.position = above(up)
        assert ignoring.check("go to a place", 0) is None
