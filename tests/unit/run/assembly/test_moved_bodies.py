"""Runs whose vehicles are moved by FMUs: from a model, by an address, and to an end in order."""

import shutil
from pathlib import Path

import pytest

from rigs.multirotor_fmu import CRASH, make_fmu
from volery import Options, simulate
from volery.base.errors import ModelError, UsageError
from volery.base.frames import LocalFrame
from volery.kernel.virtual import VirtualKernel
from volery.model.environment import VehicleSpec, WindSpec
from volery.model.fmu_bodies import Fmu
from volery.model.system_loader import load
from volery.run.assembly.firmware_programs import ProgramFolder
from volery.run.assembly.model_checks import vocabulary
from volery.run.assembly.simulated_fleet import FleetWorld, SimulatedFleet
from volery.run.connect import connect
from volery.simulation.real_firmware.firmware_process import FirmwareError

STARTER = Path(__file__).parents[4] / "examples" / "starter"


@pytest.fixture
def starter(tmp_path):
    """Return a function that writes the starter's model with a body for its drone, and an FMU beside it."""

    def write(body: str) -> Path:
        folder = tmp_path / "starter"
        shutil.copytree(STARTER, folder)
        make_fmu(folder / "quad.fmu")
        model = folder / "model.yaml"
        text = model.read_text()
        drone = "kind: multirotor, autopilot: ardupilot,"
        assert text.count(drone) == 1
        model.write_text(text.replace(drone, f"{drone} body: {body},"))
        return model

    return write


def test_a_crash_of_its_machine_code_ends_the_run_in_order(starter, tmp_path):
    model = starter(f"{{fmu: quad.fmu, parameters: {{failure: {CRASH}, fail_at: 8}}}}")
    result = simulate(model, Options(out=tmp_path / "run"))
    outcome = result.record.outcome
    assert outcome.status == "failed"
    assert "drone_1: quad.fmu was ended by SIGSEGV" in outcome.reason
    assert "its last good state, at 8.00" in outcome.reason
    assert (tmp_path / "run" / "trace.mcap").exists()


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ("{fmu: none.fmu}", "there is no file 'none.fmu' beside the model"),
        ("{axes: frd}", "fmu"),
        ("{fmu: quad.fmu, axes: enu}", "axes"),
        ("{fmu: quad.fmu, variables: {speed: v}}", "unknown key"),
        ("{fmu: quad.fmu, variables: {wind: []}}", "at least 1"),
        ("{fmu: quad.fmu, parameters: {mass: heavy}}", "number"),
    ],
)
def test_what_a_model_states_of_a_body_is_checked(starter, body, says):
    with pytest.raises(ModelError, match=says):
        load(starter(body), vocabulary())


def test_a_rover_has_no_body(starter):
    model = starter("{fmu: quad.fmu}")
    model.write_text(model.read_text().replace("kind: multirotor", "kind: rover"))
    with pytest.raises(ModelError, match="a rover has no body of its own; only a multirotor has one"):
        load(model, vocabulary())


def test_an_address_names_an_fmu(tmp_path):
    make_fmu(tmp_path / "quad.fmu", version=3)
    with connect(f"sim:px4?start=warm&body={tmp_path}/quad.fmu") as drone:
        drone.takeoff(3)
        assert drone.telemetry.armed
    with pytest.raises(UsageError, match=r"px4: .*none\.fmu: No such file"):
        connect(f"sim:px4?body={tmp_path}/none.fmu")
    with pytest.raises(UsageError, match="a rover has no body of its own"):
        connect(f"sim:ardupilot?kind=rover&body={tmp_path}/quad.fmu")


def vehicle(name: str, fmu: Fmu) -> VehicleSpec:
    system = load(STARTER / "model.yaml", vocabulary())
    stated = system.vehicles[0]
    return VehicleSpec(name, stated.kind, stated.autopilot, stated.at, body=fmu)


def test_the_run_says_what_moved_a_vehicle_and_keeps_what_it_printed(tmp_path):
    fmu = Fmu(make_fmu(tmp_path / "quad.fmu", version=3, without=("wind", "push")))
    around = FleetWorld(LocalFrame(47.0, 8.0), WindSpec())
    kernel = VirtualKernel()
    fleet = SimulatedFleet(kernel, [vehicle("first", fmu)], around, 1, programs=ProgramFolder(tmp_path))
    assert list(fleet.remarks()) == ["first: moved by quad.fmu (FMI 3); it does not take push, wind"]
    fleet.close()
    assert [one.name for one in (tmp_path / "bodies" / "first").iterdir()] == ["console.txt"]
    assert fleet.flights["first"].truth().on_ground


def test_if_one_cannot_begin_the_others_are_ended(tmp_path, monkeypatch):
    good = Fmu(make_fmu(tmp_path / "good.fmu"))
    monkeypatch.setattr("rigs.multirotor_fmu._machine_code", lambda *_: b"none")
    wrong = Fmu(make_fmu(tmp_path / "wrong.fmu"))
    around = FleetWorld(LocalFrame(47.0, 8.0), WindSpec())
    with pytest.raises(FirmwareError, match=r"second: wrong.fmu cannot be loaded"):
        SimulatedFleet(
            VirtualKernel(), [vehicle("first", good), vehicle("second", wrong)], around, 1,
            programs=ProgramFolder(tmp_path),
        )  # fmt: skip
    assert (tmp_path / "bodies" / "first" / "console.txt").read_text() == "freed\n"
    assert not list(tmp_path.glob("bodies/*/extracted"))
