"""The interface of ROS nodes and graphs, implemented by the embedded graph and by the transports to real ROS.

Times are ``int`` nanoseconds. Message and service types are named (``std_msgs/msg/String`` or
``std_msgs/String``). A call blocks its task only for its own computing, unless its docstring says otherwise.

The rules of names are those that ROS 1 and ROS 2 share: tokens of letters, digits and underscores that do not
begin with a digit, joined by single slashes; ``/a`` is absolute, ``a`` relative to the namespace, ``~a``
private to the node. See http://wiki.ros.org/Names and https://design.ros2.org/articles/topic_and_service_names.html.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from volery.base.errors import UsageError, choices
from volery.base.time import MS, Ns
from volery.base.warmth import Warmth
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext
from volery.ros.graph.work import Work

CLOCK = "/clock"
CLOCK_TYPE = "rosgraph_msgs/msg/Clock"
CLOCK_PERIOD: Ns = 10 * MS

RELIABLE, BEST_EFFORT, BEST_AVAILABLE = "reliable", "best_effort", "best_available"
VOLATILE, TRANSIENT_LOCAL = "volatile", "transient_local"
_RELIABILITY = (RELIABLE, BEST_EFFORT, BEST_AVAILABLE)
_DURABILITY = (VOLATILE, TRANSIENT_LOCAL, BEST_AVAILABLE)


@dataclass(frozen=True)
class QoS:
    """Quality of service in the terms of ROS 2, of which ROS 1 is a special case.

    A ROS 1 subscriber is ``best_available``: it takes what is offered. A latched ROS 1 publisher is
    ``transient_local`` with depth 1.

    Attributes:
        depth: Messages kept, the oldest is dropped; None for no bound. A publisher keeps them for late
            subscribers, a subscription until its callback has run.
        reliability: ``reliable``, ``best_effort`` or ``best_available``.
        durability: ``volatile``, ``transient_local`` or ``best_available``.
        spacing: A subscription uses no more than one message in this time, ns. Nodes of ROS send all; a graph
            that takes the place of a link leaves the others out (``Publisher.awaited_from``).
        deadline: Longest time between two messages, ns, offered or wanted; 0 without.
        lifespan: A publisher's messages are not given to late subscribers after this time, ns; 0 without.
        lease: Time after which a publisher that has not asserted its liveliness is not alive, ns; 0 without.
        manual: Whether a publisher asserts its liveliness itself, by messages too, or its process does.
    """

    depth: int | None = 10
    reliability: str = RELIABLE
    durability: str = VOLATILE
    spacing: Ns = 0
    deadline: Ns = 0
    lifespan: Ns = 0
    lease: Ns = 0
    manual: bool = False

    def __post_init__(self) -> None:
        if self.reliability not in _RELIABILITY:
            raise UsageError(f"QoS reliability {self.reliability!r}: choose {choices(_RELIABILITY)}")
        if self.durability not in _DURABILITY:
            raise UsageError(f"QoS durability {self.durability!r}: choose {choices(_DURABILITY)}")
        if self.depth is not None and self.depth < 1:
            raise UsageError(f"QoS depth {self.depth}: at least 1, or None for no bound")


DEFAULT = QoS()
AS_OFFERED = QoS(reliability=BEST_AVAILABLE, durability=BEST_AVAILABLE)
"""Default of a subscription: what the publisher offers, as in ROS 1."""
SENSOR_DATA = QoS(depth=5, reliability=BEST_EFFORT)
LATCHED = QoS(depth=1, durability=TRANSIENT_LOCAL)


class NodeId(NamedTuple):
    """A caller: the node's full name, the component whose code it is, and its processor ('' for none)."""

    name: str
    component: str
    processor: str


class CallTime(Protocol):
    """Execution time of a call on the node's processor, ns."""

    @property
    def caller(self) -> Ns:
        """Executed by the calling task before the call takes effect, ns."""

    @property
    def background(self) -> Ns:
        """Executed by the process in the background, ns."""


