"""Set-points in both directions: topics that command the autopilot, and publishers of its targets.

In the body frames (8, 9) vectors are forward, left, up on the ROS side; otherwise east, north, up. Yaw is
anticlockwise from east in ROS and clockwise from north in MAVLink. Altitudes of ``setpoint_raw/global`` are
passed on in the frame that the message names (AMSL, above home or above terrain); that of
``setpoint_position/global`` is above the ellipsoid.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from volery.base import frames
from volery.base.geoid import Geoid
from volery.base.time import MS, Ns
from volery.bridge.node_interface import (
    Fields,
    InterfaceContext,
    OutgoingMessage,
    Subscription,
    Topic,
    Translator,
    stamped,
)
from volery.ros.messages import message_class, new

BODY_FRAMES = frozenset({8, 9})
LOCAL_NED, GLOBAL_INT = 1, 5
POSITION_AND_YAW = 8 | 16 | 32 | 64 | 128 | 256 | 2048
VELOCITY_AND_YAW_RATE = 1 | 2 | 4 | 64 | 128 | 256 | 1024


def subscriptions(geoid: Geoid) -> tuple[Subscription, ...]:
    """Return all set-point subscriptions; *geoid* converts ellipsoidal altitudes to AMSL."""

    def position_global(message: Any, now: Ns) -> OutgoingMessage:
        return _position_global(message, now, geoid)

    return (
        Subscription("setpoint_raw/local", "mavros_msgs/msg/PositionTarget", raw_local),
        Subscription("setpoint_raw/global", "mavros_msgs/msg/GlobalPositionTarget", raw_global),
        Subscription("setpoint_position/local", "geometry_msgs/msg/PoseStamped", position_local),
        Subscription("setpoint_position/global", "geographic_msgs/msg/GeoPoseStamped", position_global),
        Subscription("setpoint_raw/attitude", "mavros_msgs/msg/AttitudeTarget", raw_attitude),
        Subscription("setpoint_velocity/cmd_vel", "geometry_msgs/msg/TwistStamped", velocity),
        Subscription("setpoint_velocity/cmd_vel_unstamped", "geometry_msgs/msg/Twist", velocity_unstamped),
        Subscription("rc/override", "mavros_msgs/msg/OverrideRCIn", rc_override),
        Subscription("manual_control/send", "mavros_msgs/msg/ManualControl", manual_control),
        Subscription("statustext/send", "mavros_msgs/msg/StatusText", status_text),
    )


def _vector(value: Any) -> frames.Vector:
    return value.x, value.y, value.z


def _motion(velocity: frames.Vector, acceleration: frames.Vector) -> dict[str, float]:
    vx, vy, vz = velocity
    afx, afy, afz = acceleration
    return {"vx": vx, "vy": vy, "vz": vz, "afx": afx, "afy": afy, "afz": afz}


def raw_local(message: Any, now: Ns) -> OutgoingMessage:
    """Translate ``setpoint_raw/local``."""
    body = message.coordinate_frame in BODY_FRAMES
    turn = frames.flu_to_frd if body else frames.enu_to_ned
    x, y, z = turn(_vector(message.position))
    yaw = -message.yaw if body else frames.yaw_to_heading(message.yaw)
    return "SET_POSITION_TARGET_LOCAL_NED", {
        "time_boot_ms": now // MS,
        "coordinate_frame": message.coordinate_frame,
        "type_mask": message.type_mask,
        "x": x,
        "y": y,
        "z": z,
        **_motion(turn(_vector(message.velocity)), turn(_vector(message.acceleration_or_force))),
        "yaw": yaw,
        "yaw_rate": -message.yaw_rate,
    }


def raw_global(message: Any, now: Ns) -> OutgoingMessage:
    """Translate ``setpoint_raw/global``."""
    velocity = frames.enu_to_ned(_vector(message.velocity))
    acceleration = frames.enu_to_ned(_vector(message.acceleration_or_force))
    return "SET_POSITION_TARGET_GLOBAL_INT", {
        "time_boot_ms": now // MS,
        "coordinate_frame": message.coordinate_frame,
        "type_mask": message.type_mask,
        "lat_int": round(message.latitude * 1e7),
        "lon_int": round(message.longitude * 1e7),
        "alt": message.altitude,
        **_motion(velocity, acceleration),
        "yaw": frames.yaw_to_heading(message.yaw),
        "yaw_rate": -message.yaw_rate,
    }


def raw_attitude(message: Any, now: Ns) -> OutgoingMessage:
    """Translate ``setpoint_raw/attitude``: attitude of the FLU body in ENU, rates in FLU, thrust 0..1."""
    orientation = message.orientation
    enu = (orientation.w, orientation.x, orientation.y, orientation.z)
    roll_rate, pitch_rate, yaw_rate = frames.flu_to_frd(_vector(message.body_rate))
    return "SET_ATTITUDE_TARGET", {
        "time_boot_ms": now // MS,
        "type_mask": message.type_mask,
        "q": list(frames.attitude_enu_to_ned(enu)),
        "body_roll_rate": roll_rate,
        "body_pitch_rate": pitch_rate,
        "body_yaw_rate": yaw_rate,
        "thrust": message.thrust,
    }


def _heading(orientation: Any) -> float:
    enu = (orientation.w, orientation.x, orientation.y, orientation.z)
    return frames.yaw_to_heading(frames.quaternion_to_euler(enu)[2])


def position_local(message: Any, now: Ns) -> OutgoingMessage:
    """Translate ``setpoint_position/local``."""
    x, y, z = frames.enu_to_ned(_vector(message.pose.position))
    return "SET_POSITION_TARGET_LOCAL_NED", {
        "time_boot_ms": now // MS,
        "coordinate_frame": LOCAL_NED,
        "type_mask": POSITION_AND_YAW,
        "x": x,
        "y": y,
        "z": z,
        "yaw": _heading(message.pose.orientation),
    }


def _position_global(message: Any, now: Ns, geoid: Geoid) -> OutgoingMessage:
    position = message.pose.position
    return "SET_POSITION_TARGET_GLOBAL_INT", {
        "time_boot_ms": now // MS,
        "coordinate_frame": GLOBAL_INT,
        "type_mask": POSITION_AND_YAW,
        "lat_int": round(position.latitude * 1e7),
        "lon_int": round(position.longitude * 1e7),
        "alt": geoid.to_amsl(position.latitude, position.longitude, position.altitude),
        "yaw": _heading(message.pose.orientation),
    }


def velocity(message: Any, now: Ns) -> OutgoingMessage:
    """Translate ``setpoint_velocity/cmd_vel``: ENU in m/s, yaw rate anticlockwise in rad/s."""
    return velocity_unstamped(message.twist, now)


def velocity_unstamped(message: Any, now: Ns) -> OutgoingMessage:
    """Translate ``setpoint_velocity/cmd_vel_unstamped``: the same without a header."""
    vx, vy, vz = frames.enu_to_ned(_vector(message.linear))
    return "SET_POSITION_TARGET_LOCAL_NED", {
        "time_boot_ms": now // MS,
        "coordinate_frame": LOCAL_NED,
        "type_mask": VELOCITY_AND_YAW_RATE,
        "vx": vx,
        "vy": vy,
        "vz": vz,
        "yaw_rate": -message.angular.z,
    }


def rc_override(message: Any, now: Ns) -> OutgoingMessage:
    """Translate ``rc/override``: microseconds; 0 releases a channel, 65535 leaves it unchanged."""
    channels = {f"chan{number}_raw": int(value) for number, value in enumerate(message.channels, start=1)}
    return "RC_CHANNELS_OVERRIDE", channels


def manual_control(message: Any, now: Ns) -> OutgoingMessage:
    """Translate ``manual_control/send``: x forward, y right, z throttle, r yaw clockwise, -1000..1000."""
    return "MANUAL_CONTROL", {
        "x": round(message.x),
        "y": round(message.y),
        "z": round(message.z),
        "r": round(message.r),
        "buttons": message.buttons,
    }


def status_text(message: Any, now: Ns) -> OutgoingMessage:
    """Translate ``statustext/send``, which is for ground stations behind the autopilot."""
    return "STATUSTEXT", {"severity": message.severity, "text": message.text}


_LOCAL, _GLOBAL = "mavros_msgs/msg/PositionTarget", "mavros_msgs/msg/GlobalPositionTarget"
_ATTITUDE = "mavros_msgs/msg/AttitudeTarget"
_point = message_class("geometry_msgs/msg/Point")
_ros_vector = message_class("geometry_msgs/msg/Vector3")
_quaternion = message_class("geometry_msgs/msg/Quaternion")

TARGET_TOPICS = (
    Topic("setpoint_raw/target_local", _LOCAL, on_demand=True),
    Topic("setpoint_raw/target_global", _GLOBAL, on_demand=True),
    Topic("setpoint_raw/target_attitude", _ATTITUDE, on_demand=True),
)


class TargetPublisher:
    """Publishes the targets that the autopilot reports."""

    def __init__(self, context: InterfaceContext) -> None:
        self._publish, self._wanted = context.publish, context.wanted

    def translators(self) -> Mapping[str, Translator]:
        """Return the translators by message name."""
        return {
            "POSITION_TARGET_LOCAL_NED": self._local,
            "POSITION_TARGET_GLOBAL_INT": self._global,
            "ATTITUDE_TARGET": self._attitude,
        }

    def _local(self, fields: Fields, at: Ns) -> None:
        """Publish the local target in ENU."""
        if self._wanted("setpoint_raw/target_local"):
            position = _point(*frames.ned_to_enu((fields["x"], fields["y"], fields["z"])))
            message = new(_LOCAL, header=stamped(at), position=position, **_motion_fields(fields))
            self._publish("setpoint_raw/target_local", message)

    def _global(self, fields: Fields, at: Ns) -> None:
        """Publish the global target; the altitude is in the frame that the message names."""
        if self._wanted("setpoint_raw/target_global"):
            place = {
                "latitude": fields["lat_int"] / 1e7,
                "longitude": fields["lon_int"] / 1e7,
                "altitude": fields["alt"],
            }
            message = new(_GLOBAL, header=stamped(at), **place, **_motion_fields(fields))
            self._publish("setpoint_raw/target_global", message)

    def _attitude(self, fields: Fields, at: Ns) -> None:
        if self._wanted("setpoint_raw/target_attitude"):
            w, x, y, z = frames.attitude_ned_to_enu(tuple(fields["q"]))
            rates = (fields["body_roll_rate"], fields["body_pitch_rate"], fields["body_yaw_rate"])
            message = new(
                _ATTITUDE, header=stamped(at), type_mask=fields["type_mask"], thrust=fields["thrust"]
            )
            message.orientation, message.body_rate = (
                _quaternion(x, y, z, w),
                _ros_vector(*frames.frd_to_flu(rates)),
            )
            self._publish("setpoint_raw/target_attitude", message)


def _motion_fields(fields: Fields) -> Fields:
    """Return the fields that local and global targets have in common."""
    return {
        "coordinate_frame": fields["coordinate_frame"],
        "type_mask": fields["type_mask"],
        "velocity": _ros_vector(*frames.ned_to_enu((fields["vx"], fields["vy"], fields["vz"]))),
        "acceleration_or_force": _ros_vector(
            *frames.ned_to_enu((fields["afx"], fields["afy"], fields["afz"]))
        ),
        "yaw": frames.heading_to_yaw(fields["yaw"]),
        "yaw_rate": -fields["yaw_rate"],
    }
