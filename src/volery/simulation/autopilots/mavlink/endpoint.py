"""The MAVLink endpoint of a vehicle: links, heartbeats, streams, and the handler of each message.

A frame is handled a few milliseconds after it has arrived, in order. Messages that its handling causes are
sent after the answer, as in recordings of the firmware once it has booted.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from itertools import count
from typing import Any

from volery.base.time import S
from volery.kernel.api import Action, Handle
from volery.links.frame import Frame
from volery.links.link import Link
from volery.links.mavlink_messages import MessageStreams, status_text_chunks
from volery.simulation.autopilots.mavlink.channel import AUTOPILOT, MavlinkChannel, Peer, StatusTextQueue
from volery.simulation.autopilots.mavlink.file_service import FileService
from volery.simulation.autopilots.mavlink.firmware import MavlinkFirmware
from volery.simulation.autopilots.mavlink.log_service import LogService
from volery.simulation.autopilots.mavlink.microservices import (
    CommandService,
    MissionService,
    ParameterService,
)
from volery.simulation.autopilots.mavlink.routing import Routes
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import Text

Handler = Callable[[Peer, dict[str, Any]], None]

BROADCAST = 0
COMMANDS = ("COMMAND_LONG", "COMMAND_INT")


class MavlinkEndpoint:
    """``LinkEndpoint`` of one vehicle that uses MAVLink.

    Args:
        firmware: What differs between firmwares.
        vehicle: The vehicle.
    """

    def __init__(self, firmware: MavlinkFirmware, vehicle: AutopilotVehicle) -> None:
        self._vehicle = vehicle
        self.firmware = firmware
        self._kernel = vehicle.kernel
        self.channels: list[MavlinkChannel] = []
        self._arrived: deque[tuple[MavlinkChannel, Frame]] = deque()
        self._handling = False
        self._after: list[Action] = []
        self._routes: Routes | None = None
        self._text_id = 0
        self._timers: list[Handle] = []
        self._parameters = parameters = ParameterService(vehicle, firmware.parameters)
        missions = MissionService(vehicle, firmware)
        logs = LogService(vehicle, firmware.logs)
        files = FileService(vehicle, firmware.files, logs.content)
        self._commands = CommandService(vehicle, firmware)
        self._handlers: dict[str, Handler] = {
            "COMMAND_INT": self._commands.on_int,
            "COMMAND_LONG": self._commands.on_long,
            "FILE_TRANSFER_PROTOCOL": files.on_request,
            "LOG_ERASE": logs.on_erase,
            "LOG_REQUEST_DATA": logs.on_data,
            "LOG_REQUEST_END": logs.on_end,
            "LOG_REQUEST_LIST": logs.on_list,
            "MISSION_ACK": missions.on_ack,
            "MISSION_CLEAR_ALL": missions.on_clear,
            "MISSION_COUNT": missions.on_count,
            "MISSION_ITEM": missions.on_item,
            "MISSION_ITEM_INT": missions.on_item_int,
            "MISSION_REQUEST": missions.on_request,
            "MISSION_REQUEST_INT": missions.on_request_int,
            "MISSION_REQUEST_LIST": missions.on_request_list,
            "MISSION_SET_CURRENT": missions.on_set_current,
            **({"MISSION_WRITE_PARTIAL_LIST": missions.on_partial} if firmware.missions.writes_parts else {}),
            "PARAM_REQUEST_LIST": self._on_parameter_list(parameters.on_list),
            "PARAM_REQUEST_READ": parameters.on_read,
            "PARAM_SET": parameters.on_set,
            "PING": self._on_ping,
            "REQUEST_DATA_STREAM": self._on_stream_request,
            "SET_MODE": self._on_set_mode,
            "TIMESYNC": self._on_timesync,
        }

    # -- links

    @property
    def banner(self) -> bytes:
        """Bytes that the autopilot writes to a new byte connection before any frame."""
        return self.firmware.start.boot_bytes[0].data if self.firmware.start.boot_bytes else b""

    def connect(self, link: Link, use: str = "") -> None:
        """Serve *link*.

        Args:
            link: The autopilot's end of the link.
            use: What the firmware uses the link for; empty: its default.
        """
        vehicle, uses = self._vehicle, self.firmware.telemetry.link_uses
        taken = {channel.index for channel in self.channels}
        index = next(index for index in count() if index not in taken)
        usual = uses[use] if use else next(iter(uses.values()))
        channel = MavlinkChannel(self._kernel, link, index, vehicle.system, usual)
        channel.streams = MessageStreams(
            self._kernel,
            self.firmware.telemetry.message_order,
            lambda names: self._burst(channel, names),
            wanted=channel.is_wanted,
            least=self.firmware.telemetry.least_period,
        )
        channel.texts = StatusTextQueue(
            self._kernel, self.firmware.texts, lambda fields: channel.send("STATUSTEXT", fields)
        )
        self.channels.append(channel)
        self._mark_high_latency([channel])
        if vehicle.uptime() >= vehicle.rules.startup.ready_after:
            channel.stream()
        link.receive(lambda frame: self._receive(channel, frame))

    def _mark_high_latency(self, channels: Sequence[MavlinkChannel]) -> None:
        """Note which of these links are of high latency."""
        links = self.firmware.telemetry.high_latency
        slow = links.links(self._vehicle) if links is not None else frozenset()
        for channel in channels:
            carries = links is not None and channel.index in slow
            channel.silent = partial(links.muted, self._vehicle) if links is not None and carries else None

    def disconnect(self, link: Link) -> None:
        """Stop serving *link*."""
        for channel in [channel for channel in self.channels if channel.link is link]:
            channel.close()
            self.channels.remove(channel)

    def close(self) -> None:
        """Stop serving all links."""
        for channel in self.channels:
            channel.close()
        self.channels.clear()

    @property
    def handled_messages(self) -> frozenset[str]:
        """Names of the messages that have an effect or an answer."""
        return frozenset(
            {*self._handlers, *self.firmware.commands.handlers, *self.firmware.commands.questions}
        )

    def _burst(self, channel: MavlinkChannel, names: Sequence[str]) -> None:
        for name in names:
            for fields in self.firmware.telemetry.build(name, self._vehicle):
                channel.send(name, fields)

    def _send_bytes(self, data: bytes) -> None:
        """Send bytes that are no message, on all links that carry bytes."""
        for channel in self.channels:
            channel.send_bytes(data)

    # -- timers

    def start(self) -> None:
        """Start heartbeats, time requests and streams, in phase with the boot."""
        self.stop()
        vehicle, firmware = self._vehicle, self.firmware
        private = firmware.commands.private_links
        self._routes = Routes(vehicle.system, private(vehicle)) if private is not None else None
        self._mark_high_latency(self.channels)
        age = vehicle.uptime()
        for piece in firmware.start.boot_bytes[1:] if not age else ():
            self._at_uptime(piece.after, partial(self._send_bytes, piece.data))
        for after in firmware.start.heartbeat_first:
            if after >= age:
                self._at_uptime(after, self._beat)
        self._regularly(firmware.start.heartbeat_from, S, self._beat)
        if firmware.start.timesync_every:
            self._regularly(firmware.start.timesync_every, firmware.start.timesync_every, self._request_time)
        if age >= vehicle.rules.startup.ready_after:
            self.stream()
        else:
            self._at_uptime(vehicle.rules.startup.ready_after, self.stream)

    def stop(self) -> None:
        """Stop all timers and streams."""
        for timer in self._timers:
            timer.cancel()
        self._timers.clear()
        for channel in self.channels:
            channel.streams.stop()

    def stream(self) -> None:
        """Start the streams of all links."""
        for channel in self.channels:
            channel.stream()

    def _at_uptime(self, uptime: int, action: Action) -> None:
        self._timers.append(self._kernel.call_at(self._vehicle.boot_at + uptime, action))

    def _regularly(self, first: int, period: int, action: Action) -> None:
        """Run *action* each *period*, in phase with the boot, not before uptime *first*."""
        age = self._vehicle.uptime()
        if age > first:
            first += -(-(age - first) // period) * period
        self._at_uptime(first, lambda: self._timers.append(self._kernel.every(period, action)))

    def _beat(self) -> None:
        """Send HEARTBEAT on all links but those of high latency."""
        for fields in self.firmware.telemetry.build("HEARTBEAT", self._vehicle):
            for channel in self.channels:
                if channel.silent is None:
                    channel.send("HEARTBEAT", fields)

    def _request_time(self) -> None:
        fields = {"tc1": 0, "ts1": self._vehicle.uptime() // 1000 * 1000 + self._vehicle.system}
        for channel in self.channels:
            channel.send("TIMESYNC", fields)

    # -- sending

    def send_text(self, severity: int, text: str) -> None:
        """Send STATUSTEXT on all links, in chunks where it is long, and record it in the trace."""
        self._kernel.record(Text(self._kernel.now(), self._vehicle.name, severity, text.strip()))
        numbered = self.firmware.texts.numbered or len(status_text_chunks(severity, text, 0)) > 1
        if numbered:
            self._text_id = self._text_id % 65_535 + 1
        chunks = status_text_chunks(severity, text, self._text_id if numbered else 0)

        def send() -> None:
            for channel in self.channels:
                channel.texts.put(chunks)

        self.after_reply(send)

    def parameter_changed(self, name: str) -> None:
        """Send PARAM_VALUE on all links."""
        fields = self._parameters.unlisted(self._vehicle.parameters.name(name))
        if fields is not None:
            self.send_event("PARAM_VALUE", fields)

    def mode_changed(self) -> None:
        """Send the messages of a change of mode on all links."""
        for message in self.firmware.telemetry.on_mode_change:
            self.send_message(message)

    def home_changed(self) -> None:
        """Send the messages of a change of the home position on all links."""
        for message in self.firmware.telemetry.on_home_change:
            self.send_message(message)

    def send_message(self, message: str) -> None:
        """Send a telemetry message now, on all links."""
        for fields in self.firmware.telemetry.build(message, self._vehicle):
            self.send_event(message, fields)

    def send_event(self, message: str, fields: dict[str, Any]) -> None:
        """Send a message with these fields, on all links."""

        def send() -> None:
            for channel in self.channels:
                channel.send(message, fields)

        self.after_reply(send)

    def after_reply(self, action: Action) -> None:
        """Run *action* once the frame in hand has been answered.

        Run it at once if there is none, or while the autopilot is booting.
        """
        if self._handling and self._vehicle.uptime() >= self._vehicle.rules.startup.ready_after:
            self._after.append(action)
        else:
            action()

    # -- receiving

    def _receive(self, channel: MavlinkChannel, frame: Frame) -> None:
        if not channel.open or not channel.admit(frame):
            return
        self._arrived.append((channel, frame))
        self._kernel.call_at(self._kernel.now() + self.firmware.commands.answer_delay, self._handle)

    def _handle(self) -> None:
        channel, frame = self._arrived.popleft()
        channel.take(frame)
        try:
            self._answer(channel, frame)
        except (ArithmeticError, ValueError) as error:
            channel.leave_out(f"{frame.name} has no effect", f"{error} ({frame.fields})")
        self._handling = False
        after, self._after = self._after, []
        for action in after:
            action()

    def _answer(self, channel: MavlinkChannel, frame: Frame) -> None:
        """Forward a frame, and let the handler of its message answer it."""
        fields = frame.fields
        channel.streams.resume()
        if self._routes is not None:
            self._routes.forward(channel, frame, self.channels)
        if not self.firmware.commands.accepts(self._vehicle, frame.name, frame.system):
            return
        if not self._is_addressed(frame):
            self._reject(channel, frame)
            return
        if frame.name == "HEARTBEAT":
            channel.texts.on_heartbeat(fields["type"])
        self._handling = True
        own = self._handlers.get(frame.name)
        question = self.firmware.commands.questions.get(frame.name)
        if own is not None:
            own(Peer(channel, frame.system, frame.component), fields)
        elif question is not None:
            question(self._vehicle, fields, Peer(channel, frame.system, frame.component))
        else:
            handler = self.firmware.commands.handlers.get(frame.name)
            if handler is not None:
                handler(self._vehicle, fields, frame.system)

    def _is_addressed(self, frame: Frame) -> bool:
        fields, strict = frame.fields, self.firmware.commands.checks_component
        system, component = fields.get("target_system", BROADCAST), fields.get("target_component", BROADCAST)
        if strict and frame.name in COMMANDS and system != self._vehicle.system:
            return False
        if system not in (BROADCAST, self._vehicle.system):
            return False
        return not strict or component in (BROADCAST, AUTOPILOT)

    def _reject(self, channel: MavlinkChannel, frame: Frame) -> None:
        result = self.firmware.commands.wrong_target
        if result is not None and frame.name in COMMANDS:
            peer = Peer(channel, frame.system, frame.component)
            self._commands.acknowledge(peer, frame.fields["command"], result)

    def _on_parameter_list(self, listing: Handler) -> Handler:
        def on_list(peer: Peer, fields: dict[str, Any]) -> None:
            listing(peer, fields)
            self.firmware.on_parameter_list(self._vehicle)

        return on_list

    def _on_stream_request(self, peer: Peer, fields: dict[str, Any]) -> None:
        vehicle, firmware = self._vehicle, self.firmware
        stream = fields["req_stream_id"]
        rate = fields["req_message_rate"] if fields["start_stop"] else 0
        names = firmware.telemetry.streams.get(stream)
        if names is not None:
            period = S // rate if rate else 0
            peer.channel.streams.set(names, period)
            peer.channel.requested.update(dict.fromkeys(names, period))
            firmware.telemetry.on_stream_request(vehicle, peer.channel.index, stream, rate)

    def _on_set_mode(self, peer: Peer, fields: dict[str, Any]) -> None:
        result = self.firmware.commands.set_mode(self._vehicle, fields["base_mode"], fields["custom_mode"])
        self._commands.acknowledge(peer, self.firmware.commands.set_mode_ack, result)

    def _on_ping(self, peer: Peer, fields: dict[str, Any]) -> None:
        if fields["target_system"] == BROADCAST:
            peer.answer("PING", time_usec=fields["time_usec"], seq=fields["seq"])

    def _on_timesync(self, peer: Peer, fields: dict[str, Any]) -> None:
        if fields["tc1"] == 0:
            peer.channel.send("TIMESYNC", {"tc1": self._vehicle.uptime(), "ts1": fields["ts1"]})
        elif "TIMESYNC" in self.firmware.commands.handlers:
            self.firmware.commands.handlers["TIMESYNC"](self._vehicle, fields, peer.system)
