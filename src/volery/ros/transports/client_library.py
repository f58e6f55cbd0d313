"""What a ROS client library offers to the nodes of a transport. Messages cross as CDR bytes.

Everything here may be called from any thread. Callbacks come from threads of the library and must not block.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from volery.ros.graph.interface import QoS, ServiceState, TopicState
from volery.ros.messages import Message, ServiceType


class ReceivedMessage(NamedTuple):
    """A message as it arrived: its bytes, what reads them, and the node it came from ('' if unknown).

    ``read`` raises ``UsageError`` where the bytes are no message of the topic's type.
    """

    data: bytes
    read: Callable[[bytes], Any]
    publisher: str


OnMessage = Callable[[ReceivedMessage], None]

OnResponse = Callable[[Message | None, str], None]
"""The answer, or ``None`` and why there is none."""

OnRequest = Callable[[Message, OnResponse], None]
"""A request, and what is to be called with the answer, once, from any thread."""


class LibraryPublisher(Protocol):
    """Sends to one topic."""

    def send(self, data: bytes) -> None:
        """Send a message's CDR bytes. Never waits for a receiver."""

    def connected(self) -> int:
        """How many subscriptions receive it."""

    def close(self) -> None:
        """Send no more."""


class LibrarySubscription(Protocol):
    """Receives from one topic."""

    def connected(self) -> int:
        """How many publishers it hears."""

    def close(self) -> None:
        """Receive no more."""


class LibraryService(Protocol):
    """A service that is offered."""

    def close(self) -> None:
        """Offer it no longer."""


class LibraryClient(Protocol):
    """Calls one service."""

    def call(self, request: Message, done: OnResponse) -> Callable[[], None]:
        """Ask; *done* is told the answer. Returns what gives it up."""

    def ready(self) -> bool:
        """Whether somebody serves it; may block for a moment."""

    def close(self) -> None:
        """Call no more."""


class LibraryNode(Protocol):
    """One node of the client library. All names are absolute. Every call may block for a moment."""

    def advertise(self, topic: str, message_type: str, qos: QoS) -> LibraryPublisher:
        """Publish to a topic. ``UsageError`` if the topic carries another type."""

    def subscribe(self, topic: str, message_type: str, qos: QoS, arrived: OnMessage) -> LibrarySubscription:
        """Receive a topic. ``UsageError`` if the topic carries another type."""

    def serve(self, name: str, kind: ServiceType, asked: OnRequest) -> LibraryService:
        """Offer a service. ``UsageError`` if somebody else does."""

    def caller(self, name: str, kind: ServiceType) -> LibraryClient:
        """Call a service."""

    def has_service(self, name: str) -> bool:
        """Whether somebody serves *name*."""

    def get_parameter(self, name: str) -> Any:
        """A parameter's value, a ``dict`` for a namespace; ``KeyError`` where there is none."""

    def set_parameter(self, name: str, value: Any) -> None:
        """Set a parameter or a namespace."""

    def delete_parameter(self, name: str) -> None:
        """Remove a parameter or a namespace; ``KeyError`` where there is none."""

    def leave(self) -> None:
        """All it has made is about to be closed, and it itself after that."""

    def close(self) -> None:
        """Leave the graph."""


class ClientLibrary(Protocol):
    """A ROS client library as one process uses it."""

    def wire(self, name: str, namespace: str, lost: Callable[[str], None]) -> LibraryNode:
        """Join the graph as the node of that full name; *lost* is told why, should it be thrown out.

        ``UsageError`` if the name is taken, ``LinkError`` if the graph cannot be reached.
        """

    def node_names(self) -> list[str]:
        """Who is there, sorted."""

    def topics(self) -> list[TopicState]:
        """What topics there are, by name."""

    def services(self) -> list[ServiceState]:
        """What services there are, by name."""

    def announce_clock(self) -> None:
        """Nodes that start from now on are to take their time from ``/clock``, where that can be said."""

    def close(self) -> None:
        """Nothing of it runs any longer."""
