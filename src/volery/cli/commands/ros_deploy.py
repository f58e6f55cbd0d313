"""``volery ros deploy``: ROS packages for the computers of an allocation."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from volery.cli.command import OK, Commands
from volery.cli.console import CommandOutput, make_table
from volery.cli.options import Allocation, Model, Overrides, Scenario

commands = Commands("ros")


@commands.add("quiet", "json", "debug")
def deploy(
    output: CommandOutput,
    model: Model,
    to: Annotated[
        Path, typer.Option(metavar="DIR", help="New or empty folder, or of an earlier deployment.")
    ],
    allocation: Allocation = None,
    scenario: Scenario = None,
    overrides: Overrides = None,
    ros: Annotated[int, typer.Option(metavar="1|2", help="Version of ROS.")] = 2,
) -> int:
    """Write a ROS package for each computer: hosts of the unmodified components, launch files, units.

    A further package simulates the vehicles and the environment for the deployed components.
    """
    from volery.deploy.generation import deploy as write_packages
    from volery.model.system_loader import load
    from volery.run.assembly.component_builder import with_executables
    from volery.run.assembly.model_checks import vocabulary

    system = with_executables(load(model, vocabulary(), scenario, allocation, overrides or ()))
    made = write_packages(system, to, ros)
    table = make_table("computer", "package")
    for computer, package in made.packages.items():
        table.add_row(computer, package)
    table.add_row("simulated vehicles and environment", made.verification)
    table.add_row("messages and services", made.interfaces)
    output.show(table)
    output.note(f"written: {made.folder}; how to build and start them: {made.folder / 'README.md'}")
    output.give({**asdict(made), "folder": str(made.folder)})
    return OK
