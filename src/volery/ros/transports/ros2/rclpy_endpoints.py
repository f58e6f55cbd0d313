"""Publishers, subscriptions, services, clients and parameters of rclpy. Messages cross as bytes.

Parameters in ROS 2 belong to nodes: ``/ns/node/gains/p`` is the parameter ``gains.p`` of ``/ns/node``. A
node's own are accessed through rclpy, those of other nodes through their parameter services.

Each part of a node has a callback group of its own: where rclpy fails to take what is ready, it leaves the
group locked for ever. In the group of the node that would end all its topics, ``/clock`` included, and the
answers to its calls, without a word.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from importlib import import_module
from typing import Any

from volery.base.errors import LinkSilent, UsageError
from volery.ros.graph.interface import BEST_AVAILABLE, BEST_EFFORT, RELIABLE, TRANSIENT_LOCAL, VOLATILE, QoS
from volery.ros.messages import RosMessage, ServiceType, from_cdr
from volery.ros.transports.client_library import OnMessage, OnRequest, OnResponse, ReceivedMessage
from volery.ros.transports.ros2.rclpy_types import from_rclpy, rclpy_class, rclpy_service, to_rclpy


def profile(qos: QoS) -> Any:
    """Return rclpy's profile of a QoS."""
    rclpy_qos = import_module("rclpy.qos")
    return rclpy_qos.QoSProfile(
        depth=qos.depth or 0,
        history=rclpy_qos.HistoryPolicy.KEEP_ALL if qos.depth is None else rclpy_qos.HistoryPolicy.KEEP_LAST,
        reliability=rclpy_qos.ReliabilityPolicy[qos.reliability.upper()],
        durability=rclpy_qos.DurabilityPolicy[qos.durability.upper()],
    )


def own_group() -> Any:
    """Return a callback group for one part of a node; reentrant: a request in progress blocks nothing."""
    return import_module("rclpy.callback_groups").ReentrantCallbackGroup()


def offered_qos(offered: Any) -> QoS:
    """Return the QoS of a discovered publisher; DDS does not tell its depth."""
    reliable = offered.reliability.name != BEST_EFFORT.upper()
    kept = offered.durability.name == TRANSIENT_LOCAL.upper()
    return QoS(None, RELIABLE if reliable else BEST_EFFORT, TRANSIENT_LOCAL if kept else VOLATILE)


class Ros2Publisher:
    """An rclpy publisher of bytes."""

    def __init__(self, node: Any, topic: str, message_type: str, qos: QoS) -> None:
        self._node = node
        offered = replace(
            qos,
            reliability=RELIABLE if qos.reliability == BEST_AVAILABLE else qos.reliability,
            durability=VOLATILE if qos.durability == BEST_AVAILABLE else qos.durability,
        )
        self._publisher = node.create_publisher(rclpy_class(message_type), topic, profile(offered))

    def send(self, data: bytes) -> None:
        """Publish a message's CDR bytes."""
        self._publisher.publish(data)

    def connected(self) -> int:
        """Return the number of subscriptions it is matched with."""
        return int(self._publisher.get_subscription_count())

    def close(self) -> None:
        """Remove it from the node."""
        self._node.destroy_publisher(self._publisher)


