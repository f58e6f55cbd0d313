"""The interface of a kernel: time and tasks. `virtual` implements it on greenlets, `wall` on threads.

Framework callbacks (actions of ``call_at``, ``every`` and ``post``) never block. Component code (the body of
a task) may block anywhere. It enters the framework at interaction points, by ``kernel.interact()``: the
virtual clock spends the task's pending execution time on its processor then. What follows within ``with
kernel.interact():`` holds, on the wall clock, the one monitor that guards all data of the framework.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.kernel.task import ExecutionContext, Scope, Task
from volery.trace.events import Record

Action = Callable[[], None]


class Handle(Protocol):
    """An action that has been scheduled."""

    def cancel(self) -> None:
        """Do not execute the action (any more)."""


class Kernel(Protocol):
    """Time and tasks."""

    root: Scope
    record: Record
    guard: AbstractContextManager[object]
    """Guards data of the framework without being an interaction point, for code that must not fail or block,
    such as a release in ``finally``. On the wall clock it is the monitor; in virtual time it is never
    contended."""

    def now(self) -> Ns:
        """Return the time since the start of the run, ns."""

    def call_at(self, when: Ns, action: Action) -> Handle:
        """Execute a framework callback at `when`, ns, or now if that is past; in call order."""

    def every(self, period: Ns, action: Action) -> Handle:
        """Execute a framework callback now and then every `period` ns."""

    def post(self, action: Action) -> None:
        """Execute a framework callback as soon as possible. The only method for foreign threads."""

    def spawn(self, body: Action, name: str, context: ExecutionContext, scope: Scope | None = None) -> Task:
        """Start a task. An exception that leaves `body` is an error of the framework and ends the run."""

    def adopt(self, name: str) -> AbstractContextManager[Task]:
        """Make the calling flow (a script, a REPL) a task while the context manager lasts.

        Virtual time runs while that task blocks and stands still while it does not.
        """

    def joined(self) -> AbstractContextManager[None]:
        """Let a thread that the kernel did not start wait while the context manager lasts.

        On the wall clock the thread is a task meanwhile. Raises ``UsageError`` in a framework callback; also
        in virtual time, which only the thread of its script can pass.
        """

    def current(self) -> Task | None:
        """Return the running task; None in a framework callback."""

    def interact(self) -> AbstractContextManager[object]:
        """Be an interaction point: it acts when it is called, and may block for any time.

        Returns:
            What a caller holds by ``with`` if it then uses data of the framework: the monitor on the wall
            clock, nothing in virtual time, where no other task runs until this one blocks.

        Raises:
            Cancelled: The task's scope has been cancelled.
        """

    def consume(self, amount: Ns) -> bool:
        """Block the current task until its processor has served `amount` ns; False if there is no task."""

    def sleep_until(self, when: Ns) -> None:
        """Spend the pending execution time, then block the current task until `when`, ns."""

    def park(self, deadline: Ns | None, waiting_for: str) -> bool:
        """Block the current task until it is woken (True) or `deadline`, ns, has passed (False).

        A caller that checks a condition before it parks does both within one ``with kernel.interact():``, so
        that it cannot be woken in between.

        Args:
            deadline: Time, ns; None waits without limit.
            waiting_for: What the task waits for, for the message of a deadlock.
        """

    def wake(self, task: Task) -> None:
        """End the wait that `task` is in."""

    def cancel(self, scope: Scope, why: str) -> None:
        """Deliver ``Cancelled`` to every task of `scope` at its next interaction point."""

    def run(self, until: Ns) -> None:
        """Let time pass up to and including `until`, ns, or until the root scope is cancelled."""

    def close(self, why: str = "end of run") -> list[str]:
        """Cancel and unwind every task; return the names of those that did not end."""


class PeriodicAction:
    """A framework callback now and every `period` ns, counted from the start, so that it does not drift."""

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
