"""From a model or an address to a program that runs, to its record and its end; the program is a stand-in."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path

import pytest

import volery
from rigs.standing_ardupilot import write_program
from volery import Options, simulate
from volery.base.errors import CapabilityError, UsageError
from volery.run.connect import connect, connect_fleet
from volery.run.fly import fly
from volery.simulation.real_firmware.firmware_process import FirmwareError

pytestmark = pytest.mark.integration

MODEL = """
volery: 1
name: standing
environment:
  origin: {latitude: 47, longitude: 8}
  places: {here: {east: 2 m, north: 3 m}}
  vehicles:
    first: {kind: multirotor, autopilot: {is: ardupilot, firmware: bin/arducopter}, at: here}
    second: {kind: multirotor, autopilot: ardupilot, at: here}
run: {duration: 3 s}
"""


@pytest.fixture
def program(tmp_path):
    return write_program(tmp_path / "bin" / "arducopter")


@pytest.fixture
def model(program, tmp_path, monkeypatch):
    monkeypatch.setenv("VOLERY_ARDUCOPTER", str(program))
    file = tmp_path / "model.yaml"
    file.write_text(MODEL)
    return file


def runs_in(folder):
    """Return the processes whose working directory is below a folder."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            with suppress(OSError):
                if (entry / "cwd").readlink().is_relative_to(folder):
                    found.append(int(entry.name))
    return found


def test_a_run_keeps_what_a_program_leaves_and_says_what_flew(model, tmp_path):
    said = []
    run = simulate(model, Options(out=tmp_path / "run", tell=said.append))
    assert run.completed
    assert said == ["first: arducopter boots"]
    assert (tmp_path / "run/firmware/first/console.txt").read_text().startswith("standing at (4700002")
    assert not (tmp_path / "run/firmware/second").exists()
    vehicles = run.record.vehicles
    assert (vehicles["first"].autopilot, vehicles["first"].firmware) == ("ardupilot", "arducopter")
    assert vehicles["second"].firmware == ""
    (remark,) = (one for one in run.record.warnings if one.startswith("first: "))
    assert "flown by the program arducopter 4.6.3 (92b0cd78) of ardupilot" in remark
    assert "inertial sensors" in remark
    assert "ardupilot (arducopter)" in (tmp_path / "run/report.html").read_text()
    assert (
        json.loads((tmp_path / "run/run.json").read_text())["vehicles"]["first"]["firmware"] == "arducopter"
    )
    assert not runs_in(tmp_path)


def test_at_fidelity_firmware_every_vehicle_flies_on_a_program(model, tmp_path):
    run = simulate(model, Options(fidelity="firmware", out=tmp_path / "run"))
    assert run.completed
    assert run.record.fidelity == "firmware"
    assert {name: one.firmware for name, one in run.record.vehicles.items()} == {
        "first": "arducopter",
        "second": "arducopter",
    }
    assert (tmp_path / "run/firmware/second/console.txt").exists()


def test_at_fidelity_firmware_a_vehicle_without_one_stays_simulated_and_the_run_says_so(model):
    run = simulate(
        model, Options(fidelity="firmware"), overrides=["environment.vehicles.second.autopilot=dji"]
    )
    assert run.completed
    assert (
        "second flies on the simulated dji: no real firmware of it flies in virtual time"
        in run.record.warnings
    )
    assert run.record.vehicles["second"].firmware == ""


def test_a_missing_program_is_named_before_anything_starts(model, tmp_path):
    with pytest.raises(UsageError, match=r"first: .*/bin/arducopte: there is no such program"):
        simulate(
            model,
            Options(out=tmp_path / "run"),
            overrides=["environment.vehicles.first.autopilot.firmware=bin/arducopte"],
        )
    assert not (tmp_path / "run").exists()


