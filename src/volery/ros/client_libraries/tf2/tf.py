"""``tf``, ROS 1's first library of transforms, over tf2."""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType
from typing import Any, ClassVar

from volery.ros.client_libraries.tf2.errors import TransformException
from volery.ros.messages import new


def _bare(frame: str) -> str:
    """tf's names may begin with a slash, tf2's may not."""
    return frame.lstrip("/")


class TransformListener:
    """``tf.TransformListener``: a buffer and what fills it."""

    tf2_ros: ClassVar[ModuleType]

    def __init__(self, *options: Any, **more: Any) -> None:
        self._buffer = self.tf2_ros.Buffer()
        self._listener = self.tf2_ros.TransformListener(self._buffer)

    def lookupTransform(  # noqa: N802 - tf's name
        self, target_frame: str, source_frame: str, time: Any
    ) -> tuple[list[float], list[float]]:
        """Translation (x, y, z) and rotation (x, y, z, w)."""
        found = self._buffer.lookup_transform(_bare(target_frame), _bare(source_frame), time).transform
        t, q = found.translation, found.rotation
        return [t.x, t.y, t.z], [q.x, q.y, q.z, q.w]

    def canTransform(self, target_frame: str, source_frame: str, time: Any) -> Any:  # noqa: N802 - tf's name
        """Whether there is one now."""
        return self._buffer.can_transform(_bare(target_frame), _bare(source_frame), time)

    def waitForTransform(  # noqa: N802 - tf's name
        self,
        target_frame: str,
        source_frame: str,
        time: Any,
        timeout: Any,
        polling_sleep_duration: Any = None,
    ) -> None:
        """Block until there is one; ``tf.Exception`` if there is none in time."""
        can, why = self._buffer.can_transform(
            _bare(target_frame), _bare(source_frame), time, timeout, return_debug_tuple=True
        )
        if not can:
            raise TransformException(why)

    def frameExists(self, frame_id: str) -> bool:  # noqa: N802 - tf's name
        """Whether somebody has told of it."""
        return _bare(frame_id) in self._buffer.all_frames_as_list()

    def transformPose(self, target_frame: str, ps: Any) -> Any:  # noqa: N802 - tf's name
        """A ``PoseStamped`` in another frame."""
        return self._buffer.transform(ps, _bare(target_frame))

    transformPoint = transformVector3 = transformPose  # noqa: N815 - tf's names


class TransformBroadcaster:
    """``tf.TransformBroadcaster``."""

    tf2_ros: ClassVar[ModuleType]

    def __init__(self, queue_size: int = 100) -> None:
        self._broadcaster = self.tf2_ros.TransformBroadcaster()

    def sendTransform(  # noqa: N802 - tf's name
        self, translation: Sequence[float], rotation: Sequence[float], time: Any, child: str, parent: str
    ) -> None:
        """Tell where *child* lies in *parent*."""
        made = new("geometry_msgs/msg/TransformStamped", child_frame_id=_bare(child))
        made.header.frame_id, made.header.stamp = _bare(parent), time
        moved, turned = made.transform.translation, made.transform.rotation
        moved.x, moved.y, moved.z = map(float, translation)
        turned.x, turned.y, turned.z, turned.w = map(float, rotation)
        self._broadcaster.sendTransform(made)
