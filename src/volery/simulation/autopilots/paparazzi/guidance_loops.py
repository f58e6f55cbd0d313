"""Response of the rotorcraft's guidance loops to set-points: the original's laws on a point with a lean.

A reference with limited speed and acceleration moves towards the set-point. Proportional, differential and
integral terms follow it: in the plane through the lean of the airframe, vertically through its thrust. The
loops are soft: on a leg of 50 m the aircraft falls behind, reaches 7.4 m/s to catch up with a reference of
5 m/s, passes the goal at 4 m/s and swings about it. The nominal throttle is 4 per cent above the one that
hovers, so that a height is first overshot by 0.4 m, until the slow integral has it. The thrust is divided by
the vertical share of the estimated lean, and acts by that of the true one. Structure and defaults
are those of version 6.2, gains those of the stock airframe ``ardrone2``, mass, thrust and drag those of its
flight dynamics in NPS; only the lag of the attitude behind its reference is fitted to a recorded flight. The
attitude estimate takes an acceleration for gravity in part, so that the aircraft leans further than commanded
while it accelerates: without that it would swing back by a quarter less.

The response is a position and a velocity that the flight stack follows.
"""

from __future__ import annotations

from math import hypot, isfinite, radians
from typing import NamedTuple

from volery.base.elementary import cos, sin
from volery.base.frames import Vector

SUBSTEP = 1.0 / 64.0
"""Step of the integration [s]. The original runs its loops at 512 Hz."""

GRAVITY = 9.81
"""Acceleration of free fall in the original's laws [m/s^2]."""
RADIANS_PER_UNIT, HOVER_UNITS = 1.0 / 4096.0, GRAVITY * 2**18 / int(2**18 * GRAVITY / (0.655 * 9600.0))
"""Unit of the horizontal command [rad], and the nominal throttle in units of the thrust command:
GUIDANCE_V_NOMINAL_HOVER_THROTTLE 0.655, by way of an acceleration for each unit that is cut to 18 bits."""

REFERENCE_OMEGA, REFERENCE_ZETA, REFERENCE_ACCEL = radians(67.0), 0.85, 5.66
"""Horizontal reference: natural frequency [rad/s], damping, acceleration limit [m/s^2]."""
REFERENCE_TAU = 0.5
"""Approach of the horizontal reference to a commanded velocity [s]."""
POSITION_GAIN, VELOCITY_GAIN = 79 * 4 * RADIANS_PER_UNIT, 100 * 4 * RADIANS_PER_UNIT
"""Lean for a distance [rad/m] and for a speed [rad s/m]: GUIDANCE_H_PGAIN 79, GUIDANCE_H_DGAIN 100."""
INTEGRAL_GAIN = 30 * 512 / 65536
"""Integral of the sum of both [1/s]: GUIDANCE_H_IGAIN 30, at 512 Hz."""
MOST_LEAN, MOST_LEAN_IN_ALL = radians(20.0), radians(45.0)
"""Limit, on each axis, of the lean and of its integral (GUIDANCE_H_MAX_BANK), and of their sum [rad]."""
FARTHEST_BEHIND = 16.0
"""Largest error of position and of velocity that counts, on each axis [m, m/s]."""
FIX_INTERVAL = 0.1
"""Time between two fixes; horizontal position and velocity are those of the last one [s]."""
LEAN_OMEGA, LEAN_ZETA = radians(450.0), 0.9
"""Reference of the attitude: natural frequency [rad/s] and damping (STABILIZATION_ATTITUDE_REF_*)."""
LEAN_LAG = 0.05
"""Lag of the estimated lean behind its reference, fitted to the recorded legs [s]."""
ESTIMATE_GAIN, ESTIMATE_BIAS_GAIN = 2.0 * 0.9 * 0.063, 0.063 * 0.063
"""Pull of the attitude estimate towards the measured acceleration [1/s], and of its rate bias [1/s^2]:
AHRS_ACCEL_OMEGA 0.063 rad/s, AHRS_ACCEL_ZETA 0.9."""
HEURISTIC, LEAST_WEIGHT = 3.0, 0.15
"""How fast the weight of that pull falls with an acceleration that is not 1 g, and its least value."""

