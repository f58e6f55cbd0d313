"""BATTERY_RESET sets what the gauge reports and what failsafes and arming checks decide by."""

from __future__ import annotations

from typing import Any

import pytest

from volery.simulation.autopilots.ardupilot.battery import left_mah

ACCEPTED, DENIED = 0, 2
RESET, REQUEST_MESSAGE, BATTERY_STATUS = 42651, 512, 147
STABILIZE, RTL = 0, 6


def shown(rig: Any) -> tuple[int, int]:
    """Return the charge left [%] and the charge used [mAh] of BATTERY_STATUS."""
    assert rig.command(REQUEST_MESSAGE, BATTERY_STATUS) == ACCEPTED
    status = rig.latest["BATTERY_STATUS"]
    return status["battery_remaining"], status["current_consumed"]


def test_the_gauge_is_set_and_counts_on_while_the_battery_stays_as_it_is(station: Any) -> None:
    rig = station("copter", parameters={"BATT_CAPACITY": 4000})
    rig.run(0.5)
    drawn = rig.vehicle.estimate.battery_used_mah
    assert rig.command(RESET, 65535, 50) == ACCEPTED
    left, used = shown(rig)
    assert left in (49, 50)
    assert used == pytest.approx(2000, abs=5)
    assert rig.vehicle.estimate.battery_used_mah == pytest.approx(drawn, abs=5)
    before = left_mah(rig.vehicle)
    rig.run(5.0)
    assert left_mah(rig.vehicle) < before


@pytest.mark.parametrize(("asked", "left"), [(150.0, 4000.0), (-3.0, 0.0)])
def test_the_share_is_limited_to_a_full_and_an_empty_battery(station: Any, asked: float, left: float) -> None:
    rig = station("copter", parameters={"BATT_CAPACITY": 4000})
    assert rig.command(RESET, 1, asked) == ACCEPTED
    assert left_mah(rig.vehicle) == pytest.approx(left, abs=5)


def test_other_batteries_and_invalid_masks_change_nothing(station: Any) -> None:
    rig = station("copter", parameters={"BATT_CAPACITY": 4000})
    before = left_mah(rig.vehicle)
    assert rig.command(RESET, 2, 10) == ACCEPTED
    for mask in (-1.0, 65_536.0):
        assert rig.command(RESET, mask, 10) == DENIED
    assert left_mah(rig.vehicle) == pytest.approx(before, abs=5)


def test_the_arming_check_goes_by_the_gauge(station: Any) -> None:
    rig = station("copter", parameters={"BATT_CAPACITY": 4000, "BATT_ARM_MAH": 1000})
    rig.beat()
    rig.run(0.5)
    assert rig.command(RESET, 1, 20) == ACCEPTED
    assert rig.command(400, 1) != ACCEPTED
    assert rig.command(RESET, 1, 90) == ACCEPTED
    assert rig.command(400, 1) == ACCEPTED
