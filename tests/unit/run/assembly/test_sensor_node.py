"""Added sensors are read by components: typed messages on topics, of the scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from volery import Options, simulate
from volery.base.errors import ModelError
from volery.base.frames import body_to_world
from volery.run.event_log import LogOptions
from volery.simulation.world import sensors
from volery.simulation.world.sensors import ErrorModel, Sensor
from volery.trace.events import Omitted, Published
from volery.trace.reader import read

MODEL = """
volery: 1
name: seen
components: {{Watch: {{language: {language}, path: watch.py, active: true}}}}
application: {{watch: {{is: Watch}}}}
platform: {{processors: {{onboard: {{is: rpi4-cortex-a72, frequency: 1500 MHz, carried_by: rover_1}}}}}}
allocations: {{only: {{watch: onboard, rover_1: onboard}}}}
environment:
  origin: {{latitude: 47, longitude: 8}}
  places: {{here: {{east: 0 m, north: 0 m}}}}
  buildings: {{tank: {{centre: {{east: 25 m, north: 0 m}}, radius: 5 m, ceiling: 9 m}}}}
  vehicles:
    rover_1: {{kind: rover, autopilot: ardupilot, at: here, heading: 90 deg, added_sensors: {sensor}}}
run: {{duration: 2 s}}
"""
WATCH = {
    "rospy": """
import rospy
from sensor_msgs.msg import Range
def hear(message):
    rospy.loginfo("%s %.2f %.2f", message.header.frame_id, message.header.stamp.to_sec(), message.range)
if __name__ == "__main__":
    rospy.init_node("watch")
    rospy.Subscriber("/rover_1/ahead", Range, hear)
    rospy.spin()
""",
    "rclpy": """
import rclpy
from sensor_msgs.msg import Range
def hear(message):
    stamp = message.header.stamp.sec + message.header.stamp.nanosec / 1e9
    node.get_logger().info(f"{message.header.frame_id} {stamp:.2f} {message.range:.2f}")
if __name__ == "__main__":
    rclpy.init()
    node = rclpy.create_node("watch")
    node.create_subscription(Range, "/rover_1/ahead", hear, 10)
    rclpy.spin(node)
