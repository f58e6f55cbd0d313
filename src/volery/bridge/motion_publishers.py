"""Publishers of IMU data, positions, velocities and transforms in the units and frames of REP 103.

RAW_IMU and SCALED_IMU carry thousandths of g, of rad/s and of gauss (so ArduPilot; MAVLink leaves the units
of RAW_IMU open); HIGHRES_IMU, which PX4 sends, carries m/s^2, rad/s and gauss.

Altitudes of ``global_position/global``, ``global_position/raw/fix``, ``global_position/gp_origin`` and
``home_position/home`` are above the ellipsoid, as in MAVROS; ``rel_alt`` is above home. Local positions are
ENU about the origin of the autopilot, those of ``global_position/local`` about home.

Transforms use MAVROS's frame names, with the vehicle's namespace as a prefix where there may be several
vehicles:

| parent | child | topic | |
|---|---|---|---|
| ``map`` | ``drone_1/base_link`` | ``/tf`` | FLU in ENU, as estimated by the autopilot, on demand |
| ``map`` | ``map_ned`` | ``/tf_static`` | the same origin, north, east and down |
| ``drone_1/base_link`` | ``drone_1/base_link_frd`` | ``/tf_static`` | the same body, forward, right, down |

With a common *origin* all vehicles share one ``map`` about it, and positions are computed from the global
position. Without an origin ``map`` is about the autopilot's own origin, as in MAVROS. Under ``/mavros``,
where MAVROS serves a single vehicle, there is no prefix.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import isnan, radians, sqrt
from typing import Any, NamedTuple

from volery.base import frames
from volery.base.elementary import cos, sin
from volery.base.time import Ns
from volery.bridge.autopilot_link import AutopilotLink
from volery.bridge.node_interface import (
    BODY,
    LATCHED_STATE,
    Fields,
    InterfaceContext,
    PublishedByNode,
    Translator,
    stamped,
)
from volery.ros.graph import LATCHED, QoS
from volery.ros.messages import message_class, new

G = 9.80665
TESLA = 1e-4
"""Tesla per gauss."""
PASCALS = 100.0
"""Pascals per hectopascal."""
IMU = "sensor_msgs/msg/Imu"
UNKNOWN = -1.0
"""First element of a covariance without a measurement (sensor_msgs/Imu)."""

_vector = message_class("geometry_msgs/msg/Vector3")
_quaternion = message_class("geometry_msgs/msg/Quaternion")

IMU_TOPICS = (
    PublishedByNode("imu/data", IMU),
    PublishedByNode("imu/data_raw", IMU, on_demand=True),
    PublishedByNode("imu/mag", "sensor_msgs/msg/MagneticField", on_demand=True),
    PublishedByNode("imu/static_pressure", "sensor_msgs/msg/FluidPressure", on_demand=True),
    PublishedByNode("imu/diff_pressure", "sensor_msgs/msg/FluidPressure", on_demand=True),
    PublishedByNode("imu/temperature_imu", "sensor_msgs/msg/Temperature", on_demand=True),
)


class ImuMeasurement(NamedTuple):
    """One IMU measurement in FRD: m/s^2, rad/s, tesla."""

    acceleration: frames.Vector
    rates: frames.Vector
    field: frames.Vector


def _triple(fields: Fields, kind: str, scale: float) -> frames.Vector:
    return fields[f"x{kind}"] * scale, fields[f"y{kind}"] * scale, fields[f"z{kind}"] * scale


def imu_measurement(name: str, fields: Fields) -> ImuMeasurement:
    """Return the measurement in a RAW_IMU, SCALED_IMU or HIGHRES_IMU."""
    if name == "HIGHRES_IMU":
        return ImuMeasurement(
            _triple(fields, "acc", 1.0), _triple(fields, "gyro", 1.0), _triple(fields, "mag", TESLA)
        )
    return ImuMeasurement(
        _triple(fields, "acc", G / 1000.0),
        _triple(fields, "gyro", 1e-3),
        _triple(fields, "mag", TESLA / 1000.0),
    )


IMU_SOURCES = ("HIGHRES_IMU", "RAW_IMU", "SCALED_IMU")
"""Messages with measurements; the first one that the autopilot sends is used."""


def imu_source(link: AutopilotLink) -> str:
    """Return which of ``IMU_SOURCES`` is used; empty while none has been received."""
    return next((name for name in IMU_SOURCES if name in link.latest), "")


class ImuPublisher:
    """Publishes IMU data, magnetic field, pressures and temperature."""

    def __init__(self, context: InterfaceContext) -> None:
        self._link = context.link
        self._publish, self._wanted = context.publish, context.wanted

    def translators(self) -> Mapping[str, Translator]:
        """Return the translators by message name."""
        return {
            "ATTITUDE": self._attitude,
            **{name: self._measured(name) for name in IMU_SOURCES},
            "SCALED_PRESSURE": self._pressure,
        }

    def _attitude(self, fields: Fields, at: Ns) -> None:
        """Publish ``imu/data`` with the acceleration of the last measurement.

        Without a measurement the acceleration is marked unknown, and so are rates that are NaN.
        """
        message = new(IMU, header=stamped(at, BODY))
        message.orientation = orientation(fields)
        message.angular_velocity = body_rates(fields)
        if isnan(fields["rollspeed"]):
            message.angular_velocity_covariance[0] = UNKNOWN
        name = imu_source(self._link)
        last = self._link.last(name)
        if last is None:
            message.linear_acceleration_covariance[0] = UNKNOWN
        else:
            message.linear_acceleration = _vector(
                *frames.frd_to_flu(imu_measurement(name, last).acceleration)
            )
        self._publish("imu/data", message)

    def _measured(self, name: str) -> Translator:
        def translate(fields: Fields, at: Ns) -> None:
            if imu_source(self._link) != name:
                return
            if self._wanted("imu/data_raw"):
                self._publish("imu/data_raw", _raw_imu(imu_measurement(name, fields), at))
            if self._wanted("imu/mag"):
                field = _vector(*frames.frd_to_flu(imu_measurement(name, fields).field))
                kind = "sensor_msgs/msg/MagneticField"
                self._publish("imu/mag", new(kind, header=stamped(at, BODY), magnetic_field=field))

        return translate

    def _pressure(self, fields: Fields, at: Ns) -> None:
        """Publish pressures (from hPa) and temperature (from 0.01 degrees)."""
        for topic, name in (("imu/static_pressure", "press_abs"), ("imu/diff_pressure", "press_diff")):
            if self._wanted(topic):
                header, pascals = stamped(at, BODY), fields[name] * PASCALS
                self._publish(
                    topic, new("sensor_msgs/msg/FluidPressure", header=header, fluid_pressure=pascals)
                )
        if self._wanted("imu/temperature_imu"):
            degrees = fields["temperature"] / 100.0
            kind = "sensor_msgs/msg/Temperature"
            self._publish("imu/temperature_imu", new(kind, header=stamped(at, BODY), temperature=degrees))


def _raw_imu(measured: ImuMeasurement, at: Ns) -> Any:
    message = new(IMU, header=stamped(at, BODY))
    message.orientation_covariance[0] = UNKNOWN
    message.angular_velocity = _vector(*frames.frd_to_flu(measured.rates))
    message.linear_acceleration = _vector(*frames.frd_to_flu(measured.acceleration))
    return message


def orientation(attitude: Fields) -> Any:
    """Return the attitude of the FLU body in ENU for an ATTITUDE."""
    ned = frames.euler_to_quaternion(attitude["roll"], attitude["pitch"], attitude["yaw"])
    w, x, y, z = frames.attitude_ned_to_enu(ned)
    return _quaternion(x, y, z, w)


def body_rates(attitude: Fields) -> Any:
    """Return the rates of an ATTITUDE in FLU."""
    rates = (attitude["rollspeed"], attitude["pitchspeed"], attitude["yawspeed"])
    return _vector(*frames.frd_to_flu(rates))


MAP = "map"
_UNKNOWN_U8, _UNKNOWN_U16 = 255, 65535
_FIX_3D, _FIX_DGPS = 3, 4
_ODOMETRY = "nav_msgs/msg/Odometry"
_TWIST = "geometry_msgs/msg/TwistStamped"

_point = message_class("geometry_msgs/msg/Point")

POSE_TOPICS = (
    PublishedByNode("global_position/global", "sensor_msgs/msg/NavSatFix"),
    PublishedByNode("global_position/raw/fix", "sensor_msgs/msg/NavSatFix"),
    PublishedByNode("global_position/raw/gps_vel", _TWIST, on_demand=True),
    PublishedByNode("global_position/raw/satellites", "std_msgs/msg/UInt32", on_demand=True),
    PublishedByNode("global_position/rel_alt", "std_msgs/msg/Float64"),
    PublishedByNode("global_position/compass_hdg", "std_msgs/msg/Float64"),
    PublishedByNode("global_position/local", _ODOMETRY, on_demand=True),
    PublishedByNode("global_position/gp_origin", "geographic_msgs/msg/GeoPointStamped", LATCHED_STATE),
    PublishedByNode("local_position/pose", "geometry_msgs/msg/PoseStamped"),
    PublishedByNode("local_position/velocity_local", _TWIST),
    PublishedByNode("local_position/velocity_body", _TWIST, on_demand=True),
    PublishedByNode("local_position/odom", _ODOMETRY, on_demand=True),
    PublishedByNode("home_position/home", "mavros_msgs/msg/HomePosition", LATCHED_STATE),
    PublishedByNode("altitude", "mavros_msgs/msg/Altitude", on_demand=True),
)


class PosePublisher:
    """Publishes positions and velocities, combining the latest frames that the link keeps."""

    def __init__(self, context: InterfaceContext) -> None:
        self._link, self._geoid = context.link, context.geoid
        self._publish, self._wanted = context.publish, context.wanted

    def translators(self) -> Mapping[str, Translator]:
        """Return the translators by message name."""
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

    def _fix(self, fields: Fields, at: Ns) -> Any:
        """Return a NavSatFix with status and covariance of the last GPS_RAW_INT."""
        raw = self._link.last("GPS_RAW_INT") or {}
        kind = raw.get("fix_type", 0)
        latitude, longitude = fields["lat"] / 1e7, fields["lon"] / 1e7
        message = new(
            "sensor_msgs/msg/NavSatFix",
            header=stamped(at, BODY),
            latitude=latitude,
            longitude=longitude,
            altitude=self._ellipsoidal(latitude, longitude, fields["alt"]),
        )
        message.status.status = -1 if kind < _FIX_3D else (2 if kind > _FIX_DGPS else kind - _FIX_3D)
        message.status.service = 1
        horizontal, vertical = raw.get("eph", _UNKNOWN_U16), raw.get("epv", _UNKNOWN_U16)
        if _UNKNOWN_U16 not in (horizontal, vertical):
            h, v = horizontal / 100.0, vertical / 100.0
            h2, v2 = h * h, v * v
            message.position_covariance = [h2, 0.0, 0.0, 0.0, h2, 0.0, 0.0, 0.0, v2]
            message.position_covariance_type = 1
        return message

    def _raw(self, fields: Fields, at: Ns) -> None:
        self._publish("global_position/raw/fix", self._fix(fields, at))
        if self._wanted("global_position/raw/satellites") and fields["satellites_visible"] != _UNKNOWN_U8:
            seen = new("std_msgs/msg/UInt32", data=fields["satellites_visible"])
            self._publish("global_position/raw/satellites", seen)
        speed, course = fields["vel"], fields["cog"]
        if self._wanted("global_position/raw/gps_vel") and _UNKNOWN_U16 not in (speed, course):
            heading = radians(course / 100.0)
            ned = (speed / 100.0 * cos(heading), speed / 100.0 * sin(heading), 0.0)
            twist = new(_TWIST, header=stamped(at, MAP))
            twist.twist.linear = _vector(*frames.ned_to_enu(ned))
            self._publish("global_position/raw/gps_vel", twist)

    def _global(self, fields: Fields, at: Ns) -> None:
        self._publish("global_position/global", self._fix(fields, at))
        self._publish(
            "global_position/rel_alt", new("std_msgs/msg/Float64", data=fields["relative_alt"] / 1000.0)
        )
        if fields["hdg"] != _UNKNOWN_U16:
            heading = new("std_msgs/msg/Float64", data=fields["hdg"] / 100.0)
            self._publish("global_position/compass_hdg", heading)
        if self._wanted("global_position/local"):
            self._publish_about_home(fields, at)

    def _publish_about_home(self, fields: Fields, at: Ns) -> None:
        """Publish position about home and velocity, both ENU, once home is known."""
        home = self._link.last("HOME_POSITION")
        if home is None:
            return
        home_frame = frames.LocalFrame(
            home["latitude"] / 1e7, home["longitude"] / 1e7, home["altitude"] / 1000.0
        )
        enu = home_frame.to_enu(fields["lat"] / 1e7, fields["lon"] / 1e7, fields["alt"] / 1000.0)
        velocity = frames.ned_to_enu((fields["vx"] / 100.0, fields["vy"] / 100.0, fields["vz"] / 100.0))
        self._publish("global_position/local", self._odometry(enu, velocity, at))

    def _odometry(self, place: frames.Vector, velocity: frames.Vector, at: Ns) -> Any:
        """Return an odometry; *velocity* is ENU in ``global_position/local``, FLU in ``odom``."""
        odometry = new(_ODOMETRY, header=stamped(at, MAP), child_frame_id=BODY)
        odometry.pose.pose.position = _point(*place)
        odometry.twist.twist.linear = _vector(*velocity)
        attitude = self._link.last("ATTITUDE")
        if attitude is not None:
            odometry.pose.pose.orientation = orientation(attitude)
            odometry.twist.twist.angular = body_rates(attitude)
        return odometry

    def _origin(self, fields: Fields, at: Ns) -> None:
        latitude, longitude = fields["latitude"] / 1e7, fields["longitude"] / 1e7
        message = new("geographic_msgs/msg/GeoPointStamped", header=stamped(at, MAP))
        message.position.latitude, message.position.longitude = latitude, longitude
        message.position.altitude = self._ellipsoidal(latitude, longitude, fields["altitude"])
        self._publish("global_position/gp_origin", message)

    def _local(self, fields: Fields, at: Ns) -> None:
        pose = new("geometry_msgs/msg/PoseStamped", header=stamped(at, MAP))
        pose.pose.position = _point(*frames.ned_to_enu((fields["x"], fields["y"], fields["z"])))
        attitude = self._link.last("ATTITUDE")
        if attitude is not None:
            pose.pose.orientation = orientation(attitude)
        self._publish("local_position/pose", pose)
        twist = new(_TWIST, header=stamped(at, MAP))
        twist.twist.linear = _vector(*frames.ned_to_enu((fields["vx"], fields["vy"], fields["vz"])))
        if attitude is not None:
            twist.twist.angular = body_rates(attitude)
        self._publish("local_position/velocity_local", twist)
        self._publish_in_body(fields, at)

    def _publish_in_body(self, fields: Fields, at: Ns) -> None:
        """Publish the velocity in FLU, once an attitude is known."""
        attitude = self._link.last("ATTITUDE")
        odometry, velocity = (self._wanted(f"local_position/{name}") for name in ("odom", "velocity_body"))
        if attitude is None or not (odometry or velocity):
            return
        ned = frames.euler_to_quaternion(attitude["roll"], attitude["pitch"], attitude["yaw"])
        body = frames.frd_to_flu(frames.world_to_body(ned, (fields["vx"], fields["vy"], fields["vz"])))
        if velocity:
            twist = new(_TWIST, header=stamped(at, BODY))
            twist.twist.linear, twist.twist.angular = _vector(*body), body_rates(attitude)
            self._publish("local_position/velocity_body", twist)
        if odometry:
            place = frames.ned_to_enu((fields["x"], fields["y"], fields["z"]))
            self._publish("local_position/odom", self._odometry(place, body, at))

    def _home(self, fields: Fields, at: Ns) -> None:
        message = new("mavros_msgs/msg/HomePosition", header=stamped(at, MAP))
        latitude, longitude = fields["latitude"] / 1e7, fields["longitude"] / 1e7
        message.geo.latitude, message.geo.longitude = latitude, longitude
        message.geo.altitude = self._ellipsoidal(latitude, longitude, fields["altitude"])
        message.position = _point(*frames.ned_to_enu((fields["x"], fields["y"], fields["z"])))
        message.approach = _vector(
            *frames.ned_to_enu((fields["approach_x"], fields["approach_y"], fields["approach_z"]))
        )
        self._publish("home_position/home", message)

    def _altitude(self, fields: Fields, at: Ns) -> None:
        """Publish ``altitude``. Only PX4 sends the message."""
        if self._wanted("altitude"):
            kinds = ("monotonic", "amsl", "local", "relative", "terrain")
            heights = {kind: fields[f"altitude_{kind}"] for kind in kinds}
            clearance = fields["bottom_clearance"]
            header = stamped(at, MAP)
            message = new("mavros_msgs/msg/Altitude", header=header, bottom_clearance=clearance, **heights)
            self._publish("altitude", message)


TF, TF_STATIC = "/tf", "/tf_static"
TF_MESSAGE = "tf2_msgs/msg/TFMessage"
_SINGLE_VEHICLE = "/mavros"
_HALF = sqrt(0.5)
_NED_IN_ENU = (0.0, _HALF, _HALF, 0.0)
_FRD_IN_FLU = (0.0, 1.0, 0.0, 0.0)
"""Quaternions (w, x, y, z): half turns about the horizontal diagonal and about the forward axis."""


TRANSFORM_TOPICS = (
    PublishedByNode(TF, TF_MESSAGE, QoS(100), on_demand=True),
    PublishedByNode(TF_STATIC, TF_MESSAGE, LATCHED),
)


class TransformPublisher:
    """Publishes the transforms of the vehicle."""

    def __init__(self, context: InterfaceContext) -> None:
        self._link, self._origin = context.link, context.origin
        self._publish, self._wanted = context.publish, context.wanted
        self._moving = context.pose_transform
        namespace = context.node.namespace
        prefix = "" if namespace == _SINGLE_VEHICLE else f"{namespace.strip('/')}/".lstrip("/")
        self._body = f"{prefix}{BODY}"
        self._static_sent = False

    def translators(self) -> Mapping[str, Translator]:
        """Return the translators by message name."""
        if not self._moving:
            return {"HEARTBEAT": self._publish_static}
        if self._origin is None:
            return {"HEARTBEAT": self._publish_static, "LOCAL_POSITION_NED": self._local}
        return {"HEARTBEAT": self._publish_static, "GLOBAL_POSITION_INT": partial(self._global, self._origin)}

    def _publish_static(self, fields: Fields, at: Ns) -> None:
        """Publish the static transforms once; late subscriptions receive them from the graph."""
        if self._static_sent:
            return
        self._static_sent = True
        pairs = ((MAP, f"{MAP}_ned", _NED_IN_ENU), (self._body, f"{self._body}_frd", _FRD_IN_FLU))
        static = [transform(at, parent, child, ros_quaternion(turn)) for parent, child, turn in pairs]
        self._publish(TF_STATIC, new(TF_MESSAGE, transforms=static))

    def _global(self, origin: frames.LocalFrame, fields: Fields, at: Ns) -> None:
        self._publish_pose(
            origin.to_enu(fields["lat"] / 1e7, fields["lon"] / 1e7, fields["alt"] / 1000.0), at
        )

    def _local(self, fields: Fields, at: Ns) -> None:
        self._publish_pose(frames.ned_to_enu((fields["x"], fields["y"], fields["z"])), at)

    def _publish_pose(self, enu: frames.Vector, at: Ns) -> None:
        attitude = self._link.last("ATTITUDE")
        if attitude is not None and self._wanted(TF):
            moving = transform(at, MAP, self._body, orientation(attitude), enu)
            self._publish(TF, new(TF_MESSAGE, transforms=[moving]))


def ros_quaternion(quaternion: frames.Quaternion) -> Any:
    """Return a ``geometry_msgs/msg/Quaternion`` of (w, x, y, z)."""
    w, x, y, z = quaternion
    return _quaternion(x, y, z, w)


def transform(at: Ns, parent: str, child: str, rotation: Any, place: frames.Vector = (0.0, 0.0, 0.0)) -> Any:
    """Return a ``geometry_msgs/msg/TransformStamped`` of ROS time *at* in ns; *rotation* is a message."""
    made = new("geometry_msgs/msg/TransformStamped", header=stamped(at, parent), child_frame_id=child)
    made.transform.translation = _vector(*place)
    made.transform.rotation = rotation
    return made
