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
from volery.base.metered_work import done, is_metered
from volery.base.numeric_code import NumericCode, numeric
from volery.model.map_file import UNKNOWN_SHADE, read_map

MET, PASSED, LIMIT = 0.85, -0.4, 4.0
"""Log odds that a beam adds where it ends and where it passes, and their limit."""

OCCUPIED, FREE = 0.65, 0.25
"""Probabilities from which on a cell is occupied, and up to which it is free."""

_FILE_FREE = 0.196
"""Threshold below which a cell of a file is free: that of map_saver, just below its shade of the unknown."""

MOST_CELLS = 400_000_000
"""Most cells of a grid: a square kilometre of cells of 5 cm, 1.6 GB."""

_GRAZING = 0.05
"""Least sine of the angle between a beam and the wall that its end and the next one may lie on."""

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
        done("odds", cells=self.log_odds.size)
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
        """Mark what a scan has met and passed.

        No beam clears a cell that the scan has met, nor one of a wall on which the ends of neighbouring beams
        lie: beams that meet a wall at a small angle run along it, and would wipe it out.
        """
        ends = pose.of(np.vstack((scan.points, scan.open_ends)))
        if not len(ends):
            return
        start = np.array((pose.x, pose.y))
        self.cover(np.vstack((ends, start)))
        met = self._walls(ends[: len(scan.points)] - start)
        corner, walls = np.array((self.west, self.south)), np.zeros(self.log_odds.shape, dtype=np.uint8)
        start, ends = (start - corner) / self.resolution, (ends - corner) / self.resolution
        if is_metered():
            passed = float(np.abs(np.floor(ends) - np.floor(start)).sum())
            done("beams", beams=len(ends), passed=passed, cells=self.log_odds.size)
        mark_beams.bind(self.log_odds, walls, start, np.ascontiguousarray(ends), met)()

    @staticmethod
    def _walls(beams: Array) -> NDArray[np.int64]:
        """Return for each beam that met something (n, 2) whether the next one met the same wall: 1 or 0."""
        found = np.zeros(len(beams), dtype=np.int64)
        if len(beams) > 1:
            lengths = np.sqrt((beams * beams).sum(axis=1))
            after, sides = np.roll(beams, -1, axis=0), np.roll(beams, -1, axis=0) - beams
            turned = np.abs(beams[:, 0] * after[:, 1] - beams[:, 1] * after[:, 0])
            between = turned / np.maximum(lengths * np.roll(lengths, -1), 1e-12)
            across = turned / np.maximum(lengths * np.sqrt((sides * sides).sum(axis=1)), 1e-12)
            ahead = (beams * after).sum(axis=1) > 0.0
            found[:] = ahead & (between < 1.5 * np.quantile(between, 0.1)) & (across > _GRAZING)
        return found

    def cover(self, points: Array) -> None:
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
        across, along = before + columns + behind, below + rows + above
        if across * along > MOST_CELLS:
            size = f"{across * self.resolution:.0f} x {along * self.resolution:.0f} m"
            raise UsageError(
                f"a map of {size} has more than {MOST_CELLS / 1e6:.0f} million cells of {self.resolution} m; "
                "give a larger resolution, or look whether the odometry jumps"
            )
        done("growth", cells=self.log_odds.size)
        self.log_odds = np.pad(self.log_odds, ((below, above), (before, behind)))
        self.south -= below * self.resolution
        self.west -= before * self.resolution

    # -- messages and files

    @classmethod
    def load(cls, path: Path) -> OccupancyGrid:
        """Return the grid of a map's YAML file, as map_saver writes it.

        Occupied and free cells are as certain as scans can make them; later scans correct them.

        Raises:
            UsageError: The file or its picture is not a map, or its axes are turned.
        """
        picture = read_map(path)
        west, south, yaw = picture.origin
        if yaw != 0.0:
            raise UsageError(f"{path}: its origin is turned by {yaw:g} rad; give a map with a yaw of 0")
        grid = cls(picture.resolution)
        grid.west, grid.south = west, south
        grid.log_odds = np.zeros(picture.occupied.shape, dtype=np.float32)
        grid.log_odds[picture.occupied], grid.log_odds[picture.free] = LIMIT, -LIMIT
        return grid

    def fill(self, message: Any) -> None:
        """Write the grid into a ``nav_msgs/OccupancyGrid``: -1 unknown, 0 free to 100 occupied."""
        rows, columns = self.log_odds.shape
        done("map_message", cells=self.log_odds.size)
        info = message.info
        info.resolution, info.width, info.height = self.resolution, columns, rows
        info.origin.position.x, info.origin.position.y = self.west, self.south
        info.origin.orientation.w = 1.0
        known = self.log_odds != 0.0
        message.data = np.where(known, np.round(100.0 * self.probability), -1).astype(np.int8).ravel()

    def save(self, path: Path) -> tuple[Path, Path]:
        """Write ``PATH.pgm`` and ``PATH.yaml`` as map_saver does; return both."""
        picture, text = path.with_name(path.name + ".pgm"), path.with_name(path.name + ".yaml")
        shades = np.full(self.log_odds.shape, UNKNOWN_SHADE, dtype=np.uint8)
        shades[self.free], shades[self.occupied] = 254, 0
        rows, columns = self.log_odds.shape
        picture.write_bytes(b"P5\n%d %d\n255\n" % (columns, rows) + shades[::-1].tobytes())
        text.write_text(
            f"image: {picture.name}\nmode: trinary\nresolution: {self.resolution:g}\n"
            f"origin: [{self.west:.6g}, {self.south:.6g}, 0]\nnegate: 0\n"
            f"occupied_thresh: {OCCUPIED}\nfree_thresh: {_FILE_FREE}\n",
            encoding="utf-8",
        )
        return picture, text


