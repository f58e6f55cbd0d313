"""All modules that a file written for ROS may import in a run."""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import NoReturn

from volery.ros import messages
from volery.ros.client_libraries import (
    actionlib,
    mavros_package,
    message_filters,
    rclpy,
    ros1_tools,
    ros2_tools,
    rosbag_module,
    rospy,
    tf2,
)
from volery.ros.client_libraries.library_base import AtEnd, Launch, ignore_end
from volery.ros.graph import Node, RosGraph

_UNAVAILABLE = {
    "dynamic_reconfigure": "ask rospy.get_param each time, as a parameter may be set while it runs",
    "dynamic_reconfigure.client": "use rospy.set_param",
    "dynamic_reconfigure.server": "ask rospy.get_param each time, as a parameter may be set while it runs",
}
"""Libraries that are not available, and their replacement."""


def importable_modules(
    graph: RosGraph,
    launched: Mapping[str, Launch] | None = None,
    nodes: Mapping[str, Node] | None = None,
    at_end: AtEnd = ignore_end,
) -> dict[str, ModuleType]:
    """Return the modules by name; interface packages have the graph's classes, not those of a library.

    For the arguments see ``rospy.modules``.
    """
    given = launched, nodes, at_end
    found = {**rospy.modules(graph, *given), **rclpy.modules(graph, *given)}
    return {
        **found,
        **messages.modules(),
        **tf2.modules(graph, found["rospy"], found["rclpy.executors"]),
        **actionlib.modules(found["rospy"]),
        **ros1_tools.modules(found["rospy"]),
        **ros2_tools.modules(),
        **rosbag_module.modules(found["rospy"]),
        **mavros_package.modules(found["rospy"]),
        **message_filters.modules(found["rospy"], found["rclpy.time"]),
        **{name: _unavailable_module(name, instead) for name, instead in _UNAVAILABLE.items()},
    }


def _unavailable_module(name: str, instead: str) -> ModuleType:
    """Return a module that raises ``ImportError`` on the first use of its content."""
    module = ModuleType(name)
    module.__path__ = []

    def missing(attribute: str) -> NoReturn:
        if attribute.startswith("__"):
            raise AttributeError(attribute)
        raise ImportError(f"{name}.{attribute}: {name} is not there on the embedded graph; {instead}")

    vars(module)["__getattr__"] = missing
    return module
