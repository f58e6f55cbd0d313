"""Failsafes without a recording: what the firmware's parameters are documented to do, and no hang."""

from __future__ import annotations

from math import nan, remainder, tau
from typing import Any

import pytest

from rigs.station import TARGET
from volery.links.mavlink_messages import to_bytewise
from volery.simulation.autopilots.onboard_mission import MissionItem

LAND, RTL, LOITER = "AUTO.LAND", "AUTO.RTL", "AUTO.LOITER"


def hovering(rig: Any) -> float:
    rig.airborne()
    rig.run(1.0)
    at: float = rig.now
    return at


@pytest.mark.parametrize(("action", "mode"), [(2, LAND), (3, RTL)])
def test_a_critical_battery_holds_and_then_acts(action: int, mode: str, bench: Any) -> None:
    rig = bench(parameters={"COM_LOW_BAT_ACT": action, "BAT_EMERGEN_THR": 0.02})
    since = hovering(rig)
    rig.flight.set_charge(0.06)
    rig.run(1.0)
    assert rig.vehicle.mode.name == LOITER
    assert "Preflight Fail: low battery\t" in rig.texts(since)
    rig.run(5.5)
    assert rig.vehicle.mode.name == mode
    assert rig.latest["HEARTBEAT"]["system_status"] == 5


def test_a_battery_that_falls_further_does_not_hold_a_second_time(bench: Any) -> None:
    """The delay of COM_FAIL_ACT_T is used up once: from critical to emergency the landing goes on."""
    rig = bench(parameters={"COM_LOW_BAT_ACT": 2})
    since = hovering(rig)
    rig.flight.set_charge(0.06)
    rig.run_until(lambda: rig.vehicle.mode.name == LAND, within=10.0)
    rig.flight.set_charge(0.03)
    seen = set()
    for _ in range(30):
        rig.run(0.1)
        seen.add(rig.vehicle.mode.name)
    assert rig.texts(since).count("Preflight Fail: low battery\t") == 1
    assert seen == {LAND}


def test_a_battery_that_only_warns(bench: Any) -> None:
    rig = bench(parameters={"COM_LOW_BAT_ACT": 0})
    since = hovering(rig)
    rig.flight.set_charge(0.06)
    rig.run(8.0)
    assert rig.vehicle.mode.name == LOITER
    assert "Preflight Fail: low battery\t" in rig.texts(since)


def test_without_a_position_it_sinks_level_and_reports_land(bench: Any) -> None:
    rig = bench()
    since = hovering(rig)
    rig.flight.block_gps()
    rig.run_until(lambda: rig.vehicle.mode.name == LAND, within=20.0)
    rig.run(0.2)
    assert "Failsafe activated\t" in rig.texts(since)
    rig.run_until(lambda: not rig.vehicle.armed, within=60.0)


def test_a_lost_ground_station_counts_only_where_it_is_asked_for(bench: Any) -> None:
    still = bench(beats=False)
    beating = [still.kernel.every(10**9, lambda: still.send("HEARTBEAT", type=6, autopilot=8))]
    hovering(still)
    beating[0].cancel()
    still.run(20.0)
    assert still.vehicle.mode.name == LOITER


def test_a_lost_ground_station_brings_it_home(bench: Any) -> None:
    rig = bench(beats=False, parameters={"NAV_DLL_ACT": 2})
    beating = rig.kernel.every(10**9, lambda: rig.send("HEARTBEAT", type=6, autopilot=8))
    hovering(rig)
    beating.cancel()
    rig.run(9.0)
    assert rig.vehicle.mode.name == LOITER
    rig.run(8.0)
    assert rig.vehicle.mode.name == RTL
    rig.run_until(lambda: not rig.vehicle.armed, within=120.0)


def test_the_user_may_leave_a_failsafe(bench: Any) -> None:
    rig = bench(parameters={"COM_OBL_RC_ACT": 3})
    rig.airborne()
    rig.offboard(z=-9.0)
    rig.run(2.0)
    rig.stop_stream()
    rig.run(3.0)
    assert rig.vehicle.mode.name == RTL
    assert rig.mode(4, 3) == 0
    rig.run(2.0)
    assert rig.vehicle.mode.name == LOITER
    rig.stream(z=-9.0)
    rig.run(1.0)
    assert rig.vehicle.mode.name == LOITER  # another wish is another wish


