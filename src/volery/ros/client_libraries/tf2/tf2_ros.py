"""``tf2_ros`` and ``tf2_geometry_msgs``: buffer, listeners, broadcasters, and transformed messages.

Listeners and broadcasters use rospy without a node, and rclpy with one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from types import ModuleType
from typing import Any, ClassVar

from volery.base.errors import choices
from volery.base.frames import multiply
from volery.base.time import Ns, S, from_seconds
from volery.kernel.api import Kernel
from volery.kernel.waiting import Signal
from volery.ros.client_libraries.rclpy.entities import DurabilityPolicy, QoSProfile
from volery.ros.client_libraries.rclpy.executors import ReentrantCallbackGroup
from volery.ros.client_libraries.tf2.transform_tree import (
    InvalidArgumentException,
    RigidTransform,
    TransformException,
    TransformTree,
    from_transform,
    rotated,
    write_transform,
)
from volery.ros.messages import message_class, new
from volery.ros.messages.message import nanoseconds


def _transform_point(point: Any, by: RigidTransform) -> None:
    point.x, point.y, point.z = by.point((point.x, point.y, point.z))


def _transform_vector(vector: Any, by: RigidTransform) -> None:
    vector.x, vector.y, vector.z = rotated(by.rotation, (vector.x, vector.y, vector.z))


def _transform_pose(pose: Any, by: RigidTransform) -> None:
    _transform_point(pose.position, by)
    q = pose.orientation
    q.w, q.x, q.y, q.z = multiply(by.rotation, (q.w, q.x, q.y, q.z))


_KINDS: dict[str, tuple[str, Callable[[Any, RigidTransform], None]]] = {
    "geometry_msgs/msg/Point": ("", _transform_point),
    "geometry_msgs/msg/PointStamped": ("point", _transform_point),
    "geometry_msgs/msg/Vector3": ("", _transform_vector),
    "geometry_msgs/msg/Vector3Stamped": ("vector", _transform_vector),
    "geometry_msgs/msg/Pose": ("", _transform_pose),
    "geometry_msgs/msg/PoseStamped": ("pose", _transform_pose),
}
"""Transformable types: the field to transform and the function that does so."""


def transformed(given: Any, transform: Any) -> Any:
    """Return a copy of *given* transformed by a ``TransformStamped``, with its header."""
    name = getattr(given, "__msgtype__", type(given).__name__)
    if name not in _KINDS:
        raise InvalidArgumentException(f"{name} cannot be transformed; choose {choices(_KINDS)}")
    field, change = _KINDS[name]
    made = given.copy()
    change(getattr(made, field) if field else made, from_transform(transform.transform))
    if field:
        made.header = transform.header.copy()
    return made


STAMPED = {
    f"do_transform_{what}": transformed
    for what in ("point", "vector3", "pose", "pose_stamped", "point_stamped", "vector3_stamped")
}
"""Content of ``tf2_geometry_msgs``."""


def as_ns(value: Any) -> Ns:
    """Return a time or duration of rospy or rclpy, a message of either, or seconds, in ns."""
    if isinstance(value, (int, float)):
        return from_seconds(value)
    found = getattr(value, "nanoseconds", None)
    return nanoseconds(value) if found is None else int(found)


class Buffer:
    """The transforms of the last *cache_time* (10 s by default)."""

    kernel: ClassVar[Kernel]

    def __init__(self, cache_time: Any = None, *options: Any, **more: Any) -> None:
        self._tree = TransformTree(10 * S if cache_time is None else as_ns(cache_time))
        self._changed = Signal(self.kernel, "tf2_ros.Buffer (a transform)")

    def set_transform(self, transform: Any, authority: str = "", *, static: bool = False) -> None:
        """Add a ``geometry_msgs/msg/TransformStamped``."""
        header = transform.header
        rigid = from_transform(transform.transform)
        self._tree.add(transform.child_frame_id, header.frame_id, as_ns(header.stamp), rigid, static=static)
        self._changed.notify()

    def set_transform_static(self, transform: Any, authority: str = "") -> None:
        """Add a static transform."""
        self.set_transform(transform, authority, static=True)

    def clear(self) -> None:
        """Remove all transforms but the static ones."""
        self._tree.clear()

    def all_frames_as_list(self) -> list[str]:
        """Return the names of all frames."""
        return self._tree.frames()

    def can_transform(
        self,
        target_frame: str,
        source_frame: str,
        time: Any,
        timeout: Any = 0,
        return_debug_tuple: bool = False,
    ) -> Any:
        """Return whether ``lookup_transform`` would succeed within *timeout*, optionally with the reason."""
        reason = self._wait_for(target_frame, source_frame, as_ns(time), as_ns(timeout))
        return (not reason, reason) if return_debug_tuple else not reason

    def _wait_for(self, target: str, source: str, at: Ns, within: Ns) -> str:
        """Wait for a transform; return why there is none, or ``""``."""
        reasons: list[str] = [""]

        def can() -> bool:
            try:
                self._tree.look_up(target, source, at)
            except TransformException as error:
                reasons[0] = str(error)
                return False
            reasons[0] = ""
            return True

        with self.kernel:
            if not can() and within > 0:
                self._changed.wait_for(can, within, ends_activation=True)
        return reasons[0]

    def lookup_transform(self, target_frame: str, source_frame: str, time: Any, timeout: Any = 0) -> Any:
        """Return the ``TransformStamped`` from *source_frame* to *target_frame*.

        Args:
            target_frame: Frame of the result.
            source_frame: Frame of the data to transform.
            time: Time of the transform; 0 is the latest for which one is available.
            timeout: Longest time to block until the transform is available.

        Raises:
            TransformException: There is no such transform; the classes are tf2's.
        """
        at = as_ns(time)
        self._wait_for(target_frame, source_frame, at, as_ns(timeout))
        found, rigid = self._tree.look_up(target_frame, source_frame, at)
        made = new("geometry_msgs/msg/TransformStamped", child_frame_id=source_frame)
        made.header.frame_id = target_frame
        made.header.stamp.sec, made.header.stamp.nanosec = divmod(found, S)
        write_transform(made.transform, rigid)
        return made

    def lookup_transform_full(
        self,
        target_frame: str,
        target_time: Any,
        source_frame: str,
        source_time: Any,
        fixed_frame: str,
        timeout: Any = 0,
    ) -> Any:
        """Return the transform from a frame at one time to a frame at another time via a fixed frame."""
        source = self.lookup_transform(fixed_frame, source_frame, source_time, timeout)
        target = self.lookup_transform(target_frame, fixed_frame, target_time, timeout)
        combined = from_transform(source.transform).then(from_transform(target.transform))
        target.child_frame_id = source_frame
        write_transform(target.transform, combined)
        return target

    def transform(
        self, object_stamped: Any, target_frame: str, timeout: Any = 0, new_type: Any = None
    ) -> Any:
        """Return a stamped point, vector or pose in another frame."""
        if new_type is not None:
            raise InvalidArgumentException(
                "Buffer.transform(new_type=...) is not there on the embedded graph"
            )
        header = object_stamped.header
        return transformed(
            object_stamped, self.lookup_transform(target_frame, header.frame_id, header.stamp, timeout)
        )


TF, TF_STATIC = "/tf", "/tf_static"
_DEPTH = 100


def _message_type() -> Any:
    return message_class("tf2_msgs/msg/TFMessage")


def _transient_local(depth: int) -> QoSProfile:
    return QoSProfile(depth=depth, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class TransformBroadcaster:
    """Publishes transforms."""

    rospy: ClassVar[ModuleType]

    def __init__(self, node: Any = None, qos: Any = None) -> None:
        if node is None:
            self._publisher: Any = self.rospy.Publisher(TF, _message_type(), queue_size=_DEPTH)
        else:
            self._publisher = node.create_publisher(_message_type(), TF, qos or _DEPTH)

    def sendTransform(self, transform: Any) -> None:  # noqa: N802 - tf2's name
        """Publish one ``TransformStamped``, or several."""
        self._publisher.publish(_message_type()(transforms=_as_list(transform)))


class StaticTransformBroadcaster:
    """Publishes static transforms, which late subscribers receive as well."""

    rospy: ClassVar[ModuleType]

    def __init__(self, node: Any = None, qos: Any = None) -> None:
        self._sent: dict[str, Any] = {}
        if node is None:
            self._publisher: Any = self.rospy.Publisher(
                TF_STATIC, _message_type(), queue_size=_DEPTH, latch=True
            )
        else:
            self._publisher = node.create_publisher(_message_type(), TF_STATIC, qos or _transient_local(1))

    def sendTransform(self, transform: Any) -> None:  # noqa: N802 - tf2's name
        """Publish one ``TransformStamped``, or several, together with all published before."""
        for one in _as_list(transform):
            self._sent[one.child_frame_id] = one.copy()
        self._publisher.publish(_message_type()(transforms=list(self._sent.values())))


def _as_list(given: Any) -> list[Any]:
    return list(given) if isinstance(given, Sequence) else [given]


class TransformListener:
    """Fills a buffer with the transforms on ``/tf`` and ``/tf_static``."""

    rospy: ClassVar[ModuleType]
    executors: ClassVar[ModuleType]

    def __init__(
        self,
        buffer: Buffer,
        node: Any = None,
        *options: Any,
        spin_thread: bool = False,
        qos: Any = None,
        static_qos: Any = None,
        **more: Any,
    ) -> None:
        self.buffer = buffer
        if not hasattr(node, "create_subscription"):  # the second argument of rospy is a queue length
            self._subscriptions = [
                self.rospy.Subscriber(
                    topic, _message_type(), partial(self._on_transforms, topic == TF_STATIC)
                )
                for topic in (TF, TF_STATIC)
            ]
            return
        self._node = node
        group = ReentrantCallbackGroup()
        self._subscriptions = [
            node.create_subscription(
                _message_type(),
                topic,
                partial(self._on_transforms, topic == TF_STATIC),
                kept,
                callback_group=group,
            )
            for topic, kept in ((TF, qos or _DEPTH), (TF_STATIC, static_qos or _transient_local(_DEPTH)))
        ]
        if spin_thread:
            executor = self.executors.SingleThreadedExecutor()
            executor.add_node(node)
            node.context.spawn(executor.spin, "tf2_ros.TransformListener")

    def _on_transforms(self, static: bool, message: Any) -> None:
        for transform in message.transforms:
            try:
                self.buffer.set_transform(transform, static=static)
            except InvalidArgumentException as error:
                self._warn(str(error))

    def _warn(self, text: str) -> None:
        node = getattr(self, "_node", None)
        if node is None:
            self.rospy.logwarn(text)
        else:
            node.get_logger().warning(text)

    def unregister(self) -> None:
        """Remove the subscriptions."""
        for subscription in self._subscriptions:
            if hasattr(subscription, "unregister"):
                subscription.unregister()
            else:
                self._node.destroy_subscription(subscription)
