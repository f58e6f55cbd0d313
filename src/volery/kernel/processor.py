"""Cores as contended resources: they serve amounts of target time, whatever for and whoever set the price.

Schedulers:

* ``fixed-priority``: the most urgent jobs run, at once; among equals the first (SCHED_FIFO of POSIX).
* ``round-robin``: priorities do not count; whoever has run for a *quantum* goes to the back if others wait.
* ``fifo``: priorities do not count; first come, first served, to the end.

A job keeps its core while it runs and takes the free core of lowest number when it starts or goes on. Putting
a job on a core that served somebody else last takes *context_switch* of that core first, which the job's
slices contain.
"""

from __future__ import annotations

from bisect import insort
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import MS, Ns
from volery.kernel.task import ExecutionContext, Task
from volery.kernel.virtual import FOREVER, VirtualKernel
from volery.trace.events import Preemption, Slice

if TYPE_CHECKING:
    from collections.abc import Callable

    from volery.kernel.api import Handle

NO_CORE = -1

QUANTUM: Ns = 10 * MS
"""The usual time slice of round-robin."""


@dataclass(eq=False, slots=True)
class Job:
    """An amount of computing that wants a core."""

    owner: Task | ExecutionContext  # a place: computing in the background, nobody waits for it
    name: str
    component: str
    priority: int
    arrival: int
    remaining: Ns
    core: int = NO_CORE
    started: Ns = 0
    turn_ends: Ns = 0
    timer: Handle | None = None
    done: bool = False


Order = tuple[int, int]


def _by_priority(job: Job) -> Order:
    return -job.priority, job.arrival


def _by_arrival(job: Job) -> Order:
    return 0, job.arrival


SCHEDULERS: dict[str, Callable[[Job], Order]] = {
    "fixed-priority": _by_priority,
    "round-robin": _by_arrival,
    "fifo": _by_arrival,
}


class Processor:
    """A ``Server`` with *cores* equal cores under one *scheduler*."""

    def __init__(
        self,
        kernel: VirtualKernel,
        name: str,
        *,
        cores: int = 1,
        scheduler: str = "fixed-priority",
        quantum: Ns = QUANTUM,
        context_switch: Ns = 0,
    ) -> None:
        if scheduler not in SCHEDULERS:
            hint = did_you_mean(scheduler, SCHEDULERS)
            raise UsageError(f"{name}: no scheduler {scheduler!r}{hint}; there is {choices(SCHEDULERS)}")
        if cores < 1 or quantum < 1 or context_switch < 0:
            raise UsageError(
                f"{name}: cores {cores} and quantum {quantum} ns must be at least 1, "
                f"context switch {context_switch} ns at least 0"
            )
        self._kernel, self.name, self.cores = kernel, name, cores
        self._order = SCHEDULERS[scheduler]
        self._quantum = quantum if scheduler == "round-robin" else FOREVER
        self._context_switch = context_switch
        self._jobs: list[Job] = []  # the first ``cores`` of them run
        self._free = list(range(cores))
        self._last: list[Task | ExecutionContext | None] = [None] * cores  # whom a core served last
        self._background: dict[ExecutionContext, Job] = {}
        self._arrivals = 0
        self._busy: Ns = 0

    def busy_ns(self, now: Ns) -> Ns:
        """Time that cores have been busy until *now*, summed over the cores."""
        return self._busy + sum(now - job.started for job in self._jobs if job.core != NO_CORE)

    # -- what is asked of it

    def serve(self, task: Task, amount: Ns) -> None:
        """Block *task* until *amount* has been executed for it, at the priority that it has now."""
        if amount <= 0 or (not self._jobs and self._serve_alone(task, amount)):
            return
        job = self._arrive(Job(task, task.name, task.place.component, task.priority, 0, amount))
        try:
            while not job.done:
                self._kernel.park(None, self.name)
        finally:
            if not job.done:
                self._leave(job)

    def _serve_alone(self, task: Task, amount: Ns) -> bool:
        """The short way: nobody else computes, and nothing happens anywhere until the end."""
        start = self._kernel.now()
        total = amount if self._last[0] is task else amount + self._context_switch
        if not self._kernel.leap(start + total):
            return False
        self._last[0] = task
        self._busy += total
        self._kernel.record(Slice(start, start + total, self.name, 0, task.name, task.place.component))
        return True

    def load(self, place: ExecutionContext, amount: Ns) -> None:
        """Execute *amount* in the background of *place*: one thread, at the priority of the place."""
        if amount <= 0:
            return
        job = self._background.get(place)
        if job is None:
            name = f"{place.component} (background)"
            job = Job(place, name, place.component, place.priority or 0, 0, amount)
            self._background[place] = job
            self._arrive(job)
        else:
            job.remaining += amount
            if job.core != NO_CORE:
                self._set_timer(job)

    # -- who runs

    def _arrive(self, job: Job) -> Job:
        self._arrivals += 1
        job.arrival = self._arrivals
        insort(self._jobs, job, key=self._order)
        self._make_way(job.name)
        self._dispatch()
        return job

    def _make_way(self, urgent: str) -> None:
        """Who has a core and no right to it any more stops for *urgent*, who has just come."""
        for job in self._jobs[self.cores :]:
            if job.core != NO_CORE:
                core = job.core
                self._stop(job)
                if job.remaining == 0:  # it would have ended at this very instant
                    self._complete(job)
                else:
                    self._kernel.record(Preemption(self._kernel.now(), self.name, core, job.name, urgent))

    def _dispatch(self) -> None:
        for job in self._jobs[: self.cores]:
            if job.core == NO_CORE:
                self._start(job)

    def _start(self, job: Job) -> None:
        job.core = min(self._free)
        self._free.remove(job.core)
        if self._last[job.core] is not job.owner:
            self._last[job.core] = job.owner
            job.remaining += self._context_switch
        job.started = self._kernel.now()
        job.turn_ends = job.started + self._quantum
        self._set_timer(job)

    def _set_timer(self, job: Job) -> None:
        if job.timer is not None:
            job.timer.cancel()
        ends = job.started + job.remaining
        if ends <= job.turn_ends:
            job.timer = self._kernel.call_at(ends, partial(self._finish, job))
        else:
            job.timer = self._kernel.call_at(job.turn_ends, partial(self._turn, job))

    def _stop(self, job: Job) -> None:
        now = self._kernel.now()
        if job.timer is not None:
            job.timer.cancel()
        if now > job.started:
            job.remaining -= now - job.started
            self._busy += now - job.started
            self._kernel.record(Slice(job.started, now, self.name, job.core, job.name, job.component))
        self._free.append(job.core)
        job.core = NO_CORE

    def _turn(self, job: Job) -> None:
        if len(self._jobs) <= self.cores:  # nobody waits
            job.turn_ends += self._quantum
            self._set_timer(job)
        else:
            self._stop(job)
            self._jobs.remove(job)
            self._arrive(job)

    def _finish(self, job: Job) -> None:
        self._stop(job)
        self._complete(job)
        self._dispatch()

    def _complete(self, job: Job) -> None:
        self._jobs.remove(job)
        job.done = True
        if isinstance(job.owner, Task):
            self._kernel.wake(job.owner)
        else:
            del self._background[job.owner]

    def _leave(self, job: Job) -> None:
        """Its task is ended: the rest of it is not executed."""
        if job.core != NO_CORE:
            self._stop(job)
        self._jobs.remove(job)
        self._dispatch()
