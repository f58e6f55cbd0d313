"""Vehicles that are out there, recorded as their autopilots say that they are."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan, radians

from volery.base.frames import LocalFrame, Quaternion, attitude_ned_to_enu, euler_to_quaternion
from volery.base.position import Position
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.run.options import SAMPLING_PERIOD
from volery.run.progress import VehicleProgress
from volery.trace.events import VehicleState
from volery.vehicles import Vehicle
from volery.vehicles.telemetry import Attitude

UNKNOWN = (nan, nan, nan)


class Watched:
    """Vehicles of which nobody knows the truth. The origin is where the first of them was seen first."""

    def __init__(self, kernel: Kernel, vehicles: Sequence[Vehicle]) -> None:
        self._kernel = kernel
        self._vehicles = vehicles
        self._frame: LocalFrame | None = None

    def sample(self, period: Ns = SAMPLING_PERIOD) -> None:
        """Record the state of every vehicle now and then each *period*."""
        self._kernel.every(period, self.record_states)

    def progress(self) -> tuple[VehicleProgress, ...]:
        """What those that have been heard do now."""
        heard = [(one.name, one.telemetry) for one in self._vehicles if one.telemetry.heard >= 0]
        return tuple(VehicleProgress(name, seen.mode, seen.armed, seen.above_home) for name, seen in heard)

    def record_states(self) -> None:
        """Record the state of every vehicle that has been heard."""
        for vehicle in self._vehicles:
            if vehicle.telemetry.heard >= 0:
                self._kernel.record(self._state(vehicle))

    def _state(self, vehicle: Vehicle) -> VehicleState:
        seen = vehicle.telemetry
        return VehicleState(
            self._kernel.now(),
            vehicle.name,
            *UNKNOWN,
            *_attitude(seen.attitude),
            seen.velocity.east,
            seen.velocity.north,
            seen.velocity.up,
            *self._about_origin(seen.position),
            *seen.battery,
            seen.armed,
            seen.mode,
        )

    def _about_origin(self, at: Position | None) -> tuple[float, float, float]:
        """ENU [m] of a position above mean sea level; NaN while it is not known."""
        if at is None:
            return nan, nan, nan
        amsl = at.altitude.metres
        if self._frame is None:
            self._frame = LocalFrame(at.latitude, at.longitude, amsl)
        return self._frame.to_enu(at.latitude, at.longitude, amsl)


def _attitude(seen: Attitude) -> Quaternion:
    """FLU body in ENU."""
    return attitude_ned_to_enu(euler_to_quaternion(*map(radians, seen)))
