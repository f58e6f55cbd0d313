"""Figures of step responses: steps of a set-point are found in a signal, and each response is judged.

A step is a jump of the set-point between two stretches in which it stands; a slower change in one direction
is a ramp, whose response is judged from the end of the ramp. A response ends with the next change of the
set-point, or where the vehicle is disarmed or on the ground. What is neither step nor ramp, or was not held
long enough, is not judged, and stated with the reason: a controller must not be blamed for it. Sizes are
relative to where the measurement was at the step, because a controller that never reaches its set-point would
otherwise be judged by the wrong size. A signal without a set-point is judged against the level at which it
comes to rest.

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
"""Time for which a level must last to count as one, s, and for which a settled error stays in its band."""
JUMP_S = 0.3
"""Longest time in which a set-point jumps, s; one that is reported seldom may take two of its reports."""
GAP_S = 1.0
"""Time without a sample, s, after which a record goes on elsewhere."""
HELD_S = 2.0
"""Time for which a set-point must stand to be judged, s, unless the measurement has settled before."""
REACTION = 0.05
"""Share of the step at which the delay ends."""
LEAST_SAMPLES = 5
CALM = 0.3
"""Share of the settling band within which the error counts as small."""
HALF_TURN = 170.0 / 360.0
"""Share of a turn from which a step counts as a half turn: either direction is right."""


class GroundedStretch(NamedTuple):
    """A stretch of a record, s, in which the vehicle does not fly, and why: ``disarmed`` ..."""

    start: float
    end: float
    why: str


class NotJudged(NamedTuple):
    """A change of the set-point that is not judged, s, and why."""

    start: float
    end: float
    why: str


@dataclass(frozen=True)
class ControlledSignal:
    """One controlled quantity over time.

    Attributes:
        name: what it is, such as ``yaw``.
        unit: unit of its values.
        times: seconds, increasing.
        measured: measured values.
        goal: set-point at the same times; ``None`` if the record has none.
        period: full turn of an angle; ``None`` if it is no angle.
        controller: name of what controlled it, for comparisons.
        stated: times of the set-point's own records, s; those of the measurement if ``None``.
        sent: times at which commands for this quantity were sent, s.
        engaged: whether the record begins when the controller takes over: then its first set-point is a step.
        idle: stretches in which the vehicle does not fly, in order.
    """

    name: str
    unit: str
    times: Array
    measured: Array
    goal: Array | None = None
    period: float | None = None
    controller: str = ""
    stated: Array | None = None
    sent: Sequence[float] = ()
    engaged: bool = True
    idle: Sequence[GroundedStretch] = ()

    def between(self, start: float, end: float) -> ControlledSignal:
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
) -> ControlledSignal:
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
    at: Array | None = None
    if goal is not None and len(goal[0]):
        at, stated = _in_order(*goal)
        index = np.searchsorted(at, times, side="right") - 1
        aims = np.where(index >= 0, stated[np.maximum(index, 0)], np.nan)
    return ControlledSignal(name, unit, times, values, aims, period, controller, at)


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
        start: time in the record at which the set-point was sent or, where that is not recorded, first
            stated, s; of a ramp the time at which it ends.
        end: time of the next change of the set-point, of the landing, or of the end of the record, s.
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
        ramp: duration of the ramp that the set-point made, s; 0 for a step. A ramp has no delay and no rise.
        resolution: time by which the set-point may have been sent earlier than ``start``, s.
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
    ramp: float = 0.0
    resolution: float = 0.0

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


def default_threshold(signal: ControlledSignal) -> float:
    """Return the least size of a step: that of its unit, and for other units a tenth of the range."""
    if signal.unit in LEAST_STEP:
        return LEAST_STEP[signal.unit]
    spread = signal.goal if signal.goal is not None else signal.measured
    known = spread[np.isfinite(spread)]
    return max(float(np.ptp(known)) / 10.0, 1e-9) if len(known) else 1e-9


class Judgement(NamedTuple):
    """What was found in a signal, in order of time."""

    responses: list[StepResponse]
    not_judged: list[NotJudged]


def step_responses(signal: ControlledSignal, least: float | None = None) -> list[StepResponse]:
    """Return the response to each step and ramp of *signal*; see ``judged``."""
    return judged(signal, least).responses


def judged(signal: ControlledSignal, least: float | None = None) -> Judgement:
    """Return the responses in *signal*, and the changes of its set-point that are not judged.

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
    changes = _goal_changes(signal, threshold) if signal.goal is not None else _movements(signal, threshold)
    judgement = Judgement([], [])
    for change in changes:
        outcome = _outcome(signal, change, threshold)
        if isinstance(outcome, StepResponse):
            judgement.responses.append(outcome)
        elif outcome:
            judgement.not_judged.append(NotJudged(change.leaves, change.end, outcome))
    return judgement


