"""Processors: cores as contended resources that serve amounts of target time.

Schedulers:

* ``fixed-priority``: the most urgent jobs run, preemptively; equal ones in order of arrival (POSIX
SCHED_FIFO).
* ``round-robin``: without priorities; a job that has run for a `quantum` goes to the end if others wait.
* ``fifo``: without priorities; first come, first served, without preemption.
* ``edf``: the earliest absolute deadline runs, preemptively (Linux's SCHED_DEADLINE without reservations);
jobs without a deadline run after all others, by priority.

A job keeps its core while it runs, and takes the free core of lowest number when it starts or continues.
Placing a job on a core that served another owner last takes `context_switch` of that core first, which the
slices of the job contain. Prices are the caller's: a processor does not know what an amount of time is for.
"""

from __future__ import annotations

from bisect import insort
from functools import partial
from typing import TYPE_CHECKING

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import MS, Ns
from volery.kernel.task import NO_DEADLINE, ExecutionContext, Task
from volery.kernel.virtual import FOREVER, NEVER, VirtualKernel
from volery.trace.events import Preemption, Slice

if TYPE_CHECKING:
    from collections.abc import Callable

    from volery.kernel.api import Handle

NO_CORE = -1

QUANTUM: Ns = 10 * MS
"""Default time slice of round-robin."""


class Job:
    """An amount of computing that needs a core.

    Args:
        owner: Whose it is; a context for computing in the background, for which no task waits.
        name: Name of the task, or of the background.
        component: Component that executes.
        priority: Higher is more urgent.
        remaining: Time that it still needs a core, ns.
        deadline: Absolute, ns.
    """

    __slots__ = (
        "arrival", "component", "core", "deadline", "done", "name",
        "owner", "priority", "remaining", "started", "timer", "turn_ends",
    )  # fmt: skip

    def __init__(
        self,
        owner: Task | ExecutionContext,
        name: str,
        component: str,
        priority: int,
        remaining: Ns,
        deadline: Ns,
    ) -> None:
        self.owner, self.name, self.component = owner, name, component
        self.priority, self.deadline = priority, deadline
        self.remaining = remaining
        self.arrival = 0
        self.core = NO_CORE
        self.started: Ns = 0
        self.turn_ends: Ns = 0
        self.timer: Handle | None = None
        self.done = False


Order = tuple[int, ...]


def _by_priority(job: Job) -> Order:
    return -job.priority, job.arrival


def _by_arrival(job: Job) -> Order:
    return 0, job.arrival


def _by_deadline(job: Job) -> Order:
    return job.deadline, -job.priority, job.arrival


SCHEDULERS: dict[str, Callable[[Job], Order]] = {
    "fixed-priority": _by_priority,
    "round-robin": _by_arrival,
    "fifo": _by_arrival,
    "edf": _by_deadline,
}


class Processor:
    """A ``ComputeResource`` of equal cores under one scheduler.

    Args:
        kernel: Virtual clock that it takes time of.
        name: Name in the trace.
        cores: Number of cores, at least 1.
        scheduler: A key of ``SCHEDULERS``.
        quantum: Time slice of round-robin, ns.
        context_switch: Time that a change of owner takes on a core, ns.

    Raises:
        UsageError: an argument is out of range.
    """

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
        self._jobs: list[Job] = []  # in order; the first `cores` of them run
        self._free = list(range(cores))
        self._last: list[Task | ExecutionContext | None] = [None] * cores  # last owner of each core
        self._background: dict[ExecutionContext, Job] = {}
        self._arrivals = 0
        self._busy: Ns = 0
        self._halted = False

    def busy_ns(self, now: Ns) -> Ns:
        """Return the busy time until `now`, summed over the cores, ns."""
        return self._busy + sum(now - job.started for job in self._jobs if job.core != NO_CORE)

    # -- requests

    def serve(self, task: Task, amount: Ns) -> None:
        """Block `task` until `amount` ns have been executed for it, at the priority that it has now."""
        if amount <= 0:
            return
        component = task.contexts[-1].component
        if not self._jobs and not self._halted:  # no job competes, and perhaps no event is due before the end
            total = amount if self._last[0] is task else amount + self._context_switch
            start = self._kernel.skip(total)
            if start != NEVER:
                self._last[0] = task
                self._busy += total
                self._kernel.record(Slice(start, start + total, self.name, 0, task.name, component))
                return
        job = Job(task, task.name, component, task.priority, amount, task.deadline)
        self._admit(job)
        try:
            while not job.done:
                self._kernel.park(None, self.name)
        finally:
            if not job.done:
                self._abandon(job)

    def load(self, context: ExecutionContext, amount: Ns) -> None:
        """Execute `amount` ns in the background of `context`: one thread, at the priority of the context."""
        if amount <= 0:
            return
        job = self._background.get(context)
        if job is None:
            name = f"{context.component} (background)"
            relative = context.deadline
            due = NO_DEADLINE if relative is None else self._kernel.now() + relative
            job = Job(context, name, context.component, context.priority or 0, amount, due)
            self._background[context] = job
            self._admit(job)
        else:
            job.remaining += amount
            if job.core != NO_CORE:
                self._set_timer(job)

    def halt(self) -> None:
        """Stop executing: no job progresses until `resume`."""
        self._halted = True
        for job in list(self._jobs):
            if job.core != NO_CORE:
                self._stop(job)
                if job.remaining == 0:  # it would have ended at this instant
                    self._complete(job)

    def resume(self) -> None:
        """Execute again, from where `halt` stopped."""
        self._halted = False
        self._dispatch()

    # -- scheduling

    def _admit(self, job: Job) -> None:
        self._arrivals += 1
        job.arrival = self._arrivals
        if self._jobs:
            insort(self._jobs, job, key=self._order)
        else:
            self._jobs.append(job)
        if len(self._jobs) > self.cores:
            self._preempt(job.name)
        self._dispatch()

    def _preempt(self, urgent: str) -> None:
        """Stop the jobs that have a core but are no longer among the first; job `urgent` has arrived."""
        for job in self._jobs[self.cores :]:
            if job.core != NO_CORE:
                core = job.core
                self._stop(job)
                if job.remaining == 0:  # it would have ended at this instant
                    self._complete(job)
                else:
                    self._kernel.record(Preemption(self._kernel.now(), self.name, core, job.name, urgent))

    def _dispatch(self) -> None:
        if self._halted:
            return
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
            job.timer = self._kernel.call_at(job.turn_ends, partial(self._end_turn, job))

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

    def _end_turn(self, job: Job) -> None:
        if len(self._jobs) <= self.cores:  # no other job waits
            job.turn_ends += self._quantum
            self._set_timer(job)
        else:
            self._stop(job)
            self._jobs.remove(job)
            self._admit(job)

    def _finish(self, job: Job) -> None:
        job.timer = None  # it has just fired
        self._stop(job)
        self._complete(job)
        if self._jobs:
            self._dispatch()

    def _complete(self, job: Job) -> None:
        self._jobs.remove(job)
        job.done = True
        if isinstance(job.owner, Task):
            self._kernel.wake(job.owner)
        else:
            del self._background[job.owner]

    def _abandon(self, job: Job) -> None:
        """Drop a job whose task has been cancelled: the rest is not executed."""
        if job.core != NO_CORE:
            self._stop(job)
        self._jobs.remove(job)
        self._dispatch()
