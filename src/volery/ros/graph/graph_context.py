"""State shared by the parts of one embedded graph, and the node as its publishers and services use it.

`GraphContext` holds the kernel, the prices, the routes and the registered topics and services. `NodeContext`
charges the calls of one node. Publishers and services stand here as narrow protocols, so that the modules
that implement them import this one and not each other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Protocol

from volery.base.errors import UsageError, did_you_mean
from volery.base.time import MS, US, Ns, S
from volery.base.warmth import COLD, Warmth
from volery.kernel.api import Action, Kernel
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import Signal
from volery.ros.graph.interface import NodeId, QoS, Routing, Tariffs
from volery.ros.graph.unserved import Want, Wants
from volery.ros.messages import RosMessage, cdr_size, from_cdr, to_cdr
from volery.trace.events import Charge, Event


class Recorded(IntEnum):
    """What is recorded of a topic's messages: of ``SHORT`` a long one is an event without its content."""

    NOTHING = 0
    SHORT = 1
    ALL = 2


Records = Callable[[str], Recorded]
"""What is recorded of a topic's messages, by the topic's name."""


class PublisherEnd(Protocol):
    """A publisher as the graph keeps it."""

    node: NodeContext
    qos: QoS
    latest: Ns | None
    """When its last message was sent, or its liveliness asserted."""

    def connect(self, subscription: SubscriptionEnd) -> None:
        """Connect a subscription and deliver latched (transient-local) messages."""

    def disconnect(self, subscription: SubscriptionEnd) -> None:
        """Stop sending to a subscription."""


class SubscriptionEnd(Protocol):
    """A subscription as the graph keeps it."""

    node: NodeContext
    qos: QoS
    want: Want

    def arrive(self, message: Any, sent: Ns, publisher: str, size: int) -> None:
        """Queue a message that has arrived. A framework callback."""

    def lose(self, sent: Ns, publisher: str, size: int) -> None:
        """Record that a message was lost. A framework callback."""


class ServiceEnd(Protocol):
    """A service as the graph keeps it."""

    node: NodeContext
    type: str

    def arrive(self, exchange: Any) -> None:
        """Queue a request that has arrived. A framework callback."""


class Topic:
    """A name at which publishers and subscriptions of one type meet; ``others`` has its other types."""

    __slots__ = ("name", "others", "publishers", "subscriptions", "type")

    def __init__(self, name: str, kind: str) -> None:
        self.name, self.type = name, kind
        self.publishers: list[PublisherEnd] = []
        self.subscriptions: list[SubscriptionEnd] = []
        self.others: dict[str, Topic] = {}


class ParameterTree:
    """Parameter values by absolute name; a namespace reads as a ``dict`` of what is below it."""

    def __init__(self) -> None:
        self._tree: dict[str, Any] = {}

    @staticmethod
    def _steps(name: str) -> list[str]:
        return [step for step in name.split("/") if step]

    def has(self, name: str) -> bool:
        """Return whether there is such a parameter or namespace."""
        try:
            self.get(name)
        except UsageError:
            return False
        return True

    def get(self, name: str) -> Any:
        """Return a copy of the value; raise ``UsageError`` if there is none."""
        value: Any = self._tree
        for step in self._steps(name):
            if not isinstance(value, dict) or step not in value:
                hint = did_you_mean(name, self.names())
                raise UsageError(f"no parameter {name!r}{hint}")
            value = value[step]
        return deepcopy(value)

    def set(self, name: str, value: Any) -> None:
        """Set a value; a ``dict`` replaces a whole namespace."""
        *path, last = self._steps(name) or [""]
        if not last:
            raise UsageError("the root of the parameters cannot be set; name a parameter")
        branch = self._tree
        for step in path:
            inner = branch.get(step)
            if not isinstance(inner, dict):
                inner = branch[step] = {}
            branch = inner
        branch[last] = deepcopy(value)

    def delete(self, name: str) -> None:
        """Remove a value or a namespace; raise ``UsageError`` if there is none."""
        self.get(name)
        *path, last = self._steps(name)
        branch = self._tree
        for step in path:
            branch = branch[step]
        del branch[last]

    def names(self) -> list[str]:
        """Return the absolute names of all parameters, sorted."""
        found: list[str] = []
        branches = [("", self._tree)]
        while branches:
            prefix, branch = branches.pop()
            for step, value in branch.items():
                if isinstance(value, dict):
                    branches.append((f"{prefix}/{step}", value))
                else:
                    found.append(f"{prefix}/{step}")
        return sorted(found)


