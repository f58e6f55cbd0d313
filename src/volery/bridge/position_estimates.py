"""External position estimates on MAVROS's topics, and the origin of the autopilot's estimator.

Poses are of the FLU body in ENU on the ROS side. As in MAVROS, ``odometry/out`` becomes an ODOMETRY in the
frame LOCAL_FRD whose velocity is the body's.
"""

from __future__ import annotations

from math import nan
from typing import Any

from volery.base import frames
from volery.base.geoid import Geoid
from volery.base.time import Ns, S
from volery.bridge.node_interface import OutgoingMessage, SubscribedTopic
from volery.links.mavlink_messages import constant

LOCAL_FRD, BODY_FRD = constant("MAV_FRAME_LOCAL_FRD"), constant("MAV_FRAME_BODY_FRD")
UNSTATED, UNKNOWN = [0.0] * 21, [nan, *[0.0] * 20]
"""Covariances of which nothing is stated: MAVROS's zeros, and by MAVLink a first value that is no number."""


def estimate_subscriptions(geoid: Geoid) -> tuple[SubscribedTopic, ...]:
    """Return the subscriptions; *geoid* converts the ellipsoidal altitude of an origin to AMSL."""

    def origin(message: Any, now: Ns) -> OutgoingMessage:
        at = message.position
        amsl = geoid.to_amsl(at.latitude, at.longitude, at.altitude)
        place = {"latitude": round(at.latitude * 1e7), "longitude": round(at.longitude * 1e7)}
        return "SET_GPS_GLOBAL_ORIGIN", {**place, "altitude": round(amsl * 1000.0), "time_usec": now // 1000}

    covariant = "geometry_msgs/msg/PoseWithCovarianceStamped"
    return (
        SubscribedTopic("vision_pose/pose", "geometry_msgs/msg/PoseStamped", pose),
        SubscribedTopic("vision_pose/pose_cov", covariant, pose_with_covariance),
        SubscribedTopic("odometry/out", "nav_msgs/msg/Odometry", odometry),
        SubscribedTopic("global_position/set_gp_origin", "geographic_msgs/msg/GeoPointStamped", origin),
    )


def _stamp(message: Any, now: Ns) -> int:
    """Return the time of a message [us]; its arrival where it states none."""
    stamp = message.header.stamp
    return (stamp.sec * S + stamp.nanosec or now) // 1000


def _vector(value: Any) -> frames.Vector:
    return value.x, value.y, value.z


def _attitude(orientation: Any) -> frames.Quaternion:
    return frames.attitude_enu_to_ned((orientation.w, orientation.x, orientation.y, orientation.z))


def _estimate(message: Any, at: Any, covariance: list[float], now: Ns) -> OutgoingMessage:
    x, y, z = frames.enu_to_ned(_vector(at.position))
    roll, pitch, yaw = frames.quaternion_to_euler(_attitude(at.orientation))
    return "VISION_POSITION_ESTIMATE", {
        "usec": _stamp(message, now),
        "x": x,
        "y": y,
        "z": z,
        "roll": roll,
        "pitch": pitch,
        "yaw": yaw,
        "covariance": covariance,
        "reset_counter": 0,
    }


def pose(message: Any, now: Ns) -> OutgoingMessage:
    """Translate ``vision_pose/pose``; no covariance is stated."""
    return _estimate(message, message.pose, UNSTATED, now)


def _upper(covariance: Any) -> list[float]:
    return frames.upper_triangle(frames.pose_covariance_enu_to_ned([float(one) for one in covariance]))


def pose_with_covariance(message: Any, now: Ns) -> OutgoingMessage:
    """Translate ``vision_pose/pose_cov``."""
    return _estimate(message, message.pose.pose, _upper(message.pose.covariance), now)


def odometry(message: Any, now: Ns) -> OutgoingMessage:
    """Translate ``odometry/out``: the pose, and the velocity and rates of the body."""
    at = message.pose.pose
    x, y, z = frames.enu_to_ned(_vector(at.position))
    vx, vy, vz = frames.flu_to_frd(_vector(message.twist.twist.linear))
    roll_rate, pitch_rate, yaw_rate = frames.flu_to_frd(_vector(message.twist.twist.angular))
    return "ODOMETRY", {
        "time_usec": _stamp(message, now),
        "frame_id": LOCAL_FRD,
        "child_frame_id": BODY_FRD,
        "x": x,
        "y": y,
        "z": z,
        "q": list(_attitude(at.orientation)),
        "vx": vx,
        "vy": vy,
        "vz": vz,
        "rollspeed": roll_rate,
        "pitchspeed": pitch_rate,
        "yawspeed": yaw_rate,
        "pose_covariance": _upper(message.pose.covariance),
        "velocity_covariance": UNKNOWN,
        "reset_counter": 0,
        "estimator_type": constant("MAV_ESTIMATOR_TYPE_VISION"),
        "quality": 0,
    }
