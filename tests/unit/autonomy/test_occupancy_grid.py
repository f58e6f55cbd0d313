from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from rigs.floor_plans import OFFICE, box, scan, tour
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


@pytest.mark.parametrize("angle", [0.03, 0.1, 0.5])
def test_a_wall_stays_that_beams_meet_at_a_small_angle(angle: float) -> None:
    """Each beam runs along several cells of the wall before it meets it."""
    turned, grid = Pose2(0.0, 0.0, angle), OccupancyGrid(0.2)
    wall = turned.of(np.array([[-3.0, 1.0], [6.0, 1.0]])).reshape(1, 4)
    places = wall[0, :2] + np.linspace(0.0, 1.0, 90)[:, None] * (wall[0, 2:] - wall[0, :2])

    def is_wall() -> NDArray[np.bool_]:
        off = places[:, None] - grid.centres(np.argwhere(grid.occupied))
        near: NDArray[np.bool_] = np.hypot(off[..., 0], off[..., 1]).min(axis=1) < 0.2
        return near

    for seed, along in enumerate(np.linspace(-2.0, 5.0, 30)):
        pose = Pose2(*turned.of(np.array([[along, 0.0]]))[0])
        grid.insert(pose, scan(wall, pose, seed))
    assert is_wall().all()
    for x, y in turned.of(np.array([[-3.5, 0.4], [-3.5, 0.6]])):
        for seed in range(60):
            grid.insert(Pose2(x, y), scan(wall, Pose2(x, y), seed))
    assert is_wall()[:-10].all()  # beams that miss it pass along its free end
    assert grid.free[grid.cell(*turned.of(np.array([[2.0, 0.4]]))[0])]


def test_a_beam_that_met_nothing_makes_free() -> None:
    grid = OccupancyGrid(0.1)
    for _ in range(4):
        grid.insert(Pose2(), LaserScan2(0, NOTHING, np.array([[5.0, 0.0]])))
    assert grid.free[grid.cell(4.95, 0.05)]
    assert not grid.occupied.any()


def test_a_gap_between_two_poles_is_passed_and_the_poles_stay() -> None:
    """Their ends are no neighbours: between them beams go out into the open."""
    poles = np.array([*box(3.0, -1.5, 3.2, -1.3), *box(3.0, 1.3, 3.2, 1.5)])
    grid = OccupancyGrid(0.1)
    for seed in range(5):
        grid.insert(Pose2(), scan(poles, Pose2(), seed))
    gap = [grid.free[grid.cell(3.05, y)] for y in np.arange(-1.15, 1.2, 0.1)]
    assert np.mean(gap) > 0.9
    assert grid.occupied[grid.cell(3.01, 1.31)]
    assert grid.occupied[grid.cell(3.01, -1.31)]


def test_what_is_gone_becomes_free_with_later_scans() -> None:
    grid = OccupancyGrid(0.1)
    for _ in range(3):
        grid.insert(Pose2(), LaserScan2(0, np.array([[2.05, 0.05]]), NOTHING))
    assert grid.occupied[grid.cell(2.05, 0.05)]
    for _ in range(12):
        grid.insert(Pose2(), LaserScan2(0, np.array([[4.05, 0.05]]), NOTHING))
    assert grid.free[grid.cell(2.05, 0.05)]


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


def test_a_saved_map_is_loaded_as_it_was(office: OccupancyGrid, tmp_path: Path) -> None:
    _, text = office.save(tmp_path / "office")
    loaded = OccupancyGrid.load(text)
    assert np.array_equal(loaded.occupied, office.occupied)
    assert np.array_equal(loaded.free, office.free)
    assert loaded.resolution == office.resolution
    assert (loaded.west, loaded.south) == pytest.approx((office.west, office.south), abs=1e-5)
    again, _ = loaded.save(tmp_path / "again")
    assert again.read_bytes() == (tmp_path / "office.pgm").read_bytes()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("resolution: 0.05\n", "", "resolution: this key is missing"),
        ("resolution: 0.05", "resolution: nan", "a resolution of nan m"),
        ("office.pgm", "lost.pgm", "lost.pgm: there is no such picture"),
        (", 0]", ", 0.5]", "its origin is turned by 0.5 rad"),
        (", 0]", "]", "three numbers"),
        ("image:", "image", "not YAML|a mapping|key"),
    ],
)
def test_a_wrong_map_file_is_named(
    office: OccupancyGrid, tmp_path: Path, old: str, new: str, words: str
) -> None:
    _, text = office.save(tmp_path / "office")
    text.write_text(text.read_text().replace(old, new))
    with pytest.raises(UsageError, match=words) as raised:
        OccupancyGrid.load(text)
    assert "office.yaml" in str(raised.value)


def test_a_damaged_picture_and_a_missing_file_are_named(office: OccupancyGrid, tmp_path: Path) -> None:
    picture, text = office.save(tmp_path / "office")
    picture.write_bytes(picture.read_bytes()[:-100])
    with pytest.raises(UsageError, match=r"office\.pgm"):
        OccupancyGrid.load(text)
    with pytest.raises(UsageError, match=r"none\.yaml: it cannot be read"):
        OccupancyGrid.load(tmp_path / "none.yaml")
    with pytest.raises(UsageError, match=r"office\.pgm: this is not YAML"):
        OccupancyGrid.load(picture)


def test_a_resolution_of_nothing_is_refused() -> None:
    with pytest.raises(UsageError, match="resolution"):
        OccupancyGrid(0.0)
