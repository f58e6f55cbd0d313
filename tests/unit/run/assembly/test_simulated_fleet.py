"""Bodies of simulated vehicles as a model describes them."""

import pytest

from volery.model.environment import Battery, Place, Vehicle
from volery.run.assembly.simulated_fleet import body_of
from volery.simulation.world.body_specs import Multirotor, Rover

PAD = Place("pad", 47.4, 8.5, 400.0, 12.0, -3.0, "pad")


@pytest.mark.parametrize(("kind", "body"), [("multirotor", Multirotor), ("rover", Rover)])
def test_a_body_stands_at_its_place_with_its_sensors(kind, body):
    vehicle = Vehicle("v", kind, "ardupilot", PAD, 90.0, None, "rtk", ("airspeed",))
    spec = body_of(vehicle)
    assert isinstance(spec, body)
    assert spec.at[:2] == (12.0, -3.0)
    assert spec.heading_deg == 90.0
    assert (spec.sensors, spec.added_sensors) == ("rtk", ("airspeed",))
    assert spec.battery == body().battery


def test_a_battery_in_the_model_replaces_the_usual_one():
    vehicle = Vehicle("v", "multirotor", "ardupilot", PAD, battery=Battery(capacity_coulomb=3600.0))
    spec = body_of(vehicle)
    assert spec.battery.capacity_ah == pytest.approx(1.0)
    assert spec.added_sensors == ()
