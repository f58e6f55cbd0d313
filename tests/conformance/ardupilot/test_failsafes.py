"""Losing the ground station, the transmitter, the battery, the satellites."""

from __future__ import annotations

from typing import Any

import pytest

from volery.base.time import S
from volery.simulation.autopilots.ardupilot.modes import received_of
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
    seen = received_of(rig.vehicle).station_at / S
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
    airborne_without_a_station(rig)
    rig.sticks(1500, 1500, 1500, 1500)
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
        assert "Radio Failsafe" in rig.texts()  # as recorded: a rover mistakes the links


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
    """The action follows FS_TIMEOUT after the loss, not in HOLD, and not in AUTO with FS_THR_ENABLE 2."""
    times = {"FS_GCS_TIMEOUT": 5, "FS_TIMEOUT": 4}
    rig = bench("rover", parameters={"FS_GCS_ENABLE": 1, "FS_THR_ENABLE": enabled, "FS_ACTION": 1, **times})
    rig.send("HEARTBEAT", type=6, autopilot=8)
    rig.run(0.5)
    rig.vehicle.mission.replace([MissionItem(16), MissionItem(16, x=-353_600_000, y=1_491_600_000)])
    rig.mode(mode)
    rig.command(400, 1)
    rig.run(8.0)
    assert "Radio Failsafe" not in rig.texts()
    rig.run(3.0)
    assert rig.vehicle.mode.number == ends_in
    assert ("Radio Failsafe" in rig.texts()) == (mode != 4)
    assert ("Failsafe - Continuing Auto Mode" in rig.texts()) == (mode == ends_in == 10)


def refused_to_arm(rig: Any) -> list[str]:
    """What it says when it refuses to arm."""
    before = len(rig.texts())
    assert rig.command(400, 1) == 4
    rig.run(0.1)
    return [text for text in rig.texts()[before:] if text.startswith("Arm: ")]


def test_a_battery_failsafe_forbids_arming_also_after_the_voltage_is_back(bench: Any) -> None:
    """Recorded: 9.9 V at rest, critical at 10.0 V, low at 10.5 V."""
    levels = {"BATT_LOW_VOLT": 10.5, "BATT_CRT_VOLT": 10.0, "BATT_LOW_TIMER": 2}
    rig = bench(parameters={**levels, "SIM_BATT_VOLTAGE": 9.9})
    rig.beat()
    rig.mode(GUIDED)
    rig.run(6.0)
    assert refused_to_arm(rig) == ["Arm: Battery 1 low voltage failsafe", "Arm: Battery failsafe"]
    set_parameter(rig, "SIM_BATT_VOLTAGE", 12.6)
    rig.run(3.0)
    assert refused_to_arm(rig) == ["Arm: Battery failsafe"]


def test_a_lost_station_forbids_arming(bench: Any) -> None:
    rig = bench(parameters={"FS_GCS_ENABLE": 1})
    rig.send("HEARTBEAT", type=6, autopilot=8)
    rig.mode(GUIDED)
    rig.run(8.0)
    assert refused_to_arm(rig) == ["Arm: GCS failsafe on"]
    rig.beat()
    rig.run(2.0)
    assert rig.command(400, 1) == 0


def test_a_receiver_without_a_fix_forbids_arming_in_modes_that_need_a_position(bench: Any) -> None:
    rig = bench()
    rig.beat()
    rig.mode(GUIDED)
    rig.run(1.0)
    set_parameter(rig, "SIM_GPS_DISABLE", 1)
    for _ in range(3):
        rig.run(1.5)
        assert refused_to_arm(rig) == ["Arm: GPS 1: Bad fix"]
    rig.mode(0)
    assert rig.command(400, 1) == 0


def test_without_satellites_it_lands_in_the_recorded_time_and_refuses_modes(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    set_parameter(rig, "SIM_GPS_DISABLE", 1)
    seconds = rig.run_until(lambda: rig.vehicle.mode.number == LAND, within=12.0)
    assert seconds == pytest.approx(8.1, abs=0.4)
    rig.run(1.0)
    assert rig.mode(GUIDED) == 4
    assert "Mode change to GUIDED failed: requires position" in rig.texts()


def test_a_battery_of_a_stated_voltage_measures_it_in_flight(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    set_parameter(rig, "SIM_BATT_VOLTAGE", 10.4)
    rig.run(2.0)
    assert rig.vehicle.estimate.battery_volts == pytest.approx(10.4, abs=0.1)


def test_a_copter_that_lacks_a_motor_stays_armed(bench: Any) -> None:
    """Recorded: the crash check does not act, and it is not disarmed without force."""
    rig = bench()
    rig.airborne(15.0)
    set_parameter(rig, "SIM_ENGINE_MUL", 0.0)
    rig.run(20.0)
    assert rig.vehicle.armed
    assert rig.command(400, 0) == 4
    assert rig.command(400, 0, 21196) == 0


def test_a_place_that_is_no_number_is_denied(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    place = {"x": -353_630_000, "y": 1_491_652_000}
    for frame, z, result in ((6, float("nan"), 2), (6, 10.0, 0), (6, 0.0, 2), (2, 10.0, 2)):
        given = {"frame": frame, **place, "z": z, "param2": 1.0, "param4": float("nan")}
        assert rig.command_int(192, **given) == result
    assert rig.command_int(192, frame=6, x=950_000_000, y=place["y"], z=10.0, param2=1.0) == 2
    assert rig.command(22, 0, 0, 0, 0, 0, 0, float("nan")) == 4


def test_a_return_along_the_track_needs_a_track(bench: Any) -> None:
    for kind, number in (("copter", SMART_RTL), ("rover", 12)):
        rig = bench(kind)
        rig.run(0.5)
        assert rig.mode(number) == 4


def test_a_rover_refuses_what_it_cannot_drive(bench: Any) -> None:
    rig = bench("rover")
    rig.beat()
    rig.run(0.5)
    assert rig.mode(10) == 4
    assert rig.texts()[-2:] == ["No Mission. Can't set AUTO.", "Flight mode change failed"]
    assert rig.mode(15) == 0
    assert rig.command(178, 1, 2.0) == 4
    assert rig.command(400, 1) == 0
    rig.send("SET_POSITION_TARGET_LOCAL_NED", target_system=1, coordinate_frame=1, type_mask=3576, x=20.0)
    rig.run(0.5)
    assert rig.command(178, 1, 2.0) == 0
