"""Where to go to see more: frontiers between what is free and what is not known (Yamauchi, CIRA 1997)."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, find_objects, label

from volery.autonomy.grid_path import WaysFrom
from volery.base.metered_work import done

_EIGHT = np.ones((3, 3), dtype=bool)


class Frontier(NamedTuple):
    """A frontier that can be reached.

    Args:
        goal: Row and column of the cell to go to: the nearest one to its middle that a way leads to.
        cells: Number of its cells.
        cost: Cost of the way, as of ``WaysFrom``.
    """

    goal: tuple[int, int]
    cells: int
    cost: float


def edges_of(
    free: NDArray[np.bool_], occupied: NDArray[np.bool_], given_up: NDArray[np.bool_], near: int
) -> NDArray[np.bool_]:
    """Return the free cells beside what is not known: neither free nor at a wall, where cells are in doubt.

    Args:
        free: Which cells are free (rows, columns).
        occupied: Which cells are occupied.
        given_up: Goals that led to nothing: within *near* cells of them, through free ones, there is no edge.
        near: Number of cells.
    """
    done("edges", cells=free.size)
    known = free | binary_dilation(occupied, _EIGHT)
    edge: NDArray[np.bool_] = free & binary_dilation(~known, _EIGHT)
    if given_up.any():
        edge &= ~reach_of(given_up, free, near)
    return edge


def reach_of(places: NDArray[np.bool_], free: NDArray[np.bool_], near: int) -> NDArray[np.bool_]:
    """Return the cells within a number of cells of places, through free ones."""
    done("reach", cells=free.size, grown=float(near * np.count_nonzero(places)))
    reached: NDArray[np.bool_] = binary_dilation(places, _EIGHT, iterations=near, mask=free)
    return reached


def frontiers_of(
    edge: NDArray[np.bool_], free: NDArray[np.bool_], ways: WaysFrom, near: int, least: int = 8
) -> list[Frontier]:
    """Return the frontiers that can be reached, the best first: cheap to reach, and long.

    Args:
        edge: Cells of frontiers, as of ``edges_of`` (rows, columns).
        free: Which cells are free.
        ways: Ways from the vehicle; they keep their distance, so a goal is near a frontier and not on it.
        near: Number of cells up to which a goal may be away from its frontier, through free ones.
        least: Frontiers of fewer cells are gaps between beams and of no use.
    """
    numbers, count = label(edge, _EIGHT)
    found = []
    done("frontiers", cells=edge.size, edges=count)
    for number, box in enumerate(find_objects(numbers, count), 1):
        rows, columns = np.nonzero(numbers[box] == number)
        if len(rows) < least:
            continue
        grown = tuple(
            slice(max(part.start - near, 0), min(part.stop + near, size))
            for part, size in zip(box, edge.shape, strict=True)
        )
        done("frontier", cells=near * numbers[grown].size)
        reach = binary_dilation(numbers[grown] == number, _EIGHT, iterations=near, mask=free[grown])
        reach &= ways.cost[grown] < np.inf
        up, right = np.nonzero(reach)
        if not len(up):
            continue
        up, right = up + grown[0].start, right + grown[1].start
        off_up, off_right = up - (box[0].start + rows.mean()), right - (box[1].start + columns.mean())
        best = int((off_up * off_up + off_right * off_right).argmin())
        goal = int(up[best]), int(right[best])
        found.append(Frontier(goal, len(rows), float(ways.cost[goal])))
    return sorted(found, key=lambda one: one.cost / sqrt(one.cells))
