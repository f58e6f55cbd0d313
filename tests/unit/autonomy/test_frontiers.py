from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.frontiers import Frontier, edges_of, frontiers_of
from volery.autonomy.grid_path import WaysFrom, clearance_of

SIDE = 0.25
Cells = NDArray[np.bool_]


def corridor() -> tuple[Cells, Cells]:
    """Return which cells are free and occupied: a corridor, open at both ends."""
    free, occupied = np.zeros((40, 60), dtype=bool), np.zeros((40, 60), dtype=bool)
    free[10:31, 10:51] = True
    occupied[[9, 31], 9:52] = True
    return free, occupied


def ways(free: Cells, start: tuple[int, int] = (20, 20), least: float = 0.6) -> WaysFrom:
    return WaysFrom(clearance_of(~free, SIDE), SIDE, start, least)


def found(
    free: Cells,
    occupied: Cells,
    from_start: WaysFrom,
    near: int = 4,
    given_up: tuple[tuple[int, int], ...] = (),
) -> list[Frontier]:
    marked = np.zeros_like(free)
    for cell in given_up:
        marked[cell] = True
    return frontiers_of(edges_of(free, occupied, marked, near), free, from_start, near, least=4)


def test_the_nearer_of_two_equal_frontiers_is_the_first() -> None:
    free, occupied = corridor()
    west, east = found(free, occupied, ways(free))
    assert west.cells == east.cells
    assert 17 <= west.cells <= 21, "without the ends, which touch the walls"
    assert west.cost < east.cost
    assert west.goal[1] < 20 < east.goal[1]


def test_a_goal_is_before_the_middle_of_its_frontier_from_where_most_of_it_is_seen() -> None:
    free, occupied = corridor()
    assert [one.goal[0] for one in found(free, occupied, ways(free, (12, 20)))] == [20, 20]


def test_goals_keep_the_distance_of_the_ways_from_what_is_not_known() -> None:
    free, occupied = corridor()
    from_start = ways(free)
    for frontier in found(free, occupied, from_start):
        assert from_start.clearance[frontier.goal] >= 0.6
        assert from_start.cost[frontier.goal] == frontier.cost


def test_cells_in_doubt_beside_a_wall_are_no_frontier_but_elsewhere_they_are() -> None:
    free, occupied = corridor()
    free[[10, 30], 10:51] = False
    assert len(found(free, occupied, ways(free))) == 2
    free[18:23, 33:38] = False
    around = [one for one in found(free, occupied, ways(free)) if one.goal[1] > 22 and one.goal[1] < 45]
    assert [one.cells for one in around] == [24]


def test_gaps_between_beams_are_none() -> None:
    free, occupied = corridor()
    occupied[10:31, 51] = True
    free[20, 30] = False  # eight cells around it
    from_start, nothing = ways(free, (15, 15)), np.zeros_like(free)
    edge = edges_of(free, occupied, nothing, 4)
    assert [one.goal[1] < 15 for one in frontiers_of(edge, free, from_start, 4, least=9)] == [True]
    assert len(frontiers_of(edge, free, from_start, 4, least=8)) == 2


def test_one_behind_a_wall_is_not_seen_through_it() -> None:
    free, occupied = corridor()
    free[:, 46] = False
    occupied[:, 46] = True
    assert [one.goal[1] < 20 for one in found(free, occupied, ways(free), near=8)] == [True]


def test_what_is_near_a_place_that_led_to_nothing_is_left_and_the_rest_is_not() -> None:
    free, occupied = corridor()
    whole = found(free, occupied, ways(free))[0]
    rest = found(free, occupied, ways(free), given_up=(whole.goal,))
    assert [one for one in rest if one.goal[1] > 20] == found(free, occupied, ways(free))[1:]
    left = [one for one in rest if one.goal[1] < 20]
    assert len(left) == 2, "above and below the middle"
    assert sum(one.cells for one in left) < whole.cells


def test_where_all_is_known_there_is_none() -> None:
    free, occupied = corridor()
    occupied[9:32, [9, 51]] = True
    assert found(free, occupied, ways(free)) == []
