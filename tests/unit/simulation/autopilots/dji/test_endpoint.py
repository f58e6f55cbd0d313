"""The simulated DJI node: topics, authority, tasks, set-points, missions, what it does by itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from math import cos, hypot, pi, radians
from typing import Any

import pytest

from rigs.effects import fingerprint
from volery.base.errors import UsageError
from volery.base.time import S
from volery.kernel.task import ExecutionContext
from volery.ros.graph import ServiceError
from volery.ros.messages import new

Make = Callable[..., Any]

GO_HOME, TAKE_OFF, LAND = 1, 4, 6


def test_it_publishes_topics_with_subscribers_at_the_rates_of_their_groups(apron: Make) -> None:
    yard = apron()

    def body() -> None:
        yard.hear("attitude", "gps_position", "battery_state", "imu")
        yard.wait(2.0)
        before = dict(yard.counts)
        yard.wait(1.0)
        assert yard.counts["attitude"] - before["attitude"] == 100
        assert yard.counts["gps_position"] - before["gps_position"] == 50
        assert yard.counts["battery_state"] - before["battery_state"] == 5
        fix = yard.seen["gps_position"]
        assert (fix.latitude, fix.longitude) == pytest.approx((46.0, -103.0), abs=1e-4)
        assert fix.altitude == pytest.approx(900.0, abs=3.0)
        assert yard.seen["imu"].linear_acceleration.z == pytest.approx(9.8, abs=0.5)
        assert 10_000.0 < yard.seen["battery_state"].voltage < 60_000.0  # millivolts
        assert yard.seen["battery_state"].percentage == 100.0

    yard.run(body)


def test_a_cold_one_boots_before_it_speaks_and_gains_its_position_later(apron: Make) -> None:
    yard = apron(warm=False)

    def body() -> None:
        yard.hear("flight_status", "gps_health", "gps_position")
        yard.wait(2.5)
        assert "flight_status" not in yard.seen
        yard.wait(2.0)
        assert (yard.seen["flight_status"].data, yard.seen["gps_health"].data) == (0, 0)
        place = yard.seen["gps_position"]
        assert (place.status.status, place.latitude, place.longitude) == (0, 0.0, 0.0)  # a fix, it says
        assert not yard.call("set_local_pos_ref", "SetLocalPosRef").result
        yard.activate()
        assert not yard.task(TAKE_OFF)
        yard.wait(25.0)
        assert yard.seen["gps_health"].data > 3
        assert yard.call("set_local_pos_ref", "SetLocalPosRef").result

    yard.run(body)


def test_the_local_position_counts_from_the_reference_once_it_is_set(apron: Make) -> None:
    yard = apron()

    def body() -> None:
        yard.hear("local_position", "local_frame_ref")
        yard.wait(1.0)
        assert "local_position" not in yard.seen
        yard.fly()
        assert yard.call("set_local_pos_ref", "SetLocalPosRef").result
        yard.keep_sending(6.0, "ENUvelocity_yawrate", 2.0, 1.0, 0.0, 0.0)
        point = yard.seen["local_position"].point
        assert (point.x, point.y) == pytest.approx((yard.place[0], yard.place[1]), abs=0.6)
        assert yard.seen["local_frame_ref"].latitude == pytest.approx(46.0, abs=1e-5)

    yard.run(body)


def test_tasks_need_no_authority_motors_and_setpoints_do(apron: Make) -> None:
    yard = apron()

    def body() -> None:
        yard.wait(0.5)
        assert not yard.authority()  # not activated
        yard.activate()
        assert not yard.motors(True)
        assert yard.task(TAKE_OFF)
        yard.until(lambda: yard.mode == 6 and yard.status == 2)
        yard.keep_sending(2.0, "ENUvelocity_yawrate", 3.0, 0.0, 0.0, 0.0)
        assert hypot(yard.place[0], yard.place[1]) < 0.5
        assert yard.authority()
        yard.keep_sending(2.0, "ENUvelocity_yawrate", 3.0, 0.0, 0.0, 0.0)
        assert yard.place[0] > 2.0
        assert yard.authority(False)
        yard.wait(0.2)
        assert yard.mode == 6

    yard.run(body)


def test_a_takeoff_starts_the_motors_and_goes_to_its_fixed_height(apron: Make) -> None:
    yard = apron()
    modes: list[int] = []

    def body() -> None:
        yard.wait(0.5)
        yard.activate()
        assert yard.status == 0
        assert yard.task(TAKE_OFF)
        while yard.mode != 6:
            if not modes or modes[-1] != yard.mode:
                modes.append(yard.mode)
            yard.wait(0.1)
        assert modes == [41, 11]  # ENGINE_START, AUTO_TAKEOFF
        yard.wait(3.0)
        assert yard.place[2] == pytest.approx(1.2, abs=0.3)
        assert not yard.task(TAKE_OFF)  # it flies already

    yard.run(body)


@pytest.mark.parametrize(("aircraft", "expected"), [(0, [0, 1, 2, 0]), (2, [1, 2, 3, 4, 5, 1])])
def test_flight_status_has_the_numbers_of_the_aircraft(
    apron: Make, aircraft: int, expected: list[int]
) -> None:
    """A3: stopped, on the ground, in the air. M100: ground, taking off, in the air, landing, landed."""
    yard = apron(parameters={"AIRCRAFT": aircraft})
    seen: list[int] = []

    def note() -> None:
        if not seen or seen[-1] != yard.status:
            seen.append(yard.status)

    def body() -> None:
        yard.hear("display_mode", "flight_status")
        yard.wait(0.5)
        yard.activate()
        note()
        assert yard.task(TAKE_OFF)
        for _ in range(100):
            yard.wait(0.1)
            note()
        assert yard.task(LAND)
        for _ in range(150):
            yard.wait(0.1)
            note()

    yard.run(body)
    if aircraft == 2:
        assert seen == expected
        assert "display_mode" not in yard.seen  # an M100 has none
        assert yard.counts["flight_status"] > 100
    else:
        assert [*dict.fromkeys(seen[:3]), seen[-1]] == expected


def test_a_position_is_a_remaining_offset_and_an_absolute_height(apron: Make) -> None:
    yard = apron()

    def body() -> None:
        yard.fly()
        goal = (8.0, -6.0)
        for _ in range(50 * 14):
            east, north, _ = yard.place
            yard.send("ENUposition_yaw", goal[0] - east, goal[1] - north, 5.0, pi / 2.0)
            yard.wait(0.02)
        assert yard.mode == 17
        assert yard.place == pytest.approx((8.0, -6.0, 5.0), abs=0.6)
        assert abs(yard.flight.estimate().attitude[2]) < 0.1  # north

    yard.run(body)


def test_the_same_offset_sent_again_and_again_is_never_reached(apron: Make) -> None:
    yard = apron()

    def body() -> None:
        yard.fly()
        yard.keep_sending(8.0, "ENUposition_yaw", 3.0, 0.0, 1.2, 0.0)
        assert yard.place[0] > 8.0

    yard.run(body)


def test_setpoints_that_are_not_fed_end_in_a_hover(apron: Make) -> None:
    yard = apron()

    def body() -> None:
        yard.fly()
        yard.keep_sending(3.0, "ENUvelocity_yawrate", 4.0, 0.0, 0.0, 0.0)
        assert yard.mode == 17
        yard.wait(0.8)
        assert yard.mode == 6
        yard.wait(8.0)
        assert hypot(*yard.flight.truth().velocity[:2]) < 0.4

    yard.run(body)


@pytest.mark.parametrize(
    ("flag", "axes", "moves"),
    [
        (0x49, (0.0, 2.0, 0.0, 0.0), (0.0, 1.0)),  # velocity over ground: north
        (0x4B, (2.0, 0.0, 0.0, 0.0), (0.0, 1.0)),  # velocity of the body, whose nose is north: forward
        (0x4B, (0.0, 2.0, 0.0, 0.0), (-1.0, 0.0)),  # left
        (0x0B, (radians(10.0), 0.0, 0.0, 0.0), (1.0, 0.0)),  # roll: right
        (0x0B, (0.0, radians(10.0), 0.0, 0.0), (0.0, 1.0)),  # pitch of FLU: nose down
        (0x1B, (0.0, radians(10.0), 1.2, 0.0), (0.0, 1.0)),  # the same, at a height
    ],
)
def test_the_flag_says_how_the_numbers_are_meant(
    apron: Make, flag: int, axes: tuple[float, ...], moves: tuple[float, float]
) -> None:
    yard = apron()

    def body() -> None:
        yard.fly()
        start = yard.place
        yard.keep_sending(3.0, "generic", *axes, float(flag))
        east, north = yard.place[0] - start[0], yard.place[1] - start[1]
        away = hypot(east, north)
        assert away > 2.0
        assert (east / away, north / away) == pytest.approx(moves, abs=0.25)
        assert yard.place[2] == pytest.approx(start[2], abs=0.6)

    yard.run(body)


def test_half_thrust_about_carries_it(apron: Make) -> None:
    yard = apron()

    def body() -> None:
        yard.fly()
        yard.keep_sending(3.0, "ENUvelocity_yawrate", 0.0, 0.0, 2.0, 0.0)
        start = yard.place[2]
        yard.keep_sending(1.5, "generic", 0.0, 0.0, 50.0, 0.0, float(0x2B))
        assert abs(yard.place[2] - start) < 3.0
        yard.keep_sending(1.0, "generic", 0.0, 0.0, 80.0, 0.0, float(0x2B))
        assert yard.flight.truth().velocity[2] > 1.0

    yard.run(body)


@pytest.mark.parametrize(
    ("topic", "axes"),
    [
        ("ENUposition_yaw", ()),
        ("ENUposition_yaw", (1.0, 2.0)),
        ("ENUvelocity_yawrate", (float("nan"), 0.0, 0.0, 0.0)),
        ("ENUvelocity_yawrate", (0.0, float("inf"), 0.0, 0.0)),
        ("generic", (1.0, 1.0, 1.0, 1.0)),
        ("generic", (1.0, 1.0, 1.0, 1.0, 300.0)),
        ("generic", (1.0, 1.0, 1.0, 1.0, float("nan"))),
        ("generic", (1.0, 1.0, 50.0, 1.0, float(0xE1))),
    ],
)
def test_setpoints_that_make_no_sense_have_no_effect(
    apron: Make, topic: str, axes: tuple[float, ...]
) -> None:
    yard = apron()

    def body() -> None:
        yard.fly()
        yard.keep_sending(0.5, topic, *axes)
        assert yard.mode == 6

    yard.run(body)


def test_the_mode_switch_takes_the_authority_and_gives_none(apron: Make) -> None:
    yard = apron()

    def body() -> None:
        yard.hear("rc")
        yard.fly()
        yard.keep_sending(1.0, "ENUvelocity_yawrate", 2.0, 0.0, 0.0, 0.0)
        before = yard.seen["rc"].axes[4]
        assert before == pytest.approx(1.0)  # P of an A3
        yard.autopilot.vehicle.rc.transmitter[4] = 2000
        yard.wait(0.3)
        assert yard.seen["rc"].axes[4] == pytest.approx(-1.0)
        yard.keep_sending(1.0, "ENUvelocity_yawrate", 2.0, 0.0, 0.0, 0.0)
        assert yard.mode == 6
        refused = yard.call("sdk_control_authority", "SDKControlAuthority", control_enable=1)
        assert (refused.result, refused.ack_data) == (False, 5)  # it needs P
        yard.autopilot.vehicle.rc.transmitter[4] = 1000
        yard.wait(0.3)
        yard.keep_sending(0.5, "ENUvelocity_yawrate", 2.0, 0.0, 0.0, 0.0)
        assert yard.mode == 6  # it must be asked for again
        assert yard.authority()

    yard.run(body)


def test_going_home_climbs_comes_back_and_stops_the_motors(apron: Make) -> None:
    yard = apron()
    highest = 0.0

    def body() -> None:
        nonlocal highest
        yard.fly()
        yard.keep_sending(8.0, "ENUvelocity_yawrate", 4.0, 0.0, 0.0, 0.0)
        assert yard.place[0] > 15.0
        assert yard.task(GO_HOME)
        assert yard.mode == 15
        for _ in range(1500):
            yard.wait(0.1)
            highest = max(highest, yard.place[2])
            if yard.status == 0:
                break
        assert yard.status == 0
        assert highest == pytest.approx(30.0, abs=1.0)
        assert hypot(yard.place[0], yard.place[1]) < 1.0

    yard.run(body)


def test_near_home_going_home_is_landing_and_no_setpoint_ends_it(apron: Make) -> None:
    yard = apron()

    def body() -> None:
        yard.fly()
        yard.keep_sending(6.0, "ENUvelocity_yawrate", 3.0, 0.0, 1.0, 0.0)
        assert 10.0 < yard.place[0] < 20.0
        assert yard.task(GO_HOME)
        assert yard.mode == 12
        yard.keep_sending(2.0, "ENUvelocity_yawrate", 0.0, 0.0, 2.0, 0.0)
        assert yard.mode == 12
        yard.until(lambda: yard.status == 0)
        assert yard.place[0] > 10.0  # it is not at home

    yard.run(body)


def test_a_low_battery_sends_it_home_and_a_setpoint_does_not_stop_it(apron: Make) -> None:
    yard = apron()

    def body() -> None:
        yard.fly()
        yard.keep_sending(8.0, "ENUvelocity_yawrate", 4.0, 0.0, 0.0, 0.0)
        yard.flight.set_charge(0.25)
        yard.wait(8.0)
        assert yard.mode == 6  # it has told, and waits
        yard.until(lambda: yard.mode == 15, within=5.0)
        yard.keep_sending(0.5, "ENUvelocity_yawrate", 4.0, 0.0, 0.0, 0.0)
        assert yard.mode == 15
        yard.flight.set_charge(0.08)
        yard.until(lambda: yard.mode == 33, within=3.0)
        assert not yard.task(GO_HOME)  # a critical battery overrides the SDK
        assert not yard.task(LAND)
        assert yard.mode == 33
        yard.until(lambda: yard.status == 0)

    yard.run(body)
    assert "battery critical" in yard.texts()


def test_motors_that_turn_for_nothing_stop(apron: Make) -> None:
    yard = apron()

    def body() -> None:
        yard.wait(0.5)
        yard.activate()
        assert yard.authority()
        assert yard.motors(True)
        assert yard.status == 1
        yard.wait(9.0)
        assert yard.status == 1
        yard.wait(2.0)
        assert yard.status == 0

    yard.run(body)


def test_without_satellites_it_holds_its_attitude_only(apron: Make) -> None:
    yard = apron()

    def body() -> None:
        yard.fly()
        yard.flight.block_gps()
        yard.until(lambda: yard.mode == 1, within=15.0)
        yard.keep_sending(1.0, "ENUvelocity_yawrate", 3.0, 0.0, 0.0, 0.0)
        assert abs(yard.flight.estimate().attitude[0]) < 0.1
        assert not yard.task(GO_HOME)
        assert yard.task(LAND)
        yard.until(lambda: yard.status == 0)

    yard.run(body)


def _mission(package: str, *places: tuple[float, float, float], finish: int = 0, **fields: Any) -> Any:
    task = new(f"{package}/MissionWaypointTask", velocity_range=10.0, idle_velocity=5.0, **fields)
    task.action_on_finish, task.mission_exec_times = finish, 1
    for east, north, up in places:
        degrees_east = east / (111_195.0 * cos(radians(46.0)))
        task.mission_waypoint.append(
            new(
                f"{package}/MissionWaypoint",
                latitude=46.0 + north / 111_195.0,
                longitude=-103.0 + degrees_east,
                altitude=up,
            )
        )
    return task


def test_a_mission_is_flown_from_point_to_point_and_what_follows_it(apron: Make) -> None:
    yard = apron()

    def body() -> None:
        task = _mission("dji_sdk", (0.0, 12.0, 6.0), (15.0, 12.0, 6.0), finish=2)
        yard.wait(0.5)
        yard.activate()
        assert yard.call("mission_waypoint_upload", "MissionWpUpload", waypoint_task=task).ack_data == 0xD1
        assert yard.authority()
        start = yard.kernel.now()
        assert yard.call("mission_waypoint_upload", "MissionWpUpload", waypoint_task=task).result
        assert yard.kernel.now() - start >= 3 * S  # a second, and one for each point
        assert yard.call("mission_status", "MissionStatus").waypoint_mission_count == 1
        grounded = yard.call("mission_waypoint_action", "MissionWpAction", action=0)
        assert (grounded.result, grounded.ack_data) == (False, 0xDA)
        yard.fly()
        assert yard.call("mission_waypoint_action", "MissionWpAction", action=0).result
        yard.wait(2.0)
        assert yard.mode == 14
        assert yard.call("mission_waypoint_action", "MissionWpAction", action=2).result  # pause
        assert yard.mode == 6
        assert yard.call("mission_waypoint_action", "MissionWpAction", action=3).result  # resume
        yard.until(lambda: hypot(yard.place[0], yard.place[1] - 12.0) < 1.0)
        assert yard.call("mission_waypoint_setSpeed", "MissionWpSetSpeed", speed=3.0).result
        assert yard.call("mission_waypoint_getSpeed", "MissionWpGetSpeed").speed == 3.0
        assert not yard.call("mission_waypoint_setSpeed", "MissionWpSetSpeed", speed=20.0).result
        yard.until(lambda: yard.mode == 12)
        assert (yard.place[0], yard.place[1]) == pytest.approx((15.0, 12.0), abs=1.0)
        yard.until(lambda: yard.status == 0)
        info = yard.call("mission_waypoint_getInfo", "MissionWpGetInfo").waypoint_task
        assert len(info.mission_waypoint) == 2

    yard.run(body)


@pytest.mark.parametrize(
    ("places", "changes", "why"),
    [
        (1, {}, "waypoints"),
        (2, {"velocity_range": 20.0}, "speeds"),
        (2, {"idle_velocity": 1.0}, "speeds"),
        (2, {"idle_velocity": float("nan")}, "speeds"),
        (100, {}, "waypoints"),
    ],
)
def test_missions_that_make_no_sense_are_refused(
    apron: Make, places: int, changes: dict[str, float], why: str
) -> None:
    yard = apron()

    def body() -> None:
        yard.wait(0.5)
        yard.activate()
        assert yard.authority()
        task = _mission("dji_sdk", *[(float(number), 0.0, 5.0) for number in range(places)])
        for name, value in changes.items():
            setattr(task, name, value)
        response = yard.call("mission_waypoint_upload", "MissionWpUpload", waypoint_task=task)
        assert (response.result, response.ack_data) == (False, 255)

    yard.run(body)
    assert any(why in text for text in yard.texts())


@pytest.mark.parametrize(
    ("parameters", "north", "up", "code"),
    [
        ({"RC_CONNECTED": 0}, 60.0, 10.0, 0xC7),  # far from home
        ({"RC_CONNECTED": 0}, 40.0, 35.0, 0xC0),  # too high
        ({"RC_CONNECTED": 0}, 40.0, 10.0, 0),
        ({}, 31_000.0, 10.0, 0xE2),  # too long
        ({"NO_FLY_NORTH": 20.0, "NO_FLY_RADIUS": 10.0}, 60.0, 10.0, 0xDD),  # crosses a no-fly zone
        ({"NO_FLY_NORTH": 20.0, "NO_FLY_EAST": 40.0, "NO_FLY_RADIUS": 10.0}, 60.0, 10.0, 0),
        ({"AIRCRAFT": 5}, 40.0, 10.0, 255),  # an M300 takes missions of another kind
    ],
)
def test_a_mission_is_refused_with_the_code_of_the_aircraft(
    apron: Make, parameters: dict[str, float], north: float, up: float, code: int
) -> None:
    yard = apron(parameters=parameters)

    def body() -> None:
        yard.wait(0.5)
        yard.activate()
        assert yard.authority()
        task = _mission("dji_sdk", (0.0, 5.0, 6.0), (0.0, north, up))
        response = yard.call("mission_waypoint_upload", "MissionWpUpload", waypoint_task=task)
        assert (response.result, response.ack_data) == (code == 0, code)

    yard.run(body)


def test_the_vehicle_node_of_4_1_has_its_services_beside_its_topics(apron: Make) -> None:
    yard = apron("dji_osdk_ros")

    def task(number: int) -> bool:
        return bool(yard.call("/flight_task_control", "FlightTaskControl", task=number).result)

    def steer(**command: float) -> None:
        for _ in range(100):
            yard.call("/joystick_action", "JoystickAction", joystickCommand=command)
            yard.wait(0.02)

    def body() -> None:
        yard.hear("flight_status", "gps_position")
        yard.wait(0.5)
        assert yard.call(
            "/obtain_release_control_authority", "ObtainControlAuthority", enable_obtain=True
        ).result
        assert task(TAKE_OFF)
        assert (yard.mode, yard.status) == (6, 2)  # it answers when it is finished
        with pytest.raises(ServiceError, match="its handler failed") as failed:
            task(8)  # the motors are not stopped in the air
        assert failed.value.by_server
        yard.call("/set_joystick_mode", "SetJoystickMode", horizontal_mode=1, yaw_mode=1, stable_mode=1)
        steer(x=3.0, y=0.0, z=1.0, yaw=0.0)  # x is north here
        assert yard.place[1] > 3.0
        assert abs(yard.place[0]) < 1.0
        assert yard.call("/emergency_brake", "EmergencyBrake").result
        assert yard.mode == 6
        assert yard.call("/set_go_home_altitude", "SetGoHomeAltitude", altitude=25).result
        assert not yard.call("/set_go_home_altitude", "SetGoHomeAltitude", altitude=5).result
        assert yard.call("/kill_switch", "KillSwitch", enable=True).result
        assert yard.status == 0

    yard.run(body)


def test_during_a_landing_the_node_of_4_1_answers_nothing_else(apron: Make) -> None:
    yard = apron("dji_osdk_ros")
    done: list[str] = []

    def ask(name: str, kind: str, **fields: Any) -> None:
        def body() -> None:
            with suppress(ServiceError):
                yard.call(name, kind, **fields)
            done.append(name)

        yard.kernel.spawn(body, name, ExecutionContext("program"))

    def body() -> None:
        yard.wait(0.5)
        assert yard.call("/flight_task_control", "FlightTaskControl", task=TAKE_OFF).result
        ask("/flight_task_control", "FlightTaskControl", task=LAND)
        yard.wait(0.1)
        assert yard.mode == 12
        ask("/kill_switch", "KillSwitch", enable=True)
        yard.wait(0.5)
        assert (done, yard.status) == ([], 2)
        yard.until(lambda: len(done) == 2)
        assert done == ["/flight_task_control", "/kill_switch"]
        assert yard.status == 0

    yard.run(body)


def test_motors_are_not_stopped_in_the_air_nor_is_task_4_flown_with_running_ones(apron: Make) -> None:
    yard = apron()

    def body() -> None:
        yard.wait(0.5)
        yard.activate()
        assert yard.authority()
        assert yard.motors(True)
        refused = yard.call("drone_task_control", "DroneTaskControl", task=TAKE_OFF)
        assert (refused.result, refused.ack_data) == (False, 1)  # MOTORS_ON
        assert yard.motors(False)
        assert yard.task(TAKE_OFF)
        yard.until(lambda: yard.mode == 6 and yard.status == 2)
        refused = yard.call("drone_arm_control", "DroneArmControl", arm=0)
        assert (refused.result, refused.ack_data) == (False, 3)  # IN_AIR
        assert yard.status == 2

    yard.run(body)


def test_an_m100_accepts_task_4_with_running_motors_and_stays(apron: Make) -> None:
    yard = apron(parameters={"AIRCRAFT": 2})

    def body() -> None:
        yard.wait(0.5)
        yard.activate()
        assert yard.authority()
        assert yard.motors(True)
        accepted = yard.call("drone_task_control", "DroneTaskControl", task=TAKE_OFF)
        assert (accepted.result, accepted.ack_data) == (True, 2)
        yard.wait(5.0)
        assert yard.place[2] < 0.2

    yard.run(body)


@pytest.mark.parametrize(
    ("aircraft", "grants", "axis"), [(0, "P", 1.0), (2, "F", 8000.0), (3, "PAF", None), (4, "PF", None)]
)
def test_the_switch_grants_the_authority_by_aircraft(
    apron: Make, aircraft: int, grants: str, axis: float | None
) -> None:
    yard = apron(parameters={"AIRCRAFT": aircraft})

    def body() -> None:
        yard.hear("rc")
        yard.wait(0.5)
        yard.activate()
        assert axis is None or yard.seen["rc"].axes[4] == pytest.approx(axis)
        for position, pulse in (("P", 1000), ("A", 1500), ("F", 2000)):
            yard.autopilot.vehicle.rc.transmitter[4] = pulse
            yard.wait(0.3)
            assert yard.authority() == (position in grants)

    yard.run(body)


def test_its_altitude_is_by_pressure_and_its_height_another_quantity(apron: Make) -> None:
    for aircraft, shown in ((0, 0.0), (4, 7.0)):
        yard = apron(parameters={"PRESSURE_OFFSET": -60.0, "AIRCRAFT": aircraft})

        def body(yard: Any = yard, shown: float = shown) -> None:
            yard.hear("gps_position", "height_above_takeoff")
            yard.fly()
            yard.keep_sending(6.0, "ENUvelocity_yawrate", 0.0, 0.0, 2.0, 0.0)
            assert yard.place[2] > 9.0
            assert yard.seen["gps_position"].altitude == pytest.approx(840.0 + yard.place[2], abs=1.5)
            assert yard.seen["height_above_takeoff"].data == pytest.approx(shown, abs=0.3)

        yard.run(body)


def test_without_satellites_the_place_freezes_and_messages_go_on(apron: Make) -> None:
    yard = apron()

    def body() -> None:
        yard.hear("gps_position", "gps_health")
        yard.fly()
        yard.keep_sending(3.0, "ENUvelocity_yawrate", 3.0, 0.0, 0.0, 0.0)
        yard.flight.block_gps()
        yard.wait(1.0)
        before, count = yard.seen["gps_position"], yard.counts["gps_position"]
        yard.keep_sending(2.0, "ENUvelocity_yawrate", 0.0, 0.0, 1.0, 0.0)
        after = yard.seen["gps_position"]
        assert yard.counts["gps_position"] - count == 100
        assert (after.latitude, after.longitude) == (before.latitude, before.longitude)
        assert (after.status.status, yard.seen["gps_health"].data) == (0, 0)
        assert after.altitude > before.altitude + 1.0

    yard.run(body)


@pytest.mark.parametrize(("action", "mode"), [(0, 12), (1, 17)])
def test_a_lost_transmitter_sends_it_home_or_does_not(apron: Make, action: int, mode: int) -> None:
    yard = apron(parameters={"RC_LOST_ACTION": action})

    def body() -> None:
        yard.hear("rc_connection_status")
        yard.fly()
        yard.autopilot.vehicle.set_parameter("RC_CONNECTED", 0.0)
        yard.keep_sending(2.5, "ENUvelocity_yawrate", 1.0, 0.0, 0.0, 0.0)
        assert (yard.mode, yard.seen["rc_connection_status"].data) == (17, 0)
        yard.keep_sending(1.0, "ENUvelocity_yawrate", 1.0, 0.0, 0.0, 0.0)
        assert yard.mode == mode

    yard.run(body)


def test_a_landing_may_wait_low_for_a_confirmation(apron: Make) -> None:
    yard = apron(parameters={"LAND_WAITS": 1})

    def body() -> None:
        yard.fly()
        assert yard.task(LAND)
        yard.wait(15.0)
        assert (yard.mode, yard.status) == (12, 2)
        assert 0.3 < yard.place[2] < 0.9
        yard.autopilot.vehicle.firmware_state.confirm_landing()
        yard.until(lambda: yard.status == 0)

    yard.run(body)


def test_a_position_has_a_law_of_speed(apron: Make) -> None:
    """Half the offset for each second, 3 m/s at most: as seen of an M600."""
    yard = apron()

    def speed(offset: float) -> float:
        yard.keep_sending(4.0, "ENUposition_yaw", offset, 0.0, 1.2, 0.0)
        return hypot(*yard.flight.truth().velocity[:2])

    def body() -> None:
        yard.fly()
        assert speed(2.0) == pytest.approx(1.0, abs=0.2)
        assert speed(4.0) == pytest.approx(2.0, abs=0.2)
        assert speed(20.0) == pytest.approx(3.0, abs=0.2)

    yard.run(body)


def test_the_imu_has_the_rate_of_the_aircraft(apron: Make) -> None:
    for aircraft, rate in ((0, 400), (2, 100)):
        yard = apron(parameters={"AIRCRAFT": aircraft})

        def body(yard: Any = yard, rate: int = rate) -> None:
            yard.hear("imu")
            yard.wait(1.0)
            before = yard.counts["imu"]
            yard.wait(1.0)
            assert yard.counts["imu"] - before == pytest.approx(rate, abs=1)

        yard.run(body)


def test_where_it_may_join_a_graph(apron: Make) -> None:
    yard = apron()
    with pytest.raises(UsageError, match="on a graph already"):
        yard.autopilot.join(yard.graph, "/other/dji_sdk", ExecutionContext("d"))
    other = apron()
    other.autopilot.endpoint.close()
    with pytest.raises(UsageError, match="dji_sdk or dji_osdk_ros"):
        other.autopilot.join(other.graph, "/d/mavros", ExecutionContext("d"))
    with pytest.raises(UsageError, match="over a graph"):
        yard.autopilot.connect(None)


ACCEPTED_WITHOUT_EFFECT: dict[str, set[str]] = {
    "dji_sdk": {"sdk_control_authority"},  # released where none is held; it is not activated
    "dji_osdk_ros": {
        "joystick_action",  # sent to an aircraft with its motors off
        "kill_switch",  # the motors are off
        "set_joystick_mode",  # kept by the node for the next set-point
    },
}


def answers(craft: Any, name: str, kind: str) -> Iterator[tuple[bool, bool]]:
    """Whether a request is accepted and changes something, with all of its numbers 0, 1, 4 and 100."""
    craft.wait(0.5)
    vehicle = craft.autopilot.vehicle
    for value in (0, 1, 4, 100):
        before = fingerprint(vehicle), vehicle.parameters.changes
        accepted = craft.asked(name, kind, value)
        yield accepted, (fingerprint(vehicle), vehicle.parameters.changes) != before


@pytest.mark.parametrize("package", ["dji_sdk", "dji_osdk_ros"])
def test_a_service_without_effect_is_refused(package: str, apron: Make) -> None:
    """Of an aircraft that has just been switched on."""
    without = set()
    for name, kind, _ in apron(package).graph.services():
        craft, found = apron(package), list[tuple[bool, bool]]()
        craft.run(lambda: found.extend(answers(craft, name, kind)))  # noqa: B023 - runs at once
        acting = [changes for accepted, changes in found if accepted]
        if acting and not any(acting):
            without.add(name.rpartition("/")[2])
    assert without == ACCEPTED_WITHOUT_EFFECT[package]
