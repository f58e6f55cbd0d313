"""Everything that waits, for both clocks: built on ``park`` and ``wake`` only.

Waits of component code end an activation when they block: ``sleep``, ``Rate.sleep``, ``Event.wait``,
``Queue.get`` and ``Signal.wait_for`` on request. Waits inside the framework, such as a ``Lock``'s, do not.

A periodic loop that is late does not wait, and still ends an activation each time round: at a sleep of no
length, or where it reads the clock and finds that there is nothing to sleep (``read_clock``).
"""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Generic, Self, TypeVar, overload

from volery.base.errors import UsageError
from volery.base.time import US, Ns
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext, Task

T = TypeVar("T")
Predicate = Callable[[], object]

MAX_PERIODS_LATE = 2
"""A loop that is later than this does not catch up but counts anew, as rospy's ``Rate`` does."""

_NO_TASK = "only a task can wait: call this from a component, or from the thread that has called connect()"
_CLOSED = "the connection is closed, or the run has ended; connect() again"
_FRAMEWORK = __name__.partition(".")[0] + "."


def current_task(kernel: Kernel) -> Task:
    """Return the running task; raise ``UsageError`` in a framework callback, which must not wait."""
    task = kernel.current()
    if task is None:
        raise UsageError(_CLOSED if kernel.root.cancelled else _NO_TASK)
    return task


def end_activation(kernel: Kernel, task: Task | None = None) -> None:
    """Record the end of the activation of `task` (the current one); call it at an interaction point."""
    activation = (task or current_task(kernel)).finish(kernel.now())
    if activation is not None:
        kernel.record(activation)


def next_release(counted_from: Ns, period: Ns, now: Ns) -> tuple[Ns, Ns]:
    """Return when the next release is or was due, and the time from which the one after it counts, ns."""
    due = counted_from + period
    return due, now if now - due > MAX_PERIODS_LATE * period else due


def read_clock(kernel: Kernel) -> Ns:
    """Return the time for component code, ns. An interaction point.

    A loop that times itself reads the clock once a cycle to find out how long to sleep, and does not sleep
    when it is late. So when a task with a period or a deadline reads the clock twice at one place without
    having waited, and was late at the first reading, then its activation ended at the first reading and the
    next one began, which was due a period after its predecessor.
    """
    with kernel.interact():
        now, task = kernel.now(), kernel.current()
        if task is not None and task.released is not None and _period_of(task) is not None:
            place = _place_of_caller()
            earlier = task.readings.get(place)
            if earlier is not None:
                _end_if_late(kernel, task, earlier)
            task.readings[place] = now
        return now


FREE_POLLS = 1000
"""Calls of one activation that are no polling yet."""
POLLS = 64
POLLED: Ns = 100 * US
"""Calls of a polling loop from one look at its time to the next; the least time executed at once, ns."""


def execute_polling(kernel: Kernel, amount: Ns) -> None:
    """Execute `amount` ns of a loop that polls; without a processor that time passes as well."""
    before = kernel.now()
    if kernel.consume(amount) and kernel.now() == before:
        kernel.sleep_until(before + amount)


def execute_polled(kernel: Kernel, task: Task) -> None:
    """Execute what a loop of `task` has polled, and the code that is counted, once that is ``POLLED`` ns."""
    context = task.context
    counted = 0 if task.meter is None else task.meter()
    if context.processor is None:
        task.polled_ns += counted
    else:
        task.pending_ns += counted
    amount = task.polled_ns
    if amount + task.pending_ns >= POLLED:
        task.polled_ns = 0
        execute_polling(kernel, amount)


def poll(kernel: Kernel, price: Ns, *, executed: bool = False) -> bool:
    """Execute a call that loops repeat until something has changed. An interaction point.

    Such a call is too short to be priced. But after ``FREE_POLLS`` of them in one activation they are what
    the task spends its time with: each counts `price` ns, which are executed for several of them at once,
    with the code between them.
    With *executed* each call executes its price.

    Returns:
        Whether it is polling.
    """
    task = kernel.current()
    if task is None or task.adopted:
        return False
    polls = task.polls = task.polls + 1
    if executed and task.context.processor is not None:
        kernel.consume(price)
        return True
    if polls <= FREE_POLLS:
        return False
    task.polled_ns += price
    if task.polled_ns >= POLLED or polls % POLLS == 0:
        execute_polled(kernel, task)
    return True


