"""Response-time bounds under EDF, under FIFO and in ROS 2 executors, by the busy-window principle.

``volery.requirements.response_bounds`` has fixed priorities. What is common here: from an instant at which
nothing waits, all demand in a window is served before a second such instant at most a busy window later; it
is enough to examine the offsets within it at which the demand of the task under analysis has a step.

* EDF: Spuri, *Analysis of Deadline Scheduled Real-Time Systems*, INRIA RR-2772, 1996, for any arrival curve
  after Bozhko and Brandenburg, *Abstract Response-Time Analysis*, ECRTS 2020.
* FIFO: Bedarkar et al., *From Intuition to Coq: Response-Time Analysis of FIFO*, RTSS 2022. The executors of
  ``volery.ros.client_libraries.rclpy`` and the events executor of rclcpp take callbacks in this order.
* rclcpp's default executor, which takes timers first and samples all others at polling points: Casini et al.,
  *Response-Time Analysis of ROS 2 Processing Chains under Reservation-Based Scheduling*, ECRTS 2019.

A demand is a ``TaskDemand``: the most that n activations execute and the least time that n releases span.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from volery.base.time import Ns
from volery.requirements.response_bounds import ManyCores, OneCore, TaskDemand

MOST_ITERATIONS = 20_000
"""A search ends without a bound after so many steps: the processor is full, or nearly."""
MOST_OFFSETS = 20_000
"""A search ends without a bound after so many offsets in one busy window."""
_INSTANT: Ns = 1
"""The length of a closed window [A, A]."""


def requested(demand: TaskDemand, window: Ns) -> Ns:
    """Return the most execution time that is released in any half-open *window*, ns."""
    return demand.cost(demand.released_within(window))


def requested_by_all(demands: Iterable[TaskDemand], window: Ns) -> Ns:
    """Return the most execution time of all *demands* that is released in any half-open *window*, ns."""
    return sum(requested(demand, window) for demand in demands)


def rate(demand: TaskDemand) -> float:
    """Return the long-term share of one core that *demand* takes."""
    return demand.costs[-1] / len(demand.costs) * len(demand.spans) / demand.spans[-1]


# -- what a processor serves


class LeastSupply(Protocol):
    """What a flow of control gets of a core, at least."""

    def time_for(self, service: Ns) -> Ns | None:
        """Return the longest time in which *service* ns are served, None if there is no limit."""


class Dedicated:
    """A core of its own."""

    def time_for(self, service: Ns) -> Ns | None:
        """See ``LeastSupply``."""
        return service


@dataclass(frozen=True)
class PeriodicReservation:
    """*budget* in each *period*, anywhere in it (Shin and Lee, RTSS 2003), as of ``SCHED_DEADLINE``."""

    period: Ns
    budget: Ns

    def time_for(self, service: Ns) -> Ns | None:
        """See ``LeastSupply``."""
        if service <= 0:
            return 0
        whole, rest = divmod(service - 1, self.budget)
        gap = self.period - self.budget
        return 2 * gap + whole * self.period + rest + 1


@dataclass(frozen=True)
class LeftOver:
    """What more urgent tasks under preemptive fixed priorities leave to a thread that is always ready."""

    others: OneCore | ManyCores

    def time_for(self, service: Ns) -> Ns | None:
        """See ``LeastSupply``."""
        return _least(service, lambda window: service + self.others.interference(window, service))


def _least(start: Ns, right_side: Callable[[Ns], Ns | None]) -> Ns | None:
    """Return the least fixed point of a growing function from *start*; None if none was found."""
    window = max(start, _INSTANT)
    for _ in range(MOST_ITERATIONS):
        longer = right_side(window)
        if longer is None or longer <= window:
            return None if longer is None else window
        window = longer
    return None


# -- EDF and FIFO on one core


@dataclass(frozen=True)
class DeadlineTask:
    """A task under EDF; *deadline* is relative to its release, ns."""

    demand: TaskDemand
    deadline: Ns


def edf_bounds(tasks: Sequence[DeadlineTask]) -> dict[str, Ns | None]:
    """Return the response-time bound of each task under preemptive EDF on one core, None without one.

    Ties of deadlines are taken as lost by the task under analysis.
    """
    everything = [task.demand for task in tasks]
    busy = _busy_window(everything, Dedicated())
    return {task.demand.name: None if busy is None else _edf_bound(task, tasks, busy) for task in tasks}


def _edf_bound(task: DeadlineTask, tasks: Sequence[DeadlineTask], busy: Ns) -> Ns | None:
    others = [one for one in tasks if one is not task]
    offsets = set(_steps(task.demand, busy))
    for other in others:
        shift = other.deadline - task.deadline
        offsets.update(max(0, at + shift) for at in _steps(other.demand, busy - shift))
    if len(offsets) > MOST_OFFSETS:
        return None
    longest = 0
    for offset in sorted(offset for offset in offsets if offset < busy):
        own = requested(task.demand, offset + _INSTANT)
        until = [(other.demand, offset + _INSTANT + task.deadline - other.deadline) for other in others]
        end = _least(
            own,
            lambda window, own=own, until=until: (  # type: ignore[misc]  # defaults bind the loop's values
                own + sum(requested(demand, min(window, latest)) for demand, latest in until)
            ),
        )
        if end is None:
            return None
        longest = max(longest, end - offset)
    return longest


def fifo_bound(demands: Sequence[TaskDemand]) -> Ns | None:
    """Return the response-time bound that all *demands* share on one core in order of release."""
    busy = _busy_window(demands, Dedicated())
    if busy is None:
        return None
    offsets = {at for demand in demands for at in _steps(demand, busy)}
    if len(offsets) > MOST_OFFSETS:
        return None
    return max((requested_by_all(demands, at + _INSTANT) - at for at in offsets), default=0)


def _busy_window(demands: Sequence[TaskDemand], supply: LeastSupply, more: Ns = 0) -> Ns | None:
    if sum(map(rate, demands)) > 1.0:
        return None
    return _least(_INSTANT, lambda window: supply.time_for(more + requested_by_all(demands, window)))


def _steps(demand: TaskDemand, until: Ns) -> Iterator[Ns]:
    """Yield the offsets below *until* at which one more activation may be released."""
    for releases in range(MOST_OFFSETS + 1):
        at = demand.span(releases)
        if at >= until:
            return
        yield at


# -- executors of ROS 2


@dataclass(frozen=True)
class Callback:
    """A callback of an executor: its demand, and whether it is a timer's. Earlier timers come first."""

    demand: TaskDemand
    timer: bool = False


