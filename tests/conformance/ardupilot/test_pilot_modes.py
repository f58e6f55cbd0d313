"""Modes beside the usual ones, and the transmitter's switches. No recording shows how they fly."""

from __future__ import annotations

from math import degrees, dist, hypot
from typing import Any

import pytest

ACRO, CIRCLE, DRIFT, POSHOLD, SMART_RTL = 1, 7, 11, 16, 21
ROVER_ACRO, STEERING, LOITER, SIMPLE, ROVER_SMART_RTL = 1, 3, 5, 7, 12
MIDDLE = (1500, 1500, 1500, 1500)


@pytest.mark.parametrize("mode", [1, 7, 11, 16, 19, 20, 21, 24])
def test_modes_of_the_recording_are_accepted_in_the_air(mode: int, bench: Any) -> None:
    rig = bench(features="traffic")
    rig.airborne()
    assert rig.mode(mode) == 0
    assert rig.latest["HEARTBEAT"]["custom_mode"] == mode


def test_with_the_throttle_closed_a_change_of_modes_lets_it_fall(bench: Any) -> None:
    """Recorded: a quick change through ACRO and DRIFT with the throttle at 1000 ended on the ground."""
    rig = bench()
    rig.airborne()
    for mode in (ACRO, CIRCLE, DRIFT, POSHOLD, ACRO):
        rig.mode(mode)
        rig.run(0.4)
    rig.run(1.5)
    assert any(text.startswith("SIM Hit ground") for text in rig.texts())


