"""Figures that manoeuvres fly by, in SI units and radians. A dialect works them out from its parameters."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import NamedTuple

from volery.base.time import Ns, S
from volery.simulation.autopilots.simulated.sticks import Sticks, Travel


class Pilot(NamedTuple):
    """The four sticks, dead zones taken off: right, back (nose up), clockwise -1..1; throttle 0..1 from its
    low end.
    """

    roll: float
    pitch: float
    throttle: float
    yaw: float


@dataclass(frozen=True)
class StickMap:
    """Which channel is which stick, and how each travels."""

    roll: int = 1
    pitch: int = 2
    throttle: int = 3
    yaw: int = 4
    travels: tuple[Travel, Travel, Travel, Travel] = (Travel(1000, 1500, 2000, 20),) * 4
    """Of roll, pitch, throttle, yaw."""

    def read(self, sticks: Sticks) -> Pilot:
        """What the pilot asks for."""
        roll, pitch, throttle, yaw = self.travels
        return Pilot(
            roll.deflection(sticks[self.roll]),
            pitch.deflection(sticks[self.pitch]),
            throttle.share(sticks[self.throttle]),
            yaw.deflection(sticks[self.yaw]),
        )

    @property
    def throttle_middle(self) -> float:
        """Where the middle of the throttle stick's travel lies on its scale of 0..1."""
        travel = self.travels[2]
        return travel.share((travel.low + travel.high) / 2.0)


@dataclass(frozen=True)
class Tuning:
    """Speeds m/s, accelerations m/s^2, angles rad, lengths m, times ns."""

    sticks: StickMap = StickMap()
    speed: float = 10.0
    speed_up: float = 2.5
    speed_down: float = 1.5
    accel: float = 2.5
    accel_z: float = 1.0
    tilt: float = radians(30.0)
    waypoint_radius: float = 2.0
    face_path: bool = True
    """Turn the nose along the path of a mission."""

    land_speed: float = 0.5
    land_speed_high: float = 1.5
    land_slow_below: float = 10.0

    return_height: float = 15.0
    return_climb_min: float = 0.0
    return_cone: float = 3.0
    return_speed: float = 10.0
    return_wait: Ns = 5 * S
    return_final: float = 0.0
    """Height at which it stays over home; 0: it lands."""

    pilot_up: float = 2.5
    pilot_down: float = 2.5
    pilot_accel_z: float = 2.5
    pilot_yaw_rate: float = radians(202.5)
    throttle_dead: float = 0.1
    """Half of the throttle's dead zone about its middle, on its scale of 0..1."""
    hover_throttle: float = 0.39

    loiter_speed: float = 12.5
    loiter_accel: float = 5.0
    loiter_tilt: float = radians(20.0)
    loiter_brake: float = 2.5
    loiter_brake_delay: Ns = S

    circle_radius: float = 10.0
    circle_rate: float = radians(20.0)

    target_timeout: Ns = 3 * S
