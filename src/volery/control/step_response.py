"""Figures of step responses: steps of a set-point are found in a signal, and each response is judged.

A step is a change of the set-point between two stretches in which it stands. Its response ends with the next
step. Sizes are relative to where the measurement was at the step, because a controller that never reaches its
set-point would otherwise be judged by the wrong size. A signal without a set-point is judged against the
level at which it comes to rest.

Definitions follow IEC 60050-351 (rise time 10 % to 90 %, settling time to a band that is not left again).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.base.errors import UsageError
from volery.control.laws import wrap

Array = NDArray[np.float64]

BANDS = (0.10, 0.03)
"""Settling bands as shares of the step, those of the thesis."""
STANDS_S = 1.0
"""Time for which a level must last to count as one, s."""
REACTION = 0.05
"""Share of the step at which the delay ends."""
LEAST_SAMPLES = 5
CALM = 0.3
"""Share of the settling band within which the error counts as small."""
HALF_TURN = 170.0 / 360.0
"""Share of a turn from which a step counts as a half turn: either direction is right."""


@dataclass(frozen=True)
class Signal:
    """One controlled quantity over time.

    Attributes:
        name: what it is, such as ``yaw``.
        unit: unit of its values.
        times: seconds, increasing.
        measured: measured values.
        goal: set-point at the same times; ``None`` if the record has none.
        period: full turn of an angle; ``None`` if it is no angle.
        controller: name of what controlled it, for comparisons.
    """

    name: str
    unit: str
    times: Array
    measured: Array
    goal: Array | None = None
    period: float | None = None
    controller: str = ""

    def between(self, start: float, end: float) -> Signal:
        """Return the part from *start* to *end*, s."""
        inside = (self.times >= start) & (self.times <= end)
        goal = self.goal[inside] if self.goal is not None else None
        return replace(self, times=self.times[inside], measured=self.measured[inside], goal=goal)


def make_signal(
    name: str,
    unit: str,
    measured: tuple[Array, Array],
    goal: tuple[Array, Array] | None = None,
    *,
    period: float | None = None,
    controller: str = "",
) -> Signal:
    """Return a signal of two records with times of their own; the set-point holds until it changes.

    Args:
        name: what it is.
        unit: unit of its values.
        measured: times, s, and measured values.
        goal: times, s, and set-points.
        period: full turn of an angle.
        controller: what controlled it.
    """
    times, values = _in_order(*measured)
    aims: Array | None = None
    if goal is not None and len(goal[0]):
        at, stated = _in_order(*goal)
        index = np.searchsorted(at, times, side="right") - 1
        aims = np.where(index >= 0, stated[np.maximum(index, 0)], np.nan)
    return Signal(name, unit, times, values, aims, period, controller)


def _in_order(times: Array, values: Array) -> tuple[Array, Array]:
    at, what = np.asarray(times, dtype=float), np.asarray(values, dtype=float)
    known = np.isfinite(at) & np.isfinite(what)
    at, what = at[known], what[known]
    order = np.argsort(at, kind="stable")
    at, what = at[order], what[order]
    last = np.append(np.diff(at) > 0.0, True) if len(at) else np.zeros(0, dtype=bool)
    return at[last], what[last]


class StepResponse(NamedTuple):
    """The response to one step. Times in s after the step; NaN where there is none.

    Attributes:
        start: time of the step in the record, s.
        end: time of the next step, or of the end of the record, s.
        origin: measured value at the step.
        goal: set-point after the step; of an angle the one in the direction that was taken.
        delay: time until 5 % of the step.
        rise: time from 10 % to 90 %.
        overshoot: greatest excess beyond the set-point, in the unit of the signal.
        settled_10: time after which the error stays within 10 % of the step.
        settled_3: the same for 3 %.
        steady_error: mean error (goal - measured) over the last quarter of the response.
        steady_swing: half of the range of the error over that quarter.
        iae: integral of the absolute error, unit s.
        itae: integral of the absolute error times the time, unit s^2.
        pushed: greatest error of a disturbance after settling, in the unit of the signal.
        recovery: time from the beginning of that disturbance until the error stays within 10 % again.
    """

    start: float
    end: float
    origin: float
    goal: float
    delay: float
    rise: float
    overshoot: float
    settled_10: float
    settled_3: float
    steady_error: float
    steady_swing: float
    iae: float
    itae: float
    pushed: float
    recovery: float

    @property
    def size(self) -> float:
        """Size of the step with its sign."""
        return self.goal - self.origin

    @property
    def overshoot_share(self) -> float:
        """Overshoot as a share of the step."""
        return self.overshoot / abs(self.size)

    @property
    def steady_share(self) -> float:
        """Steady error as a share of the step."""
        return abs(self.steady_error) / abs(self.size)


LEAST_STEP = {"deg": 5.0, "rad": float(np.radians(5.0)), "m": 0.5, "deg/s": 10.0, "m/s": 0.5}
"""Least size of a step that is worth a row, by unit."""


def default_threshold(signal: Signal) -> float:
    """Return the least size of a step: that of its unit, and for other units a tenth of the range."""
    if signal.unit in LEAST_STEP:
        return LEAST_STEP[signal.unit]
    spread = signal.goal if signal.goal is not None else signal.measured
    known = spread[np.isfinite(spread)]
    return max(float(np.ptp(known)) / 10.0, 1e-9) if len(known) else 1e-9


def step_responses(signal: Signal, least: float | None = None) -> list[StepResponse]:
    """Return the response to each step of *signal*.

    Args:
        signal: the record.
        least: least size of a step, in the unit of the signal.

    Raises:
        UsageError: the signal has no samples.
    """
    if len(signal.times) < LEAST_SAMPLES:
        raise UsageError(f"{signal.name}: {len(signal.times)} samples; a response needs more")
    threshold = default_threshold(signal) if least is None else least
    if not threshold > 0.0:
        raise UsageError(f"steps of at least {threshold:g} {signal.unit}; give a size above 0")
    levels = (
        _goal_levels(signal, threshold) if signal.goal is not None else _resting_levels(signal, threshold)
    )
    found = []
    for start, end, goal in levels:
        response = judge(signal.between(start, end), goal)
        if response is not None and abs(response.size) >= threshold:
            found.append(response)
    return found


def _goal_levels(signal: Signal, threshold: float) -> list[tuple[float, float, float]]:
    """Return start, end and set-point of each step of the set-point.

    A step begins when the set-point leaves where it stood and ends at the next step, so a ramp counts as one
    step. Stretches in which the set-point never stands are no steps. The set-point that is there at first is
    a step from where the measurement is.
    """
    assert signal.goal is not None
    known = np.isfinite(signal.goal)
    times, goal = signal.times[known], _unwrapped(signal.goal[known], signal.period)
    tolerance = threshold / 5.0
    stands = _stretches(_rests(times, goal, tolerance), np.abs(np.diff(goal)) > tolerance)
    levels = []
    for number, (begin, end) in enumerate(stands):
        first = stands[number - 1][1] if number else begin
        levels.append((float(times[first]), float(times[end - 1]), float(np.median(goal[begin:end]))))
    return levels


def _resting_levels(signal: Signal, threshold: float) -> list[tuple[float, float, float]]:
    """Return start, end and level of each movement from rest to rest, for a record without set-points."""
    times = signal.times
    values = _unwrapped(signal.measured, signal.period)
    resting = _rests(times, values, threshold / 5.0)
    stretches = _stretches(resting)
    levels = []
    for (_, left), (begin, end) in pairwise(stretches):
        level = float(np.median(values[begin:end]))
        if abs(level - values[left - 1]) >= threshold:
            levels.append((float(times[left - 1]), float(times[end - 1]), level))
    return levels


def _rests(times: Array, values: Array, tolerance: float) -> NDArray[np.bool_]:
    """Return where the values stay within *tolerance* for ``STANDS_S`` from there on, or before."""
    ends = np.searchsorted(times, times + STANDS_S, side="right")
    rests = np.zeros(len(times), dtype=bool)
    for index, end in enumerate(ends):
        if times[min(end, len(times) - 1)] - times[index] >= 0.9 * STANDS_S:
            window = values[index:end]
            if np.ptp(window) <= tolerance:
                rests[index:end] = True
    return rests


def _stretches(flags: NDArray[np.bool_], breaks: NDArray[np.bool_] | None = None) -> list[tuple[int, int]]:
    """Return begin and end of each stretch of True; it also ends before a sample that follows a break."""
    changes = np.diff(np.concatenate(([0], flags.view(np.int8), [0])))
    begins, ends = list(np.flatnonzero(changes == 1)), list(np.flatnonzero(changes == -1))
    if breaks is not None:
        inside = np.flatnonzero(breaks & flags[:-1] & flags[1:]) + 1
        begins, ends = sorted([*begins, *inside]), sorted([*ends, *inside])
    return [(int(a), int(b)) for a, b in zip(begins, ends, strict=True)]


def judge(signal: Signal, goal: float) -> StepResponse | None:
    """Return the figures of one response; ``None`` if it has too few samples.

    Args:
        signal: the record from the step to the next one.
        goal: set-point after the step.
    """
    if len(signal.times) < LEAST_SAMPLES:
        return None
    times = signal.times - signal.times[0]
    values = _unwrapped(signal.measured, signal.period)
    origin = float(values[0])
    goal = _nearest_goal(values, goal, signal.period)
    size = goal - origin
    error = goal - values
    if size == 0.0:
        return None
    progress = (values - origin) / size
    quarter = times >= times[-1] * 0.75
    overshoot = max(0.0, float(np.max(progress) - 1.0)) * abs(size)
    settled = [_settling_time(times, error, band * abs(size)) for band in BANDS]
    disturbance = _disturbance(times, error, BANDS[0] * abs(size))
    if disturbance is not None:
        calm = times < disturbance[0]
        overshoot = max(0.0, float(np.max(progress[calm]) - 1.0)) * abs(size)
        settled = [_settling_time(times[calm], error[calm], band * abs(size)) for band in BANDS]
        quarter = calm & (times >= disturbance[0] * 0.75)
    mean = float(np.mean(error[quarter])) if quarter.any() else np.nan
    swing = float(np.ptp(error[quarter])) / 2.0 if quarter.any() else np.nan
    return StepResponse(
        start=float(signal.times[0]),
        end=float(signal.times[-1]),
        origin=origin,
        goal=goal,
        delay=_first_time(times, progress, REACTION),
        rise=_first_time(times, progress, 0.9) - _first_time(times, progress, 0.1),
        overshoot=overshoot,
        settled_10=settled[0],
        settled_3=settled[1],
        steady_error=mean,
        steady_swing=swing,
        iae=float(np.trapezoid(np.abs(error), times)),
        itae=float(np.trapezoid(np.abs(error) * times, times)),
        pushed=disturbance[2] if disturbance is not None else np.nan,
        recovery=disturbance[1] if disturbance is not None else np.nan,
    )


def _unwrapped(values: Array, period: float | None) -> Array:
    return np.unwrap(values, period=period) if period is not None else np.asarray(values, dtype=float)


def _nearest_goal(values: Array, goal: float, period: float | None) -> float:
    """Return the set-point in the turn to which the measurement went; half a turn has two directions."""
    if period is None:
        return goal
    near = float(values[0] + np.asarray(wrap(goal - values[0], period)))
    if abs(near - values[0]) < HALF_TURN * period:
        return near
    other = near - np.sign(near - values[0]) * period
    last = float(np.median(values[-max(1, len(values) // 4) :]))
    return near if abs(near - last) <= abs(other - last) else float(other)


def _first_time(times: Array, progress: Array, share: float) -> float:
    """Return when *progress* first reaches *share*, interpolated; NaN if never."""
    reached = np.flatnonzero(progress >= share)
    if not len(reached):
        return float("nan")
    index = int(reached[0])
    if index == 0:
        return float(times[0])
    low, high = progress[index - 1], progress[index]
    return float(times[index - 1] + (share - low) / (high - low) * (times[index] - times[index - 1]))


def _settling_time(times: Array, error: Array, band: float) -> float:
    """Return when the error enters *band* for good; NaN if it is outside at the end."""
    outside = np.flatnonzero(np.abs(error) > band)
    if not len(outside):
        return float(times[0]) if len(times) else float("nan")
    last = int(outside[-1])
    return float(times[last + 1]) if last + 1 < len(times) else float("nan")


def _disturbance(times: Array, error: Array, band: float) -> tuple[float, float, float] | None:
    """Return begin, recovery time and greatest error of the largest disturbance after settling.

    The error leaves *band* after it has been within it for ``STANDS_S``, and reaches more than twice the
    band. It began where the error was last small.
    """
    inside = np.abs(error) <= band
    worst: tuple[float, float, float] | None = None
    for begin, end in _stretches(inside):
        if end >= len(times) or times[end] - times[begin] < STANDS_S:
            continue
        outside = np.abs(error[end:])
        left = outside > band
        back = end + int(np.argmin(left)) if not left.all() else len(times)
        peak = float(np.max(np.abs(error[end:back])))
        if peak > 2.0 * band and (worst is None or peak > worst[2]):
            calm = np.flatnonzero(np.abs(error[begin:end]) <= band * CALM)
            start = begin + int(calm[-1]) if len(calm) else end
            recovery = _settling_time(times[start:] - times[start], error[start:], band)
            worst = (float(times[start]), recovery, peak)
    return worst


COLUMNS = (
    ("at", "start"),
    ("step", "size"),
    ("delay", "delay"),
    ("rise", "rise"),
    ("over", "overshoot"),
    ("10 %", "settled_10"),
    ("3 %", "settled_3"),
    ("steady", "steady_error"),
    ("IAE", "iae"),
    ("ITAE", "itae"),
    ("recovery", "recovery"),
)
"""Headings of a table of responses and the figures below them."""


def as_record(signal: Signal, responses: Sequence[StepResponse]) -> dict[str, Any]:
    """Return the responses of a signal as plain data, ``None`` for what is unknown."""

    def plain(value: float) -> float | None:
        return round(value, 6) if np.isfinite(value) else None

    return {
        "signal": signal.name,
        "unit": signal.unit,
        "controller": signal.controller,
        "set_point": signal.goal is not None,
        "steps": [
            {**{name: plain(value) for name, value in one._asdict().items()}, "size": plain(one.size)}
            for one in responses
        ],
    }
