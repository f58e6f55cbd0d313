"""``tf2_geometry_msgs``: points, vectors and poses in another frame.

``tf2_ros.Buffer``: the tree that a listener fills and a program asks.

``tf2_ros``'s listeners and broadcasters: rospy's without a node, rclpy's with one.
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
from volery.ros.client_libraries.rclpy.executors import ReentrantCallbackGroup
from volery.ros.client_libraries.rclpy.qos import DurabilityPolicy, QoSProfile
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
from volery.ros.messages.stamp import nanoseconds


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
"""What can be transformed: the field that holds it, and how."""


def transformed(given: Any, transform: Any) -> Any:
    """A copy of *given* by a ``TransformStamped``, whose header it then has."""
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
"""``tf2_geometry_msgs``."""


def as_ns(value: Any) -> Ns:
    """A time or a duration of rospy or of rclpy, a message of either, or seconds."""
    if isinstance(value, (int, float)):
        return from_seconds(value)
    found = getattr(value, "nanoseconds", None)
    return nanoseconds(value) if found is None else int(found)


class Buffer:
    """Transforms of the last ten seconds, or of *cache_time*."""

    kernel: ClassVar[Kernel]

    def __init__(self, cache_time: Any = None, *options: Any, **more: Any) -> None:
        self._tree = TransformTree(10 * S if cache_time is None else as_ns(cache_time))
        self._learnt = Signal(self.kernel, "tf2_ros.Buffer (a transform)")

    def set_transform(self, transform: Any, authority: str = "", *, static: bool = False) -> None:
        """Learn a ``geometry_msgs/msg/TransformStamped``."""
        header = transform.header
        rigid = from_transform(transform.transform)
        self._tree.learn(transform.child_frame_id, header.frame_id, as_ns(header.stamp), rigid, static=static)
        self._learnt.notify()

    def set_transform_static(self, transform: Any, authority: str = "") -> None:
        """Learn one that holds at all times."""
        self.set_transform(transform, authority, static=True)

    def clear(self) -> None:
        """Forget what moves."""
        self._tree.clear()

    def all_frames_as_list(self) -> list[str]:
        """The frames that are known."""
        return self._tree.frames()

    def can_transform(
        self,
        target_frame: str,
        source_frame: str,
        time: Any,
        timeout: Any = 0,
        return_debug_tuple: bool = False,
    ) -> Any:
        """Whether ``lookup_transform`` would succeed within *timeout*; with the reason if asked for it."""
        why = self._why_not(target_frame, source_frame, as_ns(time), as_ns(timeout))
        return (not why, why) if return_debug_tuple else not why

    def _why_not(self, target: str, source: str, at: Ns, within: Ns) -> str:
        found: list[str] = [""]

        def can() -> bool:
            try:
                self._tree.look_up(target, source, at)
            except TransformException as error:
                found[0] = str(error)
                return False
            found[0] = ""
            return True

        with self.kernel:
            if not can() and within > 0:
                self._learnt.wait_for(can, within, ends_activation=True)
        return found[0]

    def lookup_transform(self, target_frame: str, source_frame: str, time: Any, timeout: Any = 0) -> Any:
        """The ``TransformStamped`` from *source_frame* to *target_frame* at *time* (0: the latest).

        Blocks for at most *timeout* until there is one. Raises what tf2 does.
        """
        at = as_ns(time)
        self._why_not(target_frame, source_frame, at, as_ns(timeout))
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
        """From *source_frame* then to *target_frame* at another time, by what has not moved meanwhile."""
        source = self.lookup_transform(fixed_frame, source_frame, source_time, timeout)
        target = self.lookup_transform(target_frame, fixed_frame, target_time, timeout)
        joined = from_transform(source.transform).then(from_transform(target.transform))
        target.child_frame_id = source_frame
        write_transform(target.transform, joined)
        return target

    def transform(
        self, object_stamped: Any, target_frame: str, timeout: Any = 0, new_type: Any = None
    ) -> Any:
        """A stamped point, vector or pose in another frame."""
        if new_type is not None:
            raise InvalidArgumentException(
                "Buffer.transform(new_type=...) is not there on the embedded graph"
            )
        header = object_stamped.header
        return transformed(
            object_stamped, self.lookup_transform(target_frame, header.frame_id, header.stamp, timeout)
        )


TF, STATIC = "/tf", "/tf_static"
_DEPTH = 100


def _kind() -> Any:
    return message_class("tf2_msgs/msg/TFMessage")


def _kept(depth: int) -> QoSProfile:
    return QoSProfile(depth=depth, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class TransformBroadcaster:
    """Tells where frames lie."""

    rospy: ClassVar[ModuleType]

    def __init__(self, node: Any = None, qos: Any = None) -> None:
        if node is None:
            self._publisher: Any = self.rospy.Publisher(TF, _kind(), queue_size=_DEPTH)
        else:
            self._publisher = node.create_publisher(_kind(), TF, qos or _DEPTH)

    def sendTransform(self, transform: Any) -> None:  # noqa: N802 - tf2's name
        """Tell one ``TransformStamped``, or several."""
        self._publisher.publish(_kind()(transforms=_several(transform)))


class StaticTransformBroadcaster:
    """Tells what holds at all times; who comes late hears it, too."""

    rospy: ClassVar[ModuleType]

    def __init__(self, node: Any = None, qos: Any = None) -> None:
        self._told: dict[str, Any] = {}
        if node is None:
            self._publisher: Any = self.rospy.Publisher(STATIC, _kind(), queue_size=_DEPTH, latch=True)
        else:
            self._publisher = node.create_publisher(_kind(), STATIC, qos or _kept(1))

    def sendTransform(self, transform: Any) -> None:  # noqa: N802 - tf2's name
        """Tell one ``TransformStamped``, or several, with all that have been told before."""
        for one in _several(transform):
            self._told[one.child_frame_id] = one.copy()
        self._publisher.publish(_kind()(transforms=list(self._told.values())))


def _several(given: Any) -> list[Any]:
    return list(given) if isinstance(given, Sequence) else [given]


class TransformListener:
    """Fills a buffer with what is told on ``/tf`` and ``/tf_static``."""

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
        if not hasattr(node, "create_subscription"):  # rospy's second argument is the length of a queue
            self._subscriptions = [
                self.rospy.Subscriber(topic, _kind(), partial(self._hear, topic == STATIC))
                for topic in (TF, STATIC)
            ]
            return
        self._node = node
        group = ReentrantCallbackGroup()
        self._subscriptions = [
            node.create_subscription(
                _kind(), topic, partial(self._hear, topic == STATIC), kept, callback_group=group
            )
            for topic, kept in ((TF, qos or _DEPTH), (STATIC, static_qos or _kept(_DEPTH)))
        ]
        if spin_thread:
            executor = self.executors.SingleThreadedExecutor()
            executor.add_node(node)
            node.context.spawn(executor.spin, "tf2_ros.TransformListener")

    def _hear(self, static: bool, message: Any) -> None:
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
        """Listen no longer."""
        for subscription in self._subscriptions:
            if hasattr(subscription, "unregister"):
                subscription.unregister()
            else:
                self._node.destroy_subscription(subscription)
