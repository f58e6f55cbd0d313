"""What the autopilot says, as ROS messages. MAVLink's units and frames to REP-103's.

Altitudes of ``global_position/global``, ``global_position/raw/fix`` and ``home_position/home`` are above the
ellipsoid, as in MAVROS; ``rel_alt`` is above home, ``vfr_hud`` AMSL. Local positions are ENU about the
autopilot's origin.
"""

from __future__ import annotations

from collections.abc import Callable
from math import nan
from typing import Any, NamedTuple

from volery.base import frames
from volery.base.geoid import Geoid
from volery.base.time import Ns, S
from volery.bridge.modes import Firmware, mode_name
from volery.bridge.wire import Wire
from volery.graph import DEFAULT, TRANSIENT_LOCAL, QoS
from volery.links.link import Frame
from volery.messages import message_class, new

LATCHED_STATE = QoS(10, durability=TRANSIENT_LOCAL)
MAP, BODY = "map", "base_link"
G = 9.80665
_UNKNOWN_U16 = 65535
_FIX_3D, _FIX_DGPS = 3, 4

Fields = dict[str, Any]
_header = message_class("std_msgs/msg/Header")
_time = message_class("builtin_interfaces/msg/Time")
_point = message_class("geometry_msgs/msg/Point")
_vector = message_class("geometry_msgs/msg/Vector3")
_quaternion = message_class("geometry_msgs/msg/Quaternion")


class Topic(NamedTuple):
    """A topic that the vehicle node publishes."""

    name: str
    type: str
    qos: QoS = DEFAULT


TOPICS = (
    Topic("state", "mavros_msgs/msg/State", LATCHED_STATE),
    Topic("extended_state", "mavros_msgs/msg/ExtendedState"),
    Topic("battery", "sensor_msgs/msg/BatteryState"),
    Topic("statustext/recv", "mavros_msgs/msg/StatusText"),
    Topic("global_position/global", "sensor_msgs/msg/NavSatFix"),
    Topic("global_position/raw/fix", "sensor_msgs/msg/NavSatFix"),
    Topic("global_position/rel_alt", "std_msgs/msg/Float64"),
    Topic("global_position/compass_hdg", "std_msgs/msg/Float64"),
    Topic("local_position/pose", "geometry_msgs/msg/PoseStamped"),
    Topic("local_position/velocity_local", "geometry_msgs/msg/TwistStamped"),
    Topic("home_position/home", "mavros_msgs/msg/HomePosition", LATCHED_STATE),
    Topic("imu/data", "sensor_msgs/msg/Imu"),
    Topic("vfr_hud", "mavros_msgs/msg/VfrHud"),
    Topic("rc/in", "mavros_msgs/msg/RCIn"),
    Topic("mission/reached", "mavros_msgs/msg/WaypointReached", LATCHED_STATE),
)

Publish = Callable[[str, Any], None]
"""``publish(topic, message)``."""


def stamped(at: Ns, frame_id: str) -> Any:
    """A header."""
    return _header(_time(*divmod(at, S)), frame_id)


