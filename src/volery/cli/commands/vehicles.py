"""One vehicle, simulated or real: fly it, serve it, check it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.console import Output
from volery.cli.endings import run_command
from volery.cli.options import Debug, Json, Listen, On, Out, Quiet, Seed


def fly(
    mission: Annotated[Path, typer.Argument(help="A Python file with `def mission(drone: Drone)`.")],
    on: On,
    seed: Seed = 1,
    speed: Annotated[str, typer.Option(help="Of a simulated vehicle: max, 1, 10 ...")] = "max",
    fence: Annotated[
        Path | None, typer.Option(metavar="FILE", help="GeoJSON: the polygon to stay in, no-fly zones.")
    ] = None,
    ceiling: Annotated[
        float | None, typer.Option(metavar="METRES", help="Above home, nothing goes higher; else 120.")
    ] = None,
    reserve: Annotated[
        str | None, typer.Option(metavar="SHARE", help="Of the battery, such as 20%: below it only back.")
    ] = None,
    out: Out = None,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Fly a mission on a simulated or a real vehicle: the same file for each."""
    from volery.cli import fly as command

    output = Output(quiet, as_json, debug)
    wanted = command.Wanted(mission, tuple(on), seed, speed, out, fence, ceiling, reserve)
    run_command(output, lambda: command.fly(output, wanted))


def vehicle(
    autopilot: Annotated[str, typer.Argument(help="Which autopilot to simulate.")] = "ardupilot",
    listen: Listen = None,
    speed: Annotated[float, typer.Option(help="Simulated seconds per second.")] = 1.0,
    home: Annotated[
        str | None, typer.Option(metavar="LAT,LON,AMSL", help="Where it stands: degrees, metres.")
    ] = None,
    kind: Annotated[str, typer.Option(help="multirotor or rover.")] = "multirotor",
    sensors: Annotated[str, typer.Option(help="consumer or rtk.")] = "consumer",
    system: Annotated[int | None, typer.Option(help="Its system id, by default 1.")] = None,
    graph: Annotated[
        str, typer.Option(metavar="ros1|ros2", help="Serve it as a node of that graph, where it has one.")
    ] = "",
    seed: Seed = 1,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Serve one simulated vehicle to ground stations, MAVSDK, MAVProxy or a script, until Ctrl-C."""
    from volery.cli import vehicle as command

    output = Output(quiet, False, debug)
    wanted = command.Wanted(autopilot, listen, speed, home, kind, sensors, seed, system, graph)
    run_command(output, lambda: command.vehicle(output, wanted))


def conformance(
    url: Annotated[
        str, typer.Argument(metavar="URL", help="sim:ardupilot, ardupilot+tcp://127.0.0.1:5760 ...")
    ] = "sim:ardupilot",
    only: Annotated[
        str | None, typer.Option(metavar="NAME,...", help="Only these checks, or groups of checks.")
    ] = None,
    only_list: Annotated[bool, typer.Option("--list", help="List the checks and what each demands.")] = False,
    kind: Annotated[str, typer.Option(help="drone or rover.")] = "drone",
    allow_flight: Annotated[
        bool,
        typer.Option("--fly", help="Let a real vehicle arm and fly: 60 m around home and 30 m up are free."),
    ] = False,
    second: Annotated[
        str,
        typer.Option(metavar="URL", help="A second link to the same real vehicle, to play another station."),
    ] = "",
    seed: Seed = 1,
    out: Annotated[Path | None, typer.Option(help="A folder for conformance.json.")] = None,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Check a driver and its autopilot: readiness, operations, refusals, others, the wire.

    A simulated vehicle is a new one for every check and flies in virtual time. A real one goes through the
    checks in order, in real time; those that arm or fly it are left out without --fly. Exit status: 0 if no
    check failed, 2 for bad input, 1 otherwise.
    """
    from volery.cli import conformance as command

    output = Output(quiet, as_json, debug)
    names = tuple(name.strip() for name in (only or "").split(",") if name.strip())
    if only_list:
        run_command(output, lambda: command.show_checks(output, names, kind))
    wanted = command.Wanted(url, names, kind, allow_flight, second, seed, out)
    run_command(output, lambda: command.check(output, wanted))
