"""``tf2_ros`` and ``tf2_geometry_msgs``: buffer, listeners, broadcasters, and transformed messages.

Listeners and broadcasters use rospy without a node, and rclpy with one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from types import ModuleType
from typing import Any, ClassVar

import numpy as np

from volery.base.errors import did_you_mean
from volery.base.frames import Quaternion, multiply
from volery.base.time import US, Ns, S, from_seconds, to_seconds
from volery.kernel.api import Kernel
from volery.kernel.waiting import Signal, current_task, poll
from volery.ros.client_libraries.rclpy.executors import Future, ReentrantCallbackGroup
from volery.ros.client_libraries.rclpy.qos import DurabilityPolicy, QoSProfile
from volery.ros.client_libraries.tf2.transform_tree import (
    RigidTransform,
    TransformException,
    TransformTree,
    from_transform,
    rotated,
    write_transform,
)
from volery.ros.graph import EmbeddedGraph, RosGraph
from volery.ros.messages import message_class, new
from volery.ros.messages.client_classes import RCLPY, ROSPY, adopt, library_of
from volery.ros.messages.message import nanoseconds
from volery.trace.events import ERROR, WARNING, Text

LOOK_UP: Ns = 6 * US
"""Time of a look-up in a loop that polls; of tf2 0.7.6, measured."""


def _transform_point(point: Any, by: RigidTransform) -> None:
    point.x, point.y, point.z = by.point((point.x, point.y, point.z))


def _transform_vector(vector: Any, by: RigidTransform) -> None:
    vector.x, vector.y, vector.z = rotated(by.rotation, (vector.x, vector.y, vector.z))


def _transform_pose(pose: Any, by: RigidTransform) -> None:
    _transform_point(pose.position, by)
    q = pose.orientation
    q.w, q.x, q.y, q.z = multiply(by.rotation, (q.w, q.x, q.y, q.z))


def _transform_wrench(wrench: Any, by: RigidTransform) -> None:
    _transform_vector(wrench.force, by)
    _transform_vector(wrench.torque, by)


def _transform_polygon(polygon: Any, by: RigidTransform) -> None:
    for point in polygon.points:
        _transform_point(point, by)


def _transform_covariant_pose(pose: Any, by: RigidTransform) -> None:
    """Transform a pose and turn its covariance, of x, y, z and the rotations about them."""
    _transform_pose(pose.pose, by)
    turn = np.kron(np.eye(2), rotation_matrix(by.rotation))
    covariance = np.asarray(pose.covariance, float).reshape(6, 6)
    pose.covariance = (turn @ covariance @ turn.T).ravel().tolist()


def rotation_matrix(q: Quaternion) -> Any:
    """Return the 3 x 3 matrix of a unit quaternion (w, x, y, z)."""
    return np.array([rotated(q, axis) for axis in ((1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0))]).T


_KINDS: dict[str, tuple[str, Callable[[Any, RigidTransform], None]]] = {
    "geometry_msgs/msg/Point": ("", _transform_point),
    "geometry_msgs/msg/PointStamped": ("point", _transform_point),
    "geometry_msgs/msg/Vector3": ("", _transform_vector),
    "geometry_msgs/msg/Vector3Stamped": ("vector", _transform_vector),
    "geometry_msgs/msg/Pose": ("", _transform_pose),
    "geometry_msgs/msg/PoseStamped": ("pose", _transform_pose),
    "geometry_msgs/msg/PoseWithCovarianceStamped": ("pose", _transform_covariant_pose),
    "geometry_msgs/msg/Wrench": ("", _transform_wrench),
    "geometry_msgs/msg/WrenchStamped": ("wrench", _transform_wrench),
    "geometry_msgs/msg/PolygonStamped": ("polygon", _transform_polygon),
}
"""Transformable types: the field to transform and the function that does so."""


class TypeException(Exception):  # noqa: N818 - tf2's name
    """A type that has no registered function."""


class NotImplementedException(Exception):  # noqa: N818 - tf2's name
    """A function that a buffer does not have."""

    def __init__(self) -> None:
        super().__init__("CanTransform or LookupTransform not implemented")


class TransformRegistration:
    """Functions ``(object, TransformStamped)`` that transform objects, by their class."""

    _functions: ClassVar[dict[Any, Any]] = {}

    def add(self, key: Any, callback: Any) -> None:
        """Register the function of a class."""
        self._functions[key] = callback

    def get(self, key: Any) -> Any:
        """Return the function of a class; raise ``TypeException`` if there is none."""
        function = self._functions.get(key)
        if function is not None:
            return function
        name = getattr(key, "__msgtype__", "")
        if name not in _KINDS:
            named = name or getattr(key, "__name__", key)
            raise TypeException(
                f"Type {named} if not loaded or supported{did_you_mean(str(named), _KINDS)}; register a "
                "function by tf2_ros.TransformRegistration().add(type, function)"
            )
        return transformed


def transformed(given: Any, transform: Any) -> Any:
    """Return a copy of *given* transformed by a ``TransformStamped``, with its header."""
    name = getattr(given, "__msgtype__", type(given).__name__)
    if name not in _KINDS:
        raise TypeException(f"{name} cannot be transformed{did_you_mean(name, _KINDS)}")
    field, change = _KINDS[name]
    made = given.copy()
    change(getattr(made, field) if field else made, from_transform(transform.transform))
    if field:
        made.header = transform.header.copy()
    return adopt(made, library_of(type(given)))


STAMPED = {
    f"do_transform_{what}": transformed
    for what in (
        *("point", "vector3", "pose", "wrench", "pose_stamped", "point_stamped", "vector3_stamped"),
        *("wrench_stamped", "polygon_stamped", "pose_with_covariance_stamped"),
    )
}
"""Content of ``tf2_geometry_msgs``."""


def _conversion_of(stamped: Any, new_type: Any) -> Any:
    """Return what changes the frame of a stamped object; raise ``TypeException`` if nothing does."""
    if new_type is not None:
        raise TypeException(f"Buffer.transform: nothing converts to {new_type!r} on the embedded graph")
    return TransformRegistration().get(type(stamped))


def as_ns(value: Any) -> Ns:
    """Return a time or duration of rospy or rclpy, a message of either, or seconds, in ns."""
    if isinstance(value, (int, float)):
        return from_seconds(value)
    found = getattr(value, "nanoseconds", None)
    return nanoseconds(value) if found is None else int(found)


class Buffer:
    """The transforms of the last *cache_time* (10 s by default)."""

    graph: ClassVar[RosGraph]
    kernel: ClassVar[Kernel]
    time_class: ClassVar[Any]

    def __init__(self, cache_time: Any = None, *options: Any, node: Any = None, **more: Any) -> None:
        self._tree = TransformTree(10 * S if cache_time is None else as_ns(cache_time), ros2=node is not None)
        self._changed = Signal(self.kernel, "tf2_ros.Buffer (a transform)")
        self._said: set[tuple[str, str]] = set()
        self._asked: list[tuple[Future, Callable[[], None]]] = []

    def follow_ros2(self) -> None:
        """Follow ROS 2 where its rules differ: it is filled by a node of rclpy."""
        self._tree.ros2 = True

    def set_transform(self, transform: Any, authority: str = "", *, static: bool = False) -> None:
        """Add a ``geometry_msgs/msg/TransformStamped``. What is ignored is logged, once a frame and cause."""
        header, child = transform.header, transform.child_frame_id
        rigid = from_transform(transform.transform)
        problem = self._tree.add(child, header.frame_id, as_ns(header.stamp), rigid, static=static)
        if not problem:
            self._changed.notify()
            for _, look in list(self._asked):
                look()
            return
        kind = problem.partition(" ")[0]
        if (kind, child) not in self._said:
            self._said.add((kind, child))
            severity = WARNING if kind in ("TF_OLD_DATA", "TF_REPEATED_DATA") else ERROR
            kernel = self.kernel
            with kernel.interact():
                component = current_task(kernel).context.component
                kernel.record(Text(kernel.now(), component, severity, problem))

    def set_transform_static(self, transform: Any, authority: str = "") -> None:
        """Add a static transform."""
        self.set_transform(transform, authority, static=True)

    def clear(self) -> None:
        """Remove all transforms but the static ones."""
        self._tree.clear()

    def all_frames_as_list(self) -> list[str]:
        """Return the names of all frames."""
        return self._tree.frames()

    def all_frames_as_string(self) -> str:
        """Return a line of each frame with its parent."""
        frames = self._tree.described()
        return "".join(f"Frame {name} exists with parent {parent}.\n" for name, parent, *_ in frames)

    def all_frames_as_yaml(self) -> str:
        """Return the frames with their parents, rates (Hz) and times (s) as YAML."""
        texts = []
        for name, parent, first, last, count in self._tree.described():
            length = to_seconds(last - first)
            rate = (count - 1) / length if length > 0.0 else 10000.0
            texts.append(
                f"{name}: \n  parent: '{parent}'\n  broadcaster: 'default_authority'\n  rate: {rate:.3f}\n"
                f"  most_recent_transform: {to_seconds(last):.3f}\n"
                f"  oldest_transform: {to_seconds(first):.3f}\n  buffer_length: {length:.3f}\n"
            )
        return "".join(texts)

    def get_latest_common_time(self, target_frame: str, source_frame: str) -> Any:
        """Return the latest time at which the transform between two frames is known."""
        found = self._tree.latest_common_time(target_frame, source_frame)
        return self.time_class(*divmod(found, S))

    def can_transform(
        self,
        target_frame: str,
        source_frame: str,
        time: Any,
        timeout: Any = 0,
        return_debug_tuple: bool = False,
    ) -> Any:
        """Return whether ``lookup_transform`` would succeed within *timeout*, optionally with the reason."""
        for name in (target_frame, source_frame):
            if name.startswith("/"):  # tf2 gives no reason
                return (False, "") if return_debug_tuple else False
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

        if within <= 0:
            poll(self.kernel, LOOK_UP)
        with self.kernel.interact():
            if not can() and within > 0:
                self._changed.wait_for(can, within, ends_activation=True)
            if isinstance(self.graph, EmbeddedGraph):
                self.graph.looked_up(f"transform from {source} to {target}", reasons[0])
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
        return adopt(made, RCLPY if self._tree.ros2 else ROSPY)

    def _future(self, can: Callable[[], bool]) -> Future:
        """Return a future that is done, with True, when *can* holds after a transform has come."""
        future = Future()

        def look() -> None:
            if not future.done() and can():
                future.set_result(True)

        look()
        if not future.done():
            self._asked = [(one, again) for one, again in self._asked if not one.done()]
            self._asked.append((future, look))
        return future

    def wait_for_transform_async(self, target_frame: str, source_frame: str, time: Any) -> Future:
        """Return a future that is done when a transform is available."""
        return self._future(lambda: bool(self.can_transform(target_frame, source_frame, time)))

    def wait_for_transform_full_async(
        self, target_frame: str, target_time: Any, source_frame: str, source_time: Any, fixed_frame: str
    ) -> Future:
        """Return a future that is done when a transform between two times is available."""
        return self._future(
            lambda: bool(
                self.can_transform(fixed_frame, source_frame, source_time)
                and self.can_transform(target_frame, fixed_frame, target_time)
            )
        )

    async def lookup_transform_async(self, target_frame: str, source_frame: str, time: Any) -> Any:
        """Wait for a transform in a coroutine; see ``lookup_transform``."""
        await self.wait_for_transform_async(target_frame, source_frame, time)
        return self.lookup_transform(target_frame, source_frame, time)

    async def lookup_transform_full_async(
        self, target_frame: str, target_time: Any, source_frame: str, source_time: Any, fixed_frame: str
    ) -> Any:
        """Wait for a transform between two times in a coroutine; see ``lookup_transform_full``."""
        times = target_frame, target_time, source_frame, source_time, fixed_frame
        await self.wait_for_transform_full_async(*times)
        return self.lookup_transform_full(*times)

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
        change, header = _conversion_of(object_stamped, new_type), object_stamped.header
        found = self.lookup_transform(target_frame, header.frame_id, header.stamp, timeout)
        return change(object_stamped, found)

    def transform_full(
        self,
        object_stamped: Any,
        target_frame: str,
        target_time: Any,
        fixed_frame: str,
        timeout: Any = 0,
        new_type: Any = None,
    ) -> Any:
        """Return a stamped object in another frame at another time, via a fixed frame."""
        change, header = _conversion_of(object_stamped, new_type), object_stamped.header
        full = self.lookup_transform_full(
            target_frame, target_time, header.frame_id, header.stamp, fixed_frame, timeout
        )
        return change(object_stamped, full)

    def can_transform_full(  # noqa: PLR0917 - tf2's
        self,
        target_frame: str,
        target_time: Any,
        source_frame: str,
        source_time: Any,
        fixed_frame: str,
        timeout: Any = 0,
        return_debug_tuple: bool = False,
    ) -> Any:
        """Return whether ``lookup_transform_full`` would succeed, optionally with the reason."""
        first = self.can_transform(fixed_frame, source_frame, source_time, timeout, True)
        can, why = (
            first
            if not first[0]
            else self.can_transform(target_frame, fixed_frame, target_time, timeout, True)
        )
        return (can, why) if return_debug_tuple else can

    lookup_transform_core = lookup_transform
    lookup_transform_full_core = lookup_transform_full

    def can_transform_core(self, target_frame: str, source_frame: str, time: Any) -> Any:
        """Return whether the transform is available now, and the reason."""
        can, why = self.can_transform(target_frame, source_frame, time, 0, True)
        return int(can), why


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
        buffer.follow_ros2()
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
            self.buffer.set_transform(transform, static=static)

    def unregister(self) -> None:
        """Remove the subscriptions."""
        for subscription in self._subscriptions:
            if hasattr(subscription, "unregister"):
                subscription.unregister()
            else:
                self._node.destroy_subscription(subscription)