class Telemetry:
    """Translates frames; keeps nothing but the wire, which knows what came last of each kind."""

    def __init__(self, wire: Wire, geoid: Geoid, publish: Publish) -> None:
        self._wire, self._geoid, self._publish = wire, geoid, publish
        self._translate: dict[str, Callable[[Fields, Ns], None]] = {
            "HEARTBEAT": self._heartbeat,
            "EXTENDED_SYS_STATE": self._extended_state,
            "SYS_STATUS": self._battery,
            "STATUSTEXT": self._text,
            "GLOBAL_POSITION_INT": self._global,
            "GPS_RAW_INT": self._raw_fix,
            "LOCAL_POSITION_NED": self._local,
            "HOME_POSITION": self._home,
            "ATTITUDE": self._imu,
            "VFR_HUD": self._vfr_hud,
            "RC_CHANNELS": self._rc,
            "MISSION_ITEM_REACHED": self._reached,
        }

    def publish(self, frame: Frame, stamp: Ns) -> None:
        """Publish what *frame* says, if it is of a kind that is published; *stamp* is ROS time."""
        translate = self._translate.get(frame.name)
        if translate is not None:
            translate(frame.fields, stamp)

    def disconnected(self, stamp: Ns) -> None:
        """Publish that the autopilot has fallen silent."""
        self._publish("state", new("mavros_msgs/msg/State", header=stamped(stamp, "")))

    def _last(self, name: str) -> Fields | None:
        heard = self._wire.latest.get(name)
        return heard.frame.fields if heard else None

    def _heartbeat(self, said: Fields, at: Ns) -> None:
        base = said["base_mode"]
        self._publish(
            "state",
            new(
                "mavros_msgs/msg/State",
                header=stamped(at, ""),
                connected=True,
                armed=bool(base & 128),
                guided=bool(base & 8),
                manual_input=bool(base & 64),
                mode=mode_name(Firmware(said["autopilot"], said["type"]), said["custom_mode"]),
                system_status=said["system_status"],
            ),
        )

    def _extended_state(self, said: Fields, at: Ns) -> None:
        message = new(
            "mavros_msgs/msg/ExtendedState",
            header=stamped(at, ""),
            vtol_state=said["vtol_state"],
            landed_state=said["landed_state"],
        )
        self._publish("extended_state", message)

    def _battery(self, said: Fields, at: Ns) -> None:
        """Current is negative while it discharges (sensor_msgs/BatteryState)."""
        millivolts, centiamperes = said["voltage_battery"], said["current_battery"]
        percent = said["battery_remaining"]
        self._publish(
            "battery",
            new(
                "sensor_msgs/msg/BatteryState",
                header=stamped(at, BODY),
                voltage=nan if millivolts == _UNKNOWN_U16 else millivolts / 1000.0,
                current=nan if centiamperes < 0 else -centiamperes / 100.0,
                percentage=nan if percent < 0 else percent / 100.0,
                temperature=nan,
                charge=nan,
                capacity=nan,
                design_capacity=nan,
                power_supply_status=2,
                present=True,
            ),
        )

    def _text(self, said: Fields, at: Ns) -> None:
        message = new(
            "mavros_msgs/msg/StatusText", header=stamped(at, ""), severity=said["severity"], text=said["text"]
        )
        self._publish("statustext/recv", message)

    def _fix(self, said: Fields, at: Ns) -> Any:
        """A NavSatFix; its status and covariance are those of the last GPS_RAW_INT."""
        raw = self._last("GPS_RAW_INT") or {}
        kind = raw.get("fix_type", 0)
        message = new(
            "sensor_msgs/msg/NavSatFix",
            header=stamped(at, BODY),
            latitude=said["lat"] / 1e7,
            longitude=said["lon"] / 1e7,
            altitude=self._geoid.to_ellipsoidal(said["alt"] / 1000.0),
        )
        message.status.status = -1 if kind < _FIX_3D else (2 if kind > _FIX_DGPS else kind - _FIX_3D)
        message.status.service = 1
        horizontal, vertical = raw.get("eph", _UNKNOWN_U16), raw.get("epv", _UNKNOWN_U16)
        if _UNKNOWN_U16 not in (horizontal, vertical):
            h2, v2 = (horizontal / 100.0) ** 2, (vertical / 100.0) ** 2
            message.position_covariance = [h2, 0.0, 0.0, 0.0, h2, 0.0, 0.0, 0.0, v2]
            message.position_covariance_type = 1
        return message

    def _raw_fix(self, said: Fields, at: Ns) -> None:
        self._publish("global_position/raw/fix", self._fix(said, at))

    def _global(self, said: Fields, at: Ns) -> None:
        self._publish("global_position/global", self._fix(said, at))
        self._publish(
            "global_position/rel_alt", new("std_msgs/msg/Float64", data=said["relative_alt"] / 1000.0)
        )
        if said["hdg"] != _UNKNOWN_U16:
            heading = new("std_msgs/msg/Float64", data=said["hdg"] / 100.0)
            self._publish("global_position/compass_hdg", heading)

    def _local(self, said: Fields, at: Ns) -> None:
        pose = new("geometry_msgs/msg/PoseStamped", header=stamped(at, MAP))
        pose.pose.position = _point(*frames.ned_to_enu((said["x"], said["y"], said["z"])))
        attitude = self._last("ATTITUDE")
        if attitude is not None:
            pose.pose.orientation = _orientation(attitude)
        self._publish("local_position/pose", pose)
        twist = new("geometry_msgs/msg/TwistStamped", header=stamped(at, MAP))
        twist.twist.linear = _vector(*frames.ned_to_enu((said["vx"], said["vy"], said["vz"])))
        if attitude is not None:
            twist.twist.angular = _body_rates(attitude)
        self._publish("local_position/velocity_local", twist)

    def _home(self, said: Fields, at: Ns) -> None:
        message = new("mavros_msgs/msg/HomePosition", header=stamped(at, MAP))
        message.geo.latitude, message.geo.longitude = said["latitude"] / 1e7, said["longitude"] / 1e7
        message.geo.altitude = self._geoid.to_ellipsoidal(said["altitude"] / 1000.0)
        message.position = _point(*frames.ned_to_enu((said["x"], said["y"], said["z"])))
        message.approach = _vector(
            *frames.ned_to_enu((said["approach_x"], said["approach_y"], said["approach_z"]))
        )
        self._publish("home_position/home", message)

    def _imu(self, said: Fields, at: Ns) -> None:
        """Acceleration is that of the last RAW_IMU (ArduPilot.

        Thousandths of g); without one it is marked unknown.
        """
        message = new("sensor_msgs/msg/Imu", header=stamped(at, BODY))
        message.orientation = _orientation(said)
        message.angular_velocity = _body_rates(said)
        raw = self._last("RAW_IMU")
        if raw is None:
            message.linear_acceleration_covariance[0] = -1.0
        else:
            milli = G / 1000.0
            felt = (raw["xacc"] * milli, raw["yacc"] * milli, raw["zacc"] * milli)
            message.linear_acceleration = _vector(*frames.frd_to_flu(felt))
        self._publish("imu/data", message)

    def _vfr_hud(self, said: Fields, at: Ns) -> None:
        self._publish(
            "vfr_hud",
            new(
                "mavros_msgs/msg/VfrHud",
                header=stamped(at, ""),
                airspeed=said["airspeed"],
                groundspeed=said["groundspeed"],
                heading=said["heading"],
                throttle=said["throttle"] / 100.0,
                altitude=said["alt"],
                climb=said["climb"],
            ),
        )

    def _rc(self, said: Fields, at: Ns) -> None:
        channels = [said[f"chan{number}_raw"] for number in range(1, said["chancount"] + 1)]
        message = new("mavros_msgs/msg/RCIn", header=stamped(at, ""), rssi=said["rssi"], channels=channels)
        self._publish("rc/in", message)

    def _reached(self, said: Fields, at: Ns) -> None:
        message = new("mavros_msgs/msg/WaypointReached", header=stamped(at, ""), wp_seq=said["seq"])
        self._publish("mission/reached", message)


def _orientation(attitude: Fields) -> Any:
    ned = frames.euler_to_quaternion(attitude["roll"], attitude["pitch"], attitude["yaw"])
    w, x, y, z = frames.attitude_ned_to_enu(ned)
    return _quaternion(x, y, z, w)


def _body_rates(attitude: Fields) -> Any:
    rates = (attitude["rollspeed"], attitude["pitchspeed"], attitude["yawspeed"])
    return _vector(*frames.frd_to_flu(rates))
