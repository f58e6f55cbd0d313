"""The link of the adapter: it dispatches received frames, sends telemetry and carries missions.

Of MAVLink's mission protocol there is upload, and download of what was uploaded through the adapter. There is
no item for home: the first item is the first to be flown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from typing import Any

from volery.base.errors import CapabilityError, UsageError, VoleryError, choices
from volery.base.position import AMSL
from volery.base.time import MS, Ns, S
from volery.bridge.autopilot_link import ALL, EXTENDED_STATUS, EXTRA1, EXTRA2, POSITION
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
from volery.bridge.mavlink_adapter.drone_commands import (
    ChannelsOverride,
    CommandDecoder,
    MavlinkCommand,
    from_int,
    from_long,
    global_position,
    global_target,
    local_target,
    manual_control_axes,
    to_integer,
)
from volery.bridge.mavlink_adapter.telemetry_encoder import TelemetryEncoder
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.links.link import Receiver
from volery.links.mavlink_messages import (
    CHUNK,
    MessageStreams,
    constant,
    entry_name,
    message_type,
    message_type_of,
    status_text_chunks,
)
from volery.trace.events import WARNING, Text
from volery.vehicles.driver import ChangeSpeed, Driver, Land, MissionItem, ReturnHome, TakeOff, Waypoint
from volery.vehicles.telemetry import StatusText

Fields = dict[str, Any]
Send = Callable[[str, Fields], None]

MISSION_LIST = constant("MAV_MISSION_TYPE_MISSION")
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
class _StationUpload:
    count: int
    items: list[Fields] = field(default_factory=list)


class MissionTransfer:
    """Handlers of the mission protocol for the drone of *commands*."""

    def __init__(self, commands: CommandHandler, send: Send, report: Report) -> None:
        self._commands, self._send, self._report = commands, send, report
        self._upload: _StationUpload | None = None
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
        self._upload = _StationUpload(fields["count"])
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


SYSTEM, AUTOPILOT = 1, 1
"""Ids of the vehicle on the link."""
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
        self._channels = ChannelsOverride()
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
            kind = frame.fields.get("mission_type", MISSION_LIST)
            if kind == MISSION_LIST:
                handler(frame.fields)
            else:
                self._send("MISSION_ACK", {"type": MISSION_RESULTS[UNSUPPORTED], "mission_type": kind})

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
