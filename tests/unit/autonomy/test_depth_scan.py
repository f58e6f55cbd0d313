"""Depth pictures become scans: their geometry, what is refused, a map of a bag of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigs.floor_plans import OFFICE, odometry, ranges, tour
from rigs.scanning_robot import odometry_message, stamp, transform
from volery.autonomy.depth_scan import AHEAD, depth_scan, depth_view
from volery.autonomy.laser_logs import read_laser_log
from volery.autonomy.planar_pose import Array, Pose2
from volery.autonomy.slam import OF_CAMERA, Slam
from volery.base.errors import UsageError
from volery.base.frames import multiply
from volery.base.time import MS
from volery.ros.client_libraries.tf2.transform_tree import RigidTransform, write_transform
from volery.ros.messages import new
from volery.ros.messages.bags import create_bag

WIDTH, HEIGHT = 120, 9
FOCAL = 0.5 * (WIDTH - 1)  # a field of 90 degrees
RIGHT = (np.arange(WIDTH) - 0.5 * (WIDTH - 1)) / FOCAL
PLACE = Pose2(0.2, 0.05, 0.3)
"""Where the camera is on the robot."""


def calibration() -> Any:
    info = new("sensor_msgs/msg/CameraInfo", height=HEIGHT, width=WIDTH)
    info.k = [FOCAL, 0.0, 0.5 * (WIDTH - 1), 0.0, FOCAL, 0.5 * (HEIGHT - 1), 0.0, 0.0, 1.0]
    info.header.frame_id = "optical"
    return info


def picture(depths: Array, encoding: str = "32FC1", time: int = 0) -> Any:
    message = new("sensor_msgs/msg/Image", height=HEIGHT, width=WIDTH, encoding=encoding)
    stamp(message.header, time, "optical")
    values = depths.astype("<f4") if encoding == "32FC1" else np.round(1000.0 * depths).astype("<u2")
    message.step, message.data = WIDTH * values.itemsize, values.ravel().view(np.uint8)
    return message


def seen(pose: Pose2, seed: int = 0, sigma: float = 0.0) -> Array:
    """The depths of upright walls: the same in each row of a camera that looks level."""
    angles = -np.arctan(RIGHT)
    depths = ranges(OFFICE, pose, angles) * np.cos(angles)
    return depths + np.random.default_rng(seed).normal(0.0, sigma, (HEIGHT, WIDTH))


@pytest.mark.parametrize("encoding", ["32FC1", "16UC1"])
def test_the_points_of_a_picture_are_on_the_walls(encoding: str) -> None:
    pose = Pose2(2.0, 2.0, 0.3)
    depths = np.where(np.isfinite(seen(pose)), seen(pose), np.inf if encoding == "32FC1" else 0.0)
    scan = depth_scan(picture(depths, encoding), depth_view(calibration()))
    angles = np.arctan2(scan.points[:, 1], scan.points[:, 0])
    assert len(scan.points) == int(np.isfinite(seen(pose)[0]).sum())
    assert (np.diff(angles) > 0.0).all()
    assert np.hypot(*scan.points.T) == pytest.approx(ranges(OFFICE, pose, angles), abs=0.01)


def test_a_tilted_camera_takes_the_rows_that_are_level() -> None:
    down = np.radians(3.0)
    pitched = multiply((np.cos(0.5 * down), 0.0, np.sin(0.5 * down), 0.0), AHEAD.rotation)
    view = depth_view(calibration(), RigidTransform(pitched, (0.0, 0.0, 1.0)))
    assert view.rows[0, WIDTH // 2] == round(0.5 * (HEIGHT - 1) - FOCAL * np.tan(down))
    scan = depth_scan(picture(np.full((HEIGHT, WIDTH), 2.0)), view)
    assert scan.points[WIDTH // 2] == pytest.approx((2.0, 0.0), abs=0.05)


def test_a_hole_in_one_row_does_not_hide_a_wall_and_no_depth_says_nothing() -> None:
    depths = np.full((HEIGHT, WIDTH), 3.0)
    depths[4, 10] = np.nan
    depths[:, 20], depths[:, 21], depths[:, 22] = np.nan, np.inf, -np.inf
    scan = depth_scan(picture(depths), depth_view(calibration()))
    assert len(scan.points) == WIDTH - 3
    assert len(scan.open_ends) == 0


def test_what_is_no_depth_is_refused() -> None:
    view = depth_view(calibration())
    grey = picture(np.ones((HEIGHT, WIDTH)))
    grey.encoding = "mono8"
    cut = picture(np.ones((HEIGHT, WIDTH)))
    cut.data = cut.data[:-1]
    other = picture(np.ones((HEIGHT, WIDTH)))
    other.width -= 1
    for message, words in ((grey, "mono8"), (cut, "cut off"), (other, "119 x 9 with a calibration")):
        with pytest.raises(UsageError, match=words):
            depth_scan(message, view)
    with pytest.raises(UsageError, match="focal"):
        depth_view(new("sensor_msgs/msg/CameraInfo"))
    with pytest.raises(UsageError, match="level"):
        depth_view(calibration(), RigidTransform((0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 0.0)))


TRUTH = tour([(2.0, 2.0), (10.5, 2.5), (10.5, 12.0), (2.0, 12.0), (2.0, 2.0), (10.5, 2.5)], 0.25)
WHEELS = odometry(TRUTH, 3)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of a robot whose camera looks ahead and to the left, with 1 cm of noise a pixel."""
    folder = tmp_path_factory.mktemp("camera") / "bag"
    link = transform(0, "base_link", "camera", PLACE)
    optical = transform(0, "camera", "optical", Pose2())
    write_transform(optical.transforms[0].transform, AHEAD)
    with create_bag(folder) as written:
        written.write("/tf_static", 0, link)
        written.write("/tf_static", 0, optical)
        written.write("/camera/color/image_raw", 0, new("sensor_msgs/msg/Image", encoding="rgb8"))
        for number, (true, wheels) in enumerate(zip(TRUTH, WHEELS, strict=True)):
            time = (number + 1) * 200 * MS
            depths = seen(true.after(PLACE), number, 0.01)
            written.write("/camera/depth/camera_info", time, calibration())
            written.write("/camera/depth/image_rect", time, picture(depths, time=time))
            written.write("/odom", time, odometry_message(time, wheels))
    return folder