HEIGHT_OMEGA, HEIGHT_ZETA, HEIGHT_TAU = radians(100.0), 0.85, 0.25
"""Vertical reference, as for the plane."""
MOST_PUSH_UP, MOST_PUSH_DOWN = 2.0 * GRAVITY, 0.8 * GRAVITY
"""Limits of the vertical reference's acceleration [m/s^2]."""
HEIGHT_GAIN, CLIMB_GAIN, HEIGHT_INTEGRAL = 283 * 2.0, 82 * 8.0, 13 * 2.0
"""Thrust for a height [1/m], a climb rate [s/m] and the integral of a height [1/(m s)], in units of the
thrust command: GUIDANCE_V_HOVER_KP 283, KD 82, KI 13."""
MOST_INTEGRAL, MOST_NOMINAL, MOST_THRUST = 2e6 * 13 / 65536, 0.9 * 9600.0, 9600.0
"""Limits of the integral, of the nominal thrust and of the thrust, in units of the thrust command."""
MOST_BEHIND, LEAST_VERTICAL_SHARE = 10.0, cos(radians(30.0))
"""Largest vertical error [m, m/s], and the smallest share of the thrust that is taken for vertical."""
PUSH_PER_UNIT = 4 * 0.35 * 4.448222 / 0.4 / 9600.0
"""Acceleration by one unit of the thrust command: four motors of 0.35 lbf at 0.4 kg [m/s^2]."""
DRAG = 0.5 * 1.12 * 0.0151 / 0.4
"""Drag by the square of the speed [1/m]: 0.0151 m^2, air at 900 m."""

RESYNCHRONIZE = 8.0
"""Distance from the response at which the aircraft is elsewhere: the response then goes on from there [m]."""

NO_NUMBER = -8_388_608.0
"""What the firmware's integers make of a value that is not a number [m or m/s]."""


def as_obeyed(value: float) -> float:
    """Return a commanded value as the firmware obeys it: it converts what is not finite, and flies there."""
    return value if isfinite(value) else NO_NUMBER


def _bounded(value: float, most: float) -> float:
    return min(most, max(-most, value))


def _limited(north: float, east: float, most: float) -> tuple[float, float]:
    size = hypot(north, east)
    return (north, east) if size <= most else (north * most / size, east * most / size)


class AxisLean:
    """Lean along one axis of the plane: command, its integral, and the attitude that follows it."""

    def __init__(self) -> None:
        self.angle = 0.0
        self._integral = self._reference = self._rate = 0.0
        self.estimate = self._estimate_off = self._bias = 0.0

    def step(self, behind: float, slower: float, drag: float, *, in_flight: bool) -> None:
        """Move by one substep.

        Args:
            behind: Distance to the reference [m].
            slower: Speed below that of the reference [m/s].
            drag: Deceleration by the air [m/s^2].
            in_flight: Whether the aircraft flies; on the ground there is no integral.
        """
        error = POSITION_GAIN * _bounded(behind, FARTHEST_BEHIND)
        error += VELOCITY_GAIN * _bounded(slower, FARTHEST_BEHIND)
        grown = self._integral + INTEGRAL_GAIN * error * SUBSTEP
        self._integral = _bounded(grown, MOST_LEAN) if in_flight else 0.0
        command = _bounded(_bounded(error, MOST_LEAN) + self._integral, MOST_LEAN_IN_ALL)
        push = (
            LEAN_OMEGA * LEAN_OMEGA * (command - self._reference) - 2.0 * LEAN_ZETA * LEAN_OMEGA * self._rate
        )
        self._rate += push * SUBSTEP
        self._reference += self._rate * SUBSTEP
        self.estimate += (self._reference - self.estimate) * SUBSTEP / LEAN_LAG
        if in_flight:
            self._mistake(self.estimate - drag / GRAVITY)
        self.angle = self.estimate + self._estimate_off

    def _mistake(self, unfelt: float) -> None:
        """Move the error of the estimate; *unfelt* is the lean that the accelerometer does not show [rad]."""
        weight = max(LEAST_WEIGHT, 1.0 - HEURISTIC * abs(1.0 - 1.0 / cos(self.angle)))
        self._estimate_off += (ESTIMATE_GAIN * weight * unfelt + self._bias) * SUBSTEP
        self._bias += ESTIMATE_BIAS_GAIN * weight * weight * unfelt * SUBSTEP