@numeric
def _mark(cells: NDArray[np.float32], row: int, column: int, odds: float) -> None:
    rows, columns = cells.shape
    if 0 <= row < rows and 0 <= column < columns:
        cells[row, column] = min(max(cells[row, column] + odds, -LIMIT), LIMIT)


@numeric
def _walk(  # noqa: PLR0917  # a line through a grid
    cells: NDArray[np.float32],
    walls: NDArray[np.uint8],
    x: float,
    y: float,
    to_x: float,
    to_y: float,
    is_wall: bool,
) -> None:
    """Mark the cells between two places as a wall, or as passed unless they are of a wall, but the last."""
    column, row = int(np.floor(x)), int(np.floor(y))
    last_column, last_row = int(np.floor(to_x)), int(np.floor(to_y))
    step_column, step_row = (1 if to_x > x else -1), (1 if to_y > y else -1)
    wide, high = abs(to_x - x), abs(to_y - y)
    each_x = 1.0 / wide if wide > 0.0 else np.inf
    each_y = 1.0 / high if high > 0.0 else np.inf
    next_x = (column + 1 - x if step_column > 0 else x - column) * each_x if wide > 0.0 else np.inf
    next_y = (row + 1 - y if step_row > 0 else y - row) * each_y if high > 0.0 else np.inf
    rows, columns = cells.shape
    for _ in range(abs(last_column - column) + abs(last_row - row)):
        if 0 <= row < rows and 0 <= column < columns:
            if is_wall:
                walls[row, column] = 1
            elif walls[row, column] == 0:
                _mark(cells, row, column, PASSED)
        if next_x < next_y:
            column, next_x = column + step_column, next_x + each_x
        else:
            row, next_y = row + step_row, next_y + each_y


def _compose(digest: str) -> Callable[..., int]:
    def mark_beams(
        cells: NDArray[np.float32],
        walls: NDArray[np.uint8],
        start: Array,
        ends: Array,
        met: NDArray[np.int64],
    ) -> int:
        count = len(met)
        for beam in range(count):
            at_x, at_y = ends[beam, 0], ends[beam, 1]
            walls[int(np.floor(at_y)), int(np.floor(at_x))] = 1
            after, before = (beam + 1 if beam + 1 < count else 0), (beam if beam > 0 else count) - 1
            for other, goes_on in (after, met[beam]), (before, met[before]):
                if goes_on == 1:  # to the next end, and as far on beyond the last one
                    wide, high = ends[other, 0] - at_x, ends[other, 1] - at_y
                    _walk(cells, walls, at_x - wide, at_y - high, at_x, at_y, True)
                    _walk(cells, walls, at_x, at_y, ends[other, 0], ends[other, 1], True)
        for beam in range(len(ends)):
            to_x, to_y = ends[beam, 0], ends[beam, 1]
            _walk(cells, walls, start[0], start[1], to_x, to_y, False)
            if beam < count or walls[int(np.floor(to_y)), int(np.floor(to_x))] == 0:
                _mark(cells, int(np.floor(to_y)), int(np.floor(to_x)), MET if beam < count else PASSED)
        return 1 if digest else 0

    return mark_beams


mark_beams = NumericCode(
    "mark_beams",
    _compose,
    (Path(__file__),),
    ("float32[:,::1]", "uint8[:,::1]", "float64[::1]", "float64[:,::1]", "int64[::1]"),
)
"""Mark the cells that beams pass and those where they end (Amanatides and Woo, Eurographics 1987).

Start and ends are in sides of a cell from the grid's corner, which holds them all.
"""
