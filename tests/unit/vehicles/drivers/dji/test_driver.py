"""The DJI driver against a scripted node: what it asks, in which order, what it streams, what it notices."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from math import pi
from typing import Any

import pytest

from volery.base.errors import (
    CapabilityError,
    Failsafe,
    LinkLost,
    LinkSilent,
    NotArrived,
    OutOfBounds,
    Overridden,
    Refused,
    UsageError,
    VehicleError,
)
from volery.base.position import AMSL, AboveHome, Position
from volery.base.time import MS, S
from volery.kernel.task import ExecutionContext
from volery.vehicles import Drone, Fence, Waypoint
from volery.vehicles.driver import Capability
from volery.vehicles.drivers.dji import DRIVER, open_driver
from volery.vehicles.telemetry import StatusText

HOME = (46.0, -103.0, 900.0)
METRES = 111_195.0
Make = Callable[..., Any]


def at(north: float, east: float, up: float) -> Position:
    return Position(HOME[0] + north / METRES, HOME[1] + east / METRES, AboveHome(up))


def follows(bench: Any) -> None:
    """The aircraft is at once where set-points of position send it."""

    def tick() -> None:
        node = bench.node
        if node.setpoints:
            _, flag, (x, y, z, _) = node.setpoints[-1]
            if flag == 0x91:
                node.be_at(node.north + y, node.east + x / 1.0, z)
                node.setpoints.append((bench.kernel.now(), -2, (0.0, 0.0, 0.0, 0.0)))

    bench.kernel.every(100 * MS, tick)


# -- connecting


def test_the_link_counts_once_the_aircraft_is_known(bench: Make) -> None:
    made = bench()

    def body() -> None:
        made.drone.wait_connected()
        seen = made.drone.telemetry
        assert (seen.kind, seen.autopilot, seen.mode) == ("drone", "DJI A3", "P_GPS")
        assert made.node.names() == ["query_drone_version"]
        assert seen.battery == (0.8, 22.8, 5.0)
        assert seen.attitude.heading == pytest.approx(90.0)  # a yaw of 0 looks east
        assert Capability.STABILIZE in made.drone.capabilities
        assert Capability.TERRAIN not in made.drone.capabilities

    made.run(body)


def test_a_missing_node_is_reported_with_its_topic(bench: Make) -> None:
    made = bench()
    lonely = made.graph.node("lonely", context=ExecutionContext("lonely"))
    driver = open_driver(made.kernel, lonely, "d", {"namespace": "/elsewhere/dji_sdk"})

    def body() -> None:
        with pytest.raises(LinkSilent, match="no DJI node publishes /elsewhere/dji_sdk/flight_status"):
            Drone(made.kernel, "d", driver).wait_connected(within=2.0)
        driver.close()

    made.run(body)


@pytest.mark.parametrize(
    ("options", "wrong"),
    [
        ({"home_altitude": "high"}, "no altitude"),
        ({"names": "dji"}, "dji_osdk_ros or dji_sdk"),
        ({"rate": "10"}, "no option 'rate'"),
    ],
)
def test_options_that_make_no_sense(bench: Make, options: dict[str, str], wrong: str) -> None:
    made = bench()
    node = made.graph.node("other", context=ExecutionContext("other"))
    with pytest.raises(UsageError, match=wrong):
        open_driver(made.kernel, node, "d", options)
    assert DRIVER.on_link is None
    assert DRIVER.namespace.format(name="x") == "/x/dji_sdk"


# -- the sequence


def test_a_takeoff_asks_in_order_and_then_climbs_by_setpoints(bench: Make) -> None:
    made = bench()
    follows(made)

    def body() -> None:
        made.drone.takeoff(8.0)
        assert made.node.names() == [
            "query_drone_version",
            "activation",
            "set_local_pos_ref",
            "sdk_control_authority",
            "drone_task_control",
        ]
        assert made.node.asked[-1][1].task == 4
        assert {flag for _, flag, _ in made.node.setpoints if flag > 0} == {0x91}
        assert made.drone.altitude.metres == pytest.approx(8.0)
        assert made.drone.home.altitude.metres == pytest.approx(900.0, abs=0.01)

    made.run(body)


def test_a_bad_gps_is_waited_for_and_named(bench: Make) -> None:
    made = bench()
    made.node.health = 3

    def body() -> None:
        with pytest.raises(NotArrived, match=r"gps health 3 must be above 3"):
            made.drone.wait_ready(within=5.0)
        made.later(2.0, lambda: setattr(made.node, "health", 4))
        made.drone.wait_ready(within=5.0)

    made.run(body)


@pytest.mark.parametrize(
    ("service", "words"),
    [
        ("activation", "refused to activate .*app_id"),
        ("sdk_control_authority", "give the program the authority .*mode switch must be at P"),
        ("drone_task_control", "refused to take off"),
    ],
)
def test_a_refusal_says_what_was_refused_and_what_to_do(bench: Make, service: str, words: str) -> None:
    made = bench()
    made.node.refuse.add(service)

    def body() -> None:
        with pytest.raises(Refused, match=words):
            made.drone.takeoff(5.0)

    made.run(body)


def test_setpoints_are_remaining_offsets_fifty_times_a_second(bench: Make) -> None:
    made = bench()

    def body() -> None:
        made.drone.wait_ready()
        made.node.obey(4)
        made.wait(0.1)
        made.later(2.0, lambda: made.node.be_at(20.0, 0.0, 9.0))
        start = made.kernel.now()
        made.drone.goto(at(20.0, 0.0, 9.0))
        sent = [one for one in made.node.setpoints if one[0] < start + 2 * S]
        assert 95 <= len(sent) <= 105
        assert all(flag == 0x91 for _, flag, _ in sent)
        x, y, z, yaw = sent[50][2]
        assert (x, y, z) == (pytest.approx(0.0, abs=0.05), pytest.approx(20.0, abs=0.1), 9.0)
        assert yaw == pytest.approx(0.0, abs=1e-6)  # as it looked before: east
        assert made.drone.mode == "NAVI_SDK_CTRL"

    made.run(body)


def test_a_setpoint_follows_each_position_at_once(bench: Make) -> None:
    made = bench()

    def body() -> None:
        made.drone.wait_ready()
        made.node.obey(4)
        made.wait(0.107)
        made.later(2.0, lambda: made.node.be_at(20.0, 0.0, 9.0))
        arrives = made.kernel.now() + 2 * S
        made.drone.goto(at(20.0, 0.0, 9.0))
        made.wait(0.1)
        followed = [one for one in made.node.setpoints if one[0] >= arrives]
        assert all(sent % (20 * MS) == 0 for sent, _, _ in followed)
        assert followed[0][0] - arrives < 20 * MS
        assert followed[0][2][1] == pytest.approx(0.0, abs=0.1)  # the offset from where it is now

    made.run(body)


def test_setpoints_go_on_without_positions(bench: Make) -> None:
    made = bench()

    def body() -> None:
        made.drone.wait_ready()
        made.node.obey(4)
        made.wait(0.1)
        made.node.lost = True
        start = made.kernel.now()
        made.drone.set_velocity(2.0, lasting=1.0)
        made.wait(0.5)
        times = [sent for sent, _, _ in made.node.setpoints if sent >= start]
        assert len(times) >= 16
        assert max(b - a for a, b in pairwise(times)) <= 30 * MS

    made.run(body)


def test_an_altitude_above_the_sea_is_flown_above_the_point_of_takeoff(bench: Make) -> None:
    """It reports an altitude that is 60 m too low: only its difference to home's, which is stated, counts."""
    made = bench(home_altitude="900")
    made.node.offset = -60.0

    def body() -> None:
        made.drone.wait_ready()
        made.node.obey(4)
        made.wait(0.1)
        made.later(1.0, lambda: made.node.be_at(5.0, 0.0, 12.0))
        made.drone.goto(Position(HOME[0] + 5.0 / METRES, HOME[1], AMSL(912.0)))
        assert made.drone.position.altitude == AMSL(912.0)
        assert made.node.setpoints[10][2][2] == pytest.approx(12.0, abs=0.05)
        with pytest.raises(OutOfBounds, match="0 to 120 m"):
            made.drone.goto(at(5.0, 0.0, -1.0))

    made.run(body)


