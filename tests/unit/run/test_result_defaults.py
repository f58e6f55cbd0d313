"""Defaults of a run: the same in Python and on the command line."""

from __future__ import annotations

import inspect
from pathlib import Path

import pytest

from volery.cli.commands import simulate as command
from volery.run.result import Options


@pytest.mark.parametrize("name", ["fidelity", "seed"])
def test_the_command_line_has_the_default_of_python(name: str) -> None:
    stated = inspect.signature(command.simulate).parameters[name].default
    assert stated == getattr(Options(), name)


@pytest.mark.parametrize("folder", ["r1", Path("r1")])
def test_a_run_folder_is_a_path_or_its_text(folder: Path | str) -> None:
    assert Options(out=folder).folder == Path("r1")
