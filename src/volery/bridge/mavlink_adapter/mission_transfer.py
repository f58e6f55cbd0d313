"""MAVLink's mission protocol for a drone: upload, and download of what was uploaded.

There is no item for home: the first item is the first to be flown. Only a mission that was uploaded through
the adapter can be downloaded.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from volery.base.errors import CapabilityError, UsageError, VoleryError, choices
from volery.base.position import AMSL
from volery.bridge.mavlink_adapter.command_handler import (
    ACCEPTED,
    CANCELLED,
    DENIED,
    IN_PROGRESS,
    UNSUPPORTED,
    CommandHandler,
    DroneOperation,
    Report,
    result_of,
)
from volery.bridge.mavlink_adapter.drone_commands import global_position
from volery.links.mavlink_messages import constant, entry_name
from volery.vehicles.driver import ChangeSpeed, Land, MissionItem, ReturnHome, TakeOff, Waypoint

Fields = dict[str, Any]
Send = Callable[[str, Fields], None]

ERROR = constant("MAV_MISSION_ERROR")
INVALID_SEQUENCE = constant("MAV_MISSION_INVALID_SEQUENCE")
MISSION_RESULTS: Mapping[int, int] = {
    ACCEPTED: constant("MAV_MISSION_ACCEPTED"),
    UNSUPPORTED: constant("MAV_MISSION_UNSUPPORTED"),
    DENIED: constant("MAV_MISSION_DENIED"),
    CANCELLED: constant("MAV_MISSION_OPERATION_CANCELLED"),
}
"""MAV_MISSION_RESULT by MAV_RESULT; any other result is an error."""


@dataclass
class _Upload:
    count: int
    items: list[Fields] = field(default_factory=list)


class MissionTransfer:
    """Handlers of the mission protocol for the drone of *commands*."""

    def __init__(self, commands: CommandHandler, send: Send, report: Report) -> None:
        self._commands, self._send, self._report = commands, send, report
        self._upload: _Upload | None = None
        self._on_board: list[Fields] | None = None

    def handlers(self) -> Mapping[str, Callable[[Fields], None]]:
        """Return the handlers by message name."""
        return {
            "MISSION_COUNT": self._handle_count,
            "MISSION_ITEM_INT": self._handle_item,
            "MISSION_REQUEST_LIST": self._handle_request_list,
            "MISSION_REQUEST_INT": self._handle_request,
            "MISSION_CLEAR_ALL": lambda fields: self._refuse("take its mission away"),
            "MISSION_SET_CURRENT": lambda fields: self._refuse("go on with another item of its mission"),
        }

    def _refuse(self, request: str) -> None:
        self._fail(CapabilityError(f"{self._commands.drone.name}: nothing here can {request}"))

    def _fail(self, error: VoleryError) -> None:
        self._report(str(error))
        self._answer(result_of(error))

    def _answer(self, result: int) -> None:
        if result != IN_PROGRESS:
            self._send("MISSION_ACK", {"type": MISSION_RESULTS.get(result, ERROR)})

    # -- upload

    def _handle_count(self, fields: Fields) -> None:
        if not fields["count"]:
            self._refuse("take its mission away")
            return
        self._upload = _Upload(fields["count"])
        self._send("MISSION_REQUEST_INT", {"seq": 0})

    def _handle_item(self, fields: Fields) -> None:
        upload = self._upload
        if upload is None or fields["seq"] != len(upload.items):
            self._send("MISSION_ACK", {"type": INVALID_SEQUENCE})
            return
        upload.items.append(fields)
        if len(upload.items) < upload.count:
            self._send("MISSION_REQUEST_INT", {"seq": len(upload.items)})
            return
        self._upload = None
        try:
            mission = [self._mission_item(item) for item in upload.items]
        except VoleryError as error:
            self._fail(error)
            return
        body = partial(self._upload_mission, mission, upload.items)
        description = f"take a mission of {upload.count} items"
        operation = DroneOperation(description, body, answered_when_done=True, waits=True)
        self._commands.execute(operation, self._answer)

    def _upload_mission(self, mission: Sequence[MissionItem], items: list[Fields]) -> None:
        self._commands.drone.upload_mission(mission)
        self._on_board = items

    def _mission_item(self, item: Fields) -> MissionItem:
        make = _ITEMS.get(item["command"])
        if make is None:
            name = entry_name("MAV_CMD", item["command"])
            known = choices(entry_name("MAV_CMD", number) for number in _ITEMS)
            raise CapabilityError(f"mission item {item['seq']}: no {name} here; there is {known}")
        made = make(item)
        if isinstance(made, TakeOff) and isinstance(_position(item).altitude, AMSL):
            return TakeOff(made.height - self._commands.drone.home.altitude.metres)
        return made

    # -- download

    def _handle_request_list(self, fields: Fields) -> None:
        if self._on_board is None:
            self._refuse("read the mission on board; there is only what was uploaded here")
        else:
            self._send("MISSION_COUNT", {"count": len(self._on_board)})

    def _handle_request(self, fields: Fields) -> None:
        items, number = self._on_board or (), fields["seq"]
        if number < len(items):
            self._send("MISSION_ITEM_INT", items[number])
        else:
            self._fail(UsageError(f"{self._commands.drone.name}: no item {number} of {len(items)}"))


def _position(item: Fields) -> Any:
    return global_position(item["frame"], item["x"], item["y"], item["z"])


_ITEMS: Mapping[int, Callable[[Fields], MissionItem]] = {
    constant("MAV_CMD_NAV_TAKEOFF"): lambda item: TakeOff(item["z"]),
    constant("MAV_CMD_NAV_WAYPOINT"): lambda item: Waypoint(_position(item), item["param1"], item["param4"]),
    constant("MAV_CMD_DO_CHANGE_SPEED"): lambda item: ChangeSpeed(item["param2"]),
    # Without coordinates the landing place is the current position.
    constant("MAV_CMD_NAV_LAND"): lambda item: Land(_position(item) if item["x"] or item["y"] else None),
    constant("MAV_CMD_NAV_RETURN_TO_LAUNCH"): lambda item: ReturnHome(),
}