def test_an_altitude_above_the_sea_is_refused_where_homes_is_not_stated(bench: Make) -> None:
    made = bench()
    made.node.offset = -60.0

    def body() -> None:
        made.drone.wait_ready()
        made.node.obey(4)
        made.wait(0.1)
        goal = Position(HOME[0], HOME[1], AMSL(915.0))
        with pytest.raises(Refused, match="home_altitude=900 among the options"):
            made.drone.goto(goal)
        with pytest.raises(Refused, match="by pressure"):
            made.drone.upload_mission([Waypoint(goal), Waypoint(goal)])
        made.drone.fence = Fence(ceiling=AMSL(950.0))
        with pytest.raises(UsageError, match="the fence states altitudes AMSL"):
            made.drone.goto(at(5.0, 0.0, 12.0))
        assert made.node.setpoints == []
        assert made.drone.altitude.metres == pytest.approx(1.2)

    made.run(body)


def test_the_height_is_a_difference_of_altitudes_whatever_the_downward_range_shows(bench: Make) -> None:
    made = bench()
    made.node.range, made.node.offset = 0.0, -137.0
    follows(made)

    def body() -> None:
        made.drone.takeoff(10.0)
        assert made.drone.altitude.metres == pytest.approx(10.0)
        made.node.range = 5.0  # latched
        made.drone.goto(at(20.0, 0.0, 12.0))
        assert made.drone.altitude.metres == pytest.approx(12.0)

    made.run(body)


