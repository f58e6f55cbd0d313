"""How a program of real firmware is found, and what is said where there is none."""

from __future__ import annotations

import pytest

from volery.base.errors import UsageError
from volery.simulation.real_firmware.family import PROJECTS
from volery.simulation.real_firmware.program_search import (
    PROGRAMS,
    find_program,
    how_to_get,
    variable,
)


@pytest.fixture
def nothing_installed(monkeypatch, tmp_path):
    """Let no program be found, and return the one folder of PATH."""
    for project in PROGRAMS.values():
        for program in project.targets:
            monkeypatch.delenv(variable(program), raising=False)
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    return folder


def executable(path):
    path.write_text("#!/bin/sh\n")
    path.chmod(0o755)
    return path


def test_every_project_that_is_linked_has_programs():
    assert set(PROJECTS) <= set(PROGRAMS)
    for project in PROGRAMS.values():
        assert set(project.programs.values()) == set(project.targets)


def test_a_usual_name_is_that_of_its_variable_before_that_on_the_path(
    nothing_installed, monkeypatch, tmp_path
):
    on_path, stated = executable(nothing_installed / "px4"), executable(tmp_path / "my_px4")
    assert find_program("px4") == on_path
    monkeypatch.setenv("VOLERY_PX4", str(stated))
    assert find_program("px4") == stated
    monkeypatch.setenv("VOLERY_PX4", "")
    assert find_program("px4") == on_path


def test_any_other_name_is_that_on_the_path_and_a_path_is_itself(nothing_installed, monkeypatch, tmp_path):
    on_path = executable(nothing_installed / "copter-4.5")
    assert find_program("copter-4.5") == on_path
    executable(tmp_path / "copter")
    monkeypatch.chdir(tmp_path)
    assert find_program("./copter") == tmp_path / "copter"


def test_a_usual_program_that_is_missing_is_named_with_its_build(nothing_installed):
    with pytest.raises(UsageError) as raised:
        find_program("ardurover")
    said = str(raised.value)
    assert "no ardurover on PATH, and VOLERY_ARDUROVER does not state one" in said
    assert "./waf rover, then VOLERY_ARDUROVER=SOURCES/build/sitl/bin/ardurover" in said
    assert how_to_get("px4").startswith("make px4_sitl_default, then VOLERY_PX4=")


def test_other_programs_that_are_missing_are_named(nothing_installed, monkeypatch, tmp_path):
    with pytest.raises(UsageError, match=r"no program 'copter' on PATH; give its path, such as \./copter"):
        find_program("copter")
    with pytest.raises(UsageError, match=r"/copter: there is no such program"):
        find_program(str(tmp_path / "copter"))
    monkeypatch.setenv("VOLERY_PX4", str(tmp_path / "nowhere"))
    with pytest.raises(UsageError, match=r"nowhere \(VOLERY_PX4\): there is no such program"):
        find_program("px4")


def test_a_file_that_cannot_be_executed_is_no_program(tmp_path):
    file = tmp_path / "copter"
    file.write_text("")
    with pytest.raises(UsageError, match=r"copter cannot be executed; make it so with: chmod \+x "):
        find_program(str(file))
    with pytest.raises(UsageError, match="there is no such program"):
        find_program(f"{tmp_path}/")
