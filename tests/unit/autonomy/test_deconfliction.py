from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.autonomy.deconfliction import Slot, TimedPath, deconflicted, least_distance
from volery.base.errors import UsageError
from volery.base.time import S


def path(*points: tuple[float, float, float, float]) -> TimedPath:
    """Return a path of (seconds, east, north, up)."""
    given = np.array(points)
    return TimedPath((given[:, 0] * S).astype(np.int64), given[:, 1:])


EASTWARD = path((0, 0, 0, 10), (20, 100, 0, 10))
NORTHWARD = path((0, 50, -50, 10), (20, 50, 50, 10))


def sampled(one: TimedPath, other: TimedPath) -> float:
    """Return the smallest distance at many moments."""
    times = np.linspace(min(one.times[0], other.times[0]), max(one.times[-1], other.times[-1]), 4001)
    places = [
        np.stack([np.interp(times, at.times, at.positions[:, axis]) for axis in range(3)], axis=1)
        for at in (one, other)
    ]
    return float(np.sqrt(((places[0] - places[1]) ** 2).sum(axis=1)).min())


def test_paths_that_cross_at_the_same_time_are_delayed_just_enough() -> None:
    assert least_distance(EASTWARD, NORTHWARD) == pytest.approx(0.0, abs=1e-9)
    slots = deconflicted({"one": EASTWARD, "two": NORTHWARD}, 20.0)
    assert slots["one"] == Slot(0, 0)
    assert slots["two"].level == 0
    delay = slots["two"].delay
    assert least_distance(EASTWARD, NORTHWARD.shifted(delay, 0.0)) >= 20.0
    assert least_distance(EASTWARD, NORTHWARD.shifted(delay - S, 0.0)) < 20.0


def test_a_level_is_taken_before_a_delay() -> None:
    slots = deconflicted({"one": EASTWARD, "two": NORTHWARD}, 8.0, levels=3, apart=10.0)
    assert slots == {"one": Slot(0, 0), "two": Slot(0, 1)}


def test_paths_that_keep_apart_are_left_alone() -> None:
    far = NORTHWARD.shifted(0, 60.0)
    assert deconflicted({"one": EASTWARD, "two": far}, 20.0) == {"one": Slot(0, 0), "two": Slot(0, 0)}


def test_a_vehicle_that_stands_in_the_way_is_named() -> None:
    parked = path((0, 50, 0, 10), (1, 50, 0, 10))
    with pytest.raises(UsageError, match=r"two comes within 0\.0 m of parked .* put it before parked"):
        deconflicted({"parked": parked, "two": EASTWARD}, 5.0, longest=30 * S)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_distances_are_exact_and_slots_keep_them(seed: int) -> None:
    random = np.random.default_rng(seed)
    paths = {
        f"v{number}": TimedPath(
            np.cumsum(random.integers(1, 8, 5)) * S,
            np.column_stack((random.uniform(-60, 60, (5, 2)), np.full(5, 10.0))),
        )
        for number in range(4)
    }
    exact, seen = least_distance(paths["v0"], paths["v1"]), sampled(paths["v0"], paths["v1"])
    assert seen - 1.0 <= exact <= seen + 1e-6
    slots = deconflicted(paths, 6.0, levels=8, apart=6.5)
    flown = [paths[name].shifted(slot.delay, slot.level * 6.5) for name, slot in slots.items()]
    for index, one in enumerate(flown):
        for other in flown[:index]:
            assert sampled(one, other) >= 6.0 - 1e-6


def test_wrong_input_is_named() -> None:
    with pytest.raises(UsageError, match="one: give ascending times"):
        deconflicted({"one": TimedPath(np.array([1, 1]), np.zeros((2, 3)))}, 5.0)
    with pytest.raises(UsageError, match="one: give ascending times"):
        deconflicted({"one": TimedPath(np.array([1]), np.full((1, 3), np.nan))}, 5.0)
    with pytest.raises(UsageError, match="levels that are apart"):
        deconflicted({"one": EASTWARD}, 5.0, levels=2)