def test_a_frozen_place_counts_for_nothing(bench: Make) -> None:
    """Latitude and longitude stay, messages go on and say fix: no offset, and no arrival at a goal there."""
    made = bench()

    def body() -> None:
        made.drone.wait_ready()
        made.node.obey(4)
        made.wait(0.1)
        made.later(0.5, lambda: setattr(made.node, "health", 0))
        made.later(1.0, made.node.setpoints.clear)
        began = made.kernel.now()
        with pytest.raises(VehicleError, match="no position"):
            made.drone.goto(at(60.0, 0.0, 1.2))
        assert made.node.setpoints == []
        assert made.kernel.now() - began < 15 * S
        with pytest.raises(VehicleError):
            made.drone.goto(at(0.0, 0.0, 1.2))  # where it seems to stand
        assert made.node.setpoints == []

    made.run(body)


def test_a_stated_speed_is_a_velocity_until_near_the_goal(bench: Make) -> None:
    made = bench()

    def body() -> None:
        made.drone.wait_ready()
        made.node.obey(4)
        made.wait(0.1)
        made.later(1.0, lambda: made.node.be_at(37.0, 0.0, 5.0))
        made.later(2.0, lambda: made.node.be_at(40.0, 0.0, 5.0))
        made.drone.goto(at(40.0, 0.0, 5.0), speed=3.0)
        flags = [flag for _, flag, _ in made.node.setpoints]
        first = made.node.setpoints[5][2]
        assert flags[5] == 0x49
        assert (first[0], first[1]) == (pytest.approx(0.0, abs=0.05), pytest.approx(3.0, abs=0.05))
        assert 0x91 in flags

    made.run(body)


def test_no_offset_is_sent_from_a_place_that_is_old(bench: Make) -> None:
    made = bench()

    def body() -> None:
        made.drone.wait_ready()
        made.node.obey(4)
        made.wait(0.1)
        made.later(1.0, lambda: setattr(made.node, "lost", True))
        made.later(2.0, made.node.setpoints.clear)
        made.later(3.0, lambda: setattr(made.node, "health", 0))
        made.later(3.0, lambda: setattr(made.node, "mode", 1))
        with pytest.raises(Failsafe, match="ATTITUDE"):
            made.drone.goto(at(20.0, 0.0, 5.0))
        assert made.node.setpoints == []

    made.run(body)


