"""MAVLink's microservices for one vehicle: commands, parameters and missions.

Each service parses and answers the messages of its protocol. What a command or a mission item does is the
firmware's; message intervals and requests for single messages concern the link and are handled here.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from math import isfinite
from typing import Any
from zlib import crc32

from volery.base.time import MS, US, Ns
from volery.kernel.api import Handle
from volery.links.mavlink_messages import constant, from_bytewise, message_type_of, to_bytewise
from volery.simulation.autopilots.autopilot_parameters import StoredParameter, quantised
from volery.simulation.autopilots.mavlink.channel import MavlinkChannel, Peer
from volery.simulation.autopilots.mavlink.firmware import MavlinkFirmware, ParameterPolicy
from volery.simulation.autopilots.mavlink.messages import (
    ACCEPTED,
    FAILED,
    UNSUPPORTED,
    Command,
    finite,
    from_int,
    from_long,
)
from volery.simulation.autopilots.onboard_mission import MissionItem, coordinate_scale
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

# --- commands ---

GET_MESSAGE_INTERVAL, SET_MESSAGE_INTERVAL, REQUEST_MESSAGE = 510, 511, 512
REQUEST_CAPABILITIES = 520


UNKNOWN, NOT_SENT = 0, -1
"""Intervals in MESSAGE_INTERVAL of a message that is not known, and of one that is not sent."""
LARGEST_REPORTED = 65_535
"""Largest number of a message that MESSAGE_INTERVAL can report."""


class CommandService:
    """Command protocol of one vehicle."""

    def __init__(self, vehicle: AutopilotVehicle, firmware: MavlinkFirmware) -> None:
        self._vehicle = vehicle
        self._firmware = firmware
        self._own: dict[int, Callable[[Peer, Command], int]] = {
            GET_MESSAGE_INTERVAL: self._get_interval,
            SET_MESSAGE_INTERVAL: self._set_interval,
            REQUEST_MESSAGE: self._request_message,
            REQUEST_CAPABILITIES: lambda peer, _: self._send(peer, "AUTOPILOT_VERSION"),
        }

    def on_long(self, peer: Peer, fields: dict[str, Any]) -> None:
        """Handle COMMAND_LONG."""
        self._perform(peer, from_long(fields, self._reads_nan(fields)))

    def on_int(self, peer: Peer, fields: dict[str, Any]) -> None:
        """Handle COMMAND_INT."""
        self._perform(peer, from_int(fields, self._reads_nan(fields)))

    def _reads_nan(self, fields: dict[str, Any]) -> bool:
        policy = self._firmware.commands
        return policy.reads_nan or fields["command"] in policy.nan_commands

    def _perform(self, peer: Peer, command: Command) -> None:
        result: int | None
        if own := self._own.get(command.number):
            result = own(peer, command)
        elif handler := self._firmware.commands.commands.get(command.number):
            result = handler(self._vehicle, command._replace(sender=(peer.system, peer.component)))
        else:
            result = UNSUPPORTED
        if result is not None:
            self.acknowledge(peer, command.number, result)

    def acknowledge(self, peer: Peer, number: int, result: int) -> None:
        """Send the COMMAND_ACK of command *number* with a MAV_RESULT."""
        peer.answer("COMMAND_ACK", command=number, result=result, progress=0, result_param2=0)

    # -- messages on request

    def _get_interval(self, peer: Peer, command: Command) -> int:
        number = round(finite(command.param1))
        name = self._name(number)
        interval = UNKNOWN if name is None else peer.channel.streams.period(name) // US or NOT_SENT
        if 0 <= number <= LARGEST_REPORTED:
            peer.channel.send("MESSAGE_INTERVAL", {"message_id": number, "interval_us": interval})
        return FAILED if name is None else ACCEPTED

    def _set_interval(self, peer: Peer, command: Command) -> int:
        number, interval = round(finite(command.param1)), finite(command.param2)
        name = self._name(number)
        if name is None:
            return self._firmware.telemetry.refuse_interval(self._vehicle, number)
        if self._vehicle.uptime() < self._firmware.telemetry.intervals_after:
            return ACCEPTED
        if interval == 0.0:
            period = peer.channel.requested.get(name, peer.channel.usual.get(name, 0))
        else:
            period = max(MS, round(interval) * US // MS * MS) if interval > 0 else 0
        peer.channel.streams.set((name,), period)
        return ACCEPTED

    def _request_message(self, peer: Peer, command: Command) -> int:
        name = self._name(round(finite(command.param1)))
        if name is None:
            return self._firmware.telemetry.unknown_message
        if not self._firmware.telemetry.build(name, self._vehicle):
            return self._firmware.telemetry.nothing_to_send
        return self._send(peer, name)

    def _send(self, peer: Peer, name: str) -> int:
        """Send a message after the acknowledgement."""

        def send() -> None:
            for fields in self._firmware.telemetry.build(name, self._vehicle):
                peer.channel.send(name, fields)

        self._vehicle.output.after_reply(send)
        return ACCEPTED

    def _name(self, number: int) -> str | None:
        kind = message_type_of(number)
        return kind.name if kind is not None and kind.name in self._firmware.telemetry.messages else None


# --- parameters ---

UNSOLICITED = 65535
"""Index of a PARAM_VALUE outside of a list."""

DOES_NOT_EXIST, VALUE_OUT_OF_RANGE, PERMISSION_DENIED = 1, 2, 3
"""MAV_PARAM_ERROR."""
NO_INDEX = -1

UINT32 = 5
"""MAV_PARAM_TYPE of a checksum."""

_REAL = struct.Struct("<f")


class ParameterService:
    """Parameter protocol of one vehicle."""

    def __init__(self, vehicle: AutopilotVehicle, policy: ParameterPolicy) -> None:
        self._vehicle = vehicle
        self._kernel = vehicle.kernel
        self._policy = policy

    def unlisted(self, name: str) -> dict[str, Any] | None:
        """Return the fields of a PARAM_VALUE outside of a list, or ``None`` if there is no such parameter."""
        if name == self._policy.checksum and name:
            return self._fields(self._checksum(), UNSOLICITED)
        found = self._vehicle.parameters.find(name)
        if found is None:
            return None
        keeps = self._policy.keeps_index
        return self._fields(found, self._vehicle.parameters.index(name) if keeps else UNSOLICITED)

    def _fields(self, parameter: StoredParameter, index: int) -> dict[str, Any]:
        name, kind, value, _ = parameter
        return {
            "param_id": name,
            "param_value": to_bytewise(kind, value) if self._policy.bytewise else value,
            "param_type": kind,
            "param_count": len(self._vehicle.parameters),
            "param_index": index,
        }

    def _checksum(self) -> StoredParameter:
        """Return a checksum over names and values as a parameter."""
        total = 0
        for name, kind, value, _ in self._vehicle.parameters:
            total = crc32(name.encode() + _REAL.pack(to_bytewise(kind, value)), total)
        return StoredParameter(self._policy.checksum, UINT32, float(total))

    def on_list(self, peer: Peer, _fields: dict[str, Any]) -> None:
        """Handle PARAM_REQUEST_LIST."""
        if self._policy.checksum:
            peer.channel.send("PARAM_VALUE", self._fields(self._checksum(), UNSOLICITED))
        self._burst(peer.channel, 0)

    def _burst(self, channel: MavlinkChannel, start: int) -> None:
        parameters = self._vehicle.parameters
        end = min(start + self._policy.burst, len(parameters))
        for index in range(start, end):
            channel.send("PARAM_VALUE", self._fields(parameters.at(index), index))
        if end < len(parameters):
            self._kernel.call_at(self._kernel.now() + self._policy.period, lambda: self._burst(channel, end))

    def on_read(self, peer: Peer, fields: dict[str, Any]) -> None:
        """Handle PARAM_REQUEST_READ, by name or by index."""
        index = fields["param_index"]
        if index >= len(self._vehicle.parameters):
            self._report(peer, fields, DOES_NOT_EXIST)
            return
        name = fields["param_id"] if index < 0 else self._vehicle.parameters.at(index).name
        self._kernel.call_at(
            self._kernel.now() + self._policy.read_delay, lambda: self._send_value(peer, name, index)
        )

    def _report(self, peer: Peer, asked: dict[str, Any], error: int) -> None:
        """Answer with PARAM_ERROR, where the firmware does."""
        if self._policy.reports_missing:
            name, index = asked["param_id"], asked.get("param_index", NO_INDEX)
            peer.answer("PARAM_ERROR", param_id=name, param_index=index, error=error)

    def on_set(self, peer: Peer, fields: dict[str, Any]) -> None:
        """Handle PARAM_SET: report the new value on all links; else at most PARAM_ERROR."""
        name, kind, value = fields["param_id"], fields["param_type"], fields["param_value"]
        found = self._vehicle.parameters.find(name)
        if found is None:
            self._report(peer, fields, DOES_NOT_EXIST)
        if found is None or (self._policy.typed and kind != found.type):
            return
        value = from_bytewise(found.type, value) if self._policy.bytewise else value
        changes = isfinite(value) and quantised(found.type, value) != found.value
        if changes and not self._vehicle.parameters.has_effect(name):
            self._vehicle.send_text(4, f"Param write denied ({name})")
            self._report(peer, fields, PERMISSION_DENIED)
            self._vehicle.output.parameter_changed(name)
            return
        if not self._vehicle.set_parameter(name, value):
            self._report(peer, fields, VALUE_OUT_OF_RANGE)

    def _send_value(self, peer: Peer, name: str, index: int) -> None:
        fields = self.unlisted(name)
        if fields is None:
            self._report(peer, {"param_id": name, "param_index": index}, DOES_NOT_EXIST)
        else:
            peer.channel.send("PARAM_VALUE", fields if index < 0 else {**fields, "param_index": index})


# --- missions ---

MISSION_ACCEPTED = constant("MAV_MISSION_ACCEPTED")
MISSION_ERROR = constant("MAV_MISSION_ERROR")
MISSION_UNSUPPORTED = constant("MAV_MISSION_UNSUPPORTED")
NO_SPACE = constant("MAV_MISSION_NO_SPACE")
INVALID_SEQUENCE = constant("MAV_MISSION_INVALID_SEQUENCE")

MISSION, FENCE, RALLY = 0, 1, 2
"""MAV_MISSION_TYPE."""

MAX_ITEMS = 724
REQUEST_INT = "MISSION_REQUEST_INT"
GUIDED_ITEM = 2
"""``current`` of an item outside of a mission: a destination for now."""


def _to_int32(value: float) -> int:
    return min(2**31 - 1, max(-(2**31), round(finite(value))))


@dataclass
class _MissionUpload:
    peer: Peer
    count: int
    latest: Ns
    kind: int = 0
    """MAV_MISSION_TYPE."""
    first: int = 0
    """Number of the first item: above 0 only where a part of the mission is replaced."""
    part: bool = False
    items: list[MissionItem] = field(default_factory=list)
    reminder: Handle | None = None
    by_integers: bool = False
    """Whether the peer has refused other requests."""


class MissionService:
    """Mission protocol of one vehicle. A new upload replaces one in progress."""

    def __init__(self, vehicle: AutopilotVehicle, firmware: MavlinkFirmware) -> None:
        self._vehicle = vehicle
        self._firmware = firmware
        self._kernel = vehicle.kernel
        self._upload: _MissionUpload | None = None

    # -- upload

    def on_count(self, peer: Peer, fields: dict[str, Any]) -> None:
        """Handle MISSION_COUNT: begin an upload."""
        self._drop_upload()
        kind = fields["mission_type"]
        if kind != MISSION and not self._stores(kind):
            self._acknowledge(peer, MISSION_UNSUPPORTED, kind)
        elif fields["count"] > MAX_ITEMS:
            self._acknowledge(peer, NO_SPACE, kind)
        elif fields["count"] == 0:
            self._clear(kind)
            self._acknowledge(peer, MISSION_ACCEPTED, kind)
        else:
            if kind == MISSION and not self._firmware.missions.upload.keeps_old:
                self._vehicle.mission.clear()
            self._upload = _MissionUpload(peer, fields["count"], self._kernel.now(), kind)
            self._request_item()

    def on_partial(self, peer: Peer, fields: dict[str, Any]) -> None:
        """Handle MISSION_WRITE_PARTIAL_LIST: request the items that replace a part of the mission."""
        self._drop_upload()
        first, last = fields["start_index"], fields["end_index"]
        if fields["mission_type"] != MISSION:
            self._acknowledge(peer, MISSION_UNSUPPORTED, fields["mission_type"])
        elif not 0 <= first <= last <= len(self._vehicle.mission):
            self._vehicle.send_text(4, "Flight plan update rejected")
            self._acknowledge(peer, MISSION_ERROR)
        else:
            self._upload = _MissionUpload(peer, last - first + 1, self._kernel.now(), first=first, part=True)
            self._request_item()

    def _stores(self, kind: int) -> bool:
        """Return whether a list of that MAV_MISSION_TYPE is stored beside the mission."""
        return kind in (FENCE, RALLY) and self._firmware.missions.stored_point is not None

    def _clear(self, kind: int) -> None:
        if kind == MISSION:
            self._vehicle.mission.clear()
        else:
            self._store_points(kind, [])

    def _store_points(self, kind: int, points: list[MissionItem]) -> None:
        self._vehicle.points[kind] = points
        self._firmware.missions.points_changed(self._vehicle, kind)

    def _request_item(self) -> None:
        upload = self._upload
        if upload is None:
            return
        policy = self._firmware.missions.upload
        if self._kernel.now() - upload.latest >= policy.gives_up_after:
            result = policy.gives_up(self._vehicle)
            if result is not None:
                self._acknowledge(upload.peer, result, upload.kind)
            self._upload = None
            return
        index = upload.first + len(upload.items)
        request = REQUEST_INT if upload.by_integers else policy.request(index)
        upload.peer.answer(request, seq=index, mission_type=upload.kind)
        upload.reminder = self._kernel.call_at(self._kernel.now() + policy.request_period, self._request_item)

    def _drop_upload(self) -> None:
        if self._upload is not None and self._upload.reminder is not None:
            self._upload.reminder.cancel()
        self._upload = None

    def on_item_int(self, peer: Peer, fields: dict[str, Any]) -> None:
        """Handle MISSION_ITEM_INT."""
        self._on_item(peer, fields, fields["x"], fields["y"])

    def on_item(self, peer: Peer, fields: dict[str, Any]) -> None:
        """Handle MISSION_ITEM, whose coordinates are degrees."""
        scale = coordinate_scale(fields["command"], fields["frame"])
        self._on_item(peer, fields, _to_int32(fields["x"] * scale), _to_int32(fields["y"] * scale))

    def _on_item(self, peer: Peer, fields: dict[str, Any], x: int, y: int) -> None:
        item = MissionItem(
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
            self._acknowledge(
                peer,
                MISSION_ACCEPTED
                if self._firmware.missions.go_to_item(self._vehicle, item)
                else MISSION_ERROR,
            )
        elif self._upload is None:
            self._acknowledge(peer, MISSION_ERROR)
        elif fields["seq"] != self._upload.first + len(self._upload.items):
            self._acknowledge(peer, INVALID_SEQUENCE)
        else:
            self._store(self._upload, item)

    def _store(self, upload: _MissionUpload, item: MissionItem) -> None:
        convert = self._firmware.missions.stored_point
        if upload.kind == MISSION or convert is None:
            stored = self._firmware.missions.stored_item(item)
        else:
            stored = convert(upload.kind, item)
        if isinstance(stored, int):
            self._drop_upload()
            self._firmware.missions.item_refused(self._vehicle)
            self._acknowledge(upload.peer, stored, upload.kind)
            return
        upload.items.append(stored)
        upload.latest = self._kernel.now()
        if upload.reminder is not None:
            upload.reminder.cancel()
        if len(upload.items) < upload.count:
            self._request_item()
        else:
            self._finish(upload)
        if upload.kind == MISSION and not upload.part:
            self._firmware.missions.grew(self._vehicle, len(upload.items))

    def _finish(self, upload: _MissionUpload) -> None:
        """Put a complete upload in force and acknowledge it."""
        self._upload = None
        if upload.kind != MISSION:
            if self._firmware.missions.refuses_points(self._vehicle, upload.kind, upload.items):
                self._acknowledge(upload.peer, MISSION_ERROR, upload.kind)
                return
            self._store_points(upload.kind, upload.items)
        elif upload.part:
            self._vehicle.mission.items[upload.first : upload.first + upload.count] = upload.items
        else:
            self._vehicle.mission.replace(upload.items)
        self._acknowledge(upload.peer, MISSION_ACCEPTED, upload.kind)
        if upload.kind == MISSION and self._firmware.missions.upload.received:
            self._vehicle.send_text(6, self._firmware.missions.upload.received)

    # -- download

    def on_request_list(self, peer: Peer, fields: dict[str, Any]) -> None:
        """Handle MISSION_REQUEST_LIST."""
        kind = fields["mission_type"]
        if self._firmware.missions.stored_point is not None and kind not in (MISSION, FENCE, RALLY):
            self._acknowledge(peer, MISSION_UNSUPPORTED, kind)
            return
        count = len(self._vehicle.mission) if kind == MISSION else len(self._points(kind))
        peer.answer("MISSION_COUNT", count=count, mission_type=kind, **self._id_of(kind))

    def on_request_int(self, peer: Peer, fields: dict[str, Any]) -> None:
        """Handle MISSION_REQUEST_INT."""
        item = self._requested(peer, fields)
        if item is not None:
            self._send_item(peer, "MISSION_ITEM_INT", fields, item, (item.x, item.y))

    def on_request(self, peer: Peer, fields: dict[str, Any]) -> None:
        """Handle MISSION_REQUEST; the answer is in degrees."""
        item = self._requested(peer, fields)
        if item is not None:
            scale = coordinate_scale(item.command, item.frame)
            self._send_item(peer, "MISSION_ITEM", fields, item, (item.x / scale, item.y / scale))

    def _points(self, kind: int) -> list[MissionItem]:
        """Return the points of the fence, or the rally points."""
        return self._vehicle.points.get(kind, [])

    def _requested(self, peer: Peer, fields: dict[str, Any]) -> MissionItem | None:
        sequence: int = fields["seq"]
        plan = self._vehicle.mission
        if fields["mission_type"] == MISSION:
            home = self._firmware.missions.home_item(self._vehicle)
            if sequence == 0 and home is not None:
                return home
            if sequence < len(plan):
                return plan[sequence]
        points = self._points(fields["mission_type"])
        if sequence < len(points):
            return points[sequence]
        self.on_request_list(peer, fields)
        self._acknowledge(peer, INVALID_SEQUENCE, fields["mission_type"])
        return None

    def _send_item(
        self, peer: Peer, name: str, asked: dict[str, Any], item: MissionItem, place: tuple[float, float]
    ) -> None:
        sequence, kind, (x, y) = asked["seq"], asked["mission_type"], place
        peer.answer(
            name,
            seq=sequence,
            frame=item.frame,
            command=item.command,
            current=int(kind == MISSION and sequence == self._vehicle.mission.current and sequence > 0),
            autocontinue=item.autocontinue,
            param1=item.param1,
            param2=item.param2,
            param3=item.param3,
            param4=item.param4,
            x=x,
            y=y,
            z=item.z,
            mission_type=kind if self._firmware.missions.names_lists else MISSION,
        )

    # -- the rest

    def on_clear(self, peer: Peer, fields: dict[str, Any]) -> None:
        """Handle MISSION_CLEAR_ALL, which fails while the mission is flown."""
        if self._firmware.missions.runs(self._vehicle):
            self._acknowledge(peer, MISSION_ERROR, fields["mission_type"])
            return
        if fields["mission_type"] in (MISSION, 255):
            self._drop_upload()
            self._vehicle.mission.clear()
        for kind in (FENCE, RALLY):
            if fields["mission_type"] in (kind, 255) and self._stores(kind):
                self._clear(kind)
        self._acknowledge(peer, MISSION_ACCEPTED, fields["mission_type"])
        if fields["mission_type"] in (MISSION, 255):
            self._firmware.missions.grew(self._vehicle, 0)

    def on_set_current(self, peer: Peer, fields: dict[str, Any]) -> None:
        """Handle MISSION_SET_CURRENT."""
        if self._vehicle.choose_item(fields["seq"]):
            for current in self._firmware.telemetry.build("MISSION_CURRENT", self._vehicle):
                peer.channel.send("MISSION_CURRENT", current)

    def on_ack(self, peer: Peer, fields: dict[str, Any]) -> None:
        """Handle MISSION_ACK: the end of a download, or the refusal of a request for an item."""
        upload = self._upload
        refused = upload is not None and fields["type"] == MISSION_UNSUPPORTED and not upload.by_integers
        if upload is not None and refused and self._firmware.missions.upload.falls_back_to_int:
            upload.by_integers = True
            if upload.reminder is not None:
                upload.reminder.cancel()
            self._request_item()

    def _acknowledge(self, peer: Peer, result: int, kind: int = MISSION) -> None:
        peer.answer("MISSION_ACK", type=result, mission_type=kind, **self._id_of(kind))

    def _id_of(self, kind: int) -> dict[str, int]:
        """Return the field that identifies a list, where the firmware sends one."""
        list_id = self._firmware.missions.list_id
        return {} if list_id is None else {"opaque_id": list_id(self._vehicle, kind)}
