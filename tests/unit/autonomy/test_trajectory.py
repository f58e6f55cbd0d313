from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.autonomy.trajectory import Trajectory, TrajectoryLimits
from volery.base.errors import UsageError
from volery.base.time import MS

COORDINATE = st.floats(-50.0, 50.0).map(lambda value: round(value, 3))


def distance_from(points: np.ndarray, place: np.ndarray) -> float:
    sides = np.diff(points, axis=0)
    squares = np.maximum((sides * sides).sum(axis=1), 1e-12)
    share = np.clip(((place - points[:-1]) * sides).sum(axis=1) / squares, 0.0, 1.0)
    return float(np.sqrt(((points[:-1] + share[:, None] * sides - place) ** 2).sum(axis=1)).min())


@settings(max_examples=60, deadline=None)
@given(
    points=st.integers(2, 3).flatmap(
        lambda size: st.lists(st.tuples(*[COORDINATE] * size), min_size=2, max_size=7)
    ),
    speed=st.floats(0.5, 15.0),
    acceleration=st.floats(0.5, 8.0),
    deviation=st.floats(0.0, 2.0),
)
def test_limits_hold_at_every_moment(
    points: list[tuple[float, ...]], speed: float, acceleration: float, deviation: float
) -> None:
    path = np.array(points)
    way = Trajectory(path, TrajectoryLimits(speed, acceleration, deviation))
    step = max(way.duration / 400.0, 1e-3)
    times = np.arange(0.0, way.duration + 2.0 * step, step)
    places, velocities = (np.array(column) for column in zip(*map(way.at, times), strict=True))
    speeds = np.sqrt((velocities**2).sum(axis=1))
    changes = np.sqrt((np.diff(velocities, axis=0) ** 2).sum(axis=1))
    assert speeds.max() <= speed * (1.0 + 1e-9)
    assert changes.max() <= acceleration * step * (1.0 + 1e-6) + 1e-6
    moved = np.diff(places, axis=0) - 0.5 * step * (velocities[1:] + velocities[:-1])
    assert np.sqrt((moved**2).sum(axis=1)).max() <= acceleration * step * step
    assert max(distance_from(path, place) for place in places[::5]) <= deviation + 1e-6
    assert places[0] == pytest.approx(path[0])
    assert places[-1] == pytest.approx(path[-1])
    assert speeds[0] == speeds[-1] == 0.0


def test_a_straight_way_takes_the_time_of_a_trapezoid() -> None:
    way = Trajectory(np.array(((0.0, 0.0), (20.0, 0.0))), TrajectoryLimits(4.0, 2.0))
    assert way.duration == pytest.approx(2.0 + 2.0 + 12.0 / 4.0)
    assert way.at(3.0)[0] == pytest.approx((8.0, 0.0))
    short = Trajectory(np.array(((0.0, 0.0), (2.0, 0.0))), TrajectoryLimits(4.0, 2.0))
    assert short.duration == pytest.approx(2.0)


def test_a_corner_is_flown_slower_the_sharper_it_is() -> None:
    def slowest(angle: float) -> float:
        end = (20.0 + 20.0 * np.cos(angle), 20.0 * np.sin(angle))
        way = Trajectory(np.array(((0.0, 0.0), (20.0, 0.0), end)), TrajectoryLimits(5.0, 2.0))
        middle = np.linspace(0.3, 0.7, 400) * way.duration
        return float(min(np.sqrt((way.at(time)[1] ** 2).sum()) for time in middle))

    speeds = [slowest(angle) for angle in (0.0, 0.6, 1.2, 2.0, 3.0)]
    assert speeds[0] == pytest.approx(5.0)
    assert sorted(speeds, reverse=True) == speeds
    assert speeds[-1] < 0.5


def test_without_deviation_it_stops_at_the_corner() -> None:
    way = Trajectory(np.array(((0.0, 0.0), (4.0, 0.0), (4.0, 4.0))), TrajectoryLimits(5.0, 1.0, 0.0))
    assert way.duration == pytest.approx(8.0)
    assert way.at(4.0)[0] == pytest.approx((4.0, 0.0))
    assert way.at(4.0)[1] == pytest.approx((0.0, 0.0))


def test_points_that_repeat_are_one() -> None:
    twice = Trajectory(np.array(((0.0, 0.0), (0.0, 0.0), (4.0, 0.0), (4.0, 0.0))), TrajectoryLimits(5.0, 1.0))
    assert (
        twice.duration == Trajectory(np.array(((0.0, 0.0), (4.0, 0.0))), TrajectoryLimits(5.0, 1.0)).duration
    )
    nowhere = Trajectory(np.array(((1.0, 2.0, 3.0),)), TrajectoryLimits(5.0, 1.0))
    assert nowhere.duration == 0.0
    assert nowhere.at(3.0)[0] == pytest.approx((1.0, 2.0, 3.0))


def test_samples_have_times_and_include_the_end() -> None:
    way = Trajectory(np.array(((0.0, 0.0), (20.0, 0.0))), TrajectoryLimits(4.0, 2.0))
    samples = way.samples(300 * MS)
    assert [one.time for one in samples[:3]] == [0, 300 * MS, 600 * MS]
    assert samples[-1].position == pytest.approx((20.0, 0.0))
    assert samples[-1].time < way.duration * 1e9 + 300 * MS


def test_wrong_input_is_named() -> None:
    with pytest.raises(UsageError, match="above 0"):
        TrajectoryLimits(0.0, 1.0)
    with pytest.raises(UsageError, match="above 0"):
        TrajectoryLimits(1.0, float("nan"))
    with pytest.raises(UsageError, match="finite"):
        Trajectory(np.array(((0.0, np.nan), (1.0, 1.0))), TrajectoryLimits(1.0, 1.0))
    with pytest.raises(UsageError, match="at least one point"):
        Trajectory(np.zeros((0, 2)), TrajectoryLimits(1.0, 1.0))
