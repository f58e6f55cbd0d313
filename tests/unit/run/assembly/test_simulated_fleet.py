"""A fleet whose autopilots are of another package: what it asks of them, and when they end."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from PIL import Image

from rigs.hovering_autopilot import HoveringFamily
from volery import Options, simulate
from volery.base.errors import UsageError
from volery.base.frames import LocalFrame
from volery.base.time import S
from volery.kernel.virtual import VirtualKernel
from volery.model.environment import PlaceSpec, VehicleSpec, WindSpec
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary
from volery.run.assembly.simulated_fleet import FleetWorld, SimulatedFleet, surroundings_of
from volery.simulation.added_sensors.beams import Ranging
from volery.simulation.added_sensors.lidar import Lidar
from volery.simulation.autopilots.fleet_autopilot import firmwares
from volery.simulation.world.scene import Cylinder, contact
from volery.simulation.world.sensors import SensorInput


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
    here = PlaceSpec("here", 47.0, 8.0, 0.0, 0.0, 0.0)
    vehicles = [VehicleSpec(f"{kind}_{at}", kind, "hovering", here) for at, kind in enumerate(kinds)]
    return SimulatedFleet(VirtualKernel(), vehicles, FleetWorld(LocalFrame(47.0, 8.0), WindSpec()), 1)


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


def test_beams_and_bodies_meet_the_walls_of_a_floor_plan(tmp_path):
    random = np.random.default_rng(5)
    cells = random.random((60, 80)) < 0.03
    cells[[0, -1], :] = cells[:, [0, -1]] = True
    cells[25:35, 35:45] = False
    Image.fromarray(np.where(cells[::-1], 0, 254).astype(np.uint8)).save(tmp_path / "hall.png")
    (tmp_path / "hall.yaml").write_text("image: hall.png\nresolution: 0.2\norigin: [-8.0, -6.0, 0]\n")
    text = MODEL.replace("hovering", "ardupilot").replace("  vehicles", "  floor_plan: hall.yaml\n  vehicles")
    (tmp_path / "model.yaml").write_text(text)
    scene = surroundings_of(load(tmp_path, vocabulary()).environment).scene
    lidar = Lidar("lidar", 10.0, Ranging(0.0, 30.0), 90, 2.0 * np.pi)
    angles = np.arctan2(lidar.beams()[:, 1], lidar.beams()[:, 0])
    still = (0.0, 0.0, 0.0)
    state = SensorInput(0, (0.031, 0.057, 1.0), still, (1.0, 0.0, 0.0, 0.0), still, still, still, 0.0, scene)
    found = lidar.sampler(np.uint64(0), scene)(state, 0)
    along = np.arange(0.0, 12.0, 0.001)
    for angle, distance in zip(angles, found, strict=True):
        rows = ((along * np.sin(angle) + 6.057) / 0.2).astype(int)
        columns = ((along * np.cos(angle) + 8.031) / 0.2).astype(int)
        first = along[cells[np.clip(rows, 0, 59), np.clip(columns, 0, 79)].argmax()]
        assert distance == pytest.approx(first, abs=0.01)
    west, *_ = contact(scene.arrays, Cylinder(-7.6, 0.1, 0.9, 1.0, 1.1, 0.3))
    assert scene.solids[west].name.startswith("hall_")
    assert contact(scene.arrays, Cylinder(0.0, 0.0, 0.9, 1.0, 1.1, 0.3))[0] == -1
