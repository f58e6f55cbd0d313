"""Losing the ground station, the transmitter, the battery, the satellites."""

from __future__ import annotations

from typing import Any

import pytest

from volery.base.time import S
from volery.simulation.autopilots.onboard_mission import MissionItem

RTL, LAND, BRAKE, GUIDED, SMART_RTL = 6, 9, 17, 4, 21


def set_parameter(rig: Any, name: str, value: float) -> None:
    rig.send("PARAM_SET", target_system=1, target_component=1, param_id=name, param_value=value, param_type=9)
    rig.run(0.1)


def airborne_without_a_station(rig: Any) -> None:
    """Flying; the station's heartbeats have just stopped."""
    handle = rig.kernel.every(S, lambda: rig.send("HEARTBEAT", type=6, autopilot=8))
    rig.mode(GUIDED)
    rig.command(400, 1)
    rig.command(22, 0, 0, 0, 0, 0, 0, 10)
    rig.run(15.0)
    handle.cancel()
    rig.received.clear()


def test_losing_the_station_returns_after_the_recorded_time(bench: Any, facts: Any) -> None:
    recorded = facts["failsafe"]
    rig = bench(parameters={"FS_GCS_ENABLE": 1})
    airborne_without_a_station(rig)
    seen = rig.vehicle.failsafes.station_last_ns / S
    rig.run_until(lambda: rig.vehicle.mode.number == recorded["mode"])
    assert rig.now - seen == pytest.approx(recorded["silence"], abs=0.4)
    rig.run(1.5)
    assert rig.latest["HEARTBEAT"]["system_status"] == recorded["status"]
    assert rig.texts()[0] == "GCS Failsafe"
    rig.beat()
    rig.run(1.5)
    assert "GCS Failsafe Cleared" in rig.texts()
    rig.run(1.0)
    assert rig.latest["HEARTBEAT"]["system_status"] == 4
    assert rig.vehicle.mode.number == recorded["mode_after_cleared"]


def test_without_the_parameter_it_hovers_on(bench: Any) -> None:
    rig = bench()
    airborne_without_a_station(rig)
    rig.run(30.0)
    assert rig.vehicle.mode.number == GUIDED
    assert rig.texts() == []


@pytest.mark.parametrize(
    ("value", "mode"), [(1, RTL), (3, SMART_RTL), (4, SMART_RTL), (5, LAND), (7, BRAKE), (99, RTL)]
)
def test_the_parameter_chooses_what_happens(value: int, mode: int, bench: Any) -> None:
    rig = bench(parameters={"FS_GCS_ENABLE": value})
    airborne_without_a_station(rig)
    rig.run(6.5)
    assert rig.vehicle.mode.number == mode


def test_a_pilot_flies_on_when_the_station_is_lost(bench: Any) -> None:
    rig = bench(parameters={"FS_GCS_ENABLE": 1})
    rig.sticks(1500, 1500, 1500, 1500)
    airborne_without_a_station(rig)
    rig.mode(2)
    rig.run(6.5)
    assert rig.vehicle.mode.name == "ALT_HOLD"
    assert "GCS Failsafe - Continuing Pilot Control" in rig.texts()


def test_on_the_ground_it_disarms(bench: Any) -> None:
    rig = bench(parameters={"FS_GCS_ENABLE": 1, "DISARM_DELAY": 0})
    rig.run(0.2)
    rig.send("HEARTBEAT", type=6, autopilot=8)
    rig.mode(GUIDED)
    rig.command(400, 1)
    rig.run(6.5)
    assert not rig.vehicle.armed
    assert "GCS Failsafe - Disarming" in rig.texts()


