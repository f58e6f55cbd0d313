"""The flight plan: its blocks in order, by jump, on the wire."""

from __future__ import annotations

from collections.abc import Callable
from math import dist, hypot
from typing import Any

import pytest

from volery.links.paparazzi_aircraft import stock_aircraft
from volery.simulation.autopilots.paparazzi.firmware import PLAN

Make = Callable[..., Any]


def waypoint(craft: Any, name: str) -> tuple[float, float, float]:
    """North, east, down, as it stands now."""
    east, north, up = craft.autopilot.vehicle.firmware_state.navigation.point(name)
    return north, east, -up


def test_it_is_the_plan_that_the_ground_knows() -> None:
    stock = stock_aircraft()
    assert [block.name for block in PLAN.blocks] == [block.name for block in stock.blocks]
    assert [block.number for block in stock.blocks] == list(range(len(PLAN.blocks)))
    for one in stock.waypoints:
        assert PLAN.waypoint_number(one.name) == one.number
        assert PLAN.waypoints[one.name][:2] == (one.east, one.north)


def test_every_exception_and_jump_leads_to_a_block() -> None:
    names = {block.name for block in PLAN.blocks}
    targets = {name for block in PLAN.blocks for _, name in block.exceptions}
    targets |= {stage.block for block in PLAN.blocks for stage in block.stages if hasattr(stage, "block")}
    assert targets
    assert targets <= names


def test_after_switching_on_it_waits_for_satellites_then_settles(make: Make) -> None:
    """Observed: telemetry after 0.1 s, the first status after 0.4 s, the fix at once, ready after 13.3 s."""
    craft = make(warm=False)
    craft.flight.block_gps()
    craft.run(0.45)
    assert craft.count("ROTORCRAFT_STATUS") == 1
    craft.run(8.0)
    assert craft.block_name == "Wait GPS"
    assert craft.last("ROTORCRAFT_STATUS")["gps_status"] == 0
    assert craft.last("GPS_INT")["numsv"] == 1
    assert craft.count("INS_REF") == 0
    craft.flight.block_gps(blocked=False)
    craft.run(3.0)
    assert craft.block_name == "Geo init"
    craft.until(lambda: craft.block_name == "Holding point", 10.0)
    craft.run(5.2)
    assert craft.count("INS_REF") >= 1


def test_engine_and_takeoff_lead_to_standby(craft: Any) -> None:
    craft.block("Start Engine")
    assert craft.armed
    craft.run(3.0)
    assert craft.up < 0.3
    craft.block("Takeoff")
    craft.run(3.0)
    assert craft.autopilot.vehicle.estimate.velocity[2] == pytest.approx(-0.7, rel=0.1)  # as observed
    craft.until(lambda: craft.block_name == "Standby", 10.0)
    assert craft.up == pytest.approx(2.1, abs=0.2)
    craft.run(15.0)
    assert craft.position == pytest.approx(waypoint(craft, "STDBY"), abs=0.3)
    status = craft.last("ROTORCRAFT_NAV_STATUS")
    assert status["cur_block"] == 5
    assert status["dist_wp"] < 0.3


def test_takeoff_without_engines_does_nothing(craft: Any) -> None:
    craft.block("Takeoff")
    craft.run(5.0)
    assert not craft.armed
    assert craft.up < 0.3


def test_go_leads_on_when_it_is_near(craft: Any) -> None:
    craft.in_the_air()
    craft.block("go_p2")
    goal = waypoint(craft, "p2")
    craft.until(lambda: craft.block_name == "stay_p1", 40.0)
    assert dist(craft.position[:2], goal[:2]) == pytest.approx(3.0, abs=1.2)
    craft.run(20.0)
    assert craft.position == pytest.approx(waypoint(craft, "p1"), abs=0.4)


def test_a_line_is_kept(craft: Any) -> None:
    craft.in_the_air()
    craft.block("stay_p1")
    craft.run(10.0)
    craft.block("line_p1_p2")
    start, end = waypoint(craft, "p1"), waypoint(craft, "p2")
    length = dist(start[:2], end[:2])
    for _ in range(40):
        craft.run(0.1)
        north, east, _ = craft.position
        across = (end[0] - start[0]) * (east - start[1]) - (end[1] - start[1]) * (north - start[0])
        assert abs(across) / length < 1.0
    assert craft.last("ROTORCRAFT_NAV_STATUS")["horizontal_mode"] in (0, 1)
    craft.until(lambda: craft.autopilot.vehicle.firmware_state.navigation.stage == 1, 20.0)
    craft.run(9.0)
    assert craft.autopilot.vehicle.firmware_state.navigation.stage == 1  # it stays ten seconds at p2
    craft.run(2.0)
    assert craft.autopilot.vehicle.firmware_state.navigation.stage == 2


def test_the_route_comes_back_to_its_start(craft: Any) -> None:
    craft.in_the_air()
    craft.block("route")
    craft.until(lambda: craft.block_name == "stay_p1", 60.0)
    craft.run(10.0)
    assert craft.position == pytest.approx(waypoint(craft, "p1"), abs=0.4)


@pytest.mark.parametrize("radius", [5.0, -5.0])
def test_a_circle_is_flown_clockwise_for_a_positive_radius(make: Make, radius: float) -> None:
    craft = make(parameters={"DEFAULT_CIRCLE_RADIUS": radius})
    craft.in_the_air()
    craft.block("circle CAM")
    craft.run(30.0)
    north, east, _ = waypoint(craft, "CAM")
    turning = []
    for _ in range(50):
        craft.run(0.2)
        here, velocity = craft.position, craft.autopilot.vehicle.estimate.velocity
        away = here[0] - north, here[1] - east
        assert hypot(*away) == pytest.approx(5.0, abs=2.5)
        turning.append(away[0] * velocity[1] - away[1] * velocity[0])
    assert all((turn > 0.0) == (radius > 0.0) for turn in turning)
    assert craft.last("ROTORCRAFT_NAV_STATUS")["horizontal_mode"] == 2


