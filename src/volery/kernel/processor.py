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

from bisect import bisect, insort
from functools import partial
from typing import TYPE_CHECKING

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import MS, Ns
from volery.kernel.task import NO_DEADLINE, ExecutionContext, Task
from volery.kernel.virtual import FOREVER, NEVER, ResettableTimer, VirtualKernel
from volery.trace.events import Preemption, Slice, ignore

if TYPE_CHECKING:
    from collections.abc import Callable

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
        "owner", "priority", "remaining", "started", "turn_ends",
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
        self.core: Core | None = None
        self.started: Ns = 0
        self.turn_ends: Ns = 0
        self.done = False


class Core:
    """One core: what it executes, whom it served last, and the timer that ends the job or its turn."""

    __slots__ = ("job", "last", "number", "timer")

    def __init__(self, number: int, timer: ResettableTimer) -> None:
        self.number, self.timer = number, timer
        self.job: Job | None = None
        self.last: Task | ExecutionContext | None = None


Order = tuple[int, ...]


def _number(core: Core) -> int:
    return core.number


def _nothing() -> None:
    """Do nothing; the action of a timer before its own is known."""


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
        self._orders: list[Order] = []  # of the jobs
        self._cores = [self._core(number) for number in range(cores)]
        self._free = list(self._cores)  # by number
        self._background: dict[ExecutionContext, Job] = {}
        self._arrivals = 0
        self._busy: Ns = 0
        self._halted = False

    def _core(self, number: int) -> Core:
        core = Core(number, ResettableTimer(_nothing))
        core.timer.action = partial(self._expire, core)
        return core

    def busy_ns(self, now: Ns) -> Ns:
        """Return the busy time until `now`, summed over the cores, ns."""
        return self._busy + sum(now - core.job.started for core in self._cores if core.job is not None)

    # -- requests

    def serve(self, task: Task, amount: Ns) -> None:
        """Block `task` until `amount` ns have been executed for it, at the priority that it has now."""
        if amount <= 0:
            return
        component = task.context.component
        if self._free and not self._halted:  # no job competes, and perhaps no event is due before the end
            core = self._free[0]
            total = amount if core.last is task else amount + self._context_switch
            start = self._kernel.skip(total)
            if start != NEVER:
                core.last = task
                self._busy += total
                if self._kernel.record is not ignore:
                    self._kernel.record(
                        Slice(start, start + total, self.name, core.number, task.name, component)
                    )
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
            if job.core is not None:
                self._set_timer(job, job.core)

    def halt(self) -> None:
        """Stop executing: no job progresses until `resume`."""
        self._halted = True
        for core in self._cores:
            if core.job is not None:
                self._displace(core.job, core)

    def resume(self) -> None:
        """Execute again, from where `halt` stopped."""
        self._halted = False
        self._dispatch()

    # -- scheduling

    def _admit(self, job: Job) -> None:
        self._arrivals += 1
        job.arrival = self._arrivals
        order = self._order(job)
        at = bisect(self._orders, order)
        self._orders.insert(at, order)
        self._jobs.insert(at, job)
        if len(self._jobs) > self.cores:
            last = self._jobs[
                self.cores
            ]  # the only one that may have a core and is no longer among the first
            core = last.core
            if core is not None and not self._displace(last, core) and self._kernel.record is not ignore:
                now = self._kernel.now()
                self._kernel.record(Preemption(now, self.name, core.number, last.name, job.name))
        self._dispatch()

    def _displace(self, job: Job, core: Core) -> bool:
        """Take the core from a job; return whether the job is done, as it would have been at this instant."""
        self._stop(job, core)
        if job.remaining == 0:
            self._complete(job)
        return job.done

    def _dispatch(self) -> None:
        if self._halted:
            return
        for job in self._jobs[: self.cores]:
            if job.core is None:
                self._start(job, self._free.pop(0))

    def _start(self, job: Job, core: Core) -> None:
        job.core, core.job = core, job
        if core.last is not job.owner:
            core.last = job.owner
            job.remaining += self._context_switch
        job.started = self._kernel.now()
        job.turn_ends = job.started + self._quantum
        self._set_timer(job, core)

    def _set_timer(self, job: Job, core: Core) -> None:
        """Let the timer expire at the end of the job or of its turn, whichever comes first."""
        ends = job.started + job.remaining
        self._kernel.set_timer(core.timer, ends if ends <= job.turn_ends else job.turn_ends)

    def _stop(self, job: Job, core: Core) -> None:
        now = self._kernel.now()
        core.timer.cancel()
        if now > job.started:
            job.remaining -= now - job.started
            self._busy += now - job.started
            if self._kernel.record is not ignore:
                name, component = job.name, job.component
                self._kernel.record(Slice(job.started, now, self.name, core.number, name, component))
        insort(self._free, core, key=_number)
        job.core = core.job = None

    def _expire(self, core: Core) -> None:
        """End the job of a core, or its turn if other jobs wait for a core."""
        job = core.job
        if job is None:
            return
        if job.started + job.remaining <= self._kernel.now():
            self._stop(job, core)
            self._complete(job)
            self._dispatch()
        elif len(self._jobs) <= self.cores:
            job.turn_ends += self._quantum
            self._set_timer(job, core)
        else:
            self._stop(job, core)
            self._forget(job)
            self._admit(job)

    def _forget(self, job: Job) -> None:
        at = self._jobs.index(job)
        del self._jobs[at], self._orders[at]

    def _complete(self, job: Job) -> None:
        self._forget(job)
        job.done = True
        if isinstance(job.owner, Task):
            self._kernel.wake(job.owner)
        else:
            del self._background[job.owner]

    def _abandon(self, job: Job) -> None:
        """Drop a job whose task has been cancelled: the rest is not executed."""
        if job.core is not None:
            self._stop(job, job.core)
        self._forget(job)
        self._dispatch()
