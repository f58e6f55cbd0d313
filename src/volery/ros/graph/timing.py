"""Timers and rates of a node."""

from __future__ import annotations

from collections.abc import Callable

from volery.base.errors import UsageError
from volery.base.time import US, Ns
from volery.kernel.api import Handle
from volery.kernel.waiting import Rate, current_task
from volery.kernel.waiting import sleep as wait
from volery.ros.graph.context import Member
from volery.ros.graph.group import CallbackGroup, Work


def sleep(member: Member, duration: Ns) -> None:
    """Block the current task for *duration*; what the sleep itself takes is executed meanwhile."""
    with member.context.kernel as kernel:
        member.pay("sleep", max(duration, 0) / US)
        wait(kernel, duration)


class NodeRate:
    """See ``volery.ros.graph.node.Rate``; a ``volery.kernel.waiting.Rate`` that is paid for."""

    def __init__(self, member: Member, period: Ns) -> None:
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
    """See ``volery.ros.graph.node.Timer``. A period that ends while its last callback still waits is left out."""

    def __init__(
        self, member: Member, period: Ns, callback: Callable[[], None], group: CallbackGroup
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