def test_a_map_of_a_depth_camera(bag: Path) -> None:
    log = read_laser_log(bag, of_camera=True)
    slam = Slam(OF_CAMERA)
    for step in log.steps:
        slam.add(step.odometry, step.scan)
    slam.finish()
    passed = [round(kept.scan.time / (200 * MS)) - 1 for kept in slam.scans]
    places = np.array([slam.poses[0].to(pose)[:2] for pose in slam.poses])
    reckoned = np.array([WHEELS[0].to(WHEELS[number])[:2] for number in passed])
    true = np.array([TRUTH[0].to(TRUTH[number])[:2] for number in passed])
    rms, drift = (float(np.sqrt(((one - true) ** 2).sum(axis=1).mean())) for one in (places, reckoned))
    assert rms < 0.03  # 0.31 where scans of a single wall slide along it
    assert drift > 0.5
    assert not log.damage


def test_a_bag_of_pictures_is_refused_with_the_remedy(bag: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--from camera takes pictures"):
        read_laser_log(bag)
    with create_bag(tmp_path / "bare") as written:
        written.write("/depth/image_rect", 0, picture(np.ones((HEIGHT, WIDTH))))
    with pytest.raises(UsageError, match="record /depth/camera_info"):
        read_laser_log(tmp_path / "bare", of_camera=True)
    table = tmp_path / "scans.csv"
    table.write_text("0\n")
    with pytest.raises(UsageError, match="is no bag"):
        read_laser_log(table, of_camera=True)
