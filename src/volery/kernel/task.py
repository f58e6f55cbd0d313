"""A task is a flow of control; a place is where its computing is spent; a scope is who may end it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol

from volery.base.time import Ns
from volery.trace.events import NONE, Activation

MAX_SWALLOWED_CANCELLATIONS = 10
"""How often a task may swallow its end before it is left where it is and never runs again."""


class Cancelled(BaseException):
    """Ends a task at its next interaction point. No ``Exception``, lest user code catch it by accident."""


class ComputeResource(Protocol):
    """A processor, as a task sees it."""

    name: str

    def serve(self, task: Task, amount: Ns) -> None:
        """Block *task* until *amount* of target time has been executed for it, in contention with others."""

    def load(self, place: ExecutionContext, amount: Ns) -> None:
        """Execute *amount* beside whatever the caller does: background threads of a process. Never blocks."""


@dataclass(frozen=True, eq=False)
class ExecutionContext:
    """Where computing is spent: whose it is, on which processor, how urgent, and how it is metered.

    ``processor`` is ``None`` where computing takes no simulated time. ``priority`` ``None`` means the
    caller's (a passive component). ``deadline`` is relative to the release of an activation. ``meter`` gives
    the execution time on the target since it was last asked; it is pulled at every interaction point.
    ``on_release`` is told each release of an activation before the task goes on, and may charge it.
    """

    component: str
    processor: ComputeResource | None = None
    priority: int | None = 0
    deadline: Ns | None = None
    meter: Callable[[], Ns] | None = None
    on_release: Callable[[Task], None] | None = None


class Task:
    """One flow of control. The kernel that spawned it owns ``flow`` and the fields below it.

    An *activation* runs from a release (its start, a timer, a message, the return of a sleep) to the next
    blocking wait of the user's. Waits inside the house (for a processor, a network, a lock) do not end it.
    """

    def __init__(self, name: str, place: ExecutionContext, scope: Scope) -> None:
        self.name = name
        self.places = [place]
        self.scope = scope
        self.debt: Ns = 0
        self.released: Ns | None = None  # of the activation that is under way
        self.done = False
        self.adopted = False  # the flow of a script: the kernel has not made it and cannot end it
        self.flow: Any = None
        self.waiting_for = ""
        self.woken = False
        self.ticket = 0  # of its next resumption; what was scheduled under another ticket is void
        self.refusals = 0  # how often it has swallowed its end
        self.summons: BaseException | None = Cancelled(scope.cancelled) if scope.cancelled else None
        scope.tasks.append(self)

    def answer(self) -> None:
        """Raise what it is summoned for. Returns only if it has swallowed its end too often."""
        error, self.summons = self.summons, None
        if self.scope.cancelled:
            self.summons = Cancelled(self.scope.cancelled)  # an end is delivered again and again
        if isinstance(error, Cancelled):
            self.refusals += 1
            if self.refusals > MAX_SWALLOWED_CANCELLATIONS and not self.adopted:
                return
        if error is not None:
            raise error

    def release(self, due: Ns) -> None:
        """An activation begins; it was due at *due*, which is in the past for a task that is late."""
        self.released = due
        hook = self.places[0].on_release
        if hook is not None:
            hook(self)

    def finish(self, now: Ns) -> Activation | None:
        """The activation that is under way ends; ``None`` if there is none, as in the flow of a script."""
        if self.released is None:
            return None
        home = self.places[0]
        deadline = NONE if home.deadline is None else self.released + home.deadline
        activation = Activation(self.released, now, home.component, deadline)
        self.released = None
        return activation

    @property
    def place(self) -> ExecutionContext:
        """Where it computes now: its own place, or that of the component it is visiting through a port."""
        return self.places[-1]

    @property
    def priority(self) -> int:
        """Of the innermost place that states one."""
        return next((place.priority for place in reversed(self.places) if place.priority is not None), 0)

    def charge(self, amount: Ns) -> None:
        """Owe *amount* of target time, to be served at the next interaction point."""
        self.debt += amount

    def take_debt(self) -> Ns:
        """What is owed, the meter's reading included; zero from now on."""
        amount, self.debt = self.debt, 0
        meter = self.places[-1].meter
        return amount + meter() if meter else amount


@dataclass(eq=False)
class Scope:
    """A tree of tasks that are ended together."""

    name: str
    parent: Scope | None = None
    tasks: list[Task] = field(default_factory=list)
    children: list[Scope] = field(default_factory=list)
    cancelled: str = ""  # why; empty while it lives

    def child(self, name: str) -> Scope:
        """A scope that ends when this one does, or earlier. Those that have ended before are forgotten."""
        self.children = [one for one in self.children if not (one.cancelled and one.is_empty)]
        scope = Scope(name, self, cancelled=self.cancelled)
        self.children.append(scope)
        return scope

    @property
    def is_empty(self) -> bool:
        """No task is left in it or below."""
        return next(self.all_tasks(), None) is None

    def all_tasks(self) -> Iterator[Task]:
        """Every task in this scope and below."""
        yield from self.tasks
        for child in self.children:
            yield from child.all_tasks()

    def mark(self, why: str) -> None:
        """Remember, here and below, that it has ended. Waking the tasks is the kernel's part."""
        self.cancelled = self.cancelled or why
        for task in self.tasks:
            task.summons = Cancelled(self.cancelled)
        for child in self.children:
            child.mark(why)
