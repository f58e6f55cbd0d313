"""What every room above may ask of time: once on greenlets, once on threads.

*House code* (actions of ``call_at``, ``every`` and ``post``) never blocks. *User code* (the body of a task)
blocks wherever it likes. ``with kernel:`` marks an interaction point: user code enters the house. There
virtual time first serves what the task owes its processor, and the wall clock takes the one monitor that
guards all house data.

What repeats, on either clock.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from types import TracebackType
from typing import TYPE_CHECKING, Protocol, Self

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.kernel.task import ExecutionContext, Scope, Task
from volery.trace.events import Record

if TYPE_CHECKING:
    from volery.base.time import Ns

    pass

Action = Callable[[], None]


class Handle(Protocol):
    """Something that will happen."""

    def cancel(self) -> None:
        """It will not happen (any more)."""


class Kernel(Protocol):
    """Time and flows of control."""

    root: Scope
    record: Record
    guard: AbstractContextManager[object]
    """Holds house data together without being an interaction point: for what must not fail or block, such as
    a release in ``finally``. Virtual time needs none, the wall clock takes its monitor."""

    def now(self) -> Ns:
        """Nanoseconds since the start of the run."""

    def call_at(self, when: Ns, action: Action) -> Handle:
        """Run house code at *when*, not before now. Actions of one instant run in the order of the calls."""

    def every(self, period: Ns, action: Action) -> Handle:
        """Run house code now and then each *period*."""

    def post(self, action: Action) -> None:
        """Run house code as soon as possible. The only call that a foreign thread may make."""

    def spawn(self, body: Action, name: str, place: ExecutionContext, scope: Scope | None = None) -> Task:
        """Start a flow of control. An exception that leaves *body* is a fault of the house."""

    def adopt(self, name: str) -> AbstractContextManager[Task]:
        """Make the flow that calls this (a script, a REPL) a task for as long as the context lasts.

        While it blocks, virtual time runs; while it does not, virtual time stands still.
        """

    def current(self) -> Task | None:
        """The task that runs now; ``None`` in house code."""

    def __enter__(self) -> Self:
        """An interaction point: see above. Raises ``Cancelled`` if the task's scope has ended."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Leave the house."""

    def pay(self, amount: Ns) -> None:
        """Block the current task until its processor has served *amount*, before what follows is visible."""

    def sleep_until(self, when: Ns) -> None:
        """Pay, then block the current task until *when*."""

    def park(self, deadline: Ns | None, waiting_for: str) -> bool:
        """Block the current task until it is woken (True) or *deadline* has passed (False).

        *waiting_for* names what, for the message of a deadlock. Whoever looks whether it has to wait looks
        and parks within one ``with kernel:``, lest it be woken in between.
        """

    def wake(self, task: Task) -> None:
        """End the wait that *task* is in."""

    def cancel(self, scope: Scope, why: str) -> None:
        """Deliver ``Cancelled`` to every task of *scope* at its next interaction point."""

    def run(self, until: Ns) -> None:
        """Let things happen up to and including *until*, or until the root scope is cancelled."""

    def close(self, why: str = "end of run") -> list[str]:
        """Unwind every task; returns the names of those that would not go."""


class PeriodicAction:
    """House code now and each *period* from now, counted from the start, so that it never drifts."""

    def __init__(self, kernel: Kernel, period: Ns, action: Action) -> None:
        if period <= 0:
            raise UsageError(f"a period of {period} ns; it must be above 0")
        self._kernel, self._period, self._action = kernel, period, action
        self._due = kernel.now()
        self._next = kernel.call_at(self._due, self._tick)

    def cancel(self) -> None:
        """Stop; also from inside the action."""
        self._next.cancel()

    def _tick(self) -> None:
        self._due += self._period
        self._next = self._kernel.call_at(self._due, self._tick)
        self._action()
