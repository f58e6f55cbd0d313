"""How a command of a control law reaches an autopilot: by set-points or by overridden RC channels.

A law commands a velocity over ground and a turn rate. ``VelocitySetpoints`` passes both on where the
autopilot follows a computer, ``AttitudeSetpoints`` as tilt angles, thrust and turn rate. ``RcOverride`` flies
as the thesis did, by the sticks: pulse widths from tilt, climb rate and turn rate. ``RcAxis`` holds trim,
dead band and scale of one channel; a law that is to overcome the dead band needs its true width.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import copysign, degrees, inf, isfinite, isnan, radians, sqrt
from typing import NamedTuple, Protocol

from volery.base.elementary import atan, cos, exp, log, sin
from volery.base.errors import UsageError
from volery.base.frames import turn_clockwise
from volery.control.laws import PidGains, PidLaw
from volery.control.link_failsafes import BY_STICKS
from volery.control.turn_prediction import TurnModel, TurnPrediction
from volery.control.vehicle_answer import (
    PREDICTED,
    PREDICTED_WITHIN_S,
    TILT_ANSWERS,
    VELOCITY_ANSWERS,
    LoopAnswer,
    answer_of,
)
from volery.trace.events import WARNING, Text
from volery.vehicles import Drone
from volery.vehicles.telemetry import HALF_US, MIDDLE_US, Attitude

GRAVITY = 9.80665


class MotionCommand(NamedTuple):
    """Velocity over ground in m/s and turn rate in degrees/s, clockwise positive."""

    north: float = 0.0
    east: float = 0.0
    up: float = 0.0
    yaw_rate: float = 0.0


class MeasuredState(NamedTuple):
    """What a law sees: heading in degrees, position in m about home, velocity in m/s; NaN where unknown.

    ``lead`` is the turn in degrees that is still to come by the commands already given.
    """

    heading: float
    north: float
    east: float
    up: float
    velocity_north: float
    velocity_east: float
    velocity_up: float
    lead: float = 0.0


class Actuation(Protocol):
    """Applies commands to a drone."""

    @property
    def lead(self) -> float:
        """Turn in degrees that is still to come by the commands already given; 0 where it is not modelled."""
        return 0.0

    @property
    def answer(self) -> LoopAnswer | None:
        """How the vehicle answers commands; ``None`` where they have other units than ``MotionCommand``."""
        return None

    def take_off(self, height: float) -> None:
        """Arm and climb to *height* m above home; blocks until it is there."""

    def engage(self) -> None:
        """Take control in the air."""

    def apply(self, command: MotionCommand, measured: MeasuredState, sample_s: float) -> None:
        """Send one command."""


def _turn_model(drone: Drone, scale: RcScale | None = None) -> TurnModel | None:
    """Return the model of turns, unless headings are reported too rarely for a prediction."""
    scale = scale or RC_SCALES.get(drone.telemetry.autopilot)
    rare = drone.telemetry.heading_reports.seconds > PREDICTED_WITHIN_S
    return None if scale is None or rare else scale.turning


def _answer(answers: Mapping[str, LoopAnswer], drone: Drone, model: TurnModel | None) -> LoopAnswer:
    """Return the answer of the drone's autopilot; with a *model* its turns are predicted."""
    answer = answer_of(answers, drone.telemetry.autopilot)
    return answer if model is None else answer._replace(turn=PREDICTED)


class VelocitySetpoints(Actuation):
    """Velocity set-points in the mode in which the autopilot follows a computer.

    Args:
        drone: the drone.
        lasting: time after which the drone stops if no command follows, s.
    """

    def __init__(self, drone: Drone, lasting: float = 1.0) -> None:
        self._drone, self._lasting = drone, lasting
        self._turning = TurnPrediction(None)

    @property
    def lead(self) -> float:
        """Turn in degrees that is still to come."""
        return self._turning.lead

    @property
    def answer(self) -> LoopAnswer | None:
        """How the autopilot follows velocities."""
        return _answer(VELOCITY_ANSWERS, self._drone, _turn_model(self._drone))

    def take_off(self, height: float) -> None:
        """Take off by the autopilot's own take-off."""
        self._drone.takeoff(height)
        self._turning = TurnPrediction(_turn_model(self._drone))

    def engage(self) -> None:
        """Stop where it is."""
        self._drone.hold()
        self._turning = TurnPrediction(_turn_model(self._drone))

    def apply(self, command: MotionCommand, measured: MeasuredState, sample_s: float) -> None:
        """Send a velocity and a turn rate."""
        self._turning.command(command.yaw_rate, sample_s)
        self._drone.set_velocity(*command, lasting=self._lasting)


