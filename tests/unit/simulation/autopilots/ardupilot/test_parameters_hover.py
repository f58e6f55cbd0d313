"""MOT_THST_HOVER and MOT_HOVER_LEARN: the collective at which a copter is expected to hover."""

from __future__ import annotations

from typing import Any

import pytest

ARM, MODE, TAKEOFF, REBOOT = 400, 176, 22, 246
STABILIZE, ALT_HOLD, GUIDED, LAND = 0, 2, 4, 9


def fly(rig: Any) -> None:
    """Hover for half a minute, land and disarm."""
    assert rig.command(MODE, 1.0, GUIDED) == 0
    assert rig.command(ARM, 1.0) == 0
    assert rig.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 5.0) == 0
    rig.run(30.0)
    assert rig.height == pytest.approx(5.0, abs=0.3)
    assert rig.command(MODE, 1.0, LAND) == 0
    rig.run_until(lambda: not rig.vehicle.armed)


def test_a_flight_starts_with_the_stored_hover_thrust(station: Any) -> None:
    rig = station()
    rig.run(0.5)
    assert rig.vehicle.estimate.stored_hover == pytest.approx(0.39, abs=1e-6)
    rig.vehicle.set_parameter("MOT_THST_HOVER", 0.5)
    rig.run(0.1)
    assert rig.vehicle.estimate.stored_hover == pytest.approx(0.5, abs=1e-6)
    rig.vehicle.set_parameter("WPNAV_SPEED", 900.0)
    rig.vehicle.flight.set_hover_throttle(0.3)
    rig.vehicle.set_parameter("WPNAV_SPEED", 1000.0)
    rig.run(0.1)
    assert rig.vehicle.estimate.stored_hover == pytest.approx(0.3, abs=1e-6)  # what was learnt stays
    rig.command(REBOOT, 1.0)
    rig.run(0.5)
    assert rig.vehicle.estimate.stored_hover == pytest.approx(0.5, abs=1e-6)


def test_the_middle_of_the_stick_gives_the_stored_hover_thrust(station: Any) -> None:
    """A copter that expects to hover at more than it needs climbs with the stick in the middle."""
    climbs = {}
    for hover in (0.36, 0.45):
        rig = station(parameters={"MOT_THST_HOVER": hover})
        rig.run(0.5)
        rig.command(MODE, 1.0, STABILIZE)
        assert rig.command(ARM, 1.0) == 0
        rig.vehicle.rc.transmitter[2] = 1500
        rig.run(8.0)
        climbs[hover] = -rig.vehicle.estimate.velocity[2]
    assert climbs[0.36] < 1.0
    assert climbs[0.45] > 3.0


@pytest.mark.parametrize(
    ("learning", "learns", "stores"), [(0, False, False), (1, True, False), (2, True, True)]
)
def test_hover_thrust_is_learnt_and_stored_as_the_parameter_says(
    learning: int, learns: bool, stores: bool, station: Any
) -> None:
    rig = station(parameters={"MOT_HOVER_LEARN": learning, "MOT_THST_HOVER": 0.45})
    rig.run(0.5)
    fly(rig)
    assert (rig.vehicle.estimate.stored_hover < 0.42) is learns
    assert (rig.vehicle.parameters["MOT_THST_HOVER"] < 0.42) is stores
