"""``volery fly``: a mission on simulated or real vehicles."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.base.errors import UsageError
from volery.cli.command import Commands
from volery.cli.console import CommandOutput
from volery.cli.options import IfKilled, LogFile, LogLevel, Out, Record, Seed, Speed, parse_speed

commands = Commands()


@commands.add("quiet", "json", "debug")
def fly(
    output: CommandOutput,
    mission: Annotated[Path, typer.Argument(help="Python file with `def mission(drone: Drone)`.")],
    on: Annotated[
        list[str],
        typer.Option(
            metavar="URL",
            help="Address of a vehicle, such as sim:ardupilot or ardupilot+tcp://127.0.0.1:5760; "
            "may be repeated.",
        ),
    ],
    seed: Seed = 1,
    speed: Speed = "max",
    fence: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Geofence in GeoJSON: inclusion polygon and no-fly zones."),
    ] = None,
    ceiling: Annotated[
        float | None,
        typer.Option(metavar="METRES", help="Greatest height above home; 120 if nothing else is stated."),
    ] = None,
    reserve: Annotated[
        str | None,
        typer.Option(
            metavar="SHARE", help="Battery reserve, such as 20%; below it the vehicle only returns or lands."
        ),
    ] = None,
    if_killed: IfKilled = None,
    out: Out = None,
    record: Record = "trace",
    log_file: LogFile = None,
    log_level: LogLevel = "info",
) -> int:
    """Fly a mission on a simulated or a real vehicle; the mission file is the same for both."""
    from volery.cli.run_display import read_log_options, recorded_folder, run_progress, show_outcome
    from volery.run.assembly.fences import read_fence
    from volery.run.fly import Restrictions
    from volery.run.fly import fly as run_flight
    from volery.run.result import NOTHING, TRACE, Options

    if not mission.is_file():
        expected = "a Python file with `def mission(drone: Drone)` is expected"
        raise UsageError(f"there is no file {str(mission)!r}; {expected}")
    pace = parse_speed(speed)
    restrictions = Restrictions(
        fence=read_fence(fence) if fence is not None else None,
        highest=ceiling,
        battery_reserve=_share(reserve) if reserve is not None else None,
    )
    with (
        recorded_folder(out, mission.stem, record) as folder,
        run_progress(output, f"{mission.name} on {', '.join(on)}") as show,
    ):
        options = Options(
            fidelity="hardware",
            seed=seed,
            pace=pace,
            out=folder,
            record=TRACE if record == NOTHING else record,
            show=show,
            tell=output.note,
            log=read_log_options(log_file, log_level),
            if_killed=if_killed,
        )
        run = run_flight(mission, on, options, restrictions)
    return show_outcome(output, run)


def _share(reserve: str) -> float:
    """Parse ``20%`` or ``0.2``."""
    number = reserve.removesuffix("%")
    try:
        share = float(number) / (100.0 if number != reserve else 1.0)
    except ValueError:
        share = -1.0
    if not 0.0 <= share < 1.0:
        raise UsageError(f"--reserve {reserve}: give a share of the battery, such as 20% or 0.2")
    return share