class Ros2Subscription:
    """An rclpy subscription of bytes.

    DDS leaves incompatible endpoints unconnected. A ``best_available`` subscription is therefore adapted
    whenever a publisher is discovered: reliable unless one publisher is not, transient-local if all are.
    Messages that are delivered twice over such a change are dropped by their source time.
    """

    def __init__(self, node: Any, topic: str, message_type: str, qos: QoS, arrived: OnMessage) -> None:
        self._node, self._topic, self._type, self._arrived = node, topic, message_type, arrived
        self._wanted = qos
        self._read = partial(from_cdr, message_type)
        self._guard = threading.Lock()
        self._open = True
        self._latest = self._repeated = (
            0  # source times: of the last message, and of the last before a change
        )
        self._now = self._fitting()
        self._subscription = self._subscribe()

    def _offers(self) -> list[Any]:
        return [one.qos_profile for one in self._node.get_publishers_info_by_topic(self._topic)]

    def _fitting(self) -> QoS:
        """Return the strongest QoS that all publishers known by now offer, within the requested one."""
        offers = self._offers()
        reliability, durability = self._wanted.reliability, self._wanted.durability
        if reliability == BEST_AVAILABLE:
            unreliable = any(offer.reliability.name == "BEST_EFFORT" for offer in offers)
            reliability = BEST_EFFORT if unreliable else RELIABLE
        if durability == BEST_AVAILABLE:
            kept = offers and all(offer.durability.name == "TRANSIENT_LOCAL" for offer in offers)
            durability = TRANSIENT_LOCAL if kept else VOLATILE
        return replace(self._wanted, reliability=reliability, durability=durability)

    def _subscribe(self) -> Any:
        callbacks = import_module("rclpy.event_handler").SubscriptionEventCallbacks
        events = {"incompatible_qos": self._look_again}
        if hasattr(callbacks(), "matched"):  # from Iron on
            events["matched"] = self._look_again
        return self._node.create_subscription(
            rclpy_class(self._type),
            self._topic,
            self._take,
            profile(self._now),
            raw=True,
            callback_group=own_group(),
            event_callbacks=callbacks(**events),
        )

    def _take(self, data: bytes, about: Any) -> None:
        self._latest = at = about["source_timestamp"]
        if at > self._repeated:
            self._arrived(ReceivedMessage(data, self._read, ""))

    def _look_again(self, event: Any) -> None:
        """Adapt to a new publisher in the thread that waits, before its next wait: in one nothing may go."""
        if BEST_AVAILABLE in (self._wanted.reliability, self._wanted.durability):
            self._node.executor.create_task(self._adapt)

    def _adapt(self) -> None:
        with self._guard:
            if self._open and self._offers() and (fitting := self._fitting()) != self._now:
                self._now = fitting
                self._node.destroy_subscription(self._subscription)
                self._repeated = self._latest
                self._subscription = self._subscribe()

    def connected(self) -> int:
        """Return the number of compatible publishers."""
        rclpy_qos = import_module("rclpy.qos")
        known = self._node.get_publishers_info_by_topic(self._topic)
        mine = profile(self._now)
        bad = rclpy_qos.QoSCompatibility.ERROR
        return sum(1 for one in known if rclpy_qos.qos_check_compatible(one.qos_profile, mine)[0] != bad)

    def close(self) -> None:
        """Remove it from the node."""
        with self._guard:
            self._open = False
            self._node.destroy_subscription(self._subscription)


class NoAnswerError(Exception):
    """Ends a service's callback without an answer: ROS 2 cannot report a failure."""


class Ros2ServiceServer:
    """An rclpy service; a request that fails is not answered, as in ROS 2."""

    def __init__(self, node: Any, name: str, kind: ServiceType, requested: OnRequest) -> None:
        types = rclpy_service(kind)
        self._node = node
        future_class = import_module("rclpy.task").Future

        async def handle(request: Any, response: Any) -> Any:
            answered = future_class(executor=node.executor)

            def done(answer: RosMessage | None, problem: str) -> None:
                if not answered.done():
                    answered.set_result(answer)
                    node.executor.wake()  # the executor checks results only when it is woken

            requested(from_rclpy(kind.request.__msgtype__, request), done)
            answer = await answered
            if answer is None:
                raise NoAnswerError
            return to_rclpy(answer, types.response)

        self._service = node.create_service(types.type, name, handle, callback_group=own_group())

    def close(self) -> None:
        """Remove it from the node."""
        self._node.destroy_service(self._service)


class Ros2ServiceClient:
    """An rclpy client."""

    def __init__(self, node: Any, name: str, kind: ServiceType) -> None:
        self._node, self._name, self._kind = node, name, kind
        self._types = rclpy_service(kind)
        self._client = node.create_client(self._types.type, name, callback_group=own_group())

    def call(self, request: RosMessage, done: OnResponse) -> Callable[[], None]:
        """Send the request, if a server has been discovered; rclpy would wait for one without limit."""
        if not self._client.service_is_ready():
            done(None, "no node serves it")
            return lambda: None
        future = self._client.call_async(to_rclpy(request, self._types.request))

        def finish(ended: Any) -> None:
            answer = None if ended.cancelled() else ended.result()
            if answer is None:
                done(None, f"no answer: {ended.exception() or 'cancelled'}")
            else:
                done(from_rclpy(self._kind.response.__msgtype__, answer), "")

        future.add_done_callback(finish)
        return partial(self._give_up, future)

    def _give_up(self, future: Any) -> None:
        with suppress(KeyError, ValueError):
            self._client.remove_pending_request(future)

    def ready(self) -> bool:
        """Return whether a server has been discovered."""
        return bool(self._client.service_is_ready())

    def close(self) -> None:
        """Remove it from the node."""
        self._node.destroy_client(self._client)


def check_type(node: Any, topic: str, message_type: str, who: str) -> None:
    """Raise ``UsageError`` if the topic carries another type: DDS would leave the endpoints unconnected."""
    ends = (*node.get_publishers_info_by_topic(topic), *node.get_subscriptions_info_by_topic(topic))
    others = [end for end in ends if end.topic_type != message_type]
    if others:
        users = sorted({f"{other.node_namespace.rstrip('/')}/{other.node_name}" for other in others})
        raise UsageError(
            f"node {who}: topic {topic} carries {others[0].topic_type} "
            f"(of {', '.join(users)}), not {message_type}"
        )


