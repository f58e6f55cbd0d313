"""``rclpy`` on the embedded graph: ``modules(graph)`` gives the modules that a component's file imports.

A call belongs to the context of the component of the current task. As in a launch file, the name of the
component names its first node.

Intended differences from the real library: a missing attribute is reported with the available ones; the
callbacks of an executor run in the order in which they became ready, not kind by kind; connecting takes no
time; a ``Rate`` works without a spinning executor; a timer of 0 s calls each millisecond; what rcl's wait set
needs (waitables) is refused; a node joins
``/rosout`` when it logs its first line that has a subscriber; the threads of a ``MultiThreadedExecutor`` take
turns, one continues where another waits.
"""

from volery.ros.client_libraries.library_base import Launch
from volery.ros.client_libraries.rclpy.module import modules

__all__ = ["Launch", "modules"]
