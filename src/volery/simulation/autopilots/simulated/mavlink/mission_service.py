"""MAVLink's mission protocol: upload, download, clear, choose. What an item means is not its business."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from volery.base.time import Ns, S
from volery.kernel.api import Handle
from volery.simulation.autopilots.simulated.mavlink.channel import Peer
from volery.simulation.autopilots.simulated.mavlink.numbers import number
from volery.simulation.autopilots.simulated.plan import Item
from volery.simulation.autopilots.simulated.vehicle import Vehicle

if TYPE_CHECKING:
    from volery.simulation.autopilots.simulated.mavlink.dialect import MavlinkDialect

ACCEPTED, ERROR, UNSUPPORTED, NO_SPACE, INVALID_SEQUENCE, CANCELLED = 0, 1, 3, 4, 13, 15
"""MAV_MISSION_RESULT."""

MISSION, FENCE, RALLY = 0, 1, 2
"""MAV_MISSION_TYPE."""

MOST_ITEMS = 724
ASK_AGAIN: Ns = 1 * S
GIVE_UP: Ns = 8 * S
REQUEST_INT = "MISSION_REQUEST_INT"
GUIDED_ITEM = 2
"""``current`` of an item that is no part of a mission: go there now."""


@dataclass
class _Upload:
    peer: Peer
    count: int
    latest: Ns
    items: list[Item] = field(default_factory=list)
    reminder: Handle | None = None
    by_integers: bool = False
    """Whether the peer refused to be asked otherwise."""


class MissionService:
    """Answers for one vehicle. One upload at a time; whoever starts another one replaces it."""

    def __init__(self, vehicle: Vehicle, dialect: MavlinkDialect) -> None:
        self._vehicle = vehicle
        self._dialect = dialect
        self._kernel = vehicle.kernel
        self._upload: _Upload | None = None

    # -- upload

    def on_count(self, peer: Peer, fields: dict[str, Any]) -> None:
        """MISSION_COUNT: an upload begins."""
        self._drop_upload()
        if fields["mission_type"] != MISSION:
            self._acknowledge(peer, UNSUPPORTED, fields["mission_type"])
        elif fields["count"] > MOST_ITEMS:
            self._acknowledge(peer, NO_SPACE)
        elif fields["count"] == 0:
            self._vehicle.plan.clear()
            self._acknowledge(peer, ACCEPTED)
        else:
            if not self._dialect.upload_habits.keeps_old:
                self._vehicle.plan.clear()
            self._upload = _Upload(peer, fields["count"], self._kernel.now())
            self._ask()

    def _ask(self) -> None:
        upload = self._upload
        if upload is None:
            return
        if self._kernel.now() - upload.latest >= GIVE_UP:
            self._vehicle.say(4, "Mission upload timeout")
            self._acknowledge(upload.peer, CANCELLED)
            self._upload = None
            return
        asked = len(upload.items)
        request = REQUEST_INT if upload.by_integers else self._dialect.upload_habits.asks_with(asked)
        upload.peer.answer(request, seq=asked, mission_type=MISSION)
        upload.reminder = self._kernel.call_at(self._kernel.now() + ASK_AGAIN, self._ask)

    def _drop_upload(self) -> None:
        if self._upload is not None and self._upload.reminder is not None:
            self._upload.reminder.cancel()
        self._upload = None

    def on_item_int(self, peer: Peer, fields: dict[str, Any]) -> None:
        """MISSION_ITEM_INT."""
        self._on_item(peer, fields, fields["x"], fields["y"])

    def on_item(self, peer: Peer, fields: dict[str, Any]) -> None:
        """MISSION_ITEM: coordinates in degrees."""
        self._on_item(peer, fields, round(number(fields["x"]) * 1e7), round(number(fields["y"]) * 1e7))

    def _on_item(self, peer: Peer, fields: dict[str, Any], x: int, y: int) -> None:
        item = Item(
            fields["command"],
            fields["frame"],
            fields["param1"],
            fields["param2"],
            fields["param3"],
            fields["param4"],
            x,
            y,
            fields["z"],
            fields["autocontinue"],
        )
        if fields["current"] == GUIDED_ITEM:
            self._acknowledge(peer, ACCEPTED if self._dialect.go_to_item(self._vehicle, item) else ERROR)
        elif self._upload is None:
            self._acknowledge(peer, ERROR)
        elif fields["seq"] != len(self._upload.items):
            self._acknowledge(peer, INVALID_SEQUENCE)
        else:
            self._take(self._upload, item)

    def _take(self, upload: _Upload, item: Item) -> None:
        stored = self._dialect.stored_item(item)
        if isinstance(stored, int):
            self._drop_upload()
            self._acknowledge(upload.peer, stored)
            return
        upload.items.append(stored)
        upload.latest = self._kernel.now()
        if upload.reminder is not None:
            upload.reminder.cancel()
        if len(upload.items) < upload.count:
            self._ask()
        else:
            self._upload = None
            self._vehicle.plan.replace(upload.items)
            self._acknowledge(upload.peer, ACCEPTED)
            if self._dialect.upload_habits.received:
                self._vehicle.say(6, self._dialect.upload_habits.received)
        self._dialect.mission_grew(self._vehicle, len(upload.items))

    # -- download

    def on_request_list(self, peer: Peer, fields: dict[str, Any]) -> None:
        """MISSION_REQUEST_LIST."""
        kind = fields["mission_type"]
        count = len(self._vehicle.plan) if kind == MISSION else 0
        peer.answer("MISSION_COUNT", count=count, mission_type=kind)

    def on_request_int(self, peer: Peer, fields: dict[str, Any]) -> None:
        """MISSION_REQUEST_INT."""
        item = self._requested(peer, fields)
        if item is not None:
            self._send_item(peer, "MISSION_ITEM_INT", fields["seq"], item, (item.x, item.y))

    def on_request(self, peer: Peer, fields: dict[str, Any]) -> None:
        """MISSION_REQUEST: answered in degrees."""
        item = self._requested(peer, fields)
        if item is not None:
            self._send_item(peer, "MISSION_ITEM", fields["seq"], item, (item.x / 1e7, item.y / 1e7))

    def _requested(self, peer: Peer, fields: dict[str, Any]) -> Item | None:
        sequence, plan = fields["seq"], self._vehicle.plan
        if fields["mission_type"] == MISSION:
            home = self._dialect.home_item(self._vehicle)
            if sequence == 0 and home is not None:
                return home
            if sequence < len(plan):
                return plan[sequence]
        self.on_request_list(peer, fields)
        self._acknowledge(peer, INVALID_SEQUENCE, fields["mission_type"])
        return None

    def _send_item(
        self, peer: Peer, name: str, sequence: int, item: Item, place: tuple[float, float]
    ) -> None:
        x, y = place
        peer.answer(
            name,
            seq=sequence,
            frame=item.frame,
            command=item.command,
            current=int(sequence == self._vehicle.plan.current and sequence > 0),
            autocontinue=item.autocontinue,
            param1=item.param1,
            param2=item.param2,
            param3=item.param3,
            param4=item.param4,
            x=x,
            y=y,
            z=item.z,
            mission_type=MISSION,
        )

    # -- the rest

    def on_clear(self, peer: Peer, fields: dict[str, Any]) -> None:
        """MISSION_CLEAR_ALL: not while the mission is flown."""
        if self._dialect.mission_runs(self._vehicle):
            self._acknowledge(peer, ERROR, fields["mission_type"])
            return
        if fields["mission_type"] in (MISSION, 255):
            self._drop_upload()
            self._vehicle.plan.clear()
        self._acknowledge(peer, ACCEPTED, fields["mission_type"])
        self._dialect.mission_grew(self._vehicle, 0)

    def on_set_current(self, peer: Peer, fields: dict[str, Any]) -> None:
        """MISSION_SET_CURRENT."""
        if self._vehicle.choose_item(fields["seq"]):
            peer.channel.send(
                "MISSION_CURRENT", self._dialect.messages["MISSION_CURRENT"](self._vehicle) or {}
            )

    def on_ack(self, peer: Peer, fields: dict[str, Any]) -> None:
        """MISSION_ACK: a download has ended, or the question for an item is not understood."""
        upload = self._upload
        refused = upload is not None and fields["type"] == UNSUPPORTED and not upload.by_integers
        if upload is not None and refused and self._dialect.upload_habits.turns_to_integers:
            upload.by_integers = True
            if upload.reminder is not None:
                upload.reminder.cancel()
            self._ask()

    def _acknowledge(self, peer: Peer, result: int, kind: int = MISSION) -> None:
        peer.answer("MISSION_ACK", type=result, mission_type=kind)
