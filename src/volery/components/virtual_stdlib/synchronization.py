"""Replacements of ``threading`` and ``queue`` on the tasks and the clock of the run.

A thread is a task in its component's context. The classes follow Python's own; only what they wait for
differs.
"""

from __future__ import annotations

import queue as real_queue
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from heapq import heappop, heappush
from types import ModuleType, TracebackType
from typing import Any, ClassVar

from volery.base.errors import UsageError
from volery.base.time import Ns, from_seconds, to_seconds
from volery.components.component_api import component_of
from volery.components.instance import place_of_call
from volery.components.virtual_stdlib.process_environment import make_module
from volery.kernel import waiting
from volery.kernel.api import Kernel
from volery.kernel.task import Task
from volery.trace.events import WARNING, Text


class KernelBound:
    """Base of the replaced classes: each run has a subclass of its own, bound to its kernel."""

    kernel: ClassVar[Kernel]


def bind(kernel: Kernel, kinds: Iterable[type[KernelBound]]) -> dict[str, Any]:
    """Return the subclasses of ``kinds`` for one run, by name."""
    return {kind.__name__: type(kind.__name__, (kind,), {"kernel": kernel}) for kind in kinds}


def longest_wait(blocking: bool, timeout: float | None) -> Ns | None:
    """Return the longest time to wait, ns, or None without a limit.

    There is no limit without a timeout, or with the -1 of ``Lock.acquire``.
    """
    if not blocking:
        return 0
    return None if timeout is None or timeout < 0 else from_seconds(timeout)


def threading_module(kernel: Kernel) -> ModuleType:
    """Return the replacement of ``threading``."""
    names = bind(kernel, (Thread, Timer, Lock, RLock, Event, Semaphore, BoundedSemaphore, Condition))
    names["current_thread"] = lambda: waiting.current_task(kernel)
    names["get_ident"] = lambda: waiting.current_task(kernel).name
    names["main_thread"] = lambda: _flows(kernel)[0]
    names["active_count"] = lambda: len(_flows(kernel))
    names["ThreadError"] = RuntimeError
    return make_module("threading", names)


def _flows(kernel: Kernel) -> list[Task]:
    """Return the tasks of the current component, the first of which runs its main flow."""
    task = waiting.current_task(kernel)
    instance = component_of(task)
    if instance is None or instance.scope is None:
        return [task]
    return [task for task in instance.scope.all_tasks() if task.own.component == instance.name]


class Thread(KernelBound):
    """A flow of control of the component that starts it. It ends with the component."""

    def __init__(
        self,
        group: None = None,
        target: Callable[..., object] | None = None,
        name: str | None = None,
        args: Iterable[Any] = (),
        kwargs: Mapping[str, Any] | None = None,
        *,
        daemon: bool | None = None,
    ) -> None:
        self.name = name or getattr(target, "__name__", type(self).__name__)
        self.daemon = bool(daemon)
        self._target = target
        self._args = tuple(args)
        self._kwargs = dict(kwargs or {})
        self._task: Task | None = None
        self._over = False
        self._ended = waiting.Signal(self.kernel, f"thread {self.name}")

    def start(self) -> None:
        """Start the thread; it can be started once."""
        if self._task is not None:
            raise RuntimeError("threads can only be started once")
        kernel = self.kernel
        with kernel.interact():
            instance = component_of(waiting.current_task(kernel))
            if instance is None:
                raise UsageError("threading.Thread: only components start threads")

            def body() -> None:
                try:
                    instance.run_thread(self.run, str(self.name))
                finally:
                    self._over = True
                    self._ended.notify()

            self._task = kernel.spawn(body, f"{instance.name}/{self.name}", instance.context, instance.scope)
            if not self.daemon:
                instance.threads.append(self)

    def run(self) -> None:
        """Call the target; a subclass may override this instead."""
        if self._target is not None:
            self._target(*self._args, **self._kwargs)

    def join(self, timeout: float | None = None) -> None:
        """Wait until the thread has ended."""
        if self._task is None:
            raise RuntimeError("cannot join thread before it is started")
        self._ended.wait_for(lambda: self._over, longest_wait(True, timeout), ends_activation=True)

    def is_alive(self) -> bool:
        """Return whether the thread has started and not ended."""
        with self.kernel.interact():
            return self._task is not None and not self._over


