"""What a ROS node can do: the one interface of the embedded graph and of real ROS behind a transport.

Times are ``int`` nanoseconds. Message and service types go by name (``std_msgs/msg/String`` or
``std_msgs/String``). Names follow ROS: absolute (``/a/b``), relative to the node's namespace (``a/b``) or
private to it (``~a``). Calls block their own flow of control for as long as the call itself computes, and no
longer, unless it is said.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from volery.base.errors import UsageError, choices
from volery.base.time import MS, Ns
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext

CLOCK = "/clock"
CLOCK_TYPE = "rosgraph_msgs/msg/Clock"
CLOCK_PERIOD: Ns = 10 * MS

RELIABLE, BEST_EFFORT, BEST_AVAILABLE = "reliable", "best_effort", "best_available"
VOLATILE, TRANSIENT_LOCAL = "volatile", "transient_local"
_RELIABILITY = (RELIABLE, BEST_EFFORT, BEST_AVAILABLE)
_DURABILITY = (VOLATILE, TRANSIENT_LOCAL, BEST_AVAILABLE)


@dataclass(frozen=True, slots=True)
class QoS:
    """Quality of service, in the words of ROS 2. ROS 1 is a special case of it.

    ``depth``: messages kept (a publisher's for those who come late, a subscription's until its callback ran;
    the oldest is dropped), ``None`` for no bound. ``best_available`` on the subscribing side takes what is
    offered: that is how a ROS 1 subscriber behaves, and a latched ROS 1 publisher is ``transient_local``
    with depth 1.
    """

    depth: int | None = 10
    reliability: str = RELIABLE
    durability: str = VOLATILE

    def __post_init__(self) -> None:
        if self.reliability not in _RELIABILITY:
            raise UsageError(f"QoS reliability {self.reliability!r}: choose {choices(_RELIABILITY)}")
        if self.durability not in _DURABILITY:
            raise UsageError(f"QoS durability {self.durability!r}: choose {choices(_DURABILITY)}")
        if self.depth is not None and self.depth < 1:
            raise UsageError(f"QoS depth {self.depth}: at least 1, or None for no bound")


DEFAULT = QoS()
AS_OFFERED = QoS(reliability=BEST_AVAILABLE, durability=BEST_AVAILABLE)
"""What a subscription wants unless it says otherwise: whatever the publisher offers, as in ROS 1."""
SENSOR_DATA = QoS(depth=5, reliability=BEST_EFFORT)
LATCHED = QoS(depth=1, durability=TRANSIENT_LOCAL)


class NodeId(NamedTuple):
    """Who calls: a node's full name, the component whose code it is, and its processor ('' for none)."""

    name: str
    component: str
    processor: str


class Cost(Protocol):
    """What a call takes on its processor, ns: by the caller before it goes on, and beside it."""

    @property
    def caller(self) -> Ns:
        """Paid by the calling task before the call has an effect."""

    @property
    def background(self) -> Ns:
        """Executed by the process beside the calling task."""


Price = Callable[[NodeId, str, float], Cost]
"""``price(node, call, x)``. The calls are ``init``, ``node_handle``, ``advertise``, ``subscribe``,
``advertise_service``, ``service_client``, ``publish`` (x = subscribers of the topic), ``publish_next`` (the
same where the node has sent or received something a moment ago), ``sleep`` (x = microseconds slept) and
``spin_once`` (x = 1 for the first of this node, 0 after it). Beside its calls a node meets ``receive`` (a
message arrives), ``connect`` (a subscription of it finds a publisher), ``accept`` (a publisher of it finds a
subscription) and ``wait`` (x = microseconds in which it did not sleep)."""


class _NoCost(NamedTuple):
    caller: Ns = 0
    background: Ns = 0


_NO_COST = _NoCost()


def free(node: NodeId, call: str, x: float) -> Cost:
    """A ``Price``: calls take nothing."""
    return _NO_COST


Route = Callable[[int, bool, Callable[[], None], Callable[[], None]], None]
"""``way(size, reliable, deliver, lost)``: bring *size* bytes along it, then call *deliver*, or *lost* where
they did not arrive. Never blocks and calls nothing before it has returned."""

Routing = Callable[[NodeId, NodeId], Route | None]
"""``between(sender, receiver)``: the way from node to node, asked once; ``None`` where nothing is between
them, so that what one sends is with the other at once."""


def no_route(sender: NodeId, receiver: NodeId) -> Route | None:
    """``Routing``: nothing is."""
    return None


Callback = Callable[[Any], None]
Handler = Callable[[Any], Any]


class Publisher(Protocol):
    """Sends messages of one type to one topic."""

    topic: str
    type: str

    def publish(self, message: Any) -> None:
        """Send a copy of *message* as it is now. ``UsageError`` if it is of another type."""

    def subscribers(self) -> int:
        """How many subscriptions it is connected to."""

    def close(self) -> None:
        """Advertise no longer."""


class Subscription(Protocol):
    """Receives the messages of a topic; its callback runs when its group spins."""

    topic: str
    type: str

    def publishers(self) -> int:
        """How many publishers it is connected to."""

    def close(self) -> None:
        """Receive no longer; what still waits is forgotten."""


class Service(Protocol):
    """Answers requests; its handler runs when its group spins."""

    name: str
    type: str

    def close(self) -> None:
        """Answer no longer."""


class Client(Protocol):
    """Calls a service."""

    name: str
    type: str

    def call(self, request: Any, within: Ns | None = None) -> Any:
        """Block until the answer is there.

        ``ServiceError`` if nobody serves it, the handler raised, or *within* has passed.
        """

    def wait(self, within: Ns | None = None) -> bool:
        """Block until somebody serves it; False if *within* has passed first."""

    def ready(self) -> bool:
        """Whether somebody serves it now."""


