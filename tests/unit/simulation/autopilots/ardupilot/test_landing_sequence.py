"""DO_LAND_START: the nearest start of a landing is flown in AUTO_RTL, which other items end."""

from __future__ import annotations

from typing import Any

import pytest

pytestmark = pytest.mark.optional

TARGET = {"target_system": 1, "target_component": 1}
ARM, MISSION_START, LAND_START, SET_CURRENT = 400, 300, 189, 224
ACCEPTED, FAILED = 0, 4
HERE = {"x": 460_000_000, "y": 70_000_000}
NORTH, FAR_NORTH = {"x": 460_010_000, "y": 70_000_000}, {"x": 460_050_000, "y": 70_000_000}
HOME: dict[str, Any] = {"command": 16}
TAKEOFF: dict[str, Any] = {"command": 22, "z": 5.0}
WAYPOINT, LAND = 16, {"command": 21}
SEQUENCES: list[dict[str, Any]] = [
    HOME,
    TAKEOFF,
    {"command": WAYPOINT, **NORTH, "z": 5.0},
    {"command": LAND_START, **FAR_NORTH},
    {"command": WAYPOINT, **FAR_NORTH, "z": 5.0},
    {"command": LAND_START},
    {"command": WAYPOINT, **NORTH, "z": 5.0},
    LAND,
]


def upload(rig: Any, items: list[dict[str, Any]]) -> None:
    blank = {f"param{place}": 0.0 for place in range(1, 5)} | {"x": 0, "y": 0, "z": 0.0, "frame": 3}
    rig.send("MISSION_COUNT", **TARGET, count=len(items), mission_type=0)
    for number, one in enumerate(items):
        rig.run(0.1)
        fixed = {"seq": number, "current": 0, "autocontinue": 1, "mission_type": 0}
        rig.send("MISSION_ITEM_INT", **TARGET, **fixed, **{**blank, **one})
    rig.run(0.2)


def flying(station: Any, items: list[dict[str, Any]]) -> Any:
    rig = station("copter")
    rig.beat()
    upload(rig, items)
    rig.vehicle.enter_mode(rig.vehicle.rules.modes[4])
    assert rig.command(ARM, 1) == ACCEPTED
    assert rig.command(MISSION_START) == ACCEPTED
    rig.run_until(lambda: rig.vehicle.mission.current == 2)
    return rig


def test_the_nearest_start_is_flown_where_its_first_leg_is(station: Any) -> None:
    rig = flying(station, SEQUENCES)
    assert rig.command(LAND_START) == ACCEPTED
    rig.run(1.5)
    assert rig.vehicle.mode.name == "AUTO_RTL"
    assert rig.latest["HEARTBEAT"]["custom_mode"] == 27
    assert rig.vehicle.mission.current == 6
    assert "Landing sequence start" in rig.texts()


def test_an_item_before_the_sequence_goes_on_in_auto(station: Any) -> None:
    rig = flying(station, SEQUENCES)
    assert rig.command(LAND_START) == ACCEPTED
    assert rig.command(SET_CURRENT, 2) == ACCEPTED
    rig.run(0.5)
    assert rig.vehicle.mode.name == "AUTO"
    assert rig.vehicle.mission.current == 2


def test_a_mission_without_a_sequence_goes_on(station: Any) -> None:
    rig = flying(station, SEQUENCES[:3])
    assert rig.command(LAND_START) == FAILED
    assert (rig.vehicle.mode.name, rig.vehicle.mission.current) == ("AUTO", 2)
    assert any(text.startswith("Mode change to AUTO RTL failed: No landing seq") for text in rig.texts())


@pytest.mark.parametrize(("items", "mode"), [(SEQUENCES, "AUTO_RTL"), (SEQUENCES[:3], "RTL")])
def test_a_lost_station_lands_by_the_sequence_or_returns(
    station: Any, items: list[dict[str, Any]], mode: str
) -> None:
    rig = flying(station, items)
    rig.vehicle.set_parameter("FS_GCS_ENABLE", 6)
    rig.vehicle.set_parameter("FS_GCS_TIMEOUT", 0.2)
    rig.run_until(lambda: rig.vehicle.mode.name != "AUTO", within=2.0)
    assert rig.vehicle.mode.name == mode
