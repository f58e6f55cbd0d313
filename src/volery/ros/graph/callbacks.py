"""Callback groups: what is ready waits here in the order of its arrival until somebody spins.

Timers and rates of a node.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial

from volery.base.errors import UsageError
from volery.base.time import US, Ns
from volery.kernel.api import Handle
from volery.kernel.waiting import Rate, Signal, current_task, end_activation
from volery.kernel.waiting import sleep as wait
from volery.ros.graph.graph_context import NodeContext
from volery.ros.graph.interface import Work

__all__ = ["FIRST", "NEXT", "CallbackGroup", "Work"]

FIRST, NEXT = 1.0, 0.0


class CallbackGroup:
    """See ``volery.ros.graph.interface.Group``.

    A wait in ``spin_once`` ends the caller's activation; the callback that ends the wait is a new one,
    released when its message (request, timer) arrived. Polling (``within=0``) belongs to the activation that
    is under way. With *start* nothing waits: it is given the work at once, as house code.

    An executor that waits for several groups at once sets ``on_ready``, which is called whenever something
    has become ready, and ``take``s it.
    """

    def __init__(self, member: NodeContext, label: str, start: Callable[[Work], None] | None = None) -> None:
        self._member = member
        self._start = start
        self._ready: deque[Work] = deque()
        self._filled = Signal(member.context.kernel, f"{member.name} ({label})")
        self._spun = False
        self.on_ready: Callable[[], None] | None = None

    def __len__(self) -> int:
        return len(self._ready)

    def add(self, work: Work) -> None:
        """A callback has become ready. Never blocks."""
        if self._start is not None:
            kernel = self._member.context.kernel
            if kernel.current() is None:
                self._start(work)
            else:
                kernel.call_at(kernel.now(), partial(self._start, work))
            return
        self._ready.append(work)
        self._filled.notify()
        if self.on_ready is not None:
            self.on_ready()

    @property
    def oldest(self) -> Ns | None:
        """Since when the next one has been ready; ``None`` if none is."""
        return self._ready[0].arrived if self._ready else None

    def take(self) -> Work:
        """The next one: who takes it pays for a ``spin_once`` and runs it. ``IndexError`` if none waits."""
        work = self._ready.popleft()
        self._pay()
        return work

    def wake(self) -> None:
        """Let those who wait look again: the node has been closed."""
        self._filled.notify()

    def spin_once(self, within: Ns | None = None) -> bool:
        """Run the next callback; see ``Group``."""
        member = self._member
        with member.context.kernel:
            if within == 0:
                self._pay()
                work = self._ready.popleft() if self._ready else None
            else:
                work = self._wait(within)
                self._pay()
        if work is None:
            return False
        work.run()
        return True

    def spin_available(self) -> None:
        """Run what is ready now, as one poll; what becomes ready meanwhile waits for the next."""
        with self._member.context.kernel:
            self._pay()
            count = len(self._ready)
        for _ in range(count):
            if self._ready:
                self._ready.popleft().run()

    def spin(self) -> None:
        """Run callbacks as they come until the node is closed."""
        while not self._member.closed:
            self.spin_once()

    def _pay(self) -> None:
        self._member.pay("spin_once", NEXT if self._spun else FIRST)
        self._spun = True

    def _wait(self, within: Ns | None) -> Work | None:
        kernel = self._member.context.kernel
        end_activation(kernel)
        if not self._ready:
            self._filled.wait_for(lambda: self._ready or self._member.closed, within)
        work = self._ready.popleft() if self._ready else None
        current_task(kernel).release(work.arrived if work else kernel.now())
        return work


def sleep(member: NodeContext, duration: Ns) -> None:
    """Block the current task for *duration*; what the sleep itself takes is executed meanwhile."""
    with member.context.kernel as kernel:
        member.pay("sleep", max(duration, 0) / US)
        wait(kernel, duration)


class NodeRate:
    """See ``volery.ros.graph.interface.Rate``; a ``volery.kernel.waiting.Rate`` that is paid for."""

    def __init__(self, member: NodeContext, period: Ns) -> None:
        self._member = member
        kernel = member.context.kernel
        self._rate = Rate(kernel, period)
        self._last = kernel.now()

    def remaining(self) -> Ns:
        """Until the next release; 0 for a loop that is late."""
        with self._member.context.kernel as kernel:
            return max(0, self._last + self._rate.period - kernel.now())

    def sleep(self) -> None:
        """Block until the next release."""
        with self._member.context.kernel as kernel:
            self._member.pay("sleep", self.remaining() / US)
            self._rate.sleep()
            released = current_task(kernel).released
            self._last = kernel.now() if released is None else released


class NodeTimer:
    """See ``volery.ros.graph.interface.Timer``. A period that ends while its last callback still waits is left out."""

    def __init__(
        self, member: NodeContext, period: Ns, callback: Callable[[], None], group: CallbackGroup
    ) -> None:
        if period <= 0:
            raise UsageError(f"node {member.name}: a timer's period of {period} ns; it must be above 0")
        self._member, self._period, self._callback, self._group = member, period, callback, group
        self._waits = False
        self._due = member.context.kernel.now() + period
        self._next: Handle | None = member.context.kernel.call_at(self._due, self._fire)

    def _fire(self) -> None:
        if self._member.closed:
            self._next = None
            return
        if not self._waits:
            self._waits = True
            self._group.add(Work(self._due, self._run))
        self._due += self._period
        self._next = self._member.context.kernel.call_at(self._due, self._fire)

    def _run(self) -> None:
        self._waits = False
        if self._next is not None:
            self._callback()

    def cancel(self) -> None:
        """Call back no longer."""
        with self._member.context.kernel.guard:
            if self._next is not None:
                self._next.cancel()
                self._next = None
