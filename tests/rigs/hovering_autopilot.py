"""An autopilot that is none of volery's: samples of sensors in, one command for each motor out."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import asin, atan2, cos, hypot, nan, sin, sqrt
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import MS, Ns, S
from volery.links.mavlink_codec import MAVLINK
from volery.simulation.world.body_specs import STANDARD_GRAVITY, Multirotor, Rotor
from volery.trace.events import VehicleState

PERIOD: Ns = 4 * MS
"""Period of its loops, at 250 Hz."""
AT_REST: Ns = 1 * S
"""Time after the start in which it learns the bias of its gyroscope."""
PER_STEP = PERIOD / S


def _limited(value: float, most: float) -> float:
    return max(-most, min(most, value))


class HoveringAutopilot:
    """Rises to a height above where it stands, and stays there.

    Attitude is the integral of the gyroscope, position and velocity are those of the satellites' fix.
    """

    banner = b""

    def __init__(self, kernel: Any, flight: Any, name: str = "craft", height: float = 8.0) -> None:
        self.transmitter = [1500] * 8
        self.closed = 0
        self._kernel, self._flight, self._name, self._height = kernel, flight, name, height
        self._samples = 0
        self._bias = [0.0, 0.0, 0.0]
        self._angles = [0.0, 0.0, 0.0]  # roll, pitch, yaw [rad]
        self._place: Any = None
        self._sag = 0.0  # acceleration [m/s^2] that a battery below full takes from the motors
        flight.drive_motors([0.0] * flight.rotors)
        self._loop = kernel.every(PERIOD, self._step)

    @property
    def armed(self) -> bool:
        """Whether its motors turn."""
        return self._kernel.now() > AT_REST and not self.closed

    def _step(self) -> None:
        seen = self._flight.estimate()
        if not self.armed:
            self._align(seen)
            return
        rates = [rate - bias for rate, bias in zip(seen.gyro, self._bias, strict=True)]
        self._angles = [angle + PER_STEP * rate for angle, rate in zip(self._angles, rates, strict=True)]
        roll, pitch, yaw = self._angles
        fix = seen.gps
        here = self._flight.frame.to_ned(fix.latitude, fix.longitude, fix.amsl)
        north, east, down = (
            1.2 * (_limited(0.6 * (there - at), 1.0) - speed)
            for there, at, speed in zip(self._place, here, fix.velocity, strict=True)
        )
        lean_right = _limited((east * cos(yaw) - north * sin(yaw)) / STANDARD_GRAVITY, 0.2)
        lean_back = _limited(-(north * cos(yaw) + east * sin(yaw)) / STANDARD_GRAVITY, 0.2)
        wanted = lean_right, lean_back, 0.0
        turn = [
            12.0 * (4.0 * (target - angle) - rate)
            for target, angle, rate in zip(wanted, self._angles, rates, strict=True)
        ]
        self._sag = _limited(self._sag - 0.4 * PER_STEP * down, 3.0)
        lift = self._flight.mass * (STANDARD_GRAVITY - down + self._sag) / (cos(roll) * cos(pitch))
        self._flight.drive_motors(motor_commands(self._flight.spec, lift, turn))

    def _align(self, seen: Any) -> None:
        self._samples += 1
        for axis, rate in enumerate(seen.gyro):
            self._bias[axis] += (rate - self._bias[axis]) / self._samples
        forward, right, down = seen.accel
        self._angles = [atan2(-right, -down), asin(_limited(forward / STANDARD_GRAVITY, 1.0)), 0.0]
        fix = seen.gps
        north, east, down = self._flight.frame.to_ned(fix.latitude, fix.longitude, fix.amsl)
        self._place = north, east, down - self._height

    def connect(self, link: Any, *, use: str = "") -> None:
        """Hear and say nothing."""

    def join(self, graph: Any, namespace: str, place: Any) -> None:
        """Refuse: it is reached over links."""
        raise UsageError(f"{self._name} is reached over links")

    def swap_battery(self) -> None:
        """Fly on a full battery."""
        self._flight.set_charge(1.0)

    def state(self) -> VehicleState:
        """True state; it states no estimate."""
        seen = self._flight.truth()
        where = *seen.position, *seen.attitude, *seen.velocity, nan, nan, nan
        power = seen.battery_left, seen.volts, seen.amps
        mode = "HOVER" if self.armed else "OFF"
        return VehicleState(self._kernel.now(), self._name, *where, *power, self.armed, mode)

    def close(self) -> None:
        """Stop its loops."""
        self._loop.cancel()
        self.closed += 1


def motor_commands(spec: Multirotor, lift: float, turn: list[float]) -> list[float]:
    """Motor commands for a thrust [N] and angular accelerations about forward, right, down [rad/s^2].

    The axes do not disturb each other where the rotors are spaced evenly about the centre.
    """
    roll, right, down = (inertia * rate for inertia, rate in zip(spec.inertia, turn, strict=True))
    across = sum(one.left * one.left for one in spec.rotors)
    along = sum(one.forward * one.forward for one in spec.rotors)
    drag = len(spec.rotors) * spec.torque_coefficient / spec.thrust_coefficient

    def command(rotor: Rotor) -> float:
        thrust = lift / len(spec.rotors) + roll * rotor.left / across
        thrust += right * rotor.forward / along - down * rotor.spin / drag
        return min(1.0, sqrt(max(0.0, thrust) / spec.thrust_coefficient) / spec.top_speed)

    return [command(rotor) for rotor in spec.rotors]


def off_centre(flight: Any) -> float:
    """Distance in the plane from the world's origin [m]."""
    east, north, _ = flight.truth().position
    return hypot(east, north)


@dataclass
class HoveringFamily:
    """Their family; it has no rovers. ``made`` are those that it has created."""

    name: str = "hovering"
    codec: Any = MAVLINK
    default_links: tuple[Any, ...] = ()
    airframes: bool = True
    made: list[HoveringAutopilot] = field(default_factory=list)

    def of_version(self, version: str) -> HoveringFamily:
        """There is one only."""
        return self

    def with_features(self, names: str) -> HoveringFamily:
        """There are none."""
        return self

    def create(self, kernel: Any, flight: Any, *, name: str, **options: Any) -> HoveringAutopilot:
        """See ``AutopilotFamily``."""
        if not flight.flying:
            raise UsageError("hovering autopilots do not drive")
        self.made.append(HoveringAutopilot(kernel, flight, name))
        return self.made[-1]
