"""THROW: the motors start when the copter is thrown or dropped; then it stops and enters the next mode.

Stages, conditions and texts are those of ArduCopter's mode_throw.cpp, looked at ten times a second here.
"""

from __future__ import annotations

from enum import IntEnum
from math import dist, hypot

from volery.base.elementary import cos
from volery.base.time import MS, Ns
from volery.simulation.autopilots.ardupilot.feature import Feature
from volery.simulation.autopilots.ardupilot.modes import MANUAL_BITS, change_mode, enter
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.to_point import BRAKE_ACCEL, root_speed
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import IDLE, OFF, AutopilotVehicle, FlightManoeuvre, Mode
from volery.trace.events import INFO

GRAVITY = 9.80665
DROP = 1
"""THROW_TYPE."""
HIGH_SPEED, CHANGING_SPEED = 5.0, 0.5
"""Speed, and rate of climb or descent, of a copter that is thrown [m/s]."""
FALLS, CONFIRMED = 0.25 * GRAVITY, 2.5
"""Specific force downwards [m/s^2] and loss of the climb rate [m/s] of one that falls freely."""
WITHIN: Ns = 500 * MS
"""Time from the first sign for that loss [ns]."""
UPRIGHT = 0.866
"""Cosine of the lean from which it is upright."""
NEAR = 0.5
"""Distance to the demanded height and place that counts as there [m]."""
ABOVE, BELOW = 3.0, 1.0
"""Demanded height above a throw, and below a drop [m]."""
VERTICAL_SPEED = 2.5
"""BRAKE_MODE_SPEED_Z [m/s]."""
NEXT_MODES = (3, 4, 5, 6, 9, 17)
"""Modes that THROW_NEXTMODE may name."""
THROW = 18
"""Number of the mode."""


class _ThrowStage(IntEnum):
    DISARMED, DETECTING, SPOOLING, UPRIGHTING, HEIGHT, PLACE = range(6)


class Throw(FlightManoeuvre):
    """Wait for the throw, get upright, stop climbing or falling, stop, and enter the next mode.

    Args:
        vehicle: The vehicle.
    """

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self.starts_at_once = True
        self._stage = _ThrowStage.DISARMED
        self._falls_since: Ns = NEVER
        self._climb_then = 0.0
        """Climb rate at the first sign of the throw [m/s]."""
        self._detected_at: Ns = NEVER
        self._down = 0.0
        """Demanded height, down about the estimator's origin [m]."""
        self._went_on = False

    def enter(self) -> None:
        """Begin anew, at entry and when armed; the motors are off unless THROW_MOT_START is 1."""
        self.waiting = IDLE if self.vehicle.parameters["THROW_MOT_START"] == 1.0 else OFF
        self._stage = _ThrowStage.DISARMED
        self._went_on = False

    def _say(self, text: str) -> None:
        self.vehicle.send_text(INFO, text)

    def takeoff_requested(self) -> bool:
        """Return whether the throw is detected; called at each tick before it."""
        if self._stage == _ThrowStage.DISARMED:
            self._say("waiting for throw")
            self._stage = _ThrowStage.DETECTING
        elif self._stage == _ThrowStage.DETECTING and self._is_thrown():
            self._say("throw detected - spooling motors")
            self._stage, self._detected_at = _ThrowStage.SPOOLING, self.vehicle.kernel.now()
        return self._stage >= _ThrowStage.SPOOLING

    def _is_thrown(self) -> bool:
        vehicle, now = self.vehicle, self.vehicle.kernel.now()
        estimate, p = vehicle.estimate, vehicle.parameters
        north, east, down = estimate.acceleration
        climb = -estimate.velocity[2]
        changes = climb < -CHANGING_SPEED if p["THROW_TYPE"] == DROP else climb > CHANGING_SPEED
        falls = down - GRAVITY > -FALLS or hypot(*estimate.velocity) > HIGH_SPEED
        released = hypot(north, east, down - GRAVITY) < GRAVITY
        lowest, highest = p["THROW_ALT_MIN"], p["THROW_ALT_MAX"]
        admitted = (not lowest or vehicle.height > lowest) and (not highest or vehicle.height < highest)
        if changes and falls and released and admitted and now - self._falls_since > WITHIN:
            self._falls_since, self._climb_then = now, climb
        return now - self._falls_since < WITHIN and climb - self._climb_then < -CONFIRMED

    def step(self) -> None:
        """Go on to the next stage when one is reached, and give its set-point."""
        vehicle, estimate = self.vehicle, self.vehicle.estimate
        roll, pitch, _ = estimate.attitude
        spooled = vehicle.kernel.now() - self._detected_at >= vehicle.rules.arming.spool_up
        if self._stage == _ThrowStage.SPOOLING and spooled:
            self._say("throttle is unlimited - uprighting")
            self._stage = _ThrowStage.UPRIGHTING
        elif self._stage == _ThrowStage.UPRIGHTING and cos(roll) * cos(pitch) > UPRIGHT:
            self._say("uprighted - controlling height")
            self._stage = _ThrowStage.HEIGHT
            dropped = vehicle.parameters["THROW_TYPE"] == DROP
            self._down = estimate.position[2] + (BELOW if dropped else -ABOVE)
        elif self._stage == _ThrowStage.HEIGHT and estimate.position[2] - self._down < NEAR:
            self._say("height achieved - controlling position")
            self._stage = _ThrowStage.PLACE
        elif self._stage == _ThrowStage.PLACE and not self._went_on and self._has_stopped():
            self._went_on = True
            following = round(vehicle.parameters["THROW_NEXTMODE"])
            if following in NEXT_MODES and change_mode(vehicle, following):
                return
        vehicle.drive(self._setpoint())

    def _has_stopped(self) -> bool:
        estimate = self.vehicle.estimate
        return dist(estimate.position[:2], estimate.target[:2]) < NEAR

    def _setpoint(self) -> Setpoint:
        tuning = self.vehicle.tuning
        if self._stage <= _ThrowStage.UPRIGHTING:
            return Setpoint(Control.ATTITUDE, throttle=0.5)
        above = self._down - self.vehicle.estimate.position[2]
        climb = -root_speed(above, BRAKE_ACCEL) if above > 0.0 else root_speed(-above, BRAKE_ACCEL)
        climb = min(VERTICAL_SPEED, max(-VERTICAL_SPEED, climb))
        level = self._stage == _ThrowStage.HEIGHT
        return Setpoint(
            Control.CLIMB if level else Control.VELOCITY,
            velocity=(0.0, 0.0, 0.0 if level else -climb),
            climb=climb,
            speed_up=VERTICAL_SPEED,
            speed_down=VERTICAL_SPEED,
            accel=BRAKE_ACCEL,
            accel_z=BRAKE_ACCEL,
            tilt=tuning.tilt,
        )


def _enter_throw(vehicle: AutopilotVehicle, mode: Mode) -> bool:
    return enter(vehicle, mode, "init failed" if vehicle.armed else "")


COPTER = Feature(
    parameters={
        "THROW_ALT_MAX": ("m", "height from which a throw does not count; 0: none"),
        "THROW_ALT_MIN": ("m", "height below which a throw does not count; 0: none"),
        "THROW_MOT_START": ("", "1: motors idle before a throw"),
        "THROW_NEXTMODE": ("", "mode after a throw; 18: none"),
        "THROW_TYPE": ("", "1: the copter is dropped, not thrown upwards"),
    },
    modes=(Mode(THROW, "THROW", MANUAL_BITS, Throw, needs_position=True, manual_throttle=True),),
    entries={THROW: _enter_throw},
    tumbling=("THROW",),
)