@dataclass(eq=False)
class GraphContext:
    """One graph as its nodes see it.

    Attributes:
        tariffs: Prices of each node's calls.
        route: Path of messages from node to node.
        records: What is recorded of each topic.
        epoch: ROS time at the kernel's zero, ns.
        changed: Notified whenever a node, publisher, subscription or service joins or leaves.
        listen_to_clock: Called for each subscription to ``/clock``.
        unrecorded: No event of the graph is recorded.
        as_bytes: Messages are encoded and decoded, as by a transport.
        size_of: Size of a message for its route, bytes.
        wants: What its nodes offer and ask for.
    """

    kernel: Kernel
    tariffs: Tariffs
    route: Routing
    records: Records
    epoch: Ns
    changed: Signal
    listen_to_clock: Callable[[], None] = lambda: None
    parameters: ParameterTree = field(default_factory=ParameterTree)
    topics: dict[str, Topic] = field(default_factory=dict)
    services: dict[str, ServiceEnd] = field(default_factory=dict)
    unrecorded: bool = False
    as_bytes: bool = False
    size_of: Callable[[RosMessage], int] = cdr_size
    wants: Wants = field(default_factory=Wants)

    def record(self, event: Event) -> None:
        """Record an event of the graph."""
        if not self.unrecorded:
            self.kernel.record(event)

    def copy(self, message: RosMessage) -> Any:
        """Return a copy of `message` as its receivers get it."""
        return from_cdr(message.__msgtype__, to_cdr(message)) if self.as_bytes else message.copy()

    def carry(
        self, sender: NodeContext, receiver: NodeContext, size: int, deliver: Action, lost: Action
    ) -> None:
        """Transfer a request or an answer of `size` bytes between two nodes, reliably."""
        route = self.route(sender.id, receiver.id)
        if route is None:
            deliver()
        else:
            route(size, True, deliver, lost)

    def stamp(self) -> Ns:
        """Return ROS time, ns, without being an interaction point."""
        return self.epoch + self.kernel.now()


WAIT_PERIOD: Ns = S
"""Period at which a node is charged for the time in which it neither sleeps nor calls."""

WARM: Ns = MS
"""Time after sending or receiving during which a node's threads and caches are still warm."""

REST: Ns = 32 * MS
"""Rest after which a node's caches are cold: halfway between the cycles of calibrations, 20 and 50 ms."""

_KINDS = {call: f"ros:{call}" for call in ("publish", "sleep", "spin_once")}
"""Texts of the most frequent charges, made once."""


