"""Real ArduCopter in a model and at an address; it flies where VOLERY_ARDUCOPTER names a program."""

from __future__ import annotations

import pytest

from rigs.requirements import firmware_program
from volery import Options, simulate
from volery.cli.commands.first_steps import example
from volery.run.connect import connect, connect_fleet

pytestmark = pytest.mark.integration


@pytest.fixture
def copter():
    return firmware_program("VOLERY_ARDUCOPTER")


def test_the_components_of_a_model_fly_it(copter, tmp_path):
    run = simulate(example("starter"), Options(fidelity="firmware", out=tmp_path / "run"))
    assert run.ok
    assert run.record.vehicles["drone_1"].firmware == copter.name
    assert run.record.vehicles["drone_1"].landed
    flown = run.arrays("drone_1")
    assert 10.0 < flown["z"].max() < 20.0


def test_it_boots_takes_off_and_lands_at_an_address(copter):
    with connect("firmware:ardupilot") as drone:
        drone.takeoff(10)
        assert 30e9 < drone.kernel.now() < 120e9  # a boot takes about 40 s of its clock
        assert drone.position.latitude == pytest.approx(drone.home.latitude, abs=1e-5)
        assert drone.telemetry.above_home == pytest.approx(10.0, abs=1.0)
        drone.land()
        assert not drone.telemetry.armed


def test_two_projects_and_a_simulated_autopilot_fly_in_one_world(copter):
    firmware_program("VOLERY_PX4")
    urls = {
        "a": "firmware:ardupilot?start=warm",
        "b": "firmware:px4?start=warm",
        "c": "sim:paparazzi?start=warm",
    }
    with connect_fleet(urls) as fleet:
        fleet.takeoff(8)
        assert all(7.0 < fleet[name].telemetry.above_home < 9.5 for name in fleet)
        fleet.land()
        assert not any(fleet[name].telemetry.armed for name in fleet)