class _SetpointChange(NamedTuple):
    """A change of the set-point: when it leaves its level, reaches the next, leaves that, and the level.

    ``problem`` is why it is neither step nor ramp.
    """

    leaves: float
    start: float
    end: float
    goal: float
    ramp: float = 0.0
    resolution: float = 0.0
    problem: str = ""


def _outcome(signal: ControlledSignal, change: _SetpointChange, threshold: float) -> StepResponse | str:
    """Return the response to a change, or why it is not judged; empty if it is not worth a word."""
    end, cut = change.end, ""
    for idle in signal.idle:
        if idle.start <= change.start < idle.end:
            moves = change.problem or abs(_size(signal, change)) >= threshold
            return f"the vehicle is {idle.why}" if moves else ""
        if change.start < idle.start < end:
            end, cut = idle.start, f"the vehicle is {idle.why}"
    if change.problem:
        return change.problem
    begin = change.leaves if change.ramp else change.start
    response = judge(signal.between(begin, end), change.goal, change.start)
    if response is None or abs(response.size) < threshold:
        return ""
    held = end - change.start
    if held < HELD_S and not response.settled_10 <= held:
        if not cut and end < signal.times[-1]:
            return f"a pulse: it is held for less than {HELD_S:g} s"
        return f"{cut or 'the record ends'} less than {HELD_S:g} s later"
    if change.ramp:
        response = response._replace(delay=np.nan, rise=np.nan)
    return response._replace(ramp=change.ramp, resolution=change.resolution)


def _size(signal: ControlledSignal, change: _SetpointChange) -> float:
    """Return the size of a change from where the measurement is when it begins."""
    begin = change.leaves if change.ramp else change.start
    origin = float(np.interp(begin, signal.times, _unwrapped(signal.measured, signal.period)))
    return _nearest_goal(np.array([origin]), change.goal, signal.period) - origin


def _goal_changes(signal: ControlledSignal, threshold: float) -> list[_SetpointChange]:
    """Return the changes of the set-point from one stretch in which it stands to the next."""
    assert signal.goal is not None
    known = np.isfinite(signal.goal)
    times, goal = signal.times[known], _unwrapped(signal.goal[known], signal.period)
    if not len(times):
        return []
    tolerance = threshold / 5.0
    stands = _stretches(_rests(times, goal, tolerance), np.abs(np.diff(goal)) > tolerance)
    reports = signal.stated if signal.stated is not None else times
    reports = reports[(reports >= times[0]) & (reports <= times[-1])]
    jump = max(JUMP_S, 2.05 * float(np.median(np.diff(reports)))) if len(reports) > 1 else JUMP_S
    changes: list[_SetpointChange] = []
    before: int | None = None  # the last sample at which the set-point stood
    for begin, end in stands:
        level = float(np.median(goal[begin:end]))
        last = float(times[end - 1])
        if before is None:
            changes += _first_change(signal, float(times[begin]), last, level, begin == 0, threshold)
        else:
            change = _change(times[before : begin + 1], goal[before : begin + 1], tolerance, jump)
            changes.append(change._replace(goal=level, end=change.end if change.problem else last))
        before = end - 1
    rest = (before or 0), len(goal) - 1
    if before is None or rest[1] > before:
        moved = float(np.ptp(goal[rest[0] : rest[1] + 1]))
        if moved >= threshold:
            why = f"it never stands for {STANDS_S:g} s"
            at = float(times[rest[0]]), float(times[-1])
            changes.append(_SetpointChange(at[0], at[0], at[1], float(goal[-1]), problem=why))
    return [_dated(signal, change, reports) for change in changes if not _is_small(change, signal, threshold)]


def _is_small(change: _SetpointChange, signal: ControlledSignal, threshold: float) -> bool:
    return not change.problem and abs(_size(signal, change)) < threshold


def _first_change(
    signal: ControlledSignal, at: float, end: float, level: float, first: bool, threshold: float
) -> list[_SetpointChange]:
    """Return the step to the first set-point that stands, if there was a moment at which it came."""
    whole = _SetpointChange(at, at, end, level)
    if abs(_size(signal, whole)) < threshold:
        return []
    if not first:
        why = f"it did not stand for {STANDS_S:g} s before"
        return [whole._replace(leaves=float(signal.times[0]), problem=why)]
    if not signal.engaged and at - signal.times[0] <= STANDS_S:
        return [whole._replace(problem="it is there when the record begins")]
    return [whole]


