"""Which program flies a vehicle, what it gets, and where it runs."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rigs.standing_ardupilot import write_program
from volery.base.errors import UsageError
from volery.model.environment import FirmwareProgram, PlaceSpec, VehicleSpec
from volery.run.assembly.firmware_programs import (
    FOLDER,
    ProgramFolder,
    check_programs,
    family_of,
    on_real_firmware,
    parameters_of,
)
from volery.simulation.real_firmware.family import RealFirmwareFamily

HERE = PlaceSpec("here", 47.0, 8.0, 400.0, 0.0, 0.0)


def vehicle(name="drone", kind="multirotor", autopilot="ardupilot", **stated):
    return VehicleSpec(name, kind, autopilot, HERE, **stated)


@pytest.fixture
def programs(monkeypatch, tmp_path):
    """Install a copter; no rover is there."""
    monkeypatch.setenv("VOLERY_ARDUCOPTER", str(write_program(tmp_path / "bin" / "arducopter")))
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("VOLERY_ARDUROVER", raising=False)


def test_a_program_is_a_family_of_its_own(programs, tmp_path):
    simulated = family_of(vehicle(version="4.5"), ProgramFolder(tmp_path))
    assert not isinstance(simulated, RealFirmwareFamily)
    real = family_of(
        vehicle(firmware=FirmwareProgram("arducopter", repeatable=True)), ProgramFolder(tmp_path), 7
    )
    assert isinstance(real, RealFirmwareFamily)
    assert (real.name, real.program, real.folder) == (
        "ardupilot",
        tmp_path / "bin" / "arducopter",
        tmp_path / FOLDER,
    )
    assert (real.repeatable, real.seed) == (True, 7)


@pytest.mark.parametrize(
    ("autopilot", "said"),
    [
        ("paparazzi", r"NPS keeps a time of its own.*by URL"),
        ("dji", "on its aircraft only"),
        ("mine", "nothing"),
    ],
)
def test_projects_without_a_link_say_why(autopilot, said, tmp_path):
    with pytest.raises(UsageError, match=said):
        family_of(vehicle(autopilot=autopilot, firmware=FirmwareProgram("program")), ProgramFolder(tmp_path))


def test_at_fidelity_firmware_vehicles_fly_on_the_usual_program_of_their_kind():
    own = vehicle("own", firmware=FirmwareProgram("./mine"))
    copter, rover, aircraft, kept = on_real_firmware(
        [vehicle(version="4.5", features="all"), vehicle("r", "rover"), vehicle("d", autopilot="dji"), own]
    )
    assert copter == replace(vehicle(), firmware=FirmwareProgram("arducopter"))
    assert rover.firmware == FirmwareProgram("ardurover")
    assert aircraft == vehicle("d", autopilot="dji")
    assert kept is own


def test_parameters_of_files_are_below_those_of_the_vehicle(tmp_path):
    (first := tmp_path / "a.parm").write_text("A 1\nB 1\nC 1\n")
    (second := tmp_path / "b.params").write_text("# of a station\n1\t1\tB\t2\t9\n1\t1\tC\t2\t9\n")
    flown = vehicle(parameters={"C": 3.0}, firmware=FirmwareProgram("x", (first, second)))
    assert parameters_of(flown) == {"A": 1.0, "B": 2.0, "C": 3.0}
    assert parameters_of(vehicle(parameters={"C": 3.0})) == {"C": 3.0}


def test_all_that_is_missing_is_named_at_once_by_vehicle(programs, tmp_path):
    wrong = tmp_path / "wrong.parm"
    wrong.write_text("A one\n")
    with pytest.raises(UsageError) as raised:
        check_programs(
            [
                vehicle("fits", firmware=FirmwareProgram("arducopter")),
                vehicle("r1", "rover", firmware=FirmwareProgram("ardurover")),
                vehicle("r2", "rover", firmware=FirmwareProgram("ardurover")),
                vehicle("typo", firmware=FirmwareProgram("arducopter", (wrong,))),
                vehicle("simulated", version="no such"),
            ]
        )
    rovers, typo = str(raised.value).splitlines()
    assert rovers.startswith("r1, r2: there is no ardurover on PATH")
    assert typo == f"typo: {wrong}:1: 'one' is no value of 'A'"


def test_a_folder_of_an_earlier_run_is_removed_and_nothing_else(tmp_path):
    said = []
    folder = ProgramFolder(tmp_path, said.append)
    flown = vehicle(firmware=FirmwareProgram("/opt/bin/copter-4.5"))
    left = folder.path / "drone"
    left.mkdir(parents=True)
    (left / "notes.txt").write_text("not of a program")
    folder.prepare(flown)
    assert (left / "notes.txt").exists()
    (left / "console.txt").write_text("of a program")
    (left / "eeprom.bin").write_text("what it remembers")
    folder.prepare(flown)
    assert not left.exists()
    assert said == ["drone: copter-4.5 boots"] * 2
    folder.close()
    assert folder.path.is_dir()


def test_without_a_run_folder_there_is_a_temporary_one():
    folder = ProgramFolder()
    path = folder.path
    assert path.parent.is_dir()
    assert folder.path == path
    assert folder.bodies.parent == path.parent
    folder.close()
    assert not path.parent.exists()
    folder.close()
