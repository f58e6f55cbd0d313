"""The link: frames that come are handed to whoever answers them, what is to be said goes out in its time."""

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
"""Its ids on the link."""
WARNING = 4
SET_MODE = message_type("SET_MODE").id
"""SET_MODE is acknowledged as if it were the command of that number, as ArduPilot does it."""
SET_MESSAGE_INTERVAL, REQUEST_MESSAGE, GET_HOME_POSITION, DO_SET_MODE = (
    constant(f"MAV_CMD_{name}")
    for name in ("SET_MESSAGE_INTERVAL", "REQUEST_MESSAGE", "GET_HOME_POSITION", "DO_SET_MODE")
)
FASTEST: Ns = MS
"""No message is said more often."""
NEWS_PERIOD: Ns = 100 * MS
"""How soon texts are passed on, and a change of what a heartbeat says."""

REGULAR = ("HEARTBEAT", "HOME_POSITION", "GPS_GLOBAL_ORIGIN", "MISSION_CURRENT", "MISSION_ITEM_REACHED")
"""What is said once a second if it is news, asked for or not."""
STREAMS: Mapping[int, tuple[str, ...]] = {
    EXTENDED_STATUS: ("SYS_STATUS", "GPS_RAW_INT"),
    POSITION: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
    EXTRA1: ("ATTITUDE",),
    EXTRA2: ("VFR_HUD",),
}
"""What is said at the rate of a MAV_DATA_STREAM, if anything was heard since it was said last."""


