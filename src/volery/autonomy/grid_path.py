"""Paths through a grid that keep their distance from what is in the way, in a plane or in space.

One search from the vehicle gives the way to every place, for an explorer that asks for the cheapest of many
(Dijkstra 1959, on all neighbours; near obstacles each metre costs more). With one goal it looks in its
direction first and ends there (A*: Hart, Nilsson and Raphael 1968).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from volery.autonomy.planar_pose import Array
from volery.base.errors import UsageError
from volery.base.metered_work import done, is_metered
from volery.base.numeric_code import NumericCode, numeric

Cell = tuple[int, ...]
"""Row and column; in space layer, row and column."""

COMFORT = 1.0
"""Distance [m] from obstacles below which a metre costs more, up to three times as much."""


def clearance_of(blocked: NDArray[np.bool_], resolution: float) -> Array:
    """Return the distance [m] of each cell's centre from the nearest blocked one's; infinity without one."""
    if not blocked.any():
        return np.full(blocked.shape, np.inf)
    done("clearance", cells=blocked.size)
    distances: Array = distance_transform_edt(~blocked) * resolution
    return distances


class WaysFrom:
    """The cheapest ways from one cell to all others, or to one goal.

    Args:
        clearance: Distance of each cell from what is in the way [m]: (rows, columns), in space
            (layers, rows, columns).
        resolution: Side of a cell [m].
        start: Cell to begin at. It may be nearer to an obstacle than allowed: then the way leads out.
        least: Distance that the way's cells keep [m]; between their centres it is up to 0.71 of a cell less.
        goal: The only cell of interest: costs of others are then upper bounds. None for all cells.

    Raises:
        UsageError: The distance is not above the side of a cell, so that ways might pass between two cells of
            a wall that touch at a corner.
    """

    def __init__(
        self, clearance: Array, resolution: float, start: Cell, least: float, goal: Cell | None = None
    ) -> None:
        if not least > resolution > 0.0:
            raise UsageError(
                f"a way {least:g} m from obstacles through cells of {resolution:g} m: "
                "give a distance above the side of a cell, or smaller cells"
            )
        self.start, self.least, self.resolution = start, least, resolution
        self.clearance = np.ascontiguousarray(clearance, dtype=np.float64)
        self.cost = np.full(clearance.shape, np.inf)
        """Cost of the way to each cell: metres, each near an obstacle counted up to three times."""
        self._from = np.full(clearance.shape, -1, dtype=np.int64)
        if self._holds(start):
            to = (-1, -1, -1) if goal is None or not self._holds(goal) else (0, 0, *goal)[-3:]
            where = (*(1, 1, *clearance.shape)[-3:], *(0, 0, *start)[-3:], *to)
            spread_ways.bind(
                self.clearance.reshape(-1),
                np.array((resolution, least, COMFORT)),
                np.array(where, dtype=np.int64),
                self.cost.reshape(-1),
                np.zeros(clearance.size),
                self._from.reshape(-1),
                np.zeros(clearance.size, dtype=np.int64),
                np.zeros(clearance.size, dtype=np.int64),
            )()
        if is_metered():
            done("ways", cells=clearance.size, reached=int(np.count_nonzero(self._from >= 0)))

    def _holds(self, cell: Cell) -> bool:
        return all(0 <= at < size for at, size in zip(cell, self.clearance.shape, strict=True))

    def to(self, goal: Cell) -> NDArray[np.int64]:
        """Return the cells (n, 2 or 3) of the way to a goal, the start first; none where there is no way."""
        shape = self.cost.shape
        if not self._holds(goal) or self.cost[goal] == np.inf:
            return np.zeros((0, len(shape)), dtype=np.int64)
        at, cells = int(np.ravel_multi_index(goal, shape)), []
        while at >= 0:
            cells.append(at)
            at = int(self._from.flat[at])
        done("way", cells=len(cells))
        return np.stack(np.unravel_index(cells[::-1], shape), axis=1)

    def straightened(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the corners of a way: cells between which the straight line keeps the distance, too."""
        corners, at = [0], 0
        while at < len(cells) - 1:
            near, ahead = at + 1, 2
            while at + ahead < len(cells) and self._is_open(cells[at], cells[at + ahead]):
                near, ahead = at + ahead, 2 * ahead
            far = min(at + ahead, len(cells) - 1)
            while far > near and not self._is_open(cells[at], cells[far]):
                far = near + (far - near) // 2
            at = far
            corners.append(at)
        return cells[corners] if len(cells) else cells

    def _is_open(self, one: NDArray[np.int64], other: NDArray[np.int64]) -> bool:
        """Whether the line between two cells keeps the distance, and the comfort that its ends have."""
        ends = min(self.clearance[tuple(one)], self.clearance[tuple(other)])
        if ends < self.least:
            return False
        steps = 2 * int(np.abs(other - one).max()) + 1
        done("line", cells=steps)
        line = one + (other - one) * np.linspace(0.0, 1.0, steps)[:, None]
        on_line = self.clearance[tuple(np.round(line).astype(np.int64).T)]
        return bool(on_line.min() >= max(self.least, min(COMFORT, ends)))


