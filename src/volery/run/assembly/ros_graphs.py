"""Real ROS graphs by name, and a script's way onto them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.kernel.wall import WallKernel
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
"""``ros1``: that of ``ROS_MASTER_URI``. ``ros2``: that of ``ROS_DOMAIN_ID``."""


def open_graph(
    kernel: Kernel, name: str, *, start_master: bool = False, epoch: Ns | None = None
) -> TransportGraph:
    """The graph called *name*, one of ``GRAPHS``. *epoch*: ROS time at the kernel's zero, else Unix time.

    *start_master* starts a ROS 1 master where none answers, and stops it when the graph is closed.
    Raises ``UsageError`` if there is no such kind or it is not installed, ``LinkError`` if it does not
    answer.
    """
    if name not in _OPENERS:
        raise UsageError(f"no graph {name!r}{did_you_mean(name, GRAPHS)}; there is {choices(GRAPHS)}")
    return _OPENERS[name](kernel, start_master, epoch)


@contextmanager
def on_graph(name: str, script: str) -> Iterator[RosGraph]:
    """The graph called *name*, in real time, for a script of that name; closed when the context is left."""
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
