from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.frontiers import frontiers_of
from volery.autonomy.grid_path import WaysFrom, clearance_of

SIDE = 0.25
Cells = NDArray[np.bool_]


def corridor() -> tuple[Cells, Cells]:
    """Return which cells are free and unknown: a corridor between walls, open to the unknown at both ends."""
    free, unknown = np.zeros((40, 60), dtype=bool), np.ones((40, 60), dtype=bool)
    free[10:31, 10:51] = True
    unknown[9:32, 9:52] = False
    unknown[10:31, [9, 51]] = True
    return free, unknown


def ways(free: Cells, start: tuple[int, int] = (20, 20), least: float = 0.6) -> WaysFrom:
    return WaysFrom(clearance_of(~free, SIDE), SIDE, start, least)


def test_the_nearer_of_two_equal_frontiers_is_the_first() -> None:
    free, unknown = corridor()
    west, east = frontiers_of(free, unknown, ways(free), near=4)
    assert (west.cells, east.cells) == (21, 21)
    assert west.cost < east.cost
    assert west.goal[1] < 20 < east.goal[1]


def test_goals_keep_the_distance_of_the_ways_from_what_is_not_known() -> None:
    free, unknown = corridor()
    from_start = ways(free)
    for frontier in frontiers_of(free, unknown, from_start, near=4):
        assert from_start.clearance[frontier.goal] >= 0.6
        assert from_start.cost[frontier.goal] == frontier.cost


def test_gaps_between_beams_are_none() -> None:
    free, unknown = corridor()
    unknown[10:31, 51] = False
    free[20, 30], unknown[20, 30] = False, True  # eight cells around it
    assert [one.cells for one in frontiers_of(free, unknown, ways(free, (15, 15)), near=4, least=9)] == [21]


def test_one_behind_a_wall_is_not_seen_through_it() -> None:
    free, unknown = corridor()
    free[:, 46] = False  # a wall
    unknown[:, 46] = False
    found = frontiers_of(free, unknown, ways(free), near=8)
    assert [one.goal[1] < 20 for one in found] == [True]


def test_where_all_is_known_there_is_none() -> None:
    free, unknown = corridor()
    assert frontiers_of(free, np.zeros_like(unknown), ways(free), near=4) == []
