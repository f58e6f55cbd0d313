from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from volery.autonomy.grid_path import COMFORT, WaysFrom, clearance_of
from volery.base.errors import UsageError

SIDE = 0.25


def wall_with_gap(cells: int) -> NDArray[np.bool_]:
    """A wall across 20 m with a gap of some cells about row 40."""
    blocked = np.zeros((80, 80), dtype=bool)
    blocked[:, 40] = True
    blocked[40 - cells // 2 : 40 - cells // 2 + cells, 40] = False
    return blocked


def independent(clearance: NDArray[np.float64], start: tuple[int, ...], least: float) -> NDArray[np.float64]:
    """Return the costs of all cells by scipy's search over an explicit graph."""
    numbers = np.arange(clearance.size).reshape(clearance.shape)
    begins, ends, costs = [], [], []
    for cell in np.ndindex(clearance.shape):
        for step in np.ndindex((3,) * clearance.ndim):
            to = tuple(int(at + move - 1) for at, move in zip(cell, step, strict=True))
            inside = all(0 <= at < size for at, size in zip(to, clearance.shape, strict=True))
            if to == cell or not inside or (clearance[to] < least and clearance[to] <= clearance[cell]):
                continue
            length = SIDE * float(np.linalg.norm(np.subtract(to, cell)))
            begins.append(numbers[cell])
            ends.append(numbers[to])
            costs.append(length * (1.0 + 2.0 * max(0.0, 1.0 - clearance[to] / COMFORT)))
    graph = coo_array((costs, (begins, ends)), shape=(clearance.size, clearance.size)).tocsr()
    found: NDArray[np.float64] = dijkstra(graph, indices=numbers[start]).reshape(clearance.shape)
    return found


@pytest.mark.parametrize("shape", [(15, 22), (5, 8, 9)])
@pytest.mark.parametrize("seed", range(4))
def test_costs_are_those_of_an_independent_search(shape: tuple[int, ...], seed: int) -> None:
    blocked = np.random.default_rng(seed).random(shape) < 0.04
    clearance = clearance_of(blocked, SIDE)
    start = tuple(size // 2 for size in shape)
    ways = WaysFrom(clearance, SIDE, start, 0.3)
    assert ways.cost == pytest.approx(independent(clearance, start, 0.3), abs=1e-9)
    assert np.isfinite(ways.cost).sum() > 30


@pytest.mark.parametrize(("cells", "passes"), [(0, False), (3, False), (4, False), (7, True), (20, True)])
def test_a_way_leads_through_a_gap_that_is_wide_enough(cells: int, passes: bool) -> None:
    clearance = clearance_of(wall_with_gap(cells), SIDE)
    ways = WaysFrom(clearance, SIDE, (10, 10), 0.8)
    cells_of_way = ways.to((10, 70))
    assert (len(cells_of_way) > 0) == passes
    if passes:
        assert clearance[tuple(cells_of_way.T)].min() >= 0.8
        steps = np.abs(np.diff(cells_of_way, axis=0))
        assert steps.max() == 1
        assert tuple(cells_of_way[0]) == (10, 10)
        assert tuple(cells_of_way[-1]) == (10, 70)


def test_straight_lines_between_corners_keep_the_distance_to_a_cell() -> None:
    clearance = clearance_of(wall_with_gap(9), SIDE)
    ways = WaysFrom(clearance, SIDE, (5, 5), 0.8)
    cells = ways.to((5, 75))
    corners = ways.straightened(cells)
    assert 3 <= len(corners) < len(cells) // 3
    assert tuple(corners[0]) == (5, 5)
    assert tuple(corners[-1]) == (5, 75)
    blocked = np.argwhere(wall_with_gap(9))
    for one, other in pairwise(corners):
        line = one + (other - one) * np.linspace(0.0, 1.0, 200)[:, None]
        away = np.sqrt(((line[:, None, :] - blocked[None]) ** 2).sum(axis=2)).min() * SIDE
        assert away >= 0.8 - 0.71 * SIDE


def test_a_way_from_inside_the_margin_leads_out_and_never_nearer() -> None:
    blocked = np.zeros((60, 60), dtype=bool)
    blocked[:, 20] = True
    clearance = clearance_of(blocked, SIDE)
    way = WaysFrom(clearance, SIDE, (30, 22), 1.5).to((30, 50))
    rooms = clearance[tuple(way.T)]
    assert rooms[0] == pytest.approx(0.5)
    inside = rooms[rooms < 1.5]
    assert (np.diff(inside) > 0.0).all()
    assert not len(WaysFrom(clearance, SIDE, (30, 22), 1.5).to((30, 10)))


@pytest.mark.parametrize("shape", [(60, 80), (12, 20, 24)])
def test_with_one_goal_the_way_costs_the_same(shape: tuple[int, ...]) -> None:
    random = np.random.default_rng(4)
    for _ in range(12):
        clearance = clearance_of(random.random(shape) < 0.02, SIDE)
        start, goal = (tuple(int(at) for at in random.integers(0, shape)) for _ in range(2))
        all_ways = WaysFrom(clearance, SIDE, start, 0.3)
        ways = WaysFrom(clearance, SIDE, start, 0.3, goal)
        assert ways.cost[goal] == pytest.approx(all_ways.cost[goal], rel=1e-12)
        assert (ways.cost >= all_ways.cost - 1e-9).all()
        assert len(ways.to(goal)) == 0 or ways.to(goal)[-1].tolist() == list(goal)
        assert np.isfinite(ways.cost).sum() <= np.isfinite(all_ways.cost).sum()


def test_there_is_no_way_to_a_goal_that_is_blocked_walled_in_or_outside() -> None:
    blocked = np.zeros((60, 60), dtype=bool)
    blocked[20:41, 20] = blocked[20:41, 40] = blocked[20, 20:41] = blocked[40, 20:41] = True
    ways = WaysFrom(clearance_of(blocked, SIDE), SIDE, (5, 5), 0.4)
    for goal in ((20, 30), (30, 30), (-1, 3), (3, 60)):
        assert ways.to(goal).shape == (0, 2)
        assert ways.straightened(ways.to(goal)).shape == (0, 2)
    outside = WaysFrom(clearance_of(blocked, SIDE), SIDE, (60, 0), 0.4)
    assert not np.isfinite(outside.cost).any()


def test_a_wall_of_cells_that_touch_at_corners_is_tight() -> None:
    blocked = np.eye(40, dtype=bool)
    ways = WaysFrom(clearance_of(blocked, SIDE), SIDE, (30, 5), 0.26)
    assert not len(ways.to((5, 30)))
    with pytest.raises(UsageError, match="smaller cells"):
        WaysFrom(clearance_of(blocked, SIDE), SIDE, (30, 5), 0.25)


def test_a_million_cells_without_an_obstacle() -> None:
    clearance = clearance_of(np.zeros((1000, 1000), dtype=bool), SIDE)
    ways = WaysFrom(clearance, SIDE, (0, 0), 0.5)
    assert ways.cost[999, 999] == pytest.approx(999 * SIDE * 2**0.5)
    assert len(ways.straightened(ways.to((999, 500)))) == 2


def test_the_way_to_where_it_begins_is_one_cell() -> None:
    ways = WaysFrom(clearance_of(np.zeros((9, 9), dtype=bool), SIDE), SIDE, (4, 4), 0.5)
    assert ways.straightened(ways.to((4, 4))).tolist() == [[4, 4]]
