"""What vehicles get at places: another battery, charge, and loads for their grippers."""

import pytest

from volery.base.frames import LocalFrame
from volery.base.time import S
from volery.kernel.virtual import VirtualKernel
from volery.model.airframes import BatterySpec
from volery.model.environment import CarriedLoad, PlaceSpec, VehicleSpec, WindSpec
from volery.requirements.observables import TABLE
from volery.run.assembly.place_services import serve_batteries, serve_loads
from volery.run.assembly.simulated_fleet import FleetWorld, SimulatedFleet
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.trace.attachments import RunSetup
from volery.trace.events import BatteryService, Failure, Text


class Yard:
    """A drone with a half-empty battery that stands 3 m from a place."""

    def __init__(self, place, loads=(), autopilot="ardupilot"):
        self.told = []
        self.kernel = VirtualKernel(record=self.told.append)
        battery = BatterySpec(capacity_coulomb=3600.0, charge=0.5)
        stand = PlaceSpec("stand", 47.0, 8.0, 0.0, 3.0, 0.0)
        drone = VehicleSpec("drone", "multirotor", autopilot, stand, battery=battery)
        self.fleet = SimulatedFleet(self.kernel, [drone], FleetWorld(LocalFrame(47.0, 8.0), WindSpec()), 1)
        serve_batteries(self.kernel, self.fleet, [place])
        serve_loads(self.kernel, self.fleet, loads)

    @property
    def left(self):
        """The share of the charge that is left."""
        return self.fleet.flights["drone"].truth().battery_left

    @property
    def texts(self):
        """What the trace says of batteries."""
        return [one.text for one in self.told if isinstance(one, Text) and "battery swapped" in one.text]


def _place(east_m, **service):
    return PlaceSpec("port", 47.0, 8.0, 0.0, east_m, 0.0, "", **service)


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


def test_swaps_and_charging_can_be_observed():
    yard = Yard(_place(0.0, battery_swap_ns=5 * S, charging_w=60.0))
    observed = [_observed(name) for name in ("battery_swaps", "charging_time")]
    yard.kernel.run(11 * S)
    for one in observed:
        for event in yard.told:
            one(event)
    swaps, charging = (one.value(yard.kernel.now()) for one in observed)
    served = [one for one in yard.told if isinstance(one, BatteryService)]
    assert swaps == 1.0
    assert charging == sum(one.kind == "charge" for one in served) > 5.0


def _observed(quantity):
    (make,) = [one[4] for one in TABLE if one[:2] == ("vehicle", quantity)]
    return make("drone", RunSetup())


# -- loads


def grip(yard, state, seconds=0.3):
    """Move the gripper of the drone, and wait until that is noticed."""
    yard.fleet.flights["drone"].gripper = state
    yard.kernel.run(yard.kernel.now() + round(seconds * S))


def said(yard):
    return [str(getattr(one, "text", "") or getattr(one, "what", "")) for one in yard.told
            if isinstance(one, Text | Failure)]  # fmt: skip


PARCEL = CarriedLoad("parcel", _place(2.0), 1.0)


def test_a_gripper_takes_the_nearest_load_and_its_mass():
    farther = CarriedLoad("crate", _place(1.5), 2.0)
    yard = Yard(_place(50.0), (farther, PARCEL))
    mass = yard.fleet.flights["drone"].mass
    grip(yard, 1)
    assert yard.fleet.flights["drone"].mass == mass + 1.0
    grip(yard, 0)
    assert yard.fleet.flights["drone"].mass == mass
    assert said(yard)[-2:] == ["took parcel: 1 kg", "left parcel at east 3.0 m, north 0.0 m"]


def test_a_load_lies_where_it_was_left():
    yard = Yard(_place(50.0), (PARCEL,))
    grip(yard, 1)
    grip(yard, 0)
    grip(yard, 1)
    assert said(yard)[-1] == "took parcel: 1 kg"


@pytest.mark.parametrize(
    ("load", "what"),
    [
        (
            CarriedLoad("parcel", _place(9.0), 1.0),
            "the gripper closed on nothing: no load is within its reach",
        ),
        (
            CarriedLoad("parcel", _place(3.0), 9.0),
            "parcel stays: its 9 kg are too heavy, 5.5 kg more can be lifted",
        ),
    ],
)
def test_a_load_that_is_far_or_heavy_stays(load, what):
    yard = Yard(_place(50.0), (load,))
    mass = yard.fleet.flights["drone"].mass
    grip(yard, 1)
    assert yard.fleet.flights["drone"].mass == mass
    assert said(yard)[-1] == what
    grip(yard, 0)
    assert said(yard)[-1] == what


def test_one_kilogram_more_takes_more_power_by_momentum_theory():
    """The same hover with and without the load: shaft power grows with the mass to the power 1.5."""
    yard = Yard(_place(50.0), (PARCEL,))
    flight = yard.fleet.flights["drone"]
    flight.set_charge(1.0)

    def hover():
        flight.drive(Setpoint(Control.POSITION, position=(0.0, 0.0, -10.0)))
        yard.kernel.run(yard.kernel.now() + 20 * S)
        before = flight.truth().energy_j
        yard.kernel.run(yard.kernel.now() + 10 * S)
        return (flight.truth().energy_j - before) / 10.0 - flight.spec.idle_power

    yard.fleet.sample()
    grip(yard, 1)
    loaded = hover()
    grip(yard, 0)
    assert said(yard)[-1].endswith("m up")
    assert loaded / hover() == pytest.approx((4.0 / 3.0) ** 1.5, rel=0.03)
