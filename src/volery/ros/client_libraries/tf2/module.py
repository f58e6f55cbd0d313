"""The modules ``tf2_ros``, ``tf2_geometry_msgs``, ``tf`` and what they are called besides, for one run."""

from __future__ import annotations

from types import ModuleType
from typing import Any

from volery.kernel.api import Kernel
from volery.ros.client_libraries.module import face_module
from volery.ros.client_libraries.tf2 import ends, tf
from volery.ros.client_libraries.tf2.buffer import Buffer
from volery.ros.client_libraries.tf2.errors import EXCEPTIONS, TransformException
from volery.ros.client_libraries.tf2.stamped import STAMPED
from volery.ros.client_libraries.tf2.transformations import TRANSFORMATIONS

_ENDS = (ends.TransformBroadcaster, ends.StaticTransformBroadcaster, ends.TransformListener)
_PARTS = {
    "buffer": "Buffer",
    "transform_broadcaster": "TransformBroadcaster",
    "static_transform_broadcaster": "StaticTransformBroadcaster",
    "transform_listener": "TransformListener",
}


def modules(kernel: Kernel, rospy: ModuleType, executors: ModuleType) -> dict[str, ModuleType]:
    """By name. They talk through *rospy* where no node is given; *executors* is ``rclpy.executors``."""
    members = {"rospy": rospy, "executors": executors}
    names: dict[str, Any] = {
        **EXCEPTIONS,
        "Buffer": type("Buffer", (Buffer,), {"kernel": kernel}),
        **{kind.__name__: type(kind.__name__, (kind,), members) for kind in _ENDS},
    }
    tf2_ros = face_module("tf2_ros", names)
    parts = {
        f"tf2_ros.{part}": face_module(f"tf2_ros.{part}", {name: names[name]})
        for part, name in _PARTS.items()
    }
    transformations = face_module("tf.transformations", TRANSFORMATIONS)
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
        "tf2_geometry_msgs": face_module("tf2_geometry_msgs", STAMPED),
        "tf": face_module("tf", old),
        "tf.transformations": transformations,
        "tf_transformations": face_module("tf_transformations", TRANSFORMATIONS),
    }
