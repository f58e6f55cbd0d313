"""Publishers, subscribers, services and service proxies of rospy, and the functions that wait for them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from typing import Any, ClassVar, cast

from volery.base.errors import UsageError
from volery.base.time import MS, Ns
from volery.kernel.waiting import Signal
from volery.ros.client_libraries.rospy.master import canonicalize_name
from volery.ros.client_libraries.rospy.session import (
    ROSException,
    ROSSerializationException,
    ServiceException,
    Session,
    Sessions,
)
from volery.ros.graph import BEST_AVAILABLE, LATCHED, QoS, ServiceError, Subscription, Work
from volery.ros.graph.endpoints import EmbeddedPublisher
from volery.ros.messages import RosMessage, ros1_type, to_cdr, to_ros1
from volery.ros.messages.client_classes import SerializationError, adopt, library_of, receiving
from volery.ros.messages.encodings import ros1_name
from volery.trace.events import WARNING

_TYPE_POLL: Ns = 100 * MS
"""Period at which an ``AnyMsg`` subscription looks for the type of its topic."""


class AnyMsg:
    """A message of any type as its ROS 1 bytes, ``_buff``; ``_connection_header`` holds type and topic."""

    _type = "*"
    _md5sum = "*"
    _has_header = False
    _full_text = ""
    __slots__ = ("_buff", "_connection_header")

    def __init__(self) -> None:
        self._buff: bytes | None = None
        self._connection_header: dict[str, Any] | None = None

    @classmethod
    def of(cls, message: RosMessage, topic: str) -> AnyMsg:
        """Return a received message."""
        kind, made = ros1_type(message.__msgtype__), cls()
        made._buff = to_ros1(message)
        made._connection_header = {
            "topic": topic, "type": kind.name, "md5sum": kind.md5, "message_definition": kind.text
        }  # fmt: skip
        return made

    def serialize(self, buff: Any) -> None:
        """Write the bytes to a file-like object; raise ``ROSException`` if there are none."""
        if self._buff is None:
            raise ROSException("AnyMsg is not initialized")
        buff.write(self._buff)

    def deserialize(self, str: bytes) -> AnyMsg:  # noqa: A002 - rospy's name
        """Keep bytes."""
        self._buff = str
        return self


def args_kwds_to_message(data_class: Any, args: Sequence[Any], kwds: Mapping[str, Any]) -> Any:
    """Return the message that ``publish(*args, **kwds)`` sends; raise ``TypeError`` if they do not fit."""
    if len(args) == 1 and not kwds and isinstance(args[0], data_class.of_graph):
        return args[0]
    if args and kwds:
        raise TypeError("publish() can be called with arguments or keywords, but not both.")
    return data_class(*args, **kwds)


class AnySubscription:
    """Subscribes as soon as the type of *topic* is known from another publisher or subscriber."""

    def __init__(self, session: Session, topic: str, callback: Callable[[Any], None], qos: QoS) -> None:
        self._session, self.topic, self._qos = session, topic, qos
        self._callback = callback
        self._made: Subscription | None = None
        self._open = True
        session.spawn(self._subscribe_when_known, f"type of {topic}")

    def _subscribe_when_known(self) -> None:
        node = self._session.node
        while self._open and not node.closed:
            kind = next(
                (topic.type for topic in self._session.graph.topics() if topic.name == self.topic), ""
            )
            if kind:
                group = self._session.spinning_group(self.topic, f"callback of {self.topic}")
                self._made = node.subscribe(self.topic, kind, self._call, self._qos, group)
                return
            node.sleep(_TYPE_POLL)

    def _call(self, message: Any) -> None:
        self._callback(AnyMsg.of(message, self.topic))

    def publishers(self) -> int:
        """Return the number of connected publishers."""
        return 0 if self._made is None else self._made.publishers()

    def close(self) -> None:
        """Remove the subscription from the graph."""
        self._open = False
        if self._made is not None:
            self._made.close()


def topic_name(name: Any) -> str:
    """Return the name of a topic as rospy takes it; raise ``ValueError`` if there is none."""
    if not isinstance(name, str) or not name:
        raise ValueError("topic name is not a non-empty string")
    return canonicalize_name(name)


def type_name(caller: str, data_class: Any) -> str:
    """Return the name of a message class; raise ``ValueError`` in the name of *caller* for anything else."""
    name = getattr(data_class, "__msgtype__", "")
    if not name:
        raise ValueError(
            f"rospy.{caller}: {data_class!r} is no message class; import one, as in std_msgs.msg"
        )
    return str(name)


def _subscriber_qos(depth: Any) -> QoS:
    """Return a QoS that matches every publisher, because ROS 1 has no QoS."""
    if depth is not None and not isinstance(depth, int):
        raise ROSException("queue size must be an integer")
    if depth == 0:
        raise ROSException("queue size may not be set to zero")
    return QoS(depth if depth and depth > 0 else None, BEST_AVAILABLE, BEST_AVAILABLE)


class SubscribeListener:
    """Called by a publisher when subscribers come and go; derive from it and override its methods."""

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        """Do nothing. Called when a subscriber has come.

        Args:
            topic_name: Name of the topic.
            topic_publish: Publishes a message to all subscribers.
            peer_publish: Publishes a message to the new one.
        """

    def peer_unsubscribe(self, topic_name: str, num_peers: int) -> None:
        """Do nothing. Called when a subscriber has gone, with the number of those left."""


class Publisher:
    """Publishes to a topic.

    Connections are ready at once. Publishing never blocks, whatever ``queue_size`` is.
    """

    sessions: ClassVar[Sessions]
    reg_type = "pub"

    def __init__(
        self,
        name: str,
        data_class: Any,
        subscriber_listener: Any = None,
        tcp_nodelay: bool = False,
        latch: bool = False,
        headers: Any = None,
        *,
        queue_size: int | None = None,
    ) -> None:
        session = self._session = self.sessions.joined()
        bounded = isinstance(queue_size, int) and queue_size > 0
        qos = LATCHED if latch else QoS(queue_size if bounded else None)
        self.data_class = data_class
        kind = type_name("Publisher", data_class)
        self.type = ros1_name(kind)
        self._count: int | None = 0 if getattr(data_class, "_has_header", False) else None
        self._publisher = session.node.advertise(topic_name(name), kind, qos)
        self.name = self.resolved_name = self._publisher.topic
        added = {"latching": "1" if latch else "0", **(headers or {})}
        self.sessions.headers[session.node.name, self.name] = added
        if subscriber_listener is not None:
            self._tell(subscriber_listener)

    def _tell(self, listener: SubscribeListener) -> None:
        """Call *listener* of subscribers that come and go, in a thread of its own."""
        publisher, name = self._publisher, self.name
        if not isinstance(publisher, EmbeddedPublisher):
            raise UsageError("rospy.Publisher: subscriber_listener works on the embedded graph only")
        group = self._session.spinning_group(f"peers of {name}", f"subscriber_listener of {name}")

        def changed(connection: Any, begins: bool) -> None:
            if begins:
                to_peer = partial(publisher.publish_to, connection)
                call = partial(listener.peer_subscribe, name, self.publish, to_peer)
            else:
                call = partial(listener.peer_unsubscribe, name, publisher.connected)
            group.add(Work(self._session.kernel.now(), call))

        publisher.watch(changed)

    def publish(self, *args: Any, **fields: Any) -> None:
        """Publish a message, or one made of these fields; raise ``ROSException`` before ``init_node``."""
        if not self._session.initialised:
            raise ROSException("ROS node has not been initialized yet. Please call init_node() first")
        message = args_kwds_to_message(self.data_class, args, fields)
        if self._count is not None:
            self._count += 1
            message.header.seq = self._count
        try:
            self._publisher.publish(message)
        except UsageError as error:
            if self._publisher.subscribers() or not _misfits(message):
                raise ROSSerializationException(str(error)) from error
            text = f"{self.name}: not sent (rospy raises this only when the topic has a subscriber): {error}"
            self._session.log(WARNING, text)

    @property
    def md5sum(self) -> str:
        """Checksum of the type."""
        return str(self.data_class._md5sum)

    def get_num_connections(self) -> int:
        """Return the number of connected subscribers."""
        return self._publisher.subscribers()

    def unregister(self) -> None:
        """Remove the publisher from the graph."""
        self._publisher.close()


def _misfits(message: RosMessage) -> bool:
    """Return whether a message has a value that does not fit its field."""
    try:
        to_cdr(message)
    except UsageError:
        return True
    return False


class Subscriber:
    """Calls *callback* with each message, in a thread of its own."""

    sessions: ClassVar[Sessions]
    reg_type = "sub"

    def __init__(
        self,
        name: str,
        data_class: Any,
        callback: Callable[..., Any] | None = None,
        callback_args: Any = None,
        queue_size: int | None = None,
        buff_size: int = 65536,
        *,
        tcp_nodelay: bool = False,
    ) -> None:
        session = self.sessions.joined()
        self.data_class = data_class
        self.callback = callback
        self._args = callback_args
        self._received: Callable[[Any], Any] | None = None
        self._headers: dict[str, Callable[[], dict[str, Any]]] = {}
        name = topic_name(name)
        topic = self.name = self.resolved_name = session.node.resolve(name)
        qos = _subscriber_qos(queue_size)
        self._subscription: AnySubscription | Subscription
        if data_class is AnyMsg:
            self.type = AnyMsg._type
            self._subscription = AnySubscription(session, topic, self._call, qos)
            return
        kind = type_name("Subscriber", data_class)
        self.type = ros1_name(kind)
        group = session.spinning_group(topic, f"callback of {topic}")
        self._received = receiving(data_class)
        simple = callback is not None and callback_args is None and self._received is None
        call = cast("Callable[[Any], None]", callback) if simple else self._call
        self._subscription = session.node.subscribe(name, kind, call, qos, group)

    def _call(self, message: Any) -> None:
        if self.callback is None:
            return
        if self._received is not None:
            self._received(message)
            sender = getattr(self._subscription, "sender", "")
            header_of = self._headers.get(sender)
            if header_of is None:
                header_of = self._headers[sender] = cache(partial(self._header, sender))
            message.connection_of = header_of
        if self._args is None:
            self.callback(message)
        else:
            self.callback(message, self._args)

    def _header(self, sender: str) -> dict[str, Any]:
        """Return the header of the connection to a publisher, as ROS 1 has it."""
        known = {} if not sender else {"callerid": sender}
        of_type = {"type": self.data_class._type, "md5sum": self.data_class._md5sum}
        rest = {"topic": self.name, "message_definition": self.data_class._full_text}
        return {**known, **of_type, **rest, **self.sessions.headers.get((sender, self.name), {})}

    @property
    def md5sum(self) -> str:
        """Checksum of the type."""
        return str(self.data_class._md5sum)

    def get_num_connections(self) -> int:
        """Return the number of connected publishers."""
        return self._subscription.publishers()

    def unregister(self) -> None:
        """Remove the subscription from the graph."""
        self._subscription.close()


def wait_for_message(session: Session, topic: str, data_class: Any, timeout: Ns | None) -> Any:
    """Return the next message of a topic; raise ``ROSException`` after a time-out."""
    received: list[Any] = []
    arrived = Signal(session.kernel, f"{topic} (a message)")

    def keep(message: Any) -> None:
        received.append(message)
        arrived.notify()

    group = session.node.group()
    kind = type_name("wait_for_message", data_class)
    subscription = session.node.subscribe(topic_name(topic), kind, keep, _subscriber_qos(1), group)
    try:
        group.spin_once(timeout)
    finally:
        subscription.close()
    session.check()
    if not received:
        raise ROSException(f"timeout exceeded while waiting for message on topic {subscription.topic}")
    return adopt(received[0], library_of(data_class))


def _service_type(caller: str, service_class: Any) -> str:
    name = getattr(service_class, "_type", "")
    if not name or not hasattr(service_class, "_request_class"):
        raise AttributeError(
            f"rospy.{caller}: {service_class!r} is no service class; import one, as in std_srvs.srv"
        )
    return str(name)


def _service_header(node: str, service_class: Any) -> dict[str, Any]:
    """Return what both sides of a service connection state of a node and the type."""
    name = service_class._type
    types = {"type": name, "request_type": f"{name}Request", "response_type": f"{name}Response"}
    return {"callerid": node, "md5sum": getattr(service_class, "_md5sum", "*"), **types}


class Service:
    """Handles requests, each in a thread of its own."""

    sessions: ClassVar[Sessions]

    def __init__(
        self,
        name: str,
        service_class: Any,
        handler: Callable[[Any], Any],
        buff_size: int = 65536,
        error_handler: Any = None,
    ) -> None:
        self._session = self.sessions.joined()
        self.service_class = service_class
        kind = _service_type("Service", service_class)
        self._handler = handler
        self._error_handler = error_handler
        node = self._session.node
        resolved = node.resolve(canonicalize_name(name))
        group = self._session.spawning_group(resolved, f"handler of {resolved}")
        try:
            self._service = node.serve(canonicalize_name(name), kind, self._handle, group)
        except UsageError as error:
            raise ServiceException(f"service [{resolved}] already registered: {error}") from error
        self.resolved_name = resolved

    def _handle(self, request: Any) -> Any:
        adopt(request, library_of(self.service_class._request_class))
        caller = getattr(self._service, "caller", "")
        added = self.sessions.headers.get((caller, self.resolved_name), {})
        request.connection_of = cache(
            lambda: {**_service_header(caller, self.service_class), "service": self.resolved_name, **added}
        )
        return _to_response(self.service_class, self._handler(request))

    def spin(self) -> None:
        """Block until the node shuts down."""
        self._session.wait_for_end()

    def shutdown(self, reason: str = "") -> None:
        """Remove the service from the graph."""
        self._service.close()


def _to_response(service_class: Any, given: Any) -> Any:
    """Return the response for what a handler returned.

    A handler may return a response, its only field, its fields in order, or a dict of them.
    """
    kind = service_class._response_class
    if isinstance(given, RosMessage):
        return given
    if isinstance(given, dict):
        return kind(**given)
    if isinstance(given, (list, tuple)):
        return kind(*given)
    if given is None:
        raise ServiceException("service handler returned None")
    return kind(given)


class ServiceProxy:
    """A client that calls a service like a function."""

    sessions: ClassVar[Sessions]
    uri: str | None = None

    def __init__(self, name: str, service_class: Any, persistent: bool = False, headers: Any = None) -> None:
        self._session = self.sessions.joined()
        self.service_class = service_class
        self.request_class = getattr(service_class, "_request_class", None)
        self.response_class = getattr(service_class, "_response_class", None)
        kind = _service_type("ServiceProxy", service_class)
        self._client = self._session.node.client(canonicalize_name(name), kind)
        self.resolved_name = self._client.name
        if headers:
            self.sessions.headers[self._session.node.name, self.resolved_name] = dict(headers)

    def __call__(self, *args: Any, **fields: Any) -> Any:
        """Call the service; see ``call``."""
        return self.call(*args, **fields)

    def call(self, *args: Any, **fields: Any) -> Any:
        """Call the service with a request or the fields of one.

        Raises:
            ServiceException: the call has failed.
            SerializationError: a value does not fit its field.
            TypeError, AttributeError: the fields are not those of the request.
        """
        self._session.check()
        kind = self.service_class._request_class
        given = len(args) == 1 and not fields and isinstance(args[0], kind)
        request = args[0] if given else kind(*args, **fields)
        try:
            answer = adopt(self._client.call(request), library_of(kind))
        except ServiceError as error:
            raise ServiceException(f"service [{self.resolved_name}]: {error.what}") from error
        except UsageError as error:
            raise SerializationError(f"service [{self.resolved_name}]: bad request: {error}") from error
        answer.connection_of = cache(self._header)
        return answer

    def _header(self) -> dict[str, Any]:
        """Return the header of the connection to the server, as ROS 1 has it."""
        services = self._session.graph.services()
        server = next((service.server for service in services if service.name == self.resolved_name), "")
        return _service_header(server, self.service_class)

    def wait_for_service(self, timeout: Any = None) -> None:
        """Block until the service is available."""
        wait_for_service(self._session, self.resolved_name, timeout)

    def close(self) -> None:
        """Do nothing: a proxy holds no resources."""


def wait_for_service(session: Session, name: str, timeout: Ns | None) -> None:
    """Block until the service *name* is available; raise ``ROSException`` after a time-out."""
    available = session.node.wait_for_service(name, timeout)
    session.check()
    if not available:
        raise ROSException(f"timeout exceeded while waiting for service {session.node.resolve(name)}")
