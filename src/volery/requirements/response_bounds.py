"""Bounds of response times by analysis, for comparison with the longest simulated ones.

A simulation shows what happened; analysis bounds what could have happened with the worst releases. For tasks
under preemptive fixed priorities, over the windows in which a task is busy (Lehoczky, *Fixed Priority
Scheduling of Periodic Task Sets with Arbitrary Deadlines*, RTSS 1990): the q-th activation in such a window
ends after no more than the least w with w = C(q) + interference within w, and was released no sooner than the
least span of q releases, D(q).

* one core: the interference is the sum of the execution times of more urgent tasks whose releases fall into w
  (Joseph and Pandya, *Finding Response Times in a Real-Time System*, The Computer Journal 29(5), 1986);
* m cores with migration: (sum over the more urgent of min(W, w - C(q))) / m, W being the most that one
  executes in w, including its carried-in work (after Bertogna and Cirinei, *Response-Time Analysis for
  Globally Scheduled Symmetric Multiprocessor Platforms*, RTSS 2007).

C(q) is the most that q activations in a row executed, D(q) the shortest time that q releases took (event
curves, as in Richter and Ernst, *Event Model Interfaces for Heterogeneous System Analysis*, DATE 2002), for q
up to ``IN_A_ROW``; so a bound covers what the run went through. A period that the model promises is taken for
the distance of releases unless they were faster. All flows of control of a component count as one. Tasks of
equal priority count as more urgent, and so does execution outside activations, by its greatest amount in any
``WINDOW``. Waiting for messages, networks and locks is not included.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from volery.base.time import MS, US, Ns
from volery.trace.attachments import ComponentSetup, ProcessorSetup
from volery.trace.events import Activation, Slice

WINDOW: Ns = 10 * MS


STEP: Ns = 10 * US
"""Resolution of a bound on several cores: the search goes in steps, from below."""

MOST_STEPS = 4000
"""The search ends without a bound after so many steps: the cores are nearly full."""

MOST_ACTIVATIONS = 64
"""The search ends without a bound after so many activations in one busy window."""


JITTERED_ROW = 64
"""Releases with jitter whose spans are exact; in longer rows the jitter counts again every so many."""


@dataclass(frozen=True)
class TaskDemand:
    """The demand of a task.

    ``costs`` are the most that 1, 2, ... activations in a row execute, ``spans`` the least times that 2, 3,
    ... releases take, the last of them above 0. Longer rows are put together from these. ``least_priority``
    is that of the least urgent component it computes in: a task that calls a less urgent component waits with
    that priority.
    """

    name: str
    priority: int
    costs: tuple[Ns, ...]
    spans: tuple[Ns, ...]
    least_priority: int

    @classmethod
    def periodic(cls, name: str, priority: int, cost: Ns, period: Ns, jitter: Ns = 0) -> TaskDemand:
        """Return the demand of activations of *cost*, due a *period* apart, each up to *jitter* late."""
        rows = JITTERED_ROW + jitter // period if jitter else 1
        spans = tuple(max(0, number * period - jitter) for number in range(1, rows + 1))
        return cls(name, priority, (cost,), spans, priority)

    def cost(self, activations: int) -> Ns:
        """Return the most that *activations* in a row execute."""
        rows, rest = divmod(activations, len(self.costs))
        return rows * self.costs[-1] + (self.costs[rest - 1] if rest else 0)

    def span(self, releases: int) -> Ns:
        """Return the least time that *releases* releases take."""
        rows, rest = divmod(releases, len(self.spans))
        return rows * self.spans[-1] + (self.spans[rest - 1] if rest else 0)

    def released_within(self, window: Ns) -> int:
        """Return the most releases in any half-open *window*."""
        if window <= 0:
            return 0
        rows, rest = divmod(window - 1, self.spans[-1])
        return 1 + rows * len(self.spans) + bisect_right(self.spans, rest)


@dataclass(frozen=True)
class BackgroundLoad:
    """Execution outside activations: the most in any window of ``WINDOW``, all cores together."""

    most: Ns

    def within(self, span: Ns) -> Ns:
        """Return the most in any *span*, which may touch one window more at either end."""
        return (span // WINDOW + 2) * self.most


def response_bounds(
    tasks: Iterable[TaskDemand],
    loads: Sequence[BackgroundLoad],
    cores: int,
    executed: Mapping[str, BackgroundLoad] | None = None,
) -> dict[str, Ns | None]:
    """Return the bound of each task on a processor, None where none was found.

    *executed* is, by task, what it was seen to execute: it stands in for a task on several cores that has no
    bound (yet) itself. Without it, all of its time is taken.
    """
    seen = {} if executed is None else executed
    bounds: dict[str, Ns | None] = {}
    every = sorted(tasks, key=lambda one: -one.priority)
    for task in every:
        urgent = [one for one in every if one is not task and one.priority >= task.least_priority]
        if cores == 1:
            bounds[task.name] = bound_of(task, OneCore(urgent, loads))
            continue
        known = [(one, bound) for one in urgent if (bound := bounds.get(one.name)) is not None]
        others = [
            seen.get(one.name, BackgroundLoad(WINDOW)) for one in urgent if bounds.get(one.name) is None
        ]
        bounds[task.name] = bound_of(task, ManyCores(known, [*loads, *others], cores))
    return bounds


@dataclass(frozen=True)
class OneCore:
    """Interference on one core: more urgent tasks, and loads."""

    urgent: Sequence[TaskDemand]
    loads: Sequence[BackgroundLoad]

    def interference(self, window: Ns, own: Ns) -> Ns:
        """Return the most in a *window* in which the task executes *own*, ns."""
        executed = sum(one.cost(one.released_within(window)) for one in self.urgent)
        return executed + sum(min(load.within(window), window) for load in self.loads)


@dataclass(frozen=True)
class ManyCores:
    """Interference on several cores: more urgent tasks with their bounds, and loads."""

    urgent: Sequence[tuple[TaskDemand, Ns]]
    loads: Sequence[BackgroundLoad]
    cores: int

    def interference(self, window: Ns, own: Ns) -> Ns:
        """Return the most in a *window* in which the task executes *own*, ns."""
        room = window - own + STEP
        work = [one.cost(one.released_within(window + bound)) for one, bound in self.urgent]
        work += [load.within(window) // self.cores for load in self.loads for _ in range(self.cores)]
        return sum(min(one, room) for one in work) // self.cores


def bound_of(task: TaskDemand, others: OneCore | ManyCores) -> Ns | None:
    """Return the bound of one task, None where none was found."""
    longest = window = steps = 0
    for activations in range(1, MOST_ACTIVATIONS + 1):
        own = task.cost(activations)
        window = max(window, own)
        while (longer := own + others.interference(window, own)) > window:
            window, steps = longer, steps + 1
            if steps > MOST_STEPS:
                return None
        longest = max(longest, window - task.span(activations - 1))
        if window <= task.span(activations):
            return longest
    return None


FIXED_PRIORITY = "fixed-priority"
IN_A_ROW = 16
"""Activations in a row that are compared."""
LEAST_RELEASES = 10
"""With fewer releases, their spans are unknown unless the model promises a period."""
BACKGROUND = " (background)"
"""Ends the name of what is executed beside a component's own flows of control."""


