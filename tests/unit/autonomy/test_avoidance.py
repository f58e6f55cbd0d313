from __future__ import annotations

from math import hypot, inf

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.autonomy.avoidance import Motion, judge_candidates, safe_velocity
from volery.base.errors import UsageError

DRONE = Motion(radius=0.3, speed=5.0, acceleration=3.0)
WALL = np.stack((np.full(81, 4.0), np.linspace(-4.0, 4.0, 81)), axis=1)
STEP = 0.01


def fly(
    points: np.ndarray,
    velocity: np.ndarray,
    wanted: np.ndarray,
    motion: Motion,
    seconds: float,
    lost: int = 0,
) -> tuple[np.ndarray, np.ndarray]:
    """Return places and velocities of a vehicle as ``Motion`` states; every *lost* scan is lost."""
    delay, every = round(motion.delay / STEP), round(motion.period / STEP)
    commands, place, places, velocities = [velocity] * delay, np.zeros(2), [np.zeros(2)], [velocity]
    for tick in range(round(seconds / STEP)):
        if tick % every == 0 and not (lost and tick // every % lost == lost - 1):
            pending = [(STEP, command) for command in commands[:delay]]
            command = safe_velocity(points - place, velocity, wanted, motion, pending)
        commands.append(command)
        change = commands.pop(0) - velocity
        most = motion.acceleration * STEP
        after = velocity + change * min(1.0, most / max(hypot(*change), 1e-12))
        place, velocity = place + 0.5 * STEP * (velocity + after), after
        places.append(place)
        velocities.append(velocity)
    return np.array(places), np.array(velocities)


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(1, 60),
    speed=st.floats(0.5, 12.0),
    turn=st.floats(-3.14, 3.14),
    delay=st.floats(0.0, 0.5),
    lost=st.sampled_from((0, 2, 3)),
)
def test_what_stands_still_and_is_seen_is_never_touched(
    seed: int, count: int, speed: float, turn: float, delay: float, lost: int
) -> None:
    random = np.random.default_rng(seed)
    points = random.uniform(-8.0, 8.0, (count, 2))
    points = points[np.hypot(*points.T) > 1.0]
    motion = Motion(0.3, speed, 3.0, margin=0.1, delay=round(delay, 2), period=0.1)
    wanted = speed * np.array((np.cos(turn), np.sin(turn)))
    places, _ = fly(points, np.zeros(2), wanted, motion, 6.0, lost)
    away = np.sqrt(((places[:, None, :] - points[None]) ** 2).sum(axis=2)).min(initial=inf)
    assert away >= motion.room - 0.02  # of the steps in which the flight is computed


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), speed=st.floats(0.0, 8.0), acceleration=st.floats(2.0, 9.0))
def test_no_way_between_the_moments_looked_at_comes_nearer_than_stated(
    seed: int, speed: float, acceleration: float
) -> None:
    random = np.random.default_rng(seed)
    points, velocity = random.uniform(-6.0, 6.0, (30, 2)), np.array((speed, 0.0))
    candidates = random.uniform(-10.0, 10.0, (8, 2))
    hold = 0.3
    spare = np.zeros(8)
    judge_candidates.bind(points, candidates, np.array((0.0, 0.0, *velocity, acceleration, hold)), spare)()
    for candidate, stated in zip(candidates, spare, strict=True):
        change = candidate - velocity
        turning = min(hold, hypot(*change) / acceleration)
        times = np.linspace(0.0, hold, 400)[:, None]
        turned = np.minimum(times, turning)
        rate = acceleration * change / hypot(*change)
        now = velocity + rate * turned
        place = velocity * turned + 0.5 * rate * turned**2 + now * (times - turned)
        stop = place + now * np.hypot(*now.T)[:, None] / (2.0 * acceleration)
        line = (stop - place)[:, None]
        off = points[None] - place[:, None]
        share = np.clip((off * line).sum(axis=2) / np.maximum((line * line).sum(axis=2), 1e-12), 0.0, 1.0)
        away = np.sqrt(((off - share[..., None] * line) ** 2).sum(axis=2)).min()
        assert away >= stated - 0.002
        assert stated >= away - 0.6  # and it is not so careful that nothing is left


def test_nothing_in_the_way_is_no_reason_to_turn() -> None:
    assert safe_velocity(np.zeros((0, 2)), np.zeros(2), np.array((3.0, 4.0)), DRONE) == pytest.approx(
        (3.0, 4.0)
    )
    behind = np.array(((-3.0, 0.0),))
    assert safe_velocity(behind, np.zeros(2), np.array((3.0, 0.0)), DRONE) == pytest.approx((3.0, 0.0))


def test_the_largest_speed_is_that_from_which_it_stops_within_its_sight() -> None:
    near = Motion(0.3, 20.0, 3.0, sight=10.0)
    assert near.fastest < 20.0
    lag = near.delay + 2.0 * near.period
    assert near.fastest * lag + near.fastest**2 / 6.0 == pytest.approx(10.0 - near.room)
    got = safe_velocity(np.zeros((0, 2)), np.zeros(2), np.array((0.0, 20.0)), near)
    assert got == pytest.approx((0.0, near.fastest))


def test_it_stops_before_a_wall_and_goes_on_along_it() -> None:
    places, velocities = fly(WALL, np.zeros(2), np.array((4.0, 0.0)), DRONE, 8.0)
    assert places[:, 0].max() <= 4.0 - DRONE.room + 0.01
    assert places[:, 0].max() > 2.5
    along, _ = fly(WALL, np.zeros(2), np.array((3.0, 2.0)), DRONE, 2.0)
    assert along[-1, 1] > 1.5
    assert velocities.shape == places.shape


def test_where_it_can_only_brake_it_brakes() -> None:
    assert safe_velocity(WALL - (3.2, 0.0), np.array((3.0, 0.0)), np.array((3.0, 0.0)), DRONE).tolist() == [
        0,
        0,
    ]
    assert safe_velocity(WALL, np.zeros(2), np.zeros(2), DRONE).tolist() == [0.0, 0.0]


def test_one_that_is_too_near_leaves() -> None:
    near = WALL - (4.0 - 0.35, 0.0)  # within the margin
    got = safe_velocity(near, np.zeros(2), np.array((-2.0, 0.0)), DRONE)
    assert got[0] < 0.0
    assert safe_velocity(near, np.zeros(2), np.array((2.0, 0.0)), DRONE)[0] <= 0.0


def test_commands_that_are_pending_count() -> None:
    wanted, still = np.array((3.0, 0.0)), np.zeros(2)
    slow = Motion(0.3, 5.0, 3.0, delay=1.0)
    near = WALL - (4.0 - 1.9, 0.0)
    assert safe_velocity(near, still, wanted, slow).any()
    assert safe_velocity(near, still, wanted, slow, [(1.0, np.array((5.0, 0.0)))])[0] <= 0.0


def test_wrong_figures_are_named() -> None:
    for wrong in ({"radius": 0.0}, {"delay": -0.1}, {"acceleration": float("nan")}, {"margin": -0.1}):
        with pytest.raises(UsageError, match="above 0"):
            Motion(**{"radius": 0.3, "speed": 5.0, "acceleration": 3.0, **wrong})
