"""``tf2_ros``, ``tf2_geometry_msgs`` and ``tf``: transforms on ``/tf`` and ``/tf_static``.

Built on the client libraries, as the real ones are: without a node on rospy, with a node on rclpy. Intended
differences: a wait for a transform ends at the instant at which the transform is available, not at the next
poll; transforms are ordinary messages of the graph, so a broadcast costs the same as a publish.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import Any

from volery.ros.client_libraries.library_base import library_module
from volery.ros.client_libraries.tf2 import tf
from volery.ros.client_libraries.tf2.tf import TRANSFORMATIONS
from volery.ros.client_libraries.tf2.tf2_ros import (
    STAMPED,
    Buffer,
    NotImplementedException,
    StaticTransformBroadcaster,
    TransformBroadcaster,
    TransformListener,
    TransformRegistration,
    TypeException,
)
from volery.ros.client_libraries.tf2.transform_tree import EXCEPTIONS, TransformException
from volery.ros.graph import RosGraph
from volery.ros.messages import message_class

__all__ = ["modules"]

_CLASSES = (TransformBroadcaster, StaticTransformBroadcaster, TransformListener)
_PLAIN = (NotImplementedException, TransformRegistration, TypeException)
_SUBMODULES = {
    "buffer": ("Buffer",),
    "buffer_interface": ("NotImplementedException", "TransformRegistration", "TypeException"),
    "transform_broadcaster": ("TransformBroadcaster",),
    "static_transform_broadcaster": ("StaticTransformBroadcaster",),
    "transform_listener": ("TransformListener",),
}


def modules(graph: RosGraph, rospy: ModuleType, executors: ModuleType) -> dict[str, ModuleType]:
    """Return the modules by name.

    Args:
        graph: Graph of the run.
        rospy: Module that is used where no node is given.
        executors: The module ``rclpy.executors``.
    """
    members = {"rospy": rospy, "executors": executors}
    buffer = type("Buffer", (Buffer,), {"graph": graph, "kernel": graph.kernel, "time_class": rospy.Time})
    names: dict[str, Any] = {
        **EXCEPTIONS,
        **{kind.__name__: kind for kind in _PLAIN},
        "Buffer": buffer,
        "BufferCore": buffer,
        **{kind.__name__: type(kind.__name__, (kind,), members) for kind in _CLASSES},
    }
    inside = {part: {name: names[name] for name in listed} for part, listed in _SUBMODULES.items()}
    parts = {part: library_module(f"tf2_ros.{part}", names) for part, names in inside.items()}
    tf2_ros = library_module("tf2_ros", {**names, **parts})
    transformations = library_module("tf.transformations", TRANSFORMATIONS)
    message = message_class("tf2_msgs/msg/TFMessage")
    broadcaster = type("TransformBroadcaster", (tf.TransformBroadcaster,), {"tf2_ros": tf2_ros})
    listeners: dict[str, Any] = {
        kind.__name__: type(kind.__name__, (kind,), {"tf2_ros": tf2_ros})
        for kind in (tf.Transformer, tf.TransformerROS, tf.TransformListener)
    }
    old: dict[str, Mapping[str, Any]] = {
        "broadcaster": {"TransformBroadcaster": broadcaster},
        "listener": listeners,
        "msg": {"tfMessage": message},
    }
    old_parts = {part: library_module(f"tf.{part}", names) for part, names in old.items()}
    return {
        "tf2_ros": tf2_ros,
        **{f"tf2_ros.{part}": module for part, module in parts.items()},
        "tf2_py": library_module("tf2_py", {**EXCEPTIONS, "BufferCore": buffer}),
        "tf2_geometry_msgs": library_module("tf2_geometry_msgs", STAMPED),
        "tf": library_module(
            "tf",
            {
                **EXCEPTIONS,
                "Exception": TransformException,
                "TransformBroadcaster": broadcaster,
                **listeners,
                **old_parts,
                "transformations": transformations,
            },
        ),
        **{f"tf.{part}": module for part, module in old_parts.items()},
        "tf.transformations": transformations,
        "tf_transformations": library_module("tf_transformations", TRANSFORMATIONS),
    }