def in_lost_sticks(rig: Any) -> None:
    """Hovering in LOITER after the loss of sticks that were in use."""
    rig.airborne()
    rig.sticks()
    rig.run(1.0)
    rig.stop_stream()
    rig.run(1.5)
    assert rig.latest["HEARTBEAT"]["system_status"] == 5


def test_a_mode_of_the_user_stays_while_the_sticks_are_still_lost(bench: Any) -> None:
    """Recorded: LAND, then LOITER: no second return, and the status stays critical."""
    rig = bench()
    in_lost_sticks(rig)
    assert rig.mode(4, 6) == 0
    rig.run(2.0)
    assert rig.latest["HEARTBEAT"]["system_status"] == 5
    assert rig.mode(4, 3) == 0
    since = rig.now
    rig.run(12.0)
    assert rig.vehicle.mode.name == LOITER
    assert rig.latest["HEARTBEAT"]["system_status"] == 5
    assert not [text for text in rig.texts(since) if "Failsafe" in text]


def test_sticks_that_return_and_are_lost_again_are_a_failsafe_again(bench: Any) -> None:
    rig = bench()
    in_lost_sticks(rig)
    assert rig.mode(4, 3) == 0
    rig.sticks()
    rig.run(1.0)
    assert rig.latest["HEARTBEAT"]["system_status"] == 4
    rig.stop_stream()
    rig.run(8.0)
    assert rig.vehicle.mode.name == RTL


def test_after_a_kill_in_the_air_it_counts_as_landed_at_once(bench: Any) -> None:
    """Observed 0.42 s after a kill at 25 m; the vehicle is still falling."""
    rig = bench(use="onboard")
    rig.airborne(25.0)
    assert rig.command(400, 0, 21196) == 0
    killed = rig.now
    rig.run_until(lambda: rig.latest["EXTENDED_SYS_STATE"]["landed_state"] == 1, within=1.0)
    assert rig.now - killed == pytest.approx(0.42, abs=0.22)  # sent five times a second
    assert rig.height > 10.0


@pytest.mark.parametrize(("action", "mode"), [(1, LOITER), (2, LOITER), (3, RTL), (5, LAND)])
def test_outside_its_geofence_it_does_what_gf_action_says(action: int, mode: str, bench: Any) -> None:
    rig = bench(parameters={"GF_ACTION": action, "GF_MAX_HOR_DIST": 12.0})
    rig.airborne()
    rig.offboard(x=30.0, y=0.0, z=-9.0)
    rig.run_until(lambda: rig.ned[0] > 12.5, within=10.0)
    rig.run(0.2)
    assert "Maximum distance from home reached (12.00000)\t" in rig.texts()
    rig.run(6.5)
    assert rig.vehicle.mode.name == ("OFFBOARD" if action == 1 else mode)


def test_a_rover_drives_where_the_stream_says_and_stops_without_it(bench: Any) -> None:
    rig = bench("rover")
    rig.ready()
    rig.stream(x=15.0, y=5.0, z=0.0)
    rig.run(0.1)
    assert rig.mode(6) == 0
    assert rig.command(400, 1) == 0
    rig.run(4.0)
    assert rig.ned[0] > 4.0
    rig.stop_stream()
    rig.run(4.0)
    stopped = rig.ned
    rig.run(2.0)
    assert abs(rig.ned[0] - stopped[0]) < 0.3
    assert rig.latest["HEARTBEAT"]["type"] == 10


def set_to(rig: Any, name: str, value: float) -> None:
    kind = rig.vehicle.parameters.find(name).type
    rig.send("PARAM_SET", **TARGET, param_id=name, param_value=to_bytewise(kind, value), param_type=kind)
    rig.run(0.05)


@pytest.mark.parametrize("version", ["1.14", "1.17"])
def test_without_satellites_it_lands_after_five_seconds_and_is_not_armed(version: str, rig_of: Any) -> None:
    rig = rig_of(version)
    rig.airborne()
    set_to(rig, "SIM_GPS_USED", 0.0)
    taken = rig.run_until(lambda: rig.vehicle.mode.name == LAND, within=8.0)
    assert taken == pytest.approx(5.0, abs=0.5)
    rig.run_until(lambda: not rig.vehicle.armed, within=60.0)
    assert rig.command(400, 1) == 1