def _period_of(task: Task) -> Ns | None:
    """Return the time after which a task is late, ns; None for one without, and within a call of a port."""
    own = task.own
    return None if task.is_in_call else (own.period or own.deadline)


def _end_if_late(kernel: Kernel, task: Task, ended: Ns) -> None:
    """End the activation in progress at `ended`, ns, and begin the next one, if that was due by then."""
    period = _period_of(task)
    if task.released is None or period is None or ended < task.counted_from + period:
        return
    due, counted_from = next_release(task.counted_from, period, ended)
    if task.own.period is None:  # no release was due: the loop has just come round
        due = counted_from = ended
    activation = task.finish(ended)
    if activation is not None:
        kernel.record(activation)
    task.release(due, counted_from)


def _place_of_caller() -> object:
    """Return where component code has called the framework: its innermost frame; in C++ the kind of call."""
    frame = sys._getframe()
    while frame.f_back is not None and frame.f_globals.get("__name__") == __name__:
        frame = frame.f_back  # compiled, this module has no frames
    caller = frame
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith(_FRAMEWORK):
        frame = frame.f_back
    found = caller if frame.f_back is None else frame
    return id(found.f_code), found.f_lasti


def sleep(kernel: Kernel, duration: Ns) -> None:
    """Block the current task for `duration` ns, counted from when its computing so far has been served."""
    with kernel.interact():
        sleep_within(kernel, duration, kernel.now())


def sleep_within(kernel: Kernel, duration: Ns, now: Ns) -> None:
    """``sleep`` for a caller that is at an interaction point, at the time `now`."""
    task = kernel.current()
    if duration > 0:
        if task is None:
            raise UsageError(_NO_TASK)
        activation = task.finish(now)
        if activation is not None:
            kernel.record(activation)
        kernel.sleep_until(now + duration)
        task.release(now + duration)
    elif task is not None:
        _end_if_late(kernel, task, now)


class Rate:
    """Sleeps until the next multiple of `period` ns, counted from its creation.

    A late loop catches up: ``sleep`` returns at once, and the next activation was released when it was due.
    One that is more than two periods late counts anew from now, as rospy's Rate does: the next activation was
    still released a period after its predecessor, the one after it a period from now.
    """

    def __init__(self, kernel: Kernel, period: Ns) -> None:
        if period <= 0:
            raise UsageError(f"a period of {period} ns; it must be above 0")
        self._kernel, self.period = kernel, period
        with kernel.interact():
            self._counted_from = kernel.now()

    @property
    def due(self) -> Ns:
        """Time of the next release, ns."""
        return self._counted_from + self.period

    def sleep(self) -> None:
        """End the activation; block the current task until the next one is due."""
        kernel = self._kernel
        with kernel.interact():
            task = current_task(kernel)
            before = task.released
            end_activation(kernel, task)
            due, self._counted_from = next_release(self._counted_from, self.period, kernel.now())
            if (
                before is None or due <= before
            ):  # it was not this loop that was late: it waited for something else
                due = max(due, self._counted_from)
            kernel.sleep_until(due)
            task.release(due, self._counted_from)


class Signal:
    """A condition variable: tasks wait for predicates, which each ``notify`` evaluates again."""

    def __init__(self, kernel: Kernel, name: str) -> None:
        self._kernel, self.name = kernel, name
        self._waiters: list[tuple[Task, Predicate]] = []

    def notify(self) -> None:
        """Wake the tasks whose predicates hold. Never blocks; not an interaction point."""
        with self._kernel.guard:
            for task, predicate in self._waiters:
                if _may_hold(predicate):
                    self._kernel.wake(task)

    def wait_for(
        self, predicate: Predicate, within: Ns | None = None, *, ends_activation: bool = False
    ) -> bool:
        """Block the current task until `predicate` holds (True), at most for `within` ns (False)."""
        kernel = self._kernel
        with kernel.interact():
            if predicate():
                return True
            task = current_task(kernel)
            if ends_activation:
                end_activation(kernel, task)
            held = self._wait(task, predicate, None if within is None else kernel.now() + within)
            if ends_activation:
                task.release(kernel.now())
            return held

    def _wait(self, task: Task, predicate: Predicate, deadline: Ns | None) -> bool:
        waiter = (task, predicate)
        self._waiters.append(waiter)
        try:
            while True:
                in_time = self._kernel.park(deadline, self.name)
                if predicate():
                    return True
                if not in_time:
                    return False
        finally:
            self._waiters.remove(waiter)


