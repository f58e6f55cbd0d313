"""Measurement of the times of ``volery.autonomy`` by block of code and amount (``base.metered_work``).

Each block is executed on inputs of several sizes and timed; the part of the blocks inside it, which were
measured before it, is subtracted, and what is left is divided among its own amounts: non-negative least
squares of the relative residuals. What a block executes in numpy and in Python belongs to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.base.metered_work import metered
from volery.base.time import MS
from volery.calibration.least_time import least_time
from volery.calibration.picture_times import PICTURES, module_if_installed, picture

if TYPE_CHECKING:
    from volery.autonomy.markers import MarkerPose

Array = NDArray[np.float64]
WorkTimes = dict[str, dict[str, float]]
"""Times by block and amount, ns."""


class WorkSnippet(NamedTuple):
    """A block of code on one input."""

    block: str
    execute: Callable[[], object]


class Hall(NamedTuple):
    """A hall with pillars: half of its sides [m], and rows of pillars (west, south, east, north) [m]."""

    half: tuple[float, float]
    pillars: Sequence[tuple[float, float, float, float]]

    def ranges(self, x: float, y: float, yaw: float, beams: int) -> Array:
        """Return the distances [m] to what beams all around meet first, with 1 cm of noise."""
        angles = yaw + np.linspace(-np.pi, np.pi, beams, endpoint=False)
        away = np.stack((np.cos(angles), np.sin(angles)), axis=1)
        place = np.array((x, y))
        with np.errstate(divide="ignore", invalid="ignore"):
            walls = np.where(away > 0.0, self.half - place, -place - self.half) / away
            ranges = np.where(np.isfinite(walls), walls, np.inf).min(axis=1)
            for pillar in self.pillars:
                one, other = (pillar[:2] - place) / away, (pillar[2:] - place) / away
                enters, leaves = np.minimum(one, other).max(axis=1), np.maximum(one, other).min(axis=1)
                ranges = np.where((enters > 0.0) & (enters < leaves), np.minimum(ranges, enters), ranges)
        noisy: Array = ranges + np.random.default_rng(round(abs(1000.0 * (x + y)))).normal(0.0, 0.01, beams)
        return noisy

    def way(self, steps: int) -> list[tuple[float, float, float]]:
        """Return poses on rounds through the hall, of twenty metres and more."""
        turns = np.arange(steps) * 0.15 / min(self.half)
        wide, high = 0.6 * np.array(self.half)
        return [
            (float(wide * np.cos(turn)), float(high * np.sin(turn)), float(turn + np.pi / 2))
            for turn in turns
        ]


HALLS = (
    Hall((5.0, 4.0), ((-0.5, -0.5, 0.5, 0.5), (-4.0, 2.0, -3.5, 3.0))),
    Hall(
        (14.0, 9.0),
        ((-3.0, -1.0, -1.0, 3.0), (2.0, -4.0, 6.0, -2.0), (4.0, 1.0, 5.0, 4.0), (-12.0, 2.0, -9.0, 6.0)),
    ),
)


def work_snippets() -> Iterator[WorkSnippet]:
    """Yield the blocks on their inputs; a block comes after those inside it."""
    yield from _of_poses()
    yield from _of_scans()
    yield from _of_graphs()
    yield from _of_grids()
    yield from _of_ways()
    yield from _of_drives()
    yield from _of_markers()


def _of_poses() -> Iterator[WorkSnippet]:
    from volery.autonomy.planar_pose import Pose2  # noqa: PLC0415  # scipy and OpenCV are extras of them

    pose = Pose2(1.0, 2.0, 0.3)
    yield WorkSnippet("motion", partial(pose.to, pose))
    yield WorkSnippet("motion", partial(pose.after, pose))
    for count in (1, 60, 400, 4000):
        points = np.ones((count, 2))
        yield WorkSnippet("turned", partial(pose.of, points))


def _of_scans() -> Iterator[WorkSnippet]:
    from volery.autonomy.laser_scan import scan_from_ranges  # noqa: PLC0415
    from volery.autonomy.planar_pose import Pose2  # noqa: PLC0415
    from volery.autonomy.scan_matching import LocalMap, normals_of  # noqa: PLC0415

    for hall in HALLS:
        for beams in (60, 180, 360, 1080):
            angles, at = np.linspace(-np.pi, np.pi, beams, endpoint=False), hall.way(9)
            ranges = [hall.ranges(*pose, beams) for pose in at]
            yield WorkSnippet("scan", partial(scan_from_ranges, 0, angles, ranges[0], 0.1, 12.0))
            scans = [scan_from_ranges(0, angles, one, 0.1, 12.0).points for one in ranges]
            yield WorkSnippet("normals", partial(normals_of, scans[0]))
        for beams, count in ((60, 3), (180, 8), (360, 4), (360, 12), (1080, 8)):
            angles = np.linspace(-np.pi, np.pi, beams, endpoint=False)
            poses = [Pose2(*one) for one in hall.way(count)]
            scans = [
                scan_from_ranges(0, angles, hall.ranges(*pose, beams), 0.1, 12.0).points for pose in poses
            ]
            points = np.vstack([pose.of(scan) for pose, scan in zip(poses, scans, strict=True)])
            normals = np.vstack(
                [Pose2(yaw=pose.yaw).of(normals_of(scan)) for pose, scan in zip(poses, scans, strict=True)]
            )
            yield WorkSnippet("local_map", partial(LocalMap, points, normals))
            local = LocalMap(points, normals)
            off = Pose2(poses[-1].x + 0.1, poses[-1].y - 0.07, poses[-1].yaw + 0.03)
            local.search(scans[-1], off, 0.05, 0.01)  # the field is made now, and no part of what follows
            for reach, turn in ((0.06, 0.02), (0.2, 0.1), (1.0, 0.5), (3.0, 0.5)):
                yield WorkSnippet("search", partial(local.search, scans[-1], off, reach, turn))
                yield WorkSnippet("search", partial(local.search, scans[-1], off, reach, turn, 0.6))
            yield WorkSnippet("field", partial(_fresh_field, points, normals, scans[0][:4]))
            for scale in (0.6, 1.0):
                sigmas = np.array((0.1, 0.1, 0.05))
                yield WorkSnippet("align", partial(local.align, scans[-1], off, sigmas, scale))


def _fresh_field(points: Array, normals: Array, few: Array) -> None:
    """Make a map and its field of likelihood, which the first search makes."""
    from volery.autonomy.planar_pose import Pose2  # noqa: PLC0415
    from volery.autonomy.scan_matching import LocalMap  # noqa: PLC0415

    LocalMap(points, normals).search(few, Pose2(), 0.05, 0.01)


def _of_graphs() -> Iterator[WorkSnippet]:
    from volery.autonomy.planar_pose import Pose2  # noqa: PLC0415
    from volery.autonomy.pose_graph import Edge, optimise  # noqa: PLC0415

    random, information = np.random.default_rng(4), np.diag((900.0, 900.0, 4000.0))
    for count, apart in ((10, 40), (40, 20), (120, 20), (120, 7), (400, 40), (400, 9)):
        step, poses = Pose2(0.3, 0.0, 2.0 * np.pi / apart), [Pose2()]
        for _ in range(count - 1):
            poses.append(poses[-1].after(step))
        edges = [Edge(one, one + 1, step, information, True) for one in range(count - 1)]
        edges += [Edge(one, one + apart, Pose2(), information) for one in range(0, count - apart, 2)]
        rough = [Pose2(*(np.array(pose) + random.normal(0.0, 0.03, 3))) for pose in poses]
        yield WorkSnippet("pose_graph", partial(optimise, rough, edges))


def _of_grids() -> Iterator[WorkSnippet]:
    from volery.autonomy.laser_scan import scan_from_ranges  # noqa: PLC0415
    from volery.autonomy.occupancy_grid import OccupancyGrid  # noqa: PLC0415
    from volery.autonomy.planar_pose import Pose2  # noqa: PLC0415
    from volery.ros.messages import new  # noqa: PLC0415

    for side in (0.05, 0.1, 0.2):
        for hall in HALLS:
            grid = OccupancyGrid(side)
            for beams in (90, 360, 1080):
                angles, at = np.linspace(-np.pi, np.pi, beams, endpoint=False), Pose2(*hall.way(1)[0])
                scan = scan_from_ranges(0, angles, hall.ranges(*at, beams), 0.1, 30.0)
                grid.insert(at, scan)
                yield WorkSnippet("beams", partial(grid.insert, at, scan))
            fresh = OccupancyGrid(side)
            yield WorkSnippet("odds", partial(getattr, grid, "probability"))

            def grow(grid: OccupancyGrid = fresh, hall: Hall = hall) -> None:
                grid.log_odds = np.zeros((40, 40), dtype=np.float32)
                grid.cover(np.array([hall.half]) * 4.0)
                grid.cover(np.array([hall.half]) * -4.0)

            yield WorkSnippet("growth", grow)
            message = new("nav_msgs/msg/OccupancyGrid")
            yield WorkSnippet("map_message", partial(grid.fill, message))


def _of_ways() -> Iterator[WorkSnippet]:
    from volery.autonomy.avoidance import Motion, safe_velocity  # noqa: PLC0415
    from volery.autonomy.frontiers import edges_of, frontiers_of, reach_of  # noqa: PLC0415
    from volery.autonomy.grid_path import WaysFrom, clearance_of  # noqa: PLC0415

    random = np.random.default_rng(5)
    for rows, columns, share in ((40, 60, 0.004), (100, 100, 0.002), (200, 150, 0.004), (400, 300, 0.001)):
        blocked = random.random((rows, columns)) < share
        blocked[:2], blocked[-2:], blocked[:, :2], blocked[:, -2:] = True, True, True, True
        start = rows // 2, columns // 2
        blocked[start[0] - 4 : start[0] + 5, start[1] - 4 : start[1] + 5] = False
        yield WorkSnippet("clearance", partial(clearance_of, blocked, 0.1))
        for wall in (columns - 1, 2 * columns // 3):  # half of the places behind a wall cannot be reached
            walled = blocked.copy()
            walled[:, wall] = True
            room = clearance_of(walled, 0.1)
            yield WorkSnippet("ways", partial(WaysFrom, room, 0.1, start, 0.3))
        ways = WaysFrom(clearance_of(blocked, 0.1), 0.1, start, 0.3)
        far = np.argwhere(np.isfinite(ways.cost))[-1]
        goal = int(far[0]), int(far[1])
        yield WorkSnippet("way", partial(ways.to, goal))
        cells = ways.to(goal)
        yield WorkSnippet("line", partial(ways.straightened, cells))
        free, unknown = ~blocked, np.zeros_like(blocked)
        unknown[: rows // 5, : columns // 2], unknown[-rows // 6 :, columns // 3 :] = True, True
        free &= ~unknown
        none = np.zeros_like(free)
        yield WorkSnippet("edges", partial(edges_of, free, blocked, none, 4))
        edge = edges_of(free, blocked, none, 4)
        for near in (4, 9):  # "frontier" has its amounts only inside of it
            for number in (1, 9):
                places = none.copy()
                places.flat[np.flatnonzero(free)[:: free.sum() // number + 1]] = True
                yield WorkSnippet("reach", partial(reach_of, places, free, near))
            yield WorkSnippet("frontiers", partial(frontiers_of, edge, free, ways, near))
    motion = Motion(0.35, 1.5, 1.5, sight=12.0)
    for count in (20, 90, 360, 1080):
        points = random.uniform(2.0, 9.0, (count, 2))
        wanted = np.array((0.3, 0.2)), np.array((1.0, 0.1))
        yield WorkSnippet("avoidance", partial(safe_velocity, points, *wanted, motion))


def _of_drives() -> Iterator[WorkSnippet]:
    """Blocks with a state: each execution is a whole drive, and the blocks share what is left."""
    from volery.autonomy.avoidance import Motion  # noqa: PLC0415
    from volery.autonomy.explorer import Explorer  # noqa: PLC0415
    from volery.autonomy.laser_scan import LaserScan2, scan_from_ranges  # noqa: PLC0415
    from volery.autonomy.planar_pose import Pose2  # noqa: PLC0415
    from volery.autonomy.slam import Slam  # noqa: PLC0415

    for hall, beams, steps in (
        (HALLS[0], 30, 40),
        (HALLS[0], 30, 160),
        (HALLS[0], 180, 60),
        (HALLS[0], 360, 120),
        (HALLS[1], 360, 160),
    ):
        angles = np.linspace(-np.pi, np.pi, beams, endpoint=False)
        drive = [
            (Pose2(*at), scan_from_ranges(200 * MS * number, angles, hall.ranges(*at, beams), 0.1, 12.0))
            for number, at in enumerate(hall.way(steps))
        ]

        def slam(drive: list[tuple[Pose2, LaserScan2]] = drive) -> None:
            found = Slam()
            for pose, scan in drive:
                found.add(pose, scan)

        many = Slam()
        many.poses = [pose for pose, _ in drive]
        yield WorkSnippet("distances", partial(many._distances, many.poses[0]))
        yield WorkSnippet("slam", slam)

        explorer = Explorer(Motion(0.35, 1.0, 1.0, delay=0.5, sight=12.0))
        for pose, scan in drive[:20]:
            explorer.navigator.grid.insert(pose, scan)
        yield WorkSnippet("closing", partial(getattr, explorer.navigator, "free"))
        place = np.array(drive[0][0][:2])
        yield WorkSnippet("plan", partial(explorer.navigator.ways_from, place))

        def explore(drive: list[tuple[Pose2, LaserScan2]] = drive) -> None:
            explorer = Explorer(Motion(0.35, 1.0, 1.0, delay=0.5, sight=12.0))
            for pose, scan in drive[:25]:
                explorer.update(scan.time, pose, scan, np.zeros(2))

        yield WorkSnippet("exploration", explore)


def _of_markers() -> Iterator[WorkSnippet]:
    if module_if_installed("cv2") is None:
        return
    from volery.autonomy.markers import CameraModel, MarkerFinder, camera_of, picture_of  # noqa: PLC0415
    from volery.ros.messages import new  # noqa: PLC0415

    calibration = new("sensor_msgs/msg/CameraInfo", distortion_model="plumb_bob", d=[0.0] * 5)
    calibration.k[[0, 4]] = 320.0
    yield WorkSnippet("camera_model", partial(camera_of, calibration))
    for height, width in PICTURES:
        pixels = np.zeros(height * width, dtype=np.uint8)
        message = new("sensor_msgs/msg/Image", height=height, width=width, step=width, encoding="mono8")
        message.data = pixels
        yield WorkSnippet("picture", partial(picture_of, message))
    for shape in PICTURES[1:]:
        for markers in (0, 2, 8):
            seen = picture(*shape, markers)
            focal = float(shape[1])
            camera = CameraModel(
                np.array([[focal, 0, shape[1] / 2], [0, focal, shape[0] / 2], [0, 0, 1.0]]), np.zeros(5)
            )
            for known in (0, 8):
                finder = MarkerFinder(dict.fromkeys(range(known), 0.4))
                yield WorkSnippet("detection", partial(finder.find, seen, camera))
    yield from _of_landings(finder.find(seen, camera)[0])


def _of_landings(pose: MarkerPose) -> Iterator[WorkSnippet]:
    from volery.autonomy.precision_landing import LandingRules, LandingState, sight_of, step  # noqa: PLC0415

    level, rules, still = (1.0, 0.0, 0.0, 0.0), LandingRules(), (0.0, 0.0, 0.0)
    yield WorkSnippet("sight", partial(sight_of, pose, 0, level))
    landing = LandingState()
    for now in range(0, 1000 * MS, 50 * MS):
        landing, _ = step(landing, rules, now, still, sight_of(pose, now, level))
    for sight in (None, sight_of(pose, 1000 * MS, level)):
        yield WorkSnippet("landing_step", partial(step, landing, rules, 1000 * MS, still, sight))


TOGETHER = {
    "frontiers": ("frontiers", "frontier"),
    "slam": ("slam", "gathered", "loops"),
    "exploration": ("exploration", "navigation"),
    "detection": ("detection", "marker_pose"),
}
"""Blocks that are fitted together, because none is executed alone."""


def work_times(show: Callable[[str, int, int], object]) -> WorkTimes:
    """Time all blocks on this machine.

    Args:
        show: Called with the name of each block, its number and the number of all.

    Returns:
        Times by block and amount, ns of this machine.
    """
    all_snippets = list(work_snippets())
    by_block: dict[str, list[tuple[dict[str, dict[str, float]], float]]] = {}
    for number, one in enumerate(all_snippets):
        show(f"{one.block}", number, len(all_snippets))
        with metered() as work:
            one.execute()
        by_block.setdefault(one.block, []).append((work, least_time(one.execute)))
    times: WorkTimes = {}
    for block, measured in by_block.items():
        times.update(fitted(TOGETHER.get(block, (block,)), measured, times))
    return times


def fitted(
    blocks: Sequence[str],
    measured: Sequence[tuple[Mapping[str, Mapping[str, float]], float]],
    known: Mapping[str, Mapping[str, float]],
) -> WorkTimes:
    """Return the times of blocks by amount, ns, from executions.

    Args:
        blocks: The blocks.
        measured: The work of each execution, and its time [ns].
        known: Times of the blocks inside them.
    """
    from scipy.optimize import nnls  # noqa: PLC0415  # an extra

    names = sorted(
        {(block, name) for work, _ in measured for block in blocks for name in work.get(block, {})}
    )
    rows, rest = [], []
    for work, took in measured:
        inside = sum(
            known.get(block, {}).get(name, 0.0) * amount
            for block, amounts in work.items()
            if block not in blocks
            for name, amount in amounts.items()
        )
        rows.append([work.get(block, {}).get(name, 0.0) / took for block, name in names])
        rest.append((took - inside) / took)
    found, _ = nnls(np.array(rows), np.array(rest))
    times: WorkTimes = {}
    for (block, name), each in zip(names, found, strict=True):
        times.setdefault(block, {})[name] = float(f"{each:.4g}")
    return times
