"""Fewer points that look the same."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.report.digest import thin_curve, thin_track

WALKS = st.lists(st.tuples(*[st.floats(-5, 5)] * 3), min_size=1, max_size=200)


@settings(deadline=None)
@given(WALKS, st.floats(0.05, 5.0))
def test_no_point_of_a_track_is_farther_off_than_the_tolerance(
    steps: list[tuple[float, ...]], tolerance: float
) -> None:
    points = np.cumsum(np.array(steps), axis=0)
    times = np.arange(len(points)) * 0.1
    kept = thin_track(times, points, tolerance)
    again = np.column_stack([np.interp(times, times[kept], points[kept, axis]) for axis in range(3)])
    assert np.sqrt(((again - points) ** 2).sum(axis=1)).max() <= tolerance + 1e-9
    assert kept[0] == 0
    assert kept[-1] == len(points) - 1


def test_even_motion_needs_two_points_and_a_stop_two_more() -> None:
    times = np.arange(300.0)
    x = np.concatenate([np.linspace(0, 99, 100), np.full(100, 99.0), np.linspace(99, 0, 100)])
    points = np.column_stack([x, 0 * x, 0 * x])
    assert len(thin_track(times[:100], points[:100], 0.1)) == 2
    assert len(thin_track(times, points, 0.1)) <= 6


def test_nothing_and_one() -> None:
    assert len(thin_track(np.empty(0), np.empty((0, 3)), 1.0)) == 0
    assert list(thin_track(np.zeros(1), np.zeros((1, 3)), 1.0)) == [0]
    assert len(thin_curve(np.empty(0), 5)) == 0


@given(st.lists(st.floats(-100, 100), min_size=1, max_size=500), st.integers(1, 50))
def test_a_curve_keeps_its_extremes_and_its_ends(values: list[float], stretches: int) -> None:
    curve = np.array(values)
    kept = thin_curve(curve, stretches)
    assert len(kept) <= 2 * stretches + 2
    assert curve[kept].max() == curve.max()
    assert curve[kept].min() == curve.min()
    assert list(kept) == sorted(set(kept))
    assert (kept[0], kept[-1]) == (0, len(curve) - 1)


def test_what_is_not_known_is_not_drawn() -> None:
    assert list(thin_curve(np.array([np.nan, 1.0, np.nan, 2.0]), 10)) == [1, 3]
    many = np.full(1000, np.nan)
    many[500:600] = 3.0
    assert np.isfinite(many[thin_curve(many, 20)]).all()