def straighten(share: float, expo: float) -> float:
    """Return the way of a stick, 0 to 1, whose expo curve gives that share of the full command.

    Args:
        share: share of the full command, at least 0.
        expo: share of the cubic, from 0 to below 1; the rest of the curve is straight. Solved as the
            depressed cubic with one real root.
    """
    if expo == 0.0:
        return share
    p = (1.0 - expo) / expo
    middle = 1.5 * share / (expo * p) * sqrt(3.0 / p)
    third = log(middle + sqrt(middle * middle + 1.0)) / 3.0  # of the area hyperbolic sine
    return sqrt(p / 3.0) * (exp(third) - exp(-third))


@dataclass(frozen=True)
class RcAxis:
    """Trim, dead band and scale of one channel.

    Attributes:
        per_unit: µs per unit of the command beyond the dead band.
        per_unit_down: the same for commands below 0, where it is another.
        expo: share of the cubic in the curve that the autopilot applies beyond the dead band.
        trim: pulse width that is meant to command nothing, µs.
        dead: half of the dead band about the trim, which a command jumps over, µs.
        least: least pulse width, µs.
        greatest: greatest pulse width, µs.
    """

    per_unit: float
    trim: float = MIDDLE_US
    dead: float = 0.0
    least: float = MIDDLE_US - HALF_US
    greatest: float = MIDDLE_US + HALF_US
    per_unit_down: float | None = None
    expo: float = 0.0

    def __post_init__(self) -> None:
        if not self.least < self.trim < self.greatest or self.dead < 0.0 or not self.per_unit > 0.0:
            raise UsageError(
                f"RC channel: trim {self.trim:g} us within {self.least:g} to {self.greatest:g} us, dead band "
                f"{self.dead:g} us, {self.per_unit:g} us per unit: give a trim within, the others above 0"
            )

    def pulse(self, command: float) -> float:
        """Return the pulse width of a command, µs."""
        if command == 0.0:
            return self.trim
        scale = self.per_unit if command > 0.0 or self.per_unit_down is None else self.per_unit_down
        way = HALF_US - self.dead
        beyond = self.dead + way * straighten(scale * abs(command) / way, self.expo)
        return min(self.greatest, max(self.least, self.trim + copysign(beyond, command)))

    def position(self, command: float) -> float:
        """Return the stick position -1..1 of a command."""
        return (self.pulse(command) - MIDDLE_US) / HALF_US


class RcScale(NamedTuple):
    """The channels of an autopilot: commands in degrees of tilt, m/s of climb, degrees/s of turn."""

    tilt: RcAxis
    climb: RcAxis
    turn: RcAxis
    most_tilt: float
    """Tilt angle that the laws use at most, degrees."""
    turning: TurnModel | None = None
    """How the autopilot follows a turn rate by its yaw channel; ``None`` is not modelled."""


RC_SCALES: Mapping[str, RcScale] = {
    # ATC_ACCEL_Y_MAX 270; the loops as fitted to a log of ArduCopter on its own simulator's quadrotor
    # RCn_DZ 20 us, THR_DZ 100, ANGLE_MAX 30 degrees, PILOT_SPEED_UP 2.5 m/s, PILOT_Y_RATE 202.5 degrees/s
    "ArduPilot": RcScale(
        RcAxis(480.0 / 30.0, dead=20.0),
        RcAxis(400.0 / 2.5, dead=100.0),
        RcAxis(480.0 / 202.5, dead=20.0),
        27.0,
        TurnModel(acceleration=270.0, delay_s=0.09, frequency=5.0, damping=0.3),
    ),
    # MPC_HOLD_DZ 0.1, MPC_MAN_TILT_MAX 35 degrees, MPC_Z_VEL_MAX_UP 3 m/s, MPC_Z_VEL_MAX_DN 1.5 m/s,
    # MPC_Z_MAN_EXPO 0.6, MPC_YAW_EXPO 0.6, MPC_MAN_Y_MAX 150 degrees/s; its heading follows the stick after
    # 0.1 s with a lag of 2.1 rad/s in SIH, twice frequency times damping; 3.2 rad/s turns faster
    "PX4": RcScale(
        RcAxis(500.0 / 35.0),
        RcAxis(450.0 / 3.0, dead=50.0, per_unit_down=450.0 / 1.5, expo=0.6),
        RcAxis(450.0 / 150.0, dead=50.0, expo=0.6),
        27.0,
        TurnModel(acceleration=2600.0, delay_s=0.1, frequency=0.05, damping=32.0),
    ),
}
"""Scales by autopilot, from the defaults of its parameters."""

