"""MAVLink's commands: long and int form brought to one shape, handed to the dialect, acknowledged.

What concerns the link itself (message intervals, single messages) is answered here.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, nan
from typing import TYPE_CHECKING, Any, NamedTuple

from volery.base.time import MS, US
from volery.links.mavlink import message_type_of
from volery.simulation.autopilots.simulated.mavlink.channel import Peer
from volery.simulation.autopilots.simulated.mavlink.numbers import number as finite
from volery.simulation.autopilots.simulated.plan import GLOBAL_RELATIVE

if TYPE_CHECKING:
    from volery.simulation.autopilots.simulated.mavlink.dialect import MavlinkDialect
    from volery.simulation.autopilots.simulated.vehicle import Vehicle

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = 0, 1, 2, 3, 4
"""MAV_RESULT."""

GET_MESSAGE_INTERVAL, SET_MESSAGE_INTERVAL, REQUEST_MESSAGE = 510, 511, 512
REQUEST_CAPABILITIES = 520

NOT_GIVEN = 2_147_483_647
"""A coordinate of COMMAND_INT that is none."""


class Command(NamedTuple):
    """A command, whichever form it came in. ``x`` and ``y`` are degrees where they are a place.

    All are numbers, but ``param4``, where a NaN may mean: leave the heading alone; and the others where the
    firmware reads a NaN as: not given.
    """

    number: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: float
    y: float
    z: float
    frame: int
    is_int: bool


Handler = Callable[["Vehicle", Command], int]
"""Does it and returns a MAV_RESULT."""


def from_long(fields: dict[str, Any], reads_nan: bool = False) -> Command:
    """COMMAND_LONG. *reads_nan*: what is no number stays none."""
    read = _number_or_nan if reads_nan else finite
    return Command(
        fields["command"],
        read(fields["param1"]),
        read(fields["param2"]),
        read(fields["param3"]),
        _number_or_nan(fields["param4"]),
        read(fields["param5"]),
        read(fields["param6"]),
        read(fields["param7"]),
        GLOBAL_RELATIVE,
        is_int=False,
    )


def from_int(fields: dict[str, Any], reads_nan: bool = False) -> Command:
    """COMMAND_INT. *reads_nan*: what is no number stays none, and the largest integer is none."""
    read = _number_or_nan if reads_nan else finite
    x, y = (nan if reads_nan and value == NOT_GIVEN else value / 1e7 for value in (fields["x"], fields["y"]))
    return Command(
        fields["command"],
        read(fields["param1"]),
        read(fields["param2"]),
        read(fields["param3"]),
        _number_or_nan(fields["param4"]),
        x,
        y,
        read(fields["z"]),
        fields["frame"],
        is_int=True,
    )


def _number_or_nan(value: float) -> float:
    return finite(value) if isfinite(value) else nan


class CommandService:
    """Answers for one vehicle."""

    def __init__(self, vehicle: Vehicle, dialect: MavlinkDialect) -> None:
        self._vehicle = vehicle
        self._dialect = dialect
        self._own: dict[int, Callable[[Peer, Command], int]] = {
            GET_MESSAGE_INTERVAL: self._get_interval,
            SET_MESSAGE_INTERVAL: self._set_interval,
            REQUEST_MESSAGE: self._request_message,
            REQUEST_CAPABILITIES: lambda peer, _: self._send(peer, "AUTOPILOT_VERSION"),
        }

    def on_long(self, peer: Peer, fields: dict[str, Any]) -> None:
        """COMMAND_LONG."""
        self._perform(peer, from_long(fields, self._dialect.reads_nan))

    def on_int(self, peer: Peer, fields: dict[str, Any]) -> None:
        """COMMAND_INT."""
        self._perform(peer, from_int(fields, self._dialect.reads_nan))

    def _perform(self, peer: Peer, command: Command) -> None:
        own = self._own.get(command.number)
        if own is not None:
            result = own(peer, command)
        else:
            handler = self._dialect.commands.get(command.number)
            result = UNSUPPORTED if handler is None else handler(self._vehicle, command)
        self.acknowledge(peer, command.number, result)

    def acknowledge(self, peer: Peer, number: int, result: int) -> None:
        """Send the COMMAND_ACK."""
        peer.answer("COMMAND_ACK", command=number, result=result, progress=0, result_param2=0)

    # -- messages on request

    def _get_interval(self, peer: Peer, command: Command) -> int:
        number = round(finite(command.param1))
        name = self._name(number)
        if name is None:
            return FAILED
        period = peer.channel.streams.period(name)
        peer.channel.send("MESSAGE_INTERVAL", {"message_id": number, "interval_us": period // US or -1})
        return ACCEPTED

    def _set_interval(self, peer: Peer, command: Command) -> int:
        number, interval = round(finite(command.param1)), finite(command.param2)
        name = self._name(number)
        if name is None:
            return self._dialect.refuse_interval(self._vehicle, number)
        if self._vehicle.uptime() < self._dialect.deaf_until:
            return ACCEPTED
        if interval == 0.0:
            period = peer.channel.usual.get(name, 0)
        else:
            period = max(MS, round(interval) * US // MS * MS) if interval > 0 else 0
        peer.channel.streams.set((name,), period)
        return ACCEPTED

    def _request_message(self, peer: Peer, command: Command) -> int:
        name = self._name(round(finite(command.param1)))
        if name is None:
            return self._dialect.unknown_message
        return self._send(peer, name)

    def _send(self, peer: Peer, name: str) -> int:
        """Send it after the acknowledgement."""

        def send() -> None:
            fields = self._dialect.messages[name](self._vehicle)
            if fields is not None:
                peer.channel.send(name, fields)

        self._vehicle.outlet.after_answer(send)
        return ACCEPTED

    def _name(self, number: int) -> str | None:
        kind = message_type_of(number)
        return kind.name if kind is not None and kind.name in self._dialect.messages else None
