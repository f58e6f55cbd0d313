"""The graph of a ROS master and its nodes, each made by a copy of rospy.

A node has its publishers, subscriptions, services and clients.
"""

from __future__ import annotations

import logging
import os
import struct
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

from volery.base.errors import LinkError, UsageError
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.ros.graph.embedded_graph import record_short
from volery.ros.graph.graph_context import Records
from volery.ros.graph.interface import (
    TRANSIENT_LOCAL,
    NameTakenError,
    QoS,
    ServiceState,
    TopicState,
    full_node_name,
    join_names,
)
from volery.ros.messages import RosMessage, ServiceType, from_ros1, ros1_service, ros1_type, to_ros1
from volery.ros.messages.encodings import cdr_to_ros1, our_name
from volery.ros.transports.client_library import OnMessage, OnRequest, OnResponse, ReceivedMessage
from volery.ros.transports.ros1.master import (
    URI_VARIABLE,
    Master,
    Roscore,
    TopicTypes,
    is_alive,
    master_answers,
    uri_of_master,
)
from volery.ros.transports.ros1.rospy_copy import (
    CopyServers,
    raw_message_class,
    raw_service_class,
    rospy_copy,
)
from volery.ros.transports.transport_graph import TransportGraph

GOODBYE_S = 2.0
SIM_TIME = "/use_sim_time"
Aside = Callable[[Callable[[], object]], None]
"""Executes something in a thread: the caller must not wait for a master that may be gone."""
ANY = "*"
"""Type of a subscriber that accepts every type."""


class Ros1Publisher:
    """A rospy publisher. ROS 1 latches the last message only, for any depth."""

    def __init__(self, rospy: Any, topic: str, message_type: str, qos: QoS, aside: Aside) -> None:
        self._aside = aside
        self._type, self._class = message_type, raw_message_class(message_type)
        self._counts = ros1_type(message_type).has_header
        self._sent = 0
        self._publisher = rospy.Publisher(
            topic,
            self._class,
            latch=qos.durability == TRANSIENT_LOCAL,
            queue_size=qos.depth or 0,  # never None: then rospy would wait for the slowest receiver
            tcp_nodelay=True,
        )

    def send(self, data: bytes) -> None:
        """Queue a message for each connection."""
        raw = cdr_to_ros1(self._type, data)
        self._sent += 1
        if self._counts:
            raw = struct.pack("<I", self._sent & 0xFFFFFFFF) + raw[4:]  # the header's seq, as rospy counts
        self._publisher.publish(self._class(raw))

    def connected(self) -> int:
        """Return the number of connections."""
        return int(self._publisher.get_num_connections())

    def close(self) -> None:
        """Unregister."""
        self._aside(self._publisher.unregister)


class Ros1Subscription:
    """A rospy subscriber."""

    def __init__(self, rospy: Any, topic: str, message_type: str, arrived: OnMessage, aside: Aside) -> None:
        self._aside = aside
        read = partial(from_ros1, message_type)

        def take(raw: Any) -> None:
            about = raw._connection_header
            latched = about.get("latching") == "1"
            arrived(ReceivedMessage(raw.data, read, about.get("callerid", ""), latched))

        self._subscriber = rospy.Subscriber(topic, raw_message_class(message_type), take, tcp_nodelay=True)

    def connected(self) -> int:
        """Return the number of connections."""
        return int(self._subscriber.get_num_connections())

    def close(self) -> None:
        """Unregister."""
        self._aside(self._subscriber.unregister)


class Ros1ServiceServer:
    """A rospy service: each request holds a thread of rospy until it is answered."""

    def __init__(self, rospy: Any, name: str, kind: ServiceType, requested: OnRequest, aside: Aside) -> None:
        self._aside = aside
        cls = raw_service_class(kind)
        wanted, given = kind.request.__msgtype__, cls._response_class

        def handle(request: Any) -> Any:
            ended = threading.Event()
            outcome: list[tuple[RosMessage | None, str]] = []

            def done(answer: RosMessage | None, problem: str) -> None:
                outcome.append((answer, problem))
                ended.set()

            try:
                requested(from_ros1(wanted, request.data), done)
            except UsageError as error:
                raise rospy.ServiceException(str(error)) from error
            ended.wait()
            answer, problem = outcome[0]
            if answer is None:
                raise rospy.ServiceException(problem)
            return given(to_ros1(answer))

        self._service = rospy.Service(name, cls, handle)

    def close(self) -> None:
        """Unregister."""
        self._aside(partial(self._service.shutdown, "closed"))


