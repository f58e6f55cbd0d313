"""Rover operations against the scripted autopilot."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from volery.base.errors import CapabilityError, OutOfBounds, Overridden, UsageError
from volery.base.position import AboveHome, Position
from volery.base.time import S
from volery.kernel.waiting import sleep
from volery.vehicles import Drone, Fence, Rover, TakeOff, Zone

Make = Callable[..., Any]
LONGITUDE = 149.16523
NEAR = (-35.3628, LONGITUDE)
SET_MODE, ARM, SPEED = 176, 400, 178


def test_driving_arms_and_goes_there(bench: Make) -> None:
    at = bench(Rover)
    at.fly(lambda rover: rover.drive(NEAR, speed=2.0))
    assert at.autopilot.commands() == [SET_MODE, ARM, SPEED]
    target = at.autopilot.sent("SET_POSITION_TARGET_GLOBAL_INT")[0]
    assert (target["coordinate_frame"], target["alt"], target["lat_int"]) == (6, 0.0, -353628000)


def test_it_stands_in_hold_and_disarms_at_the_end_of_a_program(bench: Make) -> None:
    at = bench(Rover)

    def mission(rover: Any) -> str:
        rover.drive(Position(*NEAR, AboveHome(33)))
        assert not rover.driving
        return str(rover.come_to_rest())

    assert at.fly(mission) == "stopped and was disarmed"
    assert (at.craft.mode, at.craft.armed) == ("HOLD", False)


def test_returning_home(bench: Make) -> None:
    at = bench(Rover)

    def mission(rover: Any) -> None:
        rover.drive(NEAR)
        at.after(5, lambda: setattr(at.craft, "north", 0.0))
        rover.return_home()
        assert rover.mode == "RTL"

    at.fly(mission)


def test_driving_by_hand_uses_steering_and_throttle_only(bench: Make) -> None:
    at = bench(Rover)

    def mission(rover: Any) -> None:
        rover.manual_control(steering=-0.4, throttle=0.5)
        rover.manual()
        rover.arm()
        sleep(at.kernel, S)

    at.fly(mission)
    held = at.autopilot.sent("RC_CHANNELS_OVERRIDE")[-1]
    assert [held[f"chan{number}_raw"] for number in range(1, 5)] == [1300, 65535, 1750, 65535]
    with pytest.raises(UsageError, match="steering=3; it goes from -1 to 1"):
        at.fly(lambda rover: rover.manual_control(3, 0))


def test_what_it_armed_itself_it_may_drive(bench: Make) -> None:
    """ArduRover arms in MANUAL, in which an armed rover counts as driving."""
    at = bench(Rover)

    def mission(rover: Any) -> None:
        rover.wait_ready()
        at.autopilot.enter("MANUAL")
        sleep(at.kernel, 2 * S)
        rover.arm()
        sleep(at.kernel, 2 * S)
        rover.drive(NEAR)

    at.fly(mission)


def test_a_driver_who_takes_over_is_not_fought(bench: Make) -> None:
    at = bench(Rover)

    def mission(rover: Any) -> None:
        rover.wait_ready()
        at.craft.velocity = (2.0, 0.0, 0.0)
        at.after(4, lambda: at.autopilot.enter("MANUAL"))
        with pytest.raises(Overridden, match="changed from GUIDED to MANUAL"):
            rover.drive(NEAR)
        with pytest.raises(Overridden, match="is in MANUAL"):
            rover.drive(NEAR)
        assert rover.come_to_rest() == "is left to the pilot or station in MANUAL"

    at.fly(mission)


def test_bounds_on_the_ground(bench: Make) -> None:
    school = Zone(
        "school", ((-35.3630, 149.1648), (-35.3630, 149.1656), (-35.3629, 149.1656), (-35.3629, 149.1648))
    )
    at = bench(Rover, fence=Fence(no_fly=(school,)))
    with pytest.raises(OutOfBounds, match="no-fly zone 'school'"):
        at.fly(lambda rover: rover.drive(NEAR))
    with pytest.raises(OutOfBounds, match="km from home"):
        at.fly(lambda rover: rover.drive((-35.2, LONGITUDE)))
    with pytest.raises(UsageError, match="off the globe"):
        at.fly(lambda rover: rover.drive((135.2, LONGITUDE)))


def test_a_rover_is_no_drone(bench: Make) -> None:
    at = bench(Rover)
    at.vehicle.__class__, at.vehicle._connection.kind = Drone, Drone.kind
    with pytest.raises(CapabilityError, match="craft_1 is a rover, not a drone"):
        at.fly(lambda drone: drone.takeoff(10))


def test_a_rover_takes_missions_too(bench: Make) -> None:
    at = bench(Rover)
    at.fly(lambda rover: (rover.wait_ready(), rover.upload_mission([TakeOff(1)])))
    assert at.autopilot.mission[1]["command"] == 22
