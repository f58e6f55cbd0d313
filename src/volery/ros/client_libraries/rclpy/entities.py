"""rclpy's entities of a node and their quality of service.

The entities are publishers, subscriptions, services, clients and timers.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any, Protocol

from volery.base.errors import UsageError
from volery.base.time import Ns, S, from_seconds
from volery.kernel.waiting import Signal
from volery.ros.client_libraries.rclpy.context import Context, InvalidHandle
from volery.ros.client_libraries.rclpy.executors import CallbackGroup, CallbackQueue, Executor, Future
from volery.ros.client_libraries.rclpy.ros_time import Duration
from volery.ros.graph import Node as GraphNode
from volery.ros.graph import QoS, ServiceError, Work
from volery.ros.graph.interface import BEST_AVAILABLE, BEST_EFFORT, RELIABLE, TRANSIENT_LOCAL, VOLATILE
from volery.ros.messages import Message


class InvalidQoSProfileException(Exception):  # noqa: N818 - rclpy's name
    """A profile that is contradictory or incomplete."""


class HistoryPolicy(IntEnum):
    """Which messages are kept."""

    SYSTEM_DEFAULT = 0
    KEEP_LAST = 1
    KEEP_ALL = 2
    UNKNOWN = 3


class ReliabilityPolicy(IntEnum):
    """Whether lost messages are sent again."""

    SYSTEM_DEFAULT = 0
    RELIABLE = 1
    BEST_EFFORT = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4


class DurabilityPolicy(IntEnum):
    """Whether late subscriptions receive earlier messages."""

    SYSTEM_DEFAULT = 0
    TRANSIENT_LOCAL = 1
    VOLATILE = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4


class LivelinessPolicy(IntEnum):
    """Liveliness policies, which are accepted without effect on the embedded graph."""

    SYSTEM_DEFAULT = 0
    AUTOMATIC = 1
    MANUAL_BY_TOPIC = 3
    UNKNOWN = 4
    BEST_AVAILABLE = 5


class QoSProfile:
    """A profile as in rclpy: ``QoSProfile(depth=10)``.

    Finite deadlines, lifespans and lease durations are refused, because the embedded graph does not monitor
    them.
    """

    def __init__(self, **policies: Any) -> None:
        if "history" not in policies and "depth" not in policies:
            raise InvalidQoSProfileException("History and/or depth settings are required.")
        self.history = HistoryPolicy(policies.pop("history", HistoryPolicy.KEEP_LAST))
        if self.history is HistoryPolicy.KEEP_LAST and "depth" not in policies:
            raise InvalidQoSProfileException("History set to KEEP_LAST without a depth setting.")
        self.depth = int(policies.pop("depth", 0))
        self.reliability = ReliabilityPolicy(policies.pop("reliability", ReliabilityPolicy.RELIABLE))
        self.durability = DurabilityPolicy(policies.pop("durability", DurabilityPolicy.VOLATILE))
        self.liveliness = LivelinessPolicy(policies.pop("liveliness", LivelinessPolicy.SYSTEM_DEFAULT))
        self.avoid_ros_namespace_conventions = policies.pop("avoid_ros_namespace_conventions", False)
        for name in ("deadline", "lifespan", "liveliness_lease_duration"):
            span = policies.pop(name, None)
            setattr(self, name, span or Duration())
            if span is not None and 0 < span.nanoseconds < (1 << 62):
                raise UsageError(f"QoSProfile: a {name} is not monitored on the embedded graph; leave it out")
        if policies:
            raise TypeError(f"QoSProfile has no {sorted(policies)[0]!r}")


def _preset(depth: int, **policies: Any) -> QoSProfile:
    return QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=depth, **policies)


qos_profile_default = _preset(10)
qos_profile_system_default = _preset(10)
qos_profile_sensor_data = _preset(5, reliability=ReliabilityPolicy.BEST_EFFORT)
qos_profile_services_default = _preset(10)
qos_profile_parameters = _preset(1000)
qos_profile_parameter_events = _preset(1000)
qos_profile_action_status_default = _preset(1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
qos_profile_best_available = _preset(
    10, reliability=ReliabilityPolicy.BEST_AVAILABLE, durability=DurabilityPolicy.BEST_AVAILABLE
)

_RELIABILITY = {
    ReliabilityPolicy.BEST_EFFORT: BEST_EFFORT,
    ReliabilityPolicy.BEST_AVAILABLE: BEST_AVAILABLE,
}
_DURABILITY = {
    DurabilityPolicy.TRANSIENT_LOCAL: TRANSIENT_LOCAL,
    DurabilityPolicy.BEST_AVAILABLE: BEST_AVAILABLE,
}


def graph_qos(given: Any) -> QoS:
    """Return the quality of service of the graph for a profile or a depth."""
    if isinstance(given, bool) or not isinstance(given, (int, QoSProfile)):
        raise TypeError(f"Expected QoSProfile or int, but received {type(given)!r}")
    if isinstance(given, int):
        if given < 0:
            raise ValueError("history depth must be greater than or equal to zero")
        return QoS(max(1, given))
    depth = None if given.history is HistoryPolicy.KEEP_ALL else max(1, given.depth)
    reliability = _RELIABILITY.get(given.reliability, RELIABLE)
    return QoS(depth, reliability, _DURABILITY.get(given.durability, VOLATILE))


QOS = {
    "DurabilityPolicy": DurabilityPolicy,
    "HistoryPolicy": HistoryPolicy,
    "InvalidQoSProfileException": InvalidQoSProfileException,
    "LivelinessPolicy": LivelinessPolicy,
    "QoSDurabilityPolicy": DurabilityPolicy,
    "QoSHistoryPolicy": HistoryPolicy,
    "QoSLivelinessPolicy": LivelinessPolicy,
    "QoSProfile": QoSProfile,
    "QoSReliabilityPolicy": ReliabilityPolicy,
    "ReliabilityPolicy": ReliabilityPolicy,
    "qos_profile_action_status_default": qos_profile_action_status_default,
    "qos_profile_best_available": qos_profile_best_available,
    "qos_profile_default": qos_profile_default,
    "qos_profile_parameter_events": qos_profile_parameter_events,
    "qos_profile_parameters": qos_profile_parameters,
    "qos_profile_sensor_data": qos_profile_sensor_data,
    "qos_profile_services_default": qos_profile_services_default,
    "qos_profile_system_default": qos_profile_system_default,
}
"""Content of ``rclpy.qos``."""


class EntityNode(Protocol):
    """What entities use of their node."""

    @property
    def graph_node(self) -> GraphNode:
        """The node of the graph behind the node of rclpy."""

    @property
    def context(self) -> Context:
        """Context of the node."""

    @property
    def executor(self) -> Executor | None:
        """Executor that spins the node."""

    def execute(self, callback: Callable[..., Any], *args: Any) -> None:
        """Run a callback, which may be a coroutine function."""


def type_name(caller: str, given: Any) -> str:
    """Return the name of a message class; raise ``TypeError`` in the name of *caller* for anything else."""
    name = getattr(given, "__msgtype__", "")
    if not name:
        raise TypeError(f"{caller}: {given!r} is no message class; import one, as in std_msgs.msg")
    return str(name)


def service_name(caller: str, given: Any) -> str:
    """Return the name of a service class; raise ``TypeError`` in the name of *caller* for anything else."""
    name = getattr(given, "_type", "")
    if not name or not hasattr(given, "Request"):
        raise TypeError(f"{caller}: {given!r} is no service class; import one, as in std_srvs.srv")
    return str(name)


class Publisher:
    """Publisher returned by ``node.create_publisher``."""

    def __init__(self, node: EntityNode, msg_type: Any, topic: str, qos: Any) -> None:
        self.msg_type = msg_type
        self.qos_profile = qos
        self._made = node.graph_node.advertise(topic, type_name("create_publisher", msg_type), graph_qos(qos))
        self.topic = self.topic_name = self._made.topic

    def publish(self, msg: Any) -> None:
        """Publish a message; raise ``TypeError`` if it is of another type."""
        if not isinstance(msg, self.msg_type):
            raise TypeError(f"Expected {self.msg_type}, got {type(msg)}")
        self._made.publish(msg)

    def get_subscription_count(self) -> int:
        """Return the number of subscriptions to the topic."""
        return self._made.subscribers()

    def destroy(self) -> None:
        """Remove the publisher from the graph."""
        self._made.close()


class Subscription:
    """Subscription returned by ``node.create_subscription``."""

    def __init__(
        self,
        node: EntityNode,
        msg_type: Any,
        topic: str,
        callback: Callable[[Any], Any],
        *,
        qos: Any,
        queue: CallbackQueue,
    ) -> None:
        self.msg_type, self.callback, self.qos_profile = msg_type, callback, qos
        self.callback_group: CallbackGroup = queue.group
        kind = type_name("create_subscription", msg_type)
        self._node = node
        self._made = node.graph_node.subscribe(topic, kind, self._call, graph_qos(qos), queue.ready)
        self.topic = self.topic_name = self._made.topic

    def _call(self, message: Any) -> None:
        self._node.execute(self.callback, message)

    def get_publisher_count(self) -> int:
        """Return the number of publishers of the topic."""
        return self._made.publishers()

    def destroy(self) -> None:
        """Remove the subscription from the graph."""
        self._made.close()


class Service:
    """Service of node.create_service. The callback gets request and response; it returns one."""

    def __init__(
        self,
        node: EntityNode,
        srv_type: Any,
        name: str,
        callback: Callable[[Any, Any], Any],
        queue: CallbackQueue,
    ) -> None:
        self.srv_type, self.callback = srv_type, callback
        self.callback_group: CallbackGroup = queue.group
        kind = service_name("create_service", srv_type)
        self._made = node.graph_node.serve(name, kind, self._handle, queue.ready)
        self.srv_name = self.service_name = self._made.name

    def _handle(self, request: Any) -> Any:
        response = self.callback(request, self.srv_type.Response())
        if not isinstance(response, Message):
            close = getattr(response, "close", None)
            if close is not None:
                close()
                raise TypeError(f"service {self.srv_name}: a coroutine cannot answer on the embedded graph")
            raise TypeError(f"service {self.srv_name}: its callback returned {response!r}, not a response")
        return response

    def destroy(self) -> None:
        """Remove the service from the graph."""
        self._made.close()


class Client:
    """Client returned by ``node.create_client``. Responses are processed when the executor spins."""

    def __init__(self, node: EntityNode, srv_type: Any, name: str, queue: CallbackQueue) -> None:
        self.srv_type = srv_type
        self.callback_group: CallbackGroup = queue.group
        self._node, self._queue = node, queue
        self._made = node.graph_node.client(name, service_name("create_client", srv_type))
        self.srv_name = self.service_name = self._made.name
        self._destroyed = False

    def service_is_ready(self) -> bool:
        """Return whether the service is available."""
        return self._made.ready()

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        """Block until the service is available; return False after a time-out."""
        return self._made.wait(None if timeout_sec is None or timeout_sec < 0 else from_seconds(timeout_sec))

    def call_async(self, request: Any) -> Future:
        """Send a request; return the future of its response."""
        return self._send(request, self._node.executor)

    def _send(self, request: Any, executor: Executor | None) -> Future:
        if self._destroyed:
            raise InvalidHandle("the client was destroyed")
        if not isinstance(request, self.srv_type.Request):
            raise TypeError(f"Expected {self.srv_type.Request}, got {type(request)}")
        future = Future(executor=executor)
        sent = request.copy()
        context = self._node.context

        def call() -> None:
            try:
                response = self._made.call(sent)
            except ServiceError as error:
                failure = error
                self._enqueue(lambda: future.set_exception(failure))
            else:
                self._enqueue(lambda: future.set_result(response))

        context.spawn(call, f"call of {self.srv_name}")
        return future

    def _enqueue(self, action: Callable[[], None]) -> None:
        kernel = self._node.context.kernel
        with kernel.guard:
            self._queue.ready.add(Work(kernel.now(), action))

    def call(self, request: Any, timeout_sec: float | None = None) -> Any:
        """Send a request and block until an executor in another task has processed the response.

        Raises:
            TimeoutError: No response was processed in time.
        """
        future = self._send(request, None)  # without an executor the waiting task is notified at once
        answered = Signal(
            self._node.context.kernel, f"{self.srv_name} (an answer, which an executor takes in)"
        )
        future.add_done_callback(lambda _: answered.notify())
        within = None if timeout_sec is None or timeout_sec < 0 else from_seconds(timeout_sec)
        if not answered.wait_for(future.done, within):
            raise TimeoutError(f"no answer from {self.srv_name} within {timeout_sec} s")
        return future.result()

    def destroy(self) -> None:
        """Refuse further calls."""
        self._destroyed = True


class Timer:
    """Timer returned by ``node.create_timer``."""

    def __init__(
        self,
        node: EntityNode,
        period: Ns,
        callback: Callable[..., Any],
        queue: CallbackQueue,
        *,
        autostart: bool = True,
    ) -> None:
        self.callback = callback
        self.callback_group: CallbackGroup = queue.group
        self.timer_period_ns = period
        self._node, self._queue = node, queue
        self._made: Any = None
        self._started: Ns = 0
        if autostart:
            self.reset()

    def _fire(self) -> None:
        self._node.execute(self.callback)

    def cancel(self) -> None:
        """Stop the timer until it is reset."""
        if self._made is not None:
            self._made.cancel()
            self._made = None

    def is_canceled(self) -> bool:
        """Return whether the timer is cancelled."""
        return self._made is None

    def reset(self) -> None:
        """Restart the timer; the next call is one period from now."""
        self.cancel()
        self._started = self._node.context.kernel.now()
        self._made = self._node.graph_node.timer(self.timer_period_ns, self._fire, self._queue.ready)

    def time_until_next_call(self) -> Ns | None:
        """Return the time until the next call in ns, or None if the timer is cancelled."""
        if self._made is None:
            return None
        since = self._node.context.kernel.now() - self._started
        return self.timer_period_ns - since % self.timer_period_ns

    def destroy(self) -> None:
        """Stop the timer."""
        self.cancel()


def timer_period(seconds: float) -> Ns:
    """Return the period of a timer in ns; raise ``ValueError`` if it is not above 0 s."""
    if seconds <= 0:
        raise ValueError("timer period must be above 0 s")
    return round(seconds * S)
