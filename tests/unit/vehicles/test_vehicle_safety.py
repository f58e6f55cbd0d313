"""Safety above the autopilot: fences and reserves while it travels, who takes precedence, sticks."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import inf, nan
from typing import Any

import pytest

from volery.base.errors import (
    CapabilityError,
    LowBattery,
    OutOfBounds,
    Overridden,
    Refused,
    UsageError,
    VoleryError,
)
from volery.base.position import AboveHome, Position
from volery.base.time import S
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import sleep
from volery.trace.events import Operation, Text
from volery.vehicles import ChangeSpeed, Fence, Limits, Rover, TakeOff, Waypoint

Make = Callable[..., Any]

LATITUDE, LONGITUDE = -35.3632610, 149.1652300
PER_M = 1.0 / 111_000.0
ARM, YAW = 400, 115


def north(metres: float, up: float = 10.0) -> Position:
    return Position(LATITUDE + metres * PER_M, LONGITUDE, AboveHome(up))


def box(metres: float, *, about: float = 0.0) -> tuple[tuple[float, float], ...]:
    low, high = LATITUDE + (about - metres) * PER_M, LATITUDE + (about + metres) * PER_M
    west, east = LONGITUDE - metres * 1.2 * PER_M, LONGITUDE + metres * 1.2 * PER_M
    return ((low, west), (high, west), (high, east), (low, east))


def drift(at: Any, metres: float) -> None:
    """It is carried away, whatever it was commanded."""
    at.craft.north, at.craft.velocity = metres, (2.0, 0.0, 0.0)
    at.after(6, lambda: setattr(at.craft, "velocity", (0.0, 0.0, 0.0)))


def meanwhile(at: Any, seconds: float, action: Callable[[], Any]) -> list[Any]:
    """*action* in a task of its own, so much later; what it raised."""
    raised: list[Any] = []

    def body() -> None:
        try:
            action()
        except VoleryError as error:
            raised.append(error)

    at.after(seconds, lambda: at.kernel.spawn(body, "guardian", ExecutionContext("guardian")))
    return raised


# -- fences


def test_one_that_is_carried_out_of_its_fence_is_held(bench: Make) -> None:
    at = bench(fence=Fence(box(100)))

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.velocity = (5.0, 0.0, 0.0)
        at.after(2.3, lambda: drift(at, 130.0))
        drone.goto(north(50))

    with pytest.raises(OutOfBounds, match="30 m outside the fence; it holds there"):
        at.fly(mission)
    held = at.autopilot.sent("SET_POSITION_TARGET_GLOBAL_INT")[-1]
    assert held["lat_int"] == pytest.approx((LATITUDE + 130 * PER_M) * 1e7, abs=300)


def test_outside_the_ways_to_safety_are_open_and_so_is_the_way_back(bench: Make) -> None:
    at = bench(fence=Fence(box(100)))

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.velocity = (5.0, 0.0, 0.0)
        at.after(2.3, lambda: drift(at, 130.0))
        with pytest.raises(OutOfBounds):
            drone.goto(north(50))
        with pytest.raises(OutOfBounds, match="the goal is outside the fence"):
            drone.goto(north(120))
        drone.hold()
        drone.goto(north(20))
        at.craft.north = 130.0
        sleep(at.kernel, S)
        drone.return_home()

    at.fly(mission)
    assert [one.outcome for one in at.recorded(Operation)][-3:] == ["ok", "ok", "ok"]


def test_a_vehicle_that_another_took_out_of_the_fence_gets_no_messages(bench: Make) -> None:
    at = bench(fence=Fence(box(100)))

    def pilot() -> None:
        at.autopilot.enter("LOITER")
        drift(at, 130.0)
        at.autopilot.received.clear()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.velocity = (5.0, 0.0, 0.0)
        at.after(2, pilot)
        drone.goto(north(50))

    with pytest.raises(Overridden, match="from GUIDED to LOITER"):
        at.fly(mission)
    sleep_until_quiet(at)
    assert at.autopilot.commands() == []
    assert at.craft.mode == "LOITER"


def sleep_until_quiet(at: Any) -> None:
    at.kernel.run(at.kernel.now() + 10 * S)


def test_a_velocity_that_leads_out_is_stopped_and_the_next_call_says_so(bench: Make) -> None:
    at = bench(fence=Fence(box(100)))

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_velocity(north=1.0, lasting=30.0)
        drift(at, 120.0)
        sleep(at.kernel, 12 * S)
        assert at.recorded(Operation)[-1].operation == "hold"
        with pytest.raises(OutOfBounds, match="20 m outside the fence; it was commanded to hold"):
            drone.set_velocity(north=-1.0)
        drone.goto(north(10))

    at.fly(mission)


def test_sticks_do_not_lead_out_either(bench: Make) -> None:
    at = bench(fence=Fence(box(100)))

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.manual_control(0.5, 0, 0.5, 0)
        drone.altitude_hold()
        drift(at, 120.0)
        sleep(at.kernel, 12 * S)
        assert at.craft.mode == "GUIDED"
        with pytest.raises(OutOfBounds, match="it was commanded to hold"):
            drone.manual_control(0.5, 0, 0.5, 0)
        drone.manual_control(-0.5, 0, 0.5, 0)
        drone.altitude_hold()  # by hand it may come back
        sleep(at.kernel, 3 * S)
        assert at.craft.mode == "ALT_HOLD"

    at.fly(mission)


def test_a_fence_that_excludes_home_is_refused_before_it_arms(bench: Make) -> None:
    for call in (lambda drone: drone.wait_ready(), lambda drone: drone.takeoff(10)):
        at = bench(fence=Fence(box(20, about=100.0)))
        with pytest.raises(UsageError, match=r"the fence excludes home: home .* is outside"):
            at.fly(call)
        assert ARM not in at.autopilot.commands()


def test_a_fence_may_be_changed_between_commands(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.goto(north(50))
        drone.fence = Fence(box(100), ceiling=AboveHome(20))
        with pytest.raises(OutOfBounds, match="above the fence's ceiling"):
            drone.goto(north(60, 25))

    at.fly(mission)


def test_a_mission_on_board_is_checked_again_when_it_starts(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.wait_ready()
        drone.upload_mission([TakeOff(10), Waypoint(north(150))])
        drone.fence = Fence(box(100))
        drone.start_mission()

    with pytest.raises(OutOfBounds, match=r"mission item 2 \(Waypoint\): the goal is outside the fence"):
        at.fly(mission)
    assert not at.craft.armed


def test_a_rover_is_fenced_as_well(bench: Make) -> None:
    at = bench(Rover, fence=Fence(box(100)))
    with pytest.raises(OutOfBounds, match="the goal is outside the fence"):
        at.fly(lambda rover: rover.drive(north(120)))


# -- the battery's reserve


def battery(at: Any, percent: int) -> None:
    def status() -> None:
        at.autopilot.say(
            "SYS_STATUS",
            onboard_control_sensors_health=at.craft.health,
            voltage_battery=12600,
            current_battery=150,
            battery_remaining=percent,
        )

    at.autopilot._sys_status = status


def test_below_the_reserve_nothing_but_the_way_back_is_begun(bench: Make) -> None:
    at = bench(limits=Limits(battery_reserve=0.5))

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        battery(at, 40)
        sleep(at.kernel, S)
        for call in (partial(drone.goto, north(20)), partial(drone.set_velocity, north=1.0)):
            with pytest.raises(LowBattery, match="at 40%, below the reserve of 50%"):
                call()
        drone.hold()
        drone.set_heading(90)
        drone.return_home()
        with pytest.raises(LowBattery):
            drone.takeoff(10)

    at.fly(mission)
    assert at.recorded(Operation)[-1].outcome == "LowBattery"


def test_below_the_reserve_on_the_way_it_is_held(bench: Make) -> None:
    at = bench(limits=Limits(battery_reserve=0.5))

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.velocity = (5.0, 0.0, 0.0)
        at.after(2, lambda: battery(at, 40))
        at.after(7, lambda: setattr(at.craft, "velocity", (0.0, 0.0, 0.0)))
        with pytest.raises(LowBattery, match=r"return_home\(\), land\(\) and hold\(\).*; it holds there"):
            drone.goto(north(80))
        drone.land()

    at.fly(mission)


def test_a_reserve_without_a_battery_monitor_cannot_be_kept(bench: Make) -> None:
    at = bench(limits=Limits(battery_reserve=0.2))
    battery(at, -1)
    with pytest.raises(CapabilityError, match="does not report how full the battery is"):
        at.fly(lambda drone: drone.takeoff(10))
    assert not at.craft.armed


# -- who takes precedence


@pytest.mark.parametrize("name", ["hold", "return_home", "land"])
def test_the_ways_to_safety_take_the_place_of_what_is_under_way(bench: Make, name: str) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.velocity = (5.0, 0.0, 0.0)
        at.after(4, lambda: setattr(at.craft, "velocity", (0.0, 0.0, 0.0)))
        raised = meanwhile(at, 3, getattr(drone, name))
        with pytest.raises(Overridden, match=rf"{name}\(\) by guardian took its place"):
            drone.goto(north(80))
        sleep(at.kernel, 20 * S)
        assert raised == []

    at.fly(mission)
    assert [(one.operation, one.outcome) for one in at.recorded(Operation)][1:] == [
        ("goto", "Overridden"),
        (name, "ok"),
    ]


def test_a_take_off_that_is_landed_does_not_start_over(bench: Make) -> None:
    at = bench()
    at.autopilot.climb_s = 20.0

    def mission(drone: Any) -> None:
        raised = meanwhile(at, 8, lambda: drone.kill(sure=True))
        with pytest.raises(Overridden, match=r"kill\(\) by guardian took its place"):
            drone.takeoff(10)
        sleep(at.kernel, 5 * S)
        assert raised == []

    at.fly(mission)
    assert at.autopilot.commands().count(ARM) == 2  # once armed, once killed
    assert not at.craft.armed


def test_kill_stops_the_motors_in_the_air_whatever_the_mode(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.autopilot.enter("LOITER")
        sleep(at.kernel, S)
        with pytest.raises(Overridden):
            drone.land()
        drone.kill(sure=True)

    at.fly(mission)
    assert not at.craft.armed
    assert at.autopilot.sent("COMMAND_LONG")[-1]["param2"] == 21196


@pytest.mark.parametrize("sure", [False, 1, None])
def test_kill_must_be_meant(bench: Make, sure: Any) -> None:
    at = bench()
    with pytest.raises(UsageError, match=r"if that is meant: sure=True"):
        at.fly(lambda drone: (drone.takeoff(10), drone.kill(sure=sure)))
    assert at.craft.armed


def test_streams_end_when_another_station_takes_over(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_velocity(north=1.0, lasting=60.0)
        at.autopilot.enter("LOITER")
        sleep(at.kernel, 2 * S)
        at.autopilot.received.clear()
        sleep(at.kernel, 5 * S)
        assert not at.autopilot.sent("SET_POSITION_TARGET_GLOBAL_INT")
        assert not at.autopilot.sent("SET_POSITION_TARGET_LOCAL_NED")
        with pytest.raises(Overridden):
            drone.set_velocity(north=1.0)

    at.fly(mission)


# -- sticks


@pytest.mark.parametrize("name", ["stabilize", "altitude_hold"])
def test_no_flying_by_hand_without_fresh_sticks(bench: Make, name: str) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        with pytest.raises(Refused, match=r"there is none\); call manual_control"):
            getattr(drone, name)()
        drone.takeoff(10)
        drone.manual_control(0, 0, 0.5, 0)
        sleep(at.kernel, 2 * S)
        with pytest.raises(Refused, match=r"the last is 2\.\d s old"):
            getattr(drone, name)()
        drone.manual_control(0, 0, 0.5, 0)
        drone.hold()
        with pytest.raises(Refused, match="no manual control is newer than 1 s"):
            getattr(drone, name)()  # hold() let go of them
        drone.manual_control(0, 0, 0.5, 0)
        getattr(drone, name)()

    at.fly(mission)


def test_a_rover_needs_fresh_controls_and_is_armed(bench: Make) -> None:
    at = bench(Rover)

    def mission(rover: Any) -> None:
        with pytest.raises(Refused, match="no manual control is newer than 1 s"):
            rover.manual()
        rover.manual_control(0.1, 0.2)
        rover.manual()
        assert rover.armed

    at.fly(mission)


def test_one_that_will_not_arm_by_hand_says_why(bench: Make) -> None:
    at = bench()
    at.autopilot.refuse[ARM] = ["Arm: Throttle too high"]

    def mission(drone: Any) -> None:
        drone.manual_control(0, 0, 0.9, 0)
        drone.stabilize()

    with pytest.raises(Refused, match=r"Throttle too high.*arms with the throttle down"):
        at.fly(mission)


def test_flying_by_hand_needs_no_position(bench: Make) -> None:
    at = bench()
    at.craft.placed, at.craft.ekf = False, 0

    def mission(drone: Any) -> None:
        drone.manual_control(0, 0, 0.5, 0)
        drone.altitude_hold()
        at.craft.landed_state, at.craft.status = 2, 4
        sleep(at.kernel, S)
        drone.manual_control(0, 0, 0.5, 0)
        drone.stabilize()
        drone.land()

    at.fly(mission)
    assert [one.outcome for one in at.recorded(Operation)] == ["ok"] * 3


# -- bad input


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda drone: drone.takeoff(nan), "nan is not a finite number"),
        (lambda drone: drone.takeoff(inf), "inf is not a finite number"),
        (lambda drone: drone.goto(north(10), speed=nan), "speed=nan: nan is not a finite number"),
        (lambda drone: drone.goto(north(10), speed=inf), "speed=inf: inf is not a finite number"),
        (lambda drone: drone.set_velocity(north=nan), "nan is not a finite number"),
        (lambda drone: drone.set_velocity(yaw_rate=inf), "inf is not a finite number"),
        (lambda drone: drone.set_velocity(north=1, lasting=nan), "nan is not a finite number"),
        (lambda drone: drone.set_velocity(north=1, lasting=0), "lasting is in seconds, above 0"),
        (lambda drone: drone.set_heading(nan), "nan is not a finite number"),
        (lambda drone: drone.manual_control(nan, 0, 0.5, 0), "nan is not a finite number"),
        (lambda drone: drone.manual_control(0, inf, 0.5, 0), "inf is not a finite number"),
        (lambda drone: drone.manual_control(0, 0, nan, 0), "nan is not a finite number"),
        (lambda drone: drone.manual_control(0, 0, 1.1, 0), "throttle=1.1; it goes from 0 to 1"),
        (lambda drone: drone.manual_control(0, 0, 0.5, -2), "yaw=-2; it goes from -1 to 1"),
        (lambda drone: drone.upload_mission([TakeOff(nan)]), "a height of nan m"),
        (lambda drone: drone.upload_mission([ChangeSpeed(-1)]), "a speed of -1 m/s"),
        (lambda drone: drone.upload_mission([Waypoint(north(5), stay_s=nan)]), "a stay of nan s"),
    ],
)
def test_numbers_that_are_none(bench: Make, call: Callable[[Any], None], says: str) -> None:
    at = bench()
    with pytest.raises(UsageError, match=says):
        at.fly(lambda drone: (drone.wait_ready(), call(drone)))
    assert not at.craft.armed


# -- what it does if left alone


def test_the_reaction_to_link_loss_is_recorded_once_it_is_known(bench: Make) -> None:
    at = bench()
    lines = ["", "", "it lands"]
    at.vehicle._driver.on_link_loss = lambda: lines.pop(0) if len(lines) > 1 else lines[0]

    def reactions() -> list[str]:
        return [one.text for one in at.recorded(Text) if one.text.startswith("if this program")]

    def mission(drone: Any) -> None:
        drone.wait_connected()
        assert not reactions()
        sleep(at.kernel, 5 * S)
        assert drone.on_link_loss == "it lands"

    at.fly(mission)
    assert reactions() == ["if this program stops sending: it lands"]
