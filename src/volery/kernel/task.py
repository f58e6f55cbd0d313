"""Tasks, the contexts they execute in, and the scopes that cancel them.

Both clocks use these classes. A task carries the execution time that it still has to spend (``pending_ns``);
only the virtual clock has processors to spend it on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol

from volery.base.time import Ns
from volery.trace.events import NONE, Activation

MAX_SWALLOWED_CANCELLATIONS = 10
"""A task that has caught more cancellations than this without ending is left blocked and never runs again."""

NO_DEADLINE: Ns = 2**63 - 1
"""The absolute deadline of an activation without one."""


class Cancelled(BaseException):
    """Ends a task at its next interaction point. Not an ``Exception``, which components may catch."""


class ComputeResource(Protocol):
    """A processor as tasks use it."""

    name: str

    def serve(self, task: Task, amount: Ns) -> None:
        """Block `task` until `amount` ns of target time have been executed for it, under contention."""

    def load(self, context: ExecutionContext, amount: Ns) -> None:
        """Execute `amount` ns in the background threads of a process. Never blocks the caller."""


@dataclass(frozen=True, eq=False)
class ExecutionContext:
    """Where execution time is spent: for which component, on which processor, at what priority.

    Attributes:
        component: Name of the component instance that is charged.
        processor: Processor that executes it; None where computing takes no simulated time.
        priority: Scheduling priority, higher is more urgent; None inherits the caller's (passive component).
        deadline: Relative to the release of an activation, ns; None for none.
        period: Time between releases that the model states, ns; None for none.
        meter: Returns the execution time on the target since its last call, ns; read at interaction points.
            Without a processor it takes simulated time in loops that poll only.
        on_release: Called with the task at each release of an activation; it may charge the activation.
    """

    component: str
    processor: ComputeResource | None = None
    priority: int | None = 0
    deadline: Ns | None = None
    period: Ns | None = None
    meter: Callable[[], Ns] | None = None
    on_release: Callable[[Task], None] | None = None


class Task:
    """One flow of control. ``flow`` and the attributes after it belong to the kernel that spawned the task.

    An activation lasts from a release (start, timer, message, end of a sleep) to the next blocking wait of
    the component's code. Waits inside the framework (for a processor, a network, a lock) do not end it.
    """

    __slots__ = (
        "_callers", "adopted", "context", "counted_from", "done", "event", "flow", "is_activated", "meter",
        "name", "own", "pending_cancellation", "pending_ns", "polled_ns", "polls", "readings", "released",
        "scope", "swallowed", "waiting_for", "woken",
    )  # fmt: skip

    def __init__(self, name: str, context: ExecutionContext, scope: Scope) -> None:
        self.name = name
        self.own = context  # of the component that it belongs to
        self.context = context  # it executes in: its own, or of the component that it calls through a port
        self.meter = context.meter  # of the context that it executes in
        self._callers: tuple[ExecutionContext, ...] = ()  # contexts that it returns to, the innermost last
        self.scope = scope
        self.pending_ns: Ns = 0
        self.released: Ns | None = None  # release time of the activation in progress
        self.counted_from: Ns = 0  # the next release is due a period after this
        self.readings: dict[object, Ns] = {}  # last reading of the clock in this activation, by its place
        self.polls = 0  # calls in this activation that only look whether something has changed
        self.polled_ns: Ns = 0  # time of a loop that polls which has not been executed yet
        self.is_activated = True  # False while what it does belongs to no activation, as a construction
        self.done = False
        self.adopted = False  # the flow of a script: the kernel did not start it and cannot end it
        self.flow: Any = None
        self.waiting_for = ""
        self.woken = False
        self.event = 0  # that resumes it; see ``VirtualKernel``
        self.swallowed = 0  # cancellations that it has caught without ending
        self.pending_cancellation: BaseException | None = (
            Cancelled(scope.cancelled) if scope.cancelled else None
        )
        scope.tasks.append(self)

    def deliver_cancellation(self) -> None:
        """Raise the pending cancellation. Returns only for a task that has swallowed too many of them."""
        error, self.pending_cancellation = self.pending_cancellation, None
        if self.scope.cancelled:
            self.pending_cancellation = Cancelled(self.scope.cancelled)  # delivered again until the task ends
        if isinstance(error, Cancelled):
            self.swallowed += 1
            if self.swallowed > MAX_SWALLOWED_CANCELLATIONS and not self.adopted:
                return
        if error is not None:
            raise error

    def release(self, due: Ns, counted_from: Ns | None = None) -> None:
        """Begin an activation that was due at `due`, ns; in the past for a task that is late.

        Args:
            due: Its release, ns.
            counted_from: Time from which the next release counts, ns; by default `due`.
        """
        if not self.is_activated:
            return
        self.released = due
        self.counted_from = due if counted_from is None else counted_from
        self.readings.clear()
        self.polls = self.polled_ns = 0
        hook = self.own.on_release
        if hook is not None:
            hook(self)

    def finish(self, now: Ns) -> Activation | None:
        """End the activation in progress; return None if there is none, as in the flow of a script."""
        released = self.released
        if released is None:
            return None
        self.released = None
        own = self.own
        deadline = NONE if own.deadline is None else released + own.deadline
        return Activation(released, now, own.component, deadline)

    @property
    def is_in_call(self) -> bool:
        """Whether it executes a call through a port, in the context of another component."""
        return bool(self._callers)

    def enter(self, context: ExecutionContext) -> None:
        """Execute in `context` until ``leave``."""
        self._callers = (*self._callers, self.context)
        self.context, self.meter = context, context.meter

    def leave(self) -> None:
        """Return to the context of the caller."""
        *callers, self.context = self._callers
        self._callers, self.meter = tuple(callers), self.context.meter

    @property
    def priority(self) -> int:
        """Priority of the innermost context that states one."""
        for context in (self.context, *reversed(self._callers)):
            if context.priority is not None:
                return context.priority
        return 0

    @property
    def deadline(self) -> Ns:
        """Absolute deadline of the activation in progress, ns; ``NO_DEADLINE`` without one."""
        relative = self.own.deadline
        return NO_DEADLINE if relative is None or self.released is None else self.released + relative

    def charge(self, amount: Ns) -> None:
        """Add `amount` ns of execution time, which is spent at the next interaction point."""
        self.pending_ns += amount

    def take_pending(self) -> Ns:
        """Return the pending execution time, the meter's reading included, and reset it to zero."""
        amount, self.pending_ns = self.pending_ns, 0
        return amount + self.meter() if self.meter else amount


@dataclass(eq=False)
class Scope:
    """A tree of tasks that are cancelled together."""

    name: str
    parent: Scope | None = None
    tasks: list[Task] = field(default_factory=list)
    children: list[Scope] = field(default_factory=list)
    cancelled: str = ""  # the reason; empty while the scope lives

    def child(self, name: str) -> Scope:
        """Return a new scope that ends with this one or earlier; forget children that have ended."""
        self.children = [one for one in self.children if not (one.cancelled and one.is_empty)]
        scope = Scope(name, self, cancelled=self.cancelled)
        self.children.append(scope)
        return scope

    @property
    def is_empty(self) -> bool:
        """Whether no task is left in this scope or below."""
        return next(self.all_tasks(), None) is None

    def all_tasks(self) -> Iterator[Task]:
        """Yield every task in this scope and below."""
        yield from self.tasks
        for child in self.children:
            yield from child.all_tasks()

    def mark(self, why: str) -> None:
        """Mark this scope, its children and their tasks as cancelled. The kernel wakes the tasks."""
        self.cancelled = self.cancelled or why
        for task in self.tasks:
            task.pending_cancellation = Cancelled(self.cancelled)
        for child in self.children:
            child.mark(why)