Tariff = Callable[[str, float, Warmth], CallTime]
"""``tariff(call, x, warmth)``: the cost of one call of a node. The calls are ``init``, ``node_handle``,
``advertise``, ``subscribe``, ``advertise_service``, ``service_client``, ``publish`` (x = subscribers of the
topic), ``sleep`` (x = microseconds slept) and ``spin_once`` (x = 1 for the first of a group, 0 after it).
Costs beside the calls are ``receive`` (a message arrives), ``connect`` (a subscription is connected to a
publisher), ``accept`` (a publisher to a subscription) and ``wait`` (x = microseconds without sleep).
The warmth is that of a node that publishes or receives: it follows less than a millisecond after another of
its messages, and happens often where the node rested for less than 32 ms before."""

Tariffs = Callable[[NodeId], Tariff | None]
"""``tariffs(node)``: the tariff of a node, requested once when it joins; None where calls take no time."""


def free(node: NodeId) -> Tariff | None:
    """Return no tariff: calls take no time."""
    return None


Route = Callable[[int, bool, Callable[[], None], Callable[[], None]], None]
"""``route(size, reliable, deliver, lost)``: transfer `size` bytes, then call `deliver`, or `lost` if they did
not arrive. Never blocks, and calls neither before it has returned."""

Routing = Callable[[NodeId, NodeId], Route | None]
"""``routing(sender, receiver)``: the route from node to node, requested once per connection; None where no
network is between them and messages arrive at once."""


def no_route(sender: NodeId, receiver: NodeId) -> Route | None:
    """Return no route: messages arrive at once."""
    return None


INVALID_VALUES = (ValueError, OverflowError, UsageError)
"""Errors that invalid numbers in a message cause."""

Callback = Callable[[Any], None]
Handler = Callable[[Any], Any]


class Publisher(Protocol):
    """Sends messages of one type to one topic."""

    topic: str
    type: str

    def publish(self, message: Any) -> None:
        """Send a copy of `message` as it is now; raise ``UsageError`` if it has another type."""

    def subscribers(self) -> int:
        """Return the number of subscriptions it is connected to."""

    def awaited_from(self) -> Ns:
        """Return the time, ns, before which no subscription would use a message; 0 where each is used."""

    def close(self) -> None:
        """Stop publishing."""


class Subscription(Protocol):
    """Receives the messages of a topic; its callback runs when its group is spun."""

    topic: str
    type: str
    dropped: int
    """Number of messages that a full queue has dropped."""

    def latest_sender(self) -> tuple[str, bool]:
        """Return who sent the message whose callback runs and whether it latches, where ROS 1 states it."""

    def publishers(self) -> int:
        """Return the number of publishers it is connected to."""

    def close(self) -> None:
        """Stop receiving and drop the waiting messages."""


class Service(Protocol):
    """Answers requests; its handler runs when its group is spun."""

    name: str
    type: str

    def close(self) -> None:
        """Stop serving."""


class Client(Protocol):
    """Calls a service."""

    name: str
    type: str

    def call(self, request: Any, within: Ns | None = None) -> Any:
        """Block until the answer has arrived.

        Args:
            request: Message of the service's request type.
            within: Longest wait, ns; None for no limit.

        Raises:
            ServiceError: no node serves it, the handler raised, or `within` has passed.
        """

    def wait(self, within: Ns | None = None) -> bool:
        """Block until a node serves it; return False if `within` ns have passed first."""

    def ready(self) -> bool:
        """Return whether a node serves it now."""


class Timer(Protocol):
    """Calls back every period; the callback runs when its group is spun."""

    def cancel(self) -> None:
        """Stop the timer."""


class LoopRate(Protocol):
    """Keeps a loop at a period."""

    def sleep(self) -> None:
        """Block until one period after the last release; return at once if that has passed."""

    def remaining(self) -> Ns:
        """Return the time until the next release, ns; 0 for a late loop."""


