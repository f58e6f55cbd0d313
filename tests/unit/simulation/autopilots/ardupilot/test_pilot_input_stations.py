"""Who may command: SYSID_ENFORCE, a switch that denies overrides, the mode switch after a boot."""

from __future__ import annotations

from typing import Any

import pytest

TARGET = {"target_system": 1, "target_component": 1}


def test_with_sysid_enforce_another_system_cannot_arm(station: Any) -> None:
    rig = station("rover", parameters={"SYSID_ENFORCE": 1})
    rig.beat()
    rig.run(0.5)
    arm = {f"param{place}": float(place == 1) for place in range(1, 8)}
    rig.send("COMMAND_LONG", system=72, **TARGET, command=400, **arm)
    rig.run(0.1)
    assert not rig.vehicle.armed
    assert not rig.of("COMMAND_ACK")
    assert rig.command(400, 1) == 0


def overridden(rig: Any, pulse: int) -> int:
    """Override the throttle and return its pulse width."""
    sticks = {f"chan{channel}_raw": 65_535 for channel in range(1, 9)}
    rig.send("RC_CHANNELS_OVERRIDE", **TARGET, **{**sticks, "chan3_raw": pulse})
    rig.run(0.2)
    return int(rig.vehicle.rc[3])


def test_a_switch_denies_the_sticks_of_the_station(station: Any) -> None:
    rig = station("rover", parameters={"RC12_OPTION": 46})
    rig.vehicle.rc.transmitter[11] = 1500
    rig.run(0.5)
    assert overridden(rig, 1700) == 1700  # admitted until the switch says otherwise
    rig.vehicle.rc.transmitter[11] = 1000
    rig.run(0.3)
    assert rig.vehicle.rc[3] == 1500
    assert overridden(rig, 1700) == 1500
    rig.vehicle.rc.transmitter[11] = 2000
    rig.run(0.3)
    assert overridden(rig, 1700) == 1700


@pytest.mark.parametrize(("kind", "channel", "mode"), [("copter", 5, 6), ("rover", 8, 11)])
def test_after_a_boot_the_mode_switch_counts_once_there_is_a_transmitter(
    kind: str, channel: int, mode: int, station: Any
) -> None:
    initial = {"INITIAL_MODE": 9 if kind == "copter" else 4}
    rig = station(kind, warm=False, parameters={**initial, "SIM_RC_FAIL": 1})
    rig.vehicle.rc.transmitter[channel - 1] = 1400
    rig.run(10.0)
    assert rig.vehicle.mode.number == initial["INITIAL_MODE"]
    rig.vehicle.set_parameter("SIM_RC_FAIL", 0.0)
    rig.run(1.0)
    assert rig.vehicle.mode.number == mode


def test_without_a_receiver_a_copter_lands_by_its_failsafe(station: Any) -> None:
    rig = station()
    rig.run(1.0)
    rig.command(176, 1, 4)
    assert rig.command(400, 1) == 0
    assert rig.command(22, 0, 0, 0, 0, 0, 0, 10.0) == 0
    rig.run_until(lambda: rig.height > 9.5)
    rig.vehicle.set_parameter("GPS_TYPE", 0.0)
    rig.run_until(lambda: rig.vehicle.mode.name == "LAND", within=30.0)
    rig.vehicle.set_parameter("GPS_TYPE", 1.0)
    rig.run_until(lambda: rig.vehicle.has_position, within=30.0)
