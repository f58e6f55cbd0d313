"""What tasks demand of their processors, folded from a run: the figures of the analysis of response times.

Of each component that has activations: the most that k of them in a row executed and the shortest time that k
releases took, for k up to ``IN_A_ROW``. All flows of control of a component count as one. A period that the
model promises is taken for the distance of releases unless they were seen to come faster.
"""

from __future__ import annotations

from collections import deque

from volery.base.time import Ns
from volery.requirements.response_bounds import WINDOW, Demand, Load, response_bounds
from volery.trace.events import Activation, Slice
from volery.trace.setup import ComponentSetup, ProcessorSetup

FIXED_PRIORITY = "fixed-priority"
IN_A_ROW = 16
"""So many activations in a row are remembered."""
LEAST_RELEASES = 10
"""Fewer say nothing about how fast releases come; a period that is promised does."""
BACKGROUND = " (background)"
"""The end of the name of what is executed beside a component's own flows of control."""


class _Releases:
    """How fast a component's activations were released, and how long they took."""

    def __init__(self) -> None:
        self.count = 0
        self.longest: Ns = 0
        self.spans: list[Ns] = []
        self._last: deque[Ns] = deque(maxlen=IN_A_ROW + 1)  # in order

    def add(self, event: Activation) -> None:
        self.count += 1
        self.longest = max(self.longest, event.finished - event.released)
        late = bool(self._last) and event.released < self._last[-1]
        if late:  # due before the one before it: taken as if all since had been released with it
            kept = [min(one, event.released) for one in self._last]
            self._last = deque(kept, maxlen=IN_A_ROW + 1)
        self._last.append(event.released)
        recent = list(self._last)
        for end in range(len(recent) - 1, 0 if late else len(recent) - 2, -1):
            self._look_back(recent, end)

    def _look_back(self, recent: list[Ns], end: int) -> None:
        spans = self.spans
        for back in range(1, end + 1):
            span = recent[end] - recent[end - back]
            if back > len(spans):
                spans.append(span)
            elif span < spans[back - 1]:
                spans[back - 1] = span

    def curve(self, period: Ns) -> tuple[Ns, ...]:
        """The least times that 2, 3, ... releases take; empty if nothing can be said."""
        promised = [period * (one + 1) for one in range(len(self.spans) or 1)] if period > 0 else []
        if not promised:
            spans = tuple(self.spans) if self.count >= LEAST_RELEASES else ()
        else:
            spans = tuple(map(min, promised, self.spans)) if self.spans else tuple(promised)
        return spans if spans and spans[-1] > 0 else ()


class _Work:
    """What a component's flows of control executed on one processor."""

    def __init__(self) -> None:
        self.since: Ns = 0  # executed since the last activation ended
        self.costs: list[Ns] = []
        self.places: dict[str, None] = {}  # the components it computed in, in order
        self._last: deque[Ns] = deque(maxlen=IN_A_ROW)

    def ended(self) -> None:
        self._last.append(self.since)
        self.since = 0
        executed = 0
        for number, cost in enumerate(reversed(self._last)):
            executed += cost
            if number >= len(self.costs):
                self.costs.append(executed)
            elif executed > self.costs[number]:
                self.costs[number] = executed


class Demands:
    """Give it all slices and activations, then ask for ``bounds``."""

    def __init__(self) -> None:
        self._work: dict[str, dict[str, _Work]] = {}  # by whose flows of control they are, and processor
        self._releases: dict[str, _Releases] = {}
        self._windows: dict[tuple[str, str], tuple[int, Ns]] = {}  # by processor and owner: window, in it
        self._most: dict[tuple[str, str], Ns] = {}

    def slice(self, event: Slice) -> None:
        """A task executed on a processor."""
        owner = _owner(event.task)
        where = self._work.setdefault(owner, {})
        work = where.get(event.processor)
        if work is None:
            work = where[event.processor] = _Work()
        work.since += event.end - event.start
        work.places[event.component] = None
        self._in_windows((event.processor, owner), event.start, event.end)

    def _in_windows(self, who: tuple[str, str], start: Ns, end: Ns) -> None:
        while start < end:
            window = start // WINDOW
            until = min(end, (window + 1) * WINDOW)
            before = self._windows.get(who, (window, 0))
            executed = until - start + (before[1] if before[0] == window else 0)
            self._windows[who] = window, executed
            self._most[who] = max(self._most.get(who, 0), executed)
            start = until

    def activation(self, event: Activation) -> None:
        """An activation ended: what was executed since the one before belongs to it."""
        self._releases.setdefault(event.component, _Releases()).add(event)
        for work in self._work.get(event.component, {}).values():
            work.ended()

    def bounds(
        self, processor: ProcessorSetup, components: dict[str, ComponentSetup]
    ) -> dict[str, Ns | None]:
        """Of the active components on *processor*; none under another scheduler than fixed priorities.

        ``None`` also for one that was seen to take longer: it waits for something that the analysis does not
        know. As the more urgent of others it counts by what it was seen to execute.
        """
        if processor.scheduler != FIXED_PRIORITY:
            return {}
        here = {name: where[processor.name] for name, where in self._work.items() if processor.name in where}
        executed = {name: Load(self._most.get((processor.name, name), 0)) for name in here}
        known = {
            name: demand
            for name, work in here.items()
            if (demand := self._demand(name, work, components)) is not None
        }
        waiting: dict[str, Ns | None] = {}
        while True:
            loads = [load for name, load in executed.items() if name not in known]
            found = response_bounds(known.values(), loads, processor.cores, executed)
            broken = [
                name for name, bound in found.items() if bound is not None and self._broken(name, bound)
            ]
            if not broken:
                return {**found, **waiting}
            for name in broken:
                waiting[name] = None
                del known[name]

    def _broken(self, name: str, bound: Ns) -> bool:
        return bound < self._releases[name].longest

    def _demand(self, name: str, work: _Work, components: dict[str, ComponentSetup]) -> Demand | None:
        """``None`` for what has no activations, too few of them, or computes on other processors as well."""
        setup, releases = components.get(name), self._releases.get(name)
        if setup is None or releases is None or len(self._work[name]) > 1 or not any(work.costs):
            return None
        spans = releases.curve(setup.period)
        if not spans:
            return None
        visited = [one for place in work.places if (one := components.get(place)) is not None]
        priorities = [setup.priority, *(one.priority for one in visited if one.active)]
        return Demand(name, max(priorities), tuple(work.costs), spans, min(priorities))


def _owner(task: str) -> str:
    """The component whose flow of control it is: ``drone/mavros`` of ``drone/mavros (set-points)``."""
    return task if task.endswith(BACKGROUND) else task.partition(" (")[0]