def test_a_fleet_that_fails_half_way_ends_the_programs_that_run(model, tmp_path):
    with pytest.raises(
        FirmwareError, match=r"second: arducopter ended with exit code 3; its last words: .*asked to"
    ):
        simulate(
            model,
            Options(fidelity="firmware", out=tmp_path / "run"),
            overrides=["environment.vehicles.second.parameters={SIM_ENDS_AT: 0.5}"],
        )
    assert (tmp_path / "run/firmware/first/console.txt").exists()
    assert not runs_in(tmp_path)


def test_a_program_that_dies_in_a_run_ends_it_with_its_last_words(model, tmp_path):
    # in flight: a warm start waits until stated parameters were asked for, from 10 s on
    overrides = ["environment.vehicles.first.parameters={SIM_ENDS_AT: 12}"]
    run = simulate(model, Options(out=tmp_path / "run"), overrides=overrides)
    assert run.record.outcome.status == "failed"
    assert "first: arducopter ended with exit code 3; its last words: " in run.record.outcome.reason
    assert not runs_in(tmp_path)


def test_parameters_of_a_file_reach_the_program_below_those_of_the_vehicle(model, tmp_path):
    (tmp_path / "slow.parm").write_text("WPNAV_SPEED 300\nRTL_ALT 2000\n")
    overrides = [
        "environment.vehicles.first.autopilot.parameters=slow.parm",
        "environment.vehicles.first.parameters={RTL_ALT: 3000}",
    ]
    assert simulate(model, Options(out=tmp_path / "run"), overrides=overrides).completed
    given = (tmp_path / "run/firmware/first/parameters.parm").read_text().splitlines()
    assert {"WPNAV_SPEED 300", "RTL_ALT 3000"} <= set(given)
    assert "FRAME_CLASS 1" in given


def test_a_program_at_an_address_lives_as_long_as_the_connection(program, monkeypatch, tmp_path):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with connect(f"firmware:ardupilot?program={program}&start=warm", within=0.0) as drone:
        assert drone.telemetry.autopilot == "ArduPilot"
        (folder,) = tmp_path.glob("volery-programs-*")
        assert runs_in(folder)
    assert not folder.exists()
    assert not runs_in(tmp_path)


def test_simulated_and_real_firmware_share_a_world(program):
    urls = {"real": f"firmware:ardupilot?program={program}&start=warm", "model": "sim:px4?start=warm"}
    with connect_fleet(urls, within=0.0) as fleet:
        fleet["model"].takeoff(5)
        assert fleet["model"].kernel is fleet["real"].kernel
        assert fleet["model"].telemetry.above_home > 4.0
        assert not fleet["real"].telemetry.armed


def test_simulated_and_real_vehicles_do_not_share_a_clock(program):
    urls = {"a": f"firmware:ardupilot?program={program}", "b": "ardupilot+udp://:14550"}
    with pytest.raises(volery.CapabilityError, match="different clocks"):
        connect_fleet(urls)


def test_a_flight_records_what_flew(program, tmp_path):
    def mission(drone: volery.Drone) -> None:
        drone.wait_for_version()

    run = fly(mission, f"firmware:ardupilot?program={program}", Options(out=tmp_path / "run"))
    assert run.completed
    assert run.record.fidelity == "firmware"
    assert run.record.vehicles["ardupilot"].firmware == "arducopter"
    assert any("flown by the program arducopter 4.6.3" in one for one in run.record.warnings)
    assert (tmp_path / "run/firmware/ardupilot/console.txt").exists()


def test_a_fault_reaches_a_program_and_is_refused_before_the_run_by_one_that_cannot_have_it(model, tmp_path):
    faulty = MODEL.replace("run:", "  faults: {trouble: {kind: gps-lost, vehicle: first, at: 1 s}}\nrun:")
    model.write_text(faulty)
    assert simulate(model, Options(out=tmp_path / "run")).completed
    model.write_text(faulty.replace("at: here}", "at: here, parameters: {SIM_FAULTLESS: 1}}", 1))
    words = (
        r"fault trouble: first: arducopter 4\.6\.3 .*cannot be given gps-lost: it has no parameter SIM_GPS1"
    )
    with pytest.raises(CapabilityError, match=words):
        simulate(model, Options())
    assert runs_in(tmp_path) == []
