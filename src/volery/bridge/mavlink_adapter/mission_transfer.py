"""Missions: MAVLink's mission protocol, its items as those of a drone.

There is no item for home: the first one is the first to be flown. What is on board can be told as far as it
was uploaded here.
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
    Operation,
    Say,
    result_of,
)
from volery.bridge.mavlink_adapter.drone_commands import global_position
from volery.links.mavlink_messages import constant, entry_name
from volery.vehicles.mission import ChangeSpeed, Land, MissionItem, ReturnHome, TakeOff, Waypoint

Fields = dict[str, Any]
Send = Callable[[str, Fields], None]

ERROR = constant("MAV_MISSION_ERROR")
INVALID_SEQUENCE = constant("MAV_MISSION_INVALID_SEQUENCE")
ENDINGS: Mapping[int, int] = {
    ACCEPTED: constant("MAV_MISSION_ACCEPTED"),
    UNSUPPORTED: constant("MAV_MISSION_UNSUPPORTED"),
    DENIED: constant("MAV_MISSION_DENIED"),
    CANCELLED: constant("MAV_MISSION_OPERATION_CANCELLED"),
}
"""MAV_MISSION_RESULT by MAV_RESULT; any other is an error."""


@dataclass
class _Upload:
    count: int
    items: list[Fields] = field(default_factory=list)


class MissionTransfer:
    """Takes missions for the drone of *conduct*."""

    def __init__(self, conduct: CommandHandler, send: Send, say: Say) -> None:
        self._conduct, self._send, self._say = conduct, send, say
        self._upload: _Upload | None = None
        self._on_board: list[Fields] | None = None

    def handlers(self) -> Mapping[str, Callable[[Fields], None]]:
        """By the name of the frame."""
        return {
            "MISSION_COUNT": self._count,
            "MISSION_ITEM_INT": self._item,
            "MISSION_REQUEST_LIST": self._list,
            "MISSION_REQUEST_INT": self._request,
            "MISSION_CLEAR_ALL": lambda fields: self._refuse("take its mission away"),
            "MISSION_SET_CURRENT": lambda fields: self._refuse("go on with another item of its mission"),
        }

    def _refuse(self, asked: str) -> None:
        self._end(CapabilityError(f"{self._conduct.drone.name}: nothing here can {asked}"))

    def _end(self, error: VoleryError) -> None:
        self._say(str(error))
        self._answer(result_of(error))

    def _answer(self, result: int) -> None:
        if result != IN_PROGRESS:
            self._send("MISSION_ACK", {"type": ENDINGS.get(result, ERROR)})

    # -- upload

    def _count(self, fields: Fields) -> None:
        if not fields["count"]:
            self._refuse("take its mission away")
            return
        self._upload = _Upload(fields["count"])
        self._send("MISSION_REQUEST_INT", {"seq": 0})

    def _item(self, fields: Fields) -> None:
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
            mission = [self._flown(item) for item in upload.items]
        except VoleryError as error:
            self._end(error)
            return
        body = partial(self._take, mission, upload.items)
        asked = f"take a mission of {upload.count} items"
        self._conduct.command(Operation(asked, body, answered_when_done=True, waits=True), self._answer)

    def _take(self, mission: Sequence[MissionItem], items: list[Fields]) -> None:
        self._conduct.drone.upload_mission(mission)
        self._on_board = items

    def _flown(self, item: Fields) -> MissionItem:
        make = _ITEMS.get(item["command"])
        if make is None:
            wrong = entry_name("MAV_CMD", item["command"])
            known = choices(entry_name("MAV_CMD", number) for number in _ITEMS)
            raise CapabilityError(f"mission item {item['seq']}: no {wrong} here; there is {known}")
        made = make(item)
        if isinstance(made, TakeOff) and isinstance(_place(item).altitude, AMSL):
            return TakeOff(made.height - self._conduct.drone.home.altitude.metres)
        return made

    # -- download

    def _list(self, fields: Fields) -> None:
        if self._on_board is None:
            self._refuse("read the mission on board; there is only what was uploaded here")
        else:
            self._send("MISSION_COUNT", {"count": len(self._on_board)})

    def _request(self, fields: Fields) -> None:
        items, number = self._on_board or (), fields["seq"]
        if number < len(items):
            self._send("MISSION_ITEM_INT", items[number])
        else:
            self._end(UsageError(f"{self._conduct.drone.name}: no item {number} of {len(items)}"))


def _place(item: Fields) -> Any:
    return global_position(item["frame"], item["x"], item["y"], item["z"])


def _landing(item: Fields) -> Land:
    """Without a place: here."""
    return Land(_place(item) if item["x"] or item["y"] else None)


_ITEMS: Mapping[int, Callable[[Fields], MissionItem]] = {
    constant("MAV_CMD_NAV_TAKEOFF"): lambda item: TakeOff(item["z"]),
    constant("MAV_CMD_NAV_WAYPOINT"): lambda item: Waypoint(_place(item), item["param1"], item["param4"]),
    constant("MAV_CMD_DO_CHANGE_SPEED"): lambda item: ChangeSpeed(item["param2"]),
    constant("MAV_CMD_NAV_LAND"): _landing,
    constant("MAV_CMD_NAV_RETURN_TO_LAUNCH"): lambda item: ReturnHome(),
}
