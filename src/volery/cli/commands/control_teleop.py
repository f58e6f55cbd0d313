"""``volery control teleop`` and ``twin``: a vehicle follows an operator, a record or another vehicle."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from volery.base.errors import UsageError
from volery.cli.command import FAILED, Commands
from volery.cli.commands.control_go import By, Height
from volery.cli.console import CommandOutput, make_table, number_column
from volery.cli.options import IfKilled, Out, Seed

if TYPE_CHECKING:
    from volery.control.teleoperation import Input
    from volery.vehicles import Drone

commands = Commands("control")


@commands.add("quiet", "json", "debug")
def teleop(
    output: CommandOutput,
    url: Annotated[str, typer.Argument(help="Address of the vehicle, such as sim:ardupilot.")],
    joystick: Annotated[
        Path | None,
        typer.Option(metavar="DEVICE", help="Joystick such as /dev/input/js0; else the keyboard."),
    ] = None,
    by: By = "setpoints",
    speed_limit: Annotated[float, typer.Option("--max-speed", help="Greatest speed over ground, m/s.")] = 2.0,
    turn_limit: Annotated[float, typer.Option("--max-turn", help="Greatest turn rate, degrees/s.")] = 45.0,
    height: Height = 3.0,
    if_killed: IfKilled = None,
    out: Out = None,
) -> int:
    """Fly by keyboard or joystick: take off, hold a key or the dead-man button, let go to hover."""
    from volery.cli.run_display import run_folder, show_outcome, status_line
    from volery.control import teleoperation
    from volery.run.fly import fly
    from volery.run.go import ACTUATIONS, GoSettings, with_rates
    from volery.run.result import Options
    from volery.vehicles.address import parse

    settings = GoSettings(by=by, height=height)
    limits = teleoperation.TeleopLimits(speed=speed_limit, turn=turn_limit)
    pace = 1.0 if parse(url).in_virtual_time else None
    with ExitStack() as stack:
        source: Input
        if joystick is not None:
            device = teleoperation.Joystick(joystick)
            stack.callback(device.close)
            source = device
            output.note("hold the left shoulder button; button 1 lands")
        else:
            source = stack.enter_context(teleoperation.keyboard())
            output.note(teleoperation.HELP)
        folder = stack.enter_context(run_folder(out, "teleop"))
        show = stack.enter_context(status_line(output))
        ended = ""

        def mission(drone: Drone) -> None:
            nonlocal ended
            actuation = ACTUATIONS[settings.by](drone)
            ended = teleoperation.teleoperate(drone, source, actuation, limits, settings.height, show)

        options = Options(fidelity="hardware", pace=pace, out=folder, tell=output.note, if_killed=if_killed)
        run = fly(mission, with_rates(url, None), options)
    status = show_outcome(output, run)
    if ended not in {"", teleoperation.LAND, teleoperation.QUIT}:
        output.complain(f"volery: {ended}; the drone was landed")
        return FAILED
    return status


@commands.add("quiet", "json", "debug")
def twin(
    output: CommandOutput,
    source: Annotated[
        str,
        typer.Argument(help="Record (run folder, bag, tlog, .bin, .ulg) or address of a vehicle to follow."),
    ],
    on: Annotated[str, typer.Option(metavar="URL", help="Address of the twin.")] = "sim:ardupilot?start=warm",
    mission: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Mission of the vehicle that is followed, to try it out."),
    ] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw both traces into a figure.")] = None,
    seed: Seed = 1,
    out: Out = None,
) -> int:
    """Let a vehicle follow the heading and position of another or of a record; print the tracking error."""
    from volery.cli.run_display import run_folder, show_outcome
    from volery.control.log_signals import read_signals
    from volery.report.response_figure import check_format, draw_records
    from volery.run.result import Options
    from volery.run.twin import follow_record, follow_vehicle

    if plot is not None:
        check_format(plot)
    is_record = Path(source).exists()
    if not is_record and ":" not in source:
        raise UsageError(f"{source} is neither a record nor the address of a vehicle")
    if is_record and mission is not None:
        raise UsageError(f"--mission {mission}: a record needs no mission")
    with run_folder(out, "twin") as folder:
        options = Options(fidelity="hardware", seed=seed, out=folder, tell=output.note)
        if is_record:
            found = follow_record(Path(source), on, options)
        else:
            found = follow_vehicle(source, on, options, mission)
        table = make_table("error", "unit", *map(number_column, ("rms", "95 %", "greatest")))
        for one in found.errors:
            table.add_row(one.quantity, one.unit, f"{one.rms:.2f}", f"{one.p95:.2f}", f"{one.greatest:.2f}")
        output.show(table)
        output.note(found.judged)
        output.give({error.quantity: error._asdict() for error in found.errors})
        if plot is not None:
            draw_records(
                [(signal, ()) for signal in read_signals(folder) if signal.controller == "twin"], plot
            )
            output.note(f"plot: {plot}")
    return show_outcome(CommandOutput(quiet=True, debug=output.debug) if output.json else output, found.run)
