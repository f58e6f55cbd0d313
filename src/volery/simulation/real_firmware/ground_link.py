"""The connection between a real firmware's telemetry port and the links of a run, in virtual time.

Every link hears all that the firmware says, as behind a router of MAVLink. The connection is read at fixed
times, while the firmware waits for its samples: so a link hears the same at the same time in each run.
"""

from __future__ import annotations

import socket
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Protocol

from volery.base.errors import UsageError
from volery.base.frames import LocalFrame, Vector
from volery.base.time import US, Ns
from volery.links.frame import Frame
from volery.links.link import Link
from volery.links.mavlink_codec import MAVLINK
from volery.links.mavlink_messages import constant, message_type

_ARMED = constant("MAV_MODE_FLAG_SAFETY_ARMED")
_AUTOPILOT = constant("MAV_COMP_ID_AUTOPILOT1")
_READY = constant("MAV_SYS_STATUS_PREARM_CHECK")
_HAS_POSITION = constant("ESTIMATOR_POS_HORIZ_ABS")
_WORST = constant("MAV_SEVERITY_WARNING")
_REAL = constant("MAV_PARAM_TYPE_REAL32")
STATION = 250
"""System id of the requests of this module."""
_LARGEST = 65_536
_RELEASES = (255, ""), (192, "-rc"), (128, "-beta"), (64, "-alpha"), (0, "-dev")
"""Least value of FIRMWARE_VERSION_TYPE, and how a version of that kind is marked."""


class Reported:
    """What a firmware has said of itself last.

    Attributes:
        armed: Whether it is armed.
        custom_mode: Number of its mode, as in HEARTBEAT.
        kind: MAV_TYPE; -1: it has said nothing yet.
        position: Its estimate, east, north, up about the world's origin [m]; None: none yet.
        ready: Whether its arming checks pass.
        located: Whether its estimator has a position.
        texts: Severity and text of what it has said since they were taken from this list.
        complaint: Its last text of a severity of WARNING or worse.
        parameters: Values of its parameters, as far as it was asked for them.
        version: Its version, such as ``4.6.3 (92b0cd78)``; empty: not stated yet.
    """

    def __init__(self, frame: LocalFrame) -> None:
        self.armed = False
        self.custom_mode = 0
        self.kind = -1
        self.position: Vector | None = None
        self.ready = False
        self.located = False
        self.texts: list[tuple[int, str]] = []
        self.complaint = ""
        self.parameters: dict[str, float] = {}
        self.version = ""
        self._frame = frame

    def take(self, message: Frame) -> None:
        """Note what a message of the firmware says."""
        if message.component != _AUTOPILOT:
            return
        fields = message.fields
        if message.name == "HEARTBEAT":
            self.armed = bool(fields["base_mode"] & _ARMED)
            self.custom_mode, self.kind = fields["custom_mode"], fields["type"]
        elif message.name == "GLOBAL_POSITION_INT":
            place = 1e-7 * fields["lat"], 1e-7 * fields["lon"], 1e-3 * fields["alt"]
            self.position = self._frame.to_enu(*place)
        elif message.name == "SYS_STATUS":
            self.ready = bool(fields["onboard_control_sensors_health"] & _READY)
        elif message.name == "EKF_STATUS_REPORT":
            self.located = bool(fields["flags"] & _HAS_POSITION)
        elif message.name == "PARAM_VALUE":
            self.parameters[fields["param_id"]] = fields["param_value"]
        elif message.name == "STATUSTEXT":
            self.texts.append((fields["severity"], fields["text"].strip()))
            if fields["severity"] <= _WORST:
                self.complaint = fields["text"]
        elif message.name == "AUTOPILOT_VERSION":
            self.version = _version(fields["flight_sw_version"], fields["flight_custom_version"])


def _version(number: int, commit: Sequence[int]) -> str:
    """Return a version as people write it.

    Args:
        number: Major, minor and patch number and the kind of release, one byte each.
        commit: Characters of the commit, zeros after them, or its bytes in the reverse order.
    """
    major, minor, patch, kind = number.to_bytes(4, "big")
    octets = bytes(commit)
    text = octets.rstrip(b"\0")
    written = text.decode("ascii") if text.isalnum() else octets[::-1].hex()
    release = next((name for least, name in _RELEASES if kind >= least), "")
    return f"{major}.{minor}.{patch}{release}" + (f" ({written[:8]})" if text else "")


