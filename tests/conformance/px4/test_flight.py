"""How it flies: take-off, a leg, landing, returning, against the recorded figures."""

from __future__ import annotations

from math import cos, degrees, hypot, radians, remainder, sin, tau
from typing import Any

import pytest

from volery.simulation.autopilots.px4.loop_state import A_POSITION
from volery.simulation.world.environment_models import Wind

OFFBOARD, POSCTL, LOITER, RTL, LAND = 0x00060000, 0x00030000, 0x03040000, 0x05040000, 0x06040000


def test_takeoff_is_noticed_and_ends_short(facts: dict[str, Any], bench: Any) -> None:
    rig, recorded = bench(), facts["flight"]
    rig.ready()
    start = rig.vehicle.estimate.geodetic[2]
    assert rig.command(22, -1, 0, 0, float("nan"), float("nan"), float("nan"), start + 10.0) == 0
    assert not rig.vehicle.armed
    armed = rig.now
    assert rig.command(400, 1) == 0
    up = rig.run_until(lambda: rig.vehicle.mode.name == "AUTO.LOITER")
    assert rig.said_at("Takeoff detected\t") - armed == pytest.approx(recorded["takeoff_detected"], abs=0.3)
    assert up == pytest.approx(recorded["takeoff"], abs=1.2)
    rig.run(10.0)
    assert rig.height == pytest.approx(recorded["hover_after_10_m"], abs=0.7)
    assert rig.height < 9.7


def test_a_leg_in_offboard_is_quick_and_ends_too_far(facts: dict[str, Any], bench: Any) -> None:
    rig, recorded = bench(), facts["flight"]["leg"]
    rig.airborne()
    rig.offboard(x=0.0, y=0.0, z=-9.0)
    rig.run(6.0)
    rig.stream(x=50.0, y=0.0, z=-9.0)
    reached = rig.run_until(lambda: rig.ned[0] > 49.5)
    farthest = 0.0
    for _ in range(60):
        rig.run(0.1)
        farthest = max(farthest, rig.ned[0] - 50.0)
    assert reached == pytest.approx(recorded["within_half_a_metre"], abs=0.25)
    assert farthest == pytest.approx(recorded["overshoot"], abs=0.5)


@pytest.mark.parametrize(("north", "first", "past"), [(36.0, 10.8, 0.7), (220.0, 46.8, 0.95)])
def test_a_leg_by_reposition_creeps_up_to_the_cruise_and_ends_too_far(
    north: float, first: float, past: float, bench: Any
) -> None:
    """Observed: 4.2 m/s first, 4.9 to 5.0 m/s after 20 s; a leg of 36 m ended 0.7 m too far.

    The 1.5 m after 220 m contain half a metre by which the recorded estimate wanders.
    """
    rig = bench()
    rig.airborne(30.0)
    rig.run(8.0)
    latitude, longitude, amsl = rig.vehicle.estimate.geodetic
    there = round((latitude + north / 111_200.0) * 1e7)
    start = rig.ned[0]
    nan = float("nan")
    place = {"x": there, "y": round(longitude * 1e7), "z": amsl, "param4": nan}
    assert rig.command_int(192, param1=-1, param2=1, **place) == 0
    flown = []
    for tenth in range(1, round(10 * (first + 20.0))):
        rig.run(0.1)
        flown.append((tenth / 10.0, rig.ned[0] - start, rig.vehicle.estimate.velocity[0]))
    assert next(at for at, way, _ in flown if way > north - 1.0) == pytest.approx(first, rel=0.05)
    assert max(speed for _, _, speed in flown) == pytest.approx(5.0 if north > 100.0 else 4.5, abs=0.2)
    assert max(way for _, way, _ in flown) - north == pytest.approx(past, abs=0.25)
    assert flown[-1][1] - north < 0.6
    assert abs(flown[-1][2]) < 0.2
    if north > 100.0:
        assert flown[60][2] == pytest.approx(4.3, abs=0.2)
        assert flown[250][2] == pytest.approx(4.95, abs=0.15)


def test_the_nose_swings_past_a_new_course(bench: Any) -> None:
    """Logged of 40 flights in SIH past a turn of 49 degrees: by 15.6, for 1.12 s by more than 3."""
    rig = bench()
    rig.airborne(30.0)
    rig.run(8.0)
    latitude, longitude, amsl = rig.vehicle.estimate.geodetic
    heading = rig.vehicle.estimate.attitude[2]
    there = [way / 111_200.0 for way in (100.0 * cos(heading + 0.85), 100.0 * sin(heading + 0.85))]
    x, y = (latitude + there[0]) * 1e7, (longitude + there[1] / cos(radians(latitude))) * 1e7
    place = {"x": round(x), "y": round(y), "z": amsl, "param4": float("nan")}
    assert rig.command_int(192, param1=-1, param2=1, **place) == 0
    past = []
    for _ in range(80):
        rig.run(0.1)
        past.append(degrees(remainder(rig.vehicle.estimate.attitude[2] - heading - 0.85, tau)))
    assert max(past) == pytest.approx(15.6, rel=0.1)
    assert 0.1 * sum(angle > 3.0 for angle in past) == pytest.approx(1.12, rel=0.1)
    assert past[-1] == pytest.approx(0.0, abs=1.0)


