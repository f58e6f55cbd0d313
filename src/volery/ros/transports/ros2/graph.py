"""The graph that ROS 2 nodes discover: one rclpy context, one thread that spins all nodes of this process."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.kernel.api import Kernel
from volery.ros.graph.embedded_graph import record_short
from volery.ros.graph.graph_context import Records
from volery.ros.graph.interface import (
    NameTakenError,
    QoS,
    ServiceState,
    TopicState,
    full_node_name,
    join_names,
)
from volery.ros.messages import ServiceType
from volery.ros.transports.client_library import POLL_S, OnMessage, OnRequest
from volery.ros.transports.ros2.rclpy_endpoints import (
    NoAnswerError,
    OtherParameters,
    OwnParameters,
    Ros2Publisher,
    Ros2ServiceClient,
    Ros2ServiceServer,
    Ros2Subscription,
    check_type,
    offered_qos,
    owner,
)
from volery.ros.transports.transport_graph import TransportGraph

DISCOVERY_S = 0.6
"""Time after the start of a process within which discovery is complete if no announcement is lost, s."""
DISCOVERY_LIMIT_S = 5.0
"""Longest wait for the nodes of endpoints that are known already; DDS repeats announcements every 3 s."""
GOODBYE_S = 2.0
"""Longest wait for rclpy to stop spinning, or to destroy a part of it, s."""
WATCH_S = 1.0
"""Period of looking for topics that carry several types, s."""
NOT_KNOWN_YET = "_NODE_NAME_UNKNOWN_"
"""Node name that DDS gives for an endpoint that was discovered before its node."""
HIDDEN = "_volery"
"""Prefix of the names of the transport's own nodes, which are not shown."""
_MISSING = (
    "ROS 2 needs rclpy, which this Python does not see: source your installation's setup.bash, or install "
    "the wheels with scripts/ros2-venv, and use that Python"
)


def available() -> bool:
    """Return whether rclpy can be imported."""
    return find_spec("rclpy") is not None


class Ros2Node:
    """See ``volery.ros.transports.client_library.LibraryNode``."""

    def __init__(self, library: Ros2Library, name: str, namespace: str) -> None:
        self.name = full_node_name(name, namespace)
        self._library = library
        self._node = library.make(name, namespace)

    def advertise(self, topic: str, message_type: str, qos: QoS) -> Ros2Publisher:
        """Publish to a topic."""
        check_type(self._node, topic, message_type, self.name)
        return Ros2Publisher(self._node, topic, message_type, qos)

    def subscribe(self, topic: str, message_type: str, qos: QoS, arrived: OnMessage) -> Ros2Subscription:
        """Receive a topic."""
        check_type(self._node, topic, message_type, self.name)
        return Ros2Subscription(self._node, topic, message_type, qos, arrived)

    def serve(self, name: str, kind: ServiceType, requested: OnRequest) -> Ros2ServiceServer:
        """Offer a service; raise ``UsageError`` if another node does."""
        for service in self._library.services():
            if service.name == name:
                raise UsageError(f"node {self.name}: service {name} is served by {service.server} already")
        return Ros2ServiceServer(self._node, name, kind, requested)

    def client(self, name: str, kind: ServiceType) -> Ros2ServiceClient:
        """Return a client of a service."""
        return Ros2ServiceClient(self._node, name, kind)

    def has_service(self, name: str) -> bool:
        """Return whether a server has been discovered."""
        return bool(self._node.count_services(name))

    def _parameters(self, name: str) -> tuple[OwnParameters | OtherParameters, str]:
        node, rest = owner(name, self.name, self._library.node_names())
        return (OwnParameters(self._node) if node == self.name else OtherParameters(self._node, node)), rest

    def get_parameter(self, name: str) -> Any:
        """Access a parameter of this node, or of the node whose name begins the parameter's."""
        of, rest = self._parameters(name)
        return of.get(rest)

    def set_parameter(self, name: str, value: Any) -> None:
        """Access a parameter of this node, or of the node whose name begins the parameter's."""
        try:
            of, rest = self._parameters(name)
        except KeyError:
            raise UsageError(
                f"parameter {name}: in ROS 2 parameters belong to nodes, and no node's name begins it; "
                f"name one of your own with '~'"
            ) from None
        of.set(rest, value)

    def delete_parameter(self, name: str) -> None:
        """Remove a parameter of this node."""
        of, rest = self._parameters(name)
        of.delete(rest)

    def prepare_close(self) -> None:
        """Do nothing: rclpy needs no preparation."""

    def close(self) -> None:
        """Leave the graph."""
        self._library.remove(self._node)