def test_an_oval_goes_round_both_points(craft: Any) -> None:
    craft.in_the_air()
    craft.block("Oval")
    first, second = waypoint(craft, "p1"), waypoint(craft, "p2")
    seen: list[str] = []
    for _ in range(500):
        craft.run(0.2)
        for name, point in (("p1", first), ("p2", second)):
            if dist(craft.position[:2], point[:2]) < 7.0 and (not seen or seen[-1] != name):
                seen.append(name)
        if len(seen) > 3:
            break
    assert seen[-3:] in (["p1", "p2", "p1"], ["p2", "p1", "p2"])


def test_yaw_goes_round_in_quarters(craft: Any) -> None:
    craft.in_the_air()
    craft.block("test yaw")
    headings = set()
    for _ in range(160):
        craft.run(0.1)
        degrees = round(craft.autopilot.vehicle.estimate.attitude[2] * 180.0 / 3.14159265) % 360
        if degrees % 90 < 3 or degrees % 90 > 87:
            headings.add(round(degrees / 90.0) % 4)
    assert headings == {0, 1, 2, 3}


def test_land_here_ends_with_the_motors_off(craft: Any) -> None:
    craft.in_the_air()
    craft.block("stay_p1")
    craft.run(10.0)
    spot = craft.position
    craft.block("land here")
    craft.until(lambda: craft.block_name == "Holding point", 30.0)
    craft.run(1.3)
    assert not craft.armed
    assert dist(craft.position[:2], spot[:2]) < 1.0
    assert craft.flight.truth().contact_speed < 1.3
    assert craft.last("ROTORCRAFT_STATUS")["ap_in_flight"] == 0


def test_the_holding_point_kills_the_motors_in_the_air(craft: Any) -> None:
    craft.in_the_air()
    craft.block("Holding point")
    assert not craft.armed


def test_a_block_is_not_flown_in_guided_but_runs(craft: Any) -> None:
    craft.guided()
    place = craft.position
    craft.block("go_p2")
    craft.run(5.0)
    assert craft.block_name == "go_p2"
    assert dist(craft.position, place) < 0.5
    craft.block("Holding point")  # its call acts in NAV only
    assert craft.armed


def test_a_block_beyond_the_plan_is_its_last_one(craft: Any) -> None:
    """Recorded: BLOCK 50 leads to block 17, HOME."""
    craft.send("BLOCK", block_id=50)
    craft.run(1.7)
    assert craft.block_name == "HOME"
    assert craft.last("ROTORCRAFT_NAV_STATUS")["cur_block"] == 17


def test_land_here_on_the_ground_leaves_the_motors_on(craft: Any) -> None:
    """Observed: the blocks run through to 16, landed, which stops no motors."""
    craft.set("kill_throttle", 0.0)
    craft.run(1.0)
    craft.block("land here")
    craft.run(4.0)
    assert craft.block_name == "landed"
    assert craft.armed


def test_a_touch_down_stops_the_motors_at_once(craft: Any) -> None:
    """Observed in eight landings: no thrust is reported 0.07 to 0.26 s after the touch-down."""
    craft.in_the_air()
    craft.block("land here")
    craft.until(lambda: craft.flight.truth().contacts > 0, 20.0)
    craft.run(0.2)
    assert not craft.armed
    assert craft.block_name == "Holding point"


def test_a_touch_down_of_an_earlier_flight_does_not_stop_the_motors(craft: Any) -> None:
    craft.in_the_air()
    craft.block("flare")
    craft.block("Standby")
    craft.set("mode", 19)
    craft.guide(0x40, 0.0, 0.0, 0.8)
    craft.until(lambda: craft.flight.truth().contacts > 0, 20.0)
    craft.run(2.0)
    craft.set("kill_throttle", 1.0)
    craft.run(1.0)
    craft.set("mode", 13)
    craft.block("Holding point")
    craft.in_the_air()
    craft.block("flare")
    craft.run(1.0)
    assert craft.armed
    assert craft.block_name == "flare"


def test_a_moved_waypoint_is_flown_to_and_reported(craft: Any) -> None:
    craft.in_the_air()
    place = 20.0, -15.0, -9.0
    latitude, longitude, amsl = craft.flight.from_ned(place)
    craft.send(
        "MOVE_WP", wp_id=3, lat=round(latitude * 1e7), lon=round(longitude * 1e7), alt=round(amsl * 1e3)
    )
    craft.run(0.1)
    reported = craft.last("WP_MOVED_ENU")
    assert reported["wp_id"] == 3
    assert [reported[axis] / 256.0 for axis in ("east", "north", "up")] == pytest.approx(
        [-15.0, 20.0, 9.0], abs=0.02
    )
    craft.run(15.0)
    assert craft.position == pytest.approx(place, abs=0.3)


@pytest.mark.parametrize("number", [0, 10, 255])
def test_waypoints_that_are_none_are_not_moved(craft: Any, number: int) -> None:
    before = list(craft.autopilot.vehicle.firmware_state.navigation.waypoints)
    craft.send("MOVE_WP", wp_id=number, lat=1, lon=1, alt=1)
    craft.run(0.1)
    assert craft.autopilot.vehicle.firmware_state.navigation.waypoints == before


def test_coming_from_guided_into_nav_it_goes_on_with_its_block(craft: Any) -> None:
    craft.guided()
    craft.block("stay_p1")
    craft.set("mode", 13)
    craft.run(20.0)
    assert craft.position == pytest.approx(waypoint(craft, "p1"), abs=0.3)
