"""Sticks by datalink: what the switch means, how they fly it, and what their silence does."""

from __future__ import annotations

from collections.abc import Callable
from math import dist, radians
from typing import Any

import pytest

Make = Callable[..., Any]
MANUAL, AUTO1, AUTO2 = 0, 1, 2
OK, LOST, REALLY_LOST = 0, 1, 2


def hold(craft: Any, seconds: float, **sticks: int) -> None:
    """Ten frames a second."""
    for _ in range(round(seconds * 10)):
        craft.sticks(**sticks)
        craft.run(0.1)


def test_a_frame_makes_the_radio_ok_and_silence_loses_it(craft: Any) -> None:
    craft.sticks(mode=AUTO2)
    craft.run(0.1)
    radio = craft.autopilot.vehicle.firmware_state.radio
    vehicle = craft.autopilot.vehicle
    assert radio.status(vehicle) == OK
    craft.run(0.6)
    assert radio.status(vehicle) == LOST
    craft.run(0.5)
    assert radio.status(vehicle) == REALLY_LOST


def test_the_switch_chooses_among_three_settings(craft: Any) -> None:
    for position, mode in ((MANUAL, "ATTITUDE_DIRECT"), (AUTO1, "ATTITUDE_Z_HOLD"), (AUTO2, "NAV")):
        hold(craft, 0.2, mode=position)
        assert craft.mode == mode
    craft.set("auto2", 6)
    hold(craft, 0.2, mode=AUTO2)
    assert craft.mode == "ATTITUDE_RC_CLIMB"


def test_with_sticks_the_mode_setting_obeys_only_for_safety(craft: Any) -> None:
    hold(craft, 0.2, mode=AUTO2)
    craft.set("mode", 19)
    assert craft.mode == "NAV"
    craft.set("mode", 2)
    assert craft.mode == "HOME"
    hold(craft, 0.2, mode=AUTO2)
    assert craft.mode == "HOME"  # only MANUAL leads out of it
    hold(craft, 0.2, mode=MANUAL)
    assert craft.mode == "ATTITUDE_DIRECT"


def test_direct_sticks_are_lean_angles_and_thrust(craft: Any) -> None:
    hold(craft, 0.3, mode=MANUAL)
    craft.set("kill_throttle", 0.0)
    assert craft.mode == "ATTITUDE_DIRECT"
    hold(craft, 1.0, mode=MANUAL, throttle=0)
    assert craft.up < 0.3
    hold(craft, 4.0, mode=MANUAL, throttle=64)
    assert craft.up > 2.0
    hold(craft, 1.0, mode=MANUAL, throttle=64, roll=64, pitch=-64)
    roll, pitch, _ = craft.autopilot.vehicle.estimate.attitude
    assert roll == pytest.approx(radians(22.5), abs=0.06)
    assert pitch == pytest.approx(radians(-22.5), abs=0.06)
    frame = craft.autopilot.vehicle.firmware_state.radio.frame
    assert (frame.roll, frame.pitch, frame.throttle) == (4800, -4800, 4800)


def test_yaw_is_a_turn_rate_clockwise(craft: Any) -> None:
    craft.in_the_air()
    craft.set("auto2", 6)
    hold(craft, 3.0, mode=AUTO2, throttle=64, yaw=64)
    assert craft.autopilot.vehicle.estimate.rates[2] == pytest.approx(radians(45.0), abs=0.08)


@pytest.mark.parametrize("throttle", [0, 64, 127])
def test_in_rc_climb_the_throttle_has_no_effect(throttle: int, craft: Any) -> None:
    craft.in_the_air()
    craft.set("auto2", 6)
    hold(craft, 4.0, mode=AUTO2, throttle=throttle)
    assert craft.mode == "ATTITUDE_RC_CLIMB"
    assert craft.up == pytest.approx(5.0, abs=0.5)


def test_climb_sticks_as_intended_take_off_climb_and_hold(make: Make) -> None:
    craft = make(parameters={"RC_CLIMB_BY_THROTTLE": 1})
    craft.set("auto2", 6)
    hold(craft, 0.3, mode=AUTO2, throttle=64)
    craft.set("kill_throttle", 0.0)
    hold(craft, 5.0, mode=AUTO2, throttle=100)
    assert craft.up > 1.5
    hold(craft, 4.0, mode=AUTO2, throttle=64)
    height = craft.up
    hold(craft, 5.0, mode=AUTO2, throttle=64)
    assert craft.up == pytest.approx(height, abs=0.3)