class Ros2Library:
    """See ``volery.ros.transports.client_library.ClientLibrary``."""

    def __init__(self, domain: int | None) -> None:
        if not available():
            raise UsageError(_MISSING)
        self._rclpy: Any = import_module("rclpy")
        self._context = import_module("rclpy.context").Context()
        no_signals = import_module("rclpy.signals").SignalHandlerOptions.NO
        self._rclpy.init(args=[], context=self._context, domain_id=domain, signal_handler_options=no_signals)
        self._executor = import_module("rclpy.executors").SingleThreadedExecutor(context=self._context)
        self._over = threading.Event()
        self._left: set[str] = set()
        self._warned: set[str] = set()
        self.say: Callable[[str], None] = lambda text: None
        self._own = self._create(
            f"{HIDDEN}_{os.getpid()}", "/", enable_rosout=False, start_parameter_services=False
        )
        self._began = time.monotonic()
        self._discovered = False
        self._thread = threading.Thread(target=self._spin, name="rclpy", daemon=True)
        self._thread.start()

    def _create(self, name: str, namespace: str, **options: Any) -> Any:
        return self._rclpy.create_node(
            name,
            namespace=namespace,
            context=self._context,
            use_global_arguments=False,
            allow_undeclared_parameters=True,
            **options,
        )

    def _spin(self) -> None:
        looked = time.monotonic()
        gone = import_module("rclpy.exceptions").InvalidHandle  # of a part that was closed meanwhile
        while not self._over.is_set():
            try:
                if time.monotonic() - looked > WATCH_S:
                    looked = time.monotonic()
                    self._warn_of_types()
                self._executor.spin_once(timeout_sec=0.5)
            except (NoAnswerError, gone):
                pass
            except Exception as error:  # rclpy raises what went wrong anywhere in it; the others go on
                if not self._over.is_set():
                    self.say(f"rclpy: {type(error).__name__}: {error}")
        self._shut_down()

    def _endpoints(self, topic: str) -> list[Any]:
        """Return rclpy's descriptions of the publishers and subscriptions of a topic."""
        own = self._own
        return [*own.get_publishers_info_by_topic(topic), *own.get_subscriptions_info_by_topic(topic)]

    def _warn_of_types(self) -> None:
        """Warn once of each topic with several types, whose endpoints DDS silently leaves unconnected."""
        for name, kinds in self._own.get_topic_names_and_types():
            if len(kinds) > 1 and name not in self._warned:
                ends = self._endpoints(name)
                if any(end.node_name == NOT_KNOWN_YET for end in ends):
                    continue  # the next look has the node's name
                self._warned.add(name)
                by_type = {kind: _users([end for end in ends if end.topic_type == kind]) for kind in kinds}
                listed = "; ".join(f"{kind} of {', '.join(who)}" for kind, who in sorted(by_type.items()))
                self.say(
                    f"{name} carries several types; nodes of different types are not connected: {listed}"
                )

    def join(self, name: str, namespace: str, lost: Callable[[str], None]) -> Ros2Node:
        """Create a node; raise ``UsageError`` if its name is taken."""
        full = full_node_name(name, namespace)
        if self._is_taken(full):
            raise NameTakenError(
                f"a node named {full} is there already; choose another name or namespace for this one"
            )
        return Ros2Node(self, name, namespace)

    def _is_taken(self, full: str) -> bool:
        """Return whether a node name is taken; a node that has just left stays visible for a moment."""
        end = time.monotonic() + DISCOVERY_S
        while full in self.node_names():
            if full not in self._left or time.monotonic() > end:
                return True
            time.sleep(POLL_S)
        return False

    def make(self, name: str, namespace: str) -> Any:
        """Create a node of rclpy and spin it."""
        node = self._create(name, namespace)
        self._executor.add_node(node)
        return node

    def remove(self, node: Any) -> None:
        """Remove a node from the graph."""
        self._left.add(join_names(node.get_namespace(), node.get_name()))

        def leave() -> None:
            with suppress(Exception):  # the node is not used any more either way
                self._executor.remove_node(node)
                node.destroy_node()

        # Only the thread that waits for a node's parts destroys them: beside that wait rclpy's destroy_node
        # can hold the interpreter's lock for ever.
        if threading.current_thread() is self._thread:
            leave()
        else:
            left = threading.Event()
            self._executor.create_task(leave).add_done_callback(lambda task: left.set())
            left.wait(GOODBYE_S)

    def _wait_for_discovery(self) -> None:
        """Wait until the nodes that exist at the start of this process have been discovered.

        An endpoint can be known before its node: then the wait goes on until the limit.
        """
        if self._discovered:
            return
        time.sleep(max(0.0, self._began + DISCOVERY_S - time.monotonic()))
        while time.monotonic() < self._began + DISCOVERY_LIMIT_S and any(
            endpoint.node_name == NOT_KNOWN_YET
            for topic, _ in self._own.get_topic_names_and_types()
            for endpoint in self._endpoints(topic)
        ):
            time.sleep(POLL_S)
        self._discovered = True

    def node_names(self) -> list[str]:
        """Return the discovered nodes, sorted."""
        self._wait_for_discovery()
        known = self._own.get_node_names_and_namespaces()
        return sorted({join_names(space, name) for name, space in known if not name.startswith(HIDDEN)})

    def topics(self) -> list[TopicState]:
        """Return what has been discovered, by name."""
        self._wait_for_discovery()
        found = []
        for name, kinds in sorted(self._own.get_topic_names_and_types()):
            publishers = _users(self._own.get_publishers_info_by_topic(name))
            subscribers = _users(self._own.get_subscriptions_info_by_topic(name))
            if publishers or subscribers:
                found.append(TopicState(name, kinds[0], publishers, subscribers))
        return found

    def offered(self, topic: str) -> tuple[QoS, ...]:
        """Return what the discovered publishers of a topic offer."""
        return tuple(offered_qos(one.qos_profile) for one in self._own.get_publishers_info_by_topic(topic))

    def services(self) -> list[ServiceState]:
        """Return what has been discovered, by name."""
        self._wait_for_discovery()
        servers: dict[str, tuple[str, str]] = {}
        for name, space in self._own.get_node_names_and_namespaces():
            if name.startswith(HIDDEN):
                continue
            with suppress(Exception):  # a node that has just left
                for service, kinds in self._own.get_service_names_and_types_by_node(name, space):
                    servers[service] = (kinds[0], join_names(space, name))
        return [ServiceState(name, kind, server) for name, (kind, server) in sorted(servers.items())]

    def announce_clock(self) -> None:
        """Do nothing: in ROS 2 each node has a parameter of its own."""

    def close(self) -> None:
        """Stop spinning and shut rclpy down."""
        self._over.set()
        self._executor.create_task(lambda: None)  # a wake alone does not end a wait
        self._thread.join(GOODBYE_S)

    def _shut_down(self) -> None:
        """Destroy the transport's own node; errors are dropped, since nothing is used any more."""
        with suppress(Exception):
            self._own.destroy_node()
        with suppress(Exception):
            self._executor.shutdown(timeout_sec=0)
        with suppress(Exception):
            self._rclpy.shutdown(context=self._context)


def _users(ends: list[Any]) -> tuple[str, ...]:
    users = {
        join_names(end.node_namespace, end.node_name) for end in ends if not end.node_name.startswith(HIDDEN)
    }
    return tuple(sorted(users))


def ros2_graph(
    kernel: Kernel,
    *,
    domain: int | None = None,
    records: Records = record_short,
    epoch: Ns | None = None,
) -> TransportGraph:
    """Return the graph of the ROS 2 nodes in a domain.

    Args:
        kernel: Clock and tasks of the nodes.
        domain: DDS domain; None for ``ROS_DOMAIN_ID``.
        records: What is recorded of each topic; here of long messages the content as well.
        epoch: ROS time at the kernel's zero, ns; by default the Unix time then.

    Raises:
        UsageError: this Python finds no rclpy.
    """
    library = Ros2Library(domain)
    graph = TransportGraph(kernel, library, records=records, epoch=epoch)
    library.say = graph.warn
    return graph
