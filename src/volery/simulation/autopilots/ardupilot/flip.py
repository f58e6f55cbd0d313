"""FLIP: one turn about the roll or the pitch axis, then back to the mode before.

Stages, angles, rates and thrusts are those of ArduCopter's mode_flip.cpp; it is run a hundred times a second.
"""

from __future__ import annotations

from enum import IntEnum
from math import radians

from volery.base.time import MS, Ns, to_seconds
from volery.kernel.api import Handle
from volery.simulation.autopilots.ardupilot.feature import Feature
from volery.simulation.autopilots.ardupilot.modes import MANUAL_BITS, enter
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.manual_flight import Stabilize
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle, Mode

PERIOD: Ns = 10 * MS
RATE, RATE_ACCEL = radians(400.0), radians(1100.0)
"""FLIP_ROTATION_RATE [rad/s], and the acceleration to it [rad/s^2], ATC_ACCEL_R_MAX."""
MORE_THRUST, LESS_THRUST = 0.20, 0.24
"""FLIP_THR_INC and FLIP_THR_DEC, shares of full thrust."""
STEEP, UPSIDE_DOWN, RECOVERED = radians(45.0), radians(90.0), radians(5.0)
TIME_OUT: Ns = 2500 * MS
ABANDONED_BY, CHOSEN_BY = 40.0 / 45.0, 3.0 / 45.0
"""Deflections of a stick that end a flip, and that choose its axis."""
FLIPS_FROM = ("ACRO", "STABILIZE", "ALT_HOLD")
"""Modes from which a flip starts."""
FLIP, FLIP_SWITCH = 14, 2
"""Number of the mode, and value of RCn_OPTION."""


class _FlipStage(IntEnum):
    START, ROLL, PITCH_UP, PITCH_DOWN, RECOVER = range(5)


def may_flip(vehicle: AutopilotVehicle) -> bool:
    """Return whether FLIP may be entered: in flight, from a mode by hand, without a far roll stick."""
    sticks = Stabilize(vehicle).pilot
    closed = sticks.throttle <= 0.0 and vehicle.mode.manual_throttle
    flies = vehicle.armed and not vehicle.landed
    return flies and vehicle.mode.name in FLIPS_FROM and not closed and abs(sticks.roll) < ABANDONED_BY


class Flip(Stabilize):
    """Turn once about an axis that the sticks choose, level out, and enter the mode before.

    Args:
        vehicle: The vehicle.
    """

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._stage = _FlipStage.START
        self._timer: Handle | None = None
        self._started: Ns = 0
        self._last: Ns = 0
        self._roll = self._pitch = 0.0
        """Sense of the turn about each axis: -1, 0 or 1."""
        self._rate = 0.0
        self._angles = (0.0, 0.0, 0.0)
        """Attitude at the start."""

    def enter(self) -> None:
        """Choose the axis by the sticks, and begin."""
        vehicle, pilot = self.vehicle, self.pilot
        self._started = self._last = vehicle.kernel.now()
        self._angles = vehicle.estimate.attitude
        if abs(pilot.pitch) > CHOSEN_BY:
            self._pitch = 1.0 if pilot.pitch > 0.0 else -1.0
        else:
            self._roll = 1.0 if pilot.roll >= 0.0 else -1.0
        self._timer = vehicle.kernel.every(PERIOD, self._run)

    def step(self) -> None:
        """Do nothing: the turn has a period of its own."""

    def _run(self) -> None:
        vehicle, pilot = self.vehicle, self.pilot
        now = vehicle.kernel.now()
        if vehicle.manoeuvre is not self or not vehicle.armed:
            self._stop()
            return
        passed, self._last = to_seconds(now - self._last), now
        self._rate = min(RATE, self._rate + RATE_ACCEL * passed)
        self._advance()
        moved = max(abs(pilot.roll), abs(pilot.pitch)) >= ABANDONED_BY
        if (
            moved
            or now - self._started > TIME_OUT
            or (self._stage == _FlipStage.RECOVER and self._is_level())
        ):
            self._stop()
            vehicle.enter_mode(vehicle.mode_before)
            return
        self._drive(self.thrust(pilot.throttle))

    def _stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def _advance(self) -> None:
        """Go on to the next stage at its angle."""
        roll, pitch, _ = self.vehicle.estimate.attitude
        turned = roll * self._roll if self._roll else pitch * self._pitch
        inverted = abs(roll) > UPSIDE_DOWN
        if self._stage == _FlipStage.START and turned >= STEEP:
            self._stage = _FlipStage.ROLL if self._roll else _FlipStage.PITCH_UP
        elif self._stage == _FlipStage.ROLL and -UPSIDE_DOWN < turned < STEEP:
            self._stage = _FlipStage.RECOVER
        elif self._stage == _FlipStage.PITCH_UP and inverted and turned > STEEP:
            self._stage = _FlipStage.PITCH_DOWN
        elif self._stage == _FlipStage.PITCH_DOWN and not inverted and turned > -STEEP:
            self._stage = _FlipStage.RECOVER

    def _is_level(self) -> bool:
        axis = 0 if self._roll else 1
        return abs(self._angles[axis] - self.vehicle.estimate.attitude[axis]) <= RECOVERED

    def _drive(self, thrust: float) -> None:
        """Give the set-point of the stage; the thrust has no correction for the lean."""
        if self._stage == _FlipStage.RECOVER:
            roll, pitch, yaw = self._angles
            lift = min(1.0, thrust + MORE_THRUST)
            self.vehicle.drive(Setpoint(Control.ATTITUDE, roll=roll, pitch=pitch, yaw=yaw, throttle=lift))
            return
        change = MORE_THRUST if self._stage == _FlipStage.START else -LESS_THRUST
        self.vehicle.drive(
            Setpoint(
                Control.RATE,
                roll_rate=self._roll * self._rate,
                pitch_rate=self._pitch * self._rate,
                throttle=min(1.0, max(0.0, thrust + change)),
            )
        )


def _enter_flip(vehicle: AutopilotVehicle, mode: Mode) -> bool:
    return enter(vehicle, mode, "" if may_flip(vehicle) else "init failed")


COPTER = Feature(
    modes=(Mode(FLIP, "FLIP", MANUAL_BITS, Flip, armable=False),),
    mode_switches={FLIP_SWITCH: FLIP},
    entries={FLIP: _enter_flip},
    tumbling=("FLIP",),
)
