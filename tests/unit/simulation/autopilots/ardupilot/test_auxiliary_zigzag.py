"""ZIGZAG: lines through two points that the pilot stores by a switch."""

from __future__ import annotations

from typing import Any

import pytest

ACCEPTED, ZIGZAG = 0, 24


def in_the_air(rig: Any, mode: int, height: float = 20.0) -> None:
    rig.run(1.0)
    rig.command(176, 1, 4)
    assert rig.command(400, 1) == ACCEPTED
    assert rig.command(22, 0, 0, 0, 0, 0, 0, height) == ACCEPTED
    rig.run_until(lambda: rig.height > height - 0.5)
    rig.vehicle.rc.transmitter[2] = 1500
    assert rig.command(176, 1, mode) == ACCEPTED
    rig.run(3.0)


def test_zigzag_flies_to_the_line_of_the_stored_point(station: Any) -> None:
    rig = station(parameters={"RC8_OPTION": 61})
    sticks = rig.vehicle.rc.transmitter
    sticks[7] = 1500
    in_the_air(rig, ZIGZAG)
    sticks[7] = 1100
    rig.run(0.3)
    sticks[0] = 1700
    rig.run(6.0)
    sticks[0], sticks[7] = 1500, 1500
    rig.run(6.0)
    sticks[7] = 1900
    rig.run(0.3)
    assert rig.texts()[-2:] == ["ZigZag: point A stored", "ZigZag: point B stored"]
    far = rig.vehicle.estimate.position
    assert far[1] > 10.0
    sticks[1] = 1400  # ahead, then the switch through its middle to A
    rig.run(4.0)
    sticks[1], sticks[7] = 1500, 1500
    rig.run(5.0)
    ahead = rig.vehicle.estimate.position[0]
    sticks[7] = 1100
    rig.run(0.3)
    assert rig.texts()[-1] == "ZigZag: moving to A"
    rig.run_until(lambda: rig.texts()[-1] == "ZigZag: manual control", within=30.0)
    north, east, _ = rig.vehicle.estimate.position
    assert ahead > 2.0
    assert (north, east) == (pytest.approx(ahead, abs=1.0), pytest.approx(0.0, abs=1.0))


def test_the_pilot_ends_a_flight_to_a_line(station: Any) -> None:
    rig = station(parameters={"RC8_OPTION": 61})
    sticks = rig.vehicle.rc.transmitter
    sticks[7] = 1500
    in_the_air(rig, ZIGZAG)
    for pulse, stick in ((1100, 1700), (1900, 1500)):
        sticks[7], sticks[0] = pulse, stick
        rig.run(5.0)
        sticks[7] = 1500
        rig.run(0.3)
    sticks[7] = 1100
    rig.run(1.0)
    sticks[7] = 1500
    rig.run(8.0)
    assert rig.texts()[-1] == "ZigZag: manual control"
    assert rig.vehicle.estimate.position[1] > 3.0


@pytest.mark.parametrize(("jerk", "slowest", "fastest"), [(1.0, 4.5, 5.9), (8.0, 6.2, 8.0)])
def test_the_jerk_of_waypoints_limits_the_speed_to_a_near_line(
    station: Any, jerk: float, slowest: float, fastest: float
) -> None:
    """Some 23 m: with a jerk of 1 m/s^3 the path of ArduCopter has 5.1 m/s in its middle."""
    rig = station(parameters={"RC8_OPTION": 61, "WPNAV_JERK": jerk})
    sticks = rig.vehicle.rc.transmitter
    sticks[7] = 1500
    in_the_air(rig, ZIGZAG)
    sticks[7], sticks[0] = 1100, 1700
    rig.run_until(lambda: rig.vehicle.estimate.position[1] > 17.0, within=20.0)
    sticks[7], sticks[0] = 1500, 1500
    rig.run(6.0)
    sticks[7] = 1900
    rig.run(0.5)
    sticks[7] = 1500
    rig.run(0.5)
    sticks[7] = 1100
    speeds: list[float] = []
    for _ in range(80):
        rig.run(0.1)
        speeds.append(-rig.vehicle.estimate.velocity[1])
    assert slowest < max(speeds) < fastest
