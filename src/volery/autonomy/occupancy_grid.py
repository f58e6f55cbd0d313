"""An occupancy grid: what beams have met, what they have passed, and what is not known.

Cells carry log odds (Moravec and Elfes, ICRA 1985). Files are those of map_server: a picture and a YAML file.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, floor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.laser_scan import LaserScan2
from volery.autonomy.planar_pose import Array, Pose2
from volery.base.errors import UsageError
from volery.base.numeric_code import NumericCode, numeric

MET, PASSED, LIMIT = 0.85, -0.4, 4.0
"""Log odds that a beam adds where it ends and where it passes, and their limit."""

OCCUPIED, FREE = 0.65, 0.25
"""Probabilities from which on a cell is occupied, and up to which it is free, as in map_saver's files."""

_MARGIN = 2.0  # [m] by which a grid grows beyond what it must hold


class OccupancyGrid:
    """A grid that grows with what is inserted.

    Args:
        resolution: Side of a cell [m].

    ``log_odds`` is (rows, columns), the first row in the south; 0 is unknown. ``west`` and ``south`` are its
    corner [m].
    """

    def __init__(self, resolution: float = 0.05) -> None:
        if not 0.001 <= resolution <= 10.0:
            raise UsageError(f"a resolution of {resolution} m; give 0.001 to 10 m")
        self.resolution = resolution
        self.west = self.south = 0.0
        self.log_odds: NDArray[np.float32] = np.zeros((0, 0), dtype=np.float32)

    @property
    def probability(self) -> Array:
        """Probability of each cell to be occupied (rows, columns), 0.5 where nothing is known."""
        return 1.0 / (1.0 + np.exp(-self.log_odds.astype(np.float64)))

    @property
    def occupied(self) -> NDArray[np.bool_]:
        """Which cells are occupied."""
        return self.probability >= OCCUPIED

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which cells are free."""
        return self.probability <= FREE

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """Return row and column of the cell of a place, inside of the grid or not."""
        return floor((y - self.south) / self.resolution), floor((x - self.west) / self.resolution)

    def centres(self, cells: NDArray[np.int64]) -> Array:
        """Return the centres (n, 2) [m] of cells (n, 2) given as rows and columns."""
        corner = np.array((self.west, self.south))
        places: Array = (cells[:, ::-1] + 0.5) * self.resolution + corner
        return places

    def insert(self, pose: Pose2, scan: LaserScan2) -> None:
        """Mark what a scan has met and passed."""
        ends = pose.of(np.vstack((scan.points, scan.open_ends)))
        if not len(ends):
            return
        start = np.array((pose.x, pose.y))
        self._cover(np.vstack((ends, start)))
        met = np.zeros(len(ends), dtype=np.int64)
        met[: len(scan.points)] = 1
        frame = np.array((self.west, self.south, self.resolution))
        mark_beams.bind(self.log_odds, frame, start, np.ascontiguousarray(ends), met)()

    def _cover(self, points: Array) -> None:
        """Grow until all points are inside."""
        low, high = points.min(axis=0), points.max(axis=0)
        if not self.log_odds.size:
            self.west, self.south = (
                floor((value - _MARGIN) / self.resolution) * self.resolution for value in low
            )
        (bottom, left), (top, right) = self.cell(*low), self.cell(*high)
        rows, columns = self.log_odds.shape
        if bottom >= 0 and left >= 0 and top < rows and right < columns:
            return
        spare = ceil(_MARGIN / self.resolution)
        below, before = (-min(value, 0) + (spare if value < 0 else 0) for value in (bottom, left))
        above, behind = (
            max(value - size + 1, 0) + (spare if value >= size else 0)
            for value, size in ((top, rows), (right, columns))
        )
        self.log_odds = np.pad(self.log_odds, ((below, above), (before, behind)))
        self.south -= below * self.resolution
        self.west -= before * self.resolution

    # -- messages and files

    def fill(self, message: Any) -> None:
        """Write the grid into a ``nav_msgs/OccupancyGrid``: -1 unknown, 0 free to 100 occupied."""
        rows, columns = self.log_odds.shape
        info = message.info
        info.resolution, info.width, info.height = self.resolution, columns, rows
        info.origin.position.x, info.origin.position.y = self.west, self.south
        info.origin.orientation.w = 1.0
        known = self.log_odds != 0.0
        message.data = np.where(known, np.round(100.0 * self.probability), -1).astype(np.int8).ravel()

    def save(self, path: Path) -> tuple[Path, Path]:
        """Write ``PATH.pgm`` and ``PATH.yaml`` as map_saver does; return both."""
        picture, text = path.with_name(path.name + ".pgm"), path.with_name(path.name + ".yaml")
        shades = np.full(self.log_odds.shape, 205, dtype=np.uint8)
        shades[self.free], shades[self.occupied] = 254, 0
        rows, columns = self.log_odds.shape
        picture.write_bytes(b"P5\n%d %d\n255\n" % (columns, rows) + shades[::-1].tobytes())
        text.write_text(
            f"image: {picture.name}\nmode: trinary\nresolution: {self.resolution:g}\n"
            f"origin: [{self.west:.6g}, {self.south:.6g}, 0]\nnegate: 0\n"
            f"occupied_thresh: {OCCUPIED}\nfree_thresh: {FREE}\n",
            encoding="utf-8",
        )
        return picture, text


@numeric
def _mark(cells: NDArray[np.float32], row: int, column: int, odds: float) -> None:
    rows, columns = cells.shape
    if 0 <= row < rows and 0 <= column < columns:
        cells[row, column] = min(max(cells[row, column] + odds, -LIMIT), LIMIT)


def _compose(digest: str) -> Callable[..., int]:
    def mark_beams(
        cells: NDArray[np.float32], frame: Array, start: Array, ends: Array, met: NDArray[np.int64]
    ) -> int:
        x, y = (start[0] - frame[0]) / frame[2], (start[1] - frame[1]) / frame[2]
        for beam in range(len(ends)):
            to_x, to_y = (ends[beam, 0] - frame[0]) / frame[2], (ends[beam, 1] - frame[1]) / frame[2]
            column, row = int(np.floor(x)), int(np.floor(y))
            last_column, last_row = int(np.floor(to_x)), int(np.floor(to_y))
            step_column, step_row = (1 if to_x > x else -1), (1 if to_y > y else -1)
            wide, high = abs(to_x - x), abs(to_y - y)
            each_x = 1.0 / wide if wide > 0.0 else np.inf
            each_y = 1.0 / high if high > 0.0 else np.inf
            next_x = (column + 1 - x if step_column > 0 else x - column) * each_x if wide > 0.0 else np.inf
            next_y = (row + 1 - y if step_row > 0 else y - row) * each_y if high > 0.0 else np.inf
            for _ in range(abs(last_column - column) + abs(last_row - row)):
                _mark(cells, row, column, PASSED)
                if next_x < next_y:
                    column, next_x = column + step_column, next_x + each_x
                else:
                    row, next_y = row + step_row, next_y + each_y
            _mark(cells, last_row, last_column, MET if met[beam] == 1 else PASSED)
        return 1 if digest else 0

    return mark_beams


mark_beams = NumericCode(
    "mark_beams",
    _compose,
    (Path(__file__),),
    ("float32[:,::1]", "float64[::1]", "float64[::1]", "float64[:,::1]", "int64[::1]"),
)
"""Mark the cells that beams pass and those where they end (Amanatides and Woo, Eurographics 1987)."""