def test_with_noise_the_airframe_of_the_loops_is_reported(bench: Any) -> None:
    """The body of the model is up to 0.2 m behind it, which is no error of EKF2."""
    rig = bench(sensors="sih", seed=2)
    rig.airborne()
    rig.offboard(x=0.0, y=0.0, z=-9.0)
    rig.run(6.0)
    rig.stream(x=50.0, y=0.0, z=-9.0)
    reported, flown = [], []
    for _ in range(120):
        rig.run(0.1)
        reported.append(rig.vehicle.estimate.position[0])
        flown.append(rig.vehicle.firmware_state.control._row[A_POSITION])
    assert max(flown) > 50.5
    assert max(reported) == pytest.approx(max(flown), abs=0.015)


def test_the_landed_detector_waits_while_the_vertical_estimate_moves(bench: Any) -> None:
    """Logged of 27 landings: 5.0 to 5.5 s from touch-down to disarming in 21, up to 9.0 s in the others."""
    moved = 0
    for seed in range(1, 28):
        rig = bench(sensors="sih", seed=seed)
        rig.airborne()
        assert rig.mode(4, 6) == 0
        last = 0.0
        while not rig.vehicle.landed:
            rig.run(0.1)
            if rig.vehicle.firmware_state.control.seems_to_move:
                last, moved = rig.now, moved + 1
        assert rig.now - last > 2.9
    assert moved


def test_in_wind_it_stays_where_it_touches_the_ground(rig_of: Any) -> None:
    """No thrust is left after a ground contact, also while the landed detector waits."""
    slides = []
    for seed in range(1, 5):
        rig = rig_of("1.17", seed=seed)
        rig.airborne(3.0)
        rig.world.set_wind(Wind(east=4.0, north=4.5, gust=1.0))
        rig.run(6.0)
        assert rig.mode(4, 6) == 0
        rig.run_until(lambda rig=rig: rig.world.truth(0).on_ground)
        touched = rig.world.truth(0).position
        rig.run_until(lambda rig=rig: not rig.vehicle.armed)
        rests = rig.world.truth(0).position
        slides.append(hypot(rests[0] - touched[0], rests[1] - touched[1]))
    assert max(slides) < 0.25


@pytest.mark.parametrize(("place", "crawls"), [(0, True), (1, False)])
def test_landing_takes_as_long_as_recorded(
    place: int, crawls: bool, facts: dict[str, Any], bench: Any
) -> None:
    """Landings scatter with the noise of SIH: beside its point by 0.5 to 1 m, the recorded aircraft sank at
    0.6 to 0.75 of its speed. The first one sank slower still from DISTANCE_SENSOR 1 m on, at MPC_LAND_CRWL.
    """
    recorded, taken = facts["flight"]["landings"][place], []
    for seed in range(1, 31):
        rig = bench(sensors="sih", seed=seed)
        rig.airborne()
        rig.vehicle.firmware_state.reads_range = crawls
        rig.offboard(x=0.0, y=0.0, z=rig.ned[2] + rig.height - recorded["from"])
        rig.run(12.0)
        assert rig.height == pytest.approx(recorded["from"], abs=0.5)
        start = rig.now
        assert rig.mode(4, 6) == 0
        rig.stop_stream()
        rig.run_until(lambda rig=rig: not rig.vehicle.armed)
        landed = rig.said_at("Landing detected\t", start)
        taken.append(landed - start)
        rig.run(0.2)
        to_disarm = rig.said_at("Disarmed by landing\t", start) - landed
        assert to_disarm == pytest.approx(recorded["to_disarm"], abs=0.15)
    assert min(taken) <= recorded["seconds"] <= max(taken)
    fifteen = taken[:15]  # as many landings from 20 m were logged: 24.2 to 30.2 s
    assert max(fifteen) - min(fifteen) < 6.0


def test_disarms_ten_seconds_after_arming_without_a_takeoff(bench: Any) -> None:
    rig = bench()
    rig.ready()
    start = rig.now
    assert rig.command(400, 1) == 0
    rig.run_until(lambda: not rig.vehicle.armed)
    assert rig.now - start == pytest.approx(10.0, abs=0.2)
    rig.run(0.1)
    assert rig.texts()[-1] == "Disarmed by auto preflight disarming\t"


@pytest.mark.parametrize(("action", "mode"), [(0, POSCTL), (3, RTL), (4, LAND), (5, LOITER)])
def test_loss_of_the_stream_and_its_return(action: int, mode: int, facts: dict[str, Any], bench: Any) -> None:
    rig = bench(parameters={"COM_OBL_RC_ACT": action})
    rig.airborne()
    rig.offboard(z=-9.0)
    rig.run(2.0)
    rig.stop_stream()
    last = rig.now
    rig.run(4.0)
    recorded = [loss["silence"] for loss in facts["losses"]]
    silence = rig.said_at("Failsafe activated\t", last) - last
    assert min(recorded) - 0.1 <= silence <= max(recorded) + 0.1
    assert rig.latest["HEARTBEAT"]["custom_mode"] == mode
    assert rig.latest["HEARTBEAT"]["system_status"] == 5
    rig.stream(z=-9.0)
    rig.run(1.2)
    assert rig.latest["HEARTBEAT"]["custom_mode"] == OFFBOARD
    assert rig.latest["HEARTBEAT"]["system_status"] == 4


