"""Failsafes of the battery by a voltage that SIM_BATT_VOLTAGE sets, and what they take precedence over."""

from __future__ import annotations

from typing import Any

import pytest

TARGET = {"target_system": 1, "target_component": 1}
ARM, TAKEOFF, REQUEST_MESSAGE, BATTERY_STATUS = 400, 22, 512, 147
OK, LOW, CRITICAL = 1, 2, 3
LEVELS = {"BATT_LOW_VOLT": 11.5, "BATT_CRT_VOLT": 10.1, "BATT_LOW_TIMER": 1}


def set_voltage(rig: Any, volts: float) -> None:
    rig.send("PARAM_SET", **TARGET, param_id="SIM_BATT_VOLTAGE", param_value=volts, param_type=9)
    rig.run(0.1)


def status(rig: Any) -> dict[str, Any]:
    rig.command(REQUEST_MESSAGE, BATTERY_STATUS)
    fields: dict[str, Any] = rig.latest["BATTERY_STATUS"]
    return fields


def test_a_lower_voltage_reaches_the_levels_one_after_the_other(station: Any) -> None:
    rig = station("rover", parameters=LEVELS)
    rig.run(0.5)
    assert status(rig)["voltages"][0] == pytest.approx(12_600, abs=30)
    assert status(rig)["charge_state"] == OK
    set_voltage(rig, 11.4)
    rig.run(2.0)
    assert status(rig)["voltages"][0] == pytest.approx(11_400, abs=30)
    assert status(rig)["charge_state"] == LOW
    set_voltage(rig, 10.0)
    rig.run(2.0)
    assert status(rig)["charge_state"] == CRITICAL


def test_a_battery_that_is_not_a_number_or_negative_gives_no_voltage(station: Any) -> None:
    rig = station("rover")
    for volts in (-3.0, float("nan")):
        set_voltage(rig, volts)
        rig.run(0.3)
        assert 0 <= status(rig)["voltages"][0] <= 65_535


def test_a_lost_transmitter_does_not_end_the_landing_that_the_battery_demands(station: Any) -> None:
    rig = station("copter", parameters={**LEVELS, "BATT_FS_CRT_ACT": 1, "FS_THR_ENABLE": 1})
    rig.beat()
    rig.run(0.5)
    rig.vehicle.enter_mode(rig.vehicle.rules.modes[4])
    assert rig.command(ARM, 1) == 0
    assert rig.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 15.0) == 0
    rig.run(10.0)
    set_voltage(rig, 10.0)
    rig.run(2.0)
    assert rig.vehicle.mode.name == "LAND"
    rig.send("PARAM_SET", **TARGET, param_id="SIM_RC_FAIL", param_value=1, param_type=9)
    rig.run(1.0)
    assert rig.vehicle.mode.name == "LAND"
    assert any("Radio + Battery Failsafe - Continuing Landing" in text for text in rig.texts())