class Ros1ServiceClient:
    """A rospy service proxy for each call."""

    def __init__(self, rospy: Any, master: Master, name: str, kind: ServiceType) -> None:
        self._rospy, self._master, self._name, self._kind = rospy, master, name, kind
        self._class = raw_service_class(kind)
        self._answer = kind.response.__msgtype__

    def call(self, request: RosMessage, done: OnResponse) -> Callable[[], None]:
        """Send the request in a thread of its own; abandoning the call closes its connection."""
        proxy = self._rospy.ServiceProxy(self._name, self._class)
        wanted = self._class._request_class(to_ros1(request))

        def ask() -> None:
            try:
                answer = from_ros1(self._answer, proxy.call(wanted).data)
            except Exception as error:  # rospy raises many types, e.g. for a closed socket
                done(None, _error_text(error))
            else:
                done(answer, "")

        threading.Thread(target=ask, name=f"call {self._name}", daemon=True).start()
        return partial(_close_connection, proxy)

    def ready(self) -> bool:
        """Return whether the master has a server registered."""
        return self._master.find("lookupService", self._name) is not None

    def close(self) -> None:
        """Do nothing: there is no state between calls."""


def _close_connection(proxy: Any) -> None:
    transport = proxy.transport
    if transport is not None:
        with suppress(OSError, AttributeError):
            transport.socket.shutdown(2)  # wakes the thread that reads from it


def _error_text(error: Exception) -> str:
    text = str(error)
    if "unavailable" in text or "unable to contact" in text or "unable to connect" in text.lower():
        return f"no node serves it: {text}"
    # rospy wraps the server's words in bytes
    return text.replace("b'", "'").replace('b"', '"')


def _aside(work: Callable[[], object]) -> None:
    threading.Thread(target=work, daemon=True).start()


class Ros1Node:
    """See ``volery.ros.transports.client_library.LibraryNode``."""

    def __init__(self, types: TopicTypes, name: str, namespace: str, lost: Callable[[str], None]) -> None:
        self._types, master = types, types.master
        self.name = full_node_name(name, namespace)
        self.master = Master(master.uri, self.name)
        self._check_free()
        self.rospy = rospy = rospy_copy()
        # rospy reads the namespace of the node's name from its command line
        rospy.names._set_caller_id(join_names(namespace, "unnamed"))
        servers = CopyServers(rospy)
        rospy.init_node(name, argv=[], disable_signals=True, disable_rosout=True, disable_rostime=True)
        self._closing = False
        self._gone = threading.Event()
        rospy.core.add_preshutdown_hook(lambda reason: None if self._closing else lost(_why(reason)))
        rospy.core.add_preshutdown_hook(lambda reason: self._gone.set())  # runs when all is unregistered
        rospy.core.add_preshutdown_hook(lambda reason: servers.end())

    def _check_free(self) -> None:
        """Raise if the name is taken: a second node of a name would make the master end the first."""
        other = self.master.find("lookupNode", self.name)
        if other is not None and is_alive(other):
            raise NameTakenError(
                f"a node named {self.name} is there already (at {other}); "
                f"choose another name or namespace for this one"
            )

    def _check_type(self, topic: str, message_type: str) -> None:
        self.master.value("getPid")  # rospy would wait for a master that is gone
        wanted, carried = ros1_type(message_type).name, self._types.of(topic)
        if carried not in (wanted, ANY, ""):
            publishers, subscribers, _ = self.master.value("getSystemState")
            users = [user for at, who in (*publishers, *subscribers) if at == topic for user in who]
            if users:
                raise UsageError(
                    f"node {self.name}: topic {topic} carries {carried} (of {', '.join(users)}), not {wanted}"
                )
        self._types.note(topic, wanted)

    def advertise(self, topic: str, message_type: str, qos: QoS) -> Ros1Publisher:
        """Publish to a topic."""
        self._check_type(topic, message_type)
        return Ros1Publisher(self.rospy, topic, message_type, qos, self._while_there)

    def subscribe(self, topic: str, message_type: str, qos: QoS, arrived: OnMessage) -> Ros1Subscription:
        """Receive a topic. ROS 1 supports only the depth of the QoS, which the caller's queue implements."""
        self._check_type(topic, message_type)
        return Ros1Subscription(self.rospy, topic, message_type, arrived, self._while_there)

    def serve(self, name: str, kind: ServiceType, requested: OnRequest) -> Ros1ServiceServer:
        """Offer a service."""
        self.master.value("getPid")
        if self.master.find("lookupService", name) is not None:
            _, _, services = self.master.value("getSystemState")
            users = [user for at, who in services if at == name for user in who]
            if any(is_alive(self.master.find("lookupNode", user) or "") for user in users):
                raise UsageError(f"node {self.name}: service {name} is served by {', '.join(users)} already")
        ros1_service(kind.name)
        return Ros1ServiceServer(self.rospy, name, kind, requested, self._while_there)

    def client(self, name: str, kind: ServiceType) -> Ros1ServiceClient:
        """Return a client of a service."""
        return Ros1ServiceClient(self.rospy, self.master, name, kind)

    def has_service(self, name: str) -> bool:
        """Return whether the master has a server registered."""
        return self.master.find("lookupService", name) is not None

    def get_parameter(self, name: str) -> Any:
        """Access a parameter of the parameter server; ``KeyError`` if there is none."""
        code, _, value = self.master.ask("getParam", name)
        if code != 1:
            raise KeyError(name)
        return value

    def set_parameter(self, name: str, value: Any) -> None:
        """Set a parameter of the parameter server."""
        try:
            self.master.value("setParam", name, value)
        except (OverflowError, TypeError) as error:
            raise UsageError(f"parameter {name}: ROS 1 cannot carry {value!r}: {error}") from error

    def delete_parameter(self, name: str) -> None:
        """Access a parameter of the parameter server; ``KeyError`` if there is none."""
        code, _, _ = self.master.ask("deleteParam", name)
        if code != 1:
            raise KeyError(name)

    @property
    def closed(self) -> bool:
        """Whether it has left the graph or was removed."""
        return self._closing or bool(self.rospy.core.is_shutdown_requested())

    def known(self) -> bool:
        """Return whether the master has this node registered at its present URI."""
        return bool(self.master.find("lookupNode", self.name) == self.rospy.core.get_node_uri())

    def register_again(self) -> None:
        """Register everything of this node again at a master that has restarted."""
        registration = self.rospy.impl.registration
        topics, services = registration.get_topic_manager(), registration.get_service_manager()
        uri = self.rospy.core.get_node_uri()
        for topic, kind in topics.get_publications():
            self.master.value("registerPublisher", topic, kind, uri)
        for service, address in services.get_services():
            self.master.value("registerService", service, address, uri)
        for topic, kind in topics.get_subscriptions():
            publishers = self.master.value("registerSubscriber", topic, kind, uri)
            for listener in registration.get_registration_listeners().listeners:
                listener.publisher_update(topic, publishers)

    def _while_there(self, work: Callable[[], object]) -> None:
        """Unregister one thing in a thread, unless the node is leaving, which unregisters everything."""
        if not self.closed:
            _aside(work)

    def prepare_close(self) -> None:
        """Let the node's shutdown unregister everything."""
        self._closing = True

    def close(self) -> None:
        """Leave the graph: at once for this process, for others as soon as the master answers."""
        self._closing = True
        _aside(partial(self.rospy.core.signal_shutdown, "closed"))
        self._gone.wait(GOODBYE_S)


