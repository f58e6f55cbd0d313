"""A velocity that gets on and from which the vehicle can always stop before what its sensor sees.

A candidate is a velocity towards which the vehicle accelerates. It is safe if the vehicle can brake to rest,
on a straight line, from every moment of the next two periods (so one scan may be lost), without coming nearer
to a seen point than its radius and margin (dynamic window: Fox, Burgard and Thrun 1997; of inevitable
collision states: Fraichard and Asama 2004). If no candidate is safe, the vehicle brakes: the decision before
ensured that it can.

The guarantee. Let the vehicle

* begin to follow a command ``delay`` after the scan, and get the next command at most ``period`` later;
* change its velocity straight towards the commanded one, with ``acceleration``;

then it never comes nearer than ``radius`` to what stands still and was seen within ``sight``. All else is the
``margin``: how far it strays from such a motion, noise of the ranges, half the distance between two beams
where an obstacle is first seen. What is hidden behind something else needs no more: a line from the vehicle
that keeps the radius from what hides it keeps the radius from what is hidden.

Between the moments that are looked at, the braking line sweeps an area. With D and D' the largest distances
of the ends of one line from the other line, no point of it is farther from both than D D' / (D + D'), since
the distance from a line is convex. Its ends stray from a chord, since they move with an acceleration of at
most a and 2.5 a: by 2.5 a h^2 / 8 in a step h. Both are added to what must stay free.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.planar_pose import Array
from volery.base.elementary import sine_cosine
from volery.base.errors import UsageError
from volery.base.metered_work import done
from volery.base.numeric_code import NumericCode, numeric

_TURNS_DEG = (
    0,
    5,
    -5,
    10,
    -10,
    16,
    -16,
    24,
    -24,
    34,
    -34,
    46,
    -46,
    60,
    -60,
    80,
    -80,
    105,
    -105,
    140,
    -140,
    180,
)
_TURNS = np.array([sine_cosine(degrees * np.pi / 180.0) for degrees in _TURNS_DEG])
_SHARES = (1.0, 0.8, 0.6, 0.4, 0.2)
_NODES = 4
"""Moments on the way to a candidate from which braking is looked at."""
_STRAIGHT = (
    0.02  # [m/s] across the change of velocity, up to which a way is a straight line but for millimetres
)
_SOFT = 0.5  # [m] beyond what must stay free, within which a candidate costs more
_CURVED = 0.3125
"""Of acceleration times step squared [m]: how far the ends of a braking line stray from a chord."""


@dataclass(frozen=True)
class Motion:
    """What a vehicle can do.

    Args:
        radius: Radius of its body [m].
        speed: Largest speed [m/s].
        acceleration: With which it changes its velocity in every direction, also when braking [m/s^2].
        margin: What must stay free around its body: see above [m].
        delay: Time from a scan to the begin of what is done about it [s].
        period: Longest time between two decisions [s].
        sight: Range of the sensor [m].

    Raises:
        UsageError: A figure is not above 0 (delay and margin: below 0).
    """

    radius: float
    speed: float
    acceleration: float
    margin: float = 0.2
    delay: float = 0.2
    period: float = 0.1
    sight: float = inf

    def __post_init__(self) -> None:
        above = (self.radius, self.speed, self.acceleration, self.period, self.sight)
        if not (all(value > 0.0 for value in above) and self.margin >= 0.0 and self.delay >= 0.0):
            raise UsageError(f"{self}: give figures above 0, delay and margin of at least 0")

    @property
    def room(self) -> float:
        """Distance that what is seen must keep from the vehicle's centre [m]."""
        return self.radius + self.margin

    @property
    def fastest(self) -> float:
        """Largest speed [m/s] from which it stops within its sight."""
        lag = (self.delay + 2.0 * self.period) * self.acceleration
        return min(self.speed, self.speed_before(max(self.sight - self.room, 0.0), lag))

    def speed_before(self, distance: float, lag: float = 0.0) -> float:
        """Return the speed [m/s] from which it stops within a distance [m]; *lag*: speed lost by reacting."""
        return sqrt(lag * lag + 2.0 * self.acceleration * distance) - lag


def safe_velocity(
    points: Array, velocity: Array, wanted: Array, motion: Motion, pending: Sequence[tuple[float, Array]] = ()
) -> Array:
    """Return the velocity to command: as near to the wanted one as is safe.

    Args:
        points: What the sensor sees, about the vehicle (n, 2) [m], in the axes of the velocities.
        velocity: Its present velocity (2,) [m/s].
        wanted: The velocity that it would have if nothing were in the way (2,) [m/s].
        motion: What the vehicle can do.
        pending: Commands of the past that take effect within the delay: for how long [s], and which (2,). For
            the rest of the delay the last one stays; without any, the velocity stays what it is.

    Returns:
        The velocity (2,) [m/s]; zero where it must brake.

    Example::

        ahead = np.array(((3.0, 0.0),))
        safe_velocity(ahead, np.zeros(2), np.array((2.0, 0.0)), Motion(0.3, 5.0, 3.0))
    """
    place, present = _after_delay(velocity, motion, pending)
    size = sqrt(float((wanted * wanted).sum()))
    if size == 0.0:
        return np.zeros(2)
    speed = min(size, motion.fastest)
    east, north = wanted / size
    sine, cosine = _TURNS[:, 0], _TURNS[:, 1]
    headings = np.stack((cosine * east - sine * north, sine * east + cosine * north), axis=1)
    candidates = (speed * np.array(_SHARES)[:, None, None] * headings).reshape(-1, 2)
    state = np.array((*place, *present, motion.acceleration, 2.0 * motion.period))
    spare = np.full(len(candidates), np.inf)
    judge_candidates.bind(np.ascontiguousarray(points, dtype=np.float64), candidates, state, spare)()
    done("avoidance", looks=len(points) * len(candidates))
    off = candidates - speed * np.array((east, north))
    effort = np.sqrt((off * off).sum(axis=1))
    effort += 0.3 * speed * np.maximum(0.0, 1.0 - (spare - motion.room) / _SOFT)
    need = motion.room
    if len(points):  # one that is too near already is left
        off = points - place
        need = min(need, sqrt(float((off * off).sum(axis=1).min())) - 1e-9)
    effort = np.where(spare >= need, effort, np.inf)
    best = int(effort.argmin())
    return candidates[best] if effort[best] < np.inf else np.zeros(2)


