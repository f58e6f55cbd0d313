"""``volery simulate`` and ``volery report``: runs of a model and their reports."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from volery.base.extras import require_extra
from volery.cli.command import OK, Commands
from volery.cli.console import Output
from volery.cli.options import (
    Allocation,
    Fidelity,
    LogFile,
    LogLevel,
    Model,
    Out,
    Overrides,
    Scenario,
    Seed,
    Speed,
    parse_speed,
)

commands = Commands("Simulate")


@commands.add("quiet", "json", "debug")
def simulate(
    output: Output,
    model: Model,
    fidelity: Fidelity = "code",
    allocation: Allocation = None,
    scenario: Scenario = None,
    seed: Seed = 1,
    overrides: Overrides = None,
    speed: Speed = "max",
    graph: Annotated[
        str,
        typer.Option(
            metavar="ros1|ros2", help="Run each component as a process on that ROS graph, in real time."
        ),
    ] = "",
    out: Out = None,
    log_file: LogFile = None,
    log_level: LogLevel = "info",
) -> int:
    """Run a model in virtual time and judge its requirements.

    Exit status: 0 if the run completed and met every requirement, 2 for bad input, 1 otherwise.
    """
    require_extra("simulation", "simulated runs")
    from volery.cli.outcome import read_log_options, run_folder, show_outcome
    from volery.cli.progress import run_progress
    from volery.model.system_loader import load
    from volery.run.assembly.vocabulary import vocabulary
    from volery.run.result import Options
    from volery.run.simulate import simulate as run_simulation

    pace = parse_speed(speed)
    system = load(model, vocabulary(), scenario, allocation, overrides or ())
    title = " · ".join(filter(None, (system.name, system.allocation, system.scenario)))
    with run_folder(out, system.name) as folder, run_progress(output, title) as show:
        options = Options(
            fidelity=fidelity,
            seed=seed,
            pace=pace,
            out=folder,
            show=show,
            tell=output.note,
            graph=graph,
            log=read_log_options(log_file, log_level),
        )
        run = run_simulation(system, options)
    return show_outcome(output, run)


@commands.add("quiet", "json", "debug")
def report(
    output: Output,
    folders: Annotated[list[Path], typer.Argument(help="A run folder; several are compared.")],
) -> int:
    """Write the report of a run again from its trace, or compare several runs.

    Also writes the report of a run that was killed. The comparison of several is written as a page into the
    folder that contains them.
    """
    from volery.report.html_report import recover, write_comparison
    from volery.report.terminal import comparison_table, summary_table

    found = [recover(folder) for folder in folders]
    records = [one.record for one in found]
    if len(records) == 1:
        output.show(summary_table(records[0]))
    else:
        output.show(comparison_table(records, [folder.name for folder in folders]))
    as_text = [record.model_dump_json(by_alias=True, indent=2) for record in records]
    output.give(as_text[0] if len(as_text) == 1 else f"[{', '.join(as_text)}]")
    for one in found:
        output.note(f"report: {one.report}")
        if one.lost:
            output.note(f"  {one.lost}")
    if len(folders) > 1:
        common = Path(os.path.commonpath([folder.resolve().parent for folder in folders]))
        shown = Path(os.path.relpath(common))
        output.note(f"side by side: {write_comparison(folders, shown)}")
    return OK
