"""Attitude and acceleration set-points on simulated autopilots, and the arguments that they take."""

from __future__ import annotations

from math import hypot, nan

import pytest

from rigs.airstrip import Airstrip
from volery.base.errors import CapabilityError, OutOfBounds, Refused, UsageError
from volery.base.time import MS, S
from volery.kernel.waiting import sleep
from volery.run.connect import connect
from volery.vehicles import Drone
from volery.vehicles.drivers.ardupilot import open_driver as open_ardupilot
from volery.vehicles.drivers.px4 import open_driver as open_px4


class ArduPilotStrip(Airstrip):
    firmware = "ardupilot"
    opener = staticmethod(open_ardupilot)


class Px4Strip(Airstrip):
    firmware = "px4"
    opener = staticmethod(open_px4)


BOTH = pytest.mark.parametrize("strip", [ArduPilotStrip, Px4Strip])


@BOTH
def test_a_pitch_flies_forward_and_the_end_stops_the_drone(strip: type[Airstrip]) -> None:
    field = strip()

    def mission(drone: Drone) -> tuple[float, float, float]:
        drone.takeoff(10)
        drone.set_heading(90)
        drone.set_attitude(pitch=-8.0, heading=90.0, lasting=4.0)
        sleep(drone.kernel, 2000 * MS)
        east = drone.velocity.east
        pitch = drone.attitude.pitch
        sleep(drone.kernel, 8 * S)
        return east, pitch, hypot(drone.velocity.north, drone.velocity.east)

    east, pitch, rest = field.fly(mission)
    assert east > 1.0
    assert pitch == pytest.approx(-8.0, abs=3.0)
    assert rest < 0.5


@BOTH
def test_an_acceleration_gains_speed(strip: type[Airstrip]) -> None:
    field = strip()

    def mission(drone: Drone) -> tuple[float, float]:
        drone.takeoff(10)
        drone.set_acceleration(north=1.5, lasting=2.0)
        sleep(drone.kernel, 1900 * MS)
        fast = drone.velocity.north
        sleep(drone.kernel, 8 * S)
        return fast, hypot(drone.velocity.north, drone.velocity.east)

    fast, rest = field.fly(mission)
    assert fast > 0.8
    assert rest < 0.5


@BOTH
def test_roll_and_pitch_are_reported(strip: type[Airstrip]) -> None:
    field = strip()

    def mission(drone: Drone) -> tuple[float, float]:
        drone.takeoff(5)
        return drone.attitude.roll, drone.attitude.pitch

    roll, pitch = field.fly(mission)
    assert abs(roll) < 10.0
    assert abs(pitch) < 10.0


def test_setpoints_that_make_no_sense_are_refused() -> None:
    field = ArduPilotStrip()

    def mission(drone: Drone) -> None:
        with pytest.raises(Refused, match="on the ground"):
            drone.set_attitude(pitch=-5)
        with pytest.raises(UsageError, match="'5' is not a finite number; write it as in set_attitude"):
            drone.set_attitude(pitch="5")  # type: ignore[arg-type]  # what a console can pass
        with pytest.raises(UsageError, match="thrust goes from 0 to 1"):
            drone.set_attitude(thrust=50)
        with pytest.raises(UsageError, match="within -90 and 90"):
            drone.set_attitude(roll=120)
        with pytest.raises(UsageError, match="nan is not a finite number"):
            drone.set_acceleration(north=nan)
        with pytest.raises(UsageError, match="lasting is in seconds, above 0"):
            drone.set_acceleration(north=1, lasting=0)
        drone.takeoff(10)
        with pytest.raises(OutOfBounds):
            drone.set_acceleration(up=8.0, lasting=10.0)

    field.fly(mission)


def test_attitudes_of_a_dji_and_what_it_and_a_paparazzi_cannot_do() -> None:
    with connect("sim:dji") as drone:
        drone.takeoff(10)
        drone.set_attitude(pitch=-8.0, lasting=3.0)
        sleep(drone.kernel, 2500 * MS)
        assert hypot(drone.velocity.north, drone.velocity.east) > 1.0
        sleep(drone.kernel, 8 * S)
        assert hypot(drone.velocity.north, drone.velocity.east) < 0.5
        with pytest.raises(CapabilityError, match="cannot follow an acceleration"):
            drone.set_acceleration(north=1.0)
        with pytest.raises(CapabilityError, match="the parameter RTL_ALT: the SDK node of a DJI"):
            drone.parameters.get("RTL_ALT")
    with connect("sim:paparazzi") as drone, pytest.raises(CapabilityError, match="cannot follow an attitude"):
        drone.set_attitude(pitch=-5.0)