def test_without_sticks_posctl_sinks(facts: dict[str, Any], bench: Any) -> None:
    rig = bench()
    rig.airborne()
    rig.offboard(z=-9.0)
    rig.run(2.0)
    rig.stop_stream()
    rig.run(3.0)
    high = rig.height
    rig.run(5.0)
    assert (high - rig.height) / 5.0 == pytest.approx(facts["flight"]["sink_without_sticks"], abs=0.1)


@pytest.mark.parametrize(("rate", "keeps"), [(1.2, True), (0.8, False)])
def test_a_slow_stream(rate: float, keeps: bool, bench: Any) -> None:
    rig = bench()
    rig.airborne()
    rig.offboard(z=-9.0)
    rig.stream(rate=rate, z=-9.0)
    start = rig.now
    rig.run(8.0)
    lost = [text for text in rig.texts(start) if text == "Failsafe activated\t"]
    assert bool(lost) is not keeps
    if not keeps:
        assert len(lost) >= 4  # it comes back with every set-point, and goes again


def test_offboard_is_accepted_at_the_first_setpoint_and_not_before(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    assert rig.mode(6) == 1
    assert rig.texts()[-1] == "Switching to OFFBOARD is currently not available\t"
    rig.stream(rate=2.0)
    rig.run(0.02)
    assert rig.mode(6) == 0


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"coordinate_frame": 7}, "SET_POSITION_TARGET_LOCAL_NED coordinate frame 7 unsupported\t"),
        ({"coordinate_frame": 9}, "SET_POSITION_TARGET_LOCAL_NED coordinate frame 9 unsupported\t"),
        ({"type_mask": 4095}, "SET_POSITION_TARGET_LOCAL_NED invalid\t"),
    ],
)
def test_invalid_setpoints_are_reported_each_time_and_do_not_count(
    fields: dict[str, int], words: str, bench: Any
) -> None:
    rig = bench()
    rig.airborne()
    start = rig.now
    rig.stream(rate=10.0, **fields)
    rig.run(1.05)
    assert rig.texts(start).count(words) == 11
    assert rig.mode(6) == 1


def test_velocities_in_the_body_frame_turn_with_the_nose(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    heading = rig.vehicle.estimate.attitude[2]
    before = rig.ned
    rig.offboard(coordinate_frame=8, type_mask=1479, vx=2.0, yaw_rate=0.35)
    rig.run(4.0)
    away = (rig.ned[0] - before[0], rig.ned[1] - before[1])
    assert away[0] > 1.5
    assert away[1] > 0.5
    assert rig.vehicle.estimate.attitude[2] > heading + 0.7


@pytest.mark.parametrize(("later", "ends_north"), [(0.1, 0.0), (2.2, 20.0)])
def test_a_return_right_after_home_was_moved_ends_at_the_old_one(
    later: float, ends_north: float, bench: Any
) -> None:
    """Measured on 1.14: it lands 20 m off. The destination is taken from home every two seconds."""
    rig = bench()
    rig.ready()
    latitude, longitude, amsl = rig.vehicle.estimate.geodetic
    rig.airborne()
    checked = rig.vehicle.firmware_state._return_checked
    rig.run_until(lambda: rig.vehicle.firmware_state._return_checked != checked, 3.0)
    moved = {"x": round((latitude + 20.0 / 111_200.0) * 1e7), "y": round(longitude * 1e7), "z": amsl}
    assert rig.command_int(179, **moved) == 0
    rig.run(later)
    assert rig.mode(4, 5) == 0
    rig.run_until(lambda: not rig.vehicle.armed)
    assert rig.ned[0] == pytest.approx(ends_north, abs=2.0)


def test_the_nose_turns_to_a_region_of_interest_until_there_is_none(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    latitude, longitude, amsl = rig.vehicle.estimate.geodetic
    east = {"x": round(latitude * 1e7), "y": round((longitude + 0.001) * 1e7), "z": amsl}
    assert rig.command_int(195, **east) == 0
    rig.run(8.0)
    assert rig.vehicle.estimate.attitude[2] == pytest.approx(1.57, abs=0.1)
    assert rig.command_int(197) == 0
    assert rig.vehicle.commanded.look_at is None


def test_a_gripper_is_there_where_it_is_enabled(bench: Any) -> None:
    rig = bench()
    rig.ready()
    assert rig.command(211, 1, 1) is None
    rig = bench(parameters={"PD_GRIPPER_EN": 1})
    rig.ready()
    assert rig.command(211, 1, 1) == 0
    assert rig.command(211, 1, 5) == 2
