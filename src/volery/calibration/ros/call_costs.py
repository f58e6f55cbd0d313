"""Costs of calls into ROS from the output of probes: points, lines through them, and their precision.

A line goes through the medians at each x, with weights that minimise relative residuals: a cheap call is to
be estimated as well as an expensive one. The precision is that of lines through rounds drawn with replacement
(bootstrap over whole rounds, since the measurements of one probe are correlated).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Literal, NamedTuple

from volery.base.errors import LinkError
from volery.base.seeds import stream
from volery.base.time import MS, S

Clock = Literal["process_ns", "caller_ns"]
"""CPU time of the whole process, or of the calling thread."""

Points = dict[str, dict[float, list[float]]]
"""{call: {x: measured times of one call, ns}}."""

ONCE = ("init", "node_handle", "advertise", "subscribe", "service_client", "advertise_service")
"""Calls that a new process makes once."""


SECOND_US = 1e6
FOLLOWING = 4
"""Topics that probes publish just after another."""
OFTEN_NS = 32 * MS
"""Cycles below this are frequent: halfway between the two periods of campaigns, 20 and 50 ms."""


class ProbeSample(NamedTuple):
    """One line of a probe: a number of cycles, their CPU times and their time on the wall clock, ns."""

    what: str
    x: float
    cycles: int
    waited_ns: int
    process_ns: int
    caller_ns: int

    def each(self, clock: Clock) -> float:
        """Return the CPU time of one cycle, ns."""
        return float(getattr(self, clock)) / self.cycles


Round = tuple[ProbeSample, ...]


def read_round(lines: Iterable[str]) -> Round:
    """Parse the output of a probe; raise ``LinkError`` if it is not a measurement."""
    try:
        return tuple(ProbeSample(**json.loads(line)) for line in lines if line.startswith("{"))
    except (ValueError, TypeError) as error:
        raise LinkError(f"the output of a probe is not a measurement: {error}") from error


def points_of(one: Round, clock: Clock) -> Points:
    """Return the times of each call in one round."""
    taken = _RoundAnalysis(one, clock)
    points: Points = {}
    for call, x, value in [
        *taken.once(),
        *taken.loops(),
        *taken.publishing(),
        *taken.hearing(),
        *taken.services(),
    ]:
        points.setdefault(call, {}).setdefault(x, []).append(value)
    return points


def merged(several: Sequence[Points]) -> Points:
    """Merge the points of several rounds."""
    found: Points = {}
    for points in several:
        for call, by_x in points.items():
            for x, values in by_x.items():
                found.setdefault(call, {}).setdefault(x, []).extend(values)
    return found


Point = tuple[str, float, float]


class _RoundAnalysis:
    """Times of calls in one round by one clock, less idle cycles and the probe's own waiting."""

    def __init__(self, samples: Round, clock: Clock) -> None:
        self._clock: Clock = clock
        self._by_name: Mapping[str, list[ProbeSample]] = _grouped(samples)
        nothing = self._by_name.get("nothing", [])
        self._own = median([one.each(clock) for one in nothing]) if nothing else 0.0
        waiting = self._by_name.get("wait", [])
        self._wait = median([getattr(one, clock) / one.waited_ns for one in waiting]) if waiting else 0.0
        settling = self._by_name.get("settle", [])
        waited = sum(one.waited_ns for one in settling)
        spent = sum(one.each(clock) - self._own for one in settling)
        self._idle = max(0.0, spent / waited) if waited else 0.0

    def _alone(self, one: ProbeSample) -> float:
        """Return the time of a single call without what the idle process would have spent."""
        return one.each(self._clock) - self._own - self._idle * one.waited_ns

    def _single(self, what: str) -> float | None:
        found = self._by_name.get(what, [])
        return median([self._alone(one) for one in found]) if found else None

    def once(self) -> Iterable[Point]:
        """Yield registrations, and connections less the same call without a peer."""
        for call in ONCE:
            value = self._single(call)
            if value is not None:
                yield call, 0.0, value
        for one in self._by_name.get("spin_once_first", []):
            yield "spin_once_first", 0.0, one.each(self._clock)
        connect, subscribe = self._single("connect"), self._single("subscribe")
        if connect is not None and subscribe is not None:
            yield "connect", 0.0, connect - subscribe
        advertise = self._single("advertise") or 0.0
        for one in self._by_name.get("accept", []):
            yield "accept", 0.0, (self._alone(one) - advertise) / one.x

    def loops(self) -> Iterable[Point]:
        """Yield sleeps, and waiting in ``spin``."""
        for one in self._by_name.get("sleep", []):
            yield "sleep", one.x, one.each(self._clock)
        for one in self._by_name.get("wait", []):
            yield "wait", SECOND_US, one.each(self._clock) * S / one.waited_ns

    def publishing(self) -> Iterable[Point]:
        """Yield publishing cycles less the idle cycles before them, by their period."""
        idle, publish = self._by_name.get("idle", []), self._by_name.get("publish", [])
        for without, whole in zip(idle, publish, strict=False):
            yield f"publish{_by_period(whole)}", whole.x, whole.each(self._clock) - without.each(self._clock)
        alone, both = self._by_name.get("publish_alone", []), self._by_name.get("publish_both", [])
        for without, whole in zip(alone, both, strict=False):
            value = (whole.each(self._clock) - without.each(self._clock)) / FOLLOWING
            yield f"publish_next{_by_period(whole)}", whole.x, value

    def hearing(self) -> Iterable[Point]:
        """Cycles that publish and spin, minus those that publish; waiting with messages, minus without."""
        both, spinning = self._by_name.get("publish_both", []), self._by_name.get("spin_once", [])
        spins = [
            one.each(self._clock) - without.each(self._clock)
            for without, one in zip(both, spinning, strict=False)
        ]
        yield from (("spin_once_next", 0.0, value) for value in spins)
        spin = median(spins) if spins else 0.0  # priced when the callback begins
        first: dict[str, list[float]] = {}
        for one in self._by_name.get("receive", []):
            first.setdefault(_by_period(one), []).append(self._received(one) - spin)
        for often, values in first.items():
            yield from ((f"receive{often}", 0.0, value) for value in values)
        for one in self._by_name.get("receive_burst", []):
            often = _by_period(one, one.x)
            following = (self._received(one) - spin) * one.x - median(first[often])
            yield f"receive_next{often}", 0.0, following / (one.x - 1.0)

    def services(self) -> Iterable[Point]:
        """Yield cycles with a request minus idle ones, and waiting with requests minus without."""
        idle, calling = self._by_name.get("idle_before_call", []), self._by_name.get("call_service", [])
        for without, whole in zip(idle, calling, strict=False):
            yield "call_service", 0.0, whole.each(self._clock) - without.each(self._clock)
        for one in self._by_name.get("serve", []):
            yield "serve", 0.0, self._received(one)

    def _received(self, one: ProbeSample) -> float:
        """Return the time of one message or request that was received while the process waited, ns."""
        return one.each(self._clock) - self._wait * one.waited_ns / one.cycles


