"""Old or unmeasured state decides nothing, and a vehicle's own safe action is not overruled."""

from __future__ import annotations

from collections.abc import Callable
from math import isnan
from typing import Any

import pytest

from volery.base.errors import Failsafe, LinkLost, LowBattery, OutOfBounds, Overridden, PositionLost
from volery.base.position import AboveHome, Position
from volery.base.time import S
from volery.kernel.waiting import sleep
from volery.vehicles import Fence, Limits

Make = Callable[..., Any]

LATITUDE, LONGITUDE = -35.3632610, 149.1652300
PER_M = 1.0 / 111_000.0
SET_MODE, LAND = 176, 9


def north(metres: float, up: float = 10.0) -> Position:
    return Position(LATITUDE + metres * PER_M, LONGITUDE, AboveHome(up))


def modes_commanded(at: Any) -> list[float]:
    sent = at.autopilot.sent("COMMAND_LONG")
    return [fields["param2"] for fields in sent if fields["command"] == SET_MODE]


def stall(at: Any, seconds: float) -> None:
    """The link holds everything back for so long, then delivers it at once."""
    held: list[tuple[str, dict[str, Any]]] = []
    say = at.autopilot.say
    at.autopilot.say = lambda name, **fields: held.append((name, fields))
    at.autopilot.deaf = True

    def resume() -> None:
        at.autopilot.say, at.autopilot.deaf = say, False
        for name, fields in held:
            say(name, **fields)

    at.after(seconds, resume)


# -- a link that stalls


def test_a_return_home_of_its_own_is_not_overruled_when_a_stalled_link_is_back(bench: Make) -> None:
    at = bench()

    def own_return() -> None:
        at.craft.mode, at.craft.status = "RTL", 5
        at.kernel.call_at(at.kernel.now() + 20 * S, lambda: at.autopilot.down("RTL"))

    def mission(drone: Any) -> str:
        drone.takeoff(10)
        at.craft.velocity = (5.0, 0.0, 0.0)
        stall(at, 12.0)
        at.after(7.0, own_return)
        with pytest.raises(LinkLost):
            drone.goto(north(300))
        at.autopilot.received.clear()
        return str(drone.come_to_rest())

    assert at.fly(mission) == "landed by itself in RTL"
    assert modes_commanded(at) == []


def test_the_state_is_marked_stale_from_the_silence_until_it_is_fresh_again(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        assert not drone.stale
        at.autopilot.mute = True
        sleep(at.kernel, 3 * S)
        assert drone.stale
        at.autopilot.mute = False
        sleep(at.kernel, 2 * S)
        assert drone.stale
        sleep(at.kernel, 3 * S)
        assert not drone.stale

    at.fly(mission)


@pytest.mark.parametrize(("stated", "silent_s"), [({}, 6.0), ({"link_timeout": S}, 1.5)])
def test_nothing_but_an_order_of_safety_is_sent_into_a_lost_link(
    bench: Make, stated: dict[str, int], silent_s: float
) -> None:
    at = bench(**stated)

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.autopilot.mute = True
        sleep(at.kernel, round(silent_s * S))
        at.autopilot.received.clear()
        with pytest.raises(LinkLost):
            drone.goto(north(30))
        sleep(at.kernel, S // 10)
        assert not at.autopilot.sent("SET_POSITION_TARGET_GLOBAL_INT")
        with pytest.raises(LinkLost):
            drone.land()
        sleep(at.kernel, S)
        assert modes_commanded(at) == [LAND]
        at.autopilot.mute = False

    at.fly(mission)


# -- a failsafe of the autopilot


@pytest.mark.parametrize("mode", ["LAND", "RTL"])
def test_the_end_of_a_program_leaves_a_failsafe_to_itself(bench: Make, mode: str) -> None:
    at = bench()

    def mission(drone: Any) -> str:
        drone.takeoff(10)
        at.craft.status = 5
        sleep(at.kernel, 2 * S)  # it holds first, as PX4 does
        at.after(3, lambda: at.autopilot.enter(mode))
        at.autopilot.received.clear()
        return str(drone.come_to_rest())

    assert at.fly(mission) == f"landed by itself in {mode}"
    assert modes_commanded(at) == []


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("Battery Failsafe", "battery"),
        ("Fence Breached", "fence"),
        ("EKF Failsafe: changed to LAND Mode", "position: GPS or estimator"),
        ("GCS Failsafe", "link to the ground station"),
        ("Radio Failsafe", "manual control"),
    ],
)
def test_a_failsafe_states_its_cause_even_without_its_status(bench: Make, text: str, cause: str) -> None:
    at = bench()

    def acts() -> None:
        at.autopilot.text(text, 2)
        at.autopilot.enter("RTL")

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.velocity = (5.0, 0.0, 0.0)
        at.after(2, acts)
        with pytest.raises(Failsafe) as raised:
            drone.goto(north(300))
        assert f"failsafe ({cause})" in str(raised.value)

    at.fly(mission)


