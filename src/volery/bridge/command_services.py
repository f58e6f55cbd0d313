"""Services that command the autopilot: modes, arming, take-off, landing, any MAVLink command, stream rates.

A command is sent once and answered with the autopilot's acknowledgement, or with ``success`` false after
five seconds without one. As in MAVROS, ``set_mode`` and ``cmd/command_int`` do not wait for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from volery.base.errors import choices, did_you_mean
from volery.base.time import Ns, S
from volery.bridge.autopilot_link import request_stream
from volery.bridge.mode_names import mode_names, mode_number
from volery.bridge.node_interface import InterfaceContext, Service
from volery.kernel.waiting import Lock
from volery.ros.messages import service

ACK_WITHIN: Ns = 5 * S
ACCEPTED, FAILED, IN_PROGRESS = 0, 4, 5
CUSTOM_MODE_ENABLED = 1
LAND, TAKEOFF, SET_HOME, ARM_DISARM, SET_MESSAGE_INTERVAL = 21, 22, 179, 400, 511


class CommandServices:
    """The handlers. One command at a time is under way, others wait their turn."""

    def __init__(self, around: InterfaceContext) -> None:
        self._wire, self._warn = around.wire, around.warn
        self._one_at_a_time = Lock(around.wire.kernel, f"{around.node.name} (command)")

    def services(self) -> Mapping[str, Service]:
        """Handlers by the service's name, with its type."""
        return {
            "set_mode": ("mavros_msgs/srv/SetMode", self.set_mode),
            "cmd/arming": ("mavros_msgs/srv/CommandBool", self.arming),
            "cmd/takeoff": ("mavros_msgs/srv/CommandTOL", self.takeoff),
            "cmd/land": ("mavros_msgs/srv/CommandTOL", self.land),
            "cmd/command": ("mavros_msgs/srv/CommandLong", self.command),
            "cmd/command_int": ("mavros_msgs/srv/CommandInt", self.command_int),
            "cmd/set_home": ("mavros_msgs/srv/CommandHome", self.set_home),
            "set_stream_rate": ("mavros_msgs/srv/StreamRate", self.set_stream_rate),
            "set_message_interval": ("mavros_msgs/srv/MessageInterval", self.set_message_interval),
        }

    def ask(self, command: int, *parameters: float, confirmation: int = 0) -> tuple[bool, int]:
        """Send a COMMAND_LONG; whether it was accepted, and the result (FAILED without an answer)."""
        padded = [*parameters, *[0.0] * (7 - len(parameters))]
        fields: dict[str, Any] = {"command": command, "confirmation": confirmation}
        fields.update({f"param{number}": value for number, value in enumerate(padded, start=1)})
        with self._one_at_a_time, self._wire.listen("COMMAND_ACK") as ear:
            self._wire.send_to("COMMAND_LONG", fields)
            while True:
                answer = ear.next(ACK_WITHIN)
                if answer is None:
                    self._warn(f"command {command}: no acknowledgement within {ACK_WITHIN // S} s")
                    return False, FAILED
                result = answer.fields["result"]
                if answer.fields["command"] == command and result != IN_PROGRESS:
                    return result == ACCEPTED, result

    def set_mode(self, request: Any) -> Any:
        """``set_mode``: sent, not waited for; look at ``state``."""
        response = service("mavros_msgs/srv/SetMode").response
        base, custom = request.base_mode, 0
        if request.custom_mode:
            number = mode_number(self._wire.firmware, request.custom_mode)
            if number is None:
                names = mode_names(self._wire.firmware)
                hint = did_you_mean(request.custom_mode.upper(), names)
                self._warn(f"set_mode: no mode {request.custom_mode!r}{hint}; there is {choices(names)}")
                return response(False)
            base, custom = CUSTOM_MODE_ENABLED, number
        system = self._wire.target[0]
        self._wire.send("SET_MODE", {"target_system": system, "base_mode": base, "custom_mode": custom})
        return response(True)

    def arming(self, request: Any) -> Any:
        """``cmd/arming``."""
        answer = self.ask(ARM_DISARM, 1.0 if request.value else 0.0)
        return service("mavros_msgs/srv/CommandBool").response(*answer)

    def _take_off_or_land(self, command: int, request: Any) -> Any:
        answer = self.ask(
            command,
            request.min_pitch,
            0.0,
            0.0,
            request.yaw,
            request.latitude,
            request.longitude,
            request.altitude,
        )
        return service("mavros_msgs/srv/CommandTOL").response(*answer)

    def takeoff(self, request: Any) -> Any:
        """``cmd/takeoff``: the altitude is what it means to the autopilot (PX4: AMSL, else above home)."""
        return self._take_off_or_land(TAKEOFF, request)

    def land(self, request: Any) -> Any:
        """``cmd/land``."""
        return self._take_off_or_land(LAND, request)

    def command(self, request: Any) -> Any:
        """``cmd/command``: any MAVLink command."""
        parameters = [getattr(request, f"param{number}") for number in range(1, 8)]
        answer = self.ask(request.command, *parameters, confirmation=request.confirmation)
        return service("mavros_msgs/srv/CommandLong").response(*answer)

    def command_int(self, request: Any) -> Any:
        """``cmd/command_int``: sent, not waited for."""
        names = (
            "frame",
            "command",
            "current",
            "autocontinue",
            "param1",
            "param2",
            "param3",
            "param4",
            "x",
            "y",
            "z",
        )
        self._wire.send_to("COMMAND_INT", {name: getattr(request, name) for name in names})
        return service("mavros_msgs/srv/CommandInt").response(True)

    def set_home(self, request: Any) -> Any:
        """``cmd/set_home``: AMSL altitude."""
        current = 1.0 if request.current_gps else 0.0
        place = (request.latitude, request.longitude, request.altitude)
        answer = self.ask(SET_HOME, current, 0.0, 0.0, request.yaw, *place)
        return service("mavros_msgs/srv/CommandHome").response(*answer)

    def set_stream_rate(self, request: Any) -> Any:
        """``set_stream_rate``: not acknowledged by MAVLink either."""
        rate = request.message_rate if request.on_off else 0
        request_stream(self._wire, request.stream_id, rate)
        return service("mavros_msgs/srv/StreamRate").response()

    def set_message_interval(self, request: Any) -> Any:
        """``set_message_interval``: hertz; 0 the autopilot's own rate, below 0 none."""
        rate = request.message_rate
        interval = -1.0 if rate < 0 else (0.0 if rate == 0 else 1e6 / rate)
        accepted, _ = self.ask(SET_MESSAGE_INTERVAL, float(request.message_id), interval)
        return service("mavros_msgs/srv/MessageInterval").response(accepted)