def test_a_velocity_is_streamed_for_as_long_as_it_lasts(bench: Make) -> None:
    made = bench()

    def body() -> None:
        made.drone.wait_ready()
        made.node.obey(4)
        made.wait(0.1)
        made.drone.set_velocity(2.0, 1.0, 0.5, 90.0, lasting=1.0)
        made.wait(5.0)
        moving = [axes for _, flag, axes in made.node.setpoints if flag == 0x49 and axes[1]]
        assert 45 <= len(moving) <= 55
        assert moving[0] == (1.0, 2.0, 0.5, pytest.approx(-pi / 2.0))
        assert made.node.setpoints[-1][2] == (0.0, 0.0, 0.0, 0.0)
        count = len(made.node.setpoints)
        made.wait(1.0)
        assert len(made.node.setpoints) == count  # it hovers by itself

    made.run(body)


def test_sticks_are_angles_turn_and_climb_or_thrust(bench: Make) -> None:
    made = bench()

    def body() -> None:
        made.drone.wait_ready()
        made.node.obey(4)
        made.wait(0.1)
        made.drone.manual_control(1.0, -1.0, 1.0, 0.5)
        made.drone.altitude_hold()
        made.wait(0.2)
        _, flag, axes = made.node.setpoints[-1]
        assert flag == 0x0B
        assert axes == (
            pytest.approx(-0.436, abs=1e-3),
            pytest.approx(0.436, abs=1e-3),
            2.0,
            pytest.approx(-pi / 4),
        )
        made.drone.manual_control(0.0, 0.0, 0.5, 0.0)
        made.wait(0.1)
        assert made.node.setpoints[-1][2] == (0.0, 0.0, 0.0, pytest.approx(0.0))
        made.drone.stabilize()
        made.wait(0.1)
        assert made.node.setpoints[-1][1:] == (0x2B, (0.0, 0.0, 50.0, pytest.approx(0.0)))

    made.run(body)


# -- tasks


def test_landing_and_going_home_stop_the_stream_and_wait_until_the_motors_stand(bench: Make) -> None:
    made = bench()

    def body() -> None:
        made.drone.arm()
        for operation, task in ((made.drone.land, 6), (made.drone.return_home, 1)):
            made.node.obey(4)
            made.wait(0.1)
            made.drone.set_velocity(1.0)
            made.later(0.5, made.node.setpoints.clear)
            operation()
            assert made.node.asked[-1][1].task == task
            assert not made.drone.armed
            assert made.node.setpoints == []

    made.run(body)


def test_a_task_is_asked_for_once_no_setpoint_is_on_its_way(bench: Make) -> None:
    """One that arrives after it would end it."""
    made = bench()
    at: list[int] = []

    def body() -> None:
        made.drone.arm()
        made.node.obey(4)
        made.wait(0.1)
        made.drone.set_velocity(1.0)
        made.wait(0.3)
        made.node.on_task = lambda task: (at.append(made.kernel.now()), made.node.obey(task))
        made.drone.land()
        assert at[0] - made.node.setpoints[-1][0] >= 150 * MS

    made.run(body)


@pytest.mark.parametrize("hardware", ["A3", "M100"])
def test_a_landing_and_a_way_home_cannot_be_left_with_3_8(bench: Make, hardware: str) -> None:
    """Set-points do not end them, and the node has no request that does: nothing is said to be held."""
    made = bench(hardware)
    flies, lands = (3, 4) if hardware == "M100" else (2, 2)

    def task(number: int) -> None:
        made.node.status, made.node.mode, made.node.up = (flies, 6, 1.2) if number == 4 else (lands, 12, 1.0)

    made.node.on_task = task

    def body() -> None:
        made.drone.wait_ready()
        task(4)
        made.wait(0.1)

        def land() -> None:
            with suppress(VehicleError):
                made.drone.land()

        made.kernel.spawn(land, "lands", ExecutionContext("commander"))
        made.wait(1.0)
        assert made.drone.mode == "AUTO_LANDING"
        made.node.setpoints.clear()
        with pytest.raises(Refused, match="only the pilot can"):
            made.drone.hold()
        with pytest.raises(Refused, match="only the pilot can"):
            made.drone.set_velocity(1.0)
        assert made.node.setpoints == []

    made.run(body)


