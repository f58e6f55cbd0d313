"""What the computers on board draw is what the batteries that feed them give."""

from __future__ import annotations

import pytest

from volery import Options, simulate
from volery.cost import load_catalogue
from volery.run import run_session
from volery.run.assembly.simulated_fleet import SimulatedFleet

pytestmark = pytest.mark.integration

LIGHT_LOAD_J = 0.02
"""A period of what is left to compute at the end, when everything stands: some hundredths of a core."""

FED = {
    "drone_1": "onboard_1",
    "drone_2": "onboard_2",
    "rover_depot": "onboard_depot",
    "rover_north": "onboard_north",
    "rover_east": "onboard_east",
}


@pytest.fixture(scope="module")
def flown(delivery):
    """The record of a run, and the true state of each vehicle at its end."""
    fleets = []

    class Kept(SimulatedFleet):
        def __init__(self, *arguments, **named):
            super().__init__(*arguments, **named)
            fleets.append(self)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_session, "SimulatedFleet", Kept)
        run = simulate(delivery, Options(fidelity="code", seed=7), scenario="pocket")
    (fleet,) = fleets
    return run.record, {name: flight.truth() for name, flight in fleet.flights.items()}


@pytest.mark.parametrize(("vehicle", "processor"), FED.items())
def test_a_battery_feeds_its_computer_but_for_the_last_period(flown, vehicle, processor):
    """Idle power flows from the start; what busy cores add comes a period late, so the last is missing."""
    record, truths = flown
    found = record.processors[processor]
    busy_s = found.utilisation * found.cores * record.sim_s
    law = load_catalogue().processor(found.kind).power_law()
    assert found.energy_j == pytest.approx(law.joules(busy_s, record.sim_s, found.frequency_mhz), rel=1e-9)
    assert truths[vehicle].payload_j == pytest.approx(found.energy_j, abs=LIGHT_LOAD_J)
    assert truths[vehicle].payload_j < found.energy_j


def test_the_drone_that_looks_for_its_beacon_draws_more_than_the_one_that_stands(flown):
    _, truths = flown
    assert truths["drone_1"].payload_j > truths["drone_2"].payload_j + 50.0 * LIGHT_LOAD_J


def test_a_vehicles_energy_contains_its_computers(flown):
    record, truths = flown
    for vehicle, truth in truths.items():
        assert record.vehicles[vehicle].energy_j == pytest.approx(truth.energy_j, rel=0.01)
        assert truth.energy_j > 0.999 * truth.payload_j > 0.0  # a rover at rest draws nothing else
