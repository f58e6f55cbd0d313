"""``examples/mapping``: a drone explores a hall; the map of its scans is the hall's floor plan."""

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

EXAMPLE = Path(__file__).parents[3] / "examples" / "mapping"
ORIGIN, SIDE = -5.0, 0.1
"""Corner of the floor plan in both axes, and side of its cells [m]."""

pytestmark = pytest.mark.integration


def test_the_map_of_what_it_saw_is_the_hall(tmp_path):
    run = simulate(EXAMPLE, Options(out=tmp_path / "hall"))
    assert run.ok, run.error or run.verdicts
    slam, grid = Slam(), OccupancyGrid(SIDE)
    for step in read_laser_log(tmp_path / "hall" / "trace.mcap").steps:
        slam.add(step.odometry, step.scan)
    for kept, pose in zip(slam.scans, slam.poses, strict=True):
        grid.insert(pose, kept.scan)
    plan = np.asarray(Image.open(EXAMPLE / "hall.png").convert("L"))[::-1] < 128
    wide = binary_dilation(plan, iterations=2)

    def on_plan(cells):
        places = grid.centres(np.argwhere(cells))
        columns, rows = ((places - ORIGIN) / SIDE).astype(int).T
        inside = (rows >= 0) & (columns >= 0) & (rows < plan.shape[0]) & (columns < plan.shape[1])
        return rows[inside], columns[inside]

    assert wide[on_plan(grid.occupied)].mean() > 0.95, "walls are where they are in the plan, to 0.2 m"
    seen = np.zeros_like(plan)
    seen[on_plan(grid.free)] = True
    assert (seen & ~wide).sum() > 0.95 * (~wide).sum(), "nearly all of the hall is known"
