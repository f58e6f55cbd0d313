"""``tf``, the older transform library of ROS 1, built on tf2, and ``tf.transformations``.

Of ``tf.transformations`` there are the functions that nodes commonly use: Euler angles with axes ``sxyz`` and
quaternions (x, y, z, w).
"""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType
from typing import Any, ClassVar

import numpy as np

from volery.base.errors import UsageError
from volery.base.frames import Quaternion, euler_to_quaternion, multiply, quaternion_to_euler
from volery.ros.client_libraries.tf2.transform_tree import TransformException, conjugate, normalised
from volery.ros.messages import new


def _without_slash(frame: str) -> str:
    """Return a frame name without a leading slash, which tf allows and tf2 does not."""
    return frame.lstrip("/")


class TransformListener:
    """``tf.TransformListener``: a buffer with its listener."""

    tf2_ros: ClassVar[ModuleType]

    def __init__(self, *options: Any, **more: Any) -> None:
        self._buffer = self.tf2_ros.Buffer()
        self._listener = self.tf2_ros.TransformListener(self._buffer)

    def lookupTransform(  # noqa: N802 - tf's name
        self, target_frame: str, source_frame: str, time: Any
    ) -> tuple[list[float], list[float]]:
        """Return translation (x, y, z) and rotation (x, y, z, w)."""
        found = self._buffer.lookup_transform(
            _without_slash(target_frame), _without_slash(source_frame), time
        ).transform
        t, q = found.translation, found.rotation
        return [t.x, t.y, t.z], [q.x, q.y, q.z, q.w]

    def canTransform(self, target_frame: str, source_frame: str, time: Any) -> Any:  # noqa: N802 - tf's name
        """Return whether the transform is available."""
        return self._buffer.can_transform(_without_slash(target_frame), _without_slash(source_frame), time)

    def waitForTransform(  # noqa: N802 - tf's name
        self,
        target_frame: str,
        source_frame: str,
        time: Any,
        timeout: Any,
        polling_sleep_duration: Any = None,
    ) -> None:
        """Block until the transform is available; raise ``tf.Exception`` after a time-out."""
        can, why = self._buffer.can_transform(
            _without_slash(target_frame), _without_slash(source_frame), time, timeout, return_debug_tuple=True
        )
        if not can:
            raise TransformException(why)

    def frameExists(self, frame_id: str) -> bool:  # noqa: N802 - tf's name
        """Return whether a frame is known."""
        return _without_slash(frame_id) in self._buffer.all_frames_as_list()

    def transformPose(self, target_frame: str, ps: Any) -> Any:  # noqa: N802 - tf's name
        """Return a ``PoseStamped`` in another frame."""
        return self._buffer.transform(ps, _without_slash(target_frame))

    transformPoint = transformVector3 = transformPose  # noqa: N815 - tf's names


class TransformBroadcaster:
    """``tf.TransformBroadcaster``."""

    tf2_ros: ClassVar[ModuleType]

    def __init__(self, queue_size: int = 100) -> None:
        self._broadcaster = self.tf2_ros.TransformBroadcaster()

    def sendTransform(  # noqa: N802 - tf's name
        self, translation: Sequence[float], rotation: Sequence[float], time: Any, child: str, parent: str
    ) -> None:
        """Publish the transform from *child* to *parent*."""
        made = new("geometry_msgs/msg/TransformStamped", child_frame_id=_without_slash(child))
        made.header.frame_id, made.header.stamp = _without_slash(parent), time
        moved, turned = made.transform.translation, made.transform.rotation
        moved.x, moved.y, moved.z = map(float, translation)
        turned.x, turned.y, turned.z, turned.w = map(float, rotation)
        self._broadcaster.sendTransform(made)


AXES = "sxyz"


def _check_axes(axes: str) -> None:
    if axes != AXES:
        raise UsageError(
            f"tf.transformations: axes {axes!r} are not there on the embedded graph; use {AXES!r}"
        )


def _wxyz(q: Sequence[float]) -> Quaternion:
    x, y, z, w = (float(part) for part in q)
    return w, x, y, z


def _xyzw(q: Quaternion) -> Any:
    w, x, y, z = q
    return np.array([x, y, z, w])


def euler_from_quaternion(quaternion: Sequence[float], axes: str = AXES) -> tuple[float, float, float]:
    """Return roll, pitch and yaw in radians."""
    _check_axes(axes)
    given = normalised(_wxyz(quaternion))
    return (0.0, 0.0, 0.0) if given is None else quaternion_to_euler(given)


def quaternion_from_euler(ai: float, aj: float, ak: float, axes: str = AXES) -> Any:
    """Return the quaternion of roll, pitch and yaw in radians."""
    _check_axes(axes)
    return _xyzw(euler_to_quaternion(ai, aj, ak))


def quaternion_multiply(quaternion1: Sequence[float], quaternion0: Sequence[float]) -> Any:
    """Return the rotation by *quaternion0* followed by *quaternion1*."""
    return _xyzw(multiply(_wxyz(quaternion1), _wxyz(quaternion0)))


def quaternion_inverse(quaternion: Sequence[float]) -> Any:
    """Return the inverse rotation."""
    given = _wxyz(quaternion)
    return _xyzw(conjugate(given)) / sum(part * part for part in given)


TRANSFORMATIONS = {
    one.__name__: one
    for one in (euler_from_quaternion, quaternion_from_euler, quaternion_multiply, quaternion_inverse)
}
"""Content of ``tf.transformations``, which is called ``tf_transformations`` in ROS 2."""