def _why(reason: str) -> str:
    if "new node registered" in reason:
        return "another node has taken its name, and the master ended this one"
    return f"it was shut down from outside: {reason}"


def is_reachable(master: Master) -> bool:
    """Return whether the master answers."""
    try:
        master.value("getPid")
    except LinkError:
        return False
    return True


WATCH_S = 1.0
LOGGERS = ("rosout", "rospy")


class _ToTrace(logging.Handler):
    """Handler that reports rospy's warnings, such as a peer's other type, which only its log has."""

    def __init__(self, say: Callable[[str], None]) -> None:
        super().__init__(logging.WARNING)
        self._say = say

    def emit(self, record: logging.LogRecord) -> None:
        """Report the text of a record without its traceback."""
        text = record.getMessage().strip().partition("Traceback")[0].rstrip(": \n")
        topic = record.threadName or ""  # what connects a subscriber is named after its topic
        self._say(f"{topic}: {text}" if topic.startswith("/") else text)


class Ros1Library:
    """See ``volery.ros.transports.client_library.ClientLibrary``.

    A thread watches the master: after a restart the master has lost all registrations, and the nodes of this
    process register again.
    """

    def __init__(self, master: Master, core: Roscore | None) -> None:
        self._master, self._core = master, core
        self._types = TopicTypes(master)
        self._wires: list[Ros1Node] = []
        self._guard = threading.Lock()
        self._over = threading.Event()
        self._log: _ToTrace | None = None
        self._restore_time: Callable[[], object] = lambda: None
        self.say: Callable[[str], None] = lambda text: None

    def start(self) -> None:
        """Start watching the master and rospy's log."""
        self._log = _ToTrace(self._pass_on)
        for name in LOGGERS:
            logging.getLogger(name).addHandler(self._log)
            logging.getLogger(name).propagate = False
        threading.Thread(target=self._watch, name="ROS master", daemon=True).start()

    def _pass_on(self, text: str) -> None:
        self.say(text)

    def join(self, name: str, namespace: str, lost: Callable[[str], None]) -> Ros1Node:
        """Create and register a node."""
        node = Ros1Node(self._types, name, namespace, lost)
        with self._guard:
            self._wires.append(node)
        return node

    def _watch(self) -> None:
        there = True
        while not self._over.wait(WATCH_S):
            found = is_reachable(self._master)
            if there and not found:
                self.say(f"the ROS master at {self._master.uri} does not answer any more")
            there = found
            if found:
                self._register_again()

    def _register_again(self) -> None:
        with self._guard:
            self._wires = [wire for wire in self._wires if not wire.closed]
            wires = list(self._wires)
        for wire in wires:
            try:
                if not wire.known():
                    wire.register_again()
                    self.say(f"{wire.name}: registered again at {self._master.uri}")
            except LinkError as error:
                self.say(f"{wire.name}: {error}")

    def _state(self) -> tuple[dict[str, str], list[Any]]:
        kinds = {name: our_name(kind) for name, kind in self._master.value("getTopicTypes")}
        return kinds, self._master.value("getSystemState")

    def node_names(self) -> list[str]:
        """Return the nodes that are registered for anything, sorted."""
        _, state = self._state()
        return sorted({node for part in state for _, nodes in part for node in nodes})

    def offered(self, topic: str) -> tuple[QoS, ...]:
        """Return nothing: the master does not know what is latched, only its receivers do."""
        return ()

    def topics(self) -> list[TopicState]:
        """Return the registered topics, by name."""
        kinds, (publishers, subscribers, _) = self._state()
        sending = {name: tuple(sorted(nodes)) for name, nodes in publishers}
        hearing = {name: tuple(sorted(nodes)) for name, nodes in subscribers}
        every = sorted({*sending, *hearing})
        return [
            TopicState(one, kinds.get(one, ""), sending.get(one, ()), hearing.get(one, ())) for one in every
        ]

    def services(self) -> list[ServiceState]:
        """Return the registered services, by name; their types are empty, since the master has none."""
        _, (_, _, services) = self._state()
        return [ServiceState(name, "", nodes[0] if nodes else "") for name, nodes in sorted(services)]

    def announce_clock(self) -> None:
        """Set ``/use_sim_time``, which every node reads when it starts, until the graph is left."""
        before = self._master.find("getParam", SIM_TIME)
        restored = ("deleteParam", SIM_TIME) if before is None else ("setParam", SIM_TIME, before)
        self._master.value("setParam", SIM_TIME, True)
        self._restore_time = partial(self._master.ask, *restored)

    def close(self) -> None:
        """Restore the time of the master, and stop watching it; stop a roscore that this process started."""
        self._over.set()
        with suppress(LinkError):  # the master is gone
            self._restore_time()
        if self._log is not None:
            for name in LOGGERS:
                logging.getLogger(name).removeHandler(self._log)
        if self._core is not None:
            self._core.stop()


