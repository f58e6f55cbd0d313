"""Paths in space over and around buildings and no-fly zones, with clearance.

The space is a grid of cells in which the distance from each prism is exact; the way is that of ``WaysFrom``,
straightened. What the grid adds to the clearance is a cell's half diagonal, so that the line between two
corners keeps the clearance everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, isfinite, sqrt

import numpy as np
import shapely

from volery.autonomy.grid_path import COMFORT, WaysFrom
from volery.autonomy.planar_pose import Array
from volery.base.errors import UsageError
from volery.model.environment import Prism

_MOST_CELLS = 20_000_000
_HALF_DIAGONAL = 0.5 * sqrt(3.0)


def path_in_space(
    prisms: Sequence[Prism],
    start: Sequence[float],
    goal: Sequence[float],
    clearance: float,
    resolution: float = 1.0,
    heights: tuple[float, float] | None = None,
) -> Array:
    """Return the corners (n, 3) of a path from start to goal: east, north, up [m]; none if there is no way.

    Args:
        prisms: What stands in the way: buildings and no-fly zones of a model's environment.
        start: East, north, up [m].
        goal: East, north, up [m].
        clearance: Distance that the path keeps from all prisms [m].
        resolution: Side of a cell [m]; gaps narrower than twice the clearance and two cells may be closed.
        heights: Lowest and highest height of the path [m]; None for from the lower of start and goal to above
            the highest prism.

    Raises:
        UsageError: Start or goal is too near to a prism or beyond the heights, the clearance is not above the
            side of a cell, or there are too many cells.
    """
    ends = np.array((start, goal), dtype=np.float64)
    if ends.shape != (2, 3) or not np.isfinite(ends).all():
        raise UsageError("a path in space needs start and goal as three finite metres each: east, north, up")
    need = clearance + _HALF_DIAGONAL * resolution
    if heights is None:
        tops = [prism.ceiling_m for prism in prisms if isfinite(prism.ceiling_m)]
        above = max((*ends[:, 2], *(top + need + 2.0 * resolution for top in tops)))
        heights = float(ends[:, 2].min()), float(above)
    if not heights[0] <= ends[:, 2].min() <= ends[:, 2].max() <= heights[1]:
        raise UsageError(
            f"start and goal at {ends[0, 2]:g} and {ends[1, 2]:g} m are not between {heights[0]:g} and "
            f"{heights[1]:g} m; give heights that hold both"
        )
    for what, place, room in (("start", ends[0], clearance), ("goal", ends[1], need)):
        _check_room(what, place, prisms, room)
    beside = need + 2.0 * resolution
    corners = np.array([ends[0, :2], ends[1, :2], *(corner for prism in prisms for corner in prism.corners)])
    low = np.append(corners.min(axis=0) - beside, heights[0])
    high = np.append(corners.max(axis=0) + beside, heights[1])
    first = -np.floor((ends[0] - low) / resolution + 1e-9).astype(np.int64)  # the start is a cell's centre
    last = np.floor((high - ends[0]) / resolution + 1e-9).astype(np.int64)
    size = last - first + 1
    if float(np.prod(size.astype(np.float64))) > _MOST_CELLS:
        raise UsageError(f"a space of {np.prod(size)} cells of {resolution:g} m; give a larger resolution")
    axes = [ends[0, axis] + resolution * np.arange(first[axis], last[axis] + 1) for axis in range(3)]
    off = np.clip(np.round((ends[1] - ends[0]) / resolution).astype(np.int64), first, last) - first
    to = tuple(int(at) for at in off[::-1])
    clearances = _clearances(prisms, axes, need + COMFORT)
    ways = WaysFrom(clearances, resolution, tuple(-first[::-1]), need, to)
    cells = ways.straightened(ways.to(to))
    if not len(cells):
        return np.zeros((0, 3))
    path = ends[0] + (cells[:, ::-1] + first) * resolution
    return np.vstack((path, ends[1])) if (path[-1] != ends[1]).any() else path


def _check_room(what: str, place: Array, prisms: Sequence[Prism], room: float) -> None:
    for prism in prisms:
        beside = shapely.distance(shapely.Polygon(prism.corners), shapely.Point(place[:2]))
        away = hypot(float(beside), max(prism.floor_m - place[2], place[2] - prism.ceiling_m, 0.0))
        if away < room:
            raise UsageError(
                f"the {what} is {away:.1f} m from {prism.name}, and the path keeps {room:.1f} m; "
                f"move the {what} or give less clearance"
            )


def _clearances(prisms: Sequence[Prism], axes: Sequence[Array], reach: float) -> Array:
    """Return the distance of each cell (layers, rows, columns) from the prisms [m], up to a reach."""
    east, north, up = axes
    found = np.full((len(up), len(north), len(east)), reach)
    for prism in prisms:
        area = shapely.Polygon(prism.corners)
        west, south, far_east, far_north = area.bounds
        columns = slice(*np.searchsorted(east, (west - reach, far_east + reach)))
        rows = slice(*np.searchsorted(north, (south - reach, far_north + reach)))
        over = np.maximum(np.maximum(prism.floor_m - up, up - prism.ceiling_m), 0.0)
        layers = np.flatnonzero(over < reach)
        if not len(layers):
            continue
        places = np.meshgrid(east[columns], north[rows])
        beside = np.asarray(shapely.distance(area, shapely.points(*places)))
        part = found[layers[0] : layers[-1] + 1, rows, columns]
        above = over[layers][:, None, None]
        away = np.sqrt(beside * beside + above * above)
        np.minimum(part, away, out=part)
    return found