class _Releases:
    """Spans of releases and longest response time of a component's activations."""

    def __init__(self) -> None:
        self.count = 0
        self.longest: Ns = 0
        self.spans: list[Ns] = []
        self._last: list[Ns] = []  # in order

    def add(self, event: Activation) -> None:
        released, last = event.released, self._last
        self.count += 1
        self.longest = max(self.longest, event.finished - released)
        late = bool(last) and released < last[-1]
        if late:  # due before the one before it: taken as if all since had been released with it
            last = self._last = [min(one, released) for one in last]
        last.append(released)
        if len(last) > IN_A_ROW + 1:
            del last[0]
        for end in range(len(last) - 1, 0 if late else len(last) - 2, -1):
            self._shorten(last, end)

    def _shorten(self, last: list[Ns], end: int) -> None:
        """Take the spans that end with the release at index *end*, where they are shorter."""
        spans = self.spans
        for row in range(end):
            span = last[end] - last[end - 1 - row]
            if row == len(spans):
                spans.append(span)
            elif span < spans[row]:
                spans[row] = span

    def curve(self, period: Ns) -> tuple[Ns, ...]:
        """Return the least times that 2, 3, ... releases take; empty if they are unknown."""
        promised = [period * (one + 1) for one in range(len(self.spans) or 1)] if period > 0 else []
        if not promised:
            spans = tuple(self.spans) if self.count >= LEAST_RELEASES else ()
        else:
            spans = tuple(map(min, promised, self.spans)) if self.spans else tuple(promised)
        return spans if spans and spans[-1] > 0 else ()