def test_running_motors_are_stopped_before_the_task_that_takes_off(bench: Make) -> None:
    """Task 4 works only while they stand."""
    made = bench()
    follows(made)

    def body() -> None:
        made.drone.arm()
        made.drone.takeoff(5.0)
        asked = [(name, getattr(request, "arm", None)) for name, request in made.node.asked]
        first = asked.index(("drone_task_control", None))
        assert asked[:first][-1] != ("drone_arm_control", 1)
        assert ("drone_arm_control", 0) in asked[:first]

    made.run(body)


@pytest.mark.parametrize(
    ("service", "code", "words"),
    [
        ("drone_task_control", 1, "refused with 1, motors on"),
        ("drone_task_control", 6, "refused with 6, bad gps"),
        ("sdk_control_authority", 5, "refused with 5, needs p"),
    ],
)
def test_a_code_is_named(bench: Make, service: str, code: int, words: str) -> None:
    made = bench()
    made.node.refuse.add(service)
    made.node.codes[service] = code

    def body() -> None:
        with pytest.raises(Refused, match=words):
            made.drone.takeoff(5.0)

    made.run(body)


def test_the_loss_of_the_transmitter_is_told(bench: Make) -> None:
    made = bench()

    def body() -> None:
        made.drone.wait_connected()
        made.node.say("rc_connection_status", data=0)
        made.wait(0.1)
        assert "the transmitter is lost" in made.drone.texts[-1].text
        made.node.say("rc_connection_status", data=1)
        made.wait(0.1)
        assert "received again" in made.drone.texts[-1].text

    made.run(body)


def test_in_the_air_the_motors_are_stopped_by_force_only(bench: Make) -> None:
    made = bench()

    def body() -> None:
        made.drone.wait_ready()
        made.node.obey(4)
        made.wait(0.1)
        with pytest.raises(Refused, match="would fall"):
            made.drone.disarm()
        made.drone.kill(sure=True)
        assert made.node.asked[-1][1].arm == 0
        assert not made.drone.armed

    made.run(body)


# -- takeover


def test_the_pilot_who_moves_the_mode_switch_has_it_until_he_moves_it_back(bench: Make) -> None:
    made = bench()

    def body() -> None:
        made.drone.wait_ready()
        made.node.obey(4)
        made.wait(0.1)
        made.later(1.0, lambda: setattr(made.node, "switch", -1.0))
        made.later(1.0, lambda: setattr(made.node, "mode", 6))
        with pytest.raises(Overridden, match="P_GPS by RC"):
            made.drone.goto(at(20.0, 0.0, 5.0))
        made.node.setpoints.clear()
        with pytest.raises(Overridden, match="did not command"):
            made.drone.hold()
        assert made.node.setpoints == []
        assert "the authority is lost" in made.drone.texts[-1].text
        made.node.switch = 1.0
        made.wait(0.1)
        asked = made.node.names().count("sdk_control_authority")
        made.drone.hold()
        assert made.node.names().count("sdk_control_authority") == asked + 1  # it must be asked for anew

    made.run(body)


def test_setpoints_that_are_not_obeyed_mean_that_another_has_the_authority(bench: Make) -> None:
    made = bench()

    def body() -> None:
        made.drone.wait_ready()
        made.node.obey(4)
        made.wait(0.1)
        made.kernel.every(10 * MS, lambda: setattr(made.node, "mode", 6))
        with pytest.raises(Overridden, match="by another program"):
            made.drone.goto(at(20.0, 0.0, 5.0))

    made.run(body)


def test_going_home_by_itself_is_a_failsafe(bench: Make) -> None:
    made = bench()

    def body() -> None:
        made.drone.wait_ready()
        made.node.obey(4)
        made.wait(0.1)

        def insist() -> None:
            made.node.mode = 15

        made.later(1.0, lambda: made.kernel.every(10 * MS, insist) and None)
        with pytest.raises(Failsafe, match="NAVI_GO_HOME"):
            made.drone.goto(at(20.0, 0.0, 5.0))

    made.run(body)


