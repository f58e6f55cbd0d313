"""``threading`` on the flows of control of the run: a thread is a task at its component's place.

``queue`` on the clock of the run.
"""

from __future__ import annotations

import queue as real_queue
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from heapq import heappop, heappush
from types import ModuleType, TracebackType
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import from_seconds, to_seconds
from volery.components.component_api import component_of
from volery.components.virtual_stdlib.module import KernelBound, bind, make_module, within
from volery.kernel import waiting
from volery.kernel.api import Kernel
from volery.kernel.task import Task
from volery.kernel.waiting import Signal


def threading_module(kernel: Kernel) -> ModuleType:
    """Stands in for ``threading``."""
    names = bind(kernel, (Thread, Timer, Lock, RLock, Event, Semaphore, BoundedSemaphore, Condition))
    names["current_thread"] = lambda: waiting.current_task(kernel)
    names["get_ident"] = lambda: waiting.current_task(kernel).name
    return make_module("threading", names)


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
        """Begin. Once only."""
        if self._task is not None:
            raise RuntimeError("threads can only be started once")
        with self.kernel as kernel:
            instance = component_of(waiting.current_task(kernel))
            if instance is None:
                raise UsageError("threading.Thread: only components start threads")
            body = self._body(lambda: instance.guard(self.run, f"thread {self.name}"))
            self._task = kernel.spawn(body, f"{instance.name}/{self.name}", instance.context, instance.scope)

    def _body(self, run: Callable[[], object]) -> Callable[[], None]:
        def body() -> None:
            try:
                run()
            finally:
                self._over = True
                self._ended.notify()

        return body

    def run(self) -> None:
        """What it does; a class of its own may say it instead of a target."""
        if self._target is not None:
            self._target(*self._args, **self._kwargs)

    def join(self, timeout: float | None = None) -> None:
        """Wait for its end."""
        if self._task is None:
            raise RuntimeError("cannot join thread before it is started")
        self._ended.wait_for(lambda: self._over, within(True, timeout), ends_activation=True)

    def is_alive(self) -> bool:
        """Started and not ended."""
        with self.kernel:
            return self._task is not None and not self._over


class Timer(Thread):
    """Calls a function once, after a while."""

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
        """It will not call."""
        with self.kernel:
            self._cancelled = True

    def run(self) -> None:
        """Wait, then call."""
        waiting.sleep(self.kernel, from_seconds(self.interval))
        if not self._cancelled:
            super().run()


class ContextManaged(KernelBound):
    """What a ``with`` statement takes and gives back."""

    acquire: Callable[..., bool]
    release: Callable[..., None]

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.release()


class Lock(ContextManaged):
    """Held by at most one task."""

    def __init__(self) -> None:
        self._owner: Task | None = None
        self._free = waiting.Signal(self.kernel, type(self).__name__)

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        """Take it; False if it was not free in time."""
        longest = within(blocking, timeout)
        with self.kernel as kernel:
            if not self._free.wait_for(lambda: self._owner is None, longest, ends_activation=blocking):
                return False
            self._owner = waiting.current_task(kernel)
            return True

    def release(self) -> None:
        """Give it back. Never blocks, so that it also works in a task that is being ended."""
        if self._owner is None:
            task = self.kernel.current()
            if task is not None and task.scope.cancelled:
                return  # its end came while it waited to have the lock back
            raise RuntimeError("release unlocked lock")
        self._owner = None
        self._free.notify()

    def locked(self) -> bool:
        """Whether somebody holds it."""
        with self.kernel:
            return self._owner is not None


class RLock(Lock):
    """A lock that its holder may take again."""

    def __init__(self) -> None:
        super().__init__()
        self._depth = 0

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        """Take it, once more if it is held by the current task."""
        if self._owner is not None and self._owner is self.kernel.current():
            self._depth += 1
            return True
        taken = super().acquire(blocking, timeout)
        if taken:
            self._depth = 1
        return taken

    def release(self) -> None:
        """Give it back as often as it was taken."""
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
        """Block until it is raised; False if it was not in time."""
        return self._event.wait(within(True, timeout))


class Semaphore(ContextManaged):
    """Counts what is free."""

    def __init__(self, value: int = 1) -> None:
        if value < 0:
            raise ValueError("semaphore initial value must be >= 0")
        self._value = value
        self._free = waiting.Signal(self.kernel, type(self).__name__)

    def acquire(self, blocking: bool = True, timeout: float | None = None) -> bool:
        """Take one; False if none was free in time."""
        longest = within(blocking, timeout)
        with self.kernel:
            if not self._free.wait_for(lambda: self._value > 0, longest, ends_activation=blocking):
                return False
            self._value -= 1
            return True

    def release(self, n: int = 1) -> None:
        """Give *n* back. Never blocks."""
        self._value += n
        self._free.notify()