def test_a_circle_is_flown_about_a_point_ahead(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    rig.hold_sticks(0.2, *MIDDLE)
    assert rig.mode(CIRCLE) == 0
    centre = rig.vehicle.manoeuvre._centre
    rig.hold_sticks(12.0, *MIDDLE)
    away = []
    for _ in range(20):
        rig.hold_sticks(0.5, *MIDDLE)
        north, east, _ = rig.vehicle.estimate.position
        away.append(hypot(north - centre[0], east - centre[1]))
    assert min(away) > 7.0
    assert max(away) < 13.0
    assert rig.height == pytest.approx(10.0, abs=1.0)


@pytest.mark.parametrize("mode", [2, 5, POSHOLD])
def test_a_climb_from_the_ground_goes_on_to_the_height_of_the_pilots_takeoff(mode: int, bench: Any) -> None:
    rig = bench(parameters={"PILOT_TKOFF_ALT": 700})
    rig.run(0.5)
    rig.mode(mode)
    rig.hold_sticks(0.5, 1500, 1500, 1000, 1500)
    assert rig.command(400, 1) == 0
    rig.hold_sticks(3.0, 1500, 1500, 1000, 1500)
    rig.hold_sticks(0.5, 1500, 1500, 1750, 1500)
    rig.hold_sticks(9.0, *MIDDLE)
    assert rig.height == pytest.approx(7.0, abs=0.5)


def test_acro_leans_by_stick_and_levels_out(bench: Any) -> None:
    rig = bench()
    rig.airborne(20.0)
    rig.hold_sticks(0.2, *MIDDLE)
    rig.mode(ACRO)
    rig.hold_sticks(0.8, 1700, 1500, 1550, 1500)
    assert degrees(rig.vehicle.estimate.attitude[0]) > 15.0
    rig.hold_sticks(3.0, 1500, 1500, 1550, 1500)
    assert abs(degrees(rig.vehicle.estimate.attitude[0])) < 6.0


def test_smart_rtl_returns_along_the_way_and_lands(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    for x, y in ((25.0, 0.0), (25.0, 25.0)):
        rig.send(
            "SET_POSITION_TARGET_LOCAL_NED",
            target_system=1,
            target_component=1,
            coordinate_frame=1,
            type_mask=3576,
            x=x,
            y=y,
            z=-10.0,
        )
        rig.run(12.0)
    assert rig.mode(SMART_RTL) == 0
    nearest = 99.0
    for _ in range(150):
        rig.run(0.1)
        nearest = min(nearest, dist(rig.vehicle.estimate.position[:2], (25.0, 0.0)))
    assert nearest < 5.0
    rig.run_until(lambda: not rig.vehicle.armed, within=90.0)
    north, east, _ = rig.vehicle.estimate.position
    assert hypot(north, east) < 2.0


def test_smart_rtl_without_a_track_is_refused(bench: Any) -> None:
    rig = bench(parameters={"ARMING_CHECK": 0})
    rig.airborne()
    rig.vehicle.ground.track.clear()
    rig.vehicle.ground.track.extend([])
    assert rig.mode(SMART_RTL) == 4
    assert rig.texts()[-1] == "Mode change to SMART_RTL failed: init failed"


def test_a_rover_is_steered_holds_its_place_and_returns_along_its_way(bench: Any) -> None:
    rig = bench("rover")
    rig.beat()
    rig.run(0.5)
    assert rig.mode(STEERING) == 0
    assert rig.command(400, 1) == 0
    rig.hold_sticks(4.0, 1500, 1500, 1700, 1500)
    north, east, _ = rig.vehicle.estimate.velocity
    assert 2.0 < hypot(north, east) < 4.0  # at 1 m/s^2 to 0.4 of CRUISE_SPEED / CRUISE_THROTTLE
    rig.hold_sticks(2.0, 1700, 1500, 1700, 1500)
    assert rig.vehicle.estimate.rates[2] > 0.2
    assert rig.mode(LOITER) == 0
    rig.run(6.0)
    north, east, _ = rig.vehicle.estimate.velocity
    assert hypot(north, east) < 0.2
    assert rig.mode(ROVER_SMART_RTL) == 0
    rig.run(40.0)
    north, east, _ = rig.vehicle.estimate.position
    assert hypot(north, east) < 3.0


def test_a_rover_brakes_by_its_motor_where_that_is_permitted(bench: Any) -> None:
    stopping = []
    for brakes in (1, 0):
        rig = bench("rover", parameters={"ATC_BRAKE": brakes, "ATC_ACCEL_MAX": 10})
        rig.beat()
        rig.run(0.5)
        assert rig.mode(STEERING) == 0
        assert rig.command(400, 1) == 0
        rig.hold_sticks(6.0, 1500, 1500, 1900, 1500)
        start = rig.vehicle.estimate.position[0]
        rig.hold_sticks(12.0, 1500, 1500, 1500, 1500)
        stopping.append(rig.vehicle.estimate.position[0] - start)
    assert stopping[0] < 0.9 * stopping[1]


def test_simple_drives_about_the_first_heading(bench: Any) -> None:
    rig = bench("rover")
    rig.beat()
    rig.run(0.5)
    assert rig.mode(SIMPLE) == 0
    assert rig.command(400, 1) == 0
    rig.hold_sticks(8.0, 2000, 1500, 1520, 1500)
    assert degrees(rig.vehicle.estimate.attitude[2]) % 360.0 == pytest.approx(83.0, abs=12.0)


@pytest.mark.parametrize(
    ("kind", "channel", "pulse", "mode"), [("copter", 5, 1300, 9), ("rover", 8, 1450, 11)]
)
def test_the_mode_switch_changes_the_mode_when_it_moves(
    kind: str, channel: int, pulse: int, mode: int, bench: Any
) -> None:
    rig = bench(kind)
    rig.run(0.5)
    before = rig.vehicle.mode.number
    sticks = [0] * 8
    sticks[channel - 1] = pulse
    rig.sticks(*sticks)
    rig.run(0.15)
    assert rig.vehicle.mode.number == before
    rig.hold_sticks(0.5, *sticks)
    assert rig.vehicle.mode.number == mode


@pytest.mark.parametrize("kind", ["copter", "rover"])
def test_full_rudder_arms_and_disarms(kind: str, bench: Any) -> None:
    rig = bench(kind)
    rig.beat()
    rig.run(0.5)
    closed = 1000 if kind == "copter" else 1500
    right = (1500, 1500, closed, 2000) if kind == "copter" else (2000, 1500, closed, 1500)
    left = (1500, 1500, closed, 1000) if kind == "copter" else (1000, 1500, closed, 1500)
    rig.hold_sticks(1.0, *right)
    assert not rig.vehicle.armed
    rig.hold_sticks(2.5, *right)
    assert rig.vehicle.armed
    rig.hold_sticks(4.0, *left)
    assert not rig.vehicle.armed


def test_without_arming_rudder_it_does_not_arm(bench: Any) -> None:
    rig = bench(parameters={"ARMING_RUDDER": 0})
    rig.beat()
    rig.run(0.5)
    rig.hold_sticks(4.0, 1500, 1500, 1000, 2000)
    assert not rig.vehicle.armed


def test_a_channel_option_enters_its_mode_and_leaves_it(bench: Any) -> None:
    rig = bench(parameters={"RC9_OPTION": 18, "RC10_OPTION": 11})
    rig.run(0.5)
    rig.hold_sticks(0.5, 0, 0, 0, 0, 0, 0, 0, 0, 1000, 1000)
    rig.hold_sticks(0.5, 0, 0, 0, 0, 0, 0, 0, 0, 1900, 1900)
    assert rig.vehicle.mode.number == 9
    assert rig.vehicle.parameters["FENCE_ENABLE"] == 1.0
    rig.hold_sticks(0.5, 0, 0, 0, 0, 0, 0, 0, 0, 1000, 1000)
    assert rig.vehicle.mode.number == 0
    assert rig.vehicle.parameters["FENCE_ENABLE"] == 0.0
