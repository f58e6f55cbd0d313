"""MAVLink's parameter protocol: list, read and set."""

from __future__ import annotations

from typing import Any

from volery.autopilots.simulated.mavlink.channel import Channel, Peer
from volery.autopilots.simulated.parameters import Parameter, Parameters
from volery.autopilots.simulated.vehicle import Vehicle
from volery.base.time import MS

UNSOLICITED = 65535
"""The index of a value that nobody listed."""

LIST_BURST = 200
LIST_PERIOD = 100 * MS
"""ArduPilot lists 1390 parameters in 0.61 s: about 230 each tenth of a second."""

READ_DELAY = 50 * MS
"""A parameter read by name is answered after 55 to 100 ms; a list and a set are answered at once."""


def value_fields(parameters: Parameters, parameter: Parameter, index: int = UNSOLICITED) -> dict[str, Any]:
    """The fields of a PARAM_VALUE."""
    return {
        "param_id": parameter.name,
        "param_value": parameter.value,
        "param_type": parameter.type,
        "param_count": len(parameters),
        "param_index": index,
    }


class ParameterService:
    """Answers for one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._kernel = vehicle.kernel

    def on_list(self, peer: Peer, _fields: dict[str, Any]) -> None:
        """PARAM_REQUEST_LIST."""
        self._burst(peer.channel, 0)

    def _burst(self, channel: Channel, start: int) -> None:
        parameters = self._vehicle.parameters
        end = min(start + LIST_BURST, len(parameters))
        for index in range(start, end):
            channel.send("PARAM_VALUE", value_fields(parameters, parameters.at(index), index))
        if end < len(parameters):
            self._kernel.call_at(self._kernel.now() + LIST_PERIOD, lambda: self._burst(channel, end))

    def on_read(self, peer: Peer, fields: dict[str, Any]) -> None:
        """PARAM_REQUEST_READ, by name or by index. Silence if there is no such parameter."""
        index = fields["param_index"]
        if index >= 0:
            found = self._vehicle.parameters.at(index) if index < len(self._vehicle.parameters) else None
        else:
            found = self._vehicle.parameters.find(fields["param_id"])
        if found is not None:
            name, shown = found.name, index if index >= 0 else UNSOLICITED
            self._kernel.call_at(
                self._kernel.now() + READ_DELAY, lambda: self._tell(peer.channel, name, shown)
            )

    def on_set(self, peer: Peer, fields: dict[str, Any]) -> None:
        """PARAM_SET. Every link learns the new value; silence if it cannot be set."""
        self._vehicle.set_parameter(fields["param_id"], fields["param_value"])

    def _tell(self, channel: Channel, name: str, index: int) -> None:
        parameters = self._vehicle.parameters
        found = parameters.find(name)
        if found is not None:
            channel.send("PARAM_VALUE", value_fields(parameters, found, index))