class Timer(Thread):
    """A thread that calls a function once after an interval."""

    def __init__(
        self,
        interval: float,
        function: Callable[..., object],
        args: Iterable[Any] | None = None,
        kwargs: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(target=function, args=args or (), kwargs=kwargs)
        self.interval = interval
        self._cancelled = False

    def cancel(self) -> None:
        """Cancel the call."""
        with self.kernel.interact():
            self._cancelled = True

    def run(self) -> None:
        """Wait for the interval, then call the function."""
        waiting.sleep(self.kernel, from_seconds(self.interval))
        if not self._cancelled:
            super().run()


class ContextManaged(KernelBound):
    """Base of objects that a ``with`` statement acquires and releases."""

    acquire: Callable[..., bool]
    release: Callable[..., None]

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.release()


class Lock(ContextManaged):
    """A lock, held by at most one task."""

    def __init__(self) -> None:
        self._owner: Task | None = None
        self._free = waiting.Signal(self.kernel, type(self).__name__)

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        """Acquire the lock; return False if it was not free in time."""
        longest = longest_wait(blocking, timeout)
        kernel = self.kernel
        with kernel.interact():
            if longest is None and self._owner is not None and self._owner is kernel.current():
                self._warn_of_deadlock(kernel)
            if not self._free.wait_for(lambda: self._owner is None, longest, ends_activation=blocking):
                return False
            self._owner = waiting.current_task(kernel)
            return True

    def release(self) -> None:
        """Release the lock. It never blocks, so that it also works in a task that is being cancelled."""
        if self._owner is None:
            task = self.kernel.current()
            if task is not None and task.scope.cancelled:
                return  # it was cancelled while it waited to acquire the lock again
            raise RuntimeError("release unlocked lock")
        self._owner = None
        self._free.notify()

    def locked(self) -> bool:
        """Return whether the lock is held."""
        with self.kernel.interact():
            return self._owner is not None

    @staticmethod
    def _warn_of_deadlock(kernel: Kernel) -> None:
        component, where = waiting.current_task(kernel).context.component, place_of_call()
        what = f"waits for a lock that the same thread holds{where}: only another one can release it"
        kernel.record(Text(kernel.now(), component, WARNING, what))


class RLock(Lock):
    """A lock that its owner may acquire again."""

    def __init__(self) -> None:
        super().__init__()
        self._depth = 0

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        """Acquire the lock, once more if the current task owns it."""
        if self._owner is not None and self._owner is self.kernel.current():
            self._depth += 1
            return True
        taken = super().acquire(blocking, timeout)
        if taken:
            self._depth = 1
        return taken

    def release(self) -> None:
        """Release the lock; it is free after as many releases as acquisitions."""
        self._depth -= 1
        if self._depth <= 0:
            super().release()


class Event(KernelBound):
    """A flag that tasks wait for."""

    def __init__(self) -> None:
        self._event = waiting.Event(self.kernel, "Event")
        self.is_set = self._event.is_set
        self.set = self._event.set
        self.clear = self._event.clear

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until the flag is set; return False if it was not in time."""
        return self._event.wait(longest_wait(True, timeout))


class Semaphore(ContextManaged):
    """A counting semaphore."""

    def __init__(self, value: int = 1) -> None:
        if value < 0:
            raise ValueError("semaphore initial value must be >= 0")
        self._value = value
        self._free = waiting.Signal(self.kernel, type(self).__name__)

    def acquire(self, blocking: bool = True, timeout: float | None = None) -> bool:
        """Decrement the counter; return False if it was zero for too long."""
        longest = longest_wait(blocking, timeout)
        with self.kernel.interact():
            if not self._free.wait_for(lambda: self._value > 0, longest, ends_activation=blocking):
                return False
            self._value -= 1
            return True

    def release(self, n: int = 1) -> None:
        """Increment the counter by ``n``. It never blocks."""
        self._value += n
        self._free.notify()


class BoundedSemaphore(Semaphore):
    """A semaphore whose counter cannot exceed its initial value."""

    def __init__(self, value: int = 1) -> None:
        super().__init__(value)
        self._most = value

    def release(self, n: int = 1) -> None:
        """Increment the counter by ``n``."""
        if self._value + n > self._most:
            raise ValueError("Semaphore released too many times")
        super().release(n)


class Condition(ContextManaged):
    """A condition variable with its lock."""

    def __init__(self, lock: Lock | None = None) -> None:
        self._lock: Lock = lock or bind(self.kernel, (RLock,))["RLock"]()
        self.acquire = self._lock.acquire
        self.release = self._lock.release
        self._notified = waiting.Signal(self.kernel, "Condition")
        self._waiting: list[list[bool]] = []

    def wait(self, timeout: float | None = None) -> bool:
        """Release the lock until notified; return False if that did not happen in time."""
        notified: list[bool] = []
        self._waiting.append(notified)
        self._lock.release()
        try:
            return self._notified.wait_for(
                lambda: notified, longest_wait(True, timeout), ends_activation=True
            )
        finally:
            if notified in self._waiting:
                self._waiting = [other for other in self._waiting if other is not notified]
            self._lock.acquire()

    def wait_for(self, predicate: Callable[[], Any], timeout: float | None = None) -> Any:
        """Wait until ``predicate`` holds; return its last value."""
        kernel = self.kernel
        with kernel.interact():
            end = None if timeout is None else kernel.now() + from_seconds(timeout)
        held = predicate()
        while not held:
            kernel = self.kernel
            with kernel.interact():
                left = None if end is None else to_seconds(end - kernel.now())
            if left is not None and left <= 0:
                break
            self.wait(left)
            held = predicate()
        return held

    def notify(self, n: int = 1) -> None:
        """Wake the first ``n`` waiting tasks."""
        with self.kernel.interact():
            for notified in self._waiting[:n]:
                notified.append(True)
            self._waiting = self._waiting[n:]
            self._notified.notify()

    def notify_all(self) -> None:
        """Wake all waiting tasks."""
        self.notify(len(self._waiting))


def queue_module(kernel: Kernel) -> ModuleType:
    """Return the replacement of ``queue``."""
    names = bind(kernel, (Queue, SimpleQueue, LifoQueue, PriorityQueue))
    return make_module("queue", {**names, "Empty": real_queue.Empty, "Full": real_queue.Full})


class Queue(KernelBound):
    """A queue, first in, first out; ``maxsize`` 0 means no bound."""

    def __init__(self, maxsize: int = 0) -> None:
        self.maxsize = maxsize
        self._items: Any = deque()
        self._changed = waiting.Signal(self.kernel, type(self).__name__)
        self._unfinished = 0

    def _push(self, item: Any) -> None:
        self._items.append(item)

    def _pop(self) -> Any:
        return self._items.popleft()

    def _has_room(self) -> bool:
        return self.maxsize <= 0 or len(self._items) < self.maxsize

    def put(self, item: Any, block: bool = True, timeout: float | None = None) -> None:
        """Append ``item``; raise ``Full`` if there was no room in time."""
        with self.kernel.interact():
            if not self._changed.wait_for(
                self._has_room, longest_wait(block, timeout), ends_activation=block
            ):
                raise real_queue.Full
            self._push(item)
            self._unfinished += 1
            self._changed.notify()

    def get(self, block: bool = True, timeout: float | None = None) -> Any:
        """Remove and return the next item; raise ``Empty`` if there was none in time."""
        with self.kernel.interact():
            if not self._changed.wait_for(
                lambda: self._items, longest_wait(block, timeout), ends_activation=block
            ):
                raise real_queue.Empty
            item = self._pop()
            self._changed.notify()
            return item

    def put_nowait(self, item: Any) -> None:
        """Append ``item`` if there is room, else raise ``Full``."""
        self.put(item, block=False)

    def get_nowait(self) -> Any:
        """Remove and return the next item if there is one, else raise ``Empty``."""
        return self.get(block=False)

    def qsize(self) -> int:
        """Return the number of items."""
        with self.kernel.interact():
            return len(self._items)

    def empty(self) -> bool:
        """Return whether the queue is empty."""
        return self.qsize() == 0

    def full(self) -> bool:
        """Return whether the queue is full."""
        return self.qsize() >= self.maxsize > 0

    def task_done(self) -> None:
        """Record that an item has been processed."""
        with self.kernel.interact():
            if self._unfinished <= 0:
                raise ValueError("task_done() called too many times")
            self._unfinished -= 1
            self._changed.notify()

    def join(self) -> None:
        """Wait until every item has been processed."""
        self._changed.wait_for(lambda: self._unfinished == 0, ends_activation=True)


class SimpleQueue(Queue):
    """A queue, first in, first out, without a bound."""

    def __init__(self) -> None:
        super().__init__()


class LifoQueue(Queue):
    """A queue, last in, first out."""

    def _pop(self) -> Any:
        return self._items.pop()


class PriorityQueue(Queue):
    """A queue, smallest item first."""

    def __init__(self, maxsize: int = 0) -> None:
        super().__init__(maxsize)
        self._items = []

    def _push(self, item: Any) -> None:
        heappush(self._items, item)

    def _pop(self) -> Any:
        return heappop(self._items)