def test_a_silent_link_is_lost_and_comes_back(bench: Make) -> None:
    made = bench()

    def body() -> None:
        made.drone.wait_ready()
        made.node.obey(4)
        made.wait(0.1)
        made.later(1.0, lambda: setattr(made.node, "mute", True))
        with pytest.raises(LinkLost, match="no message was received"):
            made.drone.goto(at(20.0, 0.0, 5.0))
        made.node.mute = False
        made.wait(0.5)
        made.drone.hold()

    made.run(body)
    details = [event.state for event in made.events if type(event).__name__ == "LinkState"]
    assert details == ["silent", "back"]


def test_anomalies_are_texts(bench: Make) -> None:
    made = bench()

    def body() -> None:
        made.drone.wait_connected()
        made.node.say("flight_anomaly", data=128 | 2048)
        made.wait(0.1)
        made.node.say("flight_anomaly", data=128)
        made.wait(0.1)
        said: list[StatusText] = made.drone.texts
        assert [one.text for one in said] == ["esc disconnected", "strong wind level2"]

    made.run(body)


# -- the M100


def test_an_m100_is_read_by_its_own_numbers(bench: Make) -> None:
    made = bench("M100")

    def take_off(_task: int) -> None:
        made.node.status = 2
        made.later(4.0, lambda: setattr(made.node, "status", 3))
        made.later(6.0, lambda: made.node.be_at(0.0, 0.0, 1.2))

    made.node.on_task = take_off

    def body() -> None:
        made.drone.wait_connected()
        assert (made.drone.armed, made.drone.flying) == (False, False)  # 1 is ON_GROUND, motors off
        follows(made)
        made.drone.takeoff(5.0)
        assert made.kernel.now() > 6 * S  # it is off the ground when it has gained a metre
        assert made.drone.telemetry.autopilot == "DJI M100"
        made.node.on_task = lambda _task: setattr(made.node, "status", 4)
        made.later(1.0, lambda: setattr(made.node, "status", 5))
        made.later(3.0, lambda: setattr(made.node, "status", 1))
        made.drone.land()
        assert not made.drone.armed

    made.run(body)


# -- hostile


@pytest.mark.parametrize(
    "spoiled",
    [
        {"latitude": float("nan"), "longitude": 0.0, "altitude": 0.0},
        {"latitude": 91.0, "longitude": 0.0, "altitude": 0.0},
        {"latitude": 46.0, "longitude": -103.0, "altitude": float("inf")},
        {"latitude": 0.0, "longitude": 0.0, "altitude": 0.0},
        {"latitude": 0.0, "longitude": 0.0, "altitude": 82.0},
    ],
)
def test_a_place_off_the_globe_is_not_believed(bench: Make, spoiled: dict[str, Any]) -> None:
    made = bench()

    def body() -> None:
        made.drone.wait_ready()
        made.node.lost = True
        made.wait(0.1)
        before = made.drone.position
        made.node.say("gps_position", **spoiled)
        made.wait(0.1)
        assert made.drone.position == before

    made.run(body)


def test_numbers_beyond_any_meaning_upset_nothing(bench: Make) -> None:
    made = bench()

    def body() -> None:
        made.drone.wait_ready()
        made.node.say("rc", axes=[])
        made.node.say("battery_state", voltage=float("nan"), current=float("nan"))
        made.node.say("attitude", quaternion={"w": 0.0, "x": 0.0, "y": 0.0, "z": 0.0})
        made.node.say("height_above_takeoff", data=float("nan"))
        made.node.status, made.node.mode = 200, 255
        made.wait(0.2)
        assert made.drone.mode == "MODE_255"
        assert made.drone.flying

    made.run(body)


def test_what_a_drone_is_not(bench: Make) -> None:
    made = bench()
    with pytest.raises(CapabilityError, match="no steps"):
        made.driver.manual()
