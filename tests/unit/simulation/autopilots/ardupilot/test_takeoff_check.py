"""The take-off check: motors stay idle until the rotor speed that is reported is in range."""

from __future__ import annotations

from typing import Any

import pytest

ARM, STABILIZE_THROTTLE = 400, 1700
BLOCKED, SILENT = "Takeoff blocked: ESC RPM out of range", "Takeoff blocked: waiting for ESC RPM"


def raised(station: Any, **parameters: float) -> Any:
    """Arm in STABILIZE and raise the throttle for eight seconds."""
    rig = station(parameters={"ARMING_CHECK": 0, **parameters})
    rig.run(0.5)
    assert rig.command(ARM, 1.0) == 0
    for _ in range(16):
        sticks = {f"chan{channel}_raw": 0 for channel in range(1, 9)} | {"chan3_raw": STABILIZE_THROTTLE}
        rig.send("RC_CHANNELS_OVERRIDE", target_system=1, target_component=1, **sticks)
        rig.run(0.5)
    return rig


def test_a_rotor_speed_below_the_least_keeps_the_copter_down(station: Any) -> None:
    rig = raised(station, TKOFF_RPM_MIN=1000, SIM_ESC_ARM_RPM=500)
    assert rig.height < 0.1
    assert BLOCKED in rig.texts()
    rig.command(512, 11_030)
    assert rig.latest["ESC_TELEMETRY_1_TO_4"]["rpm"][0] == 500


def test_so_does_one_above_the_largest(station: Any) -> None:
    rig = raised(station, TKOFF_RPM_MIN=1, TKOFF_RPM_MAX=3, SIM_ESC_ARM_RPM=500)
    assert rig.height < 0.1
    assert BLOCKED in rig.texts()


def test_so_does_one_that_is_not_reported(station: Any) -> None:
    rig = raised(station, TKOFF_RPM_MIN=100, SIM_ESC_ARM_RPM=500, SIM_ESC_TELEM=0)
    assert rig.height < 0.1
    assert SILENT in rig.texts()


@pytest.mark.parametrize(
    "parameters",
    [{"TKOFF_RPM_MIN": 400, "SIM_ESC_ARM_RPM": 500}, {"TKOFF_RPM_MIN": 0}],
    ids=["in range", "not checked"],
)
def test_else_it_takes_off(station: Any, parameters: dict[str, float]) -> None:
    rig = raised(station, **parameters)
    assert rig.height > 3.0
    assert not any(text.startswith("Takeoff blocked") for text in rig.texts())