VELOCITY_GAINS = PidGains(kp=2.0, ki=0.4, low=-5.0, high=5.0)
"""From an error of velocity in m/s to an acceleration in m/s^2."""


class _TiltLoop:
    """The loop from velocities to tilt angles; without gains the drone stays level."""

    def __init__(self, gains: PidGains | None) -> None:
        self._gains = gains
        self._laws: tuple[PidLaw, PidLaw] | None = None
        self.reset()

    @property
    def tilts(self) -> bool:
        """Whether there are gains."""
        return self._gains is not None

    def reset(self, attitude: Attitude | None = None) -> None:
        """Begin anew at an attitude, as of a hover in wind (bumpless transfer); level without one."""
        self._laws = (PidLaw(self._gains), PidLaw(self._gains)) if self._gains is not None else None
        if self._laws is None or attitude is None or not all(map(isfinite, attitude)):
            return
        roll, pitch, heading = map(radians, attitude)
        ahead, right = -GRAVITY * sin(pitch) / cos(pitch), GRAVITY * sin(roll) / cos(roll)
        for law, acceleration in zip(self._laws, turn_clockwise((ahead, right), heading), strict=True):
            law.begin_at(acceleration)

    def tilt(
        self, command: MotionCommand, measured: MeasuredState, sample_s: float, most: float
    ) -> tuple[float, float]:
        """Return tilt forward and to the right in degrees, each at most *most*."""
        if self._laws is None or isnan(measured.velocity_north) or isnan(measured.heading):
            return 0.0, 0.0
        wanted = (command.north, command.east)
        have = (measured.velocity_north, measured.velocity_east)
        north, east = (
            float(law(aim, seen, sample_s).output)
            for law, aim, seen in zip(self._laws, wanted, have, strict=True)
        )
        ahead_right = turn_clockwise((north, east), -radians(measured.heading))
        angles = (degrees(atan(acceleration / GRAVITY)) for acceleration in ahead_right)
        forward, sideways = (min(most, max(-most, angle)) for angle in angles)
        return forward, sideways


LOW_THROTTLE = (800, 1300)
"""Pulse widths in µs with which a throttle stick commands a fast descent in altitude hold."""
THROTTLE = 3


class RcOverride(Actuation):
    """RC channels overridden in altitude hold.

    The velocity loop on this side turns velocities into tilt angles; the autopilot levels, holds the height
    and turns at the commanded rate.

    Args:
        drone: the drone.
        scale: channels of its autopilot; by default those of ``RC_SCALES``.
        gains: gains of the velocity loop; ``None`` leaves the tilt at zero, as the thesis's rotation does.
    """

    def __init__(
        self, drone: Drone, scale: RcScale | None = None, gains: PidGains | None = VELOCITY_GAINS
    ) -> None:
        self._drone = drone
        self._scale = scale
        self._loop = _TiltLoop(gains)
        self._turning = TurnPrediction(None)

    @property
    def lead(self) -> float:
        """Turn in degrees that is still to come."""
        return self._turning.lead

    @property
    def answer(self) -> LoopAnswer | None:
        """How the drone follows velocities by its sticks; ``None`` with channels of another scale."""
        drone, scale = self._drone, self.scale
        if scale is not RC_SCALES.get(drone.telemetry.autopilot):
            return None
        turns = _answer(VELOCITY_ANSWERS, drone, _turn_model(drone, scale)).turn  # by rate, as set-points
        answer = _answer(TILT_ANSWERS, drone, None)._replace(turn=turns)
        return answer if self._loop.tilts else answer._replace(velocity_within_s=inf)

    @property
    def scale(self) -> RcScale:
        """Scale of the channels. Raises ``UsageError`` for an autopilot without one."""
        if self._scale is None:
            name = self._drone.telemetry.autopilot
            if name not in RC_SCALES:
                raise UsageError(
                    f"the RC scale of {name or 'this autopilot'} is not known; fly by set-points"
                )
            self._scale = RC_SCALES[name]
        return self._scale

    def take_off(self, height: float) -> None:
        """Take off by the autopilot's own take-off, then take the sticks."""
        self._drone.takeoff(height)
        self.engage()

    def engage(self) -> None:
        """Enter altitude hold with centred sticks; a transmitter whose throttle stick is low is recorded."""
        self._loop.reset(self._drone.telemetry.attitude)
        self._turning = TurnPrediction(_turn_model(self._drone, self.scale))
        drone, channels = self._drone, self._drone.telemetry.rc
        own = channels[THROTTLE - 1] if len(channels) >= THROTTLE else 0
        if LOW_THROTTLE[0] <= own < LOW_THROTTLE[1]:
            text = f"{BY_STICKS}: the transmitter's throttle, at {own} us, makes it descend fast"
            text += "; move the stick to the middle"
            drone.kernel.record(Text(drone.kernel.now(), drone.name, WARNING, text))
        self._drone.manual_control(0.0, 0.0, 0.5, 0.0)
        self._drone.altitude_hold()

    def apply(self, command: MotionCommand, measured: MeasuredState, sample_s: float) -> None:
        """Send the stick positions of a command."""
        scale = self.scale
        forward, right = self._loop.tilt(command, measured, sample_s, scale.most_tilt)
        throttle = (scale.climb.position(command.up) + 1.0) / 2.0
        self._turning.command(command.yaw_rate, sample_s)
        pitch, roll = scale.tilt.position(forward), scale.tilt.position(right)
        self._drone.manual_control(pitch, roll, throttle, scale.turn.position(command.yaw_rate))


