"""Words on one link: cut into STATUSTEXT messages, and held back as the firmware holds them back.

One link of an autopilot, and whom an answer goes to.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from volery.base.time import MS, Ns
from volery.kernel.api import Kernel
from volery.links.link import ByteLink, Frame, Link
from volery.links.mavlink_conventions import MessageStreams
from volery.simulation.autopilots.manual_control import NEVER
from volery.simulation.autopilots.mavlink.firmware import StatusTextPolicy

WAITING = 4
"""Texts that wait for a ground station; older ones are lost."""

STATION_SILENT: Ns = 2500 * MS
"""A ground station that has been silent for that long is not there."""

GROUND_STATION = 6
"""MAV_TYPE_GCS."""

Chunks = list[dict[str, Any]]


class StatusTextQueue:
    """The texts of one link. *send* sends the fields of one message."""

    def __init__(
        self, kernel: Kernel, habits: StatusTextPolicy, send: Callable[[dict[str, Any]], None]
    ) -> None:
        self._kernel = kernel
        self._habits = habits
        self._send = send
        self._waiting: deque[Chunks] = deque(maxlen=WAITING)
        self._free_at: Ns = NEVER
        self._due = False
        self._station_seen: Ns = NEVER

    def on_heartbeat(self, kind: int) -> None:
        """Somebody's heartbeat came in through the link; *kind* is a MAV_TYPE."""
        if kind == GROUND_STATION:
            self._station_seen = self._kernel.now()
            self._flush()

    def put(self, text: Chunks) -> None:
        """Send it, as soon as it may be."""
        if not (self._habits.to_stations or self._habits.spacing):
            self._tell(text)
            return
        self._waiting.append(text)
        self._flush()

    def _tell(self, text: Chunks) -> None:
        for fields in text:
            self._send(fields)

    def _listened_to(self) -> bool:
        heard = self._kernel.now() - self._station_seen <= STATION_SILENT
        return heard or not self._habits.to_stations

    def _flush(self) -> None:
        now = self._kernel.now()
        if self._due or not self._waiting or not self._listened_to():
            return
        if now >= self._free_at:
            self._tell(self._waiting.popleft())
            self._free_at = now + self._habits.spacing
        if self._waiting:
            self._due = True
            self._kernel.call_at(self._free_at, self._go_on)

    def _go_on(self) -> None:
        self._due = False
        self._flush()


AUTOPILOT = 1
"""MAV_COMP_ID_AUTOPILOT1."""


class MavlinkChannel:
    """A link with its streams. ``index`` numbers the links that are open at once; ``usual`` is what is
    streamed unasked.
    """

    def __init__(self, link: Link, index: int, system: int, usual: Mapping[str, Ns]) -> None:
        self.link = link
        self.index = index
        self.usual = usual
        self.streams: MessageStreams
        self.texts: StatusTextQueue
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

    def close(self) -> None:
        """Neither speak nor listen any more."""
        self.open = False
        self.streams.stop()


class Peer(NamedTuple):
    """Who asked: through which link, and with which ids."""

    channel: MavlinkChannel
    system: int
    component: int

    def answer(self, name: str, **fields: Any) -> None:
        """Send a message that names the asker as its target."""
        self.channel.send(name, {**fields, "target_system": self.system, "target_component": self.component})
