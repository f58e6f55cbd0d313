"""``volery simulate``: a run of a model in virtual time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from volery.base.errors import UsageError
from volery.base.installed import require_extra
from volery.cli.command import Commands
from volery.cli.console import CommandOutput
from volery.cli.options import (
    Allocation,
    Fidelity,
    LogFile,
    LogLevel,
    Model,
    Out,
    Overrides,
    Record,
    Scenario,
    Seed,
    Speed,
    parse_speed,
)

commands = Commands()


@commands.add("quiet", "json", "debug")
def simulate(
    output: CommandOutput,
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
    deployed: Annotated[
        bool,
        typer.Option(help="With --graph: others start the components, from packages of `volery ros deploy`."),
    ] = False,
    bags: Annotated[
        list[Path] | None,
        typer.Option(
            "--bag",
            metavar="RECORDING",
            help="Play a rosbag or an MCAP file into the run from its start; may be repeated.",
        ),
    ] = None,
    out: Out = None,
    record: Record = "trace",
    log_file: LogFile = None,
    log_level: LogLevel = "info",
) -> int:
    """Run a model in virtual time and judge its requirements.

    Exit status: 0 if the run completed and met every requirement, 2 for bad input, 1 otherwise.
    """
    require_extra("simulation", "simulated runs")
    from volery.cli.run_display import read_log_options, recorded_folder, run_progress, show_outcome
    from volery.model.recorded_inputs import with_recordings
    from volery.model.system_loader import load
    from volery.run.assembly.model_checks import vocabulary
    from volery.run.result import NOTHING, TRACE, Options
    from volery.run.simulate import simulate as run_simulation

    pace = parse_speed(speed)
    if deployed and not graph:
        raise UsageError("--deployed: name the graph of the components, too: --graph ros1 or --graph ros2")
    system = load(model, vocabulary(), scenario, allocation, overrides or ())
    inputs = with_recordings(system.environment.inputs, bags or ())
    system = replace(system, environment=replace(system.environment, inputs=inputs))
    title = " · ".join(filter(None, (system.name, system.allocation, system.scenario)))
    with recorded_folder(out, system.name, record) as folder, run_progress(output, title) as show:
        options = Options(
            fidelity=fidelity,
            seed=seed,
            pace=pace,
            out=folder,
            record=TRACE if record == NOTHING else record,
            show=show,
            tell=output.note,
            graph=graph,
            deployed=deployed,
            log=read_log_options(log_file, log_level),
        )
        run = run_simulation(system, options)
    return show_outcome(output, run)
