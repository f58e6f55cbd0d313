"""The link of the adapter: dispatches received frames and sends telemetry at the requested rates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import count
from typing import Any

from volery.base.errors import CapabilityError, VoleryError
from volery.base.time import MS, Ns, S
from volery.bridge.autopilot_link import ALL, EXTENDED_STATUS, EXTRA1, EXTRA2, POSITION
from volery.bridge.mavlink_adapter.command_handler import ACCEPTED, CommandHandler, result_of
from volery.bridge.mavlink_adapter.drone_commands import (
    CommandDecoder,
    MavlinkCommand,
    RcChannels,
    from_int,
    from_long,
    global_target,
    local_target,
    manual_control_axes,
    to_integer,
)
from volery.bridge.mavlink_adapter.mission_transfer import MissionTransfer
from volery.bridge.mavlink_adapter.telemetry_encoder import TelemetryEncoder
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext
from volery.links.in_process_link import in_process_pair
from volery.links.link import Frame, Receiver
from volery.links.mavlink_conventions import CHUNK, MessageStreams, status_text_chunks
from volery.links.mavlink_messages import constant, message_type, message_type_of
from volery.trace.events import Text
from volery.vehicles.driver import Driver
from volery.vehicles.telemetry import StatusText

Fields = dict[str, Any]

SYSTEM, AUTOPILOT = 1, 1
"""Ids of the vehicle on the link."""
WARNING = 4
SET_MODE = message_type("SET_MODE").id
"""SET_MODE is acknowledged as if it were the command with this number, as ArduPilot does."""
SET_MESSAGE_INTERVAL, REQUEST_MESSAGE, GET_HOME_POSITION, DO_SET_MODE = (
    constant(f"MAV_CMD_{name}")
    for name in ("SET_MESSAGE_INTERVAL", "REQUEST_MESSAGE", "GET_HOME_POSITION", "DO_SET_MODE")
)
SHORTEST_PERIOD: Ns = MS
NEWS_PERIOD: Ns = 100 * MS
"""Period at which texts and changes of the heartbeat's content are sent."""

REGULAR = ("HEARTBEAT", "HOME_POSITION", "GPS_GLOBAL_ORIGIN", "MISSION_CURRENT", "MISSION_ITEM_REACHED")
"""Messages that are sent once a second without a request, if their content is new."""
STREAMS: Mapping[int, tuple[str, ...]] = {
    EXTENDED_STATUS: ("SYS_STATUS", "GPS_RAW_INT"),
    POSITION: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
    EXTRA1: ("ATTITUDE",),
    EXTRA2: ("VFR_HUD",),
}
"""Messages that are sent at the rate of a MAV_DATA_STREAM, if their content is new."""