@numeric
def _raise_entry(
    heap: NDArray[np.int64], place: NDArray[np.int64], rank: NDArray[np.float64], at: int, cell: int
) -> None:
    """Put a cell into a heap from position *at* upwards; ``place`` is 1 + the position of each cell."""
    while at > 0:
        parent = (at - 1) // 2
        if rank[heap[parent]] <= rank[cell]:
            break
        heap[at] = heap[parent]
        place[heap[at]] = at + 1
        at = parent
    heap[at] = cell
    place[cell] = at + 1


@numeric
def _drop_first(
    heap: NDArray[np.int64], place: NDArray[np.int64], rank: NDArray[np.float64], count: int
) -> None:
    """Take the first cell out of a heap of *count* cells."""
    place[heap[0]] = 0
    cell, at = heap[count - 1], 0
    while 2 * at + 1 < count - 1:
        child = 2 * at + 1
        if child + 1 < count - 1 and rank[heap[child + 1]] < rank[heap[child]]:
            child += 1
        if rank[cell] <= rank[heap[child]]:
            break
        heap[at] = heap[child]
        place[heap[at]] = at + 1
        at = child
    if count > 1:
        heap[at] = cell
        place[cell] = at + 1


@numeric
def _ahead(layer: int, row: int, column: int, where: NDArray[np.int64]) -> float:
    """Return the least length of a way from a cell to the goal in sides of a cell; 0 without a goal."""
    if where[8] < 0:
        return 0.0
    layers, rows, columns = abs(layer - where[6]), abs(row - where[7]), abs(column - where[8])
    most = max(layers, rows, columns)
    least = min(layers, rows, columns)
    middle = layers + rows + columns - most - least
    return float(most + 0.41421356237309515 * middle + 0.31783724519578205 * least)


def _compose(digest: str) -> Callable[..., int]:
    def spread_ways(  # noqa: PLR0917  # a kernel: one loop, its arrays
        room: NDArray[np.float64],
        scales: NDArray[np.float64],
        where: NDArray[np.int64],
        cost: NDArray[np.float64],
        rank: NDArray[np.float64],
        came: NDArray[np.int64],
        heap: NDArray[np.int64],
        place: NDArray[np.int64],
    ) -> int:
        layers, rows, columns = where[0], where[1], where[2]
        resolution, least, comfort = scales[0], scales[1], scales[2]
        first = (where[3] * rows + where[4]) * columns + where[5]
        goal = (where[6] * rows + where[7]) * columns + where[8]  # below 0 without one
        cost[first] = 0.0
        heap[0], place[first], count = first, 1, 1
        while count > 0:
            at = heap[0]
            if at == goal:
                break
            _drop_first(heap, place, rank, count)
            count -= 1
            layer, row, column = at // (rows * columns), at // columns % rows, at % columns
            for up in range(max(layer - 1, 0), min(layer + 2, layers)):
                for north in range(max(row - 1, 0), min(row + 2, rows)):
                    for east in range(max(column - 1, 0), min(column + 2, columns)):
                        moved = abs(up - layer) + abs(north - row) + abs(east - column)
                        to = (up * rows + north) * columns + east
                        if moved == 0 or (room[to] < least and room[to] <= room[at]):
                            continue  # a way that begins too near may only lead away
                        length = (
                            1.0 if moved == 1 else 1.4142135623730951 if moved == 2 else 1.7320508075688772
                        )
                        further = cost[at] + resolution * length * (
                            1.0 + 2.0 * max(0.0, 1.0 - room[to] / comfort)
                        )
                        if further < cost[to]:
                            cost[to], came[to] = further, at
                            rank[to] = further + resolution * _ahead(up, north, east, where)
                            if place[to] == 0:
                                count += 1
                                _raise_entry(heap, place, rank, count - 1, to)
                            else:
                                _raise_entry(heap, place, rank, place[to] - 1, to)
        return 1 if digest else 0

    return spread_ways


spread_ways = NumericCode(
    "spread_ways",
    _compose,
    (Path(__file__),),
    ("float64[::1]", "float64[::1]", "int64[::1]", "float64[::1]", "float64[::1]", *["int64[::1]"] * 3),
)
"""Spread the cost of the cheapest ways over a grid, up to a goal if there is one."""
