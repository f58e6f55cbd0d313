from __future__ import annotations

import itertools
from math import pi

import numpy as np
import pytest

from volery.autonomy.planar_pose import Pose2
from volery.autonomy.pose_graph import Edge, optimise

INFORMATION = np.diag((400.0, 400.0, 10_000.0))
ROUND = [Pose2(10.0 * np.cos(a), 10.0 * np.sin(a), a + pi / 2) for a in np.linspace(0.0, 2.0 * pi, 41)[:-1]]


def chain(bias: float) -> tuple[list[Pose2], list[Edge]]:
    """Return poses by an odometry that turns too much, and the edges between them."""
    poses, edges = [ROUND[0]], []
    for number, (one, other) in enumerate(itertools.pairwise(ROUND)):
        motion = one.to(other)
        motion = motion._replace(yaw=motion.yaw + bias)
        poses.append(poses[-1].after(motion))
        edges.append(Edge(number, number + 1, motion, INFORMATION, True))
    return poses, edges


def error(poses: list[Pose2]) -> float:
    return max(
        float(np.hypot(pose.x - true.x, pose.y - true.y)) for pose, true in zip(poses, ROUND, strict=True)
    )


def test_a_closed_loop_takes_the_drift_away() -> None:
    poses, edges = chain(0.01)
    closing = Edge(len(ROUND) - 1, 0, ROUND[-1].to(ROUND[0]), 100.0 * INFORMATION)
    found, weights = optimise(poses, [*edges, closing], doubt=1e6)
    assert error(poses) > 2.0
    assert error(found) < 0.8
    assert weights[-1] == pytest.approx(1.0, abs=1e-3)


def test_a_loop_that_contradicts_the_rest_has_no_weight() -> None:
    poses, edges = chain(0.0)
    wrong = Edge(20, 0, Pose2(), INFORMATION)
    found, weights = optimise(poses, [*edges, wrong])
    assert weights[-1] < 1e-3
    assert error(found) < 0.1


def test_one_pose_stays_where_it_is() -> None:
    assert optimise([Pose2(1.0, 2.0, 3.0)], [])[0] == [Pose2(1.0, 2.0, 3.0)]