class PlaneLoop:
    """Horizontal response, north and east [m, m/s]."""

    def __init__(self, place: tuple[float, float], velocity: tuple[float, float]) -> None:
        self.place, self.velocity = place, velocity
        self._reference, self._reference_velocity = place, velocity
        self._by_velocity: bool | None = None
        self._fix, self._fix_age = (place, velocity), 0.0
        self.leans = AxisLean(), AxisLean()
        self.accel = (0.0, 0.0)
        self.frozen: tuple[tuple[float, float], tuple[float, float]] | None = None
        """Place and velocity that the loops are given instead of the true ones, without a fix."""

    def step(
        self,
        goal: tuple[float, float],
        most: float,
        thrust: float,
        drag: float,
        *,
        by_velocity: bool,
        in_flight: bool,
    ) -> None:
        """Move by one substep.

        Args:
            goal: Place [m], or velocity [m/s].
            most: Limit of the reference's speed towards a place [m/s].
            thrust: Acceleration by the thrust along the airframe's axis [m/s^2].
            drag: Deceleration by the air for each unit of velocity [1/s].
            by_velocity: Whether ``goal`` is a velocity.
            in_flight: Whether the aircraft flies; on the ground the reference stays with it.
        """
        (north, east), (vn, ve) = self._measured()
        if by_velocity is not self._by_velocity or not in_flight:
            self._by_velocity = by_velocity
            self._reference, self._reference_velocity = (north, east), (vn, ve)
        self._move_reference(goal, most)
        (rn, re), (rvn, rve) = self._reference, self._reference_velocity
        self.leans[0].step(rn - north, rvn - vn, drag * self.velocity[0], in_flight=in_flight)
        self.leans[1].step(re - east, rve - ve, drag * self.velocity[1], in_flight=in_flight)
        self._move(thrust, drag)

    def _measured(self) -> tuple[tuple[float, float], tuple[float, float]]:
        self._fix_age += SUBSTEP
        if self._fix_age >= FIX_INTERVAL:
            self._fix, self._fix_age = (self.place, self.velocity), self._fix_age - FIX_INTERVAL
        return self.frozen or self._fix

    def _move_reference(self, goal: tuple[float, float], most: float) -> None:
        (north, east), (vn, ve) = self._reference, self._reference_velocity
        if self._by_velocity:
            push = (goal[0] - vn) / REFERENCE_TAU, (goal[1] - ve) / REFERENCE_TAU
        else:
            gain = 0.5 * REFERENCE_OMEGA / REFERENCE_ZETA
            wn, we = _limited(gain * (goal[0] - north), gain * (goal[1] - east), most)
            gain = 2.0 * REFERENCE_ZETA * REFERENCE_OMEGA
            push = gain * (wn - vn), gain * (we - ve)
        an, ae = _limited(*push, REFERENCE_ACCEL)
        self._reference_velocity = vn, ve = vn + an * SUBSTEP, ve + ae * SUBSTEP
        self._reference = north + vn * SUBSTEP, east + ve * SUBSTEP

    def _move(self, thrust: float, drag: float) -> None:
        vn, ve = self.velocity
        along_north, along_east = self.leans[0].angle, self.leans[1].angle
        an = thrust * sin(along_north) * cos(along_east) - drag * vn
        ae = thrust * sin(along_east) - drag * ve
        self.accel = an, ae
        self.velocity = vn, ve = vn + an * SUBSTEP, ve + ae * SUBSTEP
        self.place = self.place[0] + vn * SUBSTEP, self.place[1] + ve * SUBSTEP

    @property
    def vertical_share(self) -> float:
        """Share of the thrust that acts upwards."""
        return cos(self.leans[0].angle) * cos(self.leans[1].angle)

    @property
    def estimated_share(self) -> float:
        """Share of the thrust that acts upwards by the estimated attitude."""
        return cos(self.leans[0].estimate) * cos(self.leans[1].estimate)


class SpeedLimits(NamedTuple):
    """Greatest speeds of the references in the plane, up and down [m/s]."""

    level: float
    up: float
    down: float


