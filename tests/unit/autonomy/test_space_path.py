from __future__ import annotations

from itertools import pairwise
from math import inf

import numpy as np
import pytest
import shapely

from volery.autonomy.space_path import path_in_space
from volery.base.errors import UsageError
from volery.model.environment import Prism


def box(name: str, *bounds: float, ceiling: float = inf, floor: float = 0.0) -> Prism:
    west, south, east, north = bounds
    return Prism(name, ((west, south), (east, south), (east, north), (west, north)), floor, ceiling)


def length(path: np.ndarray) -> float:
    return float(np.sqrt((np.diff(path, axis=0) ** 2).sum(axis=1)).sum())


def nearest(path: np.ndarray, prisms: list[Prism]) -> float:
    """Return the distance of many points of a path from the prisms."""
    share = np.linspace(0.0, 1.0, 200)[:, None]
    places = np.vstack([one + share * (other - one) for one, other in pairwise(path)])
    found = inf
    for prism in prisms:
        beside = shapely.distance(shapely.Polygon(prism.corners), shapely.points(places[:, :2]))
        over = np.maximum(np.maximum(prism.floor_m - places[:, 2], places[:, 2] - prism.ceiling_m), 0.0)
        found = min(found, float(np.hypot(beside, over).min()))
    return found


def test_without_prisms_it_is_straight() -> None:
    path = path_in_space([], (0.0, 0.0, 10.0), (30.5, 20.2, 15.1), 2.0)
    assert path[0] == pytest.approx((0.0, 0.0, 10.0))
    assert path[-1] == pytest.approx((30.5, 20.2, 15.1))
    assert length(path) < 1.02 * np.linalg.norm((30.5, 20.2, 5.1))


def test_it_goes_over_what_is_low_and_around_what_is_high() -> None:
    low = [box("wall", 20.0, -60.0, 24.0, 60.0, ceiling=15.0)]
    over = path_in_space(low, (0.0, 0.0, 5.0), (45.0, 0.0, 5.0), 3.0)
    assert over[:, 2].max() >= 18.0
    assert np.abs(over[:, 1]).max() < 10.0
    assert nearest(over, low) >= 3.0
    high = [box("tower", 15.0, -10.0, 30.0, 12.0)]
    around = path_in_space(high, (0.0, 0.0, 5.0), (45.0, 0.0, 5.0), 3.0)
    assert np.abs(around[:, 1]).max() >= 12.9
    assert nearest(around, high) >= 3.0
    assert length(around) < 60.0


def test_it_passes_below_what_hangs_above() -> None:
    bridge = [box("bridge", 20.0, -40.0, 24.0, 40.0, ceiling=50.0, floor=20.0)]
    below = path_in_space(bridge, (0.0, 0.0, 5.0), (45.0, 0.0, 5.0), 3.0)
    assert below[:, 2].max() < 10.0


@pytest.mark.parametrize("seed", range(3))
def test_a_city_keeps_its_clearance(seed: int) -> None:
    random = np.random.default_rng(seed)
    city = []
    for index in range(25):
        west, south = random.uniform(10.0, 80.0), random.uniform(-40.0, 40.0)
        turn, size = random.uniform(0.0, 3.0), random.uniform(4.0, 14.0)
        corners = tuple(
            (west + size * np.cos(turn + at), south + size * np.sin(turn + at)) for at in (0.0, 1.5, 3.0, 4.5)
        )
        city.append(Prism(f"b{index}", corners, 0.0, random.uniform(8.0, 60.0)))
    path = path_in_space(city, (-15.0, 0.0, 5.0), (110.0, 0.0, 5.0), 2.5, resolution=2.0)
    assert len(path) > 2
    assert nearest(path, city) >= 2.5
    assert length(path) < 1.6 * 125.0


def test_there_is_none_through_a_closed_wall() -> None:
    ring = [
        box("west", -20.0, -20.0, -16.0, 20.0), box("east", 16.0, -20.0, 20.0, 20.0),
        box("south", -20.0, -20.0, 20.0, -16.0), box("north", -20.0, 16.0, 20.0, 20.0),
    ]  # fmt: skip
    assert path_in_space(ring, (0.0, 0.0, 5.0), (40.0, 0.0, 5.0), 2.0).shape == (0, 3)


def test_wrong_input_is_named() -> None:
    tower = [box("tower", 15.0, -10.0, 30.0, 12.0)]
    with pytest.raises(UsageError, match=r"the start is 1\.0 m from tower"):
        path_in_space(tower, (14.0, 0.0, 5.0), (50.0, 0.0, 5.0), 3.0)
    with pytest.raises(UsageError, match=r"the goal is 0\.0 m from tower"):
        path_in_space(tower, (0.0, 0.0, 5.0), (20.0, 0.0, 5.0), 3.0)
    with pytest.raises(UsageError, match="finite"):
        path_in_space(tower, (0.0, np.nan, 5.0), (20.0, 0.0, 5.0), 3.0)
    with pytest.raises(UsageError, match="heights"):
        path_in_space(tower, (0.0, 0.0, 5.0), (50.0, 0.0, 5.0), 3.0, heights=(10.0, 30.0))
    with pytest.raises(UsageError, match="larger resolution"):
        path_in_space([], (0.0, 0.0, 5.0), (50_000.0, 50_000.0, 5.0), 3.0)
    with pytest.raises(UsageError, match="smaller cells"):
        path_in_space([], (0.0, 0.0, 5.0), (5.0, 0.0, 5.0), 0.1)
