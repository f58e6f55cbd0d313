"""Response of the rotorcraft's guidance loops to set-points, as recorded.

The original moves a reference with limited speed and acceleration towards the set-point and follows it by
proportional, differential and integral loops through the lean of the airframe. The loops are soft: on a leg
of 50 m the aircraft first falls behind, reaches 7.5 m/s to catch up with a reference of 5 m/s, passes the
goal at 4 m/s and swings about it. Gains and lags are fitted to the recorded flight of the stock ``ardrone2``
(a leg of 50 m, and a velocity of 3 m/s with the stop after it; the error is 0.13 m and m/s). Heights end
above the set-point by an offset that vertical motion builds up and that fades slowly, as recorded; its cause
is not known.

The response is a position and a velocity that the flight stack follows.
"""

from __future__ import annotations

from math import hypot, isfinite

from volery.base.frames import Vector

SUBSTEP = 1.0 / 64.0
"""Step of the integration [s]."""

REFERENCE_OMEGA, REFERENCE_ZETA, REFERENCE_ACCEL = 1.757, 0.951, 5.64
"""Horizontal reference: natural frequency [rad/s], damping, acceleration limit [m/s^2]."""
SPEED_GAIN = 5.82
"""Approach of the reference to a commanded velocity [1/s]."""
POSITION_GAIN, VELOCITY_GAIN, INTEGRAL_GAIN = 1.091, 1.005, 0.287
"""Gains on position [1/s^2], velocity [1/s] and the integral of position [1/s^3]."""
DRAG, LEAN_LAG = 0.107, 0.231
"""Drag [1/s], and lag from the commanded to the flown acceleration [s]."""
MOST_ACCEL = 4.2
"""Limit of the acceleration [m/s^2]; the largest recorded lean is 25 degrees."""
FARTHEST_BEHIND = 16.0
"""Largest position error that counts [m]."""

HEIGHT_OMEGA, HEIGHT_ZETA, HEIGHT_ACCEL = 1.5, 0.95, 5.25
"""Vertical reference, as for the plane."""
HEIGHT_LAG = 0.15
"""Lag of the climb behind its reference [s]."""
OFFSET_GROWS, OFFSET_MOST, OFFSET_FADES = 0.2, 0.62, 14.0
"""Offset of a height: growth for each metre of vertical motion [1/m times m], limit [m], fading time [s]."""

RESYNCHRONIZE = 8.0
"""Distance from the response at which the aircraft is elsewhere: the response then starts anew [m]."""

NO_NUMBER = -8_388_608.0
"""What the firmware's integers make of a value that is not a number [m or m/s]."""


def as_obeyed(value: float) -> float:
    """Return a commanded value as the firmware obeys it: it converts what is not finite, and flies there."""
    return value if isfinite(value) else NO_NUMBER


class PlaneLoop:
    """Horizontal response, north and east [m, m/s]."""

    def __init__(self, place: tuple[float, float], velocity: tuple[float, float]) -> None:
        self.place, self.velocity = place, velocity
        self._reference, self._reference_velocity = place, velocity
        self._integral = self._lean = (0.0, 0.0)
        self.accel = (0.0, 0.0)
        self.frozen: tuple[tuple[float, float], tuple[float, float]] | None = None
        """Place and velocity that the loops are given instead of the true ones, without a fix."""

    def step_to(self, goal: tuple[float, float], speed: float) -> None:
        """Move by one substep towards a point at a limited reference speed."""
        wanted = [
            -2.0 * REFERENCE_ZETA * REFERENCE_OMEGA * v + REFERENCE_OMEGA**2 * (to - at)
            for at, v, to in zip(self._reference, self._reference_velocity, goal, strict=True)
        ]
        self._step(wanted[0], wanted[1], speed)

    def step_at(self, velocity: tuple[float, float], speed: float) -> None:
        """Move by one substep at a commanded velocity."""
        wanted = [SPEED_GAIN * (to - v) for v, to in zip(self._reference_velocity, velocity, strict=True)]
        self._step(wanted[0], wanted[1], speed)

    def _step(self, north: float, east: float, speed: float) -> None:
        dt = SUBSTEP
        push = _limited((north, east), REFERENCE_ACCEL)
        vn, ve = self._reference_velocity
        self._reference_velocity = vn, ve = _limited((vn + push[0] * dt, ve + push[1] * dt), speed)
        self._reference = self._reference[0] + vn * dt, self._reference[1] + ve * dt
        place, velocity = self.frozen or (self.place, self.velocity)
        behind = _limited((self._reference[0] - place[0], self._reference[1] - place[1]), FARTHEST_BEHIND)
        slower = vn - velocity[0], ve - velocity[1]
        grown = [i + INTEGRAL_GAIN * e * dt for i, e in zip(self._integral, behind, strict=True)]
        self._integral = _limited((grown[0], grown[1]), MOST_ACCEL)
        lean = _limited(
            (
                POSITION_GAIN * behind[0] + VELOCITY_GAIN * slower[0] + self._integral[0],
                POSITION_GAIN * behind[1] + VELOCITY_GAIN * slower[1] + self._integral[1],
            ),
            MOST_ACCEL,
        )
        share = dt / LEAN_LAG
        an = self._lean[0] + share * (lean[0] - self._lean[0])
        ae = self._lean[1] + share * (lean[1] - self._lean[1])
        self._lean = an, ae
        self.accel = an - DRAG * self.velocity[0], ae - DRAG * self.velocity[1]
        vn, ve = self.velocity[0] + self.accel[0] * dt, self.velocity[1] + self.accel[1] * dt
        self.velocity = vn, ve
        self.place = self.place[0] + vn * dt, self.place[1] + ve * dt