class HeightLoop:
    """Vertical response, metres up."""

    def __init__(self, height: float, climb: float) -> None:
        self._reference, self._reference_climb = height, climb
        self._integral = 0.0
        self.height, self.climb, self._accel = height, climb, 0.0
        self._limits = (0.0, 0.0)

    def step(
        self,
        goal: float,
        up: float,
        down: float,
        share: float,
        estimated_share: float,
        drag: float,
        *,
        by_climb: bool,
        in_flight: bool,
    ) -> float:
        """Move by one substep and return the acceleration by the thrust [m/s^2].

        Args:
            goal: Height [m], or climb rate [m/s].
            up: Limit of the reference's climb rate [m/s]; likewise ``down``.
            down: Limit of its sink rate [m/s].
            share: Share of the thrust that acts upwards.
            estimated_share: The same by the estimated attitude.
            drag: Deceleration by the air for each unit of velocity [1/s].
            by_climb: Whether ``goal`` is a climb rate.
            in_flight: Whether the aircraft flies; on the ground there is no integral.
        """
        push = self._move_reference(goal, up, down, by_climb=by_climb)
        behind = _bounded(self._reference - self.height, MOST_BEHIND)
        slower = _bounded(self._reference_climb - self.climb, MOST_BEHIND)
        grown = _bounded(self._integral + HEIGHT_INTEGRAL * behind * SUBSTEP, MOST_INTEGRAL)
        self._integral = grown if in_flight else 0.0
        nominal = HOVER_UNITS * (1.0 + push / GRAVITY) / max(estimated_share, LEAST_VERTICAL_SHARE)
        command = min(MOST_NOMINAL, max(0.0, nominal))
        command += HEIGHT_GAIN * behind + CLIMB_GAIN * slower + self._integral
        thrust = PUSH_PER_UNIT * min(MOST_THRUST, max(0.0, command))
        self._accel = thrust * share - GRAVITY - drag * self.climb
        self.climb += self._accel * SUBSTEP
        self._limits = (up, down)
        self.height += self.climb * SUBSTEP
        return thrust

    def rest(
        self, before: HeightLoop, goal: float, limits: SpeedLimits, steps: int, *, by_climb: bool
    ) -> None:
        """Take over the reference of *before*, and move it alone: it does not stop with the motors.

        Args:
            before: Response until now.
            goal: Height [m], or climb rate [m/s].
            limits: Greatest speeds of the reference.
            steps: Number of substeps.
            by_climb: Whether ``goal`` is a climb rate.
        """
        self._reference, self._reference_climb = before._reference, before._reference_climb
        for _ in range(steps):
            self._move_reference(goal, limits.up, limits.down, by_climb=by_climb)

    def climb_ahead(self, lead: float) -> float:
        """Return the climb rate in *lead* seconds [m/s], at most that of the reference or the present one."""
        up, down = self._limits
        ahead = self.climb + lead * self._accel
        return min(max(up, self.climb), max(min(-down, self.climb), ahead))

    def _move_reference(self, goal: float, up: float, down: float, *, by_climb: bool) -> float:
        climb = self._reference_climb
        if by_climb:
            push = (goal - climb) / HEIGHT_TAU
        else:
            push = (
                HEIGHT_OMEGA * HEIGHT_OMEGA * (goal - self._reference)
                - 2.0 * HEIGHT_ZETA * HEIGHT_OMEGA * climb
            )
        push = min(MOST_PUSH_UP, max(-MOST_PUSH_DOWN, push))
        moved = min(up, max(-down, climb + push * SUBSTEP))
        self._reference_climb = moved
        self._reference += moved * SUBSTEP
        if by_climb:
            self._reference = self.height + _bounded(self._reference - self.height, MOST_BEHIND)
        return push if -down < moved < up else 0.0


class GuidanceLoops:
    """Both responses of one aircraft, moved to where it is whenever it is not where they are."""

    def __init__(self, position: Vector, velocity: Vector) -> None:
        self.plane = PlaneLoop((position[0], position[1]), (velocity[0], velocity[1]))
        self.height = HeightLoop(-position[2], -velocity[2])

    def step(
        self,
        plane: tuple[float, float],
        up: float,
        limits: SpeedLimits,
        *,
        plane_is_velocity: bool,
        up_is_velocity: bool,
        in_flight: bool,
    ) -> None:
        """Move both by one substep.

        Args:
            plane: Place north and east [m], or velocity [m/s].
            up: Height [m], or climb rate [m/s].
            limits: Greatest speeds of the references.
            plane_is_velocity: Whether ``plane`` is a velocity; likewise ``up_is_velocity``.
            up_is_velocity: Whether ``up`` is a climb rate.
            in_flight: Whether the aircraft flies.
        """
        drag = DRAG * hypot(*self.plane.velocity, self.height.climb)
        thrust = self.height.step(
            up,
            limits.up,
            limits.down,
            self.plane.vertical_share,
            self.plane.estimated_share,
            drag,
            by_climb=up_is_velocity,
            in_flight=in_flight,
        )
        self.plane.step(plane, limits.level, thrust, drag, by_velocity=plane_is_velocity, in_flight=in_flight)

    def away_from(self, position: Vector) -> bool:
        """Return whether the aircraft is too far from the response."""
        north, east = self.plane.place
        off = hypot(position[0] - north, position[1] - east, position[2] + self.height.height)
        return off > RESYNCHRONIZE

    def move_to(self, position: Vector, velocity: Vector) -> None:
        """Continue from where the aircraft is: wind has carried it off; references and integrals remain."""
        self.plane.place, self.plane.velocity = (position[0], position[1]), (velocity[0], velocity[1])
        self.height.height, self.height.climb = -position[2], -velocity[2]

    def correction(self, position: Vector, gain: float, lead: float) -> Vector:
        """Return the velocity, north, east, down [m/s], that keeps the aircraft on the response.

        Args:
            position: Where the aircraft is, north, east, down [m].
            gain: Gain on the distance between the two [1/s].
            lead: Time by which the velocity is ahead of the response [s].
        """
        (north, east), (an, ae) = self.plane.place, self.plane.accel
        return (
            self.plane.velocity[0] + lead * an + gain * (north - position[0]),
            self.plane.velocity[1] + lead * ae + gain * (east - position[1]),
            -self.height.climb_ahead(lead) + gain * (-self.height.height - position[2]),
        )
