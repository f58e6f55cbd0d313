"""Localisation on a known floor: accuracy, a stated covariance that is true, loss and recovery."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from rigs.floor_plans import OFFICE, box, odometry, scan, tour
from volery.autonomy.localisation import Localiser, Located
from volery.autonomy.occupancy_grid import OccupancyGrid
from volery.autonomy.planar_pose import Pose2
from volery.base.errors import UsageError
from volery.base.frames import wrap

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
TRUTH = tour(WAY)


@cache
def floor(resolution: float = 0.05) -> OccupancyGrid:
    grid = OccupancyGrid(resolution)
    for number, pose in enumerate(TRUTH[::3]):
        grid.insert(pose, scan(OFFICE, pose, seed=number))
    return grid


def error(here: Located, truth: Pose2) -> np.ndarray:
    pose = here.pose
    return np.array((pose.x - truth.x, pose.y - truth.y, wrap(pose.yaw - truth.yaw)))


@pytest.mark.parametrize(("resolution", "most"), [(0.05, 0.025), (0.1, 0.065)])
def test_a_way_is_followed_to_centimetres(resolution: float, most: float) -> None:
    wheels = odometry(TRUTH, 1)
    assert np.hypot(wheels[-1].x - TRUTH[-1].x, wheels[-1].y - TRUTH[-1].y) > 2.0
    start = Pose2(TRUTH[0].x + 0.3, TRUTH[0].y - 0.3, TRUTH[0].yaw + 0.1)
    localiser = Localiser(floor(resolution), start)
    off, surprise = [], []
    for number, (moved, true) in enumerate(zip(wheels, TRUTH, strict=True)):
        here = localiser.add(moved, scan(OFFICE, true, seed=5000 + number, time=number))
        wrong = error(here, true)
        off.append(np.hypot(*wrong[:2]))
        surprise.append(wrong @ np.linalg.solve(here.covariance, wrong))
        assert here.word == ""
    assert np.sqrt(np.mean(np.square(off))) < most
    assert np.mean(surprise) < 3.0, "the covariance promises no more than it keeps"
    assert here.resets == 0


def test_gaps_of_the_odometry_are_bridged_by_the_scans() -> None:
    wheels = odometry(TRUTH, 2)
    localiser = Localiser(floor(), TRUTH[0])
    for number, (moved, true) in enumerate(zip(wheels, TRUTH, strict=True)):
        here = localiser.add(None if number % 7 == 3 else moved, scan(OFFICE, true, seed=number))
        assert np.hypot(*error(here, true)[:2]) < 0.1


def test_between_two_scans_the_odometry_counts_and_the_covariance_grows() -> None:
    localiser = Localiser(floor(), TRUTH[0])
    here = localiser.add(Pose2(5.0, 5.0, 1.0), scan(OFFICE, TRUTH[0]))
    later = localiser.predict(Pose2(5.0, 5.0, 1.0).after(Pose2(0.4, 0.1, 0.2)))
    assert here.pose.to(later.pose) == pytest.approx(Pose2(0.4, 0.1, 0.2))
    assert np.all(np.diag(later.covariance) > np.diag(here.covariance))


def test_elsewhere_it_says_that_it_is_lost_and_is_found_again() -> None:
    """It is carried into another building for a while; the wheels do not notice the way back."""
    localiser = Localiser(floor(), TRUTH[0])
    elsewhere = np.array(box(-1.1, -0.7, 0.9, 0.8))
    for number in range(5):
        localiser.add(TRUTH[number], scan(OFFICE, TRUTH[number], seed=number))
    for number in range(5, 10):
        here = localiser.add(TRUTH[number], scan(elsewhere, Pose2(0.0, 0.0, 0.3), seed=number))
    assert "% of the scan fit the map" in here.word
    spread = np.sqrt(np.diag(here.covariance))
    off = Pose2(TRUTH[10].x + 0.7, TRUTH[10].y, TRUTH[10].yaw)
    assert np.sqrt(np.diag(localiser.predict(off).covariance))[0] > spread[0]
    for number in range(10, 16):
        true = TRUTH[number]
        here = localiser.add(Pose2(true.x - 0.7, true.y + 0.5, true.yaw), scan(OFFICE, true, seed=number))
    assert here.word == ""
    assert np.hypot(*error(here, true)[:2]) < 0.05
    assert here.resets == 1


@pytest.mark.parametrize("number", [5, 60, 150])
def test_a_scan_is_found_on_the_whole_map(number: int) -> None:
    match = Localiser(floor(), Pose2(0.0, 0.0, 0.0)).find(scan(OFFICE, TRUTH[number], seed=number))
    assert match is not None
    step = TRUTH[number].to(match.pose)
    assert step.distance < 0.05
    assert abs(step.yaw) < 0.02


def test_a_scan_of_another_place_is_found_nowhere() -> None:
    room = np.array(box(-1.1, -0.7, 0.9, 0.8))
    assert Localiser(floor(), Pose2()).find(scan(room, Pose2(0.0, 0.0, 0.3))) is None


def test_a_scan_that_met_nothing_leaves_it_to_odometry() -> None:
    localiser = Localiser(floor(), Pose2(2.0, 2.0, 0.0))
    here = localiser.add(Pose2(), scan(OFFICE, Pose2(200.0, 200.0, 0.0)))
    assert (here.pose, here.word) == (Pose2(2.0, 2.0, 0.0), "the scan has met nothing")


def test_a_map_without_walls_is_none() -> None:
    with pytest.raises(UsageError, match="the map has no walls"):
        Localiser(OccupancyGrid(), Pose2())


def test_the_same_scans_give_the_same_bytes() -> None:
    def found() -> bytes:
        localiser = Localiser(floor(), TRUTH[0])
        rows = [localiser.add(true, scan(OFFICE, true, seed=3)) for true in TRUTH[:20]]
        return b"".join(np.array((*one.pose, *one.covariance.ravel())).tobytes() for one in rows)

    assert found() == found()
