"""ArduPilot's own ROS 2 interface (AP_DDS): the topics and services below ``ap``.

Positions are east, north, up, bodies forward, left, up. As in the firmware, and not as REP 103 would have it:
altitudes of ``geopose/filtered``, ``navsat``, ``goal_lla`` and ``gps_global_origin/filtered`` are AMSL;
``pose/filtered`` is about home; the linear part of ``twist/filtered`` is in the axes of the earth although
its frame is ``base_link``; in ``cmd_vel`` of the frame ``base_link`` y is to the right.

Differences from the firmware: rates are at most 30 Hz, also of ``time`` and ``clock``, which the firmware
publishes at 100 Hz; most topics are published only while they have a subscription; ``status`` shows a change
of mode or arming with the next heartbeat; the orientation in ``imu/experimental/data`` has its elements in
their places, which that of 4.6 has not. Not offered: ``airspeed``, ``tf``, parameters, rally points,
``experimental/target_attitude``.

Names of 4.5 end with the number of a sensor: ``navsat/navsat0``, ``battery/battery0``; it has neither
``status``, ``goal_lla``, ``rc`` nor the services ``prearm_check`` and ``experimental/takeoff``.

Sources: ``AP_DDS_Topic_Table.h``, ``AP_DDS_Client.cpp`` and ``AP_DDS_ExternalControl.cpp`` of ArduPilot.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import isnan, nan
from typing import Any

from volery.base import frames
from volery.base.time import MS, Ns, S
from volery.bridge.commands import ARM_DISARM, TAKEOFF, VELOCITY_AND_YAW_RATE, CommandServices
from volery.bridge.motion_publishers import IMU_SOURCES, body_rates, imu_measurement, imu_source, orientation
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
from volery.links.mavlink_messages import constant
from volery.ros.graph import BEST_EFFORT, LATCHED, QoS
from volery.ros.messages import message_class, new, service

OLDEST = "4.5"
RATES: Mapping[str, float] = {
    "ATTITUDE": 30.0,
    "LOCAL_POSITION_NED": 30.0,
    "GLOBAL_POSITION_INT": 30.0,
    "RAW_IMU": 30.0,
    "RC_CHANNELS": 10.0,
    "GPS_RAW_INT": 5.0,
    "SYS_STATUS": 5.0,
    "EXTENDED_SYS_STATE": 5.0,
    "POSITION_TARGET_GLOBAL_INT": 5.0,
    "BATTERY_STATUS": 1.0,
    "HOME_POSITION": 1.0,
    "GPS_GLOBAL_ORIGIN": 1.0,
}
"""Rates in Hz of the MAVLink messages that are requested from the autopilot."""

_SENSOR = QoS(depth=5, reliability=BEST_EFFORT)
_CLOCK = QoS(depth=20)
_GEO_POINT, _TIME = "geographic_msgs/msg/GeoPointStamped", "builtin_interfaces/msg/Time"
_TOPICS = (
    PublishedByNode("time", _TIME, _CLOCK, on_demand=True),
    PublishedByNode("clock", "rosgraph_msgs/msg/Clock", _CLOCK, on_demand=True),
    PublishedByNode("navsat", "sensor_msgs/msg/NavSatFix", _SENSOR, on_demand=True),
    PublishedByNode("battery", "sensor_msgs/msg/BatteryState", _SENSOR, on_demand=True),
    PublishedByNode("imu/experimental/data", "sensor_msgs/msg/Imu", _SENSOR, on_demand=True),
    PublishedByNode("pose/filtered", "geometry_msgs/msg/PoseStamped", _SENSOR, on_demand=True),
    PublishedByNode("twist/filtered", "geometry_msgs/msg/TwistStamped", _SENSOR, on_demand=True),
    PublishedByNode("geopose/filtered", "geographic_msgs/msg/GeoPoseStamped", _SENSOR, on_demand=True),
    PublishedByNode("gps_global_origin/filtered", _GEO_POINT, _SENSOR, on_demand=True),
    PublishedByNode("goal_lla", _GEO_POINT, LATCHED),
    PublishedByNode("status", "ardupilot_msgs/msg/Status", LATCHED),
    PublishedByNode("rc", "ardupilot_msgs/msg/Rc", _SENSOR, on_demand=True),
    PublishedByNode("tf_static", "tf2_msgs/msg/TFMessage", LATCHED),
)
_NUMBERED = {"navsat": "navsat/navsat0", "battery": "battery/battery0"}
_NOT_IN_OLDEST = frozenset({"status", "goal_lla", "rc", "imu/experimental/data"})
_SERVICES_NOT_IN_OLDEST = ("prearm_check", "experimental/takeoff")
TOPIC_COUNT = len(_TOPICS)

BASE_LINK, BASE_LINK_NED, MAP = "base_link", "base_link_ned", "map"
_FIRST = "0"
"""Frame of the first sensor of a kind."""
_COPTER, _ROVER = 2, 1
_ROVER_TYPES = (10, 11)
_SAFETY_ARMED = constant("MAV_MODE_FLAG_SAFETY_ARMED")
_ON_GROUND = constant("MAV_LANDED_STATE_ON_GROUND")
_PREARM_CHECK = constant("MAV_SYS_STATUS_PREARM_CHECK")
_HEALTH_OF = {21: 0x1_0000, 22: 0x200_0000}
"""MAV_SYS_STATUS_SENSOR that is not healthy in the failsafes of radio and battery."""
_CRITICAL = constant("MAV_STATE_CRITICAL")
"""State of a failsafe."""
_UNKNOWN_U16 = 65_535
_NO_TEMPERATURE = 32_767
_DO_SET_MODE, _CUSTOM_MODE_ENABLED = 176, 1
_LOCAL_NED = constant("MAV_FRAME_LOCAL_NED")
_FRAMES = (5, 6, 11)
_IGNORES_PLACE = 0b111
_POSITION_ONLY = 0b1101_1111_1000
_FIX_2D, _FIX_DGPS, _FIX_RTK = 2, 4, 5
_UNKNOWN = -1.0

_vector = message_class("geometry_msgs/msg/Vector3")
_point = message_class("geometry_msgs/msg/Point")
_geo_point = message_class("geographic_msgs/msg/GeoPoint")
_time = message_class(_TIME)


class ArduPilotInterface:
    """Translators and handlers below ``ap``.

    Args:
        context: What the parts of an interface work with.
        version: Version of the firmware: ``OLDEST``, or newer.
    """

    def __init__(self, context: InterfaceContext, version: str) -> None:
        self._link, self._warn = context.link, context.warn
        self._send, self._is_wanted = context.publish, context.wanted
        self._commands = CommandServices(context)
        self._oldest = version == OLDEST
        self._names = {
            topic.name: f"ap/{_NUMBERED.get(topic.name, topic.name) if self._oldest else topic.name}"
            for topic in _TOPICS
            if not (self._oldest and topic.name in _NOT_IN_OLDEST)
        }
        self._status: Any = None
        self._goal: Any = None
        self._static_sent = False
        self._warned: set[str] = set()

    def topics(self) -> tuple[PublishedByNode, ...]:
        """Return the topics that are published."""
        return tuple(one._replace(name=self._names[one.name]) for one in _TOPICS if one.name in self._names)

    def translators(self) -> Mapping[str, Translator]:
        """Return the translators by message name."""
        return {
            "HEARTBEAT": self._heartbeat,
            "ATTITUDE": self._clocks,
            "LOCAL_POSITION_NED": self._local,
            "GLOBAL_POSITION_INT": self._global,
            "GPS_RAW_INT": self._navsat,
            "BATTERY_STATUS": self._battery,
            "RC_CHANNELS": self._rc,
            "POSITION_TARGET_GLOBAL_INT": self._target,
            "GPS_GLOBAL_ORIGIN": self._origin,
            **{name: partial(self._imu, name) for name in IMU_SOURCES},
        }

    def subscriptions(self) -> tuple[SubscribedTopic, ...]:
        """Return the topics that are taken."""
        return (
            SubscribedTopic("ap/joy", "sensor_msgs/msg/Joy", joy),
            SubscribedTopic("ap/cmd_vel", "geometry_msgs/msg/TwistStamped", self._velocity),
            SubscribedTopic("ap/cmd_gps_pose", "ardupilot_msgs/msg/GlobalPosition", self._global_position),
        )

    def services(self) -> Mapping[str, Service]:
        """Return types and handlers by service name."""
        offered: dict[str, Service] = {
            "arm_motors": ("ardupilot_msgs/srv/ArmMotors", self._arm),
            "mode_switch": ("ardupilot_msgs/srv/ModeSwitch", self._switch_mode),
            "prearm_check": ("std_srvs/srv/Trigger", self._check),
            "experimental/takeoff": ("ardupilot_msgs/srv/Takeoff", self._take_off),
        }
        left_out = _SERVICES_NOT_IN_OLDEST if self._oldest else ()
        return {f"ap/{name}": one for name, one in offered.items() if name not in left_out}

    def _wanted(self, topic: str) -> bool:
        return topic in self._names and self._is_wanted(self._names[topic])

    def _publish(self, topic: str, message: Any) -> None:
        self._send(self._names[topic], message)

    def _warn_once(self, text: str) -> None:
        if text not in self._warned:
            self._warned.add(text)
            self._warn(text)

    # -- state

    def _heartbeat(self, fields: Fields, at: Ns) -> None:
        if not self._static_sent:
            self._static_sent = True
            receiver = new("geometry_msgs/msg/TransformStamped", header=stamped(at, BASE_LINK))
            receiver.child_frame_id, receiver.transform.rotation.w = "GPS_0", 1.0
            self._publish("tf_static", new("tf2_msgs/msg/TFMessage", transforms=[receiver]))
        if "status" not in self._names:
            return
        landed = self._link.last("EXTENDED_SYS_STATE") or {}
        armed = bool(fields["base_mode"] & _SAFETY_ARMED)
        state = {
            "vehicle_type": _ROVER if fields["type"] in _ROVER_TYPES else _COPTER,
            "armed": armed,
            "mode": fields["custom_mode"],
            "flying": armed and landed.get("landed_state", _ON_GROUND) != _ON_GROUND,
            "external_control": True,
            "failsafe": self._failsafes() if fields["system_status"] == _CRITICAL else [],
        }
        if state != self._status:  # published when it changes
            self._status = state
            self._publish("status", new("ardupilot_msgs/msg/Status", header=stamped(at), **state))

    def _failsafes(self) -> list[int]:
        health = (self._link.last("SYS_STATUS") or {}).get("onboard_control_sensors_health", -1)
        return [number for number, sensor in _HEALTH_OF.items() if not health & sensor]

    def _clocks(self, fields: Fields, at: Ns) -> None:
        now = _time(*divmod(at, S))
        if self._wanted("time"):
            self._publish("time", now)
        if self._wanted("clock"):
            self._publish("clock", new("rosgraph_msgs/msg/Clock", clock=now))

    def _rc(self, fields: Fields, at: Ns) -> None:
        if self._wanted("rc"):
            channels = [fields[f"chan{number}_raw"] for number in range(1, fields["chancount"] + 1)]
            message = new("ardupilot_msgs/msg/Rc", header=stamped(at), receiver_rssi=fields["rssi"])
            message.is_connected = any(channels)
            message.channels, message.active_overrides = channels, [False] * len(channels)
            self._publish("rc", message)

    def _battery(self, fields: Fields, at: Ns) -> None:
        if not self._wanted("battery"):
            return
        volts = [one / 1e3 for one in fields["voltages"] if one != _UNKNOWN_U16]
        share = fields["battery_remaining"] / 100.0 if fields["battery_remaining"] >= 0 else nan
        current, temperature = fields["current_battery"], fields["temperature"]
        message = new(
            "sensor_msgs/msg/BatteryState",
            header=stamped(at, _FIRST),
            voltage=sum(volts),
            temperature=nan if temperature == _NO_TEMPERATURE else temperature / 100.0,
            current=nan if current < 0 else -current / 100.0,
            charge=nan,
            capacity=nan,
            design_capacity=nan,
            percentage=share,
            power_supply_status=2 if current > 0 else 0,
            power_supply_health=1,
            present=True,
            cell_voltage=volts,
        )
        self._publish("battery", message)

    # -- motion

    def _local(self, fields: Fields, at: Ns) -> None:
        attitude = self._link.last("ATTITUDE")
        if self._wanted("pose/filtered"):
            pose = new("geometry_msgs/msg/PoseStamped", header=stamped(at, BASE_LINK))
            home = self._link.last("HOME_POSITION")
            if home is not None:
                from_home = (fields[axis] - home[axis] for axis in "xyz")
                north, east, down = from_home
                pose.pose.position = _point(*frames.ned_to_enu((north, east, down)))
            if attitude is not None:
                pose.pose.orientation = orientation(attitude)
            self._publish("pose/filtered", pose)
        if self._wanted("twist/filtered"):
            twist = new("geometry_msgs/msg/TwistStamped", header=stamped(at, BASE_LINK))
            velocity = fields["vx"], fields["vy"], fields["vz"]
            twist.twist.linear = _vector(*frames.ned_to_enu(velocity))
            if attitude is not None:
                twist.twist.angular = body_rates(attitude)
            self._publish("twist/filtered", twist)

    def _global(self, fields: Fields, at: Ns) -> None:
        if self._wanted("geopose/filtered"):
            message = new("geographic_msgs/msg/GeoPoseStamped", header=stamped(at, BASE_LINK))
            message.pose.position = _geo_point(fields["lat"] / 1e7, fields["lon"] / 1e7, fields["alt"] / 1e3)
            attitude = self._link.last("ATTITUDE")
            if attitude is not None:
                message.pose.orientation = orientation(attitude)
            self._publish("geopose/filtered", message)

    def _geo(self, latitude: int, longitude: int, amsl: float, at: Ns, frame: str = "") -> Any:
        place = _geo_point(latitude / 1e7, longitude / 1e7, amsl)
        return new(_GEO_POINT, header=stamped(at, frame), position=place)

    def _origin(self, fields: Fields, at: Ns) -> None:
        if self._wanted("gps_global_origin/filtered"):
            place = fields["latitude"], fields["longitude"], fields["altitude"] / 1e3
            self._publish("gps_global_origin/filtered", self._geo(*place, at, BASE_LINK))

    def _target(self, fields: Fields, at: Ns) -> None:
        """Publish a target when it has changed."""
        target = fields["lat_int"], fields["lon_int"], fields["alt"]
        if "goal_lla" in self._names and target != self._goal and any(target[:2]):
            self._goal = target
            self._publish("goal_lla", self._geo(*target, at))

    # -- sensors

    def _navsat(self, fields: Fields, at: Ns) -> None:
        if not self._wanted("navsat"):
            return
        message = new("sensor_msgs/msg/NavSatFix", header=stamped(at, _FIRST))
        fix = fields["fix_type"]
        message.status.service = 1
        message.status.status = -1
        if fix >= _FIX_2D:
            message.status.status = 0 if fix < _FIX_DGPS else (1 if fix < _FIX_RTK else 2)
            message.latitude, message.longitude = fields["lat"] / 1e7, fields["lon"] / 1e7
            message.altitude = fields["alt"] / 1e3
            accuracies = fields.get("h_acc", 0) / 1e3, fields.get("v_acc", 0) / 1e3
            if all(accuracies):
                plane, height = (accuracy * accuracy for accuracy in accuracies)
                message.position_covariance = [plane, 0.0, 0.0, 0.0, plane, 0.0, 0.0, 0.0, height]
                message.position_covariance_type = 2
        self._publish("navsat", message)

    def _imu(self, name: str, fields: Fields, at: Ns) -> None:
        """Publish the measurement in the axes of the firmware: forward, right, down."""
        if imu_source(self._link) != name or not self._wanted("imu/experimental/data"):
            return
        measured = imu_measurement(name, fields)
        message = new("sensor_msgs/msg/Imu", header=stamped(at, BASE_LINK_NED))
        attitude = self._link.last("ATTITUDE")
        if attitude is not None:
            turned = message.orientation
            turned.w, turned.x, turned.y, turned.z = frames.euler_to_quaternion(
                attitude["roll"], attitude["pitch"], attitude["yaw"]
            )
        message.angular_velocity = _vector(*measured.rates)
        message.linear_acceleration = _vector(*measured.acceleration)
        for part in ("orientation", "angular_velocity", "linear_acceleration"):
            getattr(message, f"{part}_covariance")[0] = _UNKNOWN
        self._publish("imu/experimental/data", message)

    # -- what is taken

    def _velocity(self, message: Any, now: Ns) -> list[OutgoingMessage]:
        """Translate ``cmd_vel``: a velocity in m/s and a yaw rate anticlockwise in rad/s."""
        linear, frame = message.twist.linear, message.header.frame_id
        velocity = frames.enu_to_ned((linear.x, linear.y, linear.z))
        if frame == BASE_LINK:
            attitude = self._link.last("ATTITUDE")
            if attitude is None:
                return []
            q = frames.euler_to_quaternion(attitude["roll"], attitude["pitch"], attitude["yaw"])
            velocity = frames.body_to_world(q, (linear.x, linear.y, -linear.z))
        elif frame != MAP:
            self._warn_once(f"ap/cmd_vel: frame {frame!r} is ignored; there is {BASE_LINK} and {MAP}")
            return []
        vx, vy, vz = velocity
        fields = {
            "time_boot_ms": now // MS,
            "coordinate_frame": _LOCAL_NED,
            "type_mask": VELOCITY_AND_YAW_RATE,
            "vx": vx,
            "vy": vy,
            "vz": vz,
            "yaw_rate": -message.twist.angular.z,
        }
        return [("SET_POSITION_TARGET_LOCAL_NED", fields)]

    def _global_position(self, message: Any, now: Ns) -> list[OutgoingMessage]:
        """Translate ``cmd_gps_pose``, of which the firmware takes the position alone."""
        frame = message.header.frame_id
        if frame != MAP or message.coordinate_frame not in _FRAMES:
            self._warn_once(
                f"ap/cmd_gps_pose: frame {frame!r} with coordinate_frame {message.coordinate_frame} is "
                f"ignored; there is {MAP} with 5, 6 or 11"
            )
            return []
        if message.type_mask & _IGNORES_PLACE:
            return []
        fields = {
            "time_boot_ms": now // MS,
            "coordinate_frame": message.coordinate_frame,
            "type_mask": _POSITION_ONLY,
            "lat_int": round(message.latitude * 1e7),
            "lon_int": round(message.longitude * 1e7),
            "alt": message.altitude,
        }
        return [("SET_POSITION_TARGET_GLOBAL_INT", fields)]

    def _arm(self, request: Any) -> Any:
        accepted, _ = self._commands.send_command(ARM_DISARM, 1.0 if request.arm else 0.0)
        return service("ardupilot_msgs/srv/ArmMotors").response(accepted)

    def _switch_mode(self, request: Any) -> Any:
        enabled, mode = float(_CUSTOM_MODE_ENABLED), float(request.mode)
        accepted, _ = self._commands.send_command(_DO_SET_MODE, enabled, mode)
        last = self._link.last("HEARTBEAT")
        present = request.mode if accepted or last is None else last["custom_mode"]
        return service("ardupilot_msgs/srv/ModeSwitch").response(accepted, present)

    def _check(self, request: Any) -> Any:
        """Handle ``prearm_check`` by the result of the checks that the autopilot repeats."""
        checks = (self._link.last("SYS_STATUS") or {}).get("onboard_control_sensors_health", 0)
        passed = bool(checks & _PREARM_CHECK)
        said = "Vehicle is Armable" if passed else "Vehicle is Not Armable"
        return service("std_srvs/srv/Trigger").response(passed, said)

    def _take_off(self, request: Any) -> Any:
        place = (0.0, 0.0, request.alt)
        accepted, _ = self._commands.send_command(TAKEOFF, 0.0, 0.0, 0.0, 0.0, *place)
        return service("ardupilot_msgs/srv/Takeoff").response(accepted)


_PULSE_CENTRE, _PULSE_HALF = 1500, 500
"""Pulse width in microseconds of an axis at 0 and its change up to 1, by the firmware's default limits."""
_CHANNELS = 8
_FEWEST_AXES = 4


def joy(message: Any, now: Ns) -> list[OutgoingMessage]:
    """Translate ``joy``: axes of -1..1 override the channels from the first on; NaN releases a channel.

    Fewer than four axes count for nothing.
    """
    if len(message.axes) < _FEWEST_AXES:
        return []
    channels = {f"chan{number}_raw": _UNKNOWN_U16 for number in range(1, _CHANNELS + 1)}
    for number, axis in enumerate(message.axes[:_CHANNELS], start=1):
        within = 0.0 if isnan(axis) else max(-1.0, min(1.0, float(axis)))
        channels[f"chan{number}_raw"] = 0 if isnan(axis) else round(_PULSE_CENTRE + _PULSE_HALF * within)
    return [("RC_CHANNELS_OVERRIDE", channels)]
