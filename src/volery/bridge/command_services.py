"""MAVROS's command services: modes, arming, take-off, landing, any MAVLink command, stream rates.

A command is sent once. The response contains the autopilot's acknowledgement, or ``success`` false after
``ACK_TIMEOUT`` without one. As in MAVROS, ``set_mode`` and ``cmd/command_int`` do not wait for it.
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

ACK_TIMEOUT: Ns = 5 * S
ACCEPTED, FAILED, IN_PROGRESS = 0, 4, 5
CUSTOM_MODE_ENABLED = 1
LAND, TAKEOFF, SET_HOME, ARM_DISARM, SET_MESSAGE_INTERVAL = 21, 22, 179, 400, 511
_INT_FIELDS = ("frame", "command", "current", "autocontinue", "param1", "param2", "param3", "param4", *"xyz")


class CommandServices:
    """Handlers of the command services. One command is in progress at a time, others wait."""

    def __init__(self, context: InterfaceContext) -> None:
        self._link, self._warn = context.link, context.warn
        self._one_at_a_time = Lock(context.link.kernel, f"{context.node.name} (command)")

    def services(self) -> Mapping[str, Service]:
        """Return types and handlers by service name."""
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

    def send_command(self, command: int, *parameters: float, confirmation: int = 0) -> tuple[bool, int]:
        """Send a COMMAND_LONG and wait for its acknowledgement.

        Args:
            command: MAV_CMD.
            *parameters: Its parameters; missing ones are 0.
            confirmation: Number of earlier transmissions.

        Returns:
            Whether the command was accepted, and the MAV_RESULT (FAILED without an acknowledgement).
        """
        padded = [*parameters, *[0.0] * (7 - len(parameters))]
        fields: dict[str, Any] = {"command": command, "confirmation": confirmation}
        fields.update({f"param{number}": value for number, value in enumerate(padded, start=1)})
        with self._one_at_a_time, self._link.subscribe("COMMAND_ACK") as acknowledgements:
            self._link.send_to_autopilot("COMMAND_LONG", fields)
            while True:
                answer = acknowledgements.next(ACK_TIMEOUT)
                if answer is None:
                    self._warn(f"command {command}: no acknowledgement within {ACK_TIMEOUT // S} s")
                    return False, FAILED
                result = answer.fields["result"]
                if answer.fields["command"] == command and result != IN_PROGRESS:
                    return result == ACCEPTED, result

    def set_mode(self, request: Any) -> Any:
        """Handle ``set_mode``. The command is not acknowledged; ``state`` shows its effect."""
        response = service("mavros_msgs/srv/SetMode").response
        base, custom = request.base_mode, 0
        if request.custom_mode:
            number = mode_number(self._link.autopilot, request.custom_mode)
            if number is None:
                names = mode_names(self._link.autopilot)
                hint = did_you_mean(request.custom_mode.upper(), names)
                self._warn(f"set_mode: no mode {request.custom_mode!r}{hint}; there is {choices(names)}")
                return response(False)
            base, custom = CUSTOM_MODE_ENABLED, number
        system = self._link.target[0]
        self._link.send("SET_MODE", {"target_system": system, "base_mode": base, "custom_mode": custom})
        return response(True)

    def arming(self, request: Any) -> Any:
        """Handle ``cmd/arming``."""
        answer = self.send_command(ARM_DISARM, 1.0 if request.value else 0.0)
        return service("mavros_msgs/srv/CommandBool").response(*answer)

    def _take_off_or_land(self, command: int, request: Any) -> Any:
        place = (request.latitude, request.longitude, request.altitude)
        answer = self.send_command(command, request.min_pitch, 0.0, 0.0, request.yaw, *place)
        return service("mavros_msgs/srv/CommandTOL").response(*answer)

    def takeoff(self, request: Any) -> Any:
        """Handle ``cmd/takeoff``. The altitude is passed on: AMSL for PX4, else above home."""
        return self._take_off_or_land(TAKEOFF, request)

    def land(self, request: Any) -> Any:
        """Handle ``cmd/land``."""
        return self._take_off_or_land(LAND, request)

    def command(self, request: Any) -> Any:
        """Handle ``cmd/command``: any MAVLink command."""
        parameters = [getattr(request, f"param{number}") for number in range(1, 8)]
        answer = self.send_command(request.command, *parameters, confirmation=request.confirmation)
        return service("mavros_msgs/srv/CommandLong").response(*answer)

    def command_int(self, request: Any) -> Any:
        """Handle ``cmd/command_int``. The response does not wait for the acknowledgement."""
        self._link.send_to_autopilot("COMMAND_INT", {name: getattr(request, name) for name in _INT_FIELDS})
        return service("mavros_msgs/srv/CommandInt").response(True)

    def set_home(self, request: Any) -> Any:
        """Handle ``cmd/set_home``; the altitude is AMSL."""
        current = 1.0 if request.current_gps else 0.0
        place = (request.latitude, request.longitude, request.altitude)
        answer = self.send_command(SET_HOME, current, 0.0, 0.0, request.yaw, *place)
        return service("mavros_msgs/srv/CommandHome").response(*answer)

    def set_stream_rate(self, request: Any) -> Any:
        """Handle ``set_stream_rate``, which MAVLink does not acknowledge."""
        rate = request.message_rate if request.on_off else 0
        request_stream(self._link, request.stream_id, rate)
        return service("mavros_msgs/srv/StreamRate").response()

    def set_message_interval(self, request: Any) -> Any:
        """Handle ``set_message_interval``: a rate in Hz, 0 for the autopilot's default, below 0 for none."""
        rate = request.message_rate
        interval = -1.0 if rate < 0 else (0.0 if rate == 0 else 1e6 / rate)
        accepted, _ = self.send_command(SET_MESSAGE_INTERVAL, float(request.message_id), interval)
        return service("mavros_msgs/srv/MessageInterval").response(accepted)