def test_losing_the_transmitter_returns(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    set_parameter(rig, "SIM_RC_FAIL", 1)
    rig.run(1.0)
    assert rig.vehicle.mode.number == RTL
    assert "Radio Failsafe" in rig.texts()
    set_parameter(rig, "SIM_RC_FAIL", 0)
    rig.run(1.0)
    assert rig.texts()[-1] == "Radio Failsafe Cleared"
    assert rig.vehicle.mode.number == RTL


@pytest.mark.parametrize(("failure", "said"), [(1, "RC not found"), (2, "Throttle below failsafe")])
def test_without_the_transmitter_it_does_not_arm(failure: int, said: str, bench: Any) -> None:
    rig = bench(parameters={"SIM_RC_FAIL": failure})
    rig.run(0.5)
    rig.mode(GUIDED)
    assert rig.command(400, 1) == 4
    assert f"Arm: {said}" in rig.texts()
    assert rig.command(401) == 0  # RUN_PREARM_CHECKS
    assert f"PreArm: {said}" in rig.texts()


def test_a_transmitter_that_was_received_once_is_lost_not_missing(bench: Any) -> None:
    rig = bench()
    rig.run(1.0)
    set_parameter(rig, "SIM_RC_FAIL", 1)
    rig.run(0.5)
    assert rig.command(400, 1) == 4
    assert "Arm: Throttle below failsafe" in rig.texts()


@pytest.mark.parametrize(("action", "mode"), [(0, GUIDED), (1, LAND), (2, RTL), (3, SMART_RTL)])
def test_a_low_battery_says_so_and_acts_as_asked(action: int, mode: int, bench: Any) -> None:
    rig = bench(parameters={"BATT_FS_LOW_ACT": action})
    rig.airborne()
    set_parameter(rig, "BATT_LOW_MAH", 100_000)
    rig.run(1.0)
    assert rig.vehicle.mode.number == mode
    words = next(text for text in rig.texts() if text.startswith("Battery"))
    assert words.startswith("Battery 1 is low ")
    assert words.endswith(" mAh")
    assert rig.latest["HEARTBEAT"]["system_status"] == 5


def test_a_low_voltage_must_last(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    set_parameter(rig, "BATT_LOW_VOLT", 14.0)
    rig.run(9.0)
    assert not [text for text in rig.texts() if text.startswith("Battery")]
    rig.run(2.0)
    assert [text for text in rig.texts() if text.startswith("Battery")]


def test_a_critical_battery_may_terminate_the_flight(bench: Any) -> None:
    rig = bench(parameters={"BATT_FS_CRT_ACT": 5})
    rig.airborne(3.0)
    set_parameter(rig, "BATT_CRT_MAH", 100_000)
    rig.run(0.5)
    assert not rig.vehicle.armed


def test_losing_the_satellites_lands_it(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    rig.stream(4)
    rig.flight.block_gps()
    rig.run(14.0)
    assert rig.vehicle.mode.number == LAND
    assert "EKF Failsafe: changed to LAND Mode" in rig.texts()
    assert rig.latest["EKF_STATUS_REPORT"]["flags"] == 167
    rig.run(30.0)
    assert not rig.vehicle.armed
    assert rig.height < 1.0


def test_a_rover_holds_or_returns_as_asked(bench: Any) -> None:
    for action, mode in ((2, 4), (1, 11)):
        rig = bench("rover", parameters={"FS_GCS_ENABLE": 1, "FS_ACTION": action})
        rig.send("HEARTBEAT", type=6, autopilot=8)
        rig.run(0.2)
        assert rig.mode(15) == 0
        assert rig.command(400, 1) == 0
        rig.run(7.0)
        assert rig.vehicle.mode.number == mode
        assert "GCS Failsafe" in rig.texts()


def test_a_vehicle_that_lies_on_its_back_disarms(bench: Any) -> None:
    """The crash check: more than 30 degrees from the target for two seconds, slow and hardly accelerating."""
    rig = bench()
    rig.airborne()
    for motor in (0, 2):  # those in front: it turns over
        rig.flight.weaken_motor(motor, 0.0)
    rig.run_until(lambda: not rig.vehicle.armed, within=30.0)
    rig.run(0.2)
    assert any(text.startswith("Crash: Disarming: AngErr=") for text in rig.texts())


def test_the_crash_check_can_be_switched_off(bench: Any) -> None:
    rig = bench(parameters={"FS_CRASH_CHECK": 0})
    rig.airborne()
    for motor in (0, 2):  # those in front: it turns over
        rig.flight.weaken_motor(motor, 0.0)
    rig.run(15.0)
    assert rig.vehicle.armed


@pytest.mark.parametrize(
    ("enabled", "mode", "ends_in"),
    [(1, 10, 11), (2, 10, 10), (2, 0, 11), (1, 4, 4)],
    ids=["AUTO", "AUTO goes on", "MANUAL", "HOLD"],
)
def test_a_rover_without_its_station(enabled: int, mode: int, ends_in: int, bench: Any) -> None:
    """The action follows FS_TIMEOUT after the loss, not in HOLD, and not in AUTO with FS_GCS_ENABLE 2."""
    rig = bench(
        "rover", parameters={"FS_GCS_ENABLE": enabled, "FS_GCS_TIMEOUT": 5, "FS_ACTION": 1, "FS_TIMEOUT": 4}
    )
    rig.send("HEARTBEAT", type=6, autopilot=8)
    rig.run(0.5)
    rig.vehicle.mission.replace([MissionItem(16), MissionItem(16, x=-353_600_000, y=1_491_600_000)])
    rig.mode(mode)
    rig.command(400, 1)
    rig.run(8.0)
    assert "GCS Failsafe" not in rig.texts()
    rig.run(3.0)
    assert rig.vehicle.mode.number == ends_in
    assert ("GCS Failsafe" in rig.texts()) == (mode != 4)
    assert ("Failsafe - Continuing Auto Mode" in rig.texts()) == (mode == ends_in == 10)
