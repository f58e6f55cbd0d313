"""Bounds of response times by analysis, to stand beside the longest ones that were simulated.

A simulation shows what happened; analysis bounds what could, had releases fallen as unluckily as they may.
For tasks under preemptive fixed priorities, over the windows in which a task is busy (Lehoczky, *Fixed
Priority Scheduling of Periodic Task Sets with Arbitrary Deadlines*, RTSS 1990): the q-th activation in such a
window ends after no more than the least w with w = C(q) + interference within w, and was released no sooner
than the least span of q releases, D(q).

* one core: the interference is the sum of what the more urgent execute whose releases fall into w (Joseph and
  Pandya, *Finding Response Times in a Real-Time System*, The Computer Journal 29(5), 1986);
* m cores that tasks move between: (sum over the more urgent of min(W, w - C(q))) / m, W being the most that
  one of them executes in w, with what it brings along from before (after Bertogna and Cirinei, *Response-Time
  Analysis for Globally Scheduled Symmetric Multiprocessor Platforms*, RTSS 2007).

C(q) is the most that q activations in a row executed, D(q) the shortest time that q releases took (curves of
events, as in Richter and Ernst, *Event Model Interfaces for Heterogeneous System Analysis*, DATE 2002), so a
bound is as good as what the run went through. Tasks of equal priority count as more urgent. What is executed
outside activations counts as more urgent, too, by the most that was seen in any ``WINDOW``. Waiting for
messages, networks and locks is not in it.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from volery.base.time import MS, US, Ns

WINDOW: Ns = 10 * MS


STEP: Ns = 10 * US
"""A bound on several cores is found to so much: it is looked for in steps, from below."""

MOST_STEPS = 4000
"""After so many it is given up: the cores are as good as full."""

MOST_ACTIVATIONS = 64
"""In a window in which a task is busy; it is given up after so many."""


@dataclass(frozen=True)
class Demand:
    """A task: ``costs`` are the most that 1, 2, ... activations in a row execute, ``spans`` the least times
    that 2, 3, ... releases take, the last of them above 0. Longer rows are put together from these.

    ``least_priority`` is that of the least urgent place it computes at: a task that calls a less urgent
    component waits as one of its priority.
    """

    name: str
    priority: int
    costs: tuple[Ns, ...]
    spans: tuple[Ns, ...]
    least_priority: int

    @classmethod
    def periodic(cls, name: str, priority: int, cost: Ns, period: Ns) -> Demand:
        """One whose activations all execute *cost*, released no sooner after each other than *period*."""
        return cls(name, priority, (cost,), (period,), priority)

    def cost(self, activations: int) -> Ns:
        """The most that so many in a row execute."""
        rows, rest = divmod(activations, len(self.costs))
        return rows * self.costs[-1] + (self.costs[rest - 1] if rest else 0)

    def span(self, releases: int) -> Ns:
        """The least time from a release to the one that comes so many later."""
        rows, rest = divmod(releases, len(self.spans))
        return rows * self.spans[-1] + (self.spans[rest - 1] if rest else 0)

    def released_within(self, window: Ns) -> int:
        """The most releases in any half-open *window*."""
        if window <= 0:
            return 0
        rows, rest = divmod(window - 1, self.spans[-1])
        return 1 + rows * len(self.spans) + bisect_right(self.spans, rest)


@dataclass(frozen=True)
class Load:
    """Computing that is no activation: the most in any window of ``WINDOW``, all cores together."""

    most: Ns

    def within(self, span: Ns) -> Ns:
        """The most in any *span*, which may touch one window more at either end."""
        return (span // WINDOW + 2) * self.most


def response_bounds(
    tasks: Iterable[Demand],
    loads: Sequence[Load],
    cores: int,
    executed: Mapping[str, Load] | None = None,
) -> dict[str, Ns | None]:
    """The bound of each task on a processor, ``None`` where none was found.

    *executed* is, by task, what it was seen to execute: it stands in for a task on several cores that has no
    bound (yet) itself. Without it, all of its time is taken.
    """
    seen = {} if executed is None else executed
    bounds: dict[str, Ns | None] = {}
    every = sorted(tasks, key=lambda one: -one.priority)
    for task in every:
        urgent = [one for one in every if one is not task and one.priority >= task.least_priority]
        if cores == 1:
            bounds[task.name] = _bound(task, _OneCore(urgent, loads))
            continue
        known = [(one, bound) for one in urgent if (bound := bounds.get(one.name)) is not None]
        others = [seen.get(one.name, Load(WINDOW)) for one in urgent if bounds.get(one.name) is None]
        bounds[task.name] = _bound(task, _Cores(known, [*loads, *others], cores))
    return bounds


@dataclass(frozen=True)
class _OneCore:
    urgent: Sequence[Demand]
    loads: Sequence[Load]

    def interference(self, window: Ns, own: Ns) -> Ns:
        executed = sum(one.cost(one.released_within(window)) for one in self.urgent)
        return executed + sum(min(load.within(window), window) for load in self.loads)


@dataclass(frozen=True)
class _Cores:
    urgent: Sequence[tuple[Demand, Ns]]
    loads: Sequence[Load]
    cores: int

    def interference(self, window: Ns, own: Ns) -> Ns:
        room = window - own + STEP
        work = [one.cost(one.released_within(window + bound)) for one, bound in self.urgent]
        work += [load.within(window) // self.cores for load in self.loads for _ in range(self.cores)]
        return sum(min(one, room) for one in work) // self.cores


def _bound(task: Demand, others: _OneCore | _Cores) -> Ns | None:
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
