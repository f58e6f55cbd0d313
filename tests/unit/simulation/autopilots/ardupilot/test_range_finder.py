"""A range finder below: landings go by it, and LOITER follows the ground."""

from __future__ import annotations

from typing import Any

import pytest

from rigs import station as rigs_station
from volery.simulation.autopilots.flight_stack.flight import make_world
from volery.simulation.world.environment_models import Terrain
from volery.simulation.world.scene import Scene

ARM, MODE, TAKEOFF, AUX = 400, 176, 22, 218
GUIDED, LOITER, LAND = 4, 5, 9
RANGE_FINDER = 10
HILL = 12.0
"""Height of the ground from 30 m north of the start on [m]; before it rises evenly from 10 m on."""


@pytest.fixture
def hilly(station: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Makes a copter before a hill to the north, that hovers in GUIDED at 20 m."""
    rows = [0.0, 0.0, HILL / 2.0, HILL, HILL, HILL, HILL, HILL, HILL, HILL]
    hill = Terrain([[height, height] for height in rows], west_edge=-500.0, south_edge=0.0, spacing=10.0)

    def world(*arguments: Any, **options: Any) -> Any:
        return make_world(*arguments, **options, scene=Scene(terrain=hill))

    monkeypatch.setattr(rigs_station, "make_world", world)

    def made(**parameters: float) -> Any:
        rig = station(parameters={"RNGFND1_TYPE": 1, "RNGFND1_MAX_CM": 4000, **parameters})
        rig.run(0.5)
        assert rig.command(MODE, 1.0, GUIDED) == 0
        assert rig.command(ARM, 1.0) == 0
        assert rig.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 20.0) == 0
        rig.run(20.0)
        rig.vehicle.rc.transmitter[2] = 1500
        return rig

    return made


def go_north(rig: Any, north: float) -> None:
    target = {"target_system": 1, "target_component": 1, "coordinate_frame": 1, "type_mask": 0xDF8}
    rig.send("SET_POSITION_TARGET_LOCAL_NED", **target, x=north, y=0.0, z=-20.0)
    rig.run_until(lambda: rig.vehicle.estimate.position[0] > north - 0.5)
    rig.run(5.0)


@pytest.mark.parametrize(("finder", "speed"), [(1, 0.5), (0, 1.5)])
def test_a_landing_on_a_hill_is_slow_by_the_range_finder(finder: int, speed: float, hilly: Any) -> None:
    rig = hilly(RNGFND1_TYPE=finder)
    go_north(rig, 60.0)
    rig.command(MODE, 1.0, LAND)
    rig.run_until(lambda: rig.flight.truth().contacts > 0)
    assert rig.height == pytest.approx(HILL, abs=0.5)
    assert rig.flight.truth().contact_speed == pytest.approx(speed, abs=0.25)


@pytest.mark.parametrize(
    ("parameters", "follows"), [({}, True), ({"SURFTRAK_MODE": 0}, False), ({"RNGFND1_TYPE": 0}, False)]
)
def test_loiter_follows_the_ground(parameters: dict[str, float], follows: bool, hilly: Any) -> None:
    rig = hilly(**parameters)
    rig.command(MODE, 1.0, LOITER)
    rig.vehicle.rc.transmitter[1] = 1400
    rig.run_until(lambda: rig.vehicle.estimate.position[0] > 50.0)
    rig.vehicle.rc.transmitter[1] = 1500
    rig.run(15.0)
    assert rig.height == pytest.approx(20.0 + HILL if follows else 20.0, abs=0.7)


def test_the_switch_keeps_the_range_finder_out(hilly: Any) -> None:
    rig = hilly()
    assert rig.command(AUX, RANGE_FINDER, 0) == 0
    go_north(rig, 60.0)
    rig.command(MODE, 1.0, LAND)
    rig.run_until(lambda: rig.flight.truth().contacts > 0)
    assert rig.flight.truth().contact_speed > 1.2


def test_the_pilot_still_climbs_over_level_ground(hilly: Any) -> None:
    rig = hilly()
    rig.command(MODE, 1.0, LOITER)
    rig.run(2.0)
    rig.vehicle.rc.transmitter[2] = 1800
    rig.run(4.0)
    rig.vehicle.rc.transmitter[2] = 1500
    rig.run(5.0)
    assert rig.height > 24.0
