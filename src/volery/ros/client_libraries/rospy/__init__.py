"""``rospy`` on the embedded graph: ``modules(graph)`` gives the modules that a component's file imports.

Whose node a call belongs to follows the component that the current task computes for, so one set of modules
serves all components of a run. As a launch file does, the component's name names the node, whatever
``init_node`` says.

Differences from the real one, on purpose: an attribute that is not there yet says so; a topic has one thread
a subscription and a service one a request, as there, but they never run at the same instant as each other's
Python code; connecting takes no time; ``Header.seq`` is always 0; a ``Quaternion`` starts as no rotation
(ROS 2) and not as zero; a node joins ``/rosout`` with its first line that somebody listens for; when the run
ends, shutdown hooks are called, but what a file does behind ``spin`` is not.
"""

from volery.ros.client_libraries.library_base import Launch
from volery.ros.client_libraries.rospy.module import modules

__all__ = ["Launch", "modules"]
