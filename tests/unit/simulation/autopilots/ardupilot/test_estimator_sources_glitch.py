"""A receiver whose position jumps: for ten seconds its fixes are refused, then the estimate jumps."""

from __future__ import annotations

from math import dist
from typing import Any

import pytest

ARM, MODE, TAKEOFF = 400, 176, 22
GUIDED, LOITER, BRAKE = 4, 5, 17
GLITCHING = 1 << 15
DEGREES = 0.001
FAR = 111.0
"""That many degrees of latitude in metres."""


@pytest.fixture
def hovering(station: Any) -> Any:
    """Makes a copter that hovers in LOITER at 10 m."""

    def made(**parameters: float) -> Any:
        rig = station(parameters=parameters)
        rig.run(0.5)
        assert rig.command(MODE, 1.0, GUIDED) == 0
        assert rig.command(ARM, 1.0) == 0
        assert rig.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 10.0) == 0
        rig.run(15.0)
        rig.vehicle.rc.transmitter[2] = 1500
        assert rig.command(MODE, 1.0, LOITER) == 0
        rig.run(3.0)
        return rig

    return made


def moved(rig: Any, start: Any) -> float:
    return dist(rig.flight.truth().position[:2], start[:2])


def test_a_short_glitch_changes_nothing(hovering: Any) -> None:
    rig = hovering()
    start = rig.flight.truth().position
    rig.vehicle.set_parameter("SIM_GPS_GLITCH_X", DEGREES)
    rig.run(3.0)
    assert dist(rig.vehicle.estimate.position[:2], (0.0, 0.0)) < 1.0
    assert rig.vehicle.estimate.gps.latitude == pytest.approx(46.0 + DEGREES, abs=1e-6)
    rig.vehicle.set_parameter("SIM_GPS_GLITCH_X", 0.0)
    rig.run(15.0)
    assert moved(rig, start) < 1.0
    assert [text for text in rig.texts() if "litch" in text] == [
        "GPS Glitch or Compass error",
        "Glitch cleared",
    ]


def test_after_ten_seconds_the_estimate_jumps_and_the_copter_does_not_twitch(hovering: Any) -> None:
    rig = hovering()
    start = rig.flight.truth().position
    rig.command(511, 193, 200_000.0)
    rig.vehicle.set_parameter("SIM_GPS_GLITCH_X", DEGREES)
    leans = []
    for _ in range(200):
        rig.run(0.1)
        leans.append(max(map(abs, rig.vehicle.estimate.attitude[:2])))
    north, east, _ = rig.vehicle.estimate.position
    assert north == pytest.approx(FAR, abs=1.0)
    assert abs(east) < 1.0
    assert max(leans) < 0.035
    assert moved(rig, start) < 1.0
    reports = [one.fields["flags"] for one in rig.of("EKF_STATUS_REPORT")]
    assert reports[-1] & GLITCHING
    assert not reports[0] & GLITCHING


def test_a_braking_copter_does_not_twitch_either(hovering: Any) -> None:
    rig = hovering()
    rig.command(MODE, 1.0, BRAKE)
    rig.run(1.0)
    start = rig.flight.truth().position
    rig.vehicle.set_parameter("SIM_GPS_GLITCH_Y", DEGREES)
    rig.run(20.0)
    assert rig.vehicle.estimate.position[1] > 50.0
    assert moved(rig, start) < 1.0


def test_without_a_radius_every_fix_counts(hovering: Any) -> None:
    rig = hovering(EK3_GLITCH_RAD=0.0)
    rig.vehicle.set_parameter("SIM_GPS_GLITCH_X", DEGREES)
    rig.run(2.0)
    assert rig.vehicle.estimate.position[0] > 50.0


def test_a_glitch_forbids_arming(station: Any) -> None:
    rig = station()
    rig.run(0.5)
    rig.vehicle.set_parameter("SIM_GPS_GLITCH_X", DEGREES)
    rig.run(2.0)
    rig.command(MODE, 1.0, GUIDED)
    assert rig.command(ARM, 1.0) != 0
    assert "Arm: GPS glitching" in rig.texts()
