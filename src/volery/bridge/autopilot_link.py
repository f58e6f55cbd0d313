"""The MAVLink side of a vehicle node: one autopilot at the other end of a link.

Asking the autopilot for what is published, once a second for what does not come.

A request right after boot may be lost, though acknowledged. ArduPilot is asked for streams, PX4, which knows
none, for messages.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from types import TracebackType
from typing import Any, NamedTuple, Self

from volery.base.time import Ns, S
from volery.bridge.mode_names import PX4_ID, AutopilotType
from volery.kernel.api import Kernel
from volery.kernel.waiting import Signal
from volery.links.link import Frame, Link

INVALID_AUTOPILOT = 8
"""MAV_AUTOPILOT of ground stations and companions."""
_KEPT_ALL = frozenset({"STATUSTEXT", "MISSION_ITEM_REACHED", "HEARTBEAT", "PARAM_VALUE"})


class ReceivedFrame(NamedTuple):
    """A frame, and when it came."""

    frame: Frame
    at: Ns


class FrameSubscription:
    """Hears frames of some names while it is open.

    ``with wire.listen("COMMAND_ACK") as ear: ear.next(within)``.
    """

    def __init__(self, wire: AutopilotLink, names: tuple[str, ...]) -> None:
        self.names = frozenset(names)
        self._wire = wire
        self._frames: deque[Frame] = deque()
        self._filled = Signal(wire.kernel, f"{wire.name} ({', '.join(names)})")

    def __enter__(self) -> Self:
        with self._wire.kernel.guard:
            self._wire.ears.append(self)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        with self._wire.kernel.guard:
            self._wire.ears.remove(self)

    def hear(self, frame: Frame) -> None:
        """House code."""
        self._frames.append(frame)
        self._filled.notify()

    def next(self, within: Ns) -> Frame | None:
        """The next frame, waiting for it; ``None`` if none comes in time."""
        if self._filled.wait_for(lambda: self._frames, within):
            return self._frames.popleft()
        return None


class AutopilotLink:
    """Sends as (*system*, *component*) to the autopilot that is heard first, and keeps what it says.

    *vehicle* is the system id to listen for where several share a link; 0: whichever speaks.
    """

    def __init__(self, kernel: Kernel, link: Link, system: int, component: int, vehicle: int = 0) -> None:
        self.kernel, self.name = kernel, link.name
        self._link = link
        self._system, self._component = system, component
        self._vehicle = vehicle
        self._published: frozenset[str] | None = None
        self.target: tuple[int, int] = (0, 0)
        self.firmware = AutopilotType()
        self.last_heartbeat: Ns | None = None
        self.latest: dict[str, ReceivedFrame] = {}
        self.fresh: list[ReceivedFrame] = []
        self.ears: list[FrameSubscription] = []
        self._came = Signal(kernel, f"{link.name} (frames)")
        link.receive(self._receive)

    @property
    def known(self) -> bool:
        """Whether an autopilot has been heard."""
        return self.target != (0, 0)

    def _receive(self, frame: Frame) -> None:
        if self._vehicle not in (0, frame.system):
            return
        if frame.name == "HEARTBEAT" and not self.known and frame.fields["autopilot"] != INVALID_AUTOPILOT:
            self.target = (frame.system, frame.component)
        if (frame.system, frame.component) != self.target:
            return
        now = self.kernel.now()
        if frame.name == "HEARTBEAT":
            self.last_heartbeat = now
            self.firmware = AutopilotType(frame.fields["autopilot"], frame.fields["type"])
        heard = ReceivedFrame(frame, now)
        if frame.name not in _KEPT_ALL:
            self._forget(frame.name)
        self.latest[frame.name] = heard
        if self._published is None or frame.name in self._published:
            self.fresh.append(heard)
            self._came.notify()
        for ear in tuple(self.ears):
            if frame.name in ear.names:
                ear.hear(frame)

    def _forget(self, name: str) -> None:
        """What is repeated all the time is published in its latest form only."""
        last = self.latest.get(name)
        if last is not None and last in self.fresh:
            self.fresh.remove(last)

    def only(self, published: Iterable[str]) -> None:
        """From now on these names alone are fresh: nobody is woken for the others."""
        self._published = frozenset(published)

    def take(self) -> list[ReceivedFrame]:
        """What has come since it was last asked."""
        taken, self.fresh = self.fresh, []
        return taken

    def wait(self, until: Ns) -> None:
        """Block the current task until something has come, or that time."""
        within = max(0, until - self.kernel.now())
        self._came.wait_for(lambda: self.fresh, within, ends_activation=True)

    def last(self, name: str) -> dict[str, Any] | None:
        """The fields of the latest frame of that name."""
        heard = self.latest.get(name)
        return heard.frame.fields if heard else None

    def listen(self, *names: str) -> FrameSubscription:
        """An ear for frames of these names; a context manager."""
        return FrameSubscription(self, names)

    def send(self, name: str, fields: dict[str, Any]) -> None:
        """Send to nobody in particular."""
        with self.kernel.guard:
            self._link.send(Frame(name, fields, self._system, self._component))

    def send_to(self, name: str, fields: dict[str, Any]) -> None:
        """Send to the autopilot."""
        system, component = self.target
        if name == "MANUAL_CONTROL":  # the one message that addresses a system only
            self.send(name, {"target": system, **fields})
        elif name == "STATUSTEXT":  # to whom it may concern
            self.send(name, fields)
        else:
            self.send(name, {"target_system": system, "target_component": component, **fields})


ALL, RAW_SENSORS, EXTENDED_STATUS, RC, POSITION, EXTRA1, EXTRA2, EXTRA3 = 0, 1, 2, 3, 6, 10, 11, 12
"""MAV_DATA_STREAM."""
EXTENDED_SYS_STATE, GET_HOME_POSITION, SET_MESSAGE_INTERVAL = 245, 410, 511
ASK_EVERY: Ns = S
MISSED_AFTER: Ns = 3 * S

_SHOWN_BY = {
    ALL: "ATTITUDE",
    RAW_SENSORS: "RAW_IMU",
    EXTENDED_STATUS: "SYS_STATUS",
    RC: "RC_CHANNELS",
    POSITION: "GLOBAL_POSITION_INT",
    EXTRA1: "ATTITUDE",
    EXTRA2: "VFR_HUD",
    EXTRA3: "SYSTEM_TIME",
}
"""The message by which one sees that a stream comes."""

_MESSAGES: Mapping[int, tuple[int, ...]] = {
    RAW_SENSORS: (105, 29),
    EXTENDED_STATUS: (1, 24),
    RC: (65, 36),
    POSITION: (33, 32),
    EXTRA1: (30,),
    EXTRA2: (74,),
}
"""The messages of a stream that are published, for PX4: HIGHRES_IMU stands for RAW_IMU, which it lacks."""
_PX4_SHOWN_BY = {**_SHOWN_BY, RAW_SENSORS: "HIGHRES_IMU"}


def request_stream(wire: AutopilotLink, stream: int, rate: int) -> None:
    """Ask for a MAV_DATA_STREAM at *rate* hertz; 0 stops it."""
    fields = {"req_stream_id": stream, "req_message_rate": rate, "start_stop": 1 if rate else 0}
    wire.send_to("REQUEST_DATA_STREAM", fields)


class StreamRequests:
    """Keeps *rates* (hertz by stream) coming; *home* asks for the home position and the landed state as
    well.
    """

    def __init__(self, wire: AutopilotLink, rates: Mapping[int, int], *, home: bool) -> None:
        self._wire, self._rates, self._home = wire, rates, home
        self._next: Ns = 0

    def look(self, now: Ns) -> None:
        """Ask for what is missing."""
        if not self._wire.known or now < self._next:
            return
        self._next = now + ASK_EVERY
        by_message = self._wire.firmware.autopilot == PX4_ID
        shown_by = _PX4_SHOWN_BY if by_message else _SHOWN_BY
        for stream, rate in self._rates.items():
            heard = self._wire.latest.get(shown_by.get(stream, ""))
            if heard is not None and now - heard.at <= MISSED_AFTER:
                continue
            if by_message:
                self._request_messages(stream, rate)
            else:
                request_stream(self._wire, stream, rate)
        if self._home:
            self._request_once()

    def _request_messages(self, stream: int, rate: int) -> None:
        streams = _MESSAGES if stream == ALL else {stream: _MESSAGES.get(stream, ())}
        for messages in streams.values():
            for number in messages:
                self._command(SET_MESSAGE_INTERVAL, number, 1e6 / max(rate, 1))

    def _request_once(self) -> None:
        latest = self._wire.latest
        if "EXTENDED_SYS_STATE" not in latest:
            self._command(SET_MESSAGE_INTERVAL, EXTENDED_SYS_STATE, 1e6)
        if "HOME_POSITION" not in latest:
            self._command(GET_HOME_POSITION)

    def _command(self, command: int, *parameters: float) -> None:
        fields = {f"param{number}": value for number, value in enumerate(parameters, start=1)}
        self._wire.send_to("COMMAND_LONG", {"command": command, **fields})
