"""Outputs that follow the transmitter, and what they do when it is lost."""

from __future__ import annotations

from typing import Any

import pytest

from volery.simulation.autopilots.ardupilot.servo_outputs import outputs_of

SCALED_7 = {
    "SERVO9_FUNCTION": 146,
    "SERVO9_MIN": 1000,
    "SERVO9_TRIM": 1450,
    "SERVO9_MAX": 2000,
    "RC7_MIN": 1000,
    "RC7_MAX": 2000,
    "FS_THR_ENABLE": 1,
}


def output(rig: Any, channel: int = 9) -> int:
    rig.run(0.3)
    return int(outputs_of(rig.vehicle).servos[channel])


def test_pulses_pass_as_they_are(station: Any) -> None:
    rig = station(parameters={"SERVO5_FUNCTION": 1, "SERVO9_FUNCTION": 57})
    rig.vehicle.rc.transmitter[6] = 1234
    assert output(rig) == 1234  # function 57 is channel 7
    assert output(rig, 5) == rig.vehicle.rc[5]


@pytest.mark.parametrize(("is_reversed", "expected"), [(0, 1778), (1, 1181)])
def test_scaled_pulses_use_the_range_of_both(is_reversed: int, expected: int, station: Any) -> None:
    rig = station(parameters=SCALED_7 | {"SERVO9_REVERSED": is_reversed})
    rig.vehicle.rc.transmitter[6] = 1799
    assert output(rig) == expected


@pytest.mark.parametrize(("mask", "expected"), [(1 << 6, 1450), (0, 1778)])
def test_without_a_transmitter_they_stay_or_go_to_their_middle(
    mask: int, expected: int, station: Any
) -> None:
    rig = station(parameters=SCALED_7 | {"SERVO_RC_FS_MSK": mask})
    rig.vehicle.rc.transmitter[6] = 1799
    assert output(rig) == 1778
    rig.vehicle.rc.transmitter[2], rig.vehicle.rc.transmitter[6] = 800, 1300
    seen = {output(rig) for _ in range(6)}
    assert seen <= {1778, expected}
    assert output(rig) == expected
