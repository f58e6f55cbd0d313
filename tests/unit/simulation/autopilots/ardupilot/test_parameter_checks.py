"""Parameters with which ArduPilot does not arm, and the texts that refuse them."""

from __future__ import annotations

from typing import Any

import pytest

ARM, RUN_CHECKS, SET_MODE = 400, 401, 176
LOITER = 5


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"PSC_POSXY_P": -1.0}, "Bad parameter: PSC_POSXY_P must be > 0"),
        ({"PSC_ACCZ_I": 0.0}, "Bad parameter: PSC_ACCZ_I must be > 0"),
        ({"ATC_ANG_YAW_P": 0.0}, "Bad parameter: ATC_ANG_YAW_P must be > 0"),
        ({"ATC_RAT_PIT_P": 0.0}, "Bad parameter: ATC_RAT_PIT_P must be > 0"),
        (
            {"ATC_RAT_PIT_P": -0.1, "ATC_RAT_PIT_FF": 0.1},
            "Bad parameter: ATC_RAT_PIT_P must be >= 0",
        ),
        ({"ATC_RAT_RLL_D": -0.1}, "Bad parameter: ATC_RAT_RLL_D must be >= 0"),
        ({"FS_THR_VALUE": 900.0}, "Check FS_THR_VALUE"),
        ({"RC3_MIN": 980.0}, "Check FS_THR_VALUE"),
        ({"FS_GCS_ENABLE": 2.0}, "FS_GCS_ENABLE=2 removed, see FS_OPTIONS"),
        ({"ANGLE_MAX": 999.0}, "Check ANGLE_MAX"),
        ({"ANGLE_MAX": 8001.0}, "Check ANGLE_MAX"),
        ({"ACRO_BAL_PITCH": 5.0}, "Check ACRO_BAL_ROLL/PITCH"),
        ({"PILOT_SPEED_UP": 0.0}, "Check PILOT_SPEED_UP"),
        ({"MOT_SPIN_MIN": 0.5}, "Motors: MOT_SPIN_MIN too high 0.50 > 0.3"),
        ({"MOT_SPIN_MIN": 0.1, "MOT_SPIN_ARM": 0.2}, "Motors: MOT_SPIN_ARM > MOT_SPIN_MIN"),
        ({"MOT_PWM_MIN": 2000.0}, "Motors: Check MOT_PWM_MIN and MOT_PWM_MAX"),
        ({"EK3_SRC3_YAW": 17.0}, "AHRS: Check EK3_SRC3_YAW"),
        (
            {"EK3_SRC3_YAW": 3.0, "COMPASS_USE": 0.0, "COMPASS_USE2": 0.0, "COMPASS_USE3": 0.0},
            "AHRS: EK3 sources require Compass",
        ),
    ],
)
def test_a_wrong_value_forbids_arming(parameters: dict[str, float], said: str, station: Any) -> None:
    rig = station("copter", parameters=parameters)
    assert rig.command(RUN_CHECKS) == 0
    assert rig.texts() == [f"PreArm: {said}"]
    assert rig.command(ARM, 1) == 4
    assert rig.texts()[-1] == f"Arm: {said}"


@pytest.mark.parametrize(
    "parameters",
    [
        {},
        {"ATC_RAT_PIT_P": 0.0, "ATC_RAT_PIT_FF": 0.1},
        {"EK3_SRC2_POSXY": 5.0},
        {"ARMING_CHECK": 0.0, "ANGLE_MAX": 0.0},
    ],
    ids=["stock", "feed-forward", "a source that no mode needs", "checks off"],
)
def test_these_do_not(parameters: dict[str, float], station: Any) -> None:
    rig = station("copter", parameters=parameters)
    assert rig.command(ARM, 1) == 0


@pytest.mark.parametrize(
    ("source", "value", "said"),
    [
        ("POSXY", 5.0, "Check EK3_SRC2_POSXY"),
        ("POSZ", 2.0, "EK3 sources require RangeFinder"),
        ("VELZ", 1.0, "Check EK3_SRC2_VELZ"),
    ],
)
def test_sources_of_a_position_count_in_modes_that_need_one(
    source: str, value: float, said: str, station: Any
) -> None:
    rig = station("copter", parameters={f"EK3_SRC2_{source}": value})
    assert rig.command(SET_MODE, 1, LOITER) == 0
    assert rig.command(RUN_CHECKS) == 0
    assert rig.texts()[-1] == f"PreArm: AHRS: {said}"
