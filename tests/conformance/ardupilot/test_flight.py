"""How a copter flies in GUIDED and in the modes that fly by themselves, against the recorded times."""

from __future__ import annotations

from math import cos, degrees, hypot, radians, sin
from typing import Any

import pytest

from volery.simulation.world.environment_models import Wind

TOLERANCE = 0.2
"""Of the recorded times."""

LOCAL_NED, LOCAL_OFFSET, BODY, BODY_OFFSET = 1, 7, 8, 9
ONLY_POSITION, ONLY_VELOCITY, VELOCITY_AND_RATE, POSITION_AND_YAW = 3576, 3527, 1479, 2552


def fly_to(rig: Any, **fields: Any) -> None:
    rig.send("SET_POSITION_TARGET_LOCAL_NED", target_system=1, target_component=1, **fields)


def position(rig: Any) -> tuple[float, float, float]:
    return rig.vehicle.estimate.position


def speed(rig: Any) -> float:
    north, east, _ = rig.vehicle.estimate.velocity
    return hypot(north, east)


def test_take_off_to_ten_metres_takes_the_recorded_time(bench: Any, facts: Any) -> None:
    rig, recorded = bench(), facts["guided"]
    rig.beat()
    rig.command(511, 245, 100_000)
    rig.mode(4)
    rig.command(400, 1)
    assert rig.command(22, 0, 0, 0, 0, 0, 0, 10) == 0
    start = rig.now
    rig.run_until(lambda: rig.height > 0.2)
    assert rig.now - start == pytest.approx(recorded["lift_off"], rel=TOLERANCE)
    rig.run_until(lambda: rig.height > 9.5)
    assert rig.now - start == pytest.approx(recorded["up_to_9_5_m"], rel=TOLERANCE)
    rig.run(3.0)
    assert rig.height == pytest.approx(10.0, abs=0.4)
    states = list(dict.fromkeys(one.fields["landed_state"] for one in rig.of("EXTENDED_SYS_STATE")))
    assert states == [1, 3, 2]


def test_a_leg_of_fifty_metres_takes_the_recorded_time(bench: Any, facts: Any) -> None:
    rig, recorded = bench(), facts["guided"]
    rig.airborne()
    north, _, down = position(rig)
    rig.command(512, 242)
    home = rig.latest["HOME_POSITION"]
    latitude = round((home["latitude"] / 1e7 + (north - home["x"] + 50.0) / 110_940.0) * 1e7)
    goal = rig.vehicle.flight.to_ned(latitude / 1e7, home["longitude"] / 1e7, 0.0)[0]
    rig.send(
        "SET_POSITION_TARGET_GLOBAL_INT",
        target_system=1,
        target_component=1,
        coordinate_frame=6,
        type_mask=ONLY_POSITION,
        lat_int=latitude,
        lon_int=home["longitude"],
        alt=10.0,
    )
    start, peak, farthest, outside = rig.now, 0.0, north, rig.now
    while rig.now - start < 20.0:
        rig.run(0.1)
        peak, farthest = max(peak, speed(rig)), max(farthest, position(rig)[0])
        if abs(position(rig)[0] - goal) > 0.4:
            outside = rig.now
    assert outside - start == pytest.approx(recorded["leg_settled"], rel=TOLERANCE)
    assert peak == pytest.approx(recorded["leg_peak_speed"], rel=TOLERANCE)
    assert farthest - goal == pytest.approx(recorded["leg_overshoot"], rel=TOLERANCE)
    assert position(rig)[2] == pytest.approx(down, abs=0.5)
    assert rig.vehicle.estimate.attitude[2] == pytest.approx(0.0, abs=0.02)  # it faces the way, as recorded


def test_landing_from_ten_metres_takes_the_recorded_time(bench: Any, facts: Any) -> None:
    rig, recorded = bench(), facts["guided"]
    rig.command(511, 245, 100_000)
    rig.airborne()
    assert rig.mode(9) == 0
    start = rig.now
    rig.run_until(lambda: rig.texts()[-1] == "Disarming motors")
    assert rig.now - start == pytest.approx(recorded["land_to_disarm"], rel=TOLERANCE)
    touched = next(
        one.at for one in rig.of("STATUSTEXT") if one.fields["text"].startswith("SIM Hit ground at 0.")
    )
    assert rig.now - touched == pytest.approx(recorded["touch_down_to_disarm"], abs=0.2)
    states = list(dict.fromkeys(one.fields["landed_state"] for one in rig.of("EXTENDED_SYS_STATE")))
    assert states == [1, 3, 2, 4]


