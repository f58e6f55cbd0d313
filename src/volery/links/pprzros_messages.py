"""Frames of pprzlink as messages of pprzros.

In ``pprzros_msgs/PprzrosMsg`` ``data`` is the payload as on the wire and ``len`` its length. Fields that
pprzros itself leaves at 0 (``comp_id``, ``receiver_id``, ``checksum``) are filled in. Of a received message
only name, sender and data are used.
"""

from __future__ import annotations

from typing import Any

from volery.base.errors import UsageError
from volery.base.time import Ns, S
from volery.links.frame import Frame
from volery.links.pprzlink_codec import HEADER, encode
from volery.links.pprzlink_messages import DATALINK, TELEMETRY, message_type
from volery.ros.messages import message_class, new

PPRZROS_TYPE = "pprzros_msgs/msg/PprzrosMsg"
TO_ROS, FROM_ROS = "pprzros/to_ros", "pprzros/from_ros"
"""Topics of messages from the aircraft and to the aircraft."""

PPRZROS_VERSION = 2
"""Protocol version 2.0."""

_CLASSES = {TELEMETRY: "telemetry", DATALINK: "datalink"}
_header = message_class("std_msgs/msg/Header")
_time = message_class("builtin_interfaces/msg/Time")


def to_message(frame: Frame, stamp: Ns) -> Any:
    """Return *frame* as a ROS message.

    Args:
        frame: The frame to convert.
        stamp: ROS time of the header in ns.

    Raises:
        UsageError: A field does not exist or does not fit.
    """
    octets = encode(frame)
    kind = message_type(frame.name)
    return new(
        PPRZROS_TYPE,
        header=_header(_time(*divmod(stamp, S)), ""),
        version=PPRZROS_VERSION,
        len=len(octets) - HEADER - 2,
        class_name=_CLASSES.get(kind.kind, "ground"),
        comp_id=frame.component,
        msg_name=frame.name,
        sender_id=frame.system,
        receiver_id=octets[3],
        checksum=octets[-2] << 8 | octets[-1],
        data=list(octets[HEADER:-2]),
    )


def to_frame(message: Any) -> Frame:
    """Return the frame in a ROS message.

    Raises:
        UsageError: The message name is unknown, or the payload has another length.
    """
    kind = message_type(str(message.msg_name))
    payload = bytes(message.data)
    fields = kind.unpack(payload)
    if fields is None:
        raise UsageError(f"{kind.name} of {len(payload)} bytes: it has another length here")
    return Frame(kind.name, fields, int(message.sender_id), int(message.comp_id) & 0x0F)
