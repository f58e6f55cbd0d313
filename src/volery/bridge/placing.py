"""Where the vehicle is, as ROS messages: global, local, home. MAVLink's units and frames to REP-103's.

Altitudes of ``global_position/global``, ``global_position/raw/fix``, ``global_position/gp_origin`` and
``home_position/home`` are above the ellipsoid, as in MAVROS; ``rel_alt`` is above home. Local positions
are ENU about the autopilot's origin, those of ``global_position/local`` about home.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, radians, sin
from typing import Any

from volery.base import frames
from volery.base.time import Ns
from volery.bridge.inertial import body_rates, orientation
from volery.bridge.offering import BODY, LATCHED_STATE, Fields, Surroundings, Topic, Translate, stamped
from volery.ros.messages import message_class, new

MAP = "map"
_UNKNOWN_U8, _UNKNOWN_U16 = 255, 65535
_FIX_3D, _FIX_DGPS = 3, 4
_ODOMETRY = "nav_msgs/msg/Odometry"
_TWIST = "geometry_msgs/msg/TwistStamped"

_point = message_class("geometry_msgs/msg/Point")
_vector = message_class("geometry_msgs/msg/Vector3")

TOPICS = (
    Topic("global_position/global", "sensor_msgs/msg/NavSatFix"),
    Topic("global_position/raw/fix", "sensor_msgs/msg/NavSatFix"),
    Topic("global_position/raw/gps_vel", _TWIST, on_demand=True),
    Topic("global_position/raw/satellites", "std_msgs/msg/UInt32", on_demand=True),
    Topic("global_position/rel_alt", "std_msgs/msg/Float64"),
    Topic("global_position/compass_hdg", "std_msgs/msg/Float64"),
    Topic("global_position/local", _ODOMETRY, on_demand=True),
    Topic("global_position/gp_origin", "geographic_msgs/msg/GeoPointStamped", LATCHED_STATE),
    Topic("local_position/pose", "geometry_msgs/msg/PoseStamped"),
    Topic("local_position/velocity_local", _TWIST),
    Topic("local_position/velocity_body", _TWIST, on_demand=True),
    Topic("local_position/odom", _ODOMETRY, on_demand=True),
    Topic("home_position/home", "mavros_msgs/msg/HomePosition", LATCHED_STATE),
    Topic("altitude", "mavros_msgs/msg/Altitude", on_demand=True),
)


class Placing:
    """Translates frames; what several of them say together is asked of the wire, which keeps the latest."""

    def __init__(self, around: Surroundings) -> None:
        self._wire, self._geoid = around.wire, around.geoid
        self._publish, self._wanted = around.publish, around.wanted

    def translators(self) -> Mapping[str, Translate]:
        """By the name of the frame."""
        return {
            "GLOBAL_POSITION_INT": self._global,
            "GPS_RAW_INT": self._raw,
            "GPS_GLOBAL_ORIGIN": self._origin,
            "LOCAL_POSITION_NED": self._local,
            "HOME_POSITION": self._home,
            "ALTITUDE": self._altitude,
        }

    def _ellipsoidal(self, latitude: float, longitude: float, millimetres: int) -> float:
        return self._geoid.to_ellipsoidal(latitude, longitude, millimetres / 1000.0)

    def _fix(self, said: Fields, at: Ns) -> Any:
        """A NavSatFix; its status and covariance are those of the last GPS_RAW_INT."""
        raw = self._wire.last("GPS_RAW_INT") or {}
        kind = raw.get("fix_type", 0)
        latitude, longitude = said["lat"] / 1e7, said["lon"] / 1e7
        message = new(
            "sensor_msgs/msg/NavSatFix",
            header=stamped(at, BODY),
            latitude=latitude,
            longitude=longitude,
            altitude=self._ellipsoidal(latitude, longitude, said["alt"]),
        )
        message.status.status = -1 if kind < _FIX_3D else (2 if kind > _FIX_DGPS else kind - _FIX_3D)
        message.status.service = 1
        horizontal, vertical = raw.get("eph", _UNKNOWN_U16), raw.get("epv", _UNKNOWN_U16)
        if _UNKNOWN_U16 not in (horizontal, vertical):
            h2, v2 = (horizontal / 100.0) ** 2, (vertical / 100.0) ** 2
            message.position_covariance = [h2, 0.0, 0.0, 0.0, h2, 0.0, 0.0, 0.0, v2]
            message.position_covariance_type = 1
        return message

    def _raw(self, said: Fields, at: Ns) -> None:
        self._publish("global_position/raw/fix", self._fix(said, at))
        if self._wanted("global_position/raw/satellites") and said["satellites_visible"] != _UNKNOWN_U8:
            seen = new("std_msgs/msg/UInt32", data=said["satellites_visible"])
            self._publish("global_position/raw/satellites", seen)
        speed, course = said["vel"], said["cog"]
        if self._wanted("global_position/raw/gps_vel") and _UNKNOWN_U16 not in (speed, course):
            way = radians(course / 100.0)
            ned = (speed / 100.0 * cos(way), speed / 100.0 * sin(way), 0.0)
            twist = new(_TWIST, header=stamped(at, MAP))
            twist.twist.linear = _vector(*frames.ned_to_enu(ned))
            self._publish("global_position/raw/gps_vel", twist)

    def _global(self, said: Fields, at: Ns) -> None:
        self._publish("global_position/global", self._fix(said, at))
        self._publish(
            "global_position/rel_alt", new("std_msgs/msg/Float64", data=said["relative_alt"] / 1000.0)
        )
        if said["hdg"] != _UNKNOWN_U16:
            heading = new("std_msgs/msg/Float64", data=said["hdg"] / 100.0)
            self._publish("global_position/compass_hdg", heading)
        if self._wanted("global_position/local"):
            self._about_home(said, at)

    def _about_home(self, said: Fields, at: Ns) -> None:
        """Position ENU about home, velocity ENU; without a home there is none."""
        home = self._wire.last("HOME_POSITION")
        if home is None:
            return
        about = frames.LocalFrame(home["latitude"] / 1e7, home["longitude"] / 1e7, home["altitude"] / 1000.0)
        place = about.to_enu(said["lat"] / 1e7, said["lon"] / 1e7, said["alt"] / 1000.0)
        velocity = frames.ned_to_enu((said["vx"] / 100.0, said["vy"] / 100.0, said["vz"] / 100.0))
        self._publish("global_position/local", self._odometry(place, velocity, at))

    def _odometry(self, place: frames.Vector, velocity: frames.Vector, at: Ns) -> Any:
        """*velocity* is ENU in ``global_position/local`` and FLU in ``local_position/odom``, as in MAVROS."""
        odometry = new(_ODOMETRY, header=stamped(at, MAP), child_frame_id=BODY)
        odometry.pose.pose.position = _point(*place)
        odometry.twist.twist.linear = _vector(*velocity)
        attitude = self._wire.last("ATTITUDE")
        if attitude is not None:
            odometry.pose.pose.orientation = orientation(attitude)
            odometry.twist.twist.angular = body_rates(attitude)
        return odometry

    def _origin(self, said: Fields, at: Ns) -> None:
        latitude, longitude = said["latitude"] / 1e7, said["longitude"] / 1e7
        message = new("geographic_msgs/msg/GeoPointStamped", header=stamped(at, MAP))
        message.position.latitude, message.position.longitude = latitude, longitude
        message.position.altitude = self._ellipsoidal(latitude, longitude, said["altitude"])
        self._publish("global_position/gp_origin", message)

    def _local(self, said: Fields, at: Ns) -> None:
        pose = new("geometry_msgs/msg/PoseStamped", header=stamped(at, MAP))
        pose.pose.position = _point(*frames.ned_to_enu((said["x"], said["y"], said["z"])))
        attitude = self._wire.last("ATTITUDE")
        if attitude is not None:
            pose.pose.orientation = orientation(attitude)
        self._publish("local_position/pose", pose)
        twist = new(_TWIST, header=stamped(at, MAP))
        twist.twist.linear = _vector(*frames.ned_to_enu((said["vx"], said["vy"], said["vz"])))
        if attitude is not None:
            twist.twist.angular = body_rates(attitude)
        self._publish("local_position/velocity_local", twist)
        self._in_body(said, at)

    def _in_body(self, said: Fields, at: Ns) -> None:
        """Velocity in forward, left, up: it takes an attitude."""
        attitude = self._wire.last("ATTITUDE")
        odometry, velocity = (self._wanted(f"local_position/{name}") for name in ("odom", "velocity_body"))
        if attitude is None or not (odometry or velocity):
            return
        ned = frames.euler_to_quaternion(attitude["roll"], attitude["pitch"], attitude["yaw"])
        body = frames.frd_to_flu(frames.world_to_body(ned, (said["vx"], said["vy"], said["vz"])))
        if velocity:
            twist = new(_TWIST, header=stamped(at, BODY))
            twist.twist.linear, twist.twist.angular = _vector(*body), body_rates(attitude)
            self._publish("local_position/velocity_body", twist)
        if odometry:
            place = frames.ned_to_enu((said["x"], said["y"], said["z"]))
            self._publish("local_position/odom", self._odometry(place, body, at))

    def _home(self, said: Fields, at: Ns) -> None:
        message = new("mavros_msgs/msg/HomePosition", header=stamped(at, MAP))
        latitude, longitude = said["latitude"] / 1e7, said["longitude"] / 1e7
        message.geo.latitude, message.geo.longitude = latitude, longitude
        message.geo.altitude = self._ellipsoidal(latitude, longitude, said["altitude"])
        message.position = _point(*frames.ned_to_enu((said["x"], said["y"], said["z"])))
        message.approach = _vector(
            *frames.ned_to_enu((said["approach_x"], said["approach_y"], said["approach_z"]))
        )
        self._publish("home_position/home", message)

    def _altitude(self, said: Fields, at: Ns) -> None:
        """PX4 alone sends it."""
        if self._wanted("altitude"):
            kinds = ("monotonic", "amsl", "local", "relative", "terrain")
            heights = {kind: said[f"altitude_{kind}"] for kind in kinds}
            clearance = said["bottom_clearance"]
            header = stamped(at, MAP)
            message = new("mavros_msgs/msg/Altitude", header=header, bottom_clearance=clearance, **heights)
            self._publish("altitude", message)
