"""``examples/mapping``: a drone maps a hall; a rover drives by that map, and makes its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import binary_dilation

from volery import Options, simulate
from volery.autonomy.laser_logs import read_laser_log
from volery.autonomy.occupancy_grid import OccupancyGrid
from volery.autonomy.slam import Slam
from volery.ros.messages.bags import open_bag

EXAMPLE = Path(__file__).parents[3] / "examples" / "mapping"
ORIGIN, SIDE = -5.0, 0.1
"""Corner of the floor plan in both axes, and side of its cells [m]."""

pytestmark = [pytest.mark.integration, pytest.mark.long]


@pytest.fixture(scope="module")
def explored(tmp_path_factory):
    """The map of what the drone saw."""
    folder = tmp_path_factory.mktemp("explored")
    run = simulate(EXAMPLE, Options(out=folder / "hall"))
    assert run.ok, run.error
    slam, grid = Slam(), OccupancyGrid(SIDE)
    for step in read_laser_log(folder / "hall" / "trace.mcap").steps:
        slam.add(step.odometry, step.scan)
    for kept, pose in zip(slam.scans, slam.poses, strict=True):
        grid.insert(pose, kept.scan)
    return grid


def walls():
    """The cells of the floor plan (rows, columns) that are 0.2 m or nearer to a wall."""
    plan = np.asarray(Image.open(EXAMPLE / "hall.png").convert("L"))[::-1] < 128
    return binary_dilation(plan, iterations=2)


def on_plan(grid, cells):
    """Rows and columns in the floor plan of cells of a grid."""
    places = grid.centres(np.argwhere(cells))
    columns, rows = ((places - ORIGIN) / SIDE).astype(int).T
    inside = (rows >= 0) & (columns >= 0) & (rows < 160) & (columns < 240)
    return rows[inside], columns[inside]


def test_the_map_of_what_it_saw_is_the_hall(explored):
    grid = explored
    wide = walls()
    assert wide[on_plan(grid, grid.occupied)].mean() > 0.95, "walls are where they are in the plan, to 0.2 m"
    seen = np.zeros_like(wide)
    seen[on_plan(grid, grid.free)] = True
    assert (seen & ~wide).sum() > 0.98 * (~wide).sum(), "all of the hall is known"


def test_a_rover_drives_by_the_map_of_the_drone_and_makes_its_own(explored, tmp_path):
    _, plan = explored.save(tmp_path / "hall_map")
    wanted = {"plan": plan, "own": tmp_path / "own"}
    chosen = [f"application.courier.parameters.{name}={value}" for name, value in wanted.items()]
    run = simulate(EXAMPLE / "rover.yaml", Options(out=tmp_path / "rover"), overrides=chosen)
    assert run.ok, run.error
    *_, odometry = open_bag(tmp_path / "rover" / "trace.mcap").messages(["/rover/odom"])
    place = odometry.message.pose.pose.position
    assert np.hypot(place.x - 16.0, place.y - 3.0) < 2.5, "the radius in which the autopilot has arrived"
    own = OccupancyGrid.load(tmp_path / "own.yaml")
    assert own.occupied.sum() > 1000
    assert walls()[on_plan(own, own.occupied)].mean() > 0.95, "its own map is that of the hall"
