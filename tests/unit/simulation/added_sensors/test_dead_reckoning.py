"""Odometry sums up moves: exact without errors, turned and stretched with them."""

from math import cos, pi, radians, sin

import numpy as np
import pytest

from rigs.walled_room import ROOM, state
from volery.base.frames import quaternion_to_euler
from volery.base.time import S
from volery.simulation.added_sensors.dead_reckoning import DeadReckoning


def reckoned(drift_deg_s, scale, ways):
    """The last sample on a way of (seconds, position)."""
    sampler = DeadReckoning("odometry", 10.0, drift_deg_s, scale).sampler(np.uint64(0), ROOM)
    for k, (seconds, position) in enumerate(ways):
        found = sampler(state(position, yaw=0.5, time=round(seconds * S), velocity=(2.0, 0.0, 0.0)), k)
    return found


CIRCLE = [(0.1 * i, (3.0 * cos(0.01 * i), 3.0 * sin(0.01 * i), 1.0)) for i in range(300)]


def test_without_errors_it_is_the_truth():
    found = reckoned(0.0, 0.0, CIRCLE)
    assert found.position == pytest.approx(CIRCLE[-1][1])
    assert quaternion_to_euler(found.attitude) == pytest.approx((0.0, 0.0, 0.5))
    assert found.velocity == pytest.approx((2.0 * cos(0.5), -2.0 * sin(0.5), 0.0))


def test_a_scale_stretches_every_way():
    found = reckoned(0.0, 0.03, [(0.0, (5.0, 0.0, 0.0)), (1.0, (15.0, 0.0, 0.0)), (2.0, (5.0, 0.0, 0.0))])
    assert found.position == pytest.approx((5.0, 0.0, 0.0))
    assert reckoned(0.0, 0.03, [(0.0, (5.0, 0.0, 0.0)), (1.0, (15.0, 0.0, 0.0))]).position[
        0
    ] == pytest.approx(15.3)
    assert found.velocity[0] == pytest.approx(1.03 * 2.0 * cos(0.5))


def test_a_drift_bends_a_straight_way():
    steps = 1000
    ways = [(60.0 * i / steps, (30.0 * i / steps, 0.0, 0.0)) for i in range(steps + 1)]
    found = reckoned(1.0, 0.0, ways)  # 60 degrees in a minute, at 0.5 m/s
    assert quaternion_to_euler(found.attitude)[2] == pytest.approx(0.5 + pi / 3)
    radius = 0.5 / radians(1.0)
    assert found.position == pytest.approx(
        (radius * sin(pi / 3), radius * (1.0 - cos(pi / 3)), 0.0), abs=0.05
    )
