"""``rclpy.event_handler``: what a publisher or a subscription finds out about its counterparts.

A helper task of the component waits for changes of the graph and for deadlines and leases, and queues the
callbacks on the node's executor. Events exist on the embedded graph only. As in DDS, a deadline counts from
the first message on; a lease of ``MANUAL_BY_TOPIC`` counts from the last message or assertion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from volery.base.errors import UsageError
from volery.base.time import MS, Ns
from volery.kernel.api import Kernel
from volery.ros.client_libraries.rclpy.qos import QoSPolicyKind
from volery.ros.graph import EmbeddedGraph, QoS, ReadyCallbacks, RosGraph, Work
from volery.ros.graph.endpoints import incompatible


class UnsupportedEventTypeError(RuntimeError):
    """An event that the middleware does not report."""


class QoSPublisherMatchedInfo(NamedTuple):
    """Number of matched subscriptions."""

    total_count: int
    total_count_change: int
    current_count: int
    current_count_change: int


class QoSSubscriptionMatchedInfo(NamedTuple):
    """Number of matched publishers."""

    total_count: int
    total_count_change: int
    current_count: int
    current_count_change: int


class QoSRequestedIncompatibleQoSInfo(NamedTuple):
    """Number of publishers that do not match, and the policy of the last one."""

    total_count: int
    total_count_change: int
    last_policy_kind: QoSPolicyKind


class QoSOfferedIncompatibleQoSInfo(NamedTuple):
    """Number of subscriptions that do not match, and the policy of the last one."""

    total_count: int
    total_count_change: int
    last_policy_kind: QoSPolicyKind


class _Counted(NamedTuple):
    total_count: int
    total_count_change: int


class QoSRequestedDeadlineMissedInfo(_Counted):
    """Number of periods without a message."""


class QoSOfferedDeadlineMissedInfo(_Counted):
    """Number of periods without a published message."""


class QoSMessageLostInfo(_Counted):
    """Number of messages that were lost."""


class QoSLivelinessLostInfo(_Counted):
    """Number of times that a publisher did not assert its liveliness in time."""


class IncompatibleTypeInfo(NamedTuple):
    """Number of counterparts of another type."""

    total_count_change: int


class QoSLivelinessChangedInfo(NamedTuple):
    """Number of publishers that are alive, and that no longer are."""

    alive_count: int
    not_alive_count: int
    alive_count_change: int
    not_alive_count_change: int


Handler = Callable[[Any], Any] | None


@dataclass
class SubscriptionEventCallbacks:
    """Callbacks of a subscription's events, each called with one of the infos."""

    deadline: Handler = field(default=None, kw_only=True)
    incompatible_qos: Handler = field(default=None, kw_only=True)
    liveliness: Handler = field(default=None, kw_only=True)
    message_lost: Handler = field(default=None, kw_only=True)
    incompatible_type: Handler = field(default=None, kw_only=True)
    matched: Handler = field(default=None, kw_only=True)
    use_default_callbacks: bool = field(default=True, kw_only=True)


@dataclass
class PublisherEventCallbacks:
    """Callbacks of a publisher's events, each called with one of the infos."""

    deadline: Handler = field(default=None, kw_only=True)
    liveliness: Handler = field(default=None, kw_only=True)
    incompatible_qos: Handler = field(default=None, kw_only=True)
    incompatible_type: Handler = field(default=None, kw_only=True)
    matched: Handler = field(default=None, kw_only=True)
    use_default_callbacks: bool = field(default=True, kw_only=True)


class TaskOwner(Protocol):
    """What starts tasks of a component: the context of rclpy, the session of rclcpp."""

    @property
    def kernel(self) -> Kernel:
        """The kernel of the run."""

    def spawn(self, body: Callable[[], None], label: str, /) -> object:
        """Run *body* in a task of its own."""


def watch(
    owner: TaskOwner,
    graph: RosGraph,
    watched: Any,
    callbacks: PublisherEventCallbacks | SubscriptionEventCallbacks,
    ready: ReadyCallbacks,
) -> None:
    """Call the callbacks of a publisher or a subscription from now on.

    Args:
        owner: Starts the task that watches.
        graph: The embedded graph; events of real ROS are refused.
        watched: Publisher or subscription of the graph.
        callbacks: Its callbacks.
        ready: Queue of its callback group.
    """
    is_publisher = isinstance(callbacks, PublisherEventCallbacks)
    wanted = {name: call for name, call in vars(callbacks).items() if callable(call)}
    if not wanted:
        return
    if not isinstance(graph, EmbeddedGraph):
        raise UsageError("event_callbacks are there on the embedded graph only; leave them out on real ROS")
    kernel = owner.kernel

    def emit(name: str, info: Any) -> None:
        if name in wanted:
            with kernel.guard:
                ready.add(Work(kernel.now(), lambda: wanted[name](info)))

    monitor = _Monitor(watched, emit, is_publisher=is_publisher)

    def body() -> None:
        while True:
            due = monitor.check(kernel.now())
            graph.changed.wait_for(monitor.has_changed, None if due is None else due - kernel.now())

    owner.spawn(body, f"events of {watched.topic}")


