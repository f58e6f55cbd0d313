"""``volery vehicle world``: the world of a model for programs that others start."""

from __future__ import annotations

from typing import Annotated

import typer

from volery.base.errors import UsageError
from volery.base.installed import require_extra
from volery.base.time import from_seconds
from volery.cli.command import Commands
from volery.cli.console import CommandOutput
from volery.cli.options import (
    Allocation,
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

commands = Commands("vehicle")


@commands.add("quiet", "debug")
def world(
    output: CommandOutput,
    model: Model,
    json: Annotated[
        str,
        typer.Option(
            metavar="[HOST]:PORT",
            help="Where the first vehicle's program asks over ArduPilot's JSON interface; that of each "
            "further vehicle asks 10 ports above the last.",
        ),
    ] = ":9002",
    vehicle: Annotated[str, typer.Option(metavar="NAME", help="Serve this vehicle alone.")] = "",
    rate: Annotated[
        float | None,
        typer.Option(
            metavar="HZ",
            help="Exchanges per simulated second; by default 800 for a multirotor, 100 for a rover.",
        ),
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="End after so much simulated time; by default by Ctrl-C."),
    ] = None,
    allocation: Allocation = None,
    scenario: Scenario = None,
    seed: Seed = 1,
    overrides: Overrides = None,
    speed: Speed = "max",
    out: Out = None,
    record: Record = "trace",
    log_file: LogFile = None,
    log_level: LogLevel = "info",
) -> int:
    """Serve the world of a model to programs that fly its vehicles over ArduPilot's JSON interface.

    The programs are firmware or your own controllers. Time passes as they ask, until Ctrl-C.
    """
    require_extra("simulation", "simulated vehicles")
    from volery.cli.run_display import read_log_options, recorded_folder, run_progress, show_outcome
    from volery.model.system_loader import load
    from volery.run.assembly.model_checks import vocabulary
    from volery.run.result import NOTHING, TRACE, Options
    from volery.run.serve_world import WorldPorts, WorldSession
    from volery.vehicles.address import parse_listen

    pace = parse_speed(speed)
    if duration is not None and not 0.0 < duration < 1e9:
        raise UsageError(f"--duration {duration:g}: give simulated seconds above 0")
    address = parse_listen(f"udp://{json}")
    if address.port is None:
        raise UsageError(f"--json {json}: give a port, too, such as --json :9002")
    ports = WorldPorts(address.host or "127.0.0.1", address.port, rate, vehicle)
    system = load(model, vocabulary(), scenario, allocation, overrides or ())
    title = " · ".join(filter(None, (system.name, system.scenario)))
    with recorded_folder(out, system.name, record) as folder, run_progress(output, title) as show:
        options = Options(
            fidelity="times",
            seed=seed,
            pace=pace,
            out=folder,
            record=TRACE if record == NOTHING else record,
            show=show,
            tell=output.note,
            log=read_log_options(log_file, log_level),
        )
        session = WorldSession(
            system, options, ports, None if duration is None else from_seconds(duration), output.note
        )
        try:
            for one in session.served:
                output.note(f"{one.name} waits for a program at {one.address}, such as\n  {one.command}")
            if system.instances:
                output.note("the components of the model do not run; Ctrl-C ends the world")
            run = session.run()
        finally:
            session.leave()
    return show_outcome(output, run)
