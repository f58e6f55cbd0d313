"""A fleet whose autopilots are of another package: what it asks of them, and when they end."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import nan
from typing import Any

import pytest

from volery import Options, simulate
from volery.base.errors import UsageError
from volery.base.frames import LocalFrame
from volery.base.time import S
from volery.kernel.virtual import VirtualKernel
from volery.links.mavlink_codec import MAVLINK
from volery.model.environment import Place, Vehicle, Wind
from volery.run.assembly.simulated_fleet import SimulatedFleet, Surroundings
from volery.simulation.autopilots.fleet_autopilot import firmwares
from volery.trace.events import VehicleState


class Sleeper:
    """An autopilot that does nothing."""

    banner = b""

    def __init__(self, kernel: Any, flight: Any, name: str) -> None:
        self.transmitter = [1500] * 8
        self.closed = 0
        self._kernel, self._flight, self._name = kernel, flight, name

    def connect(self, link: Any, *, use: str = "") -> None:
        raise NotImplementedError

    def join(self, graph: Any, namespace: str, place: Any) -> None:
        raise NotImplementedError

    def swap_battery(self) -> None:
        self._flight.set_charge(1.0)

    def state(self) -> VehicleState:
        seen = self._flight.truth()
        where = *seen.position, *seen.attitude, *seen.velocity, nan, nan, nan
        power = seen.battery_left, seen.volts, seen.amps
        return VehicleState(self._kernel.now(), self._name, *where, *power, False, "ASLEEP")

    def close(self) -> None:
        self.closed += 1


@dataclass
class Sleepers:
    """Their family; it has no rovers."""

    name: str = "sleeper"
    codec: Any = MAVLINK
    default_links: tuple[Any, ...] = ()
    airframes: bool = False
    made: list[Sleeper] = field(default_factory=list)

    def of_version(self, version: str) -> Sleepers:
        return self

    def with_features(self, names: str) -> Sleepers:
        return self

    def create(self, kernel: Any, flight: Any, *, name: str, **options: Any) -> Sleeper:
        if not flight.flying:
            raise UsageError("sleepers do not drive")
        self.made.append(Sleeper(kernel, flight, name))
        return self.made[-1]


@pytest.fixture
def sleepers() -> Iterator[Sleepers]:
    family = Sleepers()
    firmwares.add(family.name, family)
    yield family
    del firmwares._added[family.name]


MODEL = """
volery: 1
name: rest
environment:
  origin: {latitude: 47, longitude: 8}
  places: {here: {east: 2 m, north: 3 m, battery_swap: 1 s}}
  vehicles:
    drone_1: {kind: multirotor, autopilot: sleeper, at: here, battery: {capacity: 2 Ah, charge: 50 %}}
run: {duration: 5 s}
"""


def test_a_model_runs_with_an_autopilot_that_volery_does_not_know(sleepers, tmp_path):
    (tmp_path / "model.yaml").write_text(MODEL)
    run = simulate(tmp_path / "model.yaml", Options(out=tmp_path / "run"))
    assert run.ok
    assert run.observables["drone_1.battery_swaps"] == 1.0
    assert [one.closed for one in sleepers.made] == [1]


def _fleet(*kinds: str) -> SimulatedFleet:
    here = Place("here", 47.0, 8.0, 0.0, 0.0, 0.0)
    vehicles = [Vehicle(f"{kind}_{at}", kind, "sleeper", here) for at, kind in enumerate(kinds)]
    return SimulatedFleet(VirtualKernel(), vehicles, Surroundings(LocalFrame(47.0, 8.0), Wind()), 1)


def test_progress_and_transmitter_are_those_of_the_autopilot(sleepers):
    fleet = _fleet("multirotor")
    assert [(one.mode, one.armed) for one in fleet.progress()] == [("ASLEEP", False)]
    fleet.move_transmitter("multirotor_0", S, 3, 1900)
    fleet._kernel.run(2 * S)
    assert sleepers.made[0].transmitter[:4] == [1500, 1500, 1900, 1500]


def test_those_that_were_made_end_where_a_later_one_is_refused(sleepers):
    with pytest.raises(UsageError, match="sleepers do not drive"):
        _fleet("multirotor", "rover")
    assert [one.closed for one in sleepers.made] == [1]
