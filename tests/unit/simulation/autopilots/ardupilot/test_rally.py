"""Where a vehicle returns: home, or a rally point that is nearer or prescribed."""

from __future__ import annotations

from typing import Any

import pytest

from volery.simulation.autopilots.ardupilot.rally import return_point
from volery.simulation.autopilots.onboard_mission import GLOBAL_RELATIVE, MissionItem

RALLY, RALLY_POINT, RTL_ROVER = 2, 5100, 11


def rig_with(station: Any, kind: str, north: float, height: float = 0.0, **parameters: float) -> Any:
    rig = station(kind, parameters=parameters)
    rig.beat()
    rig.run(0.5)
    latitude = rig.vehicle.home.latitude + north / 111_200.0
    point = MissionItem(
        RALLY_POINT,
        GLOBAL_RELATIVE,
        x=round(latitude * 1e7),
        y=round(rig.vehicle.home.longitude * 1e7),
        z=height,
    )
    rig.vehicle.points[RALLY] = [point]
    return rig


@pytest.mark.parametrize(
    ("north", "parameters", "used"),
    [
        (60.0, {"RALLY_INCL_HOME": 0}, True),
        (60.0, {"RALLY_INCL_HOME": 1}, False),  # the vehicle stands at home
        (400.0, {"RALLY_INCL_HOME": 0}, False),  # beyond RALLY_LIMIT_KM
        (400.0, {"RALLY_INCL_HOME": 0, "RALLY_LIMIT_KM": 0}, True),
    ],
)
def test_the_choice(north: float, parameters: dict[str, float], used: bool, station: Any) -> None:
    rig = rig_with(station, "rover", north, **parameters)
    assert (return_point(rig.vehicle) is not None) == used


def test_a_rover_returns_to_the_rally_point(station: Any) -> None:
    rig = rig_with(station, "rover", 20.0, RALLY_INCL_HOME=0)
    assert rig.command(400, 1) == 0
    assert rig.command(176, 1, RTL_ROVER) == 0
    rig.run_until(lambda: "Reached destination" in rig.texts())
    assert rig.vehicle.estimate.position[0] - rig.vehicle.home.ned[0] == pytest.approx(20.0, abs=2.5)


def test_a_copter_returns_at_the_height_of_the_rally_point(station: Any) -> None:
    rig = rig_with(station, "copter", 20.0, height=25.0, RALLY_INCL_HOME=0)
    assert rig.command(176, 1, 4) == 0
    assert rig.command(400, 1) == 0
    assert rig.command(22, 0, 0, 0, 0, 0, 0, 5.0) == 0
    rig.run_until(lambda: rig.height > 4.7)
    assert rig.command(20) == 0
    highest = 0.0

    def over_the_point() -> bool:
        nonlocal highest
        highest = max(highest, rig.height)
        return abs(rig.vehicle.estimate.position[0] - rig.vehicle.home.ned[0] - 20.0) < 1.0

    rig.run_until(over_the_point)
    assert highest == pytest.approx(25.0, abs=1.0)
