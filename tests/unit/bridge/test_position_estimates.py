"""MAVROS's topics for external position estimates: ENU in, NED out, and the origin of the estimator."""

from math import isnan, sqrt
from typing import Any

import pytest

from volery.ros import messages

from .test_commands_services import only

HALF = sqrt(0.5)
POSE = {
    "position": {"x": 1.0, "y": 2.0, "z": 3.0},
    "orientation": {"w": HALF, "x": 0.0, "y": 0.0, "z": HALF},  # yaw 90 degrees from east: the nose is north
}


def covariance() -> list[float]:
    values = [0.0] * 36
    for axis, variance in enumerate((0.04, 0.01, 0.09, 0.001, 0.002, 0.003)):
        values[7 * axis] = variance
    values[2] = values[12] = 0.005  # of east and up
    return values


def publish(rig: Any, topic: str, kind: str, pose: Any, **more: Any) -> None:
    publisher = rig.user.advertise(f"/drone_1/{topic}", kind)
    message = messages.new(kind)
    place = pose(message)
    for part, values in POSE.items():
        for name, value in values.items():
            setattr(getattr(place, part), name, value)
    for name, value in more.items():
        setattr(message, name, value)
    message.header.stamp.sec, message.header.stamp.nanosec = 3, 500_000
    publisher.publish(message)


def test_a_pose(rig: Any) -> None:
    rig.connect()
    publish(rig, "vision_pose/pose", "geometry_msgs/msg/PoseStamped", lambda message: message.pose)
    sent = only(rig, "VISION_POSITION_ESTIMATE")
    assert (sent["x"], sent["y"], sent["z"]) == (2.0, 1.0, -3.0)
    assert (sent["roll"], sent["pitch"], sent["yaw"]) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert sent["usec"] == 3_000_500
    assert set(sent["covariance"]) == {0.0}


def test_a_pose_with_its_covariance(rig: Any) -> None:
    rig.connect()

    def place(message: Any) -> Any:
        message.pose.covariance = covariance()
        return message.pose.pose

    publish(rig, "vision_pose/pose_cov", "geometry_msgs/msg/PoseWithCovarianceStamped", place)
    upper = only(rig, "VISION_POSITION_ESTIMATE")["covariance"]
    assert [upper[place] for place in (0, 6, 11, 15, 18, 20)] == pytest.approx(
        [0.01, 0.04, 0.09, 0.002, 0.001, 0.003]
    )
    assert upper[7] == pytest.approx(-0.005)  # of east and down


def test_an_odometry(rig: Any) -> None:
    rig.connect()

    def place(message: Any) -> Any:
        message.pose.covariance = covariance()
        message.twist.twist.linear.x, message.twist.twist.linear.y = 1.5, 0.5
        return message.pose.pose

    publish(rig, "odometry/out", "nav_msgs/msg/Odometry", place)
    sent = only(rig, "ODOMETRY")
    assert (sent["frame_id"], sent["child_frame_id"]) == (20, 12)
    assert (sent["x"], sent["y"], sent["z"]) == (2.0, 1.0, -3.0)
    assert [abs(one) for one in sent["q"]] == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-6)
    assert (sent["vx"], sent["vy"]) == (1.5, -0.5)
    assert sent["pose_covariance"][0] == pytest.approx(0.01)
    assert isnan(sent["velocity_covariance"][0])


def test_the_origin(raised_rig: Any) -> None:
    raised_rig.connect()
    publisher = raised_rig.user.advertise(
        "/drone_1/global_position/set_gp_origin", "geographic_msgs/msg/GeoPointStamped"
    )
    message = messages.new("geographic_msgs/msg/GeoPointStamped")
    message.position.latitude, message.position.longitude, message.position.altitude = 47.5, 8.25, 547.0
    publisher.publish(message)
    sent = only(raised_rig, "SET_GPS_GLOBAL_ORIGIN")
    assert (sent["target_system"], sent["latitude"], sent["longitude"]) == (1, 475_000_000, 82_500_000)
    assert sent["altitude"] == 500_000
