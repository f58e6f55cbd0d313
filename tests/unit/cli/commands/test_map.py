"""`volery map`: a map of a recording, in each format, and what is said of recordings that are none."""

import json
from itertools import pairwise

import numpy as np
import pytest
from typer.testing import CliRunner

from rigs.floor_plans import ANGLES, OFFICE, odometry, ranges, tour
from volery.autonomy.planar_pose import Pose2
from volery.base.frames import euler_to_quaternion
from volery.cli.main import application
from volery.ros.messages import new
from volery.ros.messages.bags import create_bag

WAY = tour([(2.0, 2.0), (10.5, 2.5), (10.5, 12.0)], 0.4)


def mapped(*options):
    return CliRunner().invoke(application(), ["map", *map(str, options)])


def stamp(header, time, frame):
    header.stamp.sec, header.stamp.nanosec, header.frame_id = time // 10**9, time % 10**9, frame


def turned(pose):
    return dict(zip("wxyz", euler_to_quaternion(0.0, 0.0, pose.yaw), strict=True))


def scan_message(time, pose):
    message = new("sensor_msgs/msg/LaserScan")
    stamp(message.header, time, "lidar")
    message.angle_min, message.angle_increment = float(ANGLES[0]), float(ANGLES[1] - ANGLES[0])
    message.range_min, message.range_max = 0.05, 10.0
    message.ranges = ranges(OFFICE, pose).tolist()
    return message


def odometry_message(time, pose):
    message = new("nav_msgs/msg/Odometry")
    stamp(message.header, time, "odom")
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    place.x, place.y = pose.x, pose.y
    for axis, value in turned(pose).items():
        setattr(turn, axis, value)
    return message


def transform(time, parent, child, pose):
    message, moved = new("tf2_msgs/msg/TFMessage"), new("geometry_msgs/msg/TransformStamped")
    stamp(moved.header, time, parent)
    moved.child_frame_id = child
    moved.transform.translation.x, moved.transform.translation.y = pose.x, pose.y
    for axis, value in turned(pose).items():
        setattr(moved.transform.rotation, axis, value)
    message.transforms = [moved]
    return message


def table(tmp_path):
    forward = np.radians(np.arange(-90.0, 90.0))
    rows = [
        ",".join(map(str, (number, *moved, *np.minimum(ranges(OFFICE, true, forward, 30.0), 81.0).round(2))))
        for number, (moved, true) in enumerate(zip(odometry(WAY, 1), WAY, strict=True))
    ]
    (tmp_path / "scans.csv").write_text("\n".join(rows))
    return tmp_path / "scans.csv"


def bag(tmp_path, name, source):
    mounting = Pose2(0.1, 0.0, 0.2)
    with create_bag(tmp_path / name) as writer:
        for number, (moved, true) in enumerate(zip(odometry(WAY, 2), WAY, strict=True)):
            time = (number + 1) * 10**8
            if source == "odometry":
                writer.write("/odom", time, odometry_message(time, moved))
            elif source == "tf":
                writer.write("/tf", time, transform(time, "odom", "base_link", moved))
            writer.write("/tf", time, transform(time, "base_link", "lidar", mounting))
            writer.write("/scan", time, scan_message(time, true.after(mounting)))
    return tmp_path / name


def way_of(path):
    return np.loadtxt(path, delimiter=",")


def check(tmp_path, way):
    """The motions of the map's way are those of the truth."""
    found = [Pose2(*row) for row in way[:, 1:]]
    true = [WAY[0].to(pose) for pose in WAY]
    start = found[0]
    last = start.to(found[-1])
    assert (last.x, last.y) == pytest.approx((true[-1].x, true[-1].y), abs=0.06)
    assert (tmp_path / "floor.pgm").read_bytes().startswith(b"P5\n")


def test_a_table_becomes_a_map(tmp_path):
    result = mapped(table(tmp_path), "--out", tmp_path / "floor", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["scans"] == str(len(WAY))
    way = way_of(tmp_path / "floor.csv")
    assert all(before < after for before, after in pairwise(way[:, 0]))
    check(tmp_path, way)


@pytest.mark.parametrize("name", ["recording.bag", "recording"])
@pytest.mark.parametrize("source", ["odometry", "tf", ""])
def test_a_bag_becomes_a_map(tmp_path, name, source):
    result = mapped(bag(tmp_path, name, source), "--out", tmp_path / "floor", "--json")
    assert result.exit_code == 0, result.output
    words = {"odometry": "/odom", "tf": "the transform from odom", "": "none"}[source]
    assert json.loads(result.stdout)["odometry"] == words
    check(tmp_path, way_of(tmp_path / "floor.csv"))


def test_what_is_missing_is_named(tmp_path):
    made = bag(tmp_path, "recording", "odometry")
    assert (
        "no topic /laser of sensor_msgs/msg/LaserScan; there is /scan"
        in mapped(made, "--scan", "laser").output
    )
    assert "no folder" in mapped(made, "--out", tmp_path / "none" / "x").output
    assert "no such file" in mapped(tmp_path / "none.bag").output
    assert mapped(tmp_path / "none.bag").exit_code == 2
    assert "a resolution of 0.0 m" in mapped(made, "--resolution", 0).output


def test_a_log_whose_beams_meet_nothing_makes_no_map(tmp_path):
    file = tmp_path / "scans.csv"
    file.write_text("\n".join(",".join(map(str, (time, 0, 0, 0, *[81.0] * 180))) for time in range(5)))
    result = mapped(file, "--out", tmp_path / "floor")
    assert result.exit_code == 2
    assert "has met anything" in result.output
    assert not list(tmp_path.glob("floor*"))
