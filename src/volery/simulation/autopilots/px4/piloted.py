"""POSCTL: PX4's multirotor flown by sticks, or by nobody."""

from __future__ import annotations

from math import cos, hypot, sin

from volery.base.frames import Vector
from volery.base.time import Ns, to_seconds
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.manual_flight import ByPilot
from volery.simulation.autopilots.px4.ramps import climb_share
from volery.simulation.autopilots.vehicle_state import Manoeuvre, Vehicle

SINK_BLIND = 0.7
"""MPC_LAND_SPEED: how it sinks in POSCTL without sticks [m/s]."""

EXPO = 0.6
"""MPC_XY_MAN_EXPO, MPC_Z_MAN_EXPO."""

STICK_SPEED_SHARE = 0.78
"""Of MPC_VEL_MANUAL: what a stick held for long came to in the recordings."""


def curve(stick: float, dead: float) -> float:
    """-1..1: nothing within the dead zone, gently beyond."""
    size = abs(stick)
    if size <= dead:
        return 0.0
    along = (size - dead) / (1.0 - dead)
    shaped = EXPO * along**3 + (1.0 - EXPO) * along
    return shaped if stick > 0.0 else -shaped


class BlindDescent(Manoeuvre):
    """POSCTL with nobody at the sticks: it keeps its place and sinks."""

    landing = False

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self._held: Vector = (0.0, 0.0, 0.0)

    def enter(self) -> None:
        """Where it is."""
        self._held = self.vehicle.estimate.position

    def step(self) -> None:
        """Sink."""
        tuning = self.vehicle.tuning
        self.vehicle.drive(
            Setpoint(
                Control.POSITION_CLIMB,
                position=self._held,
                climb=-SINK_BLIND,
                speed=tuning.speed,
                speed_down=tuning.speed_down,
                accel=tuning.accel,
                accel_z=tuning.accel_z,
                tilt=tuning.tilt,
            )
        )


class Position(ByPilot):
    """POSCTL: sticks are accelerations against a drag; let go, it brakes and stays."""

    slow_start = True

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self._velocity = (0.0, 0.0)
        self._last: Ns = 0
        self._held: Vector | None = None
        self._blind: BlindDescent | None = None

    def enter(self) -> None:
        """With the speed that it has."""
        north, east, _ = self.vehicle.estimate.velocity
        self._velocity, self._held, self._blind = (north, east), None, None
        self._last = self.vehicle.kernel.now()

    def wants_to_fly(self) -> bool:
        """When the pilot asks to climb."""
        return self._sticks and self._climb() > 0.0

    @property
    def _sticks(self) -> bool:
        valid: bool = self.vehicle.memory.joystick.valid
        return valid

    def _climb(self) -> float:
        p = self.vehicle.parameters
        asked = curve(self.vehicle.memory.joystick.now.throttle, p["MPC_HOLD_DZ"])
        return asked * (p["MPC_Z_VEL_MAX_UP"] if asked > 0.0 else p["MPC_Z_VEL_MAX_DN"])

    def step(self) -> None:
        """Sticks to speed; without sticks it sinks."""
        if not self._sticks:
            if self._blind is None:
                self._blind = BlindDescent(self.vehicle)
                self._blind.enter()
            self._blind.step()
            return
        if self._blind is not None:
            self.enter()
        self._fly()

    def _fly(self) -> None:
        vehicle, tuning, p = self.vehicle, self.vehicle.tuning, self.vehicle.parameters
        now = vehicle.kernel.now()
        passed, self._last = to_seconds(now - self._last), now
        sticks, dead = vehicle.memory.joystick.now, p["MPC_HOLD_DZ"]
        forward, right = curve(sticks.pitch, dead), curve(sticks.roll, dead)
        self._move(forward, right, passed)
        climb = self._climb()
        north, east = self._velocity
        self.drive(
            Setpoint(
                Control.VELOCITY if self._held is None else Control.POSITION_CLIMB,
                position=self._held or (0.0, 0.0, 0.0),
                velocity=(north, east, -climb),
                climb=min(climb, climb_share(vehicle) * tuning.speed_up),
                yaw_rate=curve(sticks.yaw, dead) * tuning.pilot_yaw_rate,
                speed=tuning.speed,
                speed_up=climb_share(vehicle) * tuning.speed_up,
                speed_down=tuning.speed_down,
                accel=tuning.accel,
                accel_z=tuning.accel_z,
                tilt=tuning.tilt,
            )
        )

    def _move(self, forward: float, right: float, passed: float) -> None:
        p = self.vehicle.parameters
        heading = self.vehicle.estimate.attitude[2]
        c, s = cos(heading), sin(heading)
        north, east = self._velocity
        push, top = p["MPC_ACC_HOR"], STICK_SPEED_SHARE * p["MPC_VEL_MANUAL"]
        if forward or right:
            self._held = None
            kept = 1.0 / (1.0 + push / top * passed)
            north = (north + push * (forward * c - right * s) * passed) * kept
            east = (east + push * (forward * s + right * c) * passed) * kept
            self._velocity = (north, east)
            return
        speed = hypot(north, east)
        left = max(0.0, speed - max(0.3, min(push, 1.2 * speed)) * passed)
        self._velocity = (north * left / speed, east * left / speed) if speed > 0.0 else (0.0, 0.0)
        if left == 0.0 and self._held is None:
            self._held = self.vehicle.estimate.target
