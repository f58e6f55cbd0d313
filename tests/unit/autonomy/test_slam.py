from __future__ import annotations

import numpy as np
import pytest

from rigs.floor_plans import OFFICE, odometry, scan, tour
from volery.autonomy.laser_scan import LaserScan2
from volery.autonomy.planar_pose import Pose2
from volery.autonomy.slam import Slam

WAY = [
    (2.0, 2.0),
    (10.5, 2.5),
    (10.5, 12.0),
    (2.0, 12.0),
    (2.0, 2.5),
    (10.5, 2.0),
    (18.0, 2.5),
    (18.0, 12.0),
    (10.5, 12.0),
    (10.5, 2.5),
]


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.long) for seed in (2, 3))])
def test_a_way_with_loops_is_found_to_centimetres(seed: int) -> None:
    truth = tour(WAY)
    wheels = odometry(truth, seed)
    drift = np.hypot(wheels[-1].x - truth[-1].x, wheels[-1].y - truth[-1].y)
    slam = Slam()
    live = [
        slam.add(moved, scan(OFFICE, true, seed=1000 * seed + time, time=time))
        for time, (moved, true) in enumerate(zip(wheels, truth, strict=True))
    ]
    slam.finish()
    off = [np.hypot(pose.x - true.x, pose.y - true.y) for pose, true in zip(live, truth, strict=True)]
    final = [
        np.hypot(pose.x - truth[kept.scan.time].x, pose.y - truth[kept.scan.time].y)
        for kept, pose in zip(slam.scans, slam.poses, strict=True)
    ]
    assert drift > 0.5
    assert np.mean(off) < 0.1
    assert np.sqrt(np.mean(np.square(final))) < 0.03
    assert slam.loops > 0


def test_the_same_scans_give_the_same_bytes() -> None:
    truth = tour(WAY[:4])
    wheels = odometry(truth, 5)

    def poses() -> bytes:
        slam = Slam()
        for time, (moved, true) in enumerate(zip(wheels, truth, strict=True)):
            slam.add(moved, scan(OFFICE, true, seed=time))
        slam.finish()
        return np.array(slam.poses).tobytes()

    assert poses() == poses()


def test_a_scan_without_points_is_where_odometry_says() -> None:
    slam = Slam()
    slam.add(Pose2(), scan(OFFICE, Pose2(2.0, 2.0)))
    blind = scan(OFFICE, Pose2(2.0, 2.0), most=0.1)
    assert slam.add(Pose2(1.0, 0.0, 0.1), blind) == pytest.approx((1.0, 0.0, 0.1))


def test_it_is_said_that_a_scan_fits_nowhere() -> None:
    slam = Slam()
    for x in (0.0, 0.2, 0.4):
        slam.add(Pose2(x, 0.0), scan(OFFICE, Pose2(2.0 + x, 2.0)))
    angles = np.linspace(-np.pi, np.pi, 300)
    ranges = np.random.default_rng(1).uniform(0.5, 9.0, 300)
    points = np.stack((ranges * np.cos(angles), ranges * np.sin(angles)), axis=1)
    slam.add(Pose2(1.4, 0.1, 0.3), LaserScan2(0, points, np.zeros((0, 2))))
    assert "the place is uncertain" in slam.lost[-1][1]
