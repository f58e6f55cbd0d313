"""Real vehicles in a run: recorded as their telemetry reports them."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan, radians

from volery.base.frames import LocalFrame, Quaternion, attitude_ned_to_enu, euler_to_quaternion
from volery.base.position import Position
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.run.result import SAMPLING_PERIOD, VehicleProgress
from volery.trace.events import VehicleState
from volery.vehicles import Vehicle
from volery.vehicles.telemetry import Attitude

UNKNOWN = (nan, nan, nan)


class ObservedVehicles:
    """Real vehicles, recorded as their telemetry reports them.

    The origin of the local frame is the first position that is received. The true acceleration and angular
    rates stay unknown.
    """

    def __init__(self, kernel: Kernel, vehicles: Sequence[Vehicle]) -> None:
        self._kernel = kernel
        self._vehicles = vehicles
        self._frame: LocalFrame | None = None

    def sample(self, period: Ns = SAMPLING_PERIOD) -> None:
        """Record the state of every vehicle periodically, from now on."""
        self._kernel.every(period, self.record_states)

    def progress(self) -> tuple[VehicleProgress, ...]:
        """Return the present state of each vehicle whose telemetry arrives."""
        known = [
            (vehicle.name, vehicle.telemetry)
            for vehicle in self._vehicles
            if vehicle.telemetry.last_message_ns >= 0
        ]
        return tuple(VehicleProgress(name, seen.mode, seen.armed, seen.above_home) for name, seen in known)

    def record_states(self) -> None:
        """Record the present state of each vehicle whose telemetry arrives."""
        for vehicle in self._vehicles:
            if vehicle.telemetry.last_message_ns >= 0:
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
            *self._enu(seen.position),
            *seen.battery,
            seen.armed,
            seen.mode,
        )

    def _enu(self, at: Position | None) -> tuple[float, float, float]:
        """Return metres east, north and up of the origin; NaN while the position is unknown."""
        if at is None:
            return nan, nan, nan
        amsl = at.altitude.metres
        if self._frame is None:
            self._frame = LocalFrame(at.latitude, at.longitude, amsl)
        return self._frame.to_enu(at.latitude, at.longitude, amsl)


def _attitude(seen: Attitude) -> Quaternion:
    """Return the attitude of the FLU body in ENU."""
    return attitude_ned_to_enu(euler_to_quaternion(*map(radians, seen)))
