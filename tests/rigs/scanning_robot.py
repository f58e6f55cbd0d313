"""Messages of a robot that drives through a floor plan: scans, odometry, transforms."""

from __future__ import annotations

from typing import Any

import numpy as np

from rigs.floor_plans import ANGLES, OFFICE, ranges
from volery.autonomy.planar_pose import Pose2
from volery.base.frames import euler_to_quaternion
from volery.ros.messages import new

MOUNTING = Pose2(0.1, 0.0, 0.2)
"""Where the scanner is on the robot."""


def stamp(header: Any, time: int, frame: str) -> None:
    header.stamp.sec, header.stamp.nanosec, header.frame_id = time // 10**9, time % 10**9, frame


def turned(pose: Pose2) -> dict[str, float]:
    return dict(zip("wxyz", euler_to_quaternion(0.0, 0.0, pose.yaw), strict=True))


def scan_message(time: int, pose: Pose2, noise: float = 0.0) -> Any:
    """Return what the scanner sees at its pose."""
    message = new("sensor_msgs/msg/LaserScan")
    stamp(message.header, time, "lidar")
    message.angle_min, message.angle_increment = float(ANGLES[0]), float(ANGLES[1] - ANGLES[0])
    message.range_min, message.range_max = 0.05, 10.0
    seen = ranges(OFFICE, pose) + np.random.default_rng(time).normal(0.0, noise, len(ANGLES))
    message.ranges = seen.astype(np.float32)
    return message


def odometry_message(time: int, pose: Pose2) -> Any:
    message = new("nav_msgs/msg/Odometry", child_frame_id="base_link")
    stamp(message.header, time, "odom")
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    place.x, place.y = pose.x, pose.y
    for axis, value in turned(pose).items():
        setattr(turn, axis, value)
    return message


def transform(time: int, parent: str, child: str, pose: Pose2) -> Any:
    message, moved = new("tf2_msgs/msg/TFMessage"), new("geometry_msgs/msg/TransformStamped")
    stamp(moved.header, time, parent)
    moved.child_frame_id = child
    moved.transform.translation.x, moved.transform.translation.y = pose.x, pose.y
    for axis, value in turned(pose).items():
        setattr(moved.transform.rotation, axis, value)
    message.transforms = [moved]
    return message