def _after_delay(
    velocity: Array, motion: Motion, pending: Sequence[tuple[float, Array]]
) -> tuple[Array, Array]:
    """Return where the vehicle is after the delay, and its velocity then."""
    place, present, left = np.zeros(2), np.asarray(velocity, dtype=np.float64), motion.delay
    commands = [*pending, (left, pending[-1][1] if pending else present)]
    for lasts, command in commands:
        time = min(lasts, left)
        left -= time
        change = command - present
        size = sqrt(float((change * change).sum()))
        turning = min(time, size / motion.acceleration)
        after = present + change * (turning * motion.acceleration / size if size > 0.0 else 0.0)
        place = place + 0.5 * turning * (present + after) + (time - turning) * after
        present = after
    return place, present


@numeric
def _distance(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the distance of a point from the line between a and b."""
    to_x, to_y, off_x, off_y = bx - ax, by - ay, x - ax, y - ay
    square = to_x * to_x + to_y * to_y
    share = 0.0
    if square > 0.0:
        share = min(max((off_x * to_x + off_y * to_y) / square, 0.0), 1.0)
    off_x -= share * to_x
    off_y -= share * to_y
    return sqrt(off_x * off_x + off_y * off_y)


@numeric
def _gap(  # noqa: PLR0917  # two lines
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float
) -> float:
    """Return the farthest that what line a b passes on its way to c d may be from both [m]."""
    there = max(_distance(cx, cy, ax, ay, bx, by), _distance(dx, dy, ax, ay, bx, by))
    back = max(_distance(ax, ay, cx, cy, dx, dy), _distance(bx, by, cx, cy, dx, dy))
    return there * back / (there + back) if there + back > 0.0 else 0.0


def _compose(digest: str) -> Callable[..., int]:
    def judge_candidates(
        points: NDArray[np.float64],
        candidates: NDArray[np.float64],
        state: NDArray[np.float64],
        spare: NDArray[np.float64],
    ) -> int:
        acceleration, hold = state[4], state[5]
        for which in range(len(candidates)):
            to_x, to_y = candidates[which, 0] - state[2], candidates[which, 1] - state[3]
            size = sqrt(to_x * to_x + to_y * to_y)
            turning = min(hold, size / acceleration)
            step = turning / _NODES
            rate = acceleration / size if size > 0.0 else 0.0
            straight = abs(state[2] * to_y - state[3] * to_x) <= _STRAIGHT * size
            was_x, was_y, was_end_x, was_end_y = 0.0, 0.0, 0.0, 0.0
            nearest = np.inf
            for node in range(_NODES + 2):  # the last: on at the candidate, straight
                time = min(node, _NODES) * step
                speed_x, speed_y = state[2] + rate * to_x * time, state[3] + rate * to_y * time
                x = state[0] + (state[2] + 0.5 * rate * to_x * time) * time
                y = state[1] + (state[3] + 0.5 * rate * to_y * time) * time
                if node > _NODES:
                    x += speed_x * (hold - turning)
                    y += speed_y * (hold - turning)
                brakes = 0.5 * sqrt(speed_x * speed_x + speed_y * speed_y) / acceleration
                end_x, end_y = x + brakes * speed_x, y + brakes * speed_y
                lost, from_x, from_y = 0.0, x, y
                if node > 0 and straight:  # on one line: what lies between is on it, too
                    from_x, from_y = was_x, was_y
                elif 0 < node <= _NODES:
                    lost = _gap(was_x, was_y, was_end_x, was_end_y, x, y, end_x, end_y)
                    lost += _CURVED * acceleration * step * step
                for point in range(len(points)):
                    away = _distance(points[point, 0], points[point, 1], from_x, from_y, end_x, end_y)
                    if lost > 0.0:  # the gap lies on both sides: the line before counts with it, too
                        before = _distance(
                            points[point, 0], points[point, 1], was_x, was_y, was_end_x, was_end_y
                        )
                        away = min(away, before) - lost
                    nearest = min(nearest, away)
                was_x, was_y, was_end_x, was_end_y = x, y, end_x, end_y
            spare[which] = nearest
        return 1 if digest else 0

    return judge_candidates


judge_candidates = NumericCode(
    "judge_candidates",
    _compose,
    (Path(__file__),),
    ("float64[:,::1]", "float64[:,::1]", "float64[::1]", "float64[::1]"),
)
"""Find how near braking from the way to each candidate comes to what is seen."""
