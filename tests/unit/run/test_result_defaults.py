"""Defaults of a run: the same in Python and on the command line."""

from __future__ import annotations

import inspect

import pytest

from volery.cli.commands import simulate as command
from volery.run.result import Options


@pytest.mark.parametrize("name", ["fidelity", "seed"])
def test_the_command_line_has_the_default_of_python(name: str) -> None:
    stated = inspect.signature(command.simulate).parameters[name].default
    assert stated == getattr(Options(), name)
