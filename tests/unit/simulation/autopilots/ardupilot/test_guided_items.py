"""NAV_GUIDED_ENABLE: a companion computer moves the vehicle within a mission, up to a limit."""

from __future__ import annotations

from math import hypot
from typing import Any

import pytest

pytestmark = pytest.mark.optional

AUTO = {"copter": 3, "rover": 10}
SPEEDS_ONLY = 0b110111000111
"""``type_mask`` of SET_POSITION_TARGET_LOCAL_NED: velocity alone."""


def hand_over(rig: Any, kind: str, *limits: float, **item: Any) -> None:
    """Begin a mission: take-off, limits, and the hand-over."""
    blank = {f"param{place}": 0.0 for place in range(1, 5)} | {"x": 0, "y": 0, "z": 0.0, "frame": 3}
    bounds = {f"param{place}": value for place, value in enumerate(limits, 1)}
    items = [
        {**blank, "command": 16},
        *([{**blank, "command": 22, "z": 5.0}] if kind == "copter" else []),
        {**blank, "command": 222, **bounds},
        {**blank, "command": 92, "param1": 1.0, **item},
    ]
    target = {"target_system": 1, "target_component": 1}
    rig.send("MISSION_COUNT", **target, count=len(items), mission_type=0)
    rig.run(0.1)
    for number, one in enumerate(items):
        rig.send("MISSION_ITEM_INT", **target, seq=number, current=0, autocontinue=1, mission_type=0, **one)
        rig.run(0.05)
    assert rig.command(176, 1, AUTO[kind]) == 0
    assert rig.command(400, 1) == 0
    rig.run_until(lambda: any("GuidedEnable" in text for text in rig.texts()), 60.0)


def north(rig: Any, speed: float) -> None:
    """Send a velocity to the north, for three seconds at least."""
    fields = dict.fromkeys(("x", "y", "z", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate"), 0.0)
    rig.send(
        "SET_POSITION_TARGET_LOCAL_NED",
        time_boot_ms=0,
        target_system=1,
        target_component=1,
        coordinate_frame=1,
        type_mask=SPEEDS_ONLY,
        vx=speed,
        **fields,
    )


def moved(rig: Any, seconds: float) -> float:
    """Distance [m] moved while velocities arrive each second."""
    start = rig.vehicle.estimate.position
    for _ in range(int(seconds)):
        north(rig, 2.0)
        rig.run(1.0)
    here = rig.vehicle.estimate.position
    return hypot(here[0] - start[0], here[1] - start[1])


def ended(rig: Any) -> bool:
    return bool(rig.vehicle.mission.complete)


@pytest.mark.parametrize("kind", ["copter", "rover"])
def test_targets_count_until_the_time_is_over(kind: str, station: Any) -> None:
    rig = station(kind, parameters={"AUTO_OPTIONS": 3} if kind == "copter" else {})
    hand_over(rig, kind, 8.0)
    begun = rig.now
    assert moved(rig, 5.0) > 4.0
    assert not ended(rig)
    rig.run_until(lambda: ended(rig), 6.0)
    assert rig.now - begun == pytest.approx(8.0, abs=0.3)
    rig.run(3.0)
    assert moved(rig, 3.0) < 1.0


def test_it_ends_at_a_distance(station: Any) -> None:
    rig = station("rover")
    hand_over(rig, "rover", 0.0, 0.0, 0.0, 4.0)
    start = rig.vehicle.estimate.position[0]
    for _ in range(10):
        north(rig, 2.0)
        rig.run(1.0)
    assert ended(rig)
    assert 4.0 < rig.vehicle.estimate.position[0] - start < 9.0


def test_a_copter_must_stay_above_the_lowest_height(station: Any) -> None:
    rig = station("copter", parameters={"AUTO_OPTIONS": 3})
    hand_over(rig, "copter", 0.0, 8.0)
    rig.run(0.5)
    assert ended(rig)


def test_a_rover_near_the_items_place_continues(station: Any) -> None:
    rig = station("rover")
    hand_over(rig, "rover", x=round(46.0 * 1e7), y=round(7.0 * 1e7))
    rig.run(0.5)
    assert ended(rig)


def test_without_limits_it_lasts(station: Any) -> None:
    rig = station("rover")
    hand_over(rig, "rover")
    rig.run(30.0)
    assert not ended(rig)


def test_zero_hands_nothing_over(station: Any) -> None:
    rig = station("rover")
    hand_over(rig, "rover", param1=0.0)
    rig.run(0.5)
    assert ended(rig)