PATIENCE_S = 5.0


def owner(name: str, own: str, others: list[str]) -> tuple[str, str]:
    """Return the node of a parameter, and the name there (empty for all); ``KeyError`` if there is none."""
    candidates = [one for one in (own, *others) if name == one or name.startswith(f"{one}/")]
    if not candidates:
        raise KeyError(name)
    node = max(candidates, key=len)
    return node, name[len(node) + 1 :].replace("/", ".")


def leaves(prefix: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield a value, or each value of a namespace, with its dotted name."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from leaves(f"{prefix}.{key}" if prefix else str(key), inner)
    else:
        yield prefix, value


def tree(prefix: str, values: dict[str, Any]) -> Any:
    """Return the value at `prefix`, or what is below it as a ``dict``; ``KeyError`` if there is neither."""
    if prefix in values:
        return values[prefix]
    made: dict[str, Any] = {}
    for name, value in values.items():
        if not prefix or name.startswith(f"{prefix}."):
            *path, last = name[len(prefix) + 1 if prefix else 0 :].split(".")
            branch = made
            for step in path:
                branch = branch.setdefault(step, {})
            branch[last] = value
    if not made:
        raise KeyError(prefix)
    return made


class OwnParameters:
    """Parameters of a node of this process."""

    def __init__(self, node: Any) -> None:
        self._node = node

    def get(self, prefix: str) -> Any:
        """Return the value at `prefix`; see ``tree``."""
        values = {name: _plain(one.value) for name, one in self._node._parameters.items()}
        return tree(prefix, values)

    def set(self, prefix: str, value: Any) -> None:
        """Set a value or a namespace."""
        parameter = import_module("rclpy.parameter").Parameter
        try:
            wanted = [parameter(name, value=one) for name, one in leaves(prefix, value)]
        except (TypeError, ValueError) as error:
            raise UsageError(f"parameter {prefix}: ROS 2 cannot hold {value!r}: {error}") from error
        for one in self._node.set_parameters(wanted):
            if not one.successful:
                raise UsageError(f"parameter {prefix}: refused: {one.reason}")

    def delete(self, prefix: str) -> None:
        """Remove a value or a namespace."""
        self.get(prefix)
        for name in list(self._node._parameters):
            if name == prefix or name.startswith(f"{prefix}."):
                self._node.undeclare_parameter(name)


class OtherParameters:
    """Parameters of another node, through its parameter services."""

    def __init__(self, node: Any, name: str) -> None:
        self._node, self._name = node, name
        self._services = import_module("rcl_interfaces.srv")

    def _call(self, kind: Any, service: str, request: Any) -> Any:
        client = self._node.create_client(kind, f"{self._name}/{service}", callback_group=own_group())
        try:
            if not client.wait_for_service(PATIENCE_S):
                raise LinkSilent(f"node {self._name} offers no parameters")
            ended = threading.Event()
            future = client.call_async(request)
            future.add_done_callback(lambda _: ended.set())
            if not ended.wait(PATIENCE_S):
                raise LinkSilent(f"node {self._name} does not answer about its parameters")
            return future.result()
        finally:
            self._node.destroy_client(client)

    def get(self, prefix: str) -> Any:
        """Return the value at `prefix`; see ``tree``."""
        kind = self._services.ListParameters
        names = list(self._call(kind, "list_parameters", kind.Request()).result.names)
        kind = self._services.GetParameters
        values = self._call(kind, "get_parameters", kind.Request(names=names)).values
        read: Callable[[Any], Any] = import_module("rclpy.parameter").parameter_value_to_python
        return tree(prefix, {name: _plain(read(value)) for name, value in zip(names, values, strict=True)})

    def set(self, prefix: str, value: Any) -> None:
        """Set a value or a namespace."""
        parameter = import_module("rclpy.parameter").Parameter
        kind = self._services.SetParameters
        wanted = [parameter(name, value=one).to_parameter_msg() for name, one in leaves(prefix, value)]
        for one in self._call(kind, "set_parameters", kind.Request(parameters=wanted)).results:
            if not one.successful:
                raise UsageError(f"parameter {self._name}/{prefix}: refused: {one.reason}")

    def delete(self, prefix: str) -> None:
        """Raise ``UsageError``: only the node itself can remove its parameters."""
        raise UsageError(f"parameter {prefix} of {self._name}: in ROS 2 only the node itself can remove it")


def _plain(value: Any) -> Any:
    """Return arrays and tuples as lists."""
    return value.tolist() if hasattr(value, "tolist") else list(value) if isinstance(value, tuple) else value