class ClimbByThrust(NamedTuple):
    """Thrust that an autopilot takes as a climb rate: 0.5 keeps the height."""

    up: float
    """Climb at a thrust of 1, m/s."""
    down: float
    """Descent at a thrust of 0, m/s."""
    dead: float = 0.0
    """Half of the range about 0.5 in which it keeps the height."""

    def thrust(self, climb: float) -> float:
        """Return the thrust of a climb rate in m/s."""
        share = min(1.0, abs(climb) / (self.up if climb > 0.0 else self.down))
        return 0.5 + copysign(self.dead + (0.5 - self.dead) * share, climb) if share > 0.0 else 0.5


CLIMBS_BY_THRUST: Mapping[str, ClimbByThrust] = {
    "ArduPilot": ClimbByThrust(2.5, 1.5),  # WPNAV_SPEED_UP, WPNAV_SPEED_DN
    "DJI": ClimbByThrust(2.0, 2.0, 0.05),  # as the driver maps thrust
}
"""Autopilots that take thrust as a climb rate, by the first word of their name."""
THRUST_GAINS = PidGains(kp=0.12, ki=0.08, low=-0.3, high=0.3)
"""From an error of climb rate in m/s to a share of thrust about hover."""
MOST_TILT = 27.0


class AttitudeSetpoints(Actuation):
    """Attitude set-points: tilt angles of the velocity loop, thrust and turn rate.

    Args:
        drone: the drone.
        lasting: time after which the drone stops if no command follows, s.
        gains: gains of the velocity loop.
    """

    def __init__(self, drone: Drone, lasting: float = 1.0, gains: PidGains = VELOCITY_GAINS) -> None:
        self._drone, self._lasting = drone, lasting
        self._loop = _TiltLoop(gains)
        self._thrust = PidLaw(THRUST_GAINS)

    @property
    def answer(self) -> LoopAnswer | None:
        """How the drone follows velocities by its attitude."""
        return _answer(TILT_ANSWERS, self._drone, None)

    def take_off(self, height: float) -> None:
        """Take off by the autopilot's own take-off."""
        self._drone.takeoff(height)
        self._loop.reset(self._drone.telemetry.attitude)

    def engage(self) -> None:
        """Stop where it is."""
        self._drone.hold()
        self._loop.reset(self._drone.telemetry.attitude)
        self._thrust.reset()

    def apply(self, command: MotionCommand, measured: MeasuredState, sample_s: float) -> None:
        """Send an attitude, a thrust and a turn rate."""
        forward, right = self._loop.tilt(command, measured, sample_s, MOST_TILT)
        by_rate = CLIMBS_BY_THRUST.get(self._drone.telemetry.autopilot.partition(" ")[0])
        if by_rate is not None:
            thrust = by_rate.thrust(command.up)
        else:
            thrust = 0.5 + float(self._thrust(command.up, measured.velocity_up, sample_s).output)
        self._drone.set_attitude(
            right, -forward, thrust=thrust, yaw_rate=command.yaw_rate, lasting=self._lasting
        )


def thesis_scale(trim: float = 1480.0) -> RcScale:
    """Return the channels of the thesis's rotation: µs straight from the law, about a trim 20 µs too low.

    Args:
        trim: pulse width of the yaw channel at an output of 0, µs.
    """
    return RC_SCALES["ArduPilot"]._replace(turn=RcAxis(1.0, trim=trim), turning=None)
