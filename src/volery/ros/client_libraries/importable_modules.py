"""All that a file written for ROS may import in a run: faces of client libraries, and what goes with them."""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import NoReturn

from volery.ros.client_libraries import message_filters, rclpy, rospy, tf2
from volery.ros.client_libraries.library_base import AtEnd, Launch, ignore_end
from volery.ros.graph import Node, RosGraph

_ABSENT = {
    "actionlib": "make topics and services of it, or use rclpy.action",
    "dynamic_reconfigure": "ask rospy.get_param each time, as a parameter may be set while it runs",
    "dynamic_reconfigure.client": "use rospy.set_param",
    "dynamic_reconfigure.server": "ask rospy.get_param each time, as a parameter may be set while it runs",
}
"""Libraries beside the client libraries that are not there, and what to do instead."""


def importable_modules(
    graph: RosGraph,
    launched: Mapping[str, Launch] | None = None,
    nodes: Mapping[str, Node] | None = None,
    at_end: AtEnd = ignore_end,
) -> dict[str, ModuleType]:
    """The modules by name; *launched*, *nodes* and *at_end* as in ``faces.rospy.modules``."""
    given = launched, nodes, at_end
    found = {**rospy.modules(graph, *given), **rclpy.modules(graph, *given)}
    transforms = tf2.modules(graph.kernel, found["rospy"], found["rclpy.executors"])
    filters = message_filters.modules(found["rospy"], found["rclpy.time"])
    return {
        **found,
        **transforms,
        **filters,
        **{name: _absent(name, instead) for name, instead in _ABSENT.items()},
    }


def _absent(name: str, instead: str) -> ModuleType:
    """A module that says, as soon as something of it is asked for, that it is not there."""
    module = ModuleType(name)
    module.__path__ = []

    def missing(attribute: str) -> NoReturn:
        if attribute.startswith("__"):
            raise AttributeError(attribute)
        raise ImportError(f"{name}.{attribute}: {name} is not there on the embedded graph; {instead}")

    vars(module)["__getattr__"] = missing
    return module