class Timer(Protocol):
    """Calls back each period; the callback runs when its group spins."""

    def cancel(self) -> None:
        """Call back no longer."""


class Rate(Protocol):
    """Keeps a loop at a period."""

    def sleep(self) -> None:
        """Block until one period after the last release.

        A late loop goes on at once and does not catch up.
        """

    def remaining(self) -> Ns:
        """How long until the next release; 0 for a late loop."""


class Work(NamedTuple):
    """A callback that is ready: since when, and what runs it (as user code)."""

    arrived: Ns
    run: Callable[[], None]


class Group(Protocol):
    """A queue of callbacks that are ready; who spins it runs them, one after the other."""

    def spin_once(self, within: Ns | None = None) -> bool:
        """Run the next callback, waiting for one up to *within* (``None``: for ever, 0: not at all).

        False if there was none. What the callback raises comes out here.
        """

    def spin_available(self) -> None:
        """Run all callbacks that are ready now, as one poll: roscpp's ``spinOnce``."""

    def spin(self) -> None:
        """Run callbacks as they come until the node is closed."""

    on_ready: Callable[[], None] | None
    """Called whenever a callback has become ready, for who waits for several groups at once and ``take``s
    what is there. It must not block."""

    @property
    def oldest(self) -> Ns | None:
        """Since when the next callback has been ready; ``None`` if none is."""

    def take(self) -> Work:
        """The next one: who takes it runs it. ``IndexError`` if none waits."""

    def add(self, work: Work) -> None:
        """A callback of somebody else's has become ready. House code."""


class Node(Protocol):
    """A member of the graph. Whoever makes one states its name; ``close`` takes it off the graph again."""

    name: str
    namespace: str

    @property
    def context(self) -> ExecutionContext:
        """Where its computing is spent."""

    @property
    def closed(self) -> bool:
        """Whether it has left the graph."""

    def resolve(self, name: str) -> str:
        """The absolute name, remappings applied. ``UsageError`` if it is no valid ROS name."""

    def group(self, start: Callable[[Work], None] | None = None) -> Group:
        """A new group, for callbacks that are to run beside those of the node's own group.

        With *start* its work waits for no spin: *start* is given it, as house code.
        """

    def advertise(self, topic: str, message_type: str, qos: QoS = DEFAULT) -> Publisher:
        """Publish to a topic."""

    def subscribe(
        self,
        topic: str,
        message_type: str,
        callback: Callback,
        qos: QoS = AS_OFFERED,
        group: Group | None = None,
    ) -> Subscription:
        """Call *callback* with each message of a topic, in *group* (the node's own if none is given)."""

    def serve(self, name: str, service_type: str, handler: Handler, group: Group | None = None) -> Service:
        """Answer requests: *handler* is given the request and returns the response."""

    def client(self, name: str, service_type: str) -> Client:
        """Call a service; it need not be there yet."""

    def wait_for_service(self, name: str, within: Ns | None = None) -> bool:
        """Block until somebody serves *name*; False if *within* has passed first."""

    def timer(self, period: Ns, callback: Callable[[], None], group: Group | None = None) -> Timer:
        """Call back each *period*, for the first time after one."""

    def rate(self, period: Ns) -> Rate:
        """Keep the loop of the current task at *period*."""

    def sleep(self, duration: Ns) -> None:
        """Block the current task for *duration*."""

    def now(self) -> Ns:
        """ROS time: nanoseconds since the epoch of the graph's clock. An interaction point."""

    def spin_once(self, within: Ns | None = None) -> bool:
        """``spin_once`` of the node's own group."""

    def spin_available(self) -> None:
        """``spin_available`` of the node's own group."""

    def spin(self) -> None:
        """``spin`` of the node's own group."""

    def get_parameter(self, name: str, default: Any = ...) -> Any:
        """A parameter's value, a ``dict`` for a namespace.

        *default* or a ``UsageError`` where there is none.
        """

    def set_parameter(self, name: str, value: Any) -> None:
        """Set a parameter, or a whole namespace with a ``dict``."""

    def has_parameter(self, name: str) -> bool:
        """Whether there is such a parameter or namespace."""

    def delete_parameter(self, name: str) -> None:
        """Remove a parameter or a namespace; a ``UsageError`` where there is none."""

    def close(self) -> None:
        """Leave the graph: everything this node has made is gone, who spins it returns."""


class TopicState(NamedTuple):
    """A topic as it is: who publishes and who subscribes, by the nodes' names."""

    name: str
    type: str
    publishers: tuple[str, ...]
    subscribers: tuple[str, ...]


class ServiceState(NamedTuple):
    """A service as it is: its type, and who serves it by the node's name."""

    name: str
    type: str
    server: str


class RosGraph(Protocol):
    """A ROS graph as one process sees it: embedded, or a real one behind a transport."""

    kernel: Kernel

    @property
    def epoch(self) -> Ns:
        """What ROS time is at the kernel's zero."""

    def node(
        self,
        name: str,
        namespace: str = "/",
        *,
        remaps: Mapping[str, str] | None = None,
        anonymous: bool = False,
        context: ExecutionContext | None = None,
    ) -> Node:
        """Join the graph as *name*. *anonymous* adds something to the name that makes it unique.

        *place* is where the node's computing is spent, that of the current task if it is not given.
        ``UsageError`` for an invalid name or one that is taken.
        """

    def node_names(self) -> list[str]:
        """Who is there, sorted."""

    def topics(self) -> list[TopicState]:
        """The topics that somebody publishes or subscribes to, by name."""

    def services(self) -> list[ServiceState]:
        """The services that somebody serves, by name."""

    def close(self) -> None:
        """All nodes made by it leave the graph."""
