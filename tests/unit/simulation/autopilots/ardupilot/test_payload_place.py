"""NAV_PAYLOAD_PLACE: the copter sinks to the ground, releases the load and climbs back."""

from __future__ import annotations

from typing import Any

import pytest

pytestmark = pytest.mark.optional

PLACE, AUTO, TAKEOFF, LAND = 94, 3, 22, 21
GRIPPER = {"GRIP_ENABLE": 1, "AUTO_OPTIONS": 3}
THERE = {"x": 460_002_000, "y": 70_000_000, "z": 10.0}


@pytest.fixture
def placing(station: Any) -> Any:
    """Makes a copter that takes off to 10 m in AUTO, places a load and lands there."""

    def made(depth: float = 0.0, there: dict[str, Any] | None = None, **parameters: float) -> Any:
        rig = station(parameters={**GRIPPER, **parameters})
        rig.run(0.5)
        item = {f"param{place}": 0.0 for place in range(1, 5)} | {"x": 0, "y": 0, "z": 0.0, "frame": 3}
        target = {"target_system": 1, "target_component": 1, "mission_type": 0}
        items = [
            {**item, "command": 16},
            {**item, "command": TAKEOFF, "z": 10.0},
            {**item, "command": PLACE, "param1": depth, **(there or {})},
            {**item, "command": LAND},
        ]
        rig.send("MISSION_COUNT", **target, count=len(items))
        rig.run(0.1)
        for number, one in enumerate(items):
            rig.send("MISSION_ITEM_INT", **target, seq=number, current=0, autocontinue=1, **one)
            rig.run(0.1)
        assert rig.command(176, 1, AUTO) == 0
        assert rig.command(400, 1) == 0
        return rig

    return made


def until(rig: Any, text: str) -> None:
    """Run until a status text begins so."""
    rig.run_until(lambda: any(one.startswith(text) for one in rig.texts()))


def test_the_load_is_released_on_the_ground_at_the_place(placing: Any) -> None:
    rig = placing(there=THERE)
    until(rig, "PayloadPlace: landed")
    assert rig.height < 0.3
    assert rig.vehicle.estimate.position[0] == pytest.approx(22.2, abs=2.0)
    until(rig, "Gripper load released")
    assert "PayloadPlace: Releasing the gripper" in rig.texts()
    assert rig.height < 0.3


def test_then_the_copter_climbs_back_and_goes_on(placing: Any) -> None:
    rig = placing()
    until(rig, "PayloadPlace: landed")
    until(rig, "Mission: 3 Land")
    assert rig.height == pytest.approx(10.0, abs=1.0)
    rig.run_until(lambda: not rig.vehicle.armed)


@pytest.mark.parametrize(("parameters", "seconds"), [({}, 0.5), ({"PLDP_DELAY": 4.0}, 4.5)])
def test_without_a_gripper_the_copter_waits_for_the_delay(
    placing: Any, parameters: dict[str, float], seconds: float
) -> None:
    rig = placing(**{"GRIP_ENABLE": 0, **parameters})
    until(rig, "PayloadPlace: landed")
    down = rig.now
    rig.run_until(lambda: not rig.vehicle.landed)
    assert rig.now - down == pytest.approx(seconds, abs=0.4)


def test_a_descent_that_is_too_deep_ends_in_the_air(placing: Any) -> None:
    rig = placing(3.0)
    until(rig, "PayloadPlace: Reached maximum descent")
    assert rig.height == pytest.approx(7.0, abs=0.7)
    until(rig, "Mission: 3 Land")
    assert not any(text.startswith("Gripper") for text in rig.texts())


def test_a_load_that_the_pilot_releases_in_the_air_ends_the_descent(placing: Any) -> None:
    rig = placing(PLDP_SPEED_DN=0.3)
    until(rig, "Mission: 2 PayloadPlace")
    rig.command(211, 1.0, 0.0)
    until(rig, "PayloadPlace: Manual release")
    assert rig.height > 5.0
    until(rig, "Mission: 3 Land")


def test_the_rate_of_descent_is_the_stated_one(placing: Any) -> None:
    rig = placing(PLDP_SPEED_DN=1.2)
    until(rig, "Mission: 2 PayloadPlace")
    rig.run(4.0)
    assert rig.vehicle.estimate.velocity[2] == pytest.approx(1.2, abs=0.2)
