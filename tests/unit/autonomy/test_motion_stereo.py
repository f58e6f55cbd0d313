"""One moving grey camera: what it is wrong about, what is refused, a map of a bag of its pictures."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigs.floor_plans import box, odometry, tour
from rigs.scanning_robot import odometry_message, stamp, transform
from volery.autonomy.camera_node import CameraNode
from volery.autonomy.depth_scan import AHEAD
from volery.autonomy.laser_logs import read_laser_log
from volery.autonomy.laser_scan import scan_of
from volery.autonomy.markers import CameraModel, Picture
from volery.autonomy.motion_stereo import OF_VIEWS, MotionStereo
from volery.autonomy.occupancy_grid import OccupancyGrid
from volery.autonomy.planar_pose import Array, Pose2
from volery.autonomy.slam import Slam
from volery.autonomy.slam_node import SlamNames, SlamNode
from volery.base.errors import UsageError
from volery.base.frames import Quaternion, body_to_world, euler_to_quaternion, multiply
from volery.base.time import MS
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.ros.client_libraries.tf2.transform_tree import RigidTransform, write_transform
from volery.ros.graph import LATCHED, EmbeddedGraph, Node
from volery.ros.messages import new
from volery.ros.messages.bags import create_bag
from volery.simulation.world.rasteriser import CameraView, Lens, Rasteriser
from volery.simulation.world.scene import Solid

LENS = Lens(320, 240, 160.0, (-0.1, 0.01, 0.0, 0.0, 0.0))  # a field of 90 degrees
CAMERA = CameraModel(
    np.array(((LENS.focal, 0.0, LENS.centre[0]), (0.0, LENS.focal, LENS.centre[1]), (0.0, 0.0, 1.0))),
    np.array(LENS.distortion),
)
MOUNTING = AHEAD._replace(translation=(0.1, 0.0, 0.05))
HEIGHT = 1.0  # [m] of the vehicle
STEP = 100 * MS

BLOCKS = ((3.0, 2.5, 6.0, 4.5), (0.0, 3.2, 0.5, 3.6), (8.5, 3.5, 9.0, 4.2))
WALLS = np.array([*box(0.0, 0.0, 9.0, 7.0), *(side for block in BLOCKS for side in box(*block))])
"""A room of 9 by 7 m with a block in the middle and two pillars (from east, north to east, north)."""
TRUTH = tour([(1.5, 1.2), (7.5, 1.2), (7.5, 5.8), (1.5, 5.8), (1.5, 1.2), (5.0, 1.2)], 0.1)
WHEELS = odometry(TRUTH, 3, slip=0.005)


def solids() -> list[Solid]:
    around = ((-0.2, -0.2, 9.2, 0.0), (-0.2, 7.0, 9.2, 7.2), (-0.2, 0.0, 0.0, 7.0), (9.0, 0.0, 9.2, 7.0))
    corners = (((w, s), (e, s), (e, n), (w, n)) for w, s, e, n in (*around, *BLOCKS))
    return [Solid("wall", one, 0.0, 3.0) for one in corners]


def attitude(number: int, yaw: float) -> Quaternion:
    """A drone that sways: its odometry knows."""
    return euler_to_quaternion(0.03 * np.sin(0.3 * number), 0.05 * np.sin(0.2 * number), yaw)


def drawn(rasteriser: Rasteriser, pose: Pose2, number: int) -> Picture:
    turn = attitude(number, pose.yaw)
    off = body_to_world(turn, MOUNTING.translation)
    whole = multiply(turn, MOUNTING.rotation)
    axes = [body_to_world(whole, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    at = pose.x + off[0], pose.y + off[1], HEIGHT + off[2]
    return rasteriser.draw(CameraView(at, np.array(axes).T), 0.0, k=number)


def moved(number: int) -> RigidTransform:
    x, y, yaw = WHEELS[number]
    return RigidTransform(attitude(number, yaw), (x, y, HEIGHT))


def odometry_of(time: int, number: int) -> Any:
    message, rigid = odometry_message(time, WHEELS[number]), moved(number)
    turn = message.pose.pose.orientation
    message.pose.pose.position.z = rigid.translation[2]
    turn.w, turn.x, turn.y, turn.z = rigid.rotation
    return message


def picture_message(time: int, picture: Picture) -> Any:
    height, width = picture.shape
    image = new("sensor_msgs/msg/Image", height=height, width=width, step=width, encoding="mono8")
    stamp(image.header, time, "optical")
    image.data = picture.reshape(-1)
    return image


def calibration() -> Any:
    info = new("sensor_msgs/msg/CameraInfo", height=240, width=320, distortion_model="plumb_bob")
    info.k, info.d = CAMERA.matrix.reshape(-1), CAMERA.distortion
    info.header.frame_id = "optical"
    return info


def off_the_walls(points: Array) -> Array:
    """The distance of points (n, 2) from the nearest wall [m]."""
    start, side = WALLS[:, :2], WALLS[:, 2:] - WALLS[:, :2]
    part = ((points[:, None] - start) * side).sum(axis=2) / (side * side).sum(axis=1)
    off = points[:, None] - (start + np.clip(part, 0.0, 1.0)[..., None] * side)
    distances: Array = np.sqrt((off * off).sum(axis=2).min(axis=1))
    return distances


def rms(poses: list[Pose2], numbers: list[int]) -> float:
    """The root of the mean square distance from the true places, both from the first one on [m]."""
    found = np.array([poses[0].to(pose)[:2] for pose in poses])
    true = np.array([TRUTH[numbers[0]].to(TRUTH[number])[:2] for number in numbers])
    return float(np.sqrt(((found - true) ** 2).sum(axis=1).mean()))


@pytest.fixture(scope="module")
def pictures() -> list[Picture]:
    """What a drone sees that goes once and a bit around the block and turns on the spot."""
    rasteriser = Rasteriser(LENS, solids(), noise=np.uint64(5))
    return [drawn(rasteriser, pose, number) for number, pose in enumerate(TRUTH)]


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory, pictures: list[Picture]) -> Path:
    folder = tmp_path_factory.mktemp("camera") / "bag"
    mounted = transform(0, "base_link", "optical", Pose2())
    write_transform(mounted.transforms[0].transform, MOUNTING)
    with create_bag(folder) as written:
        written.write("/tf_static", 0, mounted)
        for number, picture in enumerate(pictures):
            time = (number + 1) * STEP
            written.write("/camera/camera_info", time, calibration())
            written.write("/camera/image_raw", time, picture_message(time, picture))
            written.write("/odom", time, odometry_of(time, number))
    return folder


def test_a_map_of_one_moving_camera(bag: Path) -> None:
    log = read_laser_log(bag, of_camera=True)
    slam = Slam(log.settings)
    for step in log.steps:
        slam.add(step.odometry, step.scan)
    slam.finish()
    numbers = [round(kept.scan.time / STEP) - 1 for kept in slam.scans]
    start = TRUTH[numbers[0]].after(slam.poses[0].to(Pose2()))
    grid = OccupancyGrid()
    for kept, pose in zip(slam.scans, slam.poses, strict=True):
        grid.insert(start.after(pose), kept.scan)
    occupied = grid.centres(np.argwhere(grid.occupied))
    walls = np.vstack([np.linspace(wall[:2], wall[2:], 50) for wall in WALLS])
    near = np.sqrt(((walls[:, None] - occupied) ** 2).sum(axis=2)).min(axis=1) < 0.2
    assert rms(slam.poses, numbers) < 0.15  # 0.03 to 0.13 over six seeds
    assert rms([WHEELS[number] for number in numbers], numbers) > 0.5
    assert (off_the_walls(occupied) < 0.2).mean() > 0.9
    assert near.mean() > 0.6
    assert not slam.lost
    assert not log.damage
    assert log.odometry == "/odom, corrected by the pictures"


def test_odometry_that_says_nothing_new_and_pictures_that_show_nothing_give_no_points(
    pictures: list[Picture],
) -> None:
    for shown in (np.zeros_like(pictures[0]), pictures[0]):  # dark; frozen
        stereo = MotionStereo(CAMERA, MOUNTING)
        seen = [stereo.add(number * STEP, shown, moved(number)) for number in range(25)]
        assert sum(one is not None for one in seen) > 12, "the odometry moves"
        assert all(one is None or len(one.scan.points) == 0 for one in seen)
    stereo = MotionStereo(CAMERA, MOUNTING)
    for number, picture in enumerate(pictures[:25]):
        assert stereo.add(number * STEP, picture, moved(0)) is None, "a way of which nobody knows the length"


def test_a_turn_by_odometry_is_corrected_by_the_pictures(pictures: list[Picture]) -> None:
    turning = [number for number, (one, other) in enumerate(pairwise(TRUTH)) if one[:2] == other[:2]]
    first, last = turning[0], turning[0] + 10
    stereo = MotionStereo(CAMERA, MOUNTING)
    poses = []
    for number in range(first, last + 1):
        x, y, yaw = TRUTH[number]
        wrong = TRUTH[first].yaw + 1.1 * (yaw - TRUTH[first].yaw)
        odometry = RigidTransform(attitude(number, wrong), (x, y, HEIGHT))
        seen = stereo.add(number * STEP, pictures[number], odometry)
        poses += [] if seen is None else [seen.pose]
    turned = TRUTH[last].yaw - TRUTH[first].yaw
    assert abs(turned) > 1.4
    assert poses[-1].yaw - TRUTH[first].yaw == pytest.approx(turned, abs=0.02), "not 0.15 too much"


def test_a_picture_of_another_size_is_refused(pictures: list[Picture]) -> None:
    stereo = MotionStereo(CAMERA, MOUNTING)
    stereo.add(0, pictures[0], moved(0))
    with pytest.raises(UsageError, match="160 x 120 after 320 x 240"):
        stereo.add(STEP, np.ascontiguousarray(pictures[1][::2, ::2]), moved(1))


def write(path: Path, images: list[tuple[int, Any]], odometry: str = "") -> Path:
    """Write a bag of pictures; with poses of a type about them."""
    with create_bag(path) as written:
        written.write("/camera/camera_info", 0, calibration())
        for time, image in images:
            written.write("/camera/image_raw", time, image)
        for number in range(len(images)) if odometry else ():
            time, rigid = (number + 1) * STEP, moved(number)
            message = new(odometry)
            stamp(message.header, time, "odom")
            pose = message.pose.pose if odometry.endswith("Odometry") else message.pose
            place, turn = pose.position, pose.orientation
            place.x, place.y, place.z = rigid.translation
            turn.w, turn.x, turn.y, turn.z = rigid.rotation
            written.write("/pose", time, message)
    return path


def test_poses_of_any_source_are_taken_by_name(tmp_path: Path, pictures: list[Picture]) -> None:
    images = [
        ((number + 1) * STEP, picture_message((number + 1) * STEP, pictures[number])) for number in range(30)
    ]
    found = []
    for kind in ("nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped"):
        path = write(tmp_path / kind.rpartition("/")[2], images, kind)
        found.append(list(read_laser_log(path, odometry="pose", of_camera=True).steps))
    one, other = found
    assert len(one) > 15
    assert [step.odometry for step in one] == [step.odometry for step in other]
    with pytest.raises(UsageError, match="no odometry, without which pictures of one camera have no scale"):
        read_laser_log(path, of_camera=True)


def test_pictures_that_do_not_fit_are_left_out_and_counted(tmp_path: Path, pictures: list[Picture]) -> None:
    images = [
        ((number + 1) * STEP, picture_message((number + 1) * STEP, pictures[number])) for number in range(6)
    ]
    images[2][1].encoding = "bayer_rggb8"
    images[3] = images[3][0], picture_message(images[3][0], np.ascontiguousarray(pictures[3][::2, ::2]))
    images[4] = images[4][0], picture_message(STEP, pictures[4])
    log = read_laser_log(write(tmp_path / "bag", images, "nav_msgs/msg/Odometry"), of_camera=True)
    assert len(list(log.steps)) == 2
    (words,) = log.damage
    assert words.startswith("3 pictures are left out, such as a picture of encoding 'bayer_rggb8'")


def fly(node: Node, pictures: list[Picture], problem: str) -> None:
    """Publish what a drone sees and reckons, but for what is missing."""
    static = node.advertise("/tf_static", "tf2_msgs/msg/TFMessage", LATCHED)
    infos = node.advertise("camera/camera_info", "sensor_msgs/msg/CameraInfo")
    images = node.advertise("camera/image_raw", "sensor_msgs/msg/Image")
    moves = node.advertise("odom", "nav_msgs/msg/Odometry")
    mounted = transform(0, "base_link", "optical", Pose2())
    write_transform(mounted.transforms[0].transform, MOUNTING)
    if problem != "no transform":
        static.publish(mounted)
    for number, picture in enumerate(pictures):
        node.sleep(STEP)
        time = node.now()
        if problem != "no calibration":
            infos.publish(calibration())
        images.publish(picture_message(time, picture))
        if problem != "no odometry":
            moves.publish(odometry_of(time, number))
    node.sleep(20 * STEP)  # until a map is published


@pytest.mark.parametrize("problem", ["", "no calibration", "no transform", "no odometry"])
def test_the_node_gives_the_poses_and_scans_of_the_recording(problem: str, pictures: list[Picture]) -> None:
    kernel, said = VirtualKernel(lambda event: None), []
    graph, count = EmbeddedGraph(kernel), 40
    maps: list[SlamNode] = []
    taken: dict[str, list[Any]] = {"scan": [], "visual_odom": []}

    def camera() -> None:
        node = graph.node("camera")
        CameraNode(node, "camera/image_raw", say=said.append)
        node.subscribe("scan", "sensor_msgs/msg/LaserScan", taken["scan"].append)
        node.subscribe("visual_odom", "nav_msgs/msg/Odometry", taken["visual_odom"].append)
        node.spin()

    def slam() -> None:
        node = graph.node("slam")
        maps.append(SlamNode(node, SlamNames(odometry="visual_odom"), settings=OF_VIEWS))
        node.spin()

    kernel.spawn(camera, "camera", ExecutionContext("camera"))
    kernel.spawn(slam, "slam", ExecutionContext("slam"))
    kernel.spawn(
        lambda: fly(graph.node("drone"), pictures[:count], problem), "drone", ExecutionContext("drone")
    )
    kernel.run((count + 15) * STEP)
    if problem:
        assert not taken["scan"]
        (words,) = said
        assert words.startswith(problem)
        return
    assert not said
    stereo = MotionStereo(CAMERA, MOUNTING)
    times = [(number + 1) * STEP for number in range(count)]
    seen = [stereo.add(time, pictures[number], moved(number)) for number, time in enumerate(times)]
    wanted = [one for one in seen if one is not None]
    assert len(wanted) > 20
    for one, corrected, scan in zip(wanted, taken["visual_odom"], taken["scan"], strict=True):
        assert corrected.header.frame_id == "visual_odom"
        assert corrected.pose.pose.position.x == pytest.approx(one.pose.x)
        found = scan_of(scan)
        assert found.time == one.scan.time
        assert found.points == pytest.approx(one.scan.points, abs=1e-5)
        assert not len(found.open_ends)
    assert len(wanted[-1].scan.points) > 30
    (mapped,) = maps
    assert mapped.pose is not None
    assert TRUTH[0].to(mapped.pose)[:2] == pytest.approx(TRUTH[0].to(TRUTH[count - 1])[:2], abs=0.15)
    assert mapped.grid.occupied.sum() > 30
