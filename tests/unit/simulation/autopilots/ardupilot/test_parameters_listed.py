"""Parameters of subsystems that are switched off: found by name, listed once they are switched on."""

from __future__ import annotations

from typing import Any

import pytest

RECORDED_COUNT = 1390
GRIPPER = 7
"""Parameters that GRIP_ENABLE lists."""


def asked(rig: Any, name: str) -> Any:
    """Return the answer to PARAM_REQUEST_READ by name, or None."""
    rig.latest.pop("PARAM_VALUE", None)
    rig.send("PARAM_REQUEST_READ", target_system=1, target_component=1, param_id=name, param_index=-1)
    rig.run(0.3)
    return rig.latest.get("PARAM_VALUE")


@pytest.mark.parametrize(
    ("name", "default"),
    [
        ("RNGFND1_MAX_CM", 700.0),
        ("PLND_TYPE", 0.0),
        ("MNT1_PITCH_MIN", -90.0),
        ("GRIP_GRAB", 1900.0),
        ("BTN_PIN1", -1.0),
        ("FOLL_SYSID", 0.0),
        ("RELAY6_PIN", -1.0),
    ],
)
def test_a_parameter_of_a_subsystem_that_is_off_is_read_by_name(
    station: Any, name: str, default: float
) -> None:
    rig = station("copter", features="all")
    answer = asked(rig, name)
    assert (answer["param_value"], answer["param_count"]) == (default, RECORDED_COUNT)


def test_switching_the_gripper_on_lists_its_parameters_without_a_reboot(station: Any) -> None:
    rig = station("copter", features="all")
    rig.send(
        "PARAM_SET",
        target_system=1,
        target_component=1,
        param_id="GRIP_ENABLE",
        param_value=1.0,
        param_type=2,
    )
    rig.run(0.2)
    answer = asked(rig, "GRIP_GRAB")
    assert (answer["param_value"], answer["param_count"]) == (1900.0, RECORDED_COUNT + GRIPPER)
