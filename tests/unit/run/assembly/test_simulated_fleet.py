"""Bodies of simulated vehicles as a model describes them."""

import pytest

from volery.base.frames import LocalFrame
from volery.base.time import S
from volery.kernel.virtual import VirtualKernel
from volery.model.airframes import Battery
from volery.model.environment import Place, Vehicle, Wind
from volery.run.assembly.bodies import body_of
from volery.run.assembly.simulated_fleet import SimulatedFleet, Surroundings
from volery.simulation.world.body_specs import Multirotor, Rover
from volery.trace.events import Text

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


class Yard:
    """A drone with a half-empty battery that stands 3 m from a place."""

    def __init__(self, place, autopilot="ardupilot"):
        self.told = []
        self.kernel = VirtualKernel(record=self.told.append)
        battery = Battery(capacity_coulomb=3600.0, charge=0.5)
        stand = Place("stand", 47.0, 8.0, 0.0, 3.0, 0.0)
        drone = Vehicle("drone", "multirotor", autopilot, stand, battery=battery)
        self.fleet = SimulatedFleet(self.kernel, [drone], Surroundings(LocalFrame(47.0, 8.0), Wind()), 1)
        self.fleet.serve_batteries([place])

    @property
    def left(self):
        """The share of the charge that is left."""
        return self.fleet.flights["drone"].truth().battery_left

    @property
    def texts(self):
        """What the trace says of batteries."""
        return [one.text for one in self.told if isinstance(one, Text) and "battery swapped" in one.text]


def _place(east_m, **service):
    return Place("port", 47.0, 8.0, 0.0, east_m, 0.0, "", **service)


def test_a_vehicle_that_stands_at_a_place_gets_another_battery():
    yard = Yard(_place(0.0, battery_swap_ns=10 * S))
    vehicle = yard.fleet.autopilots["drone"].vehicle
    vehicle.failsafes.active.update(("battery low", "station"))
    vehicle.reports.gauge_offset_mah = 300.0
    yard.kernel.run(9 * S)
    assert yard.left < 0.5
    yard.kernel.run(12 * S)
    assert yard.left == pytest.approx(1.0, abs=0.002)
    assert yard.texts == ["battery swapped at port: 50% was left"]
    assert "battery low" not in vehicle.failsafes.active
    assert vehicle.reports.gauge_offset_mah == 0.0
    yard.kernel.run(40 * S)
    assert len(yard.texts) == 1


def test_no_battery_is_swapped_far_away():
    yard = Yard(_place(-3.0, battery_swap_ns=2 * S))
    yard.kernel.run(6 * S)
    assert yard.texts == []


def test_a_charger_gives_its_power_until_the_battery_is_full():
    yard, alone = Yard(_place(0.0, charging_w=60.0)), Yard(_place(0.0))
    for one in (yard, alone):
        one.kernel.run(11 * S)
    volts = yard.fleet.flights["drone"].truth().volts
    assert (yard.left - alone.left) * 3600.0 == pytest.approx(60.0 / volts * 11, rel=0.05)
    yard.kernel.run(600 * S)
    assert yard.left == pytest.approx(1.0, abs=0.01)
