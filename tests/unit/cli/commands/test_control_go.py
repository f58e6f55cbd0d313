"""``volery control go``: wrong options are named before anything starts."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from volery.cli.main import application

ON = ("--on", "sim:ardupilot")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("rotation", *ON, "--angle", "90", "--switch", "six"), "--switch six: give the number"),
        (("rotation", *ON, "--angle", "90", "--switch", "19"), "channel 19 of the safety switch"),
        (("rotation", *ON, "--angle", "90", "--on-rc-loss", "pray"), "reaction 'pray'"),
        (("rotation", *ON, "--angle", "90", "--on-telemetry-loss", "continue"), "without telemetry"),
        (("rotation", *ON, "--angle", "nan"), "at least one heading"),
        (("rotation", *ON, "--angle", "90", "--graph", "ros3"), "no graph 'ros3'"),
        (("rotation", *ON, "--angle", "90", "--gains", "nowhere.toml"), "nowhere.toml"),
        (("altitude", *ON, "--to", "-3"), "above 0 m"),
        (("waypoints", *ON), "--point NORTH,EAST,UP"),
        (("waypoints", *ON, "--point", "1,2"), "--point 1,2"),
        (("land", *ON, "--by", "magic"), "by 'magic'"),
        (("land", *ON, "--height", "0"), "above 0"),
    ],
)
def test_wrong_options_are_named(arguments: tuple[str, ...], said: str) -> None:
    result = CliRunner().invoke(application(), ["control", "go", *arguments])
    assert result.exit_code == 2
    assert said in result.stderr
    assert "Traceback" not in result.stderr