class HeightLoop:
    """Vertical response, metres up."""

    def __init__(self, height: float, climb: float, offset: float = 0.0) -> None:
        self._reference, self._reference_climb = height - offset, climb
        self._offset = offset
        self.height, self.climb = height, climb

    def step_to(self, goal: float, up: float, down: float) -> None:
        """Move by one substep towards a height, at most at these rates [m/s]."""
        push = -2.0 * HEIGHT_ZETA * HEIGHT_OMEGA * self._reference_climb
        push += HEIGHT_OMEGA**2 * (goal - self._reference)
        self._step(push, up, down)

    def step_at(self, climb: float, up: float, down: float) -> None:
        """Move by one substep at a commanded climb rate."""
        self._step(SPEED_GAIN * (climb - self._reference_climb), up, down)

    def _step(self, push: float, up: float, down: float) -> None:
        dt = SUBSTEP
        push = min(HEIGHT_ACCEL, max(-HEIGHT_ACCEL, push))
        climb = min(up, max(-down, self._reference_climb + push * dt))
        self._reference_climb = climb
        self._reference += climb * dt
        room = 1.0 - self._offset / OFFSET_MOST
        grows = OFFSET_GROWS * abs(climb) * room - self._offset / OFFSET_FADES
        self._offset += grows * dt
        share = dt / HEIGHT_LAG
        before = self.height
        self.height += share * (self._reference + self._offset + HEIGHT_LAG * climb - self.height)
        self.climb = (self.height - before) / dt


def _limited(vector: tuple[float, float], most: float) -> tuple[float, float]:
    size = hypot(*vector)
    if size <= most:
        return vector
    return vector[0] * most / size, vector[1] * most / size


class GuidanceLoops:
    """Both responses of one aircraft, restarted where it is whenever it is not where they are."""

    def __init__(self, position: Vector, velocity: Vector, offset: float = 0.0) -> None:
        self.plane = PlaneLoop((position[0], position[1]), (velocity[0], velocity[1]))
        self.height = HeightLoop(-position[2], -velocity[2], offset)

    def away_from(self, position: Vector) -> bool:
        """Return whether the aircraft is too far from the response."""
        north, east = self.plane.place
        off = hypot(position[0] - north, position[1] - east, position[2] + self.height.height)
        return off > RESYNCHRONIZE

    def correction(self, position: Vector, gain: float, lead: float) -> Vector:
        """Return the velocity, north, east, down [m/s], that keeps the aircraft on the response.

        Args:
            position: Where the aircraft is, north, east, down [m].
            gain: Gain on the distance between the two [1/s].
            lead: Time by which the horizontal velocity is ahead of the response [s].
        """
        (north, east), (an, ae) = self.plane.place, self.plane.accel
        return (
            self.plane.velocity[0] + lead * an + gain * (north - position[0]),
            self.plane.velocity[1] + lead * ae + gain * (east - position[1]),
            -self.height.climb + gain * (-self.height.height - position[2]),
        )
