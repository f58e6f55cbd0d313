"""``/clock`` in both directions: telling others our time, and taking theirs."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Protocol, runtime_checkable

from volery.base.errors import UsageError
from volery.base.time import Ns, S
from volery.ros.graph.clock import CLOCK, CLOCK_PERIOD, CLOCK_TYPE
from volery.ros.graph.context import Context
from volery.ros.graph.node import BEST_AVAILABLE, QoS
from volery.ros.messages import new, to_cdr
from volery.ros.transports.wire import Parcel, Wire

NEWEST = QoS(depth=1, reliability=BEST_AVAILABLE)


@runtime_checkable
class Followable(Protocol):
    """A kernel whose time can be told to go on."""

    def advance(self, by: Ns) -> None:
        """Let time pass."""


def tell(context: Context, wire: Wire, period: Ns = CLOCK_PERIOD) -> Callable[[], None]:
    """Publish the kernel's time as ``/clock`` each *period* of it, whoever listens. Returns what ends it."""
    outlet = wire.advertise(CLOCK, CLOCK_TYPE, QoS(depth=1))

    def tick() -> None:
        sec, nanosec = divmod(context.stamp(), S)
        outlet.send(to_cdr(new(CLOCK_TYPE, clock={"sec": sec, "nanosec": nanosec})))

    ticking = context.kernel.every(period, tick)

    def end() -> None:
        ticking.cancel()
        outlet.close()

    return end


def follow(context: Context, wire: Wire, since: Ns | None = None) -> Callable[[], None]:
    """Let the kernel's time be what ``/clock`` says. Returns what ends it.

    *since* is ROS time at the kernel's zero, where that is agreed; else it is what is heard first.

    The kernel's time never goes back: where ``/clock`` does (a simulation or a recording begins anew), ROS
    time does, and what waits goes on waiting for the time that is left. ``UsageError`` for a kernel whose
    time passes by itself.
    """
    kernel = context.kernel
    if not isinstance(kernel, Followable):
        raise UsageError(
            f"a {type(kernel).__name__} keeps its own time; to follow {CLOCK} take a FollowingKernel"
        )
    guard = threading.Lock()
    last = [] if since is None else [since]

    def arrived(parcel: Parcel) -> None:
        stamp = parcel.read(parcel.data).clock.to_nsec()
        with guard:
            if last and stamp >= last[0]:
                kernel.advance(stamp - last[0])
            else:
                context.epoch = stamp - context.kernel.now()
            last[:] = [stamp]

    return wire.subscribe(CLOCK, CLOCK_TYPE, NEWEST, arrived).close
