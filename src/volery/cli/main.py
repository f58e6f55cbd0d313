"""``volery``: all commands."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Annotated

import typer

from volery.cli.commands import bags, costs, models, ros, runs, vehicles
from volery.cli.console import Output
from volery.cli.endings import FAILED

app = typer.Typer(
    help="Model a drone-and-rover service once, simulate it, fly it, and know what it costs the computers.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    context_settings={"help_option_names": ["-h", "--help"]},
)
COMMANDS: tuple[Callable[..., None], ...] = (
    runs.demo,
    runs.new,
    runs.doctor,
    runs.simulate,
    runs.report,
    vehicles.fly,
    vehicles.vehicle,
    vehicles.conformance,
    ros.bridge,
    ros.interfaces,
    ros.graph,
    costs.cost,
    costs.measure,
)
GROUPS: tuple[tuple[str, str, tuple[Callable[..., None], ...]], ...] = (
    (
        "model",
        "Look at a model without running it.",
        (models.check, models.show, models.schema, models.observables),
    ),
    (
        "bag",
        "Recordings of ROS topics: rosbag 1, rosbag 2 and MCAP.",
        (bags.info, bags.play, bags.record, bags.convert),
    ),
    (
        "calibrate",
        "Measure what computing takes on this machine.",
        (costs.ros, costs.python, costs.processor, costs.components),
    ),
)

for command in COMMANDS:
    app.command()(command)
for name, told, members in GROUPS:
    group = typer.Typer(help=told, no_args_is_help=True)
    for member in members:
        group.command()(member)
    app.add_typer(group, name=name)


def version(wanted: bool) -> None:
    """Print the version and stop."""
    if wanted:
        from volery.run.recording import own_version

        typer.echo(f"volery {own_version()}")
        raise typer.Exit


@app.callback()
def root(
    show_version: Annotated[
        bool, typer.Option("--version", callback=version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Model a drone-and-rover service once, simulate it, fly it, and know what it costs the computers."""


def main() -> None:
    """The entry point."""
    try:
        app(prog_name="volery")
    except ImportError as error:
        Output().complain(f"volery: a part is missing: {error}; `volery doctor` says how to get it")
        sys.exit(FAILED)
