"""When a vehicle is where on a path: speeds under limits, corners rounded.

A corner becomes an arc that deviates from it by a stated length at most and is flown with constant speed; on
the straight parts between them the speed changes with the largest acceleration. So both limits hold at every
moment. Corner speeds are limited backwards and forwards, such that each can be reached and left
(Kunz and Stilman, RSS 2012, with arcs; the time-optimal profile on each straight is a trapezoid).
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from math import ceil, sqrt
from typing import NamedTuple

import numpy as np

from volery.autonomy.planar_pose import Array
from volery.base.elementary import atan2, sine_cosine
from volery.base.errors import UsageError
from volery.base.time import Ns, S


@dataclass(frozen=True)
class TrajectoryLimits:
    """How fast a path is flown.

    Args:
        speed: Largest speed [m/s].
        acceleration: Largest acceleration in any direction [m/s^2].
        deviation: How far the way may be from a corner [m]; 0 stops at each.

    Raises:
        UsageError: Speed or acceleration is not above 0, or the deviation is below 0.
    """

    speed: float
    acceleration: float
    deviation: float = 0.3

    def __post_init__(self) -> None:
        if not (self.speed > 0.0 and self.acceleration > 0.0 and self.deviation >= 0.0):
            raise UsageError(f"{self}: give speed and acceleration above 0 and a deviation of at least 0 m")


class TimedPoint(NamedTuple):
    """Where a vehicle is at a time.

    Args:
        time: Time since the start [ns].
        position: Position (2 or 3,) [m].
        velocity: Velocity (2 or 3,) [m/s].
    """

    time: Ns
    position: Array
    velocity: Array


class Arc(NamedTuple):
    """What rounds a corner.

    Args:
        tangent: Length of each side that it replaces [m].
        radius: Its radius [m]; 0 at a corner where the vehicle stops.
        angle: By which the path turns [rad].
    """

    tangent: float
    radius: float
    angle: float


class _Piece(NamedTuple):
    """A part of a trajectory: ``axis`` is where it heads, ``inward`` where it bends to with ``radius``."""

    begin: float
    lasts: float
    start: Array
    axis: Array
    inward: Array
    radius: float
    speed: float
    change: float


class Trajectory:
    """A path with times.

    Args:
        points: Corners of the path (n, 2 or 3) [m], the start first. Repeated points are left out.
        limits: How fast it is flown. It begins and ends at rest.

    Raises:
        UsageError: There is no point, or one is not a finite number.

    Example::

        way = Trajectory(np.array(((0.0, 0.0), (20.0, 0.0), (20.0, 10.0))), Limits(5.0, 2.0))
        position, velocity = way.at(way.duration / 2)
    """

    def __init__(self, points: Array, limits: TrajectoryLimits) -> None:
        points = np.asarray(points, dtype=np.float64)
        if points.ndim != 2 or not len(points) or not np.isfinite(points).all():
            raise UsageError("a trajectory needs a path of at least one point, (n, 2 or 3) finite metres")
        moves = np.ones(len(points), dtype=bool)
        moves[1:] = (np.abs(np.diff(points, axis=0)) > 1e-9).any(axis=1)
        self._points = points[moves]
        self._pieces: list[_Piece] = []
        self._begins: list[float] = []
        self.duration = 0.0
        """Time from start to end [s]."""
        if len(self._points) > 1:
            self._plan(limits)

    def _plan(self, limits: TrajectoryLimits) -> None:
        sides = np.diff(self._points, axis=0)
        lengths = np.sqrt((sides * sides).sum(axis=1))
        axes = sides / lengths[:, None]
        arcs = arcs_of(self._points, limits.deviation)
        straights = [
            max(0.0, float(length) - before.tangent - after.tangent)
            for length, before, after in zip(lengths, arcs, arcs[1:], strict=False)
        ]
        speeds = [0.0, *(corner_speed(arc, limits) for arc in arcs[1:-1]), 0.0]
        double = 2.0 * limits.acceleration
        for side, length in enumerate(straights):
            speeds[side + 1] = min(speeds[side + 1], sqrt(speeds[side] * speeds[side] + double * length))
        for side in range(len(straights) - 1, -1, -1):
            speeds[side] = min(
                speeds[side], sqrt(speeds[side + 1] * speeds[side + 1] + double * straights[side])
            )
        none = np.zeros(self._points.shape[1])
        for side, length in enumerate(straights):
            enter, leave, axis = speeds[side], speeds[side + 1], axes[side]
            top = min(limits.speed, sqrt(0.5 * (enter * enter + leave * leave + double * length)))
            top = max(top, enter, leave)
            rises, falls = (top * top - enter * enter) / double, (top * top - leave * leave) / double
            place = self._points[side] + arcs[side].tangent * axis
            for way, first, change in (
                (rises, enter, limits.acceleration),
                (max(0.0, length - rises - falls), top, 0.0),
                (falls, top, -limits.acceleration),
            ):
                if change == 0.0:
                    lasts = way / first if way > 0.0 else 0.0
                else:
                    lasts = (top - (enter if change > 0.0 else leave)) / limits.acceleration
                self._add(lasts, place, axis, none, 0.0, first, change)
                place = place + way * axis
            arc = arcs[side + 1]
            if arc.radius > 0.0:
                inward = axes[side + 1] - axis * float((axes[side + 1] * axis).sum())
                inward = inward / sqrt(float((inward * inward).sum()))
                self._add(arc.radius * arc.angle / leave, place, axis, inward, arc.radius, leave, 0.0)

    def _add(  # noqa: PLR0917  # the fields of a piece
        self,
        lasts: float,
        start: Array,
        axis: Array,
        inward: Array,
        radius: float,
        speed: float,
        change: float,
    ) -> None:
        if lasts > 0.0:
            self._begins.append(self.duration)
            self._pieces.append(_Piece(self.duration, lasts, start, axis, inward, radius, speed, change))
            self.duration += lasts

    def at(self, time: float) -> tuple[Array, Array]:
        """Return position [m] and velocity [m/s] at a time since the start [s]; outside, at rest."""
        if not self._pieces or time <= 0.0:
            return self._points[0], np.zeros(self._points.shape[1])
        if time >= self.duration:
            return self._points[-1], np.zeros(self._points.shape[1])
        piece = self._pieces[bisect_right(self._begins, time) - 1]
        since = time - piece.begin
        way = (piece.speed + 0.5 * piece.change * since) * since
        if piece.radius == 0.0:
            return piece.start + way * piece.axis, (piece.speed + piece.change * since) * piece.axis
        sine, cosine = sine_cosine(way / piece.radius)
        turned = piece.radius * (sine * piece.axis + (1.0 - cosine) * piece.inward)
        return piece.start + turned, piece.speed * (cosine * piece.axis + sine * piece.inward)

    def samples(self, step: Ns = S // 10) -> list[TimedPoint]:
        """Return where the vehicle is in steps [ns], the end included."""
        count = ceil(self.duration * S / step) + 1
        return [TimedPoint(index * step, *self.at(index * step / S)) for index in range(count)]


def arcs_of(points: Array, deviation: float) -> list[Arc]:
    """Return the arc at each point of a path (n, 2 or 3) without repeated points; none at its ends."""
    sides = np.diff(points, axis=0)
    lengths = np.sqrt((sides * sides).sum(axis=1))
    axes = sides / lengths[:, None]
    arcs = [Arc(0.0, 0.0, 0.0)]
    for before, after, first, second in zip(axes, axes[1:], lengths, lengths[1:], strict=False):
        along = float((before * after).sum())
        aside = after - along * before
        across = sqrt(float((aside * aside).sum()))
        angle = atan2(across, along)
        sine, cosine = sine_cosine(0.5 * angle)
        most = 0.5 * float(min(first, second))
        if sine < 1e-9:  # straight on: an arc of its largest radius is a straight line
            arcs.append(Arc(0.0, 0.0, 0.0))
            continue
        radius = 0.0
        if cosine > 1e-9:
            radius = min(deviation * cosine * (1.0 + cosine) / (sine * sine), most * cosine / sine)
        arcs.append(Arc(radius * sine / cosine if radius else 0.0, radius, angle))
    arcs.append(Arc(0.0, 0.0, 0.0))
    return arcs


def corner_speed(arc: Arc, limits: TrajectoryLimits) -> float:
    """Return the largest speed [m/s] on an arc: the acceleration across it is the limit."""
    if arc.radius == 0.0:
        return limits.speed if arc.angle == 0.0 else 0.0
    return min(limits.speed, sqrt(limits.acceleration * arc.radius))
