"""`volery map`: a map of a recording, in each format, and what is said of recordings that are none."""

import json
from itertools import pairwise

import numpy as np
import pytest
from typer.testing import CliRunner

from rigs.floor_plans import OFFICE, odometry, ranges, tour
from rigs.scanning_robot import MOUNTING, odometry_message, scan_message, transform
from volery.autonomy.planar_pose import Pose2
from volery.cli.main import application
from volery.ros.messages import new
from volery.ros.messages.bags import create_bag

WAY = tour([(2.0, 2.0), (10.5, 2.5), (10.5, 12.0)], 0.4)


def mapped(*options):
    return CliRunner().invoke(application(), ["map", *map(str, options)])


def table(tmp_path):
    forward = np.radians(np.arange(-90.0, 90.0))
    rows = [
        ",".join(map(str, (number, *moved, *np.minimum(ranges(OFFICE, true, forward, 30.0), 81.0).round(2))))
        for number, (moved, true) in enumerate(zip(odometry(WAY, 1), WAY, strict=True))
    ]
    (tmp_path / "scans.csv").write_text("\n".join(rows))
    return tmp_path / "scans.csv"


def bag(tmp_path, name, source):
    with create_bag(tmp_path / name) as writer:
        for number, (moved, true) in enumerate(zip(odometry(WAY, 2), WAY, strict=True)):
            time = (number + 1) * 10**8
            if source == "odometry":
                writer.write("/odom", time, odometry_message(time, moved))
            elif source == "tf":
                writer.write("/tf", time, transform(time, "odom", "base_link", moved))
            writer.write("/tf", time, transform(time, "base_link", "lidar", MOUNTING))
            writer.write("/scan", time, scan_message(time, true.after(MOUNTING)))
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


@pytest.mark.parametrize("name", ["", "..", "folder", "file/map", "nowhere/map"])
def test_a_name_that_cannot_be_written_is_refused_before_the_map_is_made(tmp_path, monkeypatch, name):
    (tmp_path / "folder.pgm").mkdir()
    (tmp_path / "file").touch()
    monkeypatch.chdir(tmp_path)
    result = mapped("no_recording", "--out", name)
    assert result.exit_code == 2
    assert "--out" in result.output


def test_odometry_that_is_no_number_is_left_out(tmp_path):
    with create_bag(tmp_path / "wrong") as writer:
        for number, true in enumerate(WAY[:3]):
            time = (number + 1) * 10**8
            writer.write("/odom", time, odometry_message(time, Pose2(float("nan"), 0.0, 0.0)))
            writer.write("/scan", time, scan_message(time, true.after(MOUNTING)))
    result = mapped(tmp_path / "wrong", "--out", tmp_path / "floor")
    assert result.exit_code == 3, result.output
    assert "3 poses of /odom that are none are left out" in result.output


def test_odometry_that_jumps_out_of_the_country_says_so(tmp_path):
    beams = ",".join(map(str, ranges(OFFICE, WAY[0], np.radians(np.arange(-90.0, 90.0)), 30.0).round(2)))
    (tmp_path / "far.csv").write_text("".join(f"{number},{number}e6,0,0,{beams}\n" for number in range(3)))
    result = mapped(tmp_path / "far.csv", "--out", tmp_path / "floor")
    assert result.exit_code == 2
    assert "look whether the odometry jumps" in result.output.replace("\n", " ")
    assert not (tmp_path / "floor.pgm").exists()


def test_pictures_that_cannot_be_used_are_named(tmp_path):
    with create_bag(tmp_path / "colours") as writer:
        writer.write("/odom", 1, odometry_message(1, Pose2()))
        writer.write("/image_raw", 1, new("sensor_msgs/msg/Image", encoding="yuv422", width=4, height=4))
        info = new("sensor_msgs/msg/CameraInfo", width=4, height=4, distortion_model="plumb_bob")
        info.k, info.d = [4.0, 0.0, 2.0, 0.0, 4.0, 2.0, 0.0, 0.0, 1.0], [0.0] * 5
        writer.write("/camera_info", 1, info)
    result = mapped(tmp_path / "colours", "--from", "camera", "--out", tmp_path / "floor")
    assert result.exit_code == 2
    assert "no scan of it can be used; 1 pictures are left out" in result.output
    assert "'yuv422'" in result.output
