"""Time that somebody else keeps: it stands still until it is told to go on (``/clock`` of real ROS)."""

from __future__ import annotations

from volery.base.time import Ns
from volery.kernel.interrupt import LONGEST_WAIT_S
from volery.kernel.wall import WallKernel
from volery.trace.events import Record, ignore


class FollowingKernel(WallKernel):
    """A kernel on threads whose time goes on by ``advance`` alone.

    What waits for a time waits until it has been told of it, however long that takes on the wall.
    """

    def __init__(self, record: Record = ignore) -> None:
        super().__init__(record)
        self._now: Ns = 0

    def now(self) -> Ns:
        """The sum of all advances."""
        return self._now

    def advance(self, by: Ns) -> None:
        """Let time pass; from any thread. What has become due happens."""
        with self._monitor:
            self._now += max(0, by)
            for task in self.root.all_tasks():
                task.flow.woken.notify()  # it looks itself whether its time has come
            self._bell.put(None)

    def _wall_seconds(self, until: Ns) -> float:
        return 0.0 if until <= self._now else LONGEST_WAIT_S