class _Work:
    """Execution times of a component's flows of control on one processor."""

    def __init__(self) -> None:
        self.since: Ns = 0  # executed since the last activation ended
        self.costs: list[Ns] = []
        self.places: dict[str, None] = {}  # the components it computed in, in order
        self.most: Ns = 0  # executed in one window
        self._window = 0  # the latest one in which it executed
        self._within: Ns = 0  # executed in it so far
        self._last: list[Ns] = []

    def executed(self, start: Ns, end: Ns) -> None:
        """Add what was executed from *start* to *end* to its windows."""
        while start < end:
            window = start // WINDOW
            until = end if end // WINDOW == window else (window + 1) * WINDOW
            within = until - start + (self._within if self._window == window else 0)
            self._window, self._within = window, within
            self.most = max(self.most, within)
            start = until

    def ended(self) -> None:
        last, costs, total = self._last, self.costs, 0
        last.append(self.since)
        if len(last) > IN_A_ROW:
            del last[0]
        self.since = 0
        for row in range(len(last)):
            total += last[-1 - row]
            if row == len(costs):
                costs.append(total)
            elif total > costs[row]:
                costs[row] = total


class Demands:
    """Demands of all components, from the slices and activations of a run; see ``bounds``."""

    def __init__(self) -> None:
        self._work: dict[str, dict[str, _Work]] = {}  # by whose flows of control they are, and processor
        self._releases: dict[str, _Releases] = {}
        self._owners: dict[str, str] = {}  # by the names of tasks

    def slice(self, event: Slice) -> None:
        """Add a slice of a task."""
        start, end, processor, _, task, component = event
        owner = self._owners.get(task)
        if owner is None:  # the component of the task: drone/mavros for "drone/mavros (set-points)"
            owner = self._owners[task] = task if task.endswith(BACKGROUND) else task.partition(" (")[0]
            self._work.setdefault(owner, {})
        where = self._work[owner]
        work = where.get(processor)
        if work is None:
            work = where[processor] = _Work()
        work.since += end - start
        work.places[component] = None
        work.executed(start, end)

    def activation(self, event: Activation) -> None:
        """Add an activation that ended: what was executed since the one before belongs to it."""
        releases = self._releases.get(event.component)
        if releases is None:
            releases = self._releases[event.component] = _Releases()
        releases.add(event)
        for work in self._work.get(event.component, {}).values():
            work.ended()

    def bounds(
        self, processor: ProcessorSetup, components: dict[str, ComponentSetup]
    ) -> dict[str, Ns | None]:
        """Return the bounds of the active components on *processor*; none unless it has fixed priorities.

        ``None`` also for one that was seen to take longer: it waits for something that the analysis does not
        know. As the more urgent of others it counts by what it was seen to execute.
        """
        if processor.scheduler != FIXED_PRIORITY:
            return {}
        here = {name: where[processor.name] for name, where in self._work.items() if processor.name in where}
        executed = {name: BackgroundLoad(work.most) for name, work in here.items()}
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

    def _demand(self, name: str, work: _Work, components: dict[str, ComponentSetup]) -> TaskDemand | None:
        """Return the demand of a task, None for too few activations or several processors."""
        setup, releases = components.get(name), self._releases.get(name)
        if setup is None or releases is None or len(self._work[name]) > 1 or not any(work.costs):
            return None
        spans = releases.curve(setup.period)
        if not spans:
            return None
        visited = [one for place in work.places if (one := components.get(place)) is not None]
        priorities = [setup.priority, *(one.priority for one in visited if one.active)]
        return TaskDemand(name, max(priorities), tuple(work.costs), spans, min(priorities))
