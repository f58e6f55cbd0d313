"""MAVROS's topics and services for a gimbal, for logs on board, for RTK corrections and for whole messages.

As in MAVROS, the log services only send the request; entries and data arrive as messages on topics.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from itertools import count
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.bridge.commands import CommandServices
from volery.bridge.node_interface import (
    Fields,
    InterfaceContext,
    OutgoingMessage,
    PublishedByNode,
    Service,
    SubscribedTopic,
    Translator,
    stamped,
)
from volery.links.frame import Frame
from volery.links.mavlink_codec import STX_V1, MavlinkParser
from volery.links.mavlink_messages import constant
from volery.ros.graph import QoS
from volery.ros.messages import message_class, new, service
from volery.vehicles.rtcm import LARGEST, correction_parts

LOG_QUEUE = QoS(1000)
_ENTRY, _DATA = "mavros_msgs/msg/LogEntry", "mavros_msgs/msg/LogData"
_time = message_class("builtin_interfaces/msg/Time")

PAYLOAD_TOPICS = (
    PublishedByNode("log_transfer/raw/log_entry", _ENTRY, LOG_QUEUE),
    PublishedByNode("log_transfer/raw/log_data", _DATA, LOG_QUEUE),
)
_CONTROL, _CONFIGURE = constant("MAV_CMD_DO_MOUNT_CONTROL"), constant("MAV_CMD_DO_MOUNT_CONFIGURE")
SEQUENCES = 32


class LogServices:
    """Handlers of the log services, and translators of what arrives."""

    def __init__(self, context: InterfaceContext) -> None:
        self._link, self._publish = context.link, context.publish

    def services(self) -> Mapping[str, Service]:
        """Return types and handlers by service name."""
        return {
            "log_transfer/raw/log_request_list": ("mavros_msgs/srv/LogRequestList", self.request_list),
            "log_transfer/raw/log_request_data": ("mavros_msgs/srv/LogRequestData", self.request_data),
            "log_transfer/raw/log_request_end": ("mavros_msgs/srv/LogRequestEnd", self.request_end),
        }

    def translators(self) -> Mapping[str, Translator]:
        """Return the translators by message name."""
        return {"LOG_ENTRY": self._publish_entry, "LOG_DATA": self._publish_data}

    def request_list(self, request: Any) -> Any:
        """Handle ``log_request_list``."""
        self._link.send_to_autopilot("LOG_REQUEST_LIST", {"start": request.start, "end": request.end})
        return service("mavros_msgs/srv/LogRequestList").response(True)

    def request_data(self, request: Any) -> Any:
        """Handle ``log_request_data``."""
        fields = {"id": request.id, "ofs": request.offset, "count": request.count}
        self._link.send_to_autopilot("LOG_REQUEST_DATA", fields)
        return service("mavros_msgs/srv/LogRequestData").response(True)

    def request_end(self, request: Any) -> Any:
        """Handle ``log_request_end``."""
        self._link.send_to_autopilot("LOG_REQUEST_END", {})
        return service("mavros_msgs/srv/LogRequestEnd").response(True)

    def _publish_entry(self, fields: Fields, at: Ns) -> None:
        message = new(
            _ENTRY,
            header=stamped(at),
            id=fields["id"],
            num_logs=fields["num_logs"],
            last_log_num=fields["last_log_num"],
            time_utc=_time(fields["time_utc"], 0),
            size=fields["size"],
        )
        self._publish("log_transfer/raw/log_entry", message)

    def _publish_data(self, fields: Fields, at: Ns) -> None:
        data = bytes(fields["data"][: fields["count"]])
        message = new(_DATA, header=stamped(at), id=fields["id"], offset=fields["ofs"], data=list(data))
        self._publish("log_transfer/raw/log_data", message)


def mount_services(commands: CommandServices) -> Mapping[str, Service]:
    """Return the service that configures a gimbal."""

    def configure(request: Any) -> Any:
        answer = commands.send_command(
            _CONFIGURE,
            request.mode,
            request.stabilize_roll,
            request.stabilize_pitch,
            request.stabilize_yaw,
            request.roll_input,
            request.pitch_input,
            request.yaw_input,
        )
        return service("mavros_msgs/srv/MountConfigure").response(*answer)

    return {"mount_control/configure": ("mavros_msgs/srv/MountConfigure", configure)}


def payload_subscriptions() -> tuple[SubscribedTopic, ...]:
    """Return the subscriptions for gimbal and corrections."""
    return (
        SubscribedTopic("mount_control/command", "mavros_msgs/msg/MountControl", mount_control),
        SubscribedTopic("gps_rtk/send_rtcm", "mavros_msgs/msg/RTCM", partial(corrections, count())),
    )


def raw_subscription(namespace: str) -> SubscribedTopic:
    """Return the subscription for whole MAVLink messages; MAVROS 1 has it beside its node's namespace."""
    above = namespace.rstrip("/").rpartition("/")[0] if namespace.endswith("/mavros") else namespace
    return SubscribedTopic(f"{above.rstrip('/')}/mavlink/to", "mavros_msgs/msg/Mavlink", whole_message)


def whole_message(message: Any, now: Ns) -> Frame:
    """Return the frame of a ``mavros_msgs/Mavlink``; ``UsageError`` if it is none."""
    version_1 = message.magic == STX_V1
    flags = () if version_1 else (message.incompat_flags, message.compat_flags)
    start = message.magic, message.len, *flags, message.seq, message.sysid, message.compid
    number = int(message.msgid).to_bytes(1 if version_1 else 3, "little")
    words = [int(one).to_bytes(8, "little") for one in message.payload64]
    payload = b"".join(words)[: message.len]
    whole = bytes(start) + number + payload + int(message.checksum).to_bytes(2, "little")
    frames = MavlinkParser().feed(whole + bytes(message.signature))
    if not frames:
        raise UsageError(f"MAVLink message {message.msgid} is unknown or its checksum is wrong")
    return frames[0]


def mount_control(message: Any, now: Ns) -> OutgoingMessage:
    """Translate ``mount_control/command``: degrees, passed on as they are."""
    values = (
        message.pitch,
        message.roll,
        message.yaw,
        message.altitude,
        message.latitude,
        message.longitude,
        message.mode,
    )
    named = {f"param{number}": float(value) for number, value in enumerate(values, 1)}
    return "COMMAND_LONG", {"command": _CONTROL, **named}


def corrections(numbers: count[int], message: Any, now: Ns) -> list[OutgoingMessage]:
    """Translate ``gps_rtk/send_rtcm``: one RTCM message in up to four parts."""
    data = bytes(message.data)
    if len(data) > LARGEST:
        raise UsageError(f"an RTCM message of {len(data)} bytes; MAVLink carries {LARGEST}")
    sequence = next(numbers) % SEQUENCES
    return [("GPS_RTCM_DATA", fields) for fields in correction_parts(data, sequence)]
