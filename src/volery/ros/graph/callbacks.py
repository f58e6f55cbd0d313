"""Callback groups, timers and rates of a node.

Callbacks that are ready wait in a group, in the order of their arrival, until a task spins the group.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial

from volery.base.errors import UsageError
from volery.base.time import US, Ns
from volery.kernel.api import Handle
from volery.kernel.task import Task
from volery.kernel.waiting import Rate, current_task, end_activation
from volery.ros.graph.graph_context import NodeContext
from volery.ros.graph.work import Work

FIRST, NEXT = 1.0, 0.0
"""The x of ``spin_once`` in a ``Tariff``."""


class CallbackGroup:
    """See ``volery.ros.graph.interface.ReadyCallbacks``.

    A wait in ``spin_once`` ends the caller's activation; the callback that ends the wait is a new one,
    released when its message, request or timer arrived. Polling (``within=0``) belongs to the activation in
    progress.

    Args:
        node: Node that the callbacks belong to.
        label: Name in the message of a deadlock.
        start: Called at once, as a framework callback, with each callback that becomes ready.

    An executor that waits for several groups sets ``on_ready``, which is called whenever a callback has
    become ready, and calls ``take``.
    """

    def __init__(self, node: NodeContext, label: str, start: Callable[[Work], None] | None = None) -> None:
        self._node = node
        self._name = f"{node.name} ({label})"
        self._start = start
        self._ready: deque[Work] = deque()
        self._waiting: list[Task] = []
        self._spin: float = FIRST  # the x of the next ``spin_once``
        self.on_ready: Callable[[], None] | None = None

    def __len__(self) -> int:
        return len(self._ready)

    def add(self, work: Work) -> None:
        """Add a callback that has become ready. Never blocks."""
        kernel = self._node.kernel
        if self._start is not None:
            if kernel.current() is None:
                self._start(work)
            else:
                kernel.call_at(kernel.now(), partial(self._start, work))
            return
        with kernel.guard:
            self._ready.append(work)
            for task in self._waiting:
                kernel.wake(task)
        if self.on_ready is not None:
            self.on_ready()

    @property
    def oldest(self) -> Ns | None:
        """Time at which the next callback became ready; None if none is."""
        return self._ready[0].arrived if self._ready else None

    def take(self) -> Work:
        """Remove and return the next callback, charged as ``spin_once``; ``IndexError`` if none is ready."""
        work = self._ready.popleft()
        self._charge_spin()
        return work

    def wake(self) -> None:
        """Wake the waiting tasks: the node has been closed."""
        kernel = self._node.kernel
        with kernel.guard:
            for task in self._waiting:
                kernel.wake(task)

    def spin_once(self, within: Ns | None = None) -> bool:
        """Run the next callback; see ``Group``."""
        kernel = self._node.kernel
        with kernel.interact():
            if within == 0:
                self._charge_spin()
                work = self._ready.popleft() if self._ready else None
            else:
                task = current_task(kernel)
                end_activation(kernel, task)
                if not (self._ready or self._node.closed):
                    self._wait(task, None if within is None else kernel.now() + within)
                work = self._ready.popleft() if self._ready else None
                task.release(work.arrived if work else kernel.now())
                self._node.consume("spin_once", self._spin)
                self._spin = NEXT
        if work is None:
            return False
        work.run()
        return True

    def spin_available(self) -> None:
        """Run the callbacks that are ready now, as one poll; later ones wait for the next spin."""
        with self._node.kernel.interact():
            self._charge_spin()
            count = len(self._ready)
        for _ in range(count):
            if self._ready:
                self._ready.popleft().run()

    def spin(self) -> None:
        """Run callbacks as they become ready until the node is closed."""
        while not self._node.closed:
            self.spin_once()

    def _charge_spin(self) -> None:
        self._node.consume("spin_once", self._spin)
        self._spin = NEXT

    def _wait(self, task: Task, deadline: Ns | None) -> None:
        """Block until a callback is ready, the node is closed, or `deadline`, ns, has passed."""
        self._waiting.append(task)
        try:
            while self._node.kernel.park(deadline, self._name):
                if self._ready or self._node.closed:
                    return
        finally:
            self._waiting.remove(task)


class NodeRate:
    """See ``volery.ros.graph.interface.LoopRate``; a ``Rate`` of the kernel whose sleeps are priced."""

    def __init__(self, node: NodeContext, period: Ns) -> None:
        self._node = node
        self._rate = Rate(node.kernel, period)

    def remaining(self) -> Ns:
        """Return the time until the next release, ns; 0 for a loop that is late."""
        kernel = self._node.kernel
        with kernel.interact():
            return max(0, self._rate.due - kernel.now())

    def sleep(self) -> None:
        """Block until the next release."""
        with self._node.kernel.interact():
            self._node.consume("sleep", self.remaining() / US)
            self._rate.sleep()


class NodeTimer:
    """See ``interface.Timer``. Periods that end while the last callback still waits are skipped."""

    def __init__(
        self, node: NodeContext, period: Ns, callback: Callable[[], None], group: CallbackGroup
    ) -> None:
        if period <= 0:
            raise UsageError(f"node {node.name}: a timer's period of {period} ns; it must be above 0")
        self._node, self._period, self._callback, self._group = node, period, callback, group
        self._ready = False
        self._due = node.kernel.now() + period
        self._next: Handle | None = node.kernel.call_at(self._due, self._fire)

    def _fire(self) -> None:
        if self._node.closed:
            self._next = None
            return
        if not self._ready:
            self._ready = True
            self._group.add(Work(self._due, self._run))
        self._due += self._period
        self._next = self._node.kernel.call_at(self._due, self._fire)

    def _run(self) -> None:
        self._ready = False
        if self._next is not None:
            self._callback()

    def cancel(self) -> None:
        """Stop the timer."""
        with self._node.kernel.guard:
            if self._next is not None:
                self._next.cancel()
                self._next = None
