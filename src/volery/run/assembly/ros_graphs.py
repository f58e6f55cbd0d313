"""Real ROS graphs by name. ROS itself is imported when a graph is opened."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.kernel.wall import WallKernel

if TYPE_CHECKING:
    from volery.ros.graph import RosGraph
    from volery.ros.transports.transport_graph import TransportGraph


def _ros1(kernel: Kernel, start_master: bool, epoch: Ns | None) -> TransportGraph:
    from volery.ros.transports.ros1 import ros1_graph

    return ros1_graph(kernel, start_master=start_master, epoch=epoch)


def _ros2(kernel: Kernel, start_master: bool, epoch: Ns | None) -> TransportGraph:
    from volery.ros.transports.ros2 import ros2_graph

    return ros2_graph(kernel, epoch=epoch)


_OPENERS: dict[str, Callable[[Kernel, bool, Ns | None], TransportGraph]] = {"ros1": _ros1, "ros2": _ros2}
GRAPHS = tuple(_OPENERS)
"""``ros1`` is the graph of ``ROS_MASTER_URI``, ``ros2`` that of ``ROS_DOMAIN_ID``."""


def open_graph(
    kernel: Kernel, name: str, *, start_master: bool = False, epoch: Ns | None = None
) -> TransportGraph:
    """Join a real ROS graph.

    Args:
        kernel: Clock and tasks of the callbacks.
        name: One of ``GRAPHS``.
        start_master: Start a ROS 1 master if none answers, and stop it when the graph is closed.
        epoch: ROS time at the zero of the kernel in nanoseconds; None for Unix time.

    Raises:
        UsageError: *name* is unknown, or that version of ROS is not installed.
        LinkError: The graph does not answer.
    """
    if name not in _OPENERS:
        raise UsageError(f"no graph {name!r}{did_you_mean(name, GRAPHS)}; there is {choices(GRAPHS)}")
    return _OPENERS[name](kernel, start_master, epoch)


@contextmanager
def on_graph(name: str, script: str) -> Iterator[RosGraph]:
    """Join the graph *name* in real time for the calling thread, called *script*; leave it at the end."""
    kernel = WallKernel()
    kernel.start()
    try:
        with kernel.adopt(script):
            graph = open_graph(kernel, name)
            try:
                yield graph
            finally:
                graph.close()
    finally:
        kernel.close()
