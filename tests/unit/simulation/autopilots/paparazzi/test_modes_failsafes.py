"""Failsafes: distance, height, data link, satellites, radio control, battery."""

from __future__ import annotations

from collections.abc import Callable
from math import dist, hypot
from typing import Any

import pytest

from volery.simulation.world.environment_models import Wind

Make = Callable[..., Any]


def test_a_silent_ground_has_no_effect(craft: Any) -> None:
    craft.guided()
    place = craft.position
    craft.run(300.0)
    assert craft.mode == "GUIDED"
    assert dist(craft.position, place) < 0.5


def test_in_nav_too_far_from_home_it_goes_home(make: Make) -> None:
    craft = make(parameters={"MAX_DIST_FROM_HOME": 30.0})
    craft.in_the_air()
    craft.block("go_p2")
    craft.until(lambda: craft.mode == "HOME", 30.0)
    craft.run(20.0)
    assert dist(craft.position[:2], (0.0, 0.0)) < 0.5
    assert craft.mode == "HOME"


def test_going_back_to_nav_while_still_too_far_is_of_no_use(make: Make) -> None:
    craft = make(parameters={"MAX_DIST_FROM_HOME": 30.0})
    craft.guided()
    craft.guide(0x00, 0.0, 40.0, -10.0)
    craft.run(20.0)
    assert craft.mode == "GUIDED"  # it is NAV's rule alone
    for _ in range(2):
        craft.set("mode", 13)
        craft.run(0.2)
        assert craft.mode == "HOME"
        craft.set("mode", 19)
    assert craft.mode == "GUIDED"


def test_very_far_from_home_it_enters_failsafe(make: Make) -> None:
    craft = make(parameters={"MAX_DIST_FROM_HOME": 10.0, "FAILSAFE_MODE_DISTANCE": 15.0})
    craft.guided()
    craft.guide(0x00, 0.0, 20.0, -10.0)
    craft.run(15.0)
    craft.set("mode", 13)
    craft.run(0.2)
    assert craft.mode == "FAILSAFE"


def test_a_ceiling_is_one_if_it_is_set(make: Make) -> None:
    craft = make(parameters={"GEOFENCE_MAX_ALTITUDE": 8.0})
    craft.guided()
    craft.set("mode", 13)
    craft.run(0.2)
    assert craft.mode == "HOME"


def test_a_silent_ground_sends_it_home_only_if_that_is_set(make: Make) -> None:
    craft = make(parameters={"GEOFENCE_DATALINK_LOST_TIME": 30.0})
    craft.in_the_air()
    craft.send("PING")
    craft.run(29.5)
    assert craft.mode == "NAV"
    craft.run(1.0)
    assert craft.mode == "HOME"


def test_without_satellites_nav_becomes_failsafe(craft: Any) -> None:
    craft.in_the_air()
    height = craft.up
    craft.flight.block_gps()
    craft.run(0.8)  # observed: told after 0.5 s
    assert craft.last("ROTORCRAFT_STATUS")["ap_mode"] == 1
    assert craft.last("ROTORCRAFT_STATUS")["gps_status"] == 0
    assert craft.last("GPS_INT")["numsv"] == 1
    craft.run(30.0)
    assert craft.armed
    assert craft.flight.truth().position[2] == pytest.approx(height, abs=1.0)  # v6.2 keeps its height


def test_without_satellites_guided_flies_on(craft: Any) -> None:
    craft.guided()
    craft.flight.block_gps()
    craft.run(6.0)
    assert craft.mode == "GUIDED"
    assert craft.armed


def test_without_satellites_the_position_freezes_and_it_flees(craft: Any) -> None:
    """Recorded: frozen at the last fix, 4.3 m/s after 10 s, as the integral of a frozen error grows."""
    craft.guided()
    craft.guide(0, 0.0, 40.0, -10.0)
    craft.run(4.0)
    craft.flight.block_gps()
    craft.run(2.0)
    told = craft.last("ROTORCRAFT_FP")
    craft.run(10.0)
    still = craft.last("ROTORCRAFT_FP")
    assert (told["east"], told["north"]) == (still["east"], still["north"])
    assert hypot(*craft.flight.truth().velocity[:2]) > 3.0
    craft.flight.block_gps(False)
    craft.run(2.0)
    assert craft.last("ROTORCRAFT_FP")["east"] != still["east"]


def test_without_satellites_home_becomes_failsafe(craft: Any) -> None:
    craft.guided()
    craft.set("mode", 2)
    craft.flight.block_gps()
    craft.run(3.0)
    assert craft.mode == "FAILSAFE"


def test_a_critical_battery_brings_it_down_if_that_is_set(make: Make) -> None:
    craft = make(parameters={"FAILSAFE_ON_BAT_CRITICAL": 1.0})
    craft.guided()
    craft.autopilot.vehicle.set_parameter("CRITIC_BAT_LEVEL", 50.0)
    craft.run(4.8)
    assert craft.mode == "GUIDED"
    craft.run(0.5)  # recorded: 5 s after the drop
    assert craft.mode == "FAILSAFE"


def test_failsafe_drifts_with_the_wind(make: Make) -> None:
    craft = make(wind=Wind(east=4.0), parameters={"FAILSAFE_DESCENT_SPEED": 1.5})
    craft.guided(-8.0)
    craft.set("mode", 1)
    craft.until(lambda: craft.mode == "KILL", 20.0)
    assert craft.flight.truth().position[0] > 1.0


@pytest.mark.parametrize("setting", ["MAX_DIST_FROM_HOME", "GEOFENCE_MAX_ALTITUDE"])
def test_fences_do_not_count_on_the_ground(make: Make, setting: str) -> None:
    craft = make(parameters={setting: 0.001})
    craft.block("Start Engine")
    craft.run(2.0)
    assert craft.mode == "NAV"
