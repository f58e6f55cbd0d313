"""Where to go to see more: frontiers between what is free and what is not known (Yamauchi, CIRA 1997)."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, find_objects, label

from volery.autonomy.grid_path import WaysFrom

_EIGHT = np.ones((3, 3), dtype=bool)


class Frontier(NamedTuple):
    """A frontier that can be reached.

    Args:
        goal: Row and column of the cell to go to: the cheapest one from which it is seen.
        cells: Number of its cells.
        cost: Cost of the way, as of ``WaysFrom``.
    """

    goal: tuple[int, int]
    cells: int
    cost: float


def frontiers_of(
    free: NDArray[np.bool_], unknown: NDArray[np.bool_], ways: WaysFrom, near: int, least: int = 8
) -> list[Frontier]:
    """Return the frontiers that can be reached, the best first: cheap to reach, and long.

    Args:
        free: Which cells are free (rows, columns).
        unknown: Which cells are not known.
        ways: Ways from the vehicle; they keep their distance, so a goal is near a frontier and not on it.
        near: Number of cells up to which a goal may be away from its frontier, through free ones.
        least: Frontiers of fewer cells are gaps between beams and of no use.
    """
    edge = free & binary_dilation(unknown, _EIGHT)
    numbers, count = label(edge, _EIGHT)
    found = []
    for number, box in enumerate(find_objects(numbers, count), 1):
        cells = int((numbers[box] == number).sum())
        if cells < least:
            continue
        grown = tuple(
            slice(max(part.start - near, 0), min(part.stop + near, size))
            for part, size in zip(box, edge.shape, strict=True)
        )
        reach = binary_dilation(numbers[grown] == number, _EIGHT, iterations=near, mask=free[grown])
        costs = np.where(reach, ways.cost[grown], np.inf)
        at = np.unravel_index(int(costs.argmin()), costs.shape)
        if costs[at] < np.inf:
            goal = (int(at[0]) + grown[0].start, int(at[1]) + grown[1].start)
            found.append(Frontier(goal, cells, float(costs[at])))
    return sorted(found, key=lambda one: one.cost / sqrt(one.cells))
