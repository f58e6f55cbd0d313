"""Sets of sources: one without satellites has no position, and the origin stays what it was."""

from __future__ import annotations

from typing import Any

import pytest

from volery.simulation.autopilots.ardupilot.estimator_sources import sources_of

SET_SOURCES, ARM, REQUEST_MESSAGE, GPS_RAW_INT, AUX_FUNCTION = 42_007, 400, 512, 24, 218
ACCEPTED, DENIED, FAILED = 0, 2, 4
GUIDED, FIX_3D = 4, 3


@pytest.mark.parametrize("number", [-1.0, 0.0, 4.0, 17.0])
def test_there_are_three_sets(station: Any, number: float) -> None:
    assert station("copter").command(SET_SOURCES, number) == DENIED


def test_a_set_without_satellites_has_no_position_while_the_receiver_works_on(station: Any) -> None:
    rig = station("copter")
    rig.beat()
    rig.run(0.5)
    rig.vehicle.enter_mode(rig.vehicle.rules.modes[GUIDED])
    origin, home = rig.vehicle.estimate.origin, rig.vehicle.home
    assert rig.command(SET_SOURCES, 2) == ACCEPTED
    rig.run(0.5)
    assert not rig.vehicle.has_position
    assert rig.command(REQUEST_MESSAGE, GPS_RAW_INT) == ACCEPTED
    assert rig.latest["GPS_RAW_INT"]["fix_type"] >= FIX_3D
    assert rig.command(ARM, 1) == FAILED
    assert "Arm: Need Position Estimate" in rig.texts()
    assert rig.command(SET_SOURCES, 1) == ACCEPTED
    rig.run(0.5)
    assert (rig.vehicle.estimate.origin, rig.vehicle.home) == (origin, home)
    assert rig.command(ARM, 1) == ACCEPTED


def test_a_switch_chooses_the_set(station: Any) -> None:
    rig = station("copter")
    rig.run(0.5)
    for position, ignored in ((2, True), (0, False), (1, True)):
        assert rig.command(AUX_FUNCTION, 90, position) == ACCEPTED
        assert sources_of(rig.vehicle).ignored is ignored
