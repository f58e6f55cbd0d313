"""Buttons on pins: their reports and their functions."""

from __future__ import annotations

from typing import Any

import pytest

pytestmark = pytest.mark.optional

ARM = 400
ARMING, EMERGENCY_STOP = 153, 31
BUTTON = {"BTN_ENABLE": 1.0, "BTN_PIN4": 3.0}
PRESSED = 1 << 3
CHANGED = "BUTTON_CHANGE"


def press(rig: Any, mask: int) -> None:
    rig.vehicle.set_parameter("SIM_PIN_MASK", mask)
    rig.run(0.2)


def changes(rig: Any) -> list[int]:
    return [one.fields["state"] for one in rig.received if one.name == CHANGED]


def test_a_change_is_reported_each_second_for_some_time(station: Any) -> None:
    rig = station("copter", parameters={**BUTTON, "BTN_REPORT_SEND": 3.0, "SIM_PIN_MASK": 0.0})
    rig.run(2.0)
    assert changes(rig) == []
    press(rig, PRESSED)
    rig.run(9.0)
    assert changes(rig) == [PRESSED] * 3
    at_first = rig.latest[CHANGED]["last_change_ms"]
    press(rig, 0)
    assert changes(rig)[3:] == [0]
    assert rig.latest[CHANGED]["last_change_ms"] > at_first


def test_other_pins_and_disabled_buttons_are_not_read(station: Any) -> None:
    rig = station("copter", parameters={**BUTTON, "SIM_PIN_MASK": 0.0})
    rig.run(0.5)
    press(rig, 1 << 4)
    assert changes(rig) == []
    off = station("copter", parameters={"BTN_PIN4": 3.0, "SIM_PIN_MASK": 0.0})
    press(off, PRESSED)
    assert changes(off) == []


def test_a_button_arms_and_disarms(station: Any) -> None:
    rig = station("copter", parameters={**BUTTON, "SIM_PIN_MASK": 0.0})
    rig.run(0.5)
    rig.vehicle.set_parameter("BTN_FUNC4", ARMING)
    press(rig, PRESSED)
    assert rig.vehicle.armed
    press(rig, 0)
    assert not rig.vehicle.armed


@pytest.mark.parametrize(("mask", "result"), [(0, 4), (PRESSED, 0)])
def test_an_inverted_emergency_stop_counts_from_boot_on(mask: int, result: int, station: Any) -> None:
    stop = {"BTN_FUNC4": float(EMERGENCY_STOP), "BTN_OPTIONS4": 2.0}
    rig = station("rover", parameters={**BUTTON, **stop, "SIM_PIN_MASK": float(mask)})
    rig.run(0.5)
    assert rig.command(ARM, 1) == result
    assert ("Arm: Motors Emergency Stopped" in rig.texts()) == bool(result)
