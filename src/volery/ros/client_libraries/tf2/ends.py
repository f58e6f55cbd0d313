"""``tf2_ros``'s listeners and broadcasters: rospy's without a node, rclpy's with one."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from types import ModuleType
from typing import Any, ClassVar

from volery.ros.client_libraries.rclpy.callback_groups import ReentrantCallbackGroup
from volery.ros.client_libraries.rclpy.qos import DurabilityPolicy, QoSProfile
from volery.ros.client_libraries.tf2.buffer import Buffer
from volery.ros.client_libraries.tf2.errors import InvalidArgumentException
from volery.ros.messages import message_class

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
