"""What a link is: messages to and from one peer, as values.

In one process they travel as values; on a wire a codec turns them into bytes and back.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, runtime_checkable


class Frame(NamedTuple):
    """A message: its name and fields as the protocol defines them (``HEARTBEAT``, ``custom_mode`` ...).

    ``system`` and ``component`` are the sender's ids. Fields are never changed after sending.
    """

    name: str
    fields: dict[str, Any]
    system: int
    component: int


Receiver = Callable[[Frame], None]


class Link(Protocol):
    """A two-way stream of frames. Never blocks; what arrives is handed over as house code."""

    name: str

    def send(self, frame: Frame) -> None:
        """Send, without waiting for anything. A link that is down drops it."""

    def receive(self, receiver: Receiver) -> None:
        """From now on hand every frame that arrives to *receiver*."""

    def problem(self) -> str:
        """What is wrong with the wire, in words for the user (``only text arrives: ...``); else empty."""

    def close(self) -> None:
        """Let go of sockets and threads."""


@runtime_checkable
class ByteLink(Protocol):
    """A link that is bytes on a wire, and so can carry some that are no frame: a greeting, noise."""

    def send_bytes(self, data: bytes) -> None:
        """Put *data* on the wire as it is."""