def test_a_pilot_who_changes_the_mode_is_no_failsafe(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.velocity = (5.0, 0.0, 0.0)
        at.autopilot.text("GPS Glitch cleared")
        at.after(2, lambda: at.autopilot.enter("LOITER"))
        with pytest.raises(Overridden) as raised:
            drone.goto(north(300))
        assert not isinstance(raised.value, Failsafe)

    at.fly(mission)


# -- position


def test_without_satellites_nothing_arrives_and_the_operation_ends(bench: Make) -> None:
    at = bench()

    def lose() -> None:
        at.autopilot._gps_raw_int = lambda: at.autopilot.say("GPS_RAW_INT", fix_type=1)

    def mission(drone: Any) -> float:
        drone.takeoff(10)
        lose()
        sleep(at.kernel, S)
        began = at.kernel.now()
        with pytest.raises(PositionLost, match=r"no position for 1\d s \(its GPS reports no_fix\)"):
            drone.goto(north(30))  # the scripted one reports that it is there at once
        return float(at.kernel.now() - began) / S

    assert 8.0 < at.fly(mission) < 11.0


def test_a_position_that_is_no_longer_reported_is_lost(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.after(1, lambda: setattr(at.craft, "placed", False))
        at.craft.velocity = (5.0, 0.0, 0.0)
        with pytest.raises(PositionLost, match="none is reported"):
            drone.goto(north(300))

    at.fly(mission)


# -- battery


def tell_battery(at: Any, percent: int, centiamperes: int = 150) -> None:
    at.autopilot._sys_status = lambda: at.autopilot.say(
        "SYS_STATUS",
        onboard_control_sensors_health=at.craft.health,
        voltage_battery=12600,
        current_battery=centiamperes,
        battery_remaining=percent,
    )


def test_a_reserve_is_kept_by_default(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        tell_battery(at, 14)
        sleep(at.kernel, S)
        with pytest.raises(LowBattery, match="14%, below the reserve of 15%"):
            drone.goto(north(20))
        drone.limits = Limits(battery_reserve=0.0)
        drone.goto(north(20))
        drone.land()

    at.fly(mission)


@pytest.mark.parametrize("centiamperes", [-1, -100])
def test_what_is_not_measured_is_no_number(bench: Make, centiamperes: int) -> None:
    at = bench()
    tell_battery(at, -1, centiamperes)

    def mission(drone: Any) -> None:
        drone.takeoff(10)  # no default reserve without a battery monitor
        assert isnan(drone.battery.amperes)
        assert isnan(drone.battery.remaining)

    at.fly(mission)


# -- bounds


def test_a_velocity_that_would_leave_the_fence_does_not_go_on(bench: Make) -> None:
    half = 60 * PER_M
    corners = tuple(
        (LATITUDE + a * half, LONGITUDE + b * half * 1.3) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    )
    at = bench(fence=Fence(corners))

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_velocity(north=8.0)
        at.craft.north = 40.0
        sleep(at.kernel, S)
        with pytest.raises(OutOfBounds, match="outside the fence; it holds there"):
            drone.set_velocity(north=8.0)
        drone.goto(north(10))

    at.fly(mission)


def test_a_call_while_it_is_held_for_its_bounds_says_so(bench: Make) -> None:
    half = 60 * PER_M
    corners = tuple(
        (LATITUDE + a * half, LONGITUDE + b * half * 1.3) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    )
    at = bench(fence=Fence(corners))

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_velocity(north=1.0, lasting=10.0)
        at.craft.north, at.craft.velocity = 80.0, (2.0, 0.0, 0.0)
        sleep(at.kernel, S)  # the hold is under way: it has not come to rest
        with pytest.raises(OutOfBounds, match="outside the fence"):
            drone.goto(north(10))
        at.craft.velocity = (0.0, 0.0, 0.0)

    at.fly(mission)
