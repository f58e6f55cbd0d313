"""Attitude targets of a rover in GUIDED."""

from __future__ import annotations

from math import cos, degrees, hypot, radians, sin
from typing import Any

import pytest

TARGET = {"target_system": 1, "target_component": 1}
GUIDED_ROVER = 15


def test_a_rover_follows_an_attitude_target(station: Any) -> None:
    rig = station("rover")
    rig.beat()
    rig.run(0.5)
    assert rig.command(176, 1, GUIDED_ROVER) == 0
    assert rig.command(400, 1) == 0
    q = (cos(radians(35.0)), 0.0, 0.0, sin(radians(35.0)))
    for _ in range(80):
        rig.send("SET_ATTITUDE_TARGET", **TARGET, type_mask=0b111, q=q, body_yaw_rate=0.0, thrust=0.5)
        rig.run(0.1)
    north, east, _ = rig.vehicle.estimate.velocity
    assert degrees(rig.vehicle.estimate.attitude[2]) == pytest.approx(70.0, abs=3.0)
    assert hypot(north, east) == pytest.approx(0.5 * rig.vehicle.tuning.speed, rel=0.1)
    for _ in range(20):
        rig.send("SET_ATTITUDE_TARGET", **TARGET, type_mask=0b1000_0011, q=q, body_yaw_rate=0.3, thrust=0.5)
        rig.run(0.1)
    assert rig.vehicle.estimate.rates[2] == pytest.approx(0.3, abs=0.06)