def _change(times: Array, goal: Array, tolerance: float, jump: float) -> _SetpointChange:
    """Return the change between two samples at which the set-point stands.

    Args:
        times: times of the samples from the one to the other, s.
        goal: set-points.
        tolerance: range within which it stands.
        jump: longest time of a jump, s.
    """
    leaves, reaches = float(times[1]), float(times[-1])
    change = _SetpointChange(leaves, reaches, reaches, float(goal[-1]))
    if np.max(np.diff(times)) > max(GAP_S, jump):
        return change._replace(start=leaves, problem="the record has a gap there")
    moved = np.diff(goal)
    back = moved[np.sign(moved) != np.sign(goal[-1] - goal[0])]
    if np.sum(np.abs(back)) > 2.0 * tolerance:
        return change._replace(start=leaves, problem="it moves to and fro before it stands")
    if reaches - times[0] <= jump:
        return change._replace(start=leaves)
    return change._replace(ramp=reaches - leaves)


def _dated(signal: ControlledSignal, change: _SetpointChange, reports: Array) -> _SetpointChange:
    """Return the change with the time at which it was sent, or else that of its first report."""
    if change.problem or change.ramp or not len(reports):
        return change
    index = int(np.searchsorted(reports, change.start, side="right")) - 1
    if index < 1:
        return change
    report, earlier = float(reports[index]), float(reports[index - 1])
    sent = next((one for one in signal.sent if earlier < one <= report), None)
    if sent is not None:
        return change._replace(start=sent)
    return change._replace(start=report, resolution=report - earlier)


def _movements(signal: ControlledSignal, threshold: float) -> list[_SetpointChange]:
    """Return each movement from rest to rest, for a record without set-points."""
    times = signal.times
    values = _unwrapped(signal.measured, signal.period)
    tolerance = threshold / 5.0
    stretches = _stretches(_rests(times, values, tolerance), np.abs(np.diff(values)) > tolerance)
    changes = []
    for (_, left), (begin, end) in pairwise(stretches):
        level = float(np.median(values[begin:end]))
        if abs(level - values[left - 1]) >= threshold:
            start = float(times[left - 1])
            changes.append(_SetpointChange(start, start, float(times[end - 1]), level))
    return changes


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


def judge(signal: ControlledSignal, goal: float, start: float) -> StepResponse | None:
    """Return the figures of one response; ``None`` if it has too few samples.

    Args:
        signal: the record from the step, or from the beginning of a ramp, to the next change.
        goal: set-point after the step.
        start: time of the step, or of the end of the ramp, s.
    """
    after = signal.times >= start
    if np.count_nonzero(after) < LEAST_SAMPLES:
        return None
    values = _unwrapped(signal.measured, signal.period)
    origin = float(values[0])
    goal = _nearest_goal(values, goal, signal.period)
    size = goal - origin
    times, values = signal.times[after] - start, values[after]
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
        start=start,
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
    """Return when the error enters *band* for good; NaN if it does not.

    It is there for good if it stays for ``STANDS_S`` at least. An oscillation that passes through the band is
    not settled: after two excursions to different sides, the stay must be longer than those between them.
    """
    outside = np.abs(error) > band
    if not outside.any():
        return float(times[0]) if len(times) else float("nan")
    last = int(np.flatnonzero(outside)[-1])
    if last + 1 >= len(times):
        return float("nan")
    entered = float(times[last + 1])
    stay = float(times[-1]) - entered
    excursions = _stretches(outside)
    between = [
        float(times[begin] - times[end])
        for (left, end), (begin, _) in pairwise(excursions)
        if error[left] * error[begin] < 0.0
    ]
    swings = between[1:]  # the first is the way into the band
    return entered if stay >= STANDS_S and stay > max(swings, default=0.0) else float("nan")


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
    ("back", "recovery"),
)
"""Headings of a table of responses and the figures below them."""


def as_record(
    signal: ControlledSignal, responses: Sequence[StepResponse], not_judged: Sequence[NotJudged] = ()
) -> dict[str, Any]:
    """Return what was found in a signal as plain data, ``None`` for what is unknown."""

    def plain(value: float) -> float | None:
        return round(value, 6) if np.isfinite(value) else None

    return {
        "signal": signal.name,
        "unit": signal.unit,
        "controller": signal.controller,
        "set_point": signal.goal is not None,
        "steps": [
            {
                **{name: plain(value) for name, value in response._asdict().items()},
                "size": plain(response.size),
            }
            for response in responses
        ],
        "not_judged": [
            {"start": plain(one.start), "end": plain(one.end), "why": one.why} for one in not_judged
        ],
    }
