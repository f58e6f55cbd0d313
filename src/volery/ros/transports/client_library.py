"""What the transports need of a ROS client library, and calls to it that may block.

Messages cross as CDR bytes. Every method of the library may be called from any thread. Callbacks come from
threads of the library and must not block. For a call that may block, a thread executes it while the
requesting task waits.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, Protocol, TypeVar, cast

from volery.base.errors import LinkSilent, VoleryError
from volery.base.time import Ns, S, to_seconds
from volery.kernel.api import Kernel
from volery.kernel.waiting import Signal
from volery.ros.graph.interface import QoS, ServiceState, TopicState
from volery.ros.messages import RosMessage, ServiceType


class ReceivedMessage(NamedTuple):
    """A message as it arrived: its bytes, what decodes them, the sending node ('' if unknown), if it latches.

    ``read`` raises ``UsageError`` if the bytes are no message of the topic's type.
    """

    data: bytes
    read: Callable[[bytes], Any]
    publisher: str
    latched: bool = False


OnMessage = Callable[[ReceivedMessage], None]

OnResponse = Callable[[RosMessage | None, str], None]
"""Receives the response, or None and the reason why there is none."""

OnRequest = Callable[[RosMessage, OnResponse], None]
"""Receives a request, and what to call with the response, once, from any thread."""


class LibraryPublisher(Protocol):
    """Sends to one topic."""

    def send(self, data: bytes) -> None:
        """Send a message's CDR bytes, without waiting for a receiver."""

    def connected(self) -> int:
        """Return the number of subscriptions that receive it."""

    def close(self) -> None:
        """Stop sending."""


class LibrarySubscription(Protocol):
    """Receives from one topic."""

    def connected(self) -> int:
        """Return the number of publishers that it receives from."""

    def close(self) -> None:
        """Stop receiving."""


class LibraryService(Protocol):
    """A service that is offered."""

    def close(self) -> None:
        """Stop offering it."""


class LibraryClient(Protocol):
    """A client of one service."""

    def call(self, request: RosMessage, done: OnResponse) -> Callable[[], None]:
        """Send a request, and call `done` with the response; return what abandons the call."""

    def ready(self) -> bool:
        """Return whether a node serves it; may block for a moment."""

    def close(self) -> None:
        """Stop calling."""


class LibraryNode(Protocol):
    """One node of the client library. All names are absolute. Every call may block for a moment."""

    def advertise(self, topic: str, message_type: str, qos: QoS) -> LibraryPublisher:
        """Publish to a topic; raise ``UsageError`` if the topic carries another type."""

    def subscribe(self, topic: str, message_type: str, qos: QoS, arrived: OnMessage) -> LibrarySubscription:
        """Receive a topic; raise ``UsageError`` if the topic carries another type."""

    def serve(self, name: str, kind: ServiceType, requested: OnRequest) -> LibraryService:
        """Offer a service; raise ``UsageError`` if another node does."""

    def client(self, name: str, kind: ServiceType) -> LibraryClient:
        """Return a client of a service."""

    def has_service(self, name: str) -> bool:
        """Return whether a node serves `name`."""

    def get_parameter(self, name: str) -> Any:
        """Return a parameter's value, a ``dict`` for a namespace; ``KeyError`` if there is none."""

    def set_parameter(self, name: str, value: Any) -> None:
        """Set a parameter or a namespace."""

    def delete_parameter(self, name: str) -> None:
        """Remove a parameter or a namespace; ``KeyError`` if there is none."""

    def prepare_close(self) -> None:
        """Prepare for the closing of all that the node has made, and then of the node."""

    def close(self) -> None:
        """Leave the graph."""


class ClientLibrary(Protocol):
    """A ROS client library as one process uses it."""

    def join(self, name: str, namespace: str, lost: Callable[[str], None]) -> LibraryNode:
        """Join the graph as a node.

        Args:
            name: Name without slashes.
            namespace: ``/`` or an absolute name.
            lost: Called with the reason if the graph removes the node.

        Raises:
            UsageError: the name is taken.
            LinkError: the graph cannot be reached.
        """

    def node_names(self) -> list[str]:
        """Return the names of all nodes, sorted."""

    def topics(self) -> list[TopicState]:
        """Return the topics, by name."""

    def offered(self, topic: str) -> tuple[QoS, ...]:
        """Return what the publishers of a topic offer; nothing in ROS 1. An unknown depth is None."""

    def services(self) -> list[ServiceState]:
        """Return the services, by name."""

    def announce_clock(self) -> None:
        """Let nodes that start from now on take their time from ``/clock``, where the graph supports that."""

    def close(self) -> None:
        """Stop the threads and processes of the library."""


T = TypeVar("T")
PATIENCE: Ns = 60 * S
"""Longest wait for a client library, ns: on a small computer it compiles, or discovers, for long."""
_waiting: dict[Kernel, list[str]] = {}
"""Names of the tasks that wait for a thread, for kernels where there are any."""
POLL_S = 0.05
"""Period of polling for what a client library does not announce, s."""


def run_in_thread(kernel: Kernel, what: str, work: Callable[[], T], within: Ns = PATIENCE) -> T:
    """Execute `work` in a thread of its own; return its result or raise its exception.

    In a framework callback, which must not block, `work` is executed in place.

    Raises:
        LinkSilent: it takes longer than `within` ns.
    """
    task = kernel.current()
    if task is None:
        return work()
    ended = Signal(kernel, what)
    outcome: list[tuple[T | None, BaseException | None]] = []

    def finish(value: T | None, error: BaseException | None) -> None:
        outcome.append((value, error))
        ended.notify()

    def run() -> None:
        try:
            value = work()
        except Exception as error:
            kernel.post(partial(finish, None, error))
        else:
            kernel.post(partial(finish, value, None))

    threading.Thread(target=run, name=what, daemon=True).start()
    waiting = _waiting.setdefault(kernel, [])
    waiting.append(task.name)
    try:
        if not ended.wait_for(lambda: outcome, within):
            raise LinkSilent(f"{what}: no answer within {to_seconds(within):g} s")
    finally:
        waiting.remove(task.name)
        if not waiting:
            _waiting.pop(kernel, None)
    value, error = outcome[0]
    if error is not None:
        raise error
    return cast("T", value)


def pending_calls(kernel: Kernel) -> tuple[str, ...]:
    """Return the names of the tasks that wait in ``run_in_thread``."""
    return tuple(_waiting.get(kernel, ()))


def poll_in_thread(kernel: Kernel, what: str, holds: Callable[[], bool], within: Ns | None) -> bool:
    """Block the current task until `holds`, which a thread polls; return False if `within` ns pass first."""
    signal = Signal(kernel, what)
    found: list[bool] = []
    given_up = threading.Event()

    def announce() -> None:
        found.append(True)
        signal.notify()

    def poll() -> None:
        while not given_up.is_set():
            if _succeeds(holds):
                kernel.post(announce)
                return
            given_up.wait(POLL_S)

    threading.Thread(target=poll, name=what, daemon=True).start()
    try:
        return signal.wait_for(lambda: found, within)
    finally:
        given_up.set()


def _succeeds(holds: Callable[[], bool]) -> bool:
    try:
        return holds()
    except (OSError, VoleryError):
        return False  # the ROS master cannot be reached; it may come back