class MavlinkAdapter:
    """A ``Link`` to the vehicle of *driver* that uses MAVLink. Operations of the vehicle run in *context*."""

    def __init__(self, kernel: Kernel, driver: Driver, context: ExecutionContext) -> None:
        self.name = driver.name
        self._kernel, self._driver = kernel, driver
        self._ours, self._theirs = in_process_pair(kernel, name=driver.name)
        self._theirs.receive(self._on_frame)
        self._telemetry = TelemetryEncoder(kernel, driver)
        self._commands = CommandHandler(kernel, driver, context, self._warn)
        self._decoder = CommandDecoder(self._commands.drone)
        self._channels = RcChannels()
        self._text_numbers = count(1)
        self._forwarded: StatusText | None = None  # last text of the vehicle that was forwarded
        self._state: tuple[object, ...] = ()
        self._handlers = self._make_handlers()
        self._streams = MessageStreams(
            kernel, tuple(self._telemetry.messages), self._send_new, least=SHORTEST_PERIOD
        )
        self._streams.set(REGULAR, S)
        self._streams.start()
        self._news = kernel.every(NEWS_PERIOD, self._send_news)

    def _make_handlers(self) -> Mapping[str, Callable[[Fields], None]]:
        commands = self._commands
        return {
            "COMMAND_LONG": lambda fields: self._handle_command(from_long(fields)),
            "COMMAND_INT": lambda fields: self._handle_command(from_int(fields)),
            "SET_MODE": lambda fields: self._change_mode(
                SET_MODE, fields["base_mode"], fields["custom_mode"]
            ),
            "SET_POSITION_TARGET_LOCAL_NED": lambda fields: self._set_target(local_target, fields),
            "SET_POSITION_TARGET_GLOBAL_INT": lambda fields: self._set_target(global_target, fields),
            "SET_ATTITUDE_TARGET": lambda fields: commands.report(
                f"{self.name}: no set-points of attitude; there are positions, velocities and sticks"
            ),
            "RC_CHANNELS_OVERRIDE": lambda fields: commands.manual_control(self._channels.update(fields)),
            "MANUAL_CONTROL": lambda fields: commands.manual_control(manual_control_axes(fields)),
            "REQUEST_DATA_STREAM": self._set_stream,
            **MissionTransfer(commands, self._send, self._warn).handlers(),
        }

    # -- the link

    def send(self, frame: Frame) -> None:
        """Send *frame* to the vehicle."""
        self._ours.send(frame)

    def receive(self, receiver: Receiver) -> None:
        """Call *receiver* with every frame of the vehicle from now on."""
        self._ours.receive(receiver)

    def problem(self) -> str:
        """Return what is wrong with the connection of the driver, or ``""``."""
        return str(self._driver.problem() or "")

    def close(self) -> None:
        """Stop commanding the vehicle; it continues what it does."""
        self._news.cancel()
        self._streams.stop()
        self._commands.close()
        self._ours.close()

    def _on_frame(self, frame: Frame) -> None:
        handler = self._handlers.get(frame.name)
        if handler is not None:
            handler(frame.fields)

    # -- sending

    def _send(self, name: str, fields: Fields | None) -> None:
        if fields is not None:
            self._theirs.send(Frame(name, fields, SYSTEM, AUTOPILOT))

    def _send_new(self, names: Sequence[str]) -> None:
        for name in names:
            self._send(name, self._telemetry.encode_new(name))

    def _send_text(self, severity: int, text: str) -> None:
        """Send a text in chunks. The last chunk is never full, which marks it as the last."""
        padded = f"{text} " if len(text) % CHUNK == 0 else text
        number = next(self._text_numbers) % 0xFFFF + 1 if len(padded) > CHUNK else 0
        for fields in status_text_chunks(severity, padded, number):
            self._send("STATUSTEXT", fields)

    def _warn(self, text: str) -> None:
        """Send a warning to the link and record it in the trace."""
        self._send_text(WARNING, text)
        self._kernel.record(Text(self._kernel.now(), self.name, WARNING, text))

    def _send_news(self) -> None:
        """Send a changed heartbeat and the new texts of the vehicle."""
        seen = self._driver.telemetry
        state = (seen.mode, seen.armed, seen.failsafe)
        if state != self._state:
            self._state = state
            self._send_new(("HEARTBEAT",))
        new: list[StatusText] = []
        for text in reversed(seen.texts):
            if text is self._forwarded:
                break
            new.append(text)
        for text in reversed(new):
            self._forwarded = text
            self._send_text(text.severity, text.text)

    # -- requests to the link

    def _set_stream(self, fields: Fields) -> None:
        """Handle REQUEST_DATA_STREAM, whose rate is in Hz."""
        rate = fields["req_message_rate"] if fields["start_stop"] else 0
        stream = fields["req_stream_id"]
        names = sum(STREAMS.values(), ()) if stream == ALL else STREAMS.get(stream, ())
        self._streams.set(names, S // rate if rate else 0)

    def _set_interval(self, command: MavlinkCommand) -> None:
        """Handle SET_MESSAGE_INTERVAL, whose interval is in microseconds; 0 means once a second."""
        number, microseconds, *_ = command.parameters
        name = self._message_name(number)
        period = S if microseconds == 0 else max(0, to_integer(microseconds * 1e3))
        self._streams.set((name,), period)

    def _send_again(self, name: str) -> None:
        self._send(name, self._telemetry.encode(name))

    def _message_name(self, number: float) -> str:
        kind = message_type_of(to_integer(number))
        if kind is None or kind.name not in self._telemetry.messages:
            name = kind.name if kind is not None else f"message {number:g}"
            raise CapabilityError(f"{self.name}: {name} is not available from this vehicle")
        return kind.name

    # -- requests to the vehicle

    def _handle_command(self, command: MavlinkCommand) -> None:
        base, custom, *_ = command.parameters
        if command.number == DO_SET_MODE:
            self._change_mode(DO_SET_MODE, base, custom)
            return
        of_link: Mapping[int, Callable[[], None]] = {
            SET_MESSAGE_INTERVAL: lambda: self._set_interval(command),
            REQUEST_MESSAGE: lambda: self._send_again(self._message_name(base)),
            GET_HOME_POSITION: lambda: self._send_again("HOME_POSITION"),
        }
        answer = partial(self._acknowledge, command.number)
        try:
            request = of_link.get(command.number)
            if request is None:
                self._commands.execute(self._decoder.decode(command), answer)
                return
            request()
            answer(ACCEPTED)
        except VoleryError as error:
            self._refuse(error, answer)

    def _change_mode(self, command: int, base: float, custom: float) -> None:
        answer = partial(self._acknowledge, command)
        try:
            autopilot = self._telemetry.autopilot
            operation = self._decoder.change_mode(autopilot, to_integer(base), to_integer(custom))
            self._commands.execute(operation, answer)
        except VoleryError as error:
            self._refuse(error, answer)

    def _refuse(self, error: VoleryError, answer: Callable[[int], None]) -> None:
        self._warn(str(error))
        answer(result_of(error))

    def _acknowledge(self, command: int, result: int) -> None:
        self._send("COMMAND_ACK", {"command": command, "result": result})

    def _set_target(self, make: Callable[..., Any], fields: Fields) -> None:
        try:
            self._commands.set_target(make(fields, self._driver.telemetry))
        except VoleryError as error:
            self._commands.report(str(error))
