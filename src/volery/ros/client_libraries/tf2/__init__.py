"""``tf2_ros``, ``tf2_geometry_msgs`` and ``tf``: transforms on ``/tf`` and ``/tf_static``.

Built on the client libraries, as the real ones are: without a node on rospy, with a node on rclpy. Intended
differences: a wait for a transform ends at the instant at which the transform is available, not at the next
poll; transforms are ordinary messages of the graph, so a broadcast costs the same as a publish.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

from volery.kernel.api import Kernel
from volery.ros.client_libraries.library_base import library_module
from volery.ros.client_libraries.tf2 import tf
from volery.ros.client_libraries.tf2.tf import TRANSFORMATIONS
from volery.ros.client_libraries.tf2.tf2_ros import (
    STAMPED,
    Buffer,
    StaticTransformBroadcaster,
    TransformBroadcaster,
    TransformListener,
)
from volery.ros.client_libraries.tf2.transform_tree import EXCEPTIONS, TransformException

__all__ = ["modules"]

_CLASSES = (TransformBroadcaster, StaticTransformBroadcaster, TransformListener)
_SUBMODULES = {
    "buffer": "Buffer",
    "transform_broadcaster": "TransformBroadcaster",
    "static_transform_broadcaster": "StaticTransformBroadcaster",
    "transform_listener": "TransformListener",
}


def modules(kernel: Kernel, rospy: ModuleType, executors: ModuleType) -> dict[str, ModuleType]:
    """Return the modules by name.

    Args:
        kernel: Kernel of the run.
        rospy: Module that is used where no node is given.
        executors: The module ``rclpy.executors``.
    """
    members = {"rospy": rospy, "executors": executors}
    names: dict[str, Any] = {
        **EXCEPTIONS,
        "Buffer": type("Buffer", (Buffer,), {"kernel": kernel}),
        **{kind.__name__: type(kind.__name__, (kind,), members) for kind in _CLASSES},
    }
    tf2_ros = library_module("tf2_ros", names)
    parts = {
        f"tf2_ros.{part}": library_module(f"tf2_ros.{part}", {name: names[name]})
        for part, name in _SUBMODULES.items()
    }
    transformations = library_module("tf.transformations", TRANSFORMATIONS)
    old: dict[str, Any] = {
        **EXCEPTIONS,
        "Exception": TransformException,
        "transformations": transformations,
        **{
            kind.__name__: type(kind.__name__, (kind,), {"tf2_ros": tf2_ros})
            for kind in (tf.TransformListener, tf.TransformBroadcaster)
        },
    }
    return {
        "tf2_ros": tf2_ros,
        **parts,
        "tf2_geometry_msgs": library_module("tf2_geometry_msgs", STAMPED),
        "tf": library_module("tf", old),
        "tf.transformations": transformations,
        "tf_transformations": library_module("tf_transformations", TRANSFORMATIONS),
    }
