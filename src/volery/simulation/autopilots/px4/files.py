"""The files of a simulated PX4, which are its logs, and its shell, which has no commands."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from functools import partial
from typing import Any

from volery.base.time import S
from volery.simulation.autopilots.mavlink.channel import Peer
from volery.simulation.autopilots.mavlink.file_service import Content, Encode, FilePolicy
from volery.simulation.autopilots.mavlink.messages import EPOCH_US
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

SHELL, REPLY = 10, 1
"""SERIAL_CONTROL_DEV of the shell, SERIAL_CONTROL_FLAG of an answer."""

SHELL_SIZE = 70
PROMPT = b"nsh> "


_NO_SESSION, _SESSION_TAKEN, _UNKNOWN = 4, 5, 7


def onboard_files(vehicle: AutopilotVehicle, encode: Encode) -> Mapping[str, Content]:
    """Return the logs, named by the date and the time at which each began."""
    files: dict[str, Content] = {}
    for log in vehicle.logs:
        began = datetime.fromtimestamp(EPOCH_US // 1_000_000 + log.started_at // S, UTC)
        files[began.strftime("log/%Y-%m-%d/%H_%M_%S.ulg")] = partial(encode, log)
    return files


FILES = FilePolicy(
    onboard_files,
    relative=False,
    entry_end=b"\0",
    dots=(b"S", b"S"),
    burst=168,
    unopened=_NO_SESSION,
    taken=_SESSION_TAKEN,
    unknown=_UNKNOWN,
    own_session=True,
    expires=0,
)


def on_shell(_vehicle: AutopilotVehicle, fields: dict[str, Any], sender: Peer) -> None:
    """Handle SERIAL_CONTROL: the shell has no commands; other devices do not exist."""
    if fields["device"] != SHELL or fields["flags"] & REPLY:
        return
    typed = bytes(int(byte) for byte in fields["data"][: fields["count"]])
    lines = typed.decode("ascii", "replace").splitlines()
    words = [line.split(maxsplit=1)[0] for line in lines if line.strip()]
    reply = b"".join(f"nsh: {word}: command not found\n".encode() for word in words) + PROMPT
    for start in range(0, len(reply), SHELL_SIZE):
        piece = reply[start : start + SHELL_SIZE]
        data = [*piece, *([0] * (SHELL_SIZE - len(piece)))]
        fields = {"device": SHELL, "flags": REPLY, "timeout": 0, "baudrate": 0, "count": len(piece)}
        sender.send("SERIAL_CONTROL", {**fields, "data": data})