def test_in_wind_it_closes_the_throttle_and_stays_where_it_touches_the_ground(bench: Any) -> None:
    """Recorded: 6 % of throttle 0.3 s after touch-down, none after 0.6 s."""
    slides = []
    for seed in range(1, 4):
        rig = bench(seed=seed)
        rig.airborne()
        rig.world.set_wind(Wind(east=4.0, north=4.5, gust=1.0))
        assert rig.mode(9) == 0
        rig.run_until(lambda rig=rig: rig.world.truth(0).on_ground)
        touched = rig.world.truth(0).position
        rig.run(0.8)
        assert rig.vehicle.estimate.throttle < 0.08
        rig.run_until(lambda rig=rig: not rig.vehicle.armed)
        rests = rig.world.truth(0).position
        slides.append(hypot(rests[0] - touched[0], rests[1] - touched[1]))
    assert max(slides) < 0.15


def test_landing_from_above_ten_metres_is_fast_at_first(bench: Any) -> None:
    rig = bench()
    rig.airborne(20.0)
    rig.mode(9)
    rig.run(5.0)
    assert rig.vehicle.estimate.velocity[2] == pytest.approx(1.5, abs=0.2)
    rig.run_until(lambda: rig.height < 8.0)
    rig.run(1.0)
    assert rig.vehicle.estimate.velocity[2] == pytest.approx(0.5, abs=0.1)


def test_left_on_the_ground_it_disarms_after_ten_seconds(bench: Any, facts: Any) -> None:
    rig = bench()
    rig.run(0.5)
    rig.mode(4)
    rig.command(400, 1)
    start = rig.now
    rig.run_until(lambda: not rig.vehicle.armed)
    assert rig.now - start == pytest.approx(facts["idle_disarm"], abs=0.3)


