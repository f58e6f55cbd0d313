"""Bounds of response times by analysis, to stand beside the longest ones that were simulated.

A simulation shows what happened; analysis bounds what could, had releases fallen as unluckily as they may.
For tasks under preemptive fixed priorities:

* one core (Joseph and Pandya, *Finding Response Times in a Real-Time System*, The Computer Journal 29(5),
  1986): the least R with R = C + sum over the more urgent of ceil(R / T) C;
* m cores that tasks move between (Bertogna and Cirinei, *Response-Time Analysis for Globally Scheduled
  Symmetric Multiprocessor Platforms*, RTSS 2007): R = C + (sum over the more urgent of min(W, R - C)) / m, W
  being the most that one of them can execute in R.

C is the longest that an activation was seen to execute and T the shortest time between two releases, so a
bound is as good as what the run went through. Tasks of equal priority count as more urgent. What is executed
outside activations counts as more urgent, too, by the most that was seen in any ``WINDOW``. Waiting for
messages, networks and locks is not in it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from volery.base.time import MS, US, Ns

WINDOW: Ns = 10 * MS


STEP: Ns = 10 * US
"""A bound on several cores is found to so much: it is looked for in steps, from below."""

MOST_STEPS = 2000
"""After so many it is given up: the cores are as good as full."""


@dataclass(frozen=True)
class Demand:
    """A task: what an activation executes, and the least time between its releases."""

    name: str
    priority: int
    cost: Ns
    period: Ns


@dataclass(frozen=True)
class Load:
    """Computing that is no activation: the most in any window of ``WINDOW``, all cores together."""

    most: Ns

    def within(self, span: Ns) -> Ns:
        """The most in any *span*, which may touch one window more at either end."""
        return (span // WINDOW + 2) * self.most


def response_bounds(tasks: Iterable[Demand], loads: Sequence[Load], cores: int) -> dict[str, Ns | None]:
    """The bound of each task on a processor, ``None`` where it may be longer than the period."""
    bounds: dict[str, Ns | None] = {}
    urgent: list[Demand] = []
    for task in sorted(tasks, key=lambda one: -one.priority):
        equals = [one for one in tasks if one.priority == task.priority and one is not task]
        more = [one for one in urgent if one.priority > task.priority] + equals
        bounds[task.name] = _bound(task, more, bounds, loads, cores)
        urgent.append(task)
    return bounds


def _bound(
    task: Demand, urgent: Sequence[Demand], bounds: dict[str, Ns | None], loads: Sequence[Load], cores: int
) -> Ns | None:
    response = task.cost
    for _ in range(MOST_STEPS):
        if response > task.period:
            break
        if cores == 1:
            interference = sum(-(-response // one.period) * one.cost for one in urgent)
            interference += sum(min(load.within(response), response) for load in loads)
        else:
            room = response - task.cost + STEP
            work = [_work(one, bounds.get(one.name) or one.period, response) for one in urgent]
            work += [load.within(response) // cores for load in loads for _ in range(cores)]
            interference = sum(min(one, room) for one in work) // cores
        longer = task.cost + interference
        if longer <= response:
            return response
        response = longer
    return None


def _work(task: Demand, response: Ns, span: Ns) -> Ns:
    """The most that *task*, whose own response takes no longer than *response*, executes in any *span*."""
    since = span + response - task.cost
    whole = since // task.period
    return whole * task.cost + min(task.cost, since - whole * task.period)
