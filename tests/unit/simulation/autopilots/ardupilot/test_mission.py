"""Missions of a copter: delays until a time of day."""

from __future__ import annotations

from typing import Any

import pytest

DELAY, SYSTEM_TIME = 93, "SYSTEM_TIME"


def time_of_day(rig: Any) -> tuple[int, int, float]:
    """Hour, minute and second of UTC that telemetry states."""
    rig.command(512, 2)
    rig.run(0.2)
    seconds = rig.latest[SYSTEM_TIME]["time_unix_usec"] / 1e6 % 86_400
    return int(seconds // 3600), int(seconds // 60 % 60), seconds % 60


@pytest.mark.parametrize(
    ("hour", "minute", "ahead", "expected"),
    [(True, True, 20, 20), (False, True, 20, 20), (False, False, 20, 20), (True, True, -20, 86_380)],
)
def test_a_delay_ends_at_a_time_of_day(
    hour: bool, minute: bool, ahead: int, expected: float, station: Any
) -> None:
    rig = station(parameters={"AUTO_OPTIONS": 3, "DISARM_DELAY": 0})
    rig.run(1.0)
    now_hour, now_minute, now_second = time_of_day(rig)
    of_day = (now_hour * 3600 + now_minute * 60 + now_second + ahead) % 86_400
    wanted = (of_day // 3600 if hour else -1, of_day // 60 % 60 if minute else -1, of_day % 60)
    rig.listed(DELAY, param2=wanted[0], param3=wanted[1], param4=wanted[2])
    rig.command(176, 1, 3)
    assert rig.command(400, 1) == 0
    start = rig.now
    rig.run(4.0)
    text = next(text for text in rig.texts() if text.startswith("Delaying"))
    assert int(text.split()[1]) == pytest.approx(expected, abs=4.0)
    if ahead > 0:
        rig.run_until(lambda: any("Reached command #1" in text for text in rig.texts()))
        assert rig.now - start == pytest.approx(ahead, abs=3.0)


def test_a_waypoint_where_the_copter_is_takes_a_moment(station: Any) -> None:
    rig = station(parameters={"AUTO_OPTIONS": 3})
    rig.run(0.5)
    item = {f"param{place}": 0.0 for place in range(1, 5)} | {"x": 460_000_000, "y": 70_000_000, "frame": 3}
    target = {"target_system": 1, "target_component": 1, "mission_type": 0}
    items = [
        {**item, "command": 16, "z": 0.0},
        {**item, "command": 22, "z": 10.0},
        {**item, "command": 16, "z": 10.0},
        {**item, "command": 16, "x": 460_010_000, "z": 10.0},
    ]
    rig.send("MISSION_COUNT", **target, count=len(items))
    rig.run(0.1)
    for number, one in enumerate(items):
        rig.send("MISSION_ITEM_INT", **target, seq=number, current=0, autocontinue=1, **one)
        rig.run(0.1)
    rig.command(176, 1, 3)
    assert rig.command(400, 1) == 0
    rig.run_until(lambda: "Mission: 2 WP" in rig.texts())
    begun = rig.now
    rig.run_until(lambda: "Mission: 3 WP" in rig.texts())
    assert 0.5 < rig.now - begun < 3.0