class BoundedSemaphore(Semaphore):
    """A semaphore that no more can be given back to than it began with."""

    def __init__(self, value: int = 1) -> None:
        super().__init__(value)
        self._most = value

    def release(self, n: int = 1) -> None:
        """Give *n* back."""
        if self._value + n > self._most:
            raise ValueError("Semaphore released too many times")
        super().release(n)


class Condition(ContextManaged):
    """A lock to wait under until somebody notifies."""

    def __init__(self, lock: Lock | None = None) -> None:
        self._lock: Lock = lock or bind(self.kernel, (RLock,))["RLock"]()
        self.acquire = self._lock.acquire
        self.release = self._lock.release
        self._told = waiting.Signal(self.kernel, "Condition")
        self._waiting: list[list[bool]] = []

    def wait(self, timeout: float | None = None) -> bool:
        """Let go of the lock until notified; False if that did not happen in time."""
        told: list[bool] = []
        self._waiting.append(told)
        self._lock.release()
        try:
            return self._told.wait_for(lambda: told, within(True, timeout), ends_activation=True)
        finally:
            if told in self._waiting:
                self._waiting = [other for other in self._waiting if other is not told]
            self._lock.acquire()

    def wait_for(self, predicate: Callable[[], Any], timeout: float | None = None) -> Any:
        """Wait until *predicate* holds; its last value."""
        with self.kernel as kernel:
            end = None if timeout is None else kernel.now() + from_seconds(timeout)
        held = predicate()
        while not held:
            with self.kernel as kernel:
                left = None if end is None else to_seconds(end - kernel.now())
            if left is not None and left <= 0:
                break
            self.wait(left)
            held = predicate()
        return held

    def notify(self, n: int = 1) -> None:
        """Wake the first *n* who wait."""
        with self.kernel:
            for told in self._waiting[:n]:
                told.append(True)
            self._waiting = self._waiting[n:]
            self._told.notify()

    def notify_all(self) -> None:
        """Wake all who wait."""
        self.notify(len(self._waiting))


def queue_module(kernel: Kernel) -> ModuleType:
    """Stands in for ``queue``."""
    names = bind(kernel, (Queue, SimpleQueue, LifoQueue, PriorityQueue))
    return make_module("queue", {**names, "Empty": real_queue.Empty, "Full": real_queue.Full})


class Queue(KernelBound):
    """First in, first out; ``maxsize`` 0 for no bound."""

    def __init__(self, maxsize: int = 0) -> None:
        self.maxsize = maxsize
        self._items: Any = deque()
        self._changed = Signal(self.kernel, type(self).__name__)
        self._unfinished = 0

    def _push(self, item: Any) -> None:
        self._items.append(item)

    def _pop(self) -> Any:
        return self._items.popleft()

    def _has_room(self) -> bool:
        return self.maxsize <= 0 or len(self._items) < self.maxsize

    def put(self, item: Any, block: bool = True, timeout: float | None = None) -> None:
        """Append *item*; ``Full`` if there was no room in time."""
        with self.kernel:
            if not self._changed.wait_for(self._has_room, within(block, timeout), ends_activation=block):
                raise real_queue.Full
            self._push(item)
            self._unfinished += 1
            self._changed.notify()

    def get(self, block: bool = True, timeout: float | None = None) -> Any:
        """Take the next item; ``Empty`` if there was none in time."""
        with self.kernel:
            if not self._changed.wait_for(lambda: self._items, within(block, timeout), ends_activation=block):
                raise real_queue.Empty
            item = self._pop()
            self._changed.notify()
            return item

    def put_nowait(self, item: Any) -> None:
        """Append *item* if there is room, else ``Full``."""
        self.put(item, block=False)

    def get_nowait(self) -> Any:
        """Take the next item if there is one, else ``Empty``."""
        return self.get(block=False)

    def qsize(self) -> int:
        """How many items wait."""
        with self.kernel:
            return len(self._items)

    def empty(self) -> bool:
        """Whether no item waits."""
        return self.qsize() == 0

    def full(self) -> bool:
        """Whether there is no room."""
        return self.qsize() >= self.maxsize > 0

    def task_done(self) -> None:
        """An item that was taken has been dealt with."""
        with self.kernel:
            if self._unfinished <= 0:
                raise ValueError("task_done() called too many times")
            self._unfinished -= 1
            self._changed.notify()

    def join(self) -> None:
        """Wait until every item has been dealt with."""
        self._changed.wait_for(lambda: self._unfinished == 0, ends_activation=True)


class SimpleQueue(Queue):
    """First in, first out, without a bound."""

    def __init__(self) -> None:
        super().__init__()


class LifoQueue(Queue):
    """Last in, first out."""

    def _pop(self) -> Any:
        return self._items.pop()


class PriorityQueue(Queue):
    """Smallest out first."""

    def __init__(self, maxsize: int = 0) -> None:
        super().__init__(maxsize)
        self._items = []

    def _push(self, item: Any) -> None:
        heappush(self._items, item)

    def _pop(self) -> Any:
        return heappop(self._items)
