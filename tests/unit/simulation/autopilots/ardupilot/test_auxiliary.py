"""Auxiliary functions: emergency stop, interlock, missions by switches, DO_AUX_FUNCTION."""

from __future__ import annotations

from typing import Any

import pytest

ARM, TAKEOFF, DO_AUX_FUNCTION = 400, 22, 218
ACCEPTED, DENIED, FAILED = 0, 2, 4
DOWN, MIDDLE, UP = 1000, 1500, 2000


def switch(rig: Any, channel: int, pulse: int, seconds: float = 0.3) -> None:
    rig.vehicle.rc.transmitter[channel - 1] = pulse
    rig.run(seconds)


def hovering(rig: Any, mode: int = 4, height: float = 10.0) -> None:
    rig.run(1.0)
    rig.command(176, 1, 4)
    assert rig.command(ARM, 1) == ACCEPTED
    assert rig.command(TAKEOFF, 0, 0, 0, 0, 0, 0, height) == ACCEPTED
    rig.run_until(lambda: rig.height > height - 0.5)
    rig.vehicle.rc.transmitter[2] = 1500
    assert rig.command(176, 1, mode) == ACCEPTED
    rig.run(3.0)


@pytest.mark.parametrize("kind", ["copter", "rover"])
def test_an_emergency_stop_at_boot_forbids_arming(kind: str, station: Any) -> None:
    rig = station(kind, parameters={"RC9_OPTION": 31})
    switch(rig, 9, UP)
    assert rig.command(ARM, 1) == FAILED
    assert "Arm: Motors Emergency Stopped" in rig.texts()
    switch(rig, 9, DOWN)
    assert rig.command(ARM, 1) == ACCEPTED


def test_an_emergency_stop_in_flight_stops_the_motors_and_disarms(station: Any) -> None:
    rig = station(parameters={"RC9_OPTION": 31})
    switch(rig, 9, DOWN)
    hovering(rig)
    switch(rig, 9, UP, 1.0)
    assert rig.height < 8.0
    assert rig.vehicle.armed
    assert rig.run_until(lambda: not rig.vehicle.armed) == pytest.approx(4.0, abs=0.2)  # half of DISARM_DELAY


def test_an_interlock_that_is_closed_forbids_arming_and_one_that_is_open_keeps_the_motors_off(
    station: Any,
) -> None:
    rig = station(parameters={"RC9_OPTION": 32})
    switch(rig, 9, UP)
    assert rig.command(ARM, 1) == FAILED
    assert "Arm: Motor Interlock Enabled" in rig.texts()
    switch(rig, 9, DOWN)
    rig.command(176, 1, 4)
    assert rig.command(ARM, 1) == ACCEPTED
    rig.run(3.0)
    assert max(rig.vehicle.estimate.motors) == 0.0
    switch(rig, 9, UP)
    assert max(rig.vehicle.estimate.motors) > 0.0


def test_a_pilot_saves_a_mission_by_a_switch(station: Any) -> None:
    rig = station(parameters={"RC7_OPTION": 7})
    switch(rig, 7, DOWN)
    hovering(rig, mode=5)
    for _ in range(2):
        switch(rig, 7, UP)
        switch(rig, 7, DOWN)
    items = rig.vehicle.mission.items
    assert [item.command for item in items] == [22, 16, 16]  # the first takes the place of home
    assert items[1].z == pytest.approx(rig.vehicle.home.amsl + 10.0, abs=1.0)
    assert rig.vehicle.parameters["MIS_TOTAL"] == 3
    rig.vehicle.rc.transmitter[2] = 1000
    switch(rig, 7, UP)
    assert rig.vehicle.mission.items[-1].command == 21


def test_a_disarmed_rover_clears_its_mission_by_the_switch_that_saves(station: Any) -> None:
    rig = station("rover", parameters={"RC7_OPTION": 7})
    switch(rig, 7, DOWN)
    rig.listed(16, x=460_001_000, y=70_000_000, z=0.0)
    switch(rig, 7, UP)
    assert not len(rig.vehicle.mission)
    assert rig.texts()[-1] == "SaveWP: Mission cleared!"
    rig.command(ARM, 1)
    switch(rig, 7, DOWN)
    switch(rig, 7, UP)
    assert [item.command for item in rig.vehicle.mission.items] == [16, 16]


def test_switches_clear_a_mission_and_begin_it_anew(station: Any) -> None:
    rig = station(parameters={"RC7_OPTION": 24, "RC8_OPTION": 58})
    for channel in (7, 8):
        switch(rig, channel, DOWN)
    rig.listed(16, x=460_001_000, y=70_000_000, z=10.0)
    rig.vehicle.choose_item(1)
    switch(rig, 7, UP)
    assert rig.vehicle.mission.current == 0
    assert len(rig.vehicle.mission) == 2
    switch(rig, 8, UP)
    assert len(rig.vehicle.mission) == 0
    assert rig.vehicle.parameters["MIS_TOTAL"] == 0


def test_do_aux_function_acts_as_the_switch(station: Any) -> None:
    rig = station()
    rig.run(0.5)
    assert rig.command(DO_AUX_FUNCTION, 70, 2) == ACCEPTED
    assert rig.vehicle.mode.name == "ALT_HOLD"
    assert rig.command(DO_AUX_FUNCTION, 31, 2) == ACCEPTED
    assert rig.command(ARM, 1) == FAILED
    assert rig.command(DO_AUX_FUNCTION, 70, 3) == DENIED
    assert rig.command(DO_AUX_FUNCTION, 9999, 2) == FAILED
    assert rig.texts()[-1] == "Invalid channel option (9999)"


def test_the_arming_switch_disarms_in_flight(station: Any) -> None:
    rig = station(parameters={"RC9_OPTION": 153})
    switch(rig, 9, MIDDLE)
    hovering(rig)
    switch(rig, 9, DOWN)
    assert not rig.vehicle.armed
