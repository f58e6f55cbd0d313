"""A failsafe that this program has caused by a broken stream, and targets beyond PX4's own geofence."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from volery.base.errors import Failsafe, Refused
from volery.base.position import AboveHome, Position
from volery.base.time import S
from volery.kernel.waiting import sleep
from volery.vehicles.drivers.px4.modes import HOLD

Make = Callable[..., Any]


def freeze(at: Any, seconds: int) -> None:
    """The program stands still: what arrives meanwhile waits, what it would send is not sent."""
    offboard = at.vehicle._driver._offboard
    offboard._timer.cancel()
    at.autopilot.mute = True

    def go_on() -> None:
        at.autopilot.mute = False
        offboard._timer = at.kernel.every(S // 10, offboard._tick)

    at.after(seconds, go_on)


@pytest.mark.parametrize("seconds", [3, 4])
def test_a_frozen_program_does_not_take_offboard_back_and_is_told(bench: Make, seconds: int) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_velocity(north=1.0, lasting=60.0)
        freeze(at, seconds)
        sleep(at.kernel, (seconds + 4) * S)
        assert at.craft.mode == "POSCTL"  # the stream has not taken it back
        with pytest.raises(Failsafe, match=r"set-points was interrupted.*resume\(\)"):
            drone.set_velocity(north=1.0)
        with pytest.raises(Failsafe):
            drone.goto(drone.position)
        drone.resume()
        assert at.craft.mode == HOLD
        at.craft.status = 4
        sleep(at.kernel, 2 * S)
        drone.set_velocity(north=1.0)

    at.fly(mission)


@pytest.mark.parametrize("order", ["land", "hold", "return_home", "come_to_rest"])
def test_every_order_of_safety_ends_it(bench: Make, order: str) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_velocity(north=1.0, lasting=60.0)
        freeze(at, 3)
        sleep(at.kernel, 7 * S)
        assert at.craft.mode == "POSCTL"
        getattr(drone, order)()

    at.fly(mission)
    assert at.craft.mode != "POSCTL"


def test_another_failsafe_is_not_taken_back(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_velocity(north=1.0, lasting=60.0)
        at.craft.status = 5
        at.autopilot.enter("AUTO.RTL")
        sleep(at.kernel, 2 * S)
        for order in (drone.resume, drone.hold):
            with pytest.raises(Failsafe):
                order()

    at.fly(mission)


def test_a_target_beyond_its_geofence_is_refused_at_once(bench: Make) -> None:
    at = bench()
    go = at.autopilot._go

    def outside(fields: dict[str, Any]) -> int:
        at.autopilot.text("Reposition is outside geofence", 2)
        return int(go(fields))

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.autopilot._go, at.autopilot._there = outside, lambda *goal: None
        here = drone.position
        began = at.kernel.now()
        with pytest.raises(Refused, match="Reposition is outside geofence"):
            drone.goto(Position(here.latitude + 0.003, here.longitude, AboveHome(10)))
        assert at.kernel.now() - began < 2 * S

    at.fly(mission)