class ReadyCallbacks(Protocol):
    """A queue of callbacks that are ready; the task that spins it runs them one after the other."""

    def spin_once(self, within: Ns | None = None) -> bool:
        """Run the next callback; return False if there was none. Its exceptions are raised here.

        Args:
            within: Longest wait for a callback, ns; None for no limit, 0 to poll.
        """

    def spin_available(self) -> None:
        """Run all callbacks that are ready now, as one poll: roscpp's ``spinOnce``."""

    def spin(self) -> None:
        """Run callbacks as they become ready until the node is closed."""

    def __len__(self) -> int:
        """Return the number of callbacks that are ready."""

    on_ready: Callable[[], None] | None
    """Called whenever a callback has become ready, for executors that wait for several groups and ``take``
    from them. It must not block."""

    @property
    def oldest(self) -> Ns | None:
        """Time at which the next callback became ready, ns; None if none is."""

    def take(self) -> Work:
        """Remove and return the next callback, which the caller runs; ``IndexError`` if none is ready."""

    def add(self, work: Work) -> None:
        """Add a callback that has become ready. A framework callback."""


class Node(Protocol):
    """A node of a graph, until ``close``."""

    name: str
    namespace: str

    @property
    def context(self) -> ExecutionContext:
        """Context that its computing is charged to."""

    @property
    def closed(self) -> bool:
        """Whether it has left the graph."""

    @property
    def own_group(self) -> ReadyCallbacks:
        """Group of the callbacks that are given none."""

    def resolve(self, name: str) -> str:
        """Return the absolute name, remappings applied; ``UsageError`` if it is no valid ROS name."""

    def group(self, start: Callable[[Work], None] | None = None) -> ReadyCallbacks:
        """Return a new group, for callbacks that run concurrently with those of the node's own group.

        Args:
            start: Called at once, as a framework callback, with each callback that becomes ready.
        """

    def advertise(self, topic: str, message_type: str, qos: QoS = DEFAULT) -> Publisher:
        """Publish to a topic."""

    def publish_all(
        self, messages: Sequence[tuple[Publisher, Any]], refused: Callable[[int, Exception], None]
    ) -> None:
        """Send messages made for this call, each by a publisher of this node.

        Where calls are priced, their prices are added up and executed at once, and all messages leave then:
        the order in time inside the batch is lost, the sum is not.

        Args:
            messages: Publishers and messages. The messages must not be changed afterwards.
            refused: Called with the index of a message that cannot be encoded, and why.
        """

    def subscribe(
        self,
        topic: str,
        message_type: str,
        callback: Callback,
        qos: QoS = AS_OFFERED,
        group: ReadyCallbacks | None = None,
    ) -> Subscription:
        """Call `callback` with each message of a topic, in `group` or else the node's own group."""

    def serve(
        self, name: str, service_type: str, handler: Handler, group: ReadyCallbacks | None = None
    ) -> Service:
        """Answer requests: `handler` gets the request and returns the response."""

    def client(self, name: str, service_type: str) -> Client:
        """Return a client of a service, which need not be served yet."""

    def wait_for_service(self, name: str, within: Ns | None = None) -> bool:
        """Block until a node serves `name`; return False if `within` ns have passed first."""

    def timer(self, period: Ns, callback: Callable[[], None], group: ReadyCallbacks | None = None) -> Timer:
        """Call back every `period` ns, for the first time after one period."""

    def rate(self, period: Ns) -> LoopRate:
        """Return what keeps the loop of the current task at `period` ns."""

    def sleep(self, duration: Ns) -> None:
        """Block the current task for `duration` ns."""

    def now(self) -> Ns:
        """Return ROS time: ns since the epoch of the graph's clock. An interaction point."""

    def spin_once(self, within: Ns | None = None) -> bool:
        """``spin_once`` of the node's own group."""

    def spin_available(self) -> None:
        """``spin_available`` of the node's own group."""

    def spin(self) -> None:
        """``spin`` of the node's own group."""

    def get_parameter(self, name: str, default: Any = ...) -> Any:
        """Return a parameter's value, a ``dict`` for a namespace.

        Raises:
            UsageError: there is no such parameter, and no `default`.
        """

    def set_parameter(self, name: str, value: Any) -> None:
        """Set a parameter, or a whole namespace to a ``dict``."""

    def has_parameter(self, name: str) -> bool:
        """Return whether there is such a parameter or namespace."""

    def delete_parameter(self, name: str) -> None:
        """Remove a parameter or a namespace; raise ``UsageError`` if there is none."""

    def close(self) -> None:
        """Leave the graph with everything that the node has made; tasks that spin it return."""


