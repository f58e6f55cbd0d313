"""Commands of ArduPilot that only choose a mode or a mission item."""

from __future__ import annotations

from math import degrees
from typing import Any

ACCEPTED, DENIED, FAILED = 0, 2, 4
DO_JUMP_TAG, JUMP_TAG, VTOL_LAND = 601, 600, 85
LAND = 9


def test_the_landing_of_a_vtol_is_that_of_a_copter_and_no_command_of_a_rover(station: Any) -> None:
    rig = station("copter")
    assert rig.command(VTOL_LAND) == ACCEPTED
    assert rig.vehicle.mode.number == LAND
    assert station("rover").command(VTOL_LAND) not in (ACCEPTED, FAILED)


def test_a_jump_goes_to_the_first_item_with_its_tag(station: Any) -> None:
    rig = station("copter")
    rig.listed(JUMP_TAG, param1=7.0)
    assert rig.command(DO_JUMP_TAG, 7) == ACCEPTED
    assert rig.vehicle.mission.current == 1
    assert rig.command(DO_JUMP_TAG, 8) == FAILED


def test_a_tag_beyond_16_bits_is_denied(station: Any) -> None:
    rig = station("rover")
    assert rig.command(DO_JUMP_TAG, 65_535) == FAILED
    for tag in (65_536, -1):
        assert rig.command(DO_JUMP_TAG, tag) == DENIED


def test_a_rover_drives_to_a_point_backwards_until_its_mode_changes(station: Any) -> None:
    rig = station("rover")
    for command in ((176, 1, 15), (400, 1), (194, 1)):  # GUIDED, arm, DO_SET_REVERSE
        assert rig.command(*command) == 0
    rig.vehicle.manoeuvre.go_to((40.0, 0.0, 0.0))
    rig.run(12.0)
    assert abs(abs(degrees(rig.vehicle.estimate.attitude[2])) - 180.0) < 5.0
    assert rig.vehicle.estimate.velocity[0] > 1.0
    rig.run_until(lambda: rig.vehicle.manoeuvre.distance() < 1.0, 60.0)
    rig.run(3.0)
    assert rig.vehicle.manoeuvre.distance() < 1.0
    assert rig.command(176, 1, 4) == 0
    assert not rig.vehicle.commanded.backwards
    assert station("copter").command(194, 1) == 3
