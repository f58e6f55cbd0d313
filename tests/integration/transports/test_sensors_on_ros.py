"""Scans and transforms of a model on real graphs: programs of rospy and rclpy with the buffers of tf2."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from volery.ros.transports.ros1 import Roscore
from volery.trace.events import Text
from volery.trace.reader import read

from .conftest import python_of, surroundings

pytestmark = pytest.mark.integration

MODEL = """
volery: 1
name: mapped
components: {{Watch: {{language: {language}, path: watch.py, active: true}}}}
application: {{watch: {{is: Watch}}}}
platform: {{processors: {{onboard: {{is: rpi4-cortex-a72, frequency: 1500 MHz, carried_by: rover_1}}}}}}
allocations: {{only: {{watch: onboard, rover_1: onboard}}}}
environment:
  origin: {{latitude: 47, longitude: 8}}
  buildings:
    wedge: {{corners: [{{east: 5 m, north: -9 m}}, {{east: 6 m, north: -9 m}}, {{east: 6 m, north: 9 m}}]}}
  vehicles:
    rover_1:
      kind: rover
      autopilot: ardupilot
      at: {{east: 0 m, north: 0 m}}
      heading: 90 deg
      added_sensors: [{{lidar: {{noise: 0 m, at: [0.2, 0, 0.3]}}}}, {{odometry: {{drift: 0 deg/min}}}}]
run: {{duration: 4 s}}
"""
WATCH = {
    "rospy": """
import rospy, tf2_ros
from sensor_msgs.msg import LaserScan
def scan(message):
    frame = message.header.frame_id
    if transforms.can_transform("odom", frame, rospy.Time(0)):
        found = transforms.lookup_transform("odom", frame, rospy.Time(0)).transform.translation
        rospy.loginfo("%s %d %.2f %.2f", frame, len(message.ranges), message.ranges[180], found.x)
rospy.init_node("watch")
transforms = tf2_ros.Buffer()
listener = tf2_ros.TransformListener(transforms)
rospy.Subscriber("/rover_1/scan", LaserScan, scan)
rospy.spin()
""",
    "rclpy": """
import rclpy, tf2_ros
from sensor_msgs.msg import LaserScan
def scan(message):
    frame, now = message.header.frame_id, rclpy.time.Time()
    if transforms.can_transform("odom", frame, now):
        found = transforms.lookup_transform("odom", frame, now).transform.translation
        text = f"{frame} {len(message.ranges)} {message.ranges[180]:.2f} {found.x:.2f}"
        node.get_logger().info(text)
rclpy.init()
node = rclpy.create_node("watch")
transforms = tf2_ros.Buffer()
listener = tf2_ros.TransformListener(transforms, node)
node.create_subscription(LaserScan, "/rover_1/scan", scan, 10)
rclpy.spin(node)
""",
}


def heard(folder: Path, language: str, python: str, graph: str, env: Mapping[str, str]) -> list[str]:
    """What the component logs about scans whose frame it can place in ``odom``."""
    (folder / "watch.py").write_text(WATCH[language])
    (folder / "model.yaml").write_text(MODEL.format(language=language))
    simulate = "from volery.cli.main import main; main()", "simulate", str(folder / "model.yaml")
    options = "--quiet", "--graph", graph, "--speed", "1", "--out", str(folder / "out")
    subprocess.run([python, "-c", *simulate, *options], env=env, check=True, timeout=300)
    events = read(folder / "out" / "trace.mcap").events
    return [one.text for one in events if isinstance(one, Text) and one.source == "watch"]


def test_rospy_places_scans_by_tf2(roscore: Roscore, tmp_path: Path) -> None:
    env = {**os.environ, "ROS_MASTER_URI": roscore.uri, "ROS_IP": "127.0.0.1"}
    texts = heard(tmp_path, "rospy", sys.executable, "ros1", env)
    assert len(texts) > 10
    assert set(texts) == {"lidar 360 5.30 0.20"}  # 5.5 m east of the origin


def test_rclpy_places_scans_by_tf2(tmp_path: Path) -> None:
    texts = heard(tmp_path, "rclpy", python_of("jazzy"), "ros2", surroundings())
    assert len(texts) > 10
    assert set(texts) == {"lidar 360 5.30 0.20"}  # 5.5 m east of the origin
