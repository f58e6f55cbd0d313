"""A fleet whose autopilots are of another package: what it asks of them, and when they end."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from rigs.hovering_autopilot import HoveringFamily
from volery import Options, simulate
from volery.base.errors import UsageError
from volery.base.frames import LocalFrame
from volery.base.time import S
from volery.kernel.virtual import VirtualKernel
from volery.model.environment import Place, Vehicle, Wind
from volery.run.assembly.simulated_fleet import SimulatedFleet, Surroundings
from volery.simulation.autopilots.fleet_autopilot import firmwares


@pytest.fixture
def hovering() -> Iterator[HoveringFamily]:
    family = HoveringFamily()
    firmwares.add(family.name, family)
    yield family
    del firmwares._added[family.name]


MODEL = """
volery: 1
name: hover
environment:
  origin: {latitude: 47, longitude: 8}
  places: {here: {east: 2 m, north: 3 m}}
  vehicles: {drone_1: {kind: multirotor, autopilot: hovering, at: here, sensors: rtk}}
run: {duration: 30 s}
"""


def test_an_autopilot_that_drives_the_motors_hovers_in_a_model(hovering, tmp_path):
    (tmp_path / "model.yaml").write_text(MODEL)
    run = simulate(tmp_path / "model.yaml", Options(out=tmp_path / "run"))
    assert run.ok
    assert [one.closed for one in hovering.made] == [1]
    flown = run.arrays("drone_1")
    last = flown["time_s"] > 20.0
    assert last.sum() == 50
    assert flown["z"][last] == pytest.approx(8.12, abs=0.5)  # its feet are 0.12 m below its centre
    assert flown["x"][last] == pytest.approx(2.0, abs=0.5)
    assert flown["y"][last] == pytest.approx(3.0, abs=0.5)


def _fleet(*kinds: str) -> SimulatedFleet:
    here = Place("here", 47.0, 8.0, 0.0, 0.0, 0.0)
    vehicles = [Vehicle(f"{kind}_{at}", kind, "hovering", here) for at, kind in enumerate(kinds)]
    return SimulatedFleet(VirtualKernel(), vehicles, Surroundings(LocalFrame(47.0, 8.0), Wind()), 1)


def test_progress_and_transmitter_are_those_of_the_autopilot(hovering):
    fleet = _fleet("multirotor")
    assert [(one.mode, one.armed) for one in fleet.progress()] == [("OFF", False)]
    fleet.move_transmitter("multirotor_0", S, 3, 1900)
    fleet._kernel.run(2 * S)
    assert hovering.made[0].transmitter[:4] == [1500, 1500, 1900, 1500]
    assert [(one.mode, one.armed) for one in fleet.progress()] == [("HOVER", True)]


def test_those_that_were_made_end_where_a_later_one_is_refused(hovering):
    with pytest.raises(UsageError, match="hovering autopilots do not drive"):
        _fleet("multirotor", "rover")
    assert [one.closed for one in hovering.made] == [1]
