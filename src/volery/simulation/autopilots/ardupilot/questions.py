"""Messages that ArduPilot answers with a message: version, terrain, old fence and rally points, logs, files.

There are no logs and no files on board; the answers say so, as the original's do for what is not there.
"""

from __future__ import annotations

from typing import Any

from volery.simulation.autopilots.ardupilot.fence import FENCE, RALLY
from volery.simulation.autopilots.mavlink.firmware import Asker, Builder, QuestionHandler
from volery.simulation.autopilots.vehicle_state import Vehicle

WARNING = 4
"""MAV_SEVERITY."""

SESSION_END, SESSION_RESET, LIST, OPEN_READ, CHECKSUM = 1, 2, 3, 4, 14
ACK, NAK = 128, 129
"""Operations of FILE_TRANSFER_PROTOCOL."""

FAIL, END_OF_FILE, UNKNOWN, NOT_FOUND = 1, 6, 7, 10
"""Error codes of a NAK."""

READS = frozenset({5, 15})
WRITES = frozenset({6, 7, 8, 9, 10, 11, 12, 13})
FTP_SIZE, HEADER = 251, 12


def _ftp_reply(asked: list[int], error: int | None) -> list[int]:
    """Return the payload of a reply.

    Args:
        asked: Payload of the request.
        error: Error code of a refusal; ``None``: an acknowledgement.
    """
    number = (asked[0] | asked[1] << 8) + 1 & 0xFFFF
    data = [] if error is None else [error]
    head = [number & 0xFF, number >> 8, asked[2], ACK if error is None else NAK, len(data), asked[3]]
    return [*head, 0, 0, *asked[8:HEADER], *data, *([0] * (FTP_SIZE - HEADER - len(data)))]


def _ftp_error(asked: list[int]) -> int | None:
    """Return the error of an operation on an empty file system."""
    operation = asked[3]
    if operation in (0, SESSION_END, SESSION_RESET):
        return None
    if operation == LIST:
        name = bytes(asked[HEADER : HEADER + asked[4]]).strip(b"/\0")
        return END_OF_FILE if name in (b"", b".") else NOT_FOUND
    if operation in (OPEN_READ, CHECKSUM):
        return NOT_FOUND
    return FAIL if operation in READS | WRITES else UNKNOWN


def on_file_transfer(_vehicle: Vehicle, fields: dict[str, Any], asker: Asker) -> None:
    """Handle FILE_TRANSFER_PROTOCOL: the directory is empty."""
    asked = [int(byte) for byte in fields["payload"]]
    asked += [0] * (FTP_SIZE - len(asked))
    asker.answer("FILE_TRANSFER_PROTOCOL", target_network=0, payload=_ftp_reply(asked, _ftp_error(asked)))


def on_log_list(vehicle: Vehicle, _fields: dict[str, Any], asker: Asker) -> None:
    """Handle LOG_REQUEST_LIST: one LOG_ENTRY says that there is none; an armed vehicle sends nothing."""
    if vehicle.armed:
        vehicle.send_text(WARNING, "Disarm for log download")
        return
    asker.send("LOG_ENTRY", {"id": 0, "num_logs": 0, "last_log_num": 0, "time_utc": 0, "size": 0})


def on_terrain_check(_vehicle: Vehicle, fields: dict[str, Any], asker: Asker) -> None:
    """Handle TERRAIN_CHECK: there is no terrain data on board."""
    asker.send("TERRAIN_REPORT", {"lat": fields["lat"], "lon": fields["lon"], "spacing": 0, "pending": 0})


def on_fence_fetch(vehicle: Vehicle, fields: dict[str, Any], asker: Asker) -> None:
    """Handle FENCE_FETCH_POINT, the deprecated form."""
    points, index = vehicle.points.get(FENCE, []), fields["idx"]
    if index >= len(points):
        vehicle.send_text(WARNING, f"Invalid fence point, index past end({index} >= {len(points)})")
        return
    place = {"lat": points[index].x / 1e7, "lng": points[index].y / 1e7}
    asker.answer("FENCE_POINT", idx=index, count=len(points), **place)


def on_rally_fetch(vehicle: Vehicle, fields: dict[str, Any], asker: Asker) -> None:
    """Handle RALLY_FETCH_POINT, the deprecated form."""
    points, index = vehicle.points.get(RALLY, []), fields["idx"]
    if index >= len(points):
        vehicle.send_text(WARNING, "Bad rally point ID")
        return
    point = points[index]
    place = {"lat": point.x, "lng": point.y, "alt": round(point.z), "break_alt": 0, "land_dir": 0, "flags": 0}
    asker.answer("RALLY_POINT", idx=index, count=len(points), **place)


def questions(version: Builder) -> dict[str, QuestionHandler]:
    """Return the handlers by message; *version* builds AUTOPILOT_VERSION."""

    def on_version(vehicle: Vehicle, _fields: dict[str, Any], asker: Asker) -> None:
        asker.send("AUTOPILOT_VERSION", version(vehicle) or {})

    return {
        "AUTOPILOT_VERSION_REQUEST": on_version,
        "FENCE_FETCH_POINT": on_fence_fetch,
        "FILE_TRANSFER_PROTOCOL": on_file_transfer,
        "LOG_REQUEST_LIST": on_log_list,
        "RALLY_FETCH_POINT": on_rally_fetch,
        "TERRAIN_CHECK": on_terrain_check,
    }