def executor_bounds(callbacks: Sequence[Callback], supply: LeastSupply) -> dict[str, Ns | None]:
    """Return the response-time bounds of callbacks of one single-threaded executor of rclcpp.

    A timer waits for one other callback that has begun, and for the timers that were created before it; any
    other callback for all that is released before it starts. Callbacks that only this executor runs and that
    never wait are assumed.
    """
    bounds: dict[str, Ns | None] = {}
    urgent: list[TaskDemand] = []
    for callback in callbacks:
        others = [each.demand for each in callbacks if each is not callback]
        if callback.timer:
            rest = [other.cost(1) for other in others if other not in urgent]
            bounds[callback.demand.name] = callback_bound(
                callback.demand, urgent, supply, max(rest, default=0)
            )
            urgent.append(callback.demand)
        else:
            bounds[callback.demand.name] = callback_bound(callback.demand, others, supply)
    return bounds


def callback_bound(
    own: TaskDemand,
    before: Sequence[TaskDemand],
    supply: LeastSupply,
    blocking: Ns = 0,
    steps: TaskDemand | None = None,
) -> Ns | None:
    """Return the response-time bound of a callback that is not preempted within its executor.

    Lemma 3 (timers) and Lemmas 4 and 5 (all others) of Casini et al.; Lemma 8 for the last callback of a
    chain, with the callbacks in front of it among *before* and the demand of the whole chain as *steps*.

    Args:
        own: The callback.
        before: What may run between its release and its start.
        supply: What the executor's thread gets of a core.
        blocking: The longest callback that may have begun when it is released, ns.
        steps: The demand whose steps are examined; by default *own*.
    """
    busy = _busy_window([own, *before], supply, blocking)
    if busy is None:
        return None
    cost, longest = own.cost(1), 0
    for offset in _steps(steps or own, busy + _INSTANT):
        response = _INSTANT
        for _ in range(MOST_ITERATIONS):
            reach = offset + max(0, response - cost) + _INSTANT
            work = requested(own, offset + _INSTANT) + requested_by_all(before, reach) + blocking
            end = supply.time_for(work)
            if end is None or end - offset <= response:
                break
            response = end - offset
        else:
            return None
        if end is None:
            return None
        longest = max(longest, end - offset)
    return longest
