"""What the transports need of a ROS client library. Messages cross as CDR bytes.

Every method may be called from any thread. Callbacks come from threads of the library and must not block.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from volery.ros.graph.interface import QoS, ServiceState, TopicState
from volery.ros.messages import Message, ServiceType


class ReceivedMessage(NamedTuple):
    """A message as it arrived: its bytes, what decodes them, and the sending node ('' if unknown).

    ``read`` raises ``UsageError`` if the bytes are no message of the topic's type.
    """

    data: bytes
    read: Callable[[bytes], Any]
    publisher: str


OnMessage = Callable[[ReceivedMessage], None]

OnResponse = Callable[[Message | None, str], None]
"""Receives the response, or None and the reason why there is none."""

OnRequest = Callable[[Message, OnResponse], None]
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

    def call(self, request: Message, done: OnResponse) -> Callable[[], None]:
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

    def services(self) -> list[ServiceState]:
        """Return the services, by name."""

    def announce_clock(self) -> None:
        """Let nodes that start from now on take their time from ``/clock``, where the graph supports that."""

    def close(self) -> None:
        """Stop the threads and processes of the library."""
