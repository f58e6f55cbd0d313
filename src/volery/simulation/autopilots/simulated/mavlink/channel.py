"""One link of an autopilot, and whom an answer goes to."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from volery.base.time import Ns
from volery.links.link import ByteLink, Frame, Link
from volery.links.rates import Streams
from volery.simulation.autopilots.simulated.mavlink.texts import TextLine

AUTOPILOT = 1
"""MAV_COMP_ID_AUTOPILOT1."""


class Channel:
    """A link with its streams. ``index`` numbers the links that are open at once; ``usual`` is what is
    streamed unasked.
    """

    def __init__(self, link: Link, index: int, system: int, usual: Mapping[str, Ns]) -> None:
        self.link = link
        self.index = index
        self.usual = usual
        self.streams: Streams
        self.texts: TextLine
        self.open = True
        self._system = system

    def send(self, name: str, fields: dict[str, Any]) -> None:
        """Send a message as the autopilot; nothing once it has hung up."""
        if self.open:
            self.link.send(Frame(name, fields, self._system, AUTOPILOT))

    def stream(self) -> None:
        """Send regularly from now on: the usual, and what was asked for."""
        for name, period in self.usual.items():
            if not self.streams.period(name):
                self.streams.set((name,), period)
        self.streams.start()

    def send_bytes(self, data: bytes) -> None:
        """Bytes that are no message, where the link carries bytes; else nothing."""
        if self.open and isinstance(self.link, ByteLink):
            self.link.send_bytes(data)

    def hang_up(self) -> None:
        """Neither speak nor listen any more."""
        self.open = False
        self.streams.stop()


class Peer(NamedTuple):
    """Who asked: through which link, and with which ids."""

    channel: Channel
    system: int
    component: int

    def answer(self, name: str, **fields: Any) -> None:
        """Send a message that names the asker as its target."""
        self.channel.send(name, {**fields, "target_system": self.system, "target_component": self.component})
