"""What a probe says, and what follows from it for each call: points to fit a law to."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from statistics import median
from typing import Literal, NamedTuple

from volery.base.errors import LinkError
from volery.base.time import S

Clock = Literal["process_ns", "caller_ns"]
"""CPU time of the whole process, or of the calling thread alone."""

Points = dict[str, dict[float, list[float]]]
"""Call -> x -> what one of them took, ns, once for each time it was measured."""

ONCE = ("init", "node_handle", "advertise", "subscribe", "service_client", "advertise_service")
"""Calls that are made once by a fresh process."""


SECOND_US = 1e6


class Sample(NamedTuple):
    """One line of a probe: so many cycles of something took so much CPU time and time on the wall."""

    what: str
    x: float
    cycles: int
    waited_ns: int
    process_ns: int
    caller_ns: int

    def each(self, clock: Clock) -> float:
        """CPU time of one cycle, ns."""
        return float(getattr(self, clock)) / self.cycles


Round = tuple[Sample, ...]


def read_round(lines: Iterable[str]) -> Round:
    """What a probe has printed. ``LinkError`` if that is something else."""
    try:
        return tuple(Sample(**json.loads(line)) for line in lines if line.startswith("{"))
    except (ValueError, TypeError) as error:
        raise LinkError(f"a probe said what is no measurement: {error}") from error


def points_of(one: Round, clock: Clock) -> Points:
    """What each call took in one round."""
    taken = _Round(one, clock)
    points: Points = {}
    for call, x, value in [*taken.once(), *taken.loops(), *taken.publishing(), *taken.hearing()]:
        points.setdefault(call, {}).setdefault(x, []).append(value)
    return points


def merged(several: Sequence[Points]) -> Points:
    """The points of several rounds together."""
    found: Points = {}
    for points in several:
        for call, by_x in points.items():
            for x, values in by_x.items():
                found.setdefault(call, {}).setdefault(x, []).extend(values)
    return found


Point = tuple[str, float, float]


class _Round:
    """One round by one clock. Idle cycles and the probe's own waiting are taken off everything."""

    def __init__(self, samples: Round, clock: Clock) -> None:
        self._clock: Clock = clock
        self._by_name: Mapping[str, list[Sample]] = _grouped(samples)
        nothing = self._by_name.get("nothing", [])
        self._own = median([one.each(clock) for one in nothing]) if nothing else 0.0
        settling = self._by_name.get("settle", [])
        waited = sum(one.waited_ns for one in settling)
        spent = sum(one.each(clock) - self._own for one in settling)
        self._idle = max(0.0, spent / waited) if waited else 0.0

    def _alone(self, one: Sample) -> float:
        """Of a single call, without what the process would have spent anyway."""
        return one.each(self._clock) - self._own - self._idle * one.waited_ns

    def _single(self, what: str) -> float | None:
        found = self._by_name.get(what, [])
        return median([self._alone(one) for one in found]) if found else None

    def once(self) -> Iterable[Point]:
        """Registrations, and connections: what they take beyond the same without a peer."""
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
        """Sleeps, and waiting in ``spin``."""
        for one in self._by_name.get("sleep", []):
            yield "sleep", one.x, one.each(self._clock)
        for one in self._by_name.get("wait", []):
            yield "wait", SECOND_US, one.each(self._clock) * S / one.waited_ns

    def publishing(self) -> Iterable[Point]:
        """Whole cycles minus the idle cycles before them."""
        idle, publish = self._by_name.get("idle", []), self._by_name.get("publish", [])
        for without, whole in zip(idle, publish, strict=False):
            yield "publish", whole.x, whole.each(self._clock) - without.each(self._clock)
        alone, both = self._by_name.get("publish_alone", []), self._by_name.get("publish_both", [])
        for without, whole in zip(alone, both, strict=False):
            yield "publish_next", whole.x, whole.each(self._clock) - without.each(self._clock)

    def hearing(self) -> Iterable[Point]:
        """Cycles that publish and spin, minus those that publish; waiting with messages, minus without."""
        both, spinning = self._by_name.get("publish_both", []), self._by_name.get("spin_once", [])
        for without, one in zip(both, spinning, strict=False):
            yield "spin_once_next", 0.0, one.each(self._clock) - without.each(self._clock)
        waiting, receiving = self._by_name.get("wait", []), self._by_name.get("receive", [])
        for quiet, one in zip(waiting, receiving, strict=False):
            anyway = getattr(quiet, self._clock) * one.waited_ns / quiet.waited_ns
            yield "receive", 0.0, (getattr(one, self._clock) - anyway) / one.cycles


def _grouped(samples: Round) -> dict[str, list[Sample]]:
    found: dict[str, list[Sample]] = {}
    for one in samples:
        found.setdefault(one.what, []).append(one)
    return found
