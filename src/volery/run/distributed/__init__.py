"""A model on a real ROS graph: each component of the application is a process of its own.

In the run's own process, on the node ``/volery``, live the world, the autopilots, the nodes that serve the
vehicles, ``/clock``, and the components of the environment: they know the truth about vehicles, so they live
where the world is. A component of the application is a node of its own name; its time is ``/clock``. Ports
between processes are services: ``/<component>/<operation>``, of type ``volery_msgs/srv/Call``. What the
processes have to tell the run (events, that they are ready, that they fail) goes over a pipe and not over the
graph.

Computing takes the time that it takes on this machine and is not accounted for: ``without_computers`` says
what of a model means nothing then.
"""

from volery.run.distributed.plan import NODE, HostPlatform, unallocated, without_computers
from volery.run.distributed.processes import DistributedRun, GraphSettings

__all__ = ["NODE", "DistributedRun", "GraphSettings", "HostPlatform", "unallocated", "without_computers"]
