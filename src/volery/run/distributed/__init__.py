"""A model on a real ROS graph: each component of the application is a process of its own.

The run's own process has the node ``/volery``. It contains the world, the autopilots, the nodes that serve
the vehicles, ``/clock``, and the components of the environment, which need the true state of the vehicles.
A component of the application is a node of its own name and takes its time from ``/clock``. Ports between
processes are services ``/<component>/<operation>`` of type ``volery_msgs/srv/Call``. Events, readiness and
failures go to the run over a pipe and not over the graph.

Computing takes the time of this machine and is not accounted for; ``without_computers`` removes what has no
meaning then.
"""

from volery.run.distributed.plan import NODE, HostPlatform, unallocated, without_computers, without_truth
from volery.run.distributed.processes import DistributedRun, GraphSettings

__all__ = [
    "NODE",
    "DistributedRun",
    "GraphSettings",
    "HostPlatform",
    "unallocated",
    "without_computers",
    "without_truth",
]
