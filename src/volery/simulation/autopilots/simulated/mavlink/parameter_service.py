"""MAVLink's parameter protocol: list, read and set."""

from __future__ import annotations

import struct
from typing import Any
from zlib import crc32

from volery.links.parameter_values import as_bytes, from_bytes
from volery.simulation.autopilots.simulated.mavlink.channel import Channel, Peer
from volery.simulation.autopilots.simulated.mavlink.habits import ParameterHabits
from volery.simulation.autopilots.simulated.parameters import Parameter
from volery.simulation.autopilots.simulated.vehicle import Vehicle

UNSOLICITED = 65535
"""The index of a value that nobody listed."""

UINT32 = 5
"""MAV_PARAM_TYPE of a checksum."""

_REAL = struct.Struct("<f")


class ParameterService:
    """Answers for one vehicle."""

    def __init__(self, vehicle: Vehicle, habits: ParameterHabits) -> None:
        self._vehicle = vehicle
        self._kernel = vehicle.kernel
        self._habits = habits

    def unlisted(self, name: str) -> dict[str, Any] | None:
        """The fields of a PARAM_VALUE that nobody listed; ``None`` if there is no such parameter."""
        if name == self._habits.checksum and name:
            return self._fields(self._checksum(), UNSOLICITED)
        found = self._vehicle.parameters.find(name)
        if found is None:
            return None
        keeps = self._habits.keeps_index
        return self._fields(found, self._vehicle.parameters.index(name) if keeps else UNSOLICITED)

    def _fields(self, parameter: Parameter, index: int) -> dict[str, Any]:
        name, kind, value = parameter
        return {
            "param_id": name,
            "param_value": as_bytes(kind, value) if self._habits.bytewise else value,
            "param_type": kind,
            "param_count": len(self._vehicle.parameters),
            "param_index": index,
        }

    def _checksum(self) -> Parameter:
        """Over names and values: it changes when any of them does."""
        total = 0
        for name, kind, value in self._vehicle.parameters:
            total = crc32(name.encode() + _REAL.pack(as_bytes(kind, value)), total)
        return Parameter(self._habits.checksum, UINT32, float(total))

    def on_list(self, peer: Peer, _fields: dict[str, Any]) -> None:
        """PARAM_REQUEST_LIST."""
        if self._habits.checksum:
            peer.channel.send("PARAM_VALUE", self._fields(self._checksum(), UNSOLICITED))
        self._burst(peer.channel, 0)

    def _burst(self, channel: Channel, start: int) -> None:
        parameters = self._vehicle.parameters
        end = min(start + self._habits.burst, len(parameters))
        for index in range(start, end):
            channel.send("PARAM_VALUE", self._fields(parameters.at(index), index))
        if end < len(parameters):
            self._kernel.call_at(self._kernel.now() + self._habits.period, lambda: self._burst(channel, end))

    def on_read(self, peer: Peer, fields: dict[str, Any]) -> None:
        """PARAM_REQUEST_READ, by name or by index. Silence if there is no such parameter."""
        index = fields["param_index"]
        if index >= len(self._vehicle.parameters):
            return
        name = fields["param_id"] if index < 0 else self._vehicle.parameters.at(index).name
        self._kernel.call_at(
            self._kernel.now() + self._habits.read_delay, lambda: self._tell(peer.channel, name, index)
        )

    def on_set(self, peer: Peer, fields: dict[str, Any]) -> None:
        """PARAM_SET. Every link learns the new value; silence if it cannot be set."""
        name, kind, value = fields["param_id"], fields["param_type"], fields["param_value"]
        found = self._vehicle.parameters.find(name)
        if found is None or (self._habits.typed and kind != found.type):
            return
        self._vehicle.set_parameter(name, from_bytes(found.type, value) if self._habits.bytewise else value)

    def _tell(self, channel: Channel, name: str, index: int) -> None:
        fields = self.unlisted(name)
        if fields is not None:
            channel.send("PARAM_VALUE", fields if index < 0 else {**fields, "param_index": index})
