"""Runs of a model: the demo, simulating, reports; and what to begin with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.console import Output
from volery.cli.endings import run_command
from volery.cli.options import Allocation, Debug, Fidelity, Json, Model, Out, Overrides, Quiet, Scenario, Seed


def demo(
    out: Annotated[Path, typer.Option(help="Where the run folders go.")] = Path("runs/demo"),
    seed: Seed = 7,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Three parcels across a city, on two allocations side by side, and a report."""
    from volery.cli import demo as command

    output = Output(quiet, as_json, debug)
    run_command(output, lambda: command.demo(output, out, seed))


def new(
    folder: Annotated[Path, typer.Argument(help="The folder to make.")],
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Make a small model that runs, to start from."""
    from volery.cli import new as command

    output = Output(quiet, False, debug)
    run_command(output, lambda: command.new(output, folder))


def doctor(as_json: Json = False, debug: Debug = False) -> None:
    """What is installed, what each missing part would enable, and how to get it."""
    from volery.cli import doctor as command

    output = Output(False, as_json, debug)
    run_command(output, lambda: command.doctor(output))


def simulate(
    model: Model,
    fidelity: Fidelity = "code",
    allocation: Allocation = None,
    scenario: Scenario = None,
    seed: Seed = 1,
    overrides: Overrides = None,
    speed: Annotated[str, typer.Option(help="Simulated seconds per second: max, 1, 10 ...")] = "max",
    graph: Annotated[
        str,
        typer.Option(metavar="ros1|ros2", help="With each component as a process on that graph; --speed 1."),
    ] = "",
    out: Out = None,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Run a model in virtual time and judge its requirements.

    Exit status: 0 if it completed and met every requirement, 2 for bad input, 1 otherwise.
    """
    from volery.cli import simulate as command

    output = Output(quiet, as_json, debug)
    changes = tuple(overrides or ())
    wanted = command.Wanted(model, fidelity, allocation, scenario, seed, changes, speed, out, graph)
    run_command(output, lambda: command.simulate(output, wanted))


def report(
    folders: Annotated[list[Path], typer.Argument(help="A run folder; several are compared.")],
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Write the report of a run again, from its trace, even of a run that was killed; compare several."""
    from volery.cli import report as command

    output = Output(quiet, as_json, debug)
    run_command(output, lambda: command.report(output, folders))
