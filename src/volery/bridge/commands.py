"""What commands the autopilot: MAVROS's command services and set-point topics, and publishers of its targets.

A command (modes, arming, take-off, landing, any MAVLink command, stream rates) is sent once. The response
contains the autopilot's acknowledgement, or ``success`` false after ``ACK_TIMEOUT`` without one. As in
MAVROS, ``set_mode`` and ``cmd/command_int`` do not wait for it.

In the body frames (8, 9) vectors are forward, left, up on the ROS side; otherwise east, north, up. Yaw is
anticlockwise from east in ROS and clockwise from north in MAVLink. Altitudes of ``setpoint_raw/global`` are
passed on in the frame that the message names (AMSL, above home or above terrain); that of
``setpoint_position/global`` is above the ellipsoid.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from volery.base import frames
from volery.base.errors import choices, did_you_mean
from volery.base.geoid import Geoid
from volery.base.time import MS, Ns, S
from volery.bridge.autopilot_link import mode_names, mode_number, request_stream
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
from volery.kernel.waiting import Lock
from volery.links.mavlink_messages import constant
from volery.ros.messages import message_class, new, service

ACK_TIMEOUT: Ns = 5 * S
ACCEPTED = constant("MAV_RESULT_ACCEPTED")
FAILED = constant("MAV_RESULT_FAILED")
IN_PROGRESS = constant("MAV_RESULT_IN_PROGRESS")
CUSTOM_MODE_ENABLED = constant("MAV_MODE_FLAG_CUSTOM_MODE_ENABLED")
LAND = constant("MAV_CMD_NAV_LAND")
TAKEOFF = constant("MAV_CMD_NAV_TAKEOFF")
SET_HOME = constant("MAV_CMD_DO_SET_HOME")
ARM_DISARM = constant("MAV_CMD_COMPONENT_ARM_DISARM")
GET_HOME = constant("MAV_CMD_GET_HOME_POSITION")
SET_MESSAGE_INTERVAL = constant("MAV_CMD_SET_MESSAGE_INTERVAL")
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
            "home_position/req_update": ("std_srvs/srv/Trigger", self.request_home),
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
        result = self.request("COMMAND_LONG", fields)
        return result == ACCEPTED, FAILED if result is None else result

    def request(self, message: str, fields: Fields) -> int | None:
        """Send a COMMAND_LONG or COMMAND_INT and wait for its acknowledgement.

        Returns:
            The MAV_RESULT, or None without an acknowledgement within ``ACK_TIMEOUT``.
        """
        command = fields["command"]
        with self._one_at_a_time, self._link.subscribe("COMMAND_ACK") as acknowledgements:
            self._link.send_to_autopilot(message, fields)
            kernel = self._link.kernel
            until = kernel.now() + ACK_TIMEOUT  # other commands are acknowledged meanwhile
            while True:
                answer = acknowledgements.next(max(0, until - kernel.now()))
                if answer is None:
                    self._warn(f"command {command}: no acknowledgement within {ACK_TIMEOUT // S} s")
                    return None
                result: int = answer.fields["result"]
                if answer.fields["command"] != command:
                    continue
                if result != IN_PROGRESS:
                    return result
                until = kernel.now() + ACK_TIMEOUT

    def set_mode(self, request: Any) -> Any:
        """Handle ``set_mode``. The command is not acknowledged; ``state`` shows its effect."""
        response = service("mavros_msgs/srv/SetMode").response
        base, custom = request.base_mode, 0
        if request.custom_mode and not self._link.known:
            self._warn(
                "set_mode: no heartbeat of an autopilot yet, so its modes are unknown; wait for connected"
            )
            return response(False)
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

    def request_home(self, request: Any) -> Any:
        """Handle ``home_position/req_update``: the autopilot sends its home position."""
        accepted, _ = self.send_command(GET_HOME)
        return service("std_srvs/srv/Trigger").response(accepted, "")

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


BODY_FRAMES = frozenset({8, 9})
LOCAL_NED, GLOBAL_INT = 1, 5
POSITION_AND_YAW = 8 | 16 | 32 | 64 | 128 | 256 | 2048
VELOCITY_AND_YAW_RATE = 1 | 2 | 4 | 64 | 128 | 256 | 1024
ACCELERATION_ONLY = 1 | 2 | 4 | 8 | 16 | 32 | 1024 | 2048
ATTITUDE_RATES_IGNORED, ATTITUDE_IGNORED = 1 | 2 | 4, 128


def subscriptions(geoid: Geoid) -> tuple[SubscribedTopic, ...]:
    """Return all set-point subscriptions; *geoid* converts ellipsoidal altitudes to AMSL."""

    def position_global(message: Any, now: Ns) -> OutgoingMessage:
        return _position_global(message, now, geoid)

    attitudes = ThrustPairs()
    return (
        SubscribedTopic("setpoint_accel/accel", "geometry_msgs/msg/Vector3Stamped", acceleration),
        SubscribedTopic("setpoint_attitude/attitude", "geometry_msgs/msg/PoseStamped", attitudes.attitude),
        SubscribedTopic("setpoint_attitude/cmd_vel", "geometry_msgs/msg/TwistStamped", attitudes.rates),
        SubscribedTopic("setpoint_attitude/thrust", "mavros_msgs/msg/Thrust", attitudes.thrust),
        SubscribedTopic("setpoint_raw/local", "mavros_msgs/msg/PositionTarget", raw_local),
        SubscribedTopic("setpoint_raw/global", "mavros_msgs/msg/GlobalPositionTarget", raw_global),
        SubscribedTopic("setpoint_position/local", "geometry_msgs/msg/PoseStamped", position_local),
        SubscribedTopic("setpoint_position/global", "geographic_msgs/msg/GeoPoseStamped", position_global),
        SubscribedTopic("setpoint_raw/attitude", "mavros_msgs/msg/AttitudeTarget", raw_attitude),
        SubscribedTopic("setpoint_velocity/cmd_vel", "geometry_msgs/msg/TwistStamped", velocity),
        SubscribedTopic("setpoint_velocity/cmd_vel_unstamped", "geometry_msgs/msg/Twist", velocity_unstamped),
        SubscribedTopic("rc/override", "mavros_msgs/msg/OverrideRCIn", rc_override),
        SubscribedTopic("manual_control/send", "mavros_msgs/msg/ManualControl", manual_control),
        SubscribedTopic("statustext/send", "mavros_msgs/msg/StatusText", status_text),
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


def acceleration(message: Any, now: Ns) -> OutgoingMessage:
    """Translate ``setpoint_accel/accel``: ENU in m/s^2."""
    return "SET_POSITION_TARGET_LOCAL_NED", {
        "time_boot_ms": now // MS,
        "coordinate_frame": LOCAL_NED,
        "type_mask": ACCELERATION_ONLY,
        **_motion((0.0, 0.0, 0.0), frames.enu_to_ned(_vector(message.vector))),
    }


class ThrustPairs:
    """Translates ``setpoint_attitude``: a thrust and an attitude, or body rates, are sent as one.

    MAVROS takes pairs of about the same stamp. Here a message waits for the next of the other topic.
    """

    def __init__(self) -> None:
        self._thrust: float | None = None
        self._turn: Fields | None = None

    def attitude(self, message: Any, now: Ns) -> list[OutgoingMessage]:
        """Take the attitude of the FLU body in ENU."""
        turned = message.pose.orientation
        q = frames.attitude_enu_to_ned((turned.w, turned.x, turned.y, turned.z))
        self._turn = {"type_mask": ATTITUDE_RATES_IGNORED, "q": list(q)}
        return self._pair(now)

    def rates(self, message: Any, now: Ns) -> list[OutgoingMessage]:
        """Take body rates in FLU, rad/s."""
        roll, pitch, yaw = frames.flu_to_frd(_vector(message.twist.angular))
        rates = {"body_roll_rate": roll, "body_pitch_rate": pitch, "body_yaw_rate": yaw}
        self._turn = {"type_mask": ATTITUDE_IGNORED, "q": [1.0, 0.0, 0.0, 0.0], **rates}
        return self._pair(now)

    def thrust(self, message: Any, now: Ns) -> list[OutgoingMessage]:
        """Take a thrust 0..1."""
        self._thrust = message.thrust
        return self._pair(now)

    def _pair(self, now: Ns) -> list[OutgoingMessage]:
        if self._thrust is None or self._turn is None:
            return []
        fields = {"time_boot_ms": now // MS, **self._turn, "thrust": self._thrust}
        self._thrust = self._turn = None
        return [("SET_ATTITUDE_TARGET", fields)]


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
    PublishedByNode("setpoint_raw/target_local", _LOCAL, on_demand=True),
    PublishedByNode("setpoint_raw/target_global", _GLOBAL, on_demand=True),
    PublishedByNode("setpoint_raw/target_attitude", _ATTITUDE, on_demand=True),
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
