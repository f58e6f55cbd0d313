"""``rospy`` on the embedded graph: ``modules(graph)`` gives the modules that a component's file imports.

A call belongs to the node of the component of the current task, so that one set of modules serves all
components of a run. As in a launch file, the name of the component names the node, whatever name
``init_node`` gets.

Intended differences from the real library: a missing attribute is reported with the available ones; there is
one thread per subscription and per service request, as in rospy, but two threads never execute Python code at
the same instant; connecting takes no time; a node joins ``/rosout`` when it logs its first line that has a
subscriber; at the end of a run shutdown hooks are called, but the code after ``spin`` is not executed.
"""

from volery.ros.client_libraries.library_base import Launch
from volery.ros.client_libraries.rospy.module import modules

__all__ = ["Launch", "modules"]
