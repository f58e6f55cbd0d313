"""What the parameters of an autopilot say about a link that is lost under RC override."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery.control.link_failsafes import BY_STICKS, describe
from volery.control.manoeuvres import Rotation
from volery.control.safety_switch import SwitchSettings
from volery.run.go import GoSettings, go
from volery.run.result import Options

COPTER = {"FS_GCS_ENABLE": 0.0, "FS_OPTIONS": 16.0, "RC_OVERRIDE_TIME": 3.0, "FS_THR_ENABLE": 1.0}
PX4 = {
    "COM_RC_IN_MODE": 3.0,
    "COM_RC_LOSS_T": 0.5,
    "NAV_RCL_ACT": 2.0,
    "NAV_DLL_ACT": 0.0,
    "COM_RCL_EXCEPT": 0.0,
}


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({}, "nothing lands it (FS_GCS_ENABLE=0, FS_OPTIONS=16); FS_GCS_ENABLE=5 with FS_OPTIONS=0 lands"),
        ({"FS_GCS_ENABLE": 5.0}, "leaves it to the transmitter's sticks"),
        ({"FS_GCS_ENABLE": 5.0, "FS_OPTIONS": 0.0}, "it lands by its failsafe"),
        ({"FS_GCS_ENABLE": 1.0, "FS_OPTIONS": 0.0}, "FS_GCS_ENABLE=5 lands where it is"),
        ({}, "lasts for 3 s, then the transmitter's sticks fly (RC_OVERRIDE_TIME=3); 1 is safer"),
        ({"RC_OVERRIDE_TIME": -1.0}, "the last command lasts for ever"),
        ({"RC_OVERRIDE_TIME": 0.0}, "RC overrides are refused"),
        ({"FS_THR_ENABLE": 0.0}, "without a transmitter, too, it does nothing (FS_THR_ENABLE=0)"),
        ({}, "state RC6_OPTION=18"),
    ],
)
def test_lines_of_a_copter(changed: dict[str, float], said: str) -> None:
    assert any(said in line for line in describe("ArduPilot", {**COPTER, **changed}, 6))


def test_a_switch_that_the_autopilot_reads_needs_no_advice() -> None:
    lines = describe("ArduPilot", {**COPTER, "RC6_OPTION": 18.0}, 6)
    assert not any("OPTION=18" in line for line in lines)
    assert not any("OPTION=18" in line for line in describe("ArduPilot", COPTER, None))


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({}, "0.5 s after the last sticks it returns home and lands (NAV_RCL_ACT=2); 3 lands where it is"),
        ({"NAV_RCL_ACT": 3.0}, "it lands (NAV_RCL_ACT=3)"),
        ({}, "a transmitter that sends may fly instead (COM_RC_IN_MODE=3"),
        ({"COM_RC_IN_MODE": 5.0}, "a transmitter that sends flies instead (COM_RC_IN_MODE=5"),
        ({"COM_RC_IN_MODE": 8.0}, "a transmitter that sends may fly instead (COM_RC_IN_MODE=8"),
        ({"COM_RC_IN_MODE": 4.0}, "the sticks of this link are ignored, as all are (COM_RC_IN_MODE=4"),
        ({}, "it does nothing (NAV_DLL_ACT=0)"),
        ({"COM_RCL_EXCEPT": 4.0}, "no effect in OFFBOARD (COM_RCL_EXCEPT=4)"),
    ],
)
def test_lines_of_px4(changed: dict[str, float], said: str) -> None:
    assert any(said in line for line in describe("PX4", {**PX4, **changed}))


def test_another_autopilot_has_no_lines() -> None:
    assert describe("Paparazzi", {}) == []


@pytest.mark.parametrize(("on", "said"), [("ardupilot", "FS_GCS_ENABLE=0"), ("px4", "NAV_RCL_ACT=2")])
def test_a_flight_by_rc_reads_them_first(tmp_path: Path, on: str, said: str) -> None:
    switch = SwitchSettings() if on == "ardupilot" else None
    lines: list[str] = []

    def collect(event: object) -> None:
        lines.append(getattr(event, "text", ""))

    url = f"sim:{on}?start=warm"
    go(
        lambda: Rotation([0.0], 1.0),
        url,
        GoSettings(by="rc", switch=switch),
        Options(out=tmp_path),
        listener=collect,
    )
    assert any(line.startswith(BY_STICKS) and said in line for line in lines)