def _by_period(one: ProbeSample, topics: float = 1.0) -> str:
    """Return the ending of the names of calls in cycles as short as these, of one message of each topic."""
    return "_often" if one.waited_ns * topics < OFTEN_NS * one.cycles else ""


def _grouped(samples: Round) -> dict[str, list[ProbeSample]]:
    found: dict[str, list[ProbeSample]] = {}
    for sample in samples:
        found.setdefault(sample.what, []).append(sample)
    return found


TYPICAL_X = {
    "publish": 4.0,
    "publish_often": 4.0,
    "publish_next": 2.0,
    "publish_next_often": 2.0,
    "sleep": 50_000.0,
    "wait": 1_000_000.0,
}
"""x at which a law is judged: four subscribers (two), 50 ms, a second."""

DRAWS = 200
NEGLIGIBLE_NS = 5_000.0
"""Half width of an interval that is precise enough for every figure: a twentieth of a cycle's cost."""

LOW, HIGH = 0.025, 0.975


class CostLine(NamedTuple):
    """``constant + per_x * x``, ns."""

    constant: float
    per_x: float = 0.0

    def at(self, x: float) -> float:
        """Return the value at x."""
        return self.constant + self.per_x * x


@dataclass(frozen=True)
class CallCost:
    """Cost of one call, ns.

    Attributes:
        call: Its name.
        whole: CPU time of the process over x.
        caller: Part of ``whole`` of the calling thread.
        low: Lower bound of a typical call (95 % interval).
        high: Upper bound of a typical call.
        spread: Inter-quartile range of single measurements, relative to the line.
        residual: Greatest distance of a median from the line, relative.
        count: Number of measurements.
        points: Measurements by x.
    """

    call: str
    whole: CostLine
    caller: CostLine
    low: float
    high: float
    spread: float
    residual: float
    count: int
    points: dict[float, list[float]]

    @property
    def typical(self) -> float:
        """Cost of a typical call, ns."""
        return self.whole.at(TYPICAL_X.get(self.call, 0.0))

    @property
    def half_width(self) -> float:
        """Half of the interval, relative to a typical call (to ``NEGLIGIBLE_NS`` if that is greater)."""
        return (self.high - self.low) / 2.0 / max(self.typical, NEGLIGIBLE_NS)

    def is_tight(self, within: float) -> bool:
        """Return whether the relative precision is ``within`` or better."""
        return self.half_width <= within or (self.high - self.low) / 2.0 <= NEGLIGIBLE_NS