def _may_hold(predicate: Predicate) -> bool:
    try:
        return bool(predicate())
    except Exception:  # an error of the waiting task: woken, it evaluates the predicate itself and raises it
        return True


class Event:
    """A flag that tasks wait for."""

    def __init__(self, kernel: Kernel, name: str) -> None:
        self._kernel = kernel
        self._changed = Signal(kernel, name)
        self._set = False

    def is_set(self) -> bool:
        """Return whether the flag is set."""
        with self._kernel.interact():
            return self._set

    def set(self) -> None:
        """Set the flag and wake every waiting task."""
        with self._kernel.interact():
            self._set = True
            self._changed.notify()

    def clear(self) -> None:
        """Reset the flag."""
        with self._kernel.interact():
            self._set = False

    def wait(self, within: Ns | None = None) -> bool:
        """Block the current task until the flag is set (True), at most for `within` ns (False)."""
        return self._changed.wait_for(lambda: self._set, within, ends_activation=True)


class Queue(Generic[T]):
    """A FIFO queue. With a `depth`, a new item replaces the oldest one of a full queue, as in ROS."""

    def __init__(self, kernel: Kernel, name: str, depth: int | None = None) -> None:
        if depth is not None and depth <= 0:
            raise UsageError(f"{name}: a depth of {depth}; give at least 1, or None for no bound")
        self._kernel = kernel
        self._items: deque[T] = deque(maxlen=depth)
        self._filled = Signal(kernel, name)

    def __len__(self) -> int:
        return len(self._items)

    def put(self, item: T) -> bool:
        """Append `item`; return False if the oldest one was dropped. An interaction point; never waits."""
        with self._kernel.interact():
            fits = len(self._items) != self._items.maxlen
            self._items.append(item)
            self._filled.notify()
            return fits

    @overload
    def get(self) -> T: ...
    @overload
    def get(self, within: Ns | None) -> T | None: ...
    def get(self, within: Ns | None = None) -> T | None:
        """Block the current task until there is an item and take it; None if there is none `within` ns."""
        with self._kernel.interact():
            if self._filled.wait_for(lambda: self._items, within, ends_activation=True):
                return self._items.popleft()
            return None


class Lock:
    """A reentrant mutual exclusion between tasks. ``with lock:`` blocks until it is free.

    The next owner is the waiting task of highest priority, among equals the first (the order of a futex under
    real-time scheduling). The owner does not inherit priority.
    """

    def __init__(self, kernel: Kernel, name: str) -> None:
        self._kernel, self.name = kernel, name
        self._waiters: list[Task] = []
        self.owner: Task | None = None
        self._depth = 0

    def __enter__(self) -> Self:
        kernel = self._kernel
        with kernel.interact():
            task = current_task(kernel)
            if self.owner is None:
                self.owner = task
            elif self.owner is not task:
                self._wait(task)
            self._depth += 1
        return self

    def _wait(self, task: Task) -> None:
        self._waiters.append(task)
        try:
            while self.owner is not task:
                self._kernel.park(None, self.name)
        except BaseException:
            if self.owner is task:
                self._pass_on()
            else:
                self._waiters.remove(task)
            raise

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Release it. Never blocks and is not an interaction point, so that a cancelled task can do it."""
        with self._kernel.guard:
            self._depth -= 1
            if self._depth == 0:
                self._pass_on()

    def _pass_on(self) -> None:
        # ``max`` returns the first of equals
        self.owner = max(self._waiters, key=lambda task: task.priority, default=None)
        if self.owner is not None:
            self._waiters.remove(self.owner)
            self._kernel.wake(self.owner)


@contextmanager
def executing_in(kernel: Kernel, context: ExecutionContext) -> Iterator[None]:
    """Let the current task compute in `context`: pending execution time is spent before it enters and leaves.

    That also holds for an exception that leaves the block; a cancelled task spends nothing.
    """
    with kernel.interact():
        task = current_task(kernel)
        task.enter(context)
    try:
        try:
            yield
        except Exception:
            kernel.interact()
            raise
        kernel.interact()
    finally:
        task.take_pending()
        task.leave()