def test_z_hold_keeps_its_height_whatever_the_throttle(craft: Any) -> None:
    craft.in_the_air()
    craft.set("auto2", 9)
    hold(craft, 5.0, mode=AUTO2, throttle=127)
    assert craft.mode == "ATTITUDE_Z_HOLD"
    assert craft.up == pytest.approx(5.0, abs=0.4)


def test_hover_keeps_its_place(craft: Any) -> None:
    craft.in_the_air()
    craft.set("auto2", 12)
    place = craft.position
    hold(craft, 6.0, mode=AUTO2, throttle=64, roll=100)
    assert craft.mode == "HOVER_Z_HOLD"
    assert dist(craft.position, place) < 0.4


def test_in_a_mode_of_sticks_their_silence_is_a_failsafe(craft: Any) -> None:
    craft.in_the_air()
    craft.set("auto2", 6)
    hold(craft, 1.0, mode=AUTO2, throttle=64)
    craft.run(0.8)
    assert craft.mode == "ATTITUDE_RC_CLIMB"
    craft.run(0.5)
    assert craft.mode == "FAILSAFE"


def test_in_nav_their_silence_means_nothing(craft: Any) -> None:
    craft.in_the_air()
    hold(craft, 1.0, mode=AUTO2)
    craft.run(5.0)
    assert craft.mode == "NAV"
    craft.set("mode", 19)  # and the datalink commands again
    assert craft.mode == "GUIDED"


def test_nav_is_not_entered_without_satellites(craft: Any) -> None:
    craft.in_the_air()
    craft.set("auto2", 13)
    hold(craft, 0.3, mode=AUTO1, throttle=64)
    craft.flight.block_gps()
    hold(craft, 3.0, mode=AUTO1, throttle=64)
    hold(craft, 1.0, mode=AUTO2, throttle=64)
    assert craft.mode == "ATTITUDE_Z_HOLD"


def test_sticks_fly_without_satellites(make: Make) -> None:
    craft = make(warm=False, parameters={"FAILSAFE_DESCENT_SPEED": 1.5, "RC_CLIMB_BY_THROTTLE": 1})
    craft.flight.block_gps()
    craft.run(15.0)
    craft.set("auto2", 6)
    hold(craft, 0.3, mode=AUTO2, throttle=64)
    craft.set("kill_throttle", 0.0)
    hold(craft, 5.0, mode=AUTO2, throttle=110)
    hold(craft, 1.5, mode=AUTO2, throttle=64)
    assert craft.flight.truth().position[2] > 1.5
    craft.set("mode", 1)
    hold(craft, 14.0, mode=AUTO2, throttle=64)
    assert not craft.armed


def test_channels_say_the_same_as_sticks(craft: Any) -> None:
    craft.send("RC_UP", channels=(64, -64, 32, 100, -127))
    craft.run(0.6)
    frame = craft.autopilot.vehicle.firmware_state.radio.frame
    assert tuple(frame) == (4800, -4800, 2400, 7500, -9525)
    assert craft.mode == "ATTITUDE_DIRECT"


def test_too_few_channels_are_no_frame(craft: Any) -> None:
    craft.send("RC_UP", channels=(64, -64))
    craft.run(0.6)
    vehicle = craft.autopilot.vehicle
    assert vehicle.firmware_state.radio.status(vehicle) == REALLY_LOST


def test_the_old_message_of_four_channels_no_longer_exists(craft: Any) -> None:
    """Dropped in July 2024: the observed aircraft stays without radio control."""
    craft.send("RC_4CH", mode=AUTO2, throttle=64, roll=0, pitch=0, yaw=0)
    craft.run(1.3)
    assert craft.last("ROTORCRAFT_STATUS")["rc_status"] == REALLY_LOST


def test_a_joystick_is_sticks_with_the_switch_at_auto2(craft: Any) -> None:
    craft.set("auto2", 6)
    craft.send("JOYSTICK_RAW", roll=9600, pitch=-32768, yaw=0, throttle=-5)
    craft.run(0.6)
    frame = craft.autopilot.vehicle.firmware_state.radio.frame
    assert tuple(frame)[:4] == (9600, -9600, 0, 0)
    assert craft.mode == "ATTITUDE_RC_CLIMB"
