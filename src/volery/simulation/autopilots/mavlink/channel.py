"""One MAVLink link of a simulated autopilot: its streams, its queue of status texts, and its peers."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from volery.base.errors import UsageError
from volery.base.time import MS, Ns, S
from volery.kernel.api import Kernel
from volery.links.frame import Frame
from volery.links.link import ByteLink, FillingLink, Link, SelectiveLink
from volery.links.mavlink_messages import MessageStreams, constant
from volery.simulation.autopilots.state_groups import NEVER
from volery.trace.events import LinkState

AUTOPILOT = 1
"""MAV_COMP_ID_AUTOPILOT1."""

WAITING = 4
"""Number of texts that wait for a ground station; older ones are lost."""

STATION_SILENT: Ns = 2500 * MS
"""Time after its last heartbeat for which a ground station counts as connected [ns]."""

GROUND_STATION = constant("MAV_TYPE_GCS")

HIGH_LATENCY_STREAMS: Mapping[str, Ns] = {"HIGH_LATENCY2": 5 * S}
"""Periods of the streams that a link of high latency carries without a request, as in ArduPilot."""

MOST_WAITING = 256
"""Frames of one sender that wait to be handled; what it sends beyond them is dropped."""

MOST_WAITING_ON_LINK = 4096
"""The same for all senders of a link together."""

Chunks = list[dict[str, Any]]


class StatusTextPolicy(NamedTuple):
    """How texts become STATUSTEXT."""

    numbered: bool = False
    """Whether a text that fits into one message also has an id."""
    to_stations: bool = False
    """Whether texts wait, four at most, until a ground station is connected on the link."""
    spacing: Ns = 0
    """Shortest time between two texts on a link [ns]."""


class StatusTextQueue:
    """Status texts of one link, held back as the firmware holds them back.

    Args:
        kernel: Clock and timers.
        policy: When texts may be sent.
        send: Sends the fields of one STATUSTEXT.
    """

    def __init__(
        self, kernel: Kernel, policy: StatusTextPolicy, send: Callable[[dict[str, Any]], None]
    ) -> None:
        self._kernel = kernel
        self._policy = policy
        self._send = send
        self._waiting: deque[Chunks] = deque(maxlen=WAITING)
        self._free_at: Ns = NEVER
        self._due = False
        self._station_last_ns: Ns = NEVER

    def on_heartbeat(self, kind: int) -> None:
        """Take note of a heartbeat that arrived on the link; *kind* is a MAV_TYPE."""
        if kind == GROUND_STATION:
            self._station_last_ns = self._kernel.now()
            self._flush()

    def put(self, text: Chunks) -> None:
        """Send a text as soon as the policy permits; *text* are the fields of its messages."""
        if not (self._policy.to_stations or self._policy.spacing):
            self._send_chunks(text)
            return
        self._waiting.append(text)
        self._flush()

    def _send_chunks(self, text: Chunks) -> None:
        for fields in text:
            self._send(fields)

    def _station_connected(self) -> bool:
        connected = self._kernel.now() - self._station_last_ns <= STATION_SILENT
        return connected or not self._policy.to_stations

    def _flush(self) -> None:
        now = self._kernel.now()
        if self._due or not self._waiting or not self._station_connected():
            return
        if now >= self._free_at:
            self._send_chunks(self._waiting.popleft())
            self._free_at = now + self._policy.spacing
        if self._waiting:
            self._due = True
            self._kernel.call_at(self._free_at, self._on_free)

    def _on_free(self) -> None:
        self._due = False
        self._flush()


class MavlinkChannel:
    """A link with its streams.

    What the autopilot cannot send or handle is left out with one line in the trace for each kind: a message
    with a value that its field does not hold, and frames that come faster than they are handled.

    Args:
        kernel: Clock and trace.
        link: The autopilot's end of the link.
        index: Number of the link among those that are open.
        system: MAVLink system id of the autopilot.
        usual: Periods of the streams that are sent without a request.
    """

    def __init__(self, kernel: Kernel, link: Link, index: int, system: int, usual: Mapping[str, Ns]) -> None:
        self._kernel = kernel
        self.link = link
        self.index = index
        self._usual = usual
        self.requested: dict[str, Ns] = {}
        """Periods of the streams that were requested as a group."""
        self.streams: MessageStreams
        self.texts: StatusTextQueue
        self.open = True
        self.silent: Callable[[], bool] | None = None
        """Whether nothing is sent now: of links of high latency only, which are switched on by a command."""
        self._system = system
        self._waiting: Counter[tuple[int, int]] = Counter()
        """Frames that wait to be handled, by their sender."""
        self._reported: set[str] = set()
        self._selective = link if isinstance(link, SelectiveLink) else None
        self._filling = link if isinstance(link, FillingLink) else None

    @property
    def usual(self) -> Mapping[str, Ns]:
        """Periods of the streams that are sent without a request."""
        return self._usual if self.silent is None else HIGH_LATENCY_STREAMS

    def _carries(self) -> bool:
        return self.open and (self.silent is None or not self.silent())

    def is_wanted(self, name: str) -> bool:
        """Return whether the other end uses the message called *name*, as far as it has stated that."""
        return self._selective is None or self._selective.is_wanted(name)

    def has_room(self) -> bool:
        """Return whether the link takes more now than telemetry; long answers wait for that."""
        return self._filling is None or self._filling.has_room()

    def send(self, name: str, fields: dict[str, Any]) -> None:
        """Send a message as the autopilot, while the channel is open."""
        if self._carries():
            self._put(Frame(name, fields, self._system, AUTOPILOT))

    def pass_on(self, frame: Frame) -> None:
        """Send a message of another system or component, while the channel is open."""
        if self._carries() and self.is_wanted(frame.name):
            self._put(frame)

    def _put(self, frame: Frame) -> None:
        try:
            self.link.send(frame)
        except UsageError as error:
            self.leave_out(f"{frame.name} is not sent", str(error))

    def leave_out(self, what: str, reason: str) -> None:
        """Record that something is left out, once for each *what*."""
        if what not in self._reported:
            self._reported.add(what)
            now = self._kernel.now()
            self._kernel.record(LinkState(now, self.link.name, "dropped", f"{what}: {reason}"))

    def admit(self, frame: Frame) -> bool:
        """Count a frame that has arrived among those that wait; return False if it is dropped instead."""
        sender = frame.system, frame.component
        if self._waiting[sender] >= MOST_WAITING or self._waiting.total() >= MOST_WAITING_ON_LINK:
            self.leave_out(
                f"what system {frame.system}, component {frame.component} sends",
                f"more than {MOST_WAITING} of its messages wait to be handled",
            )
            return False
        self._waiting[sender] += 1
        return True

    def take(self, frame: Frame) -> None:
        """Count a frame that waited as handled."""
        sender = frame.system, frame.component
        self._waiting[sender] -= 1
        if not self._waiting[sender]:
            del self._waiting[sender]

    def stream(self) -> None:
        """Start the streams: the usual ones and those that were requested."""
        for name, period in self.usual.items():
            if not self.streams.period(name):
                self.streams.set((name,), period)
        self.streams.start()

    def send_bytes(self, data: bytes) -> None:
        """Send bytes that are no message, where the link carries bytes."""
        if self.open and isinstance(self.link, ByteLink):
            self.link.send_bytes(data)

    def close(self) -> None:
        """Send nothing and handle nothing from now on."""
        self.open = False
        self.streams.stop()


class Peer(NamedTuple):
    """Sender of a message: the channel, and its system and component ids."""

    channel: MavlinkChannel
    system: int
    component: int

    def send(self, name: str, fields: dict[str, Any]) -> None:
        """Send a message that has no target."""
        self.channel.send(name, fields)

    def answer(self, name: str, **fields: Any) -> None:
        """Send a message with the peer as its target."""
        self.channel.send(name, {**fields, "target_system": self.system, "target_component": self.component})
