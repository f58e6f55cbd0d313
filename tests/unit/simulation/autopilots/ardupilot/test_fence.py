"""Limits of the fence: arming checks, the floor, and the health that SYS_STATUS states."""

from __future__ import annotations

from typing import Any

import pytest

from volery.simulation.autopilots.ardupilot.fence import fence_of

ENABLE = 207
GEOFENCE = 1 << 20
ON = {"FENCE_ENABLE": 1, "FENCE_TYPE": 7}


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ({"FENCE_TYPE": 0}, "Fences enabled, but none selected"),
        ({"FENCE_RADIUS": -1}, "Invalid FENCE_RADIUS value"),
        ({"FENCE_RADIUS": 1}, "FENCE_MARGIN is less than FENCE_RADIUS"),
        ({"FENCE_ALT_MAX": -1}, "Invalid FENCE_ALT_MAX value"),
        ({"FENCE_ALT_MIN": -101}, "Invalid FENCE_ALT_MIN value"),
        ({"FENCE_ALT_MIN": 5, "FENCE_ALT_MAX": 4}, "FENCE_ALT_MAX < FENCE_ALT_MIN"),
        ({"FENCE_ALT_MIN": 0, "FENCE_ALT_MAX": 4}, "FENCE_MARGIN too big"),
    ],
)
def test_limits_that_forbid_arming(parameters: dict[str, float], text: str, station: Any) -> None:
    rig = station(parameters=ON | parameters)
    rig.run(0.5)
    rig.command(401)
    assert [one for one in rig.texts() if one.startswith("PreArm: ")] == [f"PreArm: {text}"]


def test_without_a_fence_no_limit_forbids_arming(station: Any) -> None:
    rig = station(parameters={"FENCE_RADIUS": -1})
    rig.run(0.5)
    rig.command(401)
    assert not [one for one in rig.texts() if one.startswith("PreArm: ")]


def test_the_floor_counts_after_the_command_only(station: Any) -> None:
    rig = station(parameters={"FENCE_ENABLE": 1, "FENCE_TYPE": 15, "FENCE_ALT_MIN": 5, "FENCE_ALT_MAX": 50})
    rig.run(0.5)
    assert not fence_of(rig.vehicle).breached
    rig.command(ENABLE, 1)
    rig.run(0.5)
    assert list(fence_of(rig.vehicle).breached) == [8]
    rig.command(512, 1)
    assert not rig.latest["SYS_STATUS"]["onboard_control_sensors_health"] & GEOFENCE
    assert rig.latest["SYS_STATUS"]["onboard_control_sensors_enabled"] & GEOFENCE
    rig.command(512, 162)
    assert (rig.latest["FENCE_STATUS"]["breach_status"], rig.latest["FENCE_STATUS"]["breach_type"]) == (1, 1)


def test_an_armed_vehicle_on_the_ground_is_disarmed(station: Any) -> None:
    rig = station(parameters={"FENCE_TYPE": 8, "FENCE_ALT_MIN": 5, "FENCE_ALT_MAX": 50})
    rig.run(0.5)
    rig.command(176, 1, 4)
    assert rig.command(400, 1) == 0
    rig.command(ENABLE, 1)
    rig.run(0.3)
    assert not rig.vehicle.armed
    assert "Fence Breached" not in rig.texts()
