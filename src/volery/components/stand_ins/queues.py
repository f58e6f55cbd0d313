"""``queue`` on the clock of the run."""

from __future__ import annotations

import queue as real_queue
from collections import deque
from heapq import heappop, heappush
from types import ModuleType
from typing import Any

from volery.components.stand_ins.module import Bound, bind, make_module, within
from volery.kernel.api import Kernel
from volery.kernel.waiting import Signal


def queue_module(kernel: Kernel) -> ModuleType:
    """Stands in for ``queue``."""
    names = bind(kernel, (Queue, SimpleQueue, LifoQueue, PriorityQueue))
    return make_module("queue", {**names, "Empty": real_queue.Empty, "Full": real_queue.Full})


class Queue(Bound):
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
