"""``/clock``: ticks while somebody listens, and costs nobody anything: it is no part of the system."""

from __future__ import annotations

from volery.base.time import MS, Ns, S
from volery.kernel.api import Handle
from volery.ros.graph.context import Context
from volery.ros.messages import cdr_size, new

CLOCK = "/clock"
CLOCK_TYPE = "rosgraph_msgs/msg/Clock"
CLOCK_PERIOD: Ns = 10 * MS


class Clock:
    """The publisher of ``/clock``."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._ticking: Handle | None = None

    def listen(self) -> None:
        """Somebody has subscribed: tick, if it does not tick already."""
        if self._ticking is None:
            self._ticking = self._context.kernel.every(CLOCK_PERIOD, self._tick)

    def _tick(self) -> None:
        listeners = self._context.topics[CLOCK].subscriptions
        if not listeners and self._ticking is not None:
            self._ticking.cancel()
            self._ticking = None
        now = self._context.kernel.now()
        stamp = self._context.stamp()
        for subscription in tuple(listeners):
            message = new(CLOCK_TYPE, clock={"sec": stamp // S, "nanosec": stamp % S})
            subscription.arrive(message, now, CLOCK, cdr_size(message))
