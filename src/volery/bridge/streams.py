"""Asking the autopilot for what is published, once a second for what does not come.

A request right after boot may be lost, though acknowledged. ArduPilot is asked for streams, PX4, which knows
none, for messages.
"""

from __future__ import annotations

from collections.abc import Mapping

from volery.base.time import Ns, S
from volery.bridge.modes import PX4_ID
from volery.bridge.wire import Wire

ALL, RAW_SENSORS, EXTENDED_STATUS, RC, POSITION, EXTRA1, EXTRA2, EXTRA3 = 0, 1, 2, 3, 6, 10, 11, 12
"""MAV_DATA_STREAM."""
EXTENDED_SYS_STATE, GET_HOME_POSITION, SET_MESSAGE_INTERVAL = 245, 410, 511
ASK_EVERY: Ns = S
MISSED_AFTER: Ns = 3 * S

_SHOWN_BY = {
    ALL: "ATTITUDE",
    RAW_SENSORS: "RAW_IMU",
    EXTENDED_STATUS: "SYS_STATUS",
    RC: "RC_CHANNELS",
    POSITION: "GLOBAL_POSITION_INT",
    EXTRA1: "ATTITUDE",
    EXTRA2: "VFR_HUD",
    EXTRA3: "SYSTEM_TIME",
}
"""The message by which one sees that a stream comes."""

_MESSAGES: Mapping[int, tuple[int, ...]] = {
    RAW_SENSORS: (105, 29),
    EXTENDED_STATUS: (1, 24),
    RC: (65, 36),
    POSITION: (33, 32),
    EXTRA1: (30,),
    EXTRA2: (74,),
}
"""The messages of a stream that are published, for PX4: HIGHRES_IMU stands for RAW_IMU, which it lacks."""
_PX4_SHOWN_BY = {**_SHOWN_BY, RAW_SENSORS: "HIGHRES_IMU"}


def request_stream(wire: Wire, stream: int, rate: int) -> None:
    """Ask for a MAV_DATA_STREAM at *rate* hertz; 0 stops it."""
    fields = {"req_stream_id": stream, "req_message_rate": rate, "start_stop": 1 if rate else 0}
    wire.send_to("REQUEST_DATA_STREAM", fields)


class Streams:
    """Keeps *rates* (hertz by stream) coming; *home* asks for the home position and the landed state as
    well.
    """

    def __init__(self, wire: Wire, rates: Mapping[int, int], *, home: bool) -> None:
        self._wire, self._rates, self._home = wire, rates, home
        self._next: Ns = 0

    def look(self, now: Ns) -> None:
        """Ask for what is missing."""
        if not self._wire.known or now < self._next:
            return
        self._next = now + ASK_EVERY
        by_message = self._wire.firmware.autopilot == PX4_ID
        shown_by = _PX4_SHOWN_BY if by_message else _SHOWN_BY
        for stream, rate in self._rates.items():
            heard = self._wire.latest.get(shown_by.get(stream, ""))
            if heard is not None and now - heard.at <= MISSED_AFTER:
                continue
            if by_message:
                self._request_messages(stream, rate)
            else:
                request_stream(self._wire, stream, rate)
        if self._home:
            self._request_once()

    def _request_messages(self, stream: int, rate: int) -> None:
        streams = _MESSAGES if stream == ALL else {stream: _MESSAGES.get(stream, ())}
        for messages in streams.values():
            for number in messages:
                self._command(SET_MESSAGE_INTERVAL, number, 1e6 / max(rate, 1))

    def _request_once(self) -> None:
        latest = self._wire.latest
        if "EXTENDED_SYS_STATE" not in latest:
            self._command(SET_MESSAGE_INTERVAL, EXTENDED_SYS_STATE, 1e6)
        if "HOME_POSITION" not in latest:
            self._command(GET_HOME_POSITION)

    def _command(self, command: int, *parameters: float) -> None:
        fields = {f"param{number}": value for number, value in enumerate(parameters, start=1)}
        self._wire.send_to("COMMAND_LONG", {"command": command, **fields})
