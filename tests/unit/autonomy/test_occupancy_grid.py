from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rigs.floor_plans import OFFICE, scan, tour
from volery.autonomy.laser_scan import LaserScan2
from volery.autonomy.occupancy_grid import OccupancyGrid
from volery.autonomy.planar_pose import Pose2
from volery.base.errors import UsageError
from volery.ros.messages import new

NOTHING = np.zeros((0, 2))


@pytest.fixture(scope="module")
def office() -> OccupancyGrid:
    grid = OccupancyGrid()
    for number, pose in enumerate(tour([(2.0, 2.0), (10.5, 2.0), (10.5, 12.0)], 0.5)):
        grid.insert(pose, scan(OFFICE, pose, seed=number))
    return grid


def test_walls_are_occupied_and_the_way_is_free(office: OccupancyGrid) -> None:
    assert office.free[office.cell(6.0, 2.0)]
    assert office.log_odds[office.cell(6.5, 7.0)] == 0.0, "inside of a block nothing is known"
    walls = office.centres(np.argwhere(office.occupied))
    x, y = walls[:, 0], walls[:, 1]
    west, south, east, north = (
        OFFICE[:, [0, 2]].min(1),
        OFFICE[:, [1, 3]].min(1),
        OFFICE[:, [0, 2]].max(1),
        OFFICE[:, [1, 3]].max(1),
    )
    off_x = np.maximum(np.maximum(west - x[:, None], x[:, None] - east), 0.0)
    off_y = np.maximum(np.maximum(south - y[:, None], y[:, None] - north), 0.0)
    assert (np.hypot(off_x, off_y).min(axis=1) < 0.1).mean() > 0.99


def test_a_beam_that_met_nothing_makes_free() -> None:
    grid = OccupancyGrid(0.1)
    for _ in range(4):
        grid.insert(Pose2(), LaserScan2(0, NOTHING, np.array([[5.0, 0.0]])))
    assert grid.free[grid.cell(4.95, 0.05)]
    assert not grid.occupied.any()


def test_an_empty_scan_changes_nothing() -> None:
    grid = OccupancyGrid()
    grid.insert(Pose2(), LaserScan2(0, NOTHING, NOTHING))
    assert grid.log_odds.size == 0


def test_a_grid_keeps_its_cells_as_it_grows() -> None:
    grid = OccupancyGrid(0.1)
    for _ in range(3):
        grid.insert(Pose2(), LaserScan2(0, np.array([[1.05, 0.05]]), NOTHING))
    for to in ([-30.0, 0.0], [0.0, -30.0], [30.0, 0.0], [0.0, 30.0]):
        grid.insert(Pose2(), LaserScan2(0, np.array([to]), NOTHING))
    assert grid.occupied[grid.cell(1.05, 0.05)]
    assert grid.occupied.sum() >= 1


def test_the_message_is_that_of_ros(office: OccupancyGrid) -> None:
    message = new("nav_msgs/msg/OccupancyGrid")
    office.fill(message)
    assert message.info.width * message.info.height == len(message.data)
    assert set(np.unique(message.data)) >= {-1}
    assert max(message.data) <= 100
    assert (message.info.origin.position.x, message.info.resolution) == (office.west, 0.05)


def test_the_files_are_those_of_map_server(office: OccupancyGrid, tmp_path: Path) -> None:
    picture, text = office.save(tmp_path / "office")
    magic, size, depth, pixels = picture.read_bytes().split(b"\n", 3)
    columns, rows = map(int, size.split())
    assert (magic, depth, len(pixels)) == (b"P5", b"255", columns * rows)
    shades = np.frombuffer(pixels, dtype=np.uint8).reshape(rows, columns)[::-1]
    assert np.array_equal(shades == 0, office.occupied)
    assert "image: office.pgm" in text.read_text()


def test_a_resolution_of_nothing_is_refused() -> None:
    with pytest.raises(UsageError, match="resolution"):
        OccupancyGrid(0.0)
