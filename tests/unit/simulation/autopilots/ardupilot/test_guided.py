"""Targets of GUIDED: attitudes of a rover, turns of a copter."""

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


def test_a_copter_turns_beside_a_velocity_no_faster_than_the_slew_rate(station: Any) -> None:
    rig = station(parameters={"ARMING_CHECK": 0})
    rig.run(0.5)
    for number, params in ((176, (1.0, 4.0)), (400, (1.0,)), (22, (0, 0, 0, 0, 0, 0, 10.0))):
        assert rig.command(number, *params) == 0
    rig.run(15.0)
    mask = 0b0101_1100_0111
    rates = []
    for _ in range(40):
        rig.send("SET_POSITION_TARGET_LOCAL_NED", **TARGET, coordinate_frame=1, type_mask=mask, yaw_rate=-3.0)
        rig.run(0.1)
        rates.append(rig.vehicle.estimate.rates[2])
    assert sum(rates[-20:]) / 20.0 == pytest.approx(radians(-60.0), rel=0.05)
