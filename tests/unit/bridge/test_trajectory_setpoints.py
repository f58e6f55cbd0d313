"""A trajectory on MAVROS's topic becomes set-points at the times of its points."""

from math import pi
from typing import Any

import pytest

from volery.base.time import MS, S
from volery.ros.messages import new

TYPE = "trajectory_msgs/MultiDOFJointTrajectory"
TARGET = "SET_POSITION_TARGET_LOCAL_NED"


def point(after: float, **parts: Any) -> Any:
    made = new("trajectory_msgs/MultiDOFJointTrajectoryPoint", **parts)
    made.time_from_start.sec, made.time_from_start.nanosec = divmod(round(after * S), S)
    return made


def place(x: float, y: float, z: float) -> list[Any]:
    transform = new("geometry_msgs/Transform")
    transform.translation.x, transform.translation.y, transform.translation.z = x, y, z
    transform.rotation.w = 1.0
    return [transform]


def twist(x: float, y: float, z: float, turn: float) -> list[Any]:
    made = new("geometry_msgs/Twist")
    made.linear.x, made.linear.y, made.linear.z, made.angular.z = x, y, z, turn
    return [made]


def test_points_are_sent_at_their_times_with_what_they_have(rig: Any) -> None:
    rig.connect()
    desired = rig.listen("setpoint_trajectory/desired", "nav_msgs/Path")
    points = [
        point(0.0, transforms=place(1.0, 2.0, 3.0)),
        point(0.5, transforms=place(4.0, 5.0, 6.0), velocities=twist(1.0, 2.0, 0.5, 0.25)),
        point(2.0, velocities=twist(0.0, 0.0, -1.0, 0.0), accelerations=twist(3.0, 4.0, 5.0, 0.0)),
    ]
    rig.publish("setpoint_trajectory/local", TYPE, points=points)
    rig.run(100 * MS)
    [first] = rig.asked(TARGET)
    assert [first[one] for one in ("x", "y", "z", "yaw")] == pytest.approx([2.0, 1.0, -3.0, pi / 2])
    assert first["type_mask"] == 0b1001_1111_1000 & ~0b0100_0000_0000
    assert [one.pose.position.x for one in desired[0].poses] == [1.0, 4.0]
    rig.run(S)
    _, second = rig.asked(TARGET)
    assert [second[one] for one in ("x", "y", "vx", "vy", "vz")] == pytest.approx([5.0, 4.0, 2.0, 1.0, -0.5])
    assert (second["yaw_rate"], second["type_mask"]) == (-0.25, 0b0001_1100_0000)
    rig.run(S)
    *_, third = rig.asked(TARGET)
    assert [third[one] for one in ("vz", "afx", "afy", "afz")] == pytest.approx([1.0, 4.0, 3.0, -5.0])
    assert third["type_mask"] == 0b0100_0000_0111


def test_a_reset_drops_the_points_that_are_left(rig: Any) -> None:
    rig.connect()
    points = [point(0.0, transforms=place(1.0, 0.0, 2.0)), point(0.5, transforms=place(9.0, 0.0, 2.0))]
    rig.publish("setpoint_trajectory/local", TYPE, points=points)
    assert rig.call("setpoint_trajectory/reset", "std_srvs/Trigger").success
    rig.run(2 * S)
    assert len(rig.asked(TARGET)) == 1
    assert not rig.call("setpoint_trajectory/reset", "std_srvs/Trigger").success
