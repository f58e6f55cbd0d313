from __future__ import annotations

import numpy as np
import pytest

from rigs.floor_plans import OFFICE, scan
from volery.autonomy.planar_pose import Pose2
from volery.autonomy.scan_matching import LocalMap, normals_of

HERE = Pose2(2.5, 3.0, 0.4)
PRIOR = np.array((0.5, 0.5, 0.3))


@pytest.fixture(scope="module")
def local() -> LocalMap:
    seen = scan(OFFICE, HERE, seed=1)
    return LocalMap(seen.points, normals_of(seen.points))


def test_a_scan_is_found_without_a_good_guess(local: LocalMap) -> None:
    other = Pose2(3.1, 2.6, 0.7)
    points = scan(OFFICE, other, seed=2).points
    motion = HERE.to(other)
    found = local.search(points, Pose2(motion.x - 0.4, motion.y + 0.5, motion.yaw - 0.2), 0.8, 0.35)
    assert found is not None
    match = local.align(points, found.pose, PRIOR)
    assert match.pose == pytest.approx(motion, abs=0.01)
    assert match.share > 0.8


def test_the_search_is_exact(local: LocalMap) -> None:
    """A window of one block at a time finds nothing better than the whole window."""
    points = scan(OFFICE, Pose2(2.8, 2.9, 0.5), seed=3).points
    whole = local.search(points, Pose2(), 0.4, 0.1)
    assert whole is not None
    for x in (-0.2, 0.2):
        for y in (-0.2, 0.2):
            part = local.search(points, Pose2(x, y), 0.2, 0.1)
            assert part is None or part.share <= whole.share + 1e-12


def test_nothing_is_found_below_the_least_share(local: LocalMap) -> None:
    elsewhere = scan(OFFICE, Pose2(17.0, 12.0, 1.0), seed=4).points
    assert local.search(elsewhere, Pose2(), 0.3, 0.1, least=0.8) is None


def test_along_a_corridor_the_prior_holds_the_pose() -> None:
    walls = np.array([(-100.0, -1.0, 100.0, -1.0), (-100.0, 1.0, 100.0, 1.0)])
    seen = scan(walls, Pose2(), seed=1)
    corridor = LocalMap(seen.points, normals_of(seen.points))
    match = corridor.align(
        scan(walls, Pose2(0.3, 0.1), seed=2).points, Pose2(0.3, 0.0), np.array((0.05, 0.05, 0.05))
    )
    assert match.pose == pytest.approx((0.3, 0.1, 0.0), abs=0.03)
    values = np.linalg.eigvalsh(match.information)
    assert values[0] < 0.05 * values[1]


def test_normals_are_unit_or_zero() -> None:
    normals = normals_of(scan(OFFICE, HERE, seed=5).points)
    lengths = np.sqrt((normals**2).sum(axis=1))
    assert np.all((np.abs(lengths - 1.0) < 1e-9) | (lengths == 0.0))
    assert (lengths > 0.0).mean() > 0.8
    assert normals_of(np.zeros((0, 2))).shape == (0, 2)