class MavlinkAdapter:
    """A ``Link`` at whose other end the vehicle of *driver* speaks MAVLink.

    What it takes to fly it is computed at *place*.
    """

    def __init__(self, kernel: Kernel, driver: Driver, place: ExecutionContext) -> None:
        self.name = driver.name
        self._kernel, self._driver = kernel, driver
        self._ours, self._theirs = in_process_pair(kernel, name=driver.name)
        self._theirs.receive(self._hear)
        self._telling = TelemetryEncoder(kernel, driver)
        self._conduct = CommandHandler(kernel, driver, place, self._warn)
        self._orders = CommandDecoder(self._conduct.drone)
        self._channels = RcChannels()
        self._numbers = count(1)
        self._passed: StatusText | None = None  # the last of the vehicle's own texts that was passed on
        self._state: tuple[object, ...] = ()
        self._handlers = self._all()
        self._streams = MessageStreams(kernel, tuple(self._telling.messages), self._burst, least=FASTEST)
        self._streams.set(REGULAR, S)
        self._streams.start()
        self._news = kernel.every(NEWS_PERIOD, self._tell_news)

    def _all(self) -> Mapping[str, Callable[[Fields], None]]:
        conduct = self._conduct
        return {
            "COMMAND_LONG": lambda fields: self._command(from_long(fields)),
            "COMMAND_INT": lambda fields: self._command(from_int(fields)),
            "SET_MODE": lambda fields: self._change_mode(
                SET_MODE, fields["base_mode"], fields["custom_mode"]
            ),
            "SET_POSITION_TARGET_LOCAL_NED": lambda fields: self._aim(local_target, fields),
            "SET_POSITION_TARGET_GLOBAL_INT": lambda fields: self._aim(global_target, fields),
            "SET_ATTITUDE_TARGET": lambda fields: conduct.complain(
                f"{self.name}: no set-points of attitude; there are positions, velocities and sticks"
            ),
            "RC_CHANNELS_OVERRIDE": lambda fields: conduct.sticks(self._channels.take(fields)),
            "MANUAL_CONTROL": lambda fields: conduct.sticks(manual_control_axes(fields)),
            "REQUEST_DATA_STREAM": self._stream,
            **MissionTransfer(conduct, self._say, self._warn).handlers(),
        }

    # -- the link

    def send(self, frame: Frame) -> None:
        """To the vehicle."""
        self._ours.send(frame)

    def receive(self, receiver: Receiver) -> None:
        """What the vehicle says."""
        self._ours.receive(receiver)

    def problem(self) -> str:
        """What is wrong with the driver's way to it."""
        return str(self._driver.problem() or "")

    def close(self) -> None:
        """Nobody commands it any more; it goes on with what it does."""
        self._news.cancel()
        self._streams.stop()
        self._conduct.close()
        self._ours.close()

    def _hear(self, frame: Frame) -> None:
        handler = self._handlers.get(frame.name)
        if handler is not None:
            handler(frame.fields)

    # -- saying

    def _say(self, name: str, fields: Fields) -> None:
        self._theirs.send(Frame(name, fields, SYSTEM, AUTOPILOT))

    def _burst(self, names: Sequence[str]) -> None:
        for name in names:
            self._say_if(name, self._telling.anew(name))

    def _say_if(self, name: str, fields: Fields | None) -> None:
        if fields is not None:
            self._say(name, fields)

    def _text(self, severity: int, text: str) -> None:
        """In chunks; the last one is not full: that it is the last is seen by that."""
        whole = f"{text} " if len(text) % CHUNK == 0 else text
        number = next(self._numbers) % 0xFFFF + 1 if len(whole) > CHUNK else 0
        for fields in status_text_chunks(severity, whole, number):
            self._say("STATUSTEXT", fields)

    def _warn(self, text: str) -> None:
        """What went wrong here: to whoever is on the link, and into the record."""
        self._text(WARNING, text)
        self._kernel.record(Text(self._kernel.now(), self.name, WARNING, text))

    def _tell_news(self) -> None:
        seen = self._driver.telemetry
        state = (seen.mode, seen.armed, seen.failsafe)
        if state != self._state:
            self._state = state
            self._burst(("HEARTBEAT",))
        self._pass_on_texts()

    def _pass_on_texts(self) -> None:
        """What the vehicle says in words."""
        new: list[StatusText] = []
        for said in reversed(self._driver.telemetry.texts):
            if said is self._passed:
                break
            new.append(said)
        for said in reversed(new):
            self._passed = said
            self._text(said.severity, said.text)

    # -- what is asked of the link

    def _stream(self, fields: Fields) -> None:
        """REQUEST_DATA_STREAM: in hertz."""
        rate = fields["req_message_rate"] if fields["start_stop"] else 0
        stream = fields["req_stream_id"]
        names = sum(STREAMS.values(), ()) if stream == ALL else STREAMS.get(stream, ())
        self._streams.set(names, S // rate if rate else 0)

    def _interval(self, command: MavlinkCommand) -> None:
        """SET_MESSAGE_INTERVAL: in microseconds; 0 is once a second."""
        number, microseconds, *_ = command.parameters
        name = self._name(number)
        period = S if microseconds == 0 else max(0, to_integer(microseconds * 1e3))
        self._streams.set((name,), period)

    def _name(self, number: float) -> str:
        kind = message_type_of(to_integer(number))
        if kind is None or kind.name not in self._telling.messages:
            what = kind.name if kind is not None else f"message {number:g}"
            raise CapabilityError(f"{self.name}: {what} is not told by such a vehicle")
        return kind.name

    # -- what is asked of the vehicle

    def _command(self, command: MavlinkCommand) -> None:
        base, custom, *_ = command.parameters
        if command.number == DO_SET_MODE:
            self._change_mode(DO_SET_MODE, base, custom)
            return
        asked: Mapping[int, Callable[[], None]] = {
            SET_MESSAGE_INTERVAL: lambda: self._interval(command),
            REQUEST_MESSAGE: lambda: self._again(self._name(base)),
            GET_HOME_POSITION: lambda: self._again("HOME_POSITION"),
        }
        answer = partial(self._acknowledge, command.number)
        try:
            of_link = asked.get(command.number)
            if of_link is None:
                self._conduct.command(self._orders.of(command), answer)
                return
            of_link()
            answer(ACCEPTED)
        except VoleryError as error:
            self._refuse(error, answer)

    def _again(self, name: str) -> None:
        self._say_if(name, self._telling.again(name))

    def _change_mode(self, asked_with: int, base: float, custom: float) -> None:
        answer = partial(self._acknowledge, asked_with)
        try:
            order = self._orders.mode(self._telling.firmware, to_integer(base), to_integer(custom))
            self._conduct.command(order, answer)
        except VoleryError as error:
            self._refuse(error, answer)

    def _refuse(self, error: VoleryError, answer: Callable[[int], None]) -> None:
        self._warn(str(error))
        answer(result_of(error))

    def _acknowledge(self, command: int, result: int) -> None:
        self._say("COMMAND_ACK", {"command": command, "result": result})

    def _aim(self, make: Callable[..., Any], fields: Fields) -> None:
        try:
            self._conduct.aim(make(fields, self._driver.telemetry))
        except VoleryError as error:
            self._conduct.complain(str(error))
