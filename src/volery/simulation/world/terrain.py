"""The ground: heights over a square grid, bilinear between the posts, level beyond the edge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from volery.base.errors import UsageError
from volery.simulation.world.columns import Array

_HALF_CURVATURE = 0.5 / 6_371_008.8  # of the earth's mean radius (IUGG) [1/m]


@dataclass(frozen=True)
class Terrain:
    """Heights in metres above the level of the world's origin (AMSL less the frame's).

    The ground follows the globe: seen from the plane that touches it at the origin it falls by d^2 / 2 R (8 m
    in 10 km), so that ground at one level has one altitude AMSL.

    ``heights[row][column]`` is the height at north ``south_edge + row * spacing`` and east ``west_edge +
    column * spacing``. One post alone is level ground everywhere.
    """

    heights: Sequence[Sequence[float]] = ((0.0,),)
    west_edge: float = 0.0
    south_edge: float = 0.0
    spacing: float = 1.0

    def __post_init__(self) -> None:
        widths = {len(row) for row in self.heights}
        if len(widths) != 1 or 0 in widths:
            raise UsageError("terrain: every row of heights needs the same number of posts, at least one")
        if self.spacing <= 0.0:
            raise UsageError(f"terrain: a spacing of {self.spacing} m between posts; give more than 0")

    def height(self, east: float, north: float) -> float:
        """Metres up of the ground at a point: its ``up`` in the world's frame."""
        heights, grid = self.arrays()
        return float(ground_height(heights, grid, east, north))

    def arrays(self) -> tuple[Array, Array]:
        """The posts and (west edge, south edge, spacing), as compiled code takes them."""
        return (
            np.array(self.heights, dtype=np.float64),
            np.array((self.west_edge, self.south_edge, self.spacing), dtype=np.float64),
        )


@njit(cache=True)
def _relief(heights: Array, grid: Array, east: float, north: float) -> float:
    """Bilinear interpolation between the four posts around a point."""
    rows, columns = heights.shape
    x = min(max((east - grid[0]) / grid[2], 0.0), columns - 1.0)
    y = min(max((north - grid[1]) / grid[2], 0.0), rows - 1.0)
    column = min(int(x), max(columns - 2, 0))
    row = min(int(y), max(rows - 2, 0))
    right = min(column + 1, columns - 1)
    above = min(row + 1, rows - 1)
    fx = x - column
    fy = y - row
    south_side = heights[row, column] * (1.0 - fx) + heights[row, right] * fx
    north_side = heights[above, column] * (1.0 - fx) + heights[above, right] * fx
    height: float = south_side * (1.0 - fy) + north_side * fy
    return height


@njit(cache=True)
def ground_height(heights: Array, grid: Array, east: float, north: float) -> float:
    """Metres up of the ground, over the plane that touches the globe at the world's origin."""
    drop = (east * east + north * north) * _HALF_CURVATURE
    if heights.size == 1:
        level: float = heights[0, 0] - drop
        return level
    return _relief(heights, grid, east, north) - drop