class TopicState(NamedTuple):
    """A topic with the names of the nodes that publish and subscribe."""

    name: str
    type: str
    publishers: tuple[str, ...]
    subscribers: tuple[str, ...]


class ServiceState(NamedTuple):
    """A service with its type and the name of the node that serves it."""

    name: str
    type: str
    server: str


class RosGraph(Protocol):
    """A ROS graph as one process sees it: the embedded one, or a real one behind a transport."""

    kernel: Kernel

    @property
    def epoch(self) -> Ns:
        """ROS time at the kernel's zero, ns."""

    def node(
        self,
        name: str,
        namespace: str = "/",
        *,
        remaps: Mapping[str, str] | None = None,
        anonymous: bool = False,
        context: ExecutionContext | None = None,
    ) -> Node:
        """Join the graph.

        Args:
            name: Name without slashes.
            namespace: ``/`` or an absolute name.
            remaps: Names of topics, services and parameters, and what replaces them.
            anonymous: Append to the name what makes it unique.
            context: Context that the node's computing is charged to; the current task's by default.

        Raises:
            UsageError: the name is not valid or is taken.
        """

    def node_names(self) -> list[str]:
        """Return the names of all nodes, sorted."""

    def topics(self) -> list[TopicState]:
        """Return the topics that have a publisher or a subscription, by name."""

    def offered(self, topic: str) -> tuple[QoS, ...]:
        """Return what the publishers of a topic offer; nothing in ROS 1. An unknown depth is None."""

    def services(self) -> list[ServiceState]:
        """Return the services that have a server, by name."""

    def close(self) -> None:
        """Close all nodes made by it."""


_TOKEN = r"[A-Za-z_][A-Za-z0-9_]*"
_NAME = re.compile(rf"(?:~/?|/)?{_TOKEN}(?:/{_TOKEN})*\Z")
_NODE = re.compile(rf"{_TOKEN}\Z")
_NAMESPACE = re.compile(rf"/|(?:/{_TOKEN})+\Z")
_PART = "letters, digits and underscores, not beginning with a digit"
_RULE = f"{_PART}, parts joined by single slashes"


def check_name(name: str, what: str = "name") -> None:
    """Raise ``UsageError`` if `name` is no valid ROS name."""
    if not _NAME.match(name):
        raise UsageError(
            f"{name!r} is no valid ROS {what}: {_RULE}; '/' before makes it absolute, '~' private"
        )


class NameTakenError(UsageError):
    """A node of that name is on the graph already."""


def full_node_name(name: str, namespace: str) -> str:
    """Return the full name of a node; ``UsageError`` if its name or its namespace is not valid."""
    if not _NODE.match(name) or "__" in name:
        raise UsageError(f"{name!r} is no valid ROS node name: {_PART}, without slashes")
    if not _NAMESPACE.fullmatch(namespace):
        raise UsageError(f"{namespace!r} is no valid ROS namespace: '/' or absolute, {_RULE}")
    return join_names(namespace, name)


def join_names(namespace: str, name: str) -> str:
    """Return `name` below `namespace`."""
    return f"{namespace.rstrip('/')}/{name}"


def absolute_name(name: str, namespace: str, node: str) -> str:
    """Return the absolute form of `name` as used by the node of full name `node` in `namespace`."""
    check_name(name)
    if name.startswith("/"):
        return name
    if name.startswith("~"):
        return join_names(node, name[1:].lstrip("/"))
    return join_names(namespace, name)


def absolute_remaps(remaps: Mapping[str, str], namespace: str, node: str) -> dict[str, str]:
    """Return remappings with both sides absolute."""
    return {
        absolute_name(old, namespace, node): absolute_name(new, namespace, node)
        for old, new in remaps.items()
    }
