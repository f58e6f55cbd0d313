"""``rclpy`` on the embedded graph: ``modules(graph)`` gives the modules that a component's file imports.

Whose context a call belongs to follows the component that the current task computes for. As a launch file
does, the component's name names its first node.

Differences from the real one, on purpose: an attribute that is not there yet says so; the callbacks of an
executor run in the order in which they became ready, not kind by kind; connecting takes no time; deadlines,
lifespans and liveliness are refused, not ignored; a ``Rate`` needs nobody to spin; a service's callback
cannot be a coroutine. Arrays of numbers are numpy's. A node joins ``/rosout`` with its first line that
somebody listens for. The threads of a ``MultiThreadedExecutor`` take turns: one goes on where another waits.
"""

from volery.ros.client_libraries.library_base import Launch
from volery.ros.client_libraries.rclpy.module import modules

__all__ = ["Launch", "modules"]
