"""MAVLink's log protocol of one vehicle: list, data, end and erase.

A log is sent in pieces of 90 bytes, some at a time so that telemetry goes on beside, and only while the link
has room. What does not exist is not answered, as by the originals.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from volery.base.time import MS, Ns, S
from volery.kernel.api import Handle
from volery.simulation.autopilots.mavlink.channel import Peer
from volery.simulation.autopilots.mavlink.messages import EPOCH_US
from volery.simulation.autopilots.onboard_log import FlightLog
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import WARNING

PIECE = 90
"""Bytes of a LOG_DATA."""
BURST = 50
"""Pieces that are sent at once."""
PERIOD: Ns = 10 * MS
"""Time between two bursts."""


class LogPolicy(NamedTuple):
    """How a firmware writes and lists its logs."""

    encode: Callable[[FlightLog], bytes]
    """Return a log in the firmware's format."""
    first: int
    """Number of the first log."""
    while_armed: bool
    """Whether logs are listed and sent while the vehicle is armed."""


@dataclass
class _Transfer:
    peer: Peer
    number: int
    data: bytes
    place: int
    end: int
    timer: Handle | None = None


class LogService:
    """Log protocol of one vehicle. A new request replaces one that is being answered.

    Args:
        vehicle: The vehicle, with its logs.
        policy: What differs between firmwares.
    """

    def __init__(self, vehicle: AutopilotVehicle, policy: LogPolicy) -> None:
        self._vehicle = vehicle
        self._policy = policy
        self._transfer: _Transfer | None = None

    def content(self, log: FlightLog) -> bytes:
        """Return a log as a file."""
        if log.encoded is None:
            log.encoded = self._policy.encode(log)
        return log.encoded

    def _is_refused(self) -> bool:
        """Return whether the vehicle is armed and its firmware does not answer then; a text says so."""
        if self._policy.while_armed or not self._vehicle.armed:
            return False
        self._vehicle.send_text(WARNING, "Disarm for log download")
        return True

    def on_list(self, peer: Peer, fields: dict[str, Any]) -> None:
        """Handle LOG_REQUEST_LIST: one LOG_ENTRY a log, or one that says that there is none."""
        if self._is_refused():
            return
        logs, first = self._vehicle.logs, self._policy.first
        if not logs:
            peer.send("LOG_ENTRY", {"id": 0, "num_logs": 0, "last_log_num": 0, "time_utc": 0, "size": 0})
        last = first + len(logs) - 1
        for number, log in enumerate(logs, first):
            if fields["start"] <= number <= fields["end"]:
                entry = {"id": number, "num_logs": len(logs), "last_log_num": last}
                ended = EPOCH_US // 1_000_000 + log.ended_at // S
                peer.send("LOG_ENTRY", {**entry, "time_utc": ended, "size": len(self.content(log))})

    def on_data(self, peer: Peer, fields: dict[str, Any]) -> None:
        """Handle LOG_REQUEST_DATA; from its end on, a log is answered with an empty piece."""
        index = fields["id"] - self._policy.first
        if self._is_refused() or not 0 <= index < len(self._vehicle.logs):
            return
        self._stop()
        data = self.content(self._vehicle.logs[index])
        place = min(fields["ofs"], len(data))
        end = min(place + fields["count"], len(data))
        self._transfer = _Transfer(peer, fields["id"], data, place, end)
        if place == end:
            self._send_piece(self._transfer)
        self._send_burst()

    def _send_burst(self) -> None:
        transfer = self._transfer
        if transfer is None:
            return
        for _ in range(BURST):
            if not transfer.peer.channel.has_room():
                break
            if transfer.place >= transfer.end:
                self._transfer = None
                return
            self._send_piece(transfer)
        kernel = self._vehicle.kernel
        transfer.timer = kernel.call_at(kernel.now() + PERIOD, self._send_burst)

    def _send_piece(self, transfer: _Transfer) -> None:
        place = transfer.place
        piece = transfer.data[place : min(place + PIECE, transfer.end)]
        transfer.place += len(piece)
        fields = {
            "id": transfer.number,
            "ofs": place,
            "count": len(piece),
            "data": [*piece.ljust(PIECE, b"\0")],
        }
        transfer.peer.send("LOG_DATA", fields)

    def _stop(self) -> None:
        if self._transfer is not None and self._transfer.timer is not None:
            self._transfer.timer.cancel()
        self._transfer = None

    def on_end(self, _peer: Peer, _fields: dict[str, Any]) -> None:
        """Handle LOG_REQUEST_END: nothing more of a log is sent."""
        self._stop()

    def on_erase(self, _peer: Peer, _fields: dict[str, Any]) -> None:
        """Handle LOG_ERASE: all logs are erased."""
        self._stop()
        self._vehicle.logs.clear()