def test_a_battery_drains_as_the_parameters_of_the_simulator_say(bench: Any) -> None:
    rig = bench(parameters={"COM_LOW_BAT_ACT": 2})
    rig.ready()
    full = rig.vehicle.estimate.battery_left
    set_to(rig, "SIM_BAT_DRAIN", 30.0)
    set_to(rig, "SIM_BAT_MIN_PCT", 6.0)
    rig.airborne()
    rig.run_until(lambda: rig.vehicle.mode.name == LAND, within=40.0)
    assert rig.vehicle.estimate.battery_left == pytest.approx(0.06, abs=0.01)
    rig.run_until(lambda: not rig.vehicle.armed, within=120.0)
    rig.run(0.3)
    assert rig.vehicle.estimate.battery_left == pytest.approx(full, abs=0.05)  # exchanged, as there
    assert rig.command(420, 100, 1) == 0
    rig.run(5.0)
    assert rig.command(400, 1) == 1  # below the critical level
    assert rig.command(420, 100, 0) == 0
    set_to(rig, "SYS_FAILURE_EN", 0.0)
    assert rig.command(420, 100, 0) == 2


@pytest.mark.parametrize("version", ["1.14", "1.17"])
def test_a_terminated_vehicle_stays_armed_and_is_not_armed_again(version: str, rig_of: Any) -> None:
    rig = rig_of(version)
    rig.airborne()
    assert rig.command(185, 1) == 0
    rig.run(6.0)
    assert rig.vehicle.armed
    assert rig.latest["HEARTBEAT"]["system_status"] == 8
    assert rig.height < 1.0
    assert rig.command(400, 0) == 1
    assert rig.command(400, 0, 21196) == 0
    assert rig.command(400, 1) == 1


@pytest.mark.parametrize("version", ["1.14", "1.17"])
def test_a_mission_beyond_the_fence_is_not_started(version: str, rig_of: Any) -> None:
    rig = rig_of(version, parameters={"GF_MAX_HOR_DIST": 40.0})
    rig.airborne()
    latitude, longitude, _ = rig.vehicle.estimate.geodetic
    place = {"x": round((latitude + 5e-4) * 1e7), "y": round(longitude * 1e7), "z": 10.0}
    rig.vehicle.mission.replace([MissionItem(16, 6, **place)])
    since = rig.now
    rig.run(0.2)
    rig.mode(4, 4)
    rig.run(0.1)
    assert rig.latest["COMMAND_ACK"]["result"] == 1
    assert rig.vehicle.mode.name == LOITER
    name = {"1.14": "AUTO_MISSION", "1.17": "Mission"}[version]
    assert rig.texts(since) == [
        "Geofence violation for waypoint 1\t",
        f"Switching to {name} is currently not available\t",
    ]


def test_body_rates_alone_are_flown_in_offboard(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    fields = {"time_boot_ms": 0, **TARGET, "type_mask": 128, "q": (1.0, 0.0, 0.0, 0.0), "thrust": 0.5}
    rates = {"body_roll_rate": 0.0, "body_pitch_rate": 0.0, "body_yaw_rate": 0.5}
    rig.kernel.every(50_000_000, lambda: rig.send("SET_ATTITUDE_TARGET", **fields, **rates))
    rig.run(0.2)
    before = rig.vehicle.estimate.attitude[2]
    assert rig.mode(6) == 0
    rig.run(2.0)
    assert rig.vehicle.mode.name == "OFFBOARD"
    assert remainder(rig.vehicle.estimate.attitude[2] - before, tau) == pytest.approx(1.0, abs=0.35)
    assert rig.latest["HEARTBEAT"]["base_mode"] == 129


def test_gf_action_1_only_warns_and_a_destination_beyond_is_flown_to(bench: Any) -> None:
    rig = bench(parameters={"GF_ACTION": 1, "GF_MAX_HOR_DIST": 20.0})
    rig.airborne()
    latitude, longitude, amsl = rig.vehicle.estimate.geodetic
    there = {"x": round((latitude + 3e-4) * 1e7), "y": round(longitude * 1e7), "z": amsl, "param4": nan}
    assert rig.command_int(192, param1=-1, param2=1, **there) == 0
    rig.run_until(lambda: rig.ned[0] > 25.0, within=30.0)