def test_a_point_does_not_lift_it_off_the_ground(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    rig.mode(4)
    rig.command(400, 1)
    fly_to(rig, coordinate_frame=LOCAL_NED, type_mask=ONLY_POSITION, x=5.0, z=-5.0)
    rig.run(8.0)
    assert rig.height < 0.3
    assert rig.vehicle.landed


def test_velocities_expire_after_three_seconds_and_points_never(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    fly_to(rig, coordinate_frame=LOCAL_NED, type_mask=ONLY_VELOCITY, vx=3.0)
    rig.run(2.9)
    assert speed(rig) == pytest.approx(3.0, abs=0.5)
    rig.run(4.0)
    assert speed(rig) < 0.3
    fly_to(rig, coordinate_frame=LOCAL_NED, type_mask=ONLY_POSITION, x=40.0, y=-10.0, z=-12.0)
    rig.run(25.0)
    assert position(rig) == pytest.approx((40.0, -10.0, -12.0), abs=0.6)


@pytest.mark.parametrize("frame", [LOCAL_OFFSET, BODY, BODY_OFFSET])
def test_offsets_are_from_where_it_is_and_body_frames_turn_with_it(frame: int, bench: Any) -> None:
    rig = bench()
    rig.airborne()
    rig.command(115, 90, 0, 1, 0)
    rig.run(6.0)
    before = position(rig)
    heading = rig.vehicle.estimate.attitude[2] if frame != LOCAL_OFFSET else 0.0
    fly_to(rig, coordinate_frame=frame, type_mask=ONLY_POSITION, x=10.0, y=5.0, z=-3.0)
    rig.run(15.0)
    north = 10.0 * cos(heading) - 5.0 * sin(heading)
    east = 10.0 * sin(heading) + 5.0 * cos(heading)
    after = position(rig)
    assert after == pytest.approx((before[0] + north, before[1] + east, before[2] - 3.0), abs=0.6)


def test_a_velocity_may_come_with_a_turn_rate(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    fly_to(rig, coordinate_frame=BODY, type_mask=VELOCITY_AND_RATE, vx=2.0, yaw_rate=0.3)
    rig.run(2.5)
    assert rig.vehicle.estimate.rates[2] == pytest.approx(0.3, abs=0.08)


def test_a_point_may_come_with_a_heading(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    fly_to(rig, coordinate_frame=LOCAL_OFFSET, type_mask=POSITION_AND_YAW, x=1.0, yaw=radians(120.0))
    rig.run(8.0)
    assert degrees(rig.vehicle.estimate.attitude[2]) == pytest.approx(120.0, abs=5.0)


@pytest.mark.parametrize(
    ("mask", "frame"),
    [(ONLY_POSITION & ~0b1 | 0b1, LOCAL_NED), (4095, LOCAL_NED), (ONLY_POSITION, 12), (ONLY_POSITION, 3)],
    ids=["two axes of three", "nothing asked", "unknown frame", "global frame"],
)
def test_incomplete_or_unknown_targets_are_ignored(mask: int, frame: int, bench: Any) -> None:
    rig = bench()
    rig.airborne()
    before = position(rig)
    fly_to(rig, coordinate_frame=frame, type_mask=mask, x=30.0, y=30.0, z=-30.0)
    rig.run(5.0)
    assert position(rig) == pytest.approx(before, abs=0.6)


def test_targets_outside_guided_are_ignored(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    rig.mode(17)
    before = position(rig)
    fly_to(rig, coordinate_frame=LOCAL_NED, type_mask=ONLY_POSITION, x=30.0, y=0.0, z=-10.0)
    rig.run(5.0)
    assert position(rig) == pytest.approx(before, abs=0.6)


def test_attitude_targets_lean_and_climb_and_expire(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    quaternion = (cos(radians(5.0)), 0.0, -sin(radians(5.0)), 0.0)  # ten degrees nose down, nose north
    rig.send(
        "SET_ATTITUDE_TARGET", target_system=1, target_component=1, type_mask=7, q=quaternion, thrust=0.7
    )
    rig.run(2.5)
    assert degrees(rig.vehicle.estimate.attitude[1]) == pytest.approx(-10.0, abs=2.5)
    assert rig.vehicle.estimate.velocity[2] == pytest.approx(-1.0, abs=0.3)
    rig.run(3.0)
    assert degrees(rig.vehicle.estimate.attitude[1]) == pytest.approx(0.0, abs=2.5)
    assert abs(rig.vehicle.estimate.velocity[2]) < 0.2


def test_reposition_enters_guided_with_its_flag(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    latitude, longitude, _ = rig.vehicle.estimate.geodetic
    place = {
        "x": round((latitude + 0.0002) * 1e7),
        "y": round(longitude * 1e7),
        "z": 12.0,
        "param4": float("nan"),
    }
    rig.mode(17)
    assert rig.command_int(192, frame=3, param1=-1.0, param2=0.0, **place) == 2
    assert rig.command_int(192, frame=3, param1=3.0, param2=1.0, **place) == 0
    assert rig.vehicle.mode.name == "GUIDED"
    rig.run(4.0)
    assert speed(rig) > 4.0  # the original ignores the speed of the command
    rig.run(16.0)
    assert rig.vehicle.estimate.geodetic[0] == pytest.approx(latitude + 0.0002, abs=8e-6)
    assert rig.height == pytest.approx(12.0, abs=0.5)


def test_speed_can_be_changed_until_the_mode_changes(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    assert rig.command(178, 1, 2.0) == 0
    fly_to(rig, coordinate_frame=LOCAL_OFFSET, type_mask=ONLY_POSITION, x=60.0)
    rig.run(3.0)
    assert speed(rig) > 3.0  # the first target after a take-off restores WPNAV_SPEED
    assert rig.command(178, 1, 2.0) == 0
    rig.run(6.0)
    assert speed(rig) == pytest.approx(2.0, abs=0.3)
    rig.mode(17)
    rig.mode(4)
    fly_to(rig, coordinate_frame=LOCAL_OFFSET, type_mask=ONLY_POSITION, x=60.0)
    rig.run(5.0)
    assert speed(rig) > 4.0


def test_yaw_turns_to_a_heading_and_by_an_angle(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    assert rig.command(115, 180, 0, 1, 0) == 0
    rig.run(8.0)
    assert abs(degrees(rig.vehicle.estimate.attitude[2])) == pytest.approx(180.0, abs=4.0)
    assert rig.command(115, 90, 0, -1, 1) == 0
    rig.run(6.0)
    assert degrees(rig.vehicle.estimate.attitude[2]) == pytest.approx(90.0, abs=5.0)


def test_brake_stops_with_the_jerk_of_the_position_controller(bench: Any) -> None:
    """Speed fades with BRAKE_MODE_DECEL_RATE / PSC_JERK_XY = 1.5 s: 15 m from 10 m/s, and a lag."""
    rig = bench()
    rig.airborne()
    fly_to(rig, coordinate_frame=LOCAL_OFFSET, type_mask=ONLY_POSITION, x=100.0)
    rig.run(6.0)
    assert speed(rig) > 6.0
    rig.mode(17)
    before = position(rig)
    rig.run(5.0)
    assert speed(rig) < 0.4
    assert 15.0 < position(rig)[0] - before[0] < 22.0


def test_return_climbs_flies_waits_and_lands_at_home(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    fly_to(rig, coordinate_frame=LOCAL_OFFSET, type_mask=ONLY_POSITION, x=30.0, y=20.0)
    rig.run(15.0)
    heading = rig.vehicle.estimate.attitude[2]
    assert rig.mode(6) == 0
    highest = 0.0
    start = rig.now
    while rig.vehicle.armed and rig.now - start < 120.0:
        rig.run(0.5)
        highest = max(highest, rig.height)
    assert highest == pytest.approx(15.0, abs=0.6)
    north, east, _ = position(rig)
    home = rig.vehicle.home.ned
    assert hypot(north - home[0], east - home[1]) < 0.7
    assert rig.vehicle.estimate.attitude[2] == pytest.approx(heading, abs=0.15)
    assert 35.0 < rig.now - start < 60.0


def test_return_stays_low_close_to_home(bench: Any) -> None:
    rig = bench()
    rig.airborne(4.0)
    rig.mode(6)
    rig.run(8.0)
    assert rig.height < 5.0


def test_loiter_takes_off_by_command_with_the_stick_in_its_middle(bench: Any) -> None:
    rig = bench()
    rig.beat()
    rig.mode(5)
    rig.sticks(1500, 1500, 1000, 1500)
    rig.run(0.1)
    assert rig.command(400, 1) == 0
    assert rig.command(22, 0, 0, 0, 0, 0, 0, 5) == 0
    rig.hold_sticks(15.0, 1500, 1500, 1500, 1500)
    assert rig.height == pytest.approx(5.0, abs=0.5)


def test_guided_after_a_fall_in_stabilize_catches_it(bench: Any) -> None:
    """A stick at zero across a change to STABILIZE idles the motors: it falls until GUIDED takes over."""
    rig = bench()
    rig.airborne(30.0)
    rig.mode(0)
    rig.run(0.5)
    assert rig.vehicle.estimate.velocity[2] > 2.0
    rig.mode(4)
    rig.run(8.0)
    assert rig.vehicle.armed
    assert abs(rig.vehicle.estimate.velocity[2]) < 0.3
    assert 5.0 < rig.height < 29.0


def test_landing_chosen_while_it_climbs_fast_brakes_hard(bench: Any) -> None:
    """The original brakes with the limit times twice the speed over its limit: 21 m/s end within 60 m."""
    rig = bench()
    rig.airborne()
    rig.mode(0)
    while rig.height < 37.0:
        rig.hold_sticks(0.1, 1500, 1500, 2000, 1500)
    climb = -rig.vehicle.estimate.velocity[2]
    assert climb > 10.0
    rig.mode(9)
    highest = rig.height
    for _ in range(100):
        rig.run(0.1)
        highest = max(highest, rig.height)
    assert highest < 37.0 + 60.0
    assert rig.vehicle.estimate.velocity[2] > 0.5


@pytest.mark.parametrize(
    ("params", "turned", "seconds"),
    [
        ((270, 0, 1, 0), 180.0, 3.94),
        ((180, 90, -1, 1), -180.0, 4.0),
        ((90, 30, 1, 1), 90.0, 3.66),
        ((90, 10, 1, 1), 90.0, 9.6),
    ],
    ids=["absolute clockwise", "relative anticlockwise", "30 deg/s", "10 deg/s"],
)
def test_a_turn_takes_the_commanded_rate_and_direction(
    params: tuple[float, ...], turned: float, seconds: float, bench: Any
) -> None:
    rig = bench()
    rig.airborne()
    assert rig.command(115, 90, 0, 1, 0) == 0
    rig.run(6.0)
    assert rig.command(115, *params) == 0
    before, total, start, settled = degrees(rig.vehicle.estimate.attitude[2]), 0.0, rig.now, rig.now
    while rig.now - start < 14.0:
        rig.run(0.05)
        now = degrees(rig.vehicle.estimate.attitude[2])
        total += (now - before + 180.0) % 360.0 - 180.0
        before = now
        if abs(total - turned) > 2.0:
            settled = rig.now
    assert total == pytest.approx(turned, abs=3.0)
    assert settled - start == pytest.approx(seconds, rel=0.25)


def test_a_point_without_a_heading_is_faced_and_ends_an_earlier_turn(bench: Any) -> None:
    """Recorded on the way to a point to the west-north-west: 280 degrees."""
    rig = bench()
    rig.airborne()
    rig.command(115, 90, 0, 1, 0)
    rig.run(5.0)
    north, east, down = position(rig)
    fly_to(rig, coordinate_frame=LOCAL_NED, type_mask=ONLY_POSITION, x=north + 5, y=east - 30, z=down)
    rig.run(5.0)
    assert degrees(rig.vehicle.estimate.attitude[2]) % 360.0 == pytest.approx(280.0, abs=6.0)


def test_without_yaw_behaviour_a_point_keeps_the_heading(bench: Any) -> None:
    rig = bench(parameters={"WP_YAW_BEHAVIOR": 0})
    rig.airborne()
    before = rig.vehicle.estimate.attitude[2]
    fly_to(rig, coordinate_frame=LOCAL_OFFSET, type_mask=ONLY_POSITION, y=30.0)
    rig.run(5.0)
    assert rig.vehicle.estimate.attitude[2] == pytest.approx(before, abs=0.05)


def test_a_point_may_come_with_a_turn_rate(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    fly_to(rig, coordinate_frame=LOCAL_OFFSET, type_mask=1528, x=5.0, yaw_rate=1.0)
    rig.run(2.0)
    assert rig.vehicle.estimate.rates[2] == pytest.approx(1.0, abs=0.15)
    rig.run(3.0)
    assert rig.vehicle.estimate.rates[2] == pytest.approx(0.0, abs=0.1)


def test_the_local_target_shows_a_velocity(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    rig.command(511, 85, 100_000)
    fly_to(rig, coordinate_frame=LOCAL_NED, type_mask=ONLY_VELOCITY, vx=2.0, vy=-1.0)
    rig.run(0.5)
    shown = rig.latest["POSITION_TARGET_LOCAL_NED"]
    assert (shown["type_mask"], shown["vx"], shown["vy"]) == (3079, 2.0, -1.0)


def test_a_point_below_is_approached_along_a_straight_line(bench: Any) -> None:
    """A leg of 90 m that descends by 20 m took 17.8 s, not the 12 s of a level one."""
    rig = bench()
    rig.airborne(30.0)
    fly_to(rig, coordinate_frame=LOCAL_OFFSET, type_mask=ONLY_POSITION, x=90.0, z=20.0)
    rig.run(8.0)
    north, _, down = position(rig)
    assert (30.0 + down) / 20.0 == pytest.approx(north / 90.0, abs=0.1)
    left = 90.0 - north, down + 10.0
    assert speed(rig) == pytest.approx(1.5 * left[0] / abs(left[1]), rel=0.05)
    assert 6.7 < speed(rig) < 7.6


def test_a_target_far_away_is_flown_towards(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    rig.send(
        "SET_POSITION_TARGET_GLOBAL_INT",
        target_system=1,
        target_component=1,
        coordinate_frame=6,
        type_mask=ONLY_POSITION,
        lat_int=0,
        lon_int=0,
        alt=10.0,
    )
    rig.run(8.0)
    assert speed(rig) > 8.0
    assert rig.height == pytest.approx(10.0, abs=1.0)


def test_the_heading_is_cut_to_whole_degrees_everywhere(bench: Any) -> None:
    rig = bench()
    rig.stream(10)
    rig.run(1.0)
    shown = degrees(rig.vehicle.estimate.attitude[2]) % 360.0
    assert rig.latest["VFR_HUD"]["heading"] == int(shown)
    assert shown > 180.0