class TelemetryPort(Protocol):
    """Bytes to and from the telemetry port of a firmware; no method waits."""

    def read(self) -> bytes:
        """Return what has arrived."""

    def write(self, octets: bytes) -> None:
        """Send *octets*; without a peer they are lost."""

    def close(self) -> None:
        """Close it."""


class UdpConnection:
    """A bound socket that the firmware sends to. What it says is there before its next question is.

    Args:
        bound: The socket.
        peer: Where the firmware listens; None: where it has sent from last.
    """

    def __init__(self, bound: socket.socket, peer: tuple[str, int] | None = None) -> None:
        self._socket, self._peer, self._learns = bound, peer, peer is None
        bound.setblocking(False)

    def read(self) -> bytes:
        """See ``TelemetryPort``."""
        return b"".join(iter(self.datagram, b""))

    def datagram(self) -> bytes:
        """Return the next datagram; empty: there is none."""
        try:
            octets, sender = self._socket.recvfrom(_LARGEST)
        except OSError:  # nothing more, or nothing listens any more
            return b""
        if self._learns:
            self._peer = sender
        return octets

    def write(self, octets: bytes) -> None:
        """See ``TelemetryPort``."""
        if self._peer is not None:
            with suppress(OSError):  # no peer any more, which the next exchange finds
                self._socket.sendto(octets, self._peer)

    def close(self) -> None:
        """See ``TelemetryPort``; the process closes its sockets."""


class GroundLink:
    """Router between a firmware and the links of a run.

    Args:
        connection: That of the firmware's telemetry port.
        frame: Local frame with the world's origin.
        meet: Lets the firmware reach the present and wait there, so that what is written now is read at this
            instant of virtual time in each run.
    """

    def __init__(self, connection: TelemetryPort, frame: LocalFrame, meet: Callable[[], None]) -> None:
        self.reported = Reported(frame)
        self._connection, self._meet = connection, meet
        self._parser = MAVLINK.parser()
        self._links: list[Link] = []
        self._sent = 0

    def connect(self, link: Link) -> None:
        """Let *link* hear the firmware, and the firmware what arrives over it."""
        self._links.append(link)
        link.receive(self._on_frame)

    def _on_frame(self, message: Frame) -> None:
        self._meet()
        self.write(message)

    def write(self, message: Frame) -> None:
        """Send a message to the firmware, which waits."""
        try:
            octets = MAVLINK.encode(message, self._sent)
        except UsageError:  # a message of another protocol
            return
        self._sent += 1
        self._connection.write(octets)

    def request(self, message: str, period: Ns) -> None:
        """Ask the firmware, which waits, to send a message regularly."""
        self.command("MAV_CMD_SET_MESSAGE_INTERVAL", float(message_type(message).id), period / US)

    def command(self, name: str, *parameters: float) -> None:
        """Send a command of MAV_CMD to the firmware, which waits."""
        fields = {f"param{at}": value for at, value in enumerate(parameters, 1)}
        self.write(Frame("COMMAND_LONG", {"command": constant(name), **fields}, STATION, _AUTOPILOT))

    def ask_parameter(self, name: str) -> None:
        """Ask the firmware, which waits, for a parameter: its answer is among those reported."""
        self.write(Frame("PARAM_REQUEST_READ", {"param_id": name, "param_index": -1}, STATION, _AUTOPILOT))

    def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter of the firmware, which waits: its answer is among those reported."""
        fields = {"param_id": name, "param_value": value, "param_type": _REAL}
        self.write(Frame("PARAM_SET", fields, STATION, _AUTOPILOT))

    def read(self) -> None:
        """Give the links what the firmware, which waits, has said."""
        octets = self._connection.read()
        if not octets:
            return
        for message in self._parser.feed(octets):
            self.reported.take(message)
            for link in self._links:
                link.send(message)

    def close(self) -> None:
        """Close the links and the connection."""
        for link in self._links:
            link.close()
        self._connection.close()