def fit(by_x: dict[float, list[float]]) -> CostLine:
    """Fit a line through the medians at each x, which is nowhere negative for x >= 0.

    With one x only the line is constant if that x is 0, else proportional.
    """
    medians = {x: median(values) for x, values in by_x.items()}
    if len(medians) == 1:
        [(x, value)] = medians.items()
        return CostLine(0.0, max(0.0, value) / x) if x else CostLine(max(0.0, value))
    constant, per_x = _least_squares(medians)
    if per_x < 0.0:  # noise has made one of them negative
        return CostLine(max(0.0, median(medians.values())))
    if constant < 0.0:
        return CostLine(0.0, max(0.0, median(value / x for x, value in medians.items() if x)))
    return CostLine(constant, per_x)


def _least_squares(medians: dict[float, float]) -> tuple[float, float]:
    """Return constant and slope that minimise relative residuals."""
    weights = {x: max(value, NEGLIGIBLE_NS) ** -2 for x, value in medians.items()}
    total = sum(weights.values())
    mean_x = sum(weights[x] * x for x in medians) / total
    mean_y = sum(weights[x] * value for x, value in medians.items()) / total
    spread_x = sum(weights[x] * (x - mean_x) ** 2 for x in medians)
    slope = sum(weights[x] * (x - mean_x) * (value - mean_y) for x, value in medians.items()) / spread_x
    return mean_y - slope * mean_x, slope


def call_costs(rounds: Sequence[Round], seed: int = 1) -> dict[str, CallCost]:
    """Return the cost of every call by the rounds so far."""
    whole = [points_of(one, "process_ns") for one in rounds]
    together, callers = merged(whole), merged([points_of(one, "caller_ns") for one in rounds])
    drawn = _drawn(whole, seed)
    return {
        call: _cost(call, by_x, callers[call], sorted(drawn[call])) for call, by_x in sorted(together.items())
    }


def _cost(
    call: str, by_x: dict[float, list[float]], of_caller: dict[float, list[float]], drawn: list[float]
) -> CallCost:
    line = fit(by_x)
    away = sorted(
        (value - line.at(x)) / max(line.at(x), NEGLIGIBLE_NS)
        for x, values in by_x.items()
        for value in values
    )
    from_line = [
        abs(median(values) - line.at(x)) / max(line.at(x), NEGLIGIBLE_NS) for x, values in by_x.items()
    ]
    return CallCost(
        call=call,
        whole=line,
        caller=fit(of_caller),
        low=_quantile(drawn, LOW),
        high=_quantile(drawn, HIGH),
        spread=_quantile(away, 0.75) - _quantile(away, 0.25),
        residual=max(from_line),
        count=len(away),
        points=by_x,
    )


def _drawn(rounds: Sequence[Points], seed: int) -> dict[str, list[float]]:
    """Return bootstrap samples of the typical cost of each call: rounds drawn with replacement."""
    random = stream(seed, "calibrate/bootstrap")
    found: dict[str, list[float]] = {}
    for _ in range(DRAWS):
        chosen = merged(random.choices(rounds, k=len(rounds)))
        for call, by_x in chosen.items():
            found.setdefault(call, []).append(fit(by_x).at(TYPICAL_X.get(call, 0.0)))
    return found


def _quantile(ordered: Sequence[float], share: float) -> float:
    """Return a quantile, linear between order statistics."""
    place = share * (len(ordered) - 1)
    below = int(place)
    above = min(below + 1, len(ordered) - 1)
    return ordered[below] + (ordered[above] - ordered[below]) * (place - below)