class NodeContext:
    """A node as its publishers, subscriptions and services use it: their owner, which is charged."""

    __slots__ = (
        "_free", "_last_traffic", "_rest", "_since", "_slept", "_tariff", "_waited",
        "closed", "context", "graph", "id", "kernel", "name", "processor",
    )  # fmt: skip

    def __init__(self, graph: GraphContext, name: str, context: ExecutionContext) -> None:
        self.graph, self.kernel = graph, graph.kernel
        self.name, self.context, self.processor = name, context, context.processor
        self.id = NodeId(name, context.component, self.processor.name if self.processor else "")
        self.closed = False
        self._tariff = graph.tariffs(self.id)
        self._free = graph.unrecorded and self.processor is None  # neither executed nor recorded
        self._since = self.kernel.now()
        self._last_traffic: Ns = -REST
        self._rest: Ns = REST
        self._slept = self._waited = 0.0

    def consume(self, call: str, x: float = 0.0) -> Ns:
        """Execute a call into ROS: the caller's part before this returns, the rest in the background.

        A framework callback cannot wait: there all of the call goes to the background.

        Args:
            call: Name of the call, see ``Tariff``.
            x: What its price depends on, see ``Tariff``.

        Returns:
            Time at which the caller's part has been executed, ns.
        """
        kernel = self.kernel
        now = kernel.now()
        if self._free:
            return now
        warmth = COLD
        if call == "sleep":
            self._slept += x
        elif call == "publish":
            warmth = self._warmth(now)
        caller = background = 0
        if self._tariff is not None:
            cost = self._tariff(call, x, warmth)
            caller, background = cost.caller, cost.background
        if not self.graph.unrecorded:
            kind = _KINDS.get(call) or f"ros:{call}"
            kernel.record(Charge(now, self.id.component, self.id.processor, kind, caller, background, 0.0))
        return self._execute(now, caller, background)

    def consume_publications(self, subscribers: Sequence[int]) -> Ns:
        """Execute one call of ``publish`` for each entry, as one batch with the sum of their prices.

        Args:
            subscribers: Number of connections of each publisher.

        Returns:
            Time at which the callers' parts have been executed, ns.
        """
        kernel, tariff = self.kernel, self._tariff
        now = at = kernel.now()
        if self._free or not subscribers:
            return now
        caller = background = 0
        for connections in subscribers:
            warmth = self._warmth(at)
            if tariff is not None:
                cost = tariff("publish", float(connections), warmth)
                caller += cost.caller
                background += cost.background
                at += cost.caller
        if not self.graph.unrecorded:
            kind = f"ros:publish*{len(subscribers)}" if len(subscribers) > 1 else "ros:publish"
            kernel.record(Charge(now, self.id.component, self.id.processor, kind, caller, background, 0.0))
        return self._execute(now, caller, background)

    def _warmth(self, at: Ns) -> Warmth:
        """Return how warm the node is when it sends or receives at `at`, ns; it is warmer after it."""
        rest = at - self._last_traffic
        self._last_traffic = at
        if rest >= WARM:
            self._rest = rest
        return Warmth(follows=rest < WARM, often=self._rest < REST)

    def _execute(self, now: Ns, caller: Ns, background: Ns) -> Ns:
        """Execute what has been charged at *now*; return the time at which the caller's part has been."""
        if caller:
            if self.kernel.consume(caller):
                now = self.kernel.now()
            else:
                background += caller
        if background and self.processor is not None:
            self.processor.load(self.context, background)
        return now

    def consume_if_priced(self, call: str) -> None:
        """Execute a call as ``consume`` does, if the law has a figure for it."""
        if self._tariff is not None:
            cost = self._tariff(call, 0.0, COLD)
            if cost.caller or cost.background:
                self.consume(call)

    def charge_background(self, what: str, x: float = 0.0) -> None:
        """Execute in the background a cost beside the calls; see ``Tariff`` for `what` and `x`."""
        processor = self.processor
        if processor is None or self._tariff is None:
            return
        cost = self._tariff(what, x, self._warmth(self.kernel.now()) if what == "receive" else COLD)
        background = cost.caller + cost.background
        if not background:
            return
        if not self.graph.unrecorded:
            now, (_, component, name) = self.kernel.now(), self.id
            self.kernel.record(Charge(now, component, name, f"ros:{what}", 0, background, 0.0))
        processor.load(self.context, background)

    def start_charging_waits(self) -> None:
        """Charge the client library's threads while the node does not sleep; a sleep's price has them."""
        if (
            self.processor is not None
            and self._tariff is not None
            and self._tariff("wait", WAIT_PERIOD / US, COLD).background
        ):
            self.kernel.every(WAIT_PERIOD, self._charge_wait)

    def _charge_wait(self) -> None:
        if self.closed:
            return
        lived = (self.kernel.now() - self._since) / US
        waited = lived - self._slept - self._waited
        if waited > 0.0:
            self._waited += waited
            self.charge_background("wait", waited)

    def want(self, kind: str, name: str, type_name: str) -> Want:
        """Return what the graph keeps of this use of a name by the node's component."""
        return self.graph.wants.of(kind, name, type_name, (self.id.component, self.name), self.kernel.now())

    def check_open(self) -> None:
        """Raise ``UsageError`` if the node has left the graph."""
        if self.closed:
            raise UsageError(f"node {self.name} has left the graph")