def ros1_graph(
    kernel: Kernel,
    *,
    master: str = "",
    start_master: bool = True,
    records: Records = record_short,
    epoch: Ns | None = None,
) -> TransportGraph:
    """Return the graph of a ROS master.

    Args:
        kernel: Clock and tasks of the nodes.
        master: URI of the master; empty for ``ROS_MASTER_URI`` or ROS's default.
        start_master: Start ``roscore`` if no master answers, and stop it in ``close``.
        records: What is recorded of each topic; here of long messages the content as well.
        epoch: ROS time at the kernel's zero, ns; by default the Unix time then.

    Raises:
        LinkSilent: no master answers, and none is to be started.
        UsageError: this process uses another master already.
    """
    uri = master or uri_of_master()
    _claim(uri)
    core = None
    if not master_answers(uri):
        if start_master:
            core = Roscore(uri)
            core.start()
        else:
            Master(uri, "/volery").value("getPid")
    library = Ros1Library(Master(uri, "/volery"), core)
    graph = TransportGraph(kernel, library, records=records, epoch=epoch)
    library.say = graph.warn
    library.start()
    return graph


_claimed: list[str] = []


def _claim(uri: str) -> None:
    """Set the master's address for rospy, which reads it from the environment at each request."""
    if _claimed and _claimed[0] != uri:
        raise UsageError(
            f"this process is on the ROS master at {_claimed[0]}; rospy cannot talk to {uri} as well: "
            f"use another process"
        )
    _claimed[:] = [uri]
    os.environ[URI_VARIABLE] = uri