class _Monitor:
    """Compares the counterparts of one endpoint with those of the last check."""

    def __init__(self, watched: Any, emit: Callable[[str, Any], None], *, is_publisher: bool) -> None:
        self._watched, self._emit, self._is_publisher = watched, emit, is_publisher
        self._known: list[Any] = []
        self._alive: dict[int, bool] = {}
        self._total = self._refused = self._missed = self._lost = self._leases = 0
        self._counted_from: Ns | None = None

    def has_changed(self) -> bool:
        """Return whether ``check`` is due before its time."""
        return self._watched.counterparts() != self._known or getattr(self._watched, "lost", 0) != self._lost

    def check(self, now: Ns) -> Ns | None:
        """Emit what has happened; return when to check again, ns, or None if nothing is to be expected."""
        own, before, self._known = self._watched, self._known, self._watched.counterparts()
        self._matched(before, [one for one in self._known if one not in before])
        lost = getattr(own, "lost", 0)
        if lost != self._lost:
            self._emit("message_lost", QoSMessageLostInfo(lost, lost - self._lost))
            self._lost = lost
        times = [self._deadline(now), self._own_lease(now) if self._is_publisher else self._liveliness(now)]
        return min((time for time in times if time is not None), default=None)

    def _why(self, other: Any) -> str:
        pair = (self._watched.qos, other.qos) if self._is_publisher else (other.qos, self._watched.qos)
        return incompatible(*pair)

    def _matched(self, before: list[Any], new: list[Any]) -> None:
        for one in new:
            why = self._why(one)
            if why:
                self._refused += 1
                kind = next(policy for word, policy in _POLICIES.items() if word in why)
                made = (
                    QoSOfferedIncompatibleQoSInfo if self._is_publisher else QoSRequestedIncompatibleQoSInfo
                )
                self._emit("incompatible_qos", made(self._refused, 1, kind))
        joined = sum(1 for one in new if not self._why(one))
        left = sum(1 for one in before if one not in self._known and not self._why(one))
        if joined or left:
            self._total += joined
            current = sum(1 for one in self._known if not self._why(one))
            info = QoSPublisherMatchedInfo if self._is_publisher else QoSSubscriptionMatchedInfo
            self._emit("matched", info(self._total, joined, current, joined - left))

    def _deadline(self, now: Ns) -> Ns | None:
        period: Ns = self._watched.qos.deadline
        latest: Ns | None = self._watched.latest
        if not period:
            return None
        if latest is None:
            return now + period
        if self._counted_from is None or latest > self._counted_from:
            self._counted_from = latest
        missed = 0
        while now >= self._counted_from + period:
            self._counted_from += period
            missed += 1
        if missed:
            self._missed += missed
            info = QoSOfferedDeadlineMissedInfo if self._is_publisher else QoSRequestedDeadlineMissedInfo
            self._emit("deadline", info(self._missed, missed))
        return self._counted_from + period

    def _own_lease(self, now: Ns) -> Ns | None:
        qos: QoS = self._watched.qos
        latest: Ns | None = self._watched.latest
        if not (qos.manual and qos.lease):
            return None
        if latest is None or now < latest + qos.lease:
            self._alive[0] = latest is not None
            return (now if latest is None else latest) + qos.lease
        if self._alive.get(0):
            self._alive[0] = False
            self._leases += 1
            self._emit("liveliness", QoSLivelinessLostInfo(self._leases, 1))
        return now + qos.lease

    def _liveliness(self, now: Ns) -> Ns | None:
        before, self._alive = self._alive, {}
        times = []
        for one in self._known:
            if self._why(one):
                continue
            lease = one.qos.lease
            if one.qos.manual and lease:
                alive = one.latest is not None and now < one.latest + lease
                if one.latest is None and id(one) not in before:
                    continue
                self._alive[id(one)] = alive
                times.append(one.latest + lease if alive else now + lease)
            else:
                self._alive[id(one)] = True
        was, now_alive = sum(before.values()), sum(self._alive.values())
        dead_before, dead = len(before) - was, len(self._alive) - now_alive
        if (was, dead_before) != (now_alive, dead):
            info = QoSLivelinessChangedInfo(now_alive, dead, now_alive - was, dead - dead_before)
            self._emit("liveliness", info)
        manual = any(one.qos.manual for one in self._known)
        return min(times, default=now + _POLL if manual else None)


_POLL: Ns = 10 * MS
"""Period at which a publisher that has not asserted its liveliness yet is looked at."""
_POLICIES = {
    "reliable": QoSPolicyKind.RELIABILITY,
    "transient": QoSPolicyKind.DURABILITY,
    "deadline": QoSPolicyKind.DEADLINE,
    "liveliness": QoSPolicyKind.LIVELINESS,
}
"""Words of ``incompatible`` and the policy that they are about."""


EVENTS: dict[str, Any] = {
    kind.__name__: kind
    for kind in (
        IncompatibleTypeInfo,
        PublisherEventCallbacks,
        QoSLivelinessChangedInfo,
        QoSLivelinessLostInfo,
        QoSMessageLostInfo,
        QoSOfferedDeadlineMissedInfo,
        QoSOfferedIncompatibleQoSInfo,
        QoSPublisherMatchedInfo,
        QoSRequestedDeadlineMissedInfo,
        QoSRequestedIncompatibleQoSInfo,
        QoSSubscriptionMatchedInfo,
        SubscriptionEventCallbacks,
        UnsupportedEventTypeError,
    )
}
"""Content of ``rclpy.event_handler``."""