""",
}
EXACT = ErrorModel()


@dataclass(frozen=True)
class RangeAhead(Sensor):
    """Distance to what stands ahead, up to 30 m."""

    name: str = "ahead"
    error: ErrorModel = EXACT
    rate: float = 5.0

    type = "sensor_msgs/msg/Range"

    def ideal(self, state):
        ahead = body_to_world(state.attitude, (1.0, 0.0, 0.0))
        return tuple(state.scene.cast(np.array([state.position]), np.array([ahead]), 30.0))

    def fill(self, message, values):
        message.range, message.max_range = values[0], 30.0


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    monkeypatch.setitem(sensors.sensors._added, "ahead", RangeAhead())


@pytest.mark.parametrize("language", ["rospy", "rclpy"])
def test_a_component_reads_an_added_sensor(language, tmp_path):
    (tmp_path / "watch.py").write_text(WATCH[language])
    (tmp_path / "model.yaml").write_text(MODEL.format(language=language, sensor="ahead"))
    run = simulate(
        tmp_path / "model.yaml", Options(out=tmp_path / "run", log=LogOptions(tmp_path / "log.txt"))
    )
    assert run.ok, run.record.outcome
    heard = [
        line.split("watch: ")[1]
        for line in (tmp_path / "log.txt").read_text().splitlines()
        if "watch: " in line
    ]
    assert len(heard) == pytest.approx(9, abs=1)
    assert heard[0].split() == ["ahead", "0.20", "19.98"]  # a circle is inside its polygon


def test_a_sensor_that_no_package_provides_is_an_error_of_the_model(tmp_path):
    (tmp_path / "watch.py").write_text(WATCH["rospy"])
    (tmp_path / "model.yaml").write_text(MODEL.format(language="rospy", sensor="ahaed"))
    with pytest.raises(ModelError, match=r"model\.yaml:\d+.*ahaed.*did you mean 'ahead'"):
        simulate(tmp_path / "model.yaml", Options(out=None))


PICTURES = """
import rospy
from sensor_msgs.msg import CameraInfo, Image
def hear(message):
    late = rospy.Time.now() - message.header.stamp
    rospy.loginfo("%s %d %d", message.header.frame_id, len(message.data), late.to_nsec() // 10**6)
if __name__ == "__main__":
    rospy.init_node("watch")
    rospy.Subscriber("/rover_1/camera/image_raw", Image, hear)
    known = lambda info: rospy.loginfo("K %.1f", info.K[0])
    rospy.Subscriber("/rover_1/camera/camera_info", CameraInfo, known)
    rospy.spin()
"""


UNHEARD = """
import rospy
if __name__ == "__main__":
    rospy.init_node("watch")
    rospy.sleep(1.5)
"""


@pytest.mark.parametrize(("record", "published"), [("trace", 0), ("/rover_1/camera/image_raw", 21)])
def test_a_picture_that_nobody_hears_is_published_only_for_a_record(record, published, tmp_path):
    (tmp_path / "watch.py").write_text(UNHEARD)
    camera = "[{camera: {width: 64, height: 48, field: 90 deg}}]"
    (tmp_path / "model.yaml").write_text(MODEL.format(language="rospy", sensor=camera))
    run = simulate(tmp_path / "model.yaml", Options(out=tmp_path / "run", record=record))
    events = read(run.folder / "trace.mcap").events
    sent = [one for one in events if isinstance(one, Published) and one.topic == "/rover_1/camera/image_raw"]
    assert len(sent) == published


def test_pictures_come_late_and_are_stamped_with_their_exposure(tmp_path):
    (tmp_path / "watch.py").write_text(PICTURES)
    camera = "[{camera: {width: 64, height: 48, field: 90 deg, latency: 40 ms}}]"
    (tmp_path / "model.yaml").write_text(MODEL.format(language="rospy", sensor=camera))
    log = LogOptions(tmp_path / "log.txt")
    assert simulate(tmp_path / "model.yaml", Options(log=log)).ok
    heard = [
        line.split("watch: ")[1]
        for line in (tmp_path / "log.txt").read_text().splitlines()
        if "watch: " in line
    ]
    assert "K 32.0" in heard
    frame, size, late = next(one for one in heard if not one.startswith("K")).split()
    assert (frame, int(size)) == ("camera_optical_frame", 64 * 48)
    assert 40 <= int(late) < 45
    assert 15 <= sum(not one.startswith("K") for one in heard) <= 20


MAPPING = {
    "rospy": """
import rospy, tf2_ros
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
def scan(message):
    ranges = message.ranges
    rospy.loginfo("scan %s %d %.2f %s", message.header.frame_id, len(ranges), ranges[180], ranges[0])
    if transforms.can_transform("odom", message.header.frame_id, rospy.Time(0)):
        found = transforms.lookup_transform("odom", message.header.frame_id, rospy.Time(0)).transform
        rospy.loginfo("tf %.2f %.2f", found.translation.x, found.translation.z)
def moved(message):
    place = message.pose.pose.position
    rospy.loginfo("odom %s %s %.2f", message.header.frame_id, message.child_frame_id, place.x)
if __name__ == "__main__":
    rospy.init_node("watch")
    transforms = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(transforms)
    rospy.Subscriber("/rover_1/scan", LaserScan, scan)
    rospy.Subscriber("/rover_1/odom", Odometry, moved)
    rospy.spin()
""",
    "rclpy": """
import rclpy, tf2_ros
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
def scan(message):
    ranges, frame = message.ranges, message.header.frame_id
    node.get_logger().info(f"scan {frame} {len(ranges)} {ranges[180]:.2f} {ranges[0]}")
    if transforms.can_transform("odom", frame, rclpy.time.Time()):
        found = transforms.lookup_transform("odom", frame, rclpy.time.Time()).transform.translation
        node.get_logger().info(f"tf {found.x:.2f} {found.z:.2f}")
def moved(message):
    place = message.pose.pose.position
    node.get_logger().info(f"odom {message.header.frame_id} {message.child_frame_id} {place.x:.2f}")
if __name__ == "__main__":
    rclpy.init()
    node = rclpy.create_node("watch")
    transforms = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(transforms, node)
    node.create_subscription(LaserScan, "/rover_1/scan", scan, 10)
    node.create_subscription(Odometry, "/rover_1/odom", moved, 10)
    rclpy.spin(node)
""",
}
LIDAR = "[{lidar: {beams: 360, range: 30 m, noise: 0 m, at: [0.5, 0, 0.5]}}, {odometry: {drift: 0 deg/min}}]"


@pytest.mark.parametrize("language", ["rospy", "rclpy"])
def test_a_component_reads_scan_odometry_and_transforms(language, tmp_path):
    (tmp_path / "watch.py").write_text(MAPPING[language])
    (tmp_path / "model.yaml").write_text(MODEL.format(language=language, sensor=LIDAR))
    run = simulate(tmp_path / "model.yaml", Options(out=None, log=LogOptions(tmp_path / "log.txt")))
    assert run.ok, run.record.outcome
    lines = (tmp_path / "log.txt").read_text().splitlines()
    heard = [line.split("watch: ")[1].split() for line in lines if "watch: " in line]
    scans, moves, transforms = (
        [one[1:] for one in heard if one[0] == kind] for kind in ("scan", "odom", "tf")
    )
    assert len(scans) == pytest.approx(19, abs=2)
    assert {tuple(one) for one in scans} == {("lidar", "360", "19.48", "inf")}  # the tank, 0.5 m nearer
    assert len(moves) == pytest.approx(99, abs=3)
    assert {tuple(one) for one in moves} == {("odom", "base_link", "0.00")}
    assert len(transforms) > 15
    assert {one[0] for one in transforms} == {"0.50"}


ALL = """
import rospy
from sensor_msgs.msg import CameraInfo, Image, Imu, PointCloud2, Range
def hear(message, topic):
    size = len(message.data) if hasattr(message, "data") else 0
    rospy.loginfo("%s %s %d", topic, message.header.frame_id, size)
if __name__ == "__main__":
    rospy.init_node("watch")
    kinds = {"points": PointCloud2, "depth/image_rect": Image, "depth/camera_info": CameraInfo,
             "range": Range, "front/sonar": Range, "imu_external": Imu}
    for topic, kind in kinds.items():
        rospy.Subscriber("/rover_1/" + topic, kind, hear, topic)
    rospy.spin()
"""


def test_a_component_reads_clouds_depths_ranges_and_rates(tmp_path):
    (tmp_path / "watch.py").write_text(ALL)
    sensors = "[lidar3d, depth_camera, range_finder, {sonar: {name: front}}, imu_external]"
    (tmp_path / "model.yaml").write_text(MODEL.format(language="rospy", sensor=sensors))
    run = simulate(
        tmp_path / "model.yaml", Options(out=tmp_path / "run", log=LogOptions(tmp_path / "log.txt"))
    )
    assert run.ok, run.record.outcome
    lines = (tmp_path / "log.txt").read_text().splitlines()
    heard = {tuple(line.split("watch: ")[1].split()) for line in lines if "watch: " in line}
    assert heard == {
        ("points", "lidar3d", str(16 * 900 * 16)),
        ("depth/image_rect", "depth_camera_optical_frame", str(4 * 160 * 120)),
        ("depth/camera_info", "depth_camera_optical_frame", "0"),
        ("range", "range_finder", "0"),
        ("front/sonar", "front", "0"),
        ("imu_external", "imu_external", "0"),
    }
    events = read(tmp_path / "run" / "trace.mcap").events
    omitted = {one.topic for one in events if isinstance(one, Omitted)}
    assert omitted == {"/rover_1/points", "/rover_1/depth/image_rect"}


ESTIMATE = """
import rospy
from nav_msgs.msg import Odometry
def hear(message):
    place, sigmas = message.pose.pose.position, message.pose.covariance
    rospy.loginfo("%.1f %.1f %s %s", place.x, place.y, 0 < sigmas[0] == sigmas[7] < 1, sigmas[14] > 0)
if __name__ == "__main__":
    rospy.init_node("watch")
    rospy.Subscriber("/rover_1/odom", Odometry, hear)
    rospy.spin()
"""


def test_the_estimate_of_the_autopilot_is_about_the_origin_of_the_model(tmp_path):
    (tmp_path / "watch.py").write_text(ESTIMATE)
    text = MODEL.format(language="rospy", sensor="odometry, sensors: rtk")
    text = text.replace("here: {east: 0 m, north: 0 m}", "here: {east: 40 m, north: -30 m}")
    (tmp_path / "model.yaml").write_text(text)
    run = simulate(tmp_path / "model.yaml", Options(out=None, log=LogOptions(tmp_path / "log.txt")))
    assert run.ok, run.record.outcome
    lines = (tmp_path / "log.txt").read_text().splitlines()
    heard = {tuple(line.split("watch: ")[1].split()) for line in lines if "watch: " in line}
    assert heard == {("40.0", "-30.0", "True", "True")}


TREE = """
import rospy
from tf2_msgs.msg import TFMessage
def hear(message):
    for one in message.transforms:
        rospy.loginfo("%s %s", one.header.frame_id, one.child_frame_id)
if __name__ == "__main__":
    rospy.init_node("watch")
    rospy.Subscriber("/tf", TFMessage, hear)
    rospy.Subscriber("/tf_static", TFMessage, hear)
    rospy.spin()
"""


@pytest.mark.parametrize("allocated", [True, False])
def test_each_frame_has_one_parent(allocated, tmp_path):
    (tmp_path / "watch.py").write_text(TREE)
    text = MODEL.format(language="rospy", sensor="[lidar, odometry]")
    rover = next(line for line in text.splitlines() if "rover_1: {kind" in line)
    text = text.replace(
        rover, f"{rover}\n{rover.replace('rover_1', 'rover_2').replace('at: here', 'at: there')}"
    )
    text = text.replace(
        "north: 0 m}}\n  buildings", "north: 0 m}, there: {east: 0 m, north: 5 m}}\n  buildings"
    )
    if not allocated:
        text = text.replace(", rover_1: onboard", "")
    (tmp_path / "model.yaml").write_text(text)
    run = simulate(tmp_path / "model.yaml", Options(out=None, log=LogOptions(tmp_path / "log.txt")))
    assert run.ok, run.record.outcome
    lines = (tmp_path / "log.txt").read_text().splitlines()
    links = {tuple(line.split("watch: ")[1].split()) for line in lines if "watch: " in line}
    for rover in ("rover_1", "rover_2"):
        assert (f"{rover}/odom", f"{rover}/base_link") in links
        assert (f"{rover}/base_link", f"{rover}/lidar") in links
    assert len({child for _, child in links}) == len(links)


def test_the_same_seed_gives_the_same_scans_byte_for_byte(tmp_path):
    (tmp_path / "watch.py").write_text(WATCH["rospy"])
    sensor = "[{lidar: {lost: 5 %}}, {odometry: {drift: 2 deg/min, scale: 3 %}}, depth_camera]"
    (tmp_path / "model.yaml").write_text(MODEL.format(language="rospy", sensor=sensor))
    traces = []
    for seed in (1, 1, 2):
        options = Options(out=tmp_path / "run", seed=seed, record="/rover_1/depth/image_rect")
        assert simulate(tmp_path / "model.yaml", options).ok
        traces.append((tmp_path / "run" / "trace.mcap").read_bytes())
    assert traces[0] == traces[1]
    assert traces[0] != traces[2]
