"""The MAVLink side of a vehicle node: one autopilot behind a link, its telemetry streams and its modes.

A request right after boot may be lost although it is acknowledged, so missing streams are requested once a
second. Streams (REQUEST_DATA_STREAM) are requested from ArduPilot, single messages from PX4, which has no
streams.

Source of the mode names: ArduPilot's ``ArduCopter/mode.h`` and ``Rover/mode.h``, PX4's ``px4_custom_mode.h``;
for autopilots without MAVLink the definitions of their own protocols. A mode that is not listed is called
``CMODE(number)``, as in MAVROS.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterable, Mapping
from types import MappingProxyType, TracebackType
from typing import Any, NamedTuple, Self

from volery.base.time import Ns, S
from volery.kernel.api import Kernel
from volery.kernel.waiting import Signal
from volery.links import mavlink_messages
from volery.links.frame import Frame
from volery.links.link import Link
from volery.links.mavlink_messages import message_type
from volery.links.pprzlink_messages import message_type as pprzlink_message_type
from volery.ros.messages.dji_constants import DisplayMode

COPTER = {
    0: "STABILIZE", 1: "ACRO", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 5: "LOITER", 6: "RTL", 7: "CIRCLE",
    8: "POSITION", 9: "LAND", 10: "OF_LOITER", 11: "DRIFT", 13: "SPORT", 14: "FLIP", 15: "AUTOTUNE",
    16: "POSHOLD", 17: "BRAKE", 18: "THROW", 19: "AVOID_ADSB", 20: "GUIDED_NOGPS", 21: "SMART_RTL",
    22: "FLOWHOLD", 23: "FOLLOW", 24: "ZIGZAG", 25: "SYSTEMID", 26: "AUTOROTATE", 27: "AUTO_RTL",
    28: "TURTLE",
}  # fmt: skip
ROVER = {
    0: "MANUAL", 1: "ACRO", 3: "STEERING", 4: "HOLD", 5: "LOITER", 6: "FOLLOW", 7: "SIMPLE", 8: "DOCK",
    9: "CIRCLE", 10: "AUTO", 11: "RTL", 12: "SMART_RTL", 15: "GUIDED", 16: "INITIALISING",
}  # fmt: skip
_PX4_MODES = (
    (1, 0, "MANUAL"), (2, 0, "ALTCTL"), (3, 0, "POSCTL"), (3, 1, "POSCTL.ORBIT"), (4, 1, "AUTO.READY"),
    (4, 2, "AUTO.TAKEOFF"), (4, 3, "AUTO.LOITER"), (4, 4, "AUTO.MISSION"), (4, 5, "AUTO.RTL"),
    (4, 6, "AUTO.LAND"), (4, 8, "AUTO.FOLLOW_TARGET"), (4, 9, "AUTO.PRECLAND"), (4, 10, "AUTO.VTOL_TAKEOFF"),
    (5, 0, "ACRO"), (6, 0, "OFFBOARD"), (7, 0, "STABILIZED"), (8, 0, "RATTITUDE"),
)  # fmt: skip
PX4 = {sub << 24 | main << 16: name for main, sub, name in _PX4_MODES}
"""The modes of PX4 are the same for all vehicle types."""
PAPARAZZI = dict(enumerate(pprzlink_message_type("ROTORCRAFT_STATUS").words("ap_mode")))
DJI = {mode.value: mode.name for mode in DisplayMode}

GENERIC_ID, ARDUPILOT_ID, PAPARAZZI_ID, PX4_ID = 0, 3, 9, 12
"""MAV_AUTOPILOT."""
DJI_ID = 255
"""MAVLink defines no id for DJI and does not use this one. The id is used within this process only."""
AUTOPILOT_NAMES = {ARDUPILOT_ID: "ArduPilot", PX4_ID: "PX4", PAPARAZZI_ID: "Paparazzi", DJI_ID: "DJI"}

_ROVER_TYPES = frozenset({10, 11})
"""MAV_TYPE: ground rover, surface boat."""
_SAME_FOR_ALL_TYPES = {PX4_ID: PX4, PAPARAZZI_ID: PAPARAZZI, DJI_ID: DJI}
_NUMBERED = re.compile(r"(?:CMODE\(|MODE_)?(\d+)\)?\Z")


class AutopilotType(NamedTuple):
    """MAV_AUTOPILOT and MAV_TYPE of a heartbeat, which determine the mode names."""

    autopilot: int = ARDUPILOT_ID
    kind: int = 0


def _mode_table(autopilot: AutopilotType) -> dict[int, str]:
    by_type = ROVER if autopilot.kind in _ROVER_TYPES else COPTER
    return _SAME_FOR_ALL_TYPES.get(autopilot.autopilot, by_type)


def mode_name(autopilot: AutopilotType, number: int) -> str:
    """Return the name of mode *number*."""
    return _mode_table(autopilot).get(number, f"CMODE({number})")


def mode_number(autopilot: AutopilotType, name: str) -> int | None:
    """Return the number of the mode called *name*, or None."""
    for number, known in _mode_table(autopilot).items():
        if known == name.upper():
            return number
    numbered = _NUMBERED.match(name)
    return int(numbered.group(1)) if numbered else None


def mode_names(autopilot: AutopilotType) -> list[str]:
    """Return the names of all modes of an autopilot."""
    return list(_mode_table(autopilot).values())


INVALID_AUTOPILOT = 8
"""MAV_AUTOPILOT of ground stations and companion computers."""
_KEPT_ALL = frozenset(
    {
        *("STATUSTEXT", "MISSION_ITEM_REACHED", "HEARTBEAT", "PARAM_VALUE", "LOG_ENTRY", "LOG_DATA"),
        "COMMAND_ACK",
    }
)
"""Messages that are published one by one; of all others only the latest is published."""


class ReceivedFrame:
    """A frame and the time at which it was received."""

    def __init__(self, frame: Frame, at: Ns) -> None:
        self.frame = frame
        self.at = at


class FrameSubscription:
    """Queues the frames of some names while it is open.

    ``with link.subscribe("COMMAND_ACK") as answers: answers.next(within)``.
    """

    def __init__(self, link: AutopilotLink, names: tuple[str, ...]) -> None:
        self.names = frozenset(names)
        self._link = link
        self._frames: deque[Frame] = deque()
        self._filled = Signal(link.kernel, f"{link.name} ({', '.join(names)})")

    def __enter__(self) -> Self:
        with self._link.kernel.guard:
            self._link.subscriptions.append(self)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        with self._link.kernel.guard:
            self._link.subscriptions.remove(self)

    def add(self, frame: Frame) -> None:
        """Queue a frame. Framework callback."""
        self._frames.append(frame)
        self._filled.notify()

    def next(self, within: Ns) -> Frame | None:
        """Return the next frame, waiting at most *within* ns for it, or None."""
        if self._filled.wait_for(lambda: self._frames, within):
            return self._frames.popleft()
        return None


class AutopilotLink:
    """Sends to one autopilot and keeps its latest messages.

    Args:
        kernel: Clock and wake-ups.
        link: Connection to the autopilot.
        system: Own MAVLink system id.
        component: Own MAVLink component id.
        vehicle: System id of the autopilot; 0 selects the first autopilot that sends a heartbeat.
    """

    def __init__(self, kernel: Kernel, link: Link, system: int, component: int, vehicle: int = 0) -> None:
        self.kernel, self.name = kernel, link.name
        self._link = link
        self._system, self._component = system, component
        self._vehicle = vehicle
        self._published: frozenset[str] | None = None
        self.target: tuple[int, int] = (0, 0)
        self.autopilot = AutopilotType()
        self.last_heartbeat: Ns | None = None
        self.latest: dict[str, ReceivedFrame] = {}
        self.unpublished: list[ReceivedFrame] = []
        self.subscriptions: list[FrameSubscription] = []
        self._received = Signal(kernel, f"{link.name} (frames)")
        link.receive(self._on_frame)

    @property
    def known(self) -> bool:
        """Whether an autopilot has sent a heartbeat."""
        return self.target != (0, 0)

    def _on_frame(self, frame: Frame) -> None:
        name = frame.name
        if self._vehicle not in (0, frame.system):
            return
        if name == "HEARTBEAT" and not self.known and frame.fields["autopilot"] != INVALID_AUTOPILOT:
            self.target = (frame.system, frame.component)
        if (frame.system, frame.component) != self.target:
            return
        now = self.kernel.now()
        if name == "HEARTBEAT":
            self.last_heartbeat = now
            self.autopilot = AutopilotType(frame.fields["autopilot"], frame.fields["type"])
        if name not in _KEPT_ALL:
            last = self.latest.get(name)
            if last is not None and last in self.unpublished:
                self.unpublished.remove(last)
        self.latest[name] = received = ReceivedFrame(frame, now)
        if self._published is None or name in self._published:
            self.unpublished.append(received)
            self._received.notify()
        for subscription in tuple(self.subscriptions):
            if name in subscription.names:
                subscription.add(frame)

    def publish_only(self, names: Iterable[str]) -> None:
        """Queue only frames of these names for publication; others wake no task."""
        self._published = frozenset(names)

    def take_unpublished(self) -> list[ReceivedFrame]:
        """Return and clear the frames queued for publication."""
        taken, self.unpublished = self.unpublished, []
        return taken

    def wait(self, until: Ns) -> None:
        """Block the current task until a frame is queued for publication or the time *until*."""
        within = max(0, until - self.kernel.now())
        self._received.wait_for(lambda: self.unpublished, within, ends_activation=True)

    def last(self, name: str) -> dict[str, Any] | None:
        """Return the fields of the latest frame called *name*, or None."""
        received = self.latest.get(name)
        return received.frame.fields if received else None

    def subscribe(self, *names: str) -> FrameSubscription:
        """Return a subscription to frames of these names, which is a context manager."""
        return FrameSubscription(self, names)

    def send(self, name: str, fields: dict[str, Any]) -> None:
        """Send a message without an addressee."""
        with self.kernel.guard:
            self._link.send(Frame(name, fields, self._system, self._component))

    def pass_on(self, frame: Frame) -> None:
        """Send a message of another sender."""
        with self.kernel.guard:
            self._link.send(frame)

    def send_to_autopilot(self, name: str, fields: dict[str, Any]) -> None:
        """Send a message to the autopilot."""
        system, component = self.target
        if name == "MANUAL_CONTROL":  # the only message that addresses a system but no component
            self.send(name, {"target": system, **fields})
        else:
            to = {"target_system": system, "target_component": component}
            # some have no addressee, or only a system
            known = mavlink_messages.message_type(name).field_names
            self.send(name, {one: value for one, value in to.items() if one in known} | fields)


# -- telemetry streams

ALL, RAW_SENSORS, EXTENDED_STATUS, RC, POSITION, EXTRA1, EXTRA2, EXTRA3 = 0, 1, 2, 3, 6, 10, 11, 12
"""MAV_DATA_STREAM."""
EXTENDED_SYS_STATE, GET_HOME_POSITION, SET_MESSAGE_INTERVAL = 245, 410, 511
REQUEST_PERIOD: Ns = S
MISSING_AFTER: Ns = 3 * S

_INDICATORS = {
    ALL: "ATTITUDE",
    RAW_SENSORS: "RAW_IMU",
    EXTENDED_STATUS: "SYS_STATUS",
    RC: "RC_CHANNELS",
    POSITION: "GLOBAL_POSITION_INT",
    EXTRA1: "ATTITUDE",
    EXTRA2: "VFR_HUD",
    EXTRA3: "SYSTEM_TIME",
}
"""The message that shows whether a stream arrives."""

_PX4_MESSAGES: Mapping[int, tuple[int, ...]] = {
    RAW_SENSORS: (105, 29),
    EXTENDED_STATUS: (1, 24),
    RC: (65, 36),
    POSITION: (33, 32),
    EXTRA1: (30,),
    EXTRA2: (74,),
}
"""Ids of the published messages of each stream for PX4, which sends HIGHRES_IMU instead of RAW_IMU."""
_PX4_INDICATORS = {**_INDICATORS, RAW_SENSORS: "HIGHRES_IMU"}


def request_stream(link: AutopilotLink, stream: int, rate: int) -> None:
    """Request a telemetry stream.

    Args:
        link: Link to the autopilot.
        stream: MAV_DATA_STREAM.
        rate: Hz; 0 stops the stream.
    """
    fields = {"req_stream_id": stream, "req_message_rate": rate, "start_stop": 1 if rate else 0}
    link.send_to_autopilot("REQUEST_DATA_STREAM", fields)


class MissingStreams:
    """Requests the telemetry streams that do not arrive.

    Args:
        link: Link to the autopilot.
        rates: Rates in Hz by MAV_DATA_STREAM.
        home: Whether to request the home position and the landed state as well.
        messages: Rates in Hz of single messages, by name.
    """

    def __init__(
        self,
        link: AutopilotLink,
        rates: Mapping[int, int],
        *,
        home: bool,
        messages: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        self._link, self._rates, self._home = link, rates, home
        self._messages = messages
        self._next: Ns = 0

    def check(self, now: Ns) -> None:
        """Request what is missing, at most once per ``REQUEST_PERIOD``."""
        if not self._link.known or now < self._next:
            return
        self._next = now + REQUEST_PERIOD
        px4 = self._link.autopilot.autopilot == PX4_ID
        indicators = _PX4_INDICATORS if px4 else _INDICATORS
        for stream, rate in self._rates.items():
            received = self._link.latest.get(indicators.get(stream, ""))
            if received is not None and now - received.at <= MISSING_AFTER:
                continue
            if px4:
                self._request_messages(stream, rate)
            else:
                request_stream(self._link, stream, rate)
        for name, hertz in self._messages.items():
            received = self._link.latest.get(name)
            if received is None or now - received.at > max(MISSING_AFTER, round(2 * S / hertz)):
                self._command(SET_MESSAGE_INTERVAL, message_type(name).id, 1e6 / hertz)
        if self._home:
            if "EXTENDED_SYS_STATE" not in self._link.latest:
                self._command(SET_MESSAGE_INTERVAL, EXTENDED_SYS_STATE, 1e6)
            if "HOME_POSITION" not in self._link.latest:
                self._command(GET_HOME_POSITION)

    def _request_messages(self, stream: int, rate: int) -> None:
        streams = _PX4_MESSAGES if stream == ALL else {stream: _PX4_MESSAGES.get(stream, ())}
        for messages in streams.values():
            for number in messages:
                self._command(SET_MESSAGE_INTERVAL, number, 1e6 / max(rate, 1))

    def _command(self, command: int, *parameters: float) -> None:
        fields = {f"param{number}": value for number, value in enumerate(parameters, start=1)}
        self._link.send_to_autopilot("COMMAND_LONG", {"command": command, **fields})
