from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import label

from rigs.floor_plans import box, scan
from rigs.velocity_vehicle import distances, fly
from volery.autonomy.avoidance import Motion
from volery.autonomy.explorer import Explorer
from volery.autonomy.planar_pose import Array, Pose2

DRONE = Motion(radius=0.3, speed=2.0, acceleration=2.0, margin=0.15, period=0.2, sight=12.0)
TURN = 0.6

FLOOR = np.array(
    [
        *box(0.0, 0.0, 30.0, 40.0),
        *box(12.0, 12.0, 18.0, 28.0),
        *((8.0, low, 8.0, high) for low, high in ((0.0, 5.0), (6.8, 18.0), (19.8, 33.0), (34.8, 40.0))),
        (0.0, 13.0, 8.0, 13.0),
        (0.0, 26.0, 8.0, 26.0),
        (12.0, 34.0, 20.0, 34.0),
        (21.8, 34.0, 30.0, 34.0),
        (14.0, 6.0, 26.0, 6.0),
        *box(22.0, 16.0, 24.0, 17.0),
        *box(25.0, 25.0, 26.0, 26.0),
    ]
)
"""A floor of 30 by 40 m with three rooms, loops around a block, a wall and pillars."""


def truly_free(walls: Array, side: float, start: tuple[float, float]) -> tuple[Array, Array]:
    """Return the centres of cells, and which of them can be reached from a place."""
    x, y = np.meshgrid(np.arange(0.5 * side, 30.0, side), np.arange(0.5 * side, 40.0, side))
    centres = np.stack((x.ravel(), y.ravel()), axis=1)
    open_cells = (distances(walls, centres) > 0.75 * side).reshape(x.shape)
    numbers, _ = label(open_cells)
    return centres, (numbers == numbers[int(start[1] / side), int(start[0] / side)]).ravel()


def test_a_floor_with_loops_becomes_known_without_a_collision() -> None:
    explorer = Explorer(DRONE, resolution=0.15, turn=TURN)

    def decide(time: int, pose: Pose2, velocity: Array) -> tuple[Array, float] | None:
        seen = scan(FLOOR, pose, seed=time, most=12.0, time=time)
        return None if explorer.done else explorer.update(time, pose, seen, velocity)

    poses = fly(decide, DRONE, Pose2(10.0, 10.0), 600.0)
    assert explorer.done
    assert explorer.navigator.word.startswith("explored")
    assert distances(FLOOR, poses[:, :2]).min() > DRONE.radius
    centres, free = truly_free(FLOOR, 0.15, (10.0, 10.0))
    grid = explorer.navigator.grid
    cells = np.array([grid.cell(x, y) for x, y in centres[free]])
    known = explorer.navigator.free[tuple(cells.T)]
    assert known.mean() > 0.99
    assert np.abs(np.diff(poses[:, 2])).max() <= TURN * 0.01 + 1e-12
    speeds = np.hypot(*np.diff(poses[:, :2], axis=0).T) / 0.01
    assert speeds.max() <= DRONE.speed + 1e-9
    assert np.abs(np.diff(speeds)).max() <= DRONE.acceleration * 0.01 + 1e-6


def test_it_brakes_without_a_scan_and_waits_for_the_first() -> None:
    explorer = Explorer(DRONE)
    command = explorer.update(0, Pose2(10.0, 10.0), None, np.zeros(2))
    assert not command.velocity.any()
    assert explorer.navigator.word == "no scan yet"
    assert not explorer.done


@pytest.mark.parametrize("side", [1.0, 3.0])
def test_a_closed_room_is_done_soon(side: float) -> None:
    walls = np.array(box(10.0 - side, 10.0 - side, 10.0 + side, 10.0 + side))
    explorer = Explorer(DRONE)

    def decide(time: int, pose: Pose2, velocity: Array) -> tuple[Array, float] | None:
        seen = scan(walls, pose, seed=time, time=time)
        return None if explorer.done else explorer.update(time, pose, seen, velocity)

    poses = fly(decide, DRONE, Pose2(10.0, 10.0), 60.0)
    assert explorer.done
    assert distances(walls, poses[:, :2]).min() > DRONE.radius


def test_what_is_seen_but_cannot_be_reached_ends_no_exploration_and_hides_no_other_frontier() -> None:
    walls = np.array(
        [
            *box(0.0, 0.0, 16.0, 8.0),
            (8.0, 0.0, 8.0, 2.0),
            (8.0, 2.5, 8.0, 5.0),  # a window, too narrow for the drone
            (8.0, 7.0, 8.0, 8.0),  # and a door
            (8.0, 4.0, 16.0, 4.0),  # the door leads into another room
        ]
    )
    explorer = Explorer(DRONE)

    def decide(time: int, pose: Pose2, velocity: Array) -> tuple[Array, float] | None:
        seen = scan(walls, pose, seed=time, time=time)
        return None if explorer.done else explorer.update(time, pose, seen, velocity)

    poses = fly(decide, DRONE, Pose2(3.0, 5.0), 120.0)
    assert explorer.done
    assert distances(walls, poses[:, :2]).min() > DRONE.radius
    assert explorer.given_up
    grid, free = explorer.navigator.grid, explorer.navigator.free
    for x, y in ((1.0, 1.0), (7.0, 1.0), (15.0, 5.0), (9.0, 5.0), (15.0, 7.0)):
        assert free[grid.cell(x, y)], (x, y)


@pytest.mark.parametrize(("away", "open_"), [(7.0, True), (2.0, False)])
def test_what_one_scan_sees_far_away_closes_no_way_through_what_is_known(away: float, open_: bool) -> None:
    """Odometry that is late lays the points of a scan at an old yaw."""
    room, pose = box(0.0, 0.0, 12.0, 4.0), Pose2(3.0, 2.0)
    navigator = Explorer(DRONE).navigator
    for time in range(10):
        navigator.update(time, pose, scan(np.array(room), pose, seed=time, most=12.0, time=time), np.zeros(2))
    wrong = np.array([*room, (3.0 + away, 0.0, 3.0 + away, 4.0)])
    navigator.update(10, pose, scan(wrong, pose, seed=10, most=12.0, time=10), np.zeros(2))
    ways, window = navigator.ways_from(np.array((pose.x, pose.y)))
    assert (ways.cost[window.cell(11.0, 2.0)] < np.inf) == open_


def test_from_a_passage_that_is_narrower_than_those_it_would_choose_it_goes_on() -> None:
    passage = [(x, low, x, high) for x in (5.0, 7.0) for low, high in ((0.0, 2.45), (3.55, 6.0))]
    walls = np.array([*box(0.0, 0.0, 12.0, 6.0), *passage, *((5.0, y, 7.0, y) for y in (2.45, 3.55))])
    explorer = Explorer(DRONE)
    assert 2.0 * DRONE.room < 1.1 < 2.0 * explorer.navigator.least

    def decide(time: int, pose: Pose2, velocity: Array) -> tuple[Array, float] | None:
        seen = scan(walls, pose, seed=time, time=time)
        return None if explorer.done else explorer.update(time, pose, seen, velocity)

    poses = fly(decide, DRONE, Pose2(6.0, 3.0), 60.0)
    assert explorer.done
    assert distances(walls, poses[:, :2]).min() > DRONE.radius
    grid, free = explorer.navigator.grid, explorer.navigator.free
    corners = [free[grid.cell(x, y)] for x in (0.5, 4.5, 7.5, 11.5) for y in (0.5, 5.5)]
    assert all(corners[:4]) or all(corners[4:]), "one of the rooms"
