"""What the sensors felt, as ROS messages: FRD to FLU, MAVLink's units to SI.

RAW_IMU and SCALED_IMU carry thousandths of g, of rad/s and of gauss (so ArduPilot; MAVLink leaves the
units of RAW_IMU open); HIGHRES_IMU, which PX4 sends, carries m/s^2, rad/s and gauss.

Where the vehicle is, as ROS messages: global, local, home. MAVLink's units and frames to REP-103's.

Altitudes of ``global_position/global``, ``global_position/raw/fix``, ``global_position/gp_origin`` and
``home_position/home`` are above the ellipsoid, as in MAVROS; ``rel_alt`` is above home. Local positions
are ENU about the autopilot's origin, those of ``global_position/local`` about home.

Where the vehicle's body is, for tf2: ``/tf``, and on ``/tf_static`` the frames that autopilots think in.

MAVROS's names of frames, behind the vehicle's namespace where there may be several of them:

| parent | child | where | |
|---|---|---|---|
| ``map`` | ``drone_1/base_link`` | ``/tf`` | FLU in ENU, as the autopilot believes, while somebody listens |
| ``map`` | ``map_ned`` | ``/tf_static`` | the same place, north, east and down |
| ``drone_1/base_link`` | ``drone_1/base_link_frd`` | ``/tf_static`` | the same body, forward, right, down |

With an *origin* that is agreed, all vehicles have one ``map``, about it, and a position comes from what the
autopilot says of the globe. Without one ``map`` is about the autopilot's own origin, as MAVROS has it. Under
``/mavros``, where MAVROS serves a single vehicle, there is no prefix.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import cos, isnan, radians, sin, sqrt
from typing import Any, NamedTuple

from volery.base import frames
from volery.base.time import Ns
from volery.bridge.autopilot_link import AutopilotLink
from volery.bridge.node_interface import (
    BODY,
    LATCHED_STATE,
    Fields,
    InterfaceContext,
    Topic,
    Translator,
    stamped,
)
from volery.ros.graph import LATCHED, QoS
from volery.ros.messages import message_class, new

G = 9.80665
TESLA = 1e-4
"""Of a gauss."""
PASCALS = 100.0
"""Of a hectopascal."""
IMU = "sensor_msgs/msg/Imu"
UNKNOWN = -1.0
"""First in a covariance: there is no such measurement (sensor_msgs/Imu)."""

_vector = message_class("geometry_msgs/msg/Vector3")
_quaternion = message_class("geometry_msgs/msg/Quaternion")

IMU_TOPICS = (
    Topic("imu/data", IMU),
    Topic("imu/data_raw", IMU, on_demand=True),
    Topic("imu/mag", "sensor_msgs/msg/MagneticField", on_demand=True),
    Topic("imu/static_pressure", "sensor_msgs/msg/FluidPressure", on_demand=True),
    Topic("imu/diff_pressure", "sensor_msgs/msg/FluidPressure", on_demand=True),
    Topic("imu/temperature_imu", "sensor_msgs/msg/Temperature", on_demand=True),
)


class ImuMeasurement(NamedTuple):
    """One measurement in FRD: m/s^2, rad/s, tesla."""

    acceleration: frames.Vector
    rates: frames.Vector
    field: frames.Vector


def _triple(said: Fields, kind: str, scale: float) -> frames.Vector:
    return said[f"x{kind}"] * scale, said[f"y{kind}"] * scale, said[f"z{kind}"] * scale


def imu_measurement(name: str, said: Fields) -> ImuMeasurement:
    """What a RAW_IMU, SCALED_IMU or HIGHRES_IMU says."""
    if name == "HIGHRES_IMU":
        return ImuMeasurement(
            _triple(said, "acc", 1.0), _triple(said, "gyro", 1.0), _triple(said, "mag", TESLA)
        )
    return ImuMeasurement(
        _triple(said, "acc", G / 1000.0), _triple(said, "gyro", 1e-3), _triple(said, "mag", TESLA / 1000.0)
    )


IMU_SOURCES = ("HIGHRES_IMU", "RAW_IMU", "SCALED_IMU")
"""Where measurements are taken from: the first of them that the autopilot sends."""


def imu_source(wire: AutopilotLink) -> str:
    """Which one it is; empty while none has come."""
    return next((name for name in IMU_SOURCES if name in wire.latest), "")


class ImuPublisher:
    """Translates frames."""

    def __init__(self, around: InterfaceContext) -> None:
        self._wire = around.wire
        self._publish, self._wanted = around.publish, around.wanted

    def translators(self) -> Mapping[str, Translator]:
        """By the name of the frame."""
        return {
            "ATTITUDE": self._attitude,
            **{name: self._measured(name) for name in IMU_SOURCES},
            "SCALED_PRESSURE": self._pressure,
        }

    def _attitude(self, said: Fields, at: Ns) -> None:
        """Its acceleration is that of the last measurement; without one it is marked unknown, as are rates
        that are no numbers.
        """
        message = new(IMU, header=stamped(at, BODY))
        message.orientation = orientation(said)
        message.angular_velocity = body_rates(said)
        if isnan(said["rollspeed"]):
            message.angular_velocity_covariance[0] = UNKNOWN
        name = imu_source(self._wire)
        last = self._wire.last(name)
        if last is None:
            message.linear_acceleration_covariance[0] = UNKNOWN
        else:
            message.linear_acceleration = _vector(
                *frames.frd_to_flu(imu_measurement(name, last).acceleration)
            )
        self._publish("imu/data", message)

    def _measured(self, name: str) -> Translator:
        def translate(said: Fields, at: Ns) -> None:
            if imu_source(self._wire) != name:
                return
            if self._wanted("imu/data_raw"):
                self._publish("imu/data_raw", _raw(imu_measurement(name, said), at))
            if self._wanted("imu/mag"):
                field = _vector(*frames.frd_to_flu(imu_measurement(name, said).field))
                kind = "sensor_msgs/msg/MagneticField"
                self._publish("imu/mag", new(kind, header=stamped(at, BODY), magnetic_field=field))

        return translate

    def _pressure(self, said: Fields, at: Ns) -> None:
        """Hectopascals and hundredths of a degree."""
        for topic, name in (("imu/static_pressure", "press_abs"), ("imu/diff_pressure", "press_diff")):
            if self._wanted(topic):
                header, pascals = stamped(at, BODY), said[name] * PASCALS
                self._publish(
                    topic, new("sensor_msgs/msg/FluidPressure", header=header, fluid_pressure=pascals)
                )
        if self._wanted("imu/temperature_imu"):
            degrees = said["temperature"] / 100.0
            kind = "sensor_msgs/msg/Temperature"
            self._publish("imu/temperature_imu", new(kind, header=stamped(at, BODY), temperature=degrees))


def _raw(measured: ImuMeasurement, at: Ns) -> Any:
    message = new(IMU, header=stamped(at, BODY))
    message.orientation_covariance[0] = UNKNOWN
    message.angular_velocity = _vector(*frames.frd_to_flu(measured.rates))
    message.linear_acceleration = _vector(*frames.frd_to_flu(measured.acceleration))
    return message


def orientation(attitude: Fields) -> Any:
    """An ATTITUDE as the quaternion of a FLU body in ENU."""
    ned = frames.euler_to_quaternion(attitude["roll"], attitude["pitch"], attitude["yaw"])
    w, x, y, z = frames.attitude_ned_to_enu(ned)
    return _quaternion(x, y, z, w)


def body_rates(attitude: Fields) -> Any:
    """The rates of an ATTITUDE in FLU."""
    rates = (attitude["rollspeed"], attitude["pitchspeed"], attitude["yawspeed"])
    return _vector(*frames.frd_to_flu(rates))


MAP = "map"
_UNKNOWN_U8, _UNKNOWN_U16 = 255, 65535
_FIX_3D, _FIX_DGPS = 3, 4
_ODOMETRY = "nav_msgs/msg/Odometry"
_TWIST = "geometry_msgs/msg/TwistStamped"

_point = message_class("geometry_msgs/msg/Point")

POSE_TOPICS = (
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


class PosePublisher:
    """Translates frames; what several of them say together is asked of the wire, which keeps the latest."""

    def __init__(self, around: InterfaceContext) -> None:
        self._wire, self._geoid = around.wire, around.geoid
        self._publish, self._wanted = around.publish, around.wanted

    def translators(self) -> Mapping[str, Translator]:
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


TF, TF_STATIC = "/tf", "/tf_static"
_TF_MESSAGE = "tf2_msgs/msg/TFMessage"
_ALONE = "/mavros"
_HALF = sqrt(0.5)
_NED_IN_ENU = (0.0, _HALF, _HALF, 0.0)
_FRD_IN_FLU = (0.0, 1.0, 0.0, 0.0)
"""Quaternions (w, x, y, z): half a turn about the horizontal diagonal, and about the forward axis."""


TRANSFORM_TOPICS = (
    Topic(TF, _TF_MESSAGE, QoS(100), on_demand=True),
    Topic(TF_STATIC, _TF_MESSAGE, LATCHED),
)


class TransformPublisher:
    """Translates frames."""

    def __init__(self, around: InterfaceContext) -> None:
        self._wire, self._origin = around.wire, around.origin
        self._publish, self._wanted = around.publish, around.wanted
        namespace = around.node.namespace
        prefix = "" if namespace == _ALONE else f"{namespace.strip('/')}/".lstrip("/")
        self._body = f"{prefix}{BODY}"
        self._told = False

    def translators(self) -> Mapping[str, Translator]:
        """By the name of the frame."""
        if self._origin is None:
            return {"HEARTBEAT": self._tell_static, "LOCAL_POSITION_NED": self._local}
        return {"HEARTBEAT": self._tell_static, "GLOBAL_POSITION_INT": partial(self._global, self._origin)}

    def _tell_static(self, said: Fields, at: Ns) -> None:
        """Once; whoever comes later is told by the graph."""
        if self._told:
            return
        self._told = True
        pairs = ((MAP, f"{MAP}_ned", _NED_IN_ENU), (self._body, f"{self._body}_frd", _FRD_IN_FLU))
        still = [_transform(at, parent, child, _turned(turn)) for parent, child, turn in pairs]
        self._publish(TF_STATIC, new(_TF_MESSAGE, transforms=still))

    def _global(self, origin: frames.LocalFrame, said: Fields, at: Ns) -> None:
        self._place(origin.to_enu(said["lat"] / 1e7, said["lon"] / 1e7, said["alt"] / 1000.0), at)

    def _local(self, said: Fields, at: Ns) -> None:
        self._place(frames.ned_to_enu((said["x"], said["y"], said["z"])), at)

    def _place(self, enu: frames.Vector, at: Ns) -> None:
        attitude = self._wire.last("ATTITUDE")
        if attitude is not None and self._wanted(TF):
            moving = _transform(at, MAP, self._body, orientation(attitude), enu)
            self._publish(TF, new(_TF_MESSAGE, transforms=[moving]))


def _turned(quaternion: frames.Quaternion) -> Any:
    w, x, y, z = quaternion
    return _quaternion(x, y, z, w)


def _transform(at: Ns, parent: str, child: str, rotation: Any, place: frames.Vector = (0.0, 0.0, 0.0)) -> Any:
    made = new("geometry_msgs/msg/TransformStamped", header=stamped(at, parent), child_frame_id=child)
    made.transform.translation = _vector(*place)
    made.transform.rotation = rotation
    return made
