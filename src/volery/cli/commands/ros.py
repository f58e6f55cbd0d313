"""Real ROS: the bridge, its interfaces, the graph."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.console import Output
from volery.cli.endings import run_command
from volery.cli.options import Debug, Json, Quiet, Seed


def bridge(
    url: Annotated[str, typer.Argument(metavar="URL", help="ardupilot+serial:///dev/ttyUSB0, sim:px4 ...")],
    graph: Annotated[
        str, typer.Option(metavar="ros1|ros2", help="The graph to put the vehicle on.")
    ] = "ros1",
    names: Annotated[
        str,
        typer.Option(
            metavar="mavros|roscopter|pprzros",
            help="Whose names: pprzros for Paparazzi, the others for all; else the usual ones.",
        ),
    ] = "",
    namespace: Annotated[str, typer.Option(metavar="/NAME", help="Where they begin, such as /mavros.")] = "",
    rate: Annotated[int, typer.Option(help="What the autopilot is asked for, Hz; 0: nothing.")] = 10,
    enable_control: Annotated[
        bool, typer.Option("--enable-control", help="Take roscopter's send_rc; MAVROS's names need no leave.")
    ] = False,
    source_system: Annotated[int, typer.Option(help="The MAVLink system id that it speaks as.")] = 255,
    geoid: Annotated[
        str, typer.Option(metavar="egm96|METRES", help="Mean sea level above the ellipsoid.")
    ] = "egm96",
    speed: Annotated[float, typer.Option(help="Of a simulated vehicle: seconds per second.")] = 1.0,
    seed: Seed = 1,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Put a vehicle on a real ROS graph under the names of MAVROS, roscopter or pprzros, until Ctrl-C.

    In real time, over serial lines (57600 baud unless the address says ?baud=...), UDP and TCP; a link that
    breaks is opened again.
    """
    from volery.cli import bridge as command
    from volery.run.bridge import BridgeOptions

    output = Output(quiet, False, debug)
    wanted = BridgeOptions(
        url=url,
        graph=graph,
        names=names,
        namespace=namespace,
        rate=rate,
        control=enable_control,
        system=source_system,
        geoid=geoid,
        speed=speed,
        seed=seed,
    )
    run_command(output, lambda: command.bridge(output, wanted))


def interfaces(
    packages: Annotated[list[str], typer.Argument(help="Such as roscopter, mavros_msgs, pprzros_msgs.")],
    out: Annotated[Path, typer.Option(help="Where they go, a folder each.")] = Path(),
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Write packages of messages and services, so that rostopic and rosservice know their types."""
    from volery.cli import interfaces as command

    output = Output(quiet, False, debug)
    run_command(output, lambda: command.interfaces(output, packages, out))


def graph(
    source: Annotated[
        str, typer.Argument(metavar="ros1|ros2|FOLDER", help="A real graph, or the folder of a run.")
    ],
    within: Annotated[float, typer.Option(help="Count the rates of a real graph for so many seconds.")] = 2.0,
    svg: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw it.")] = None,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Show the nodes, topics, rates and connections of a ROS graph."""
    from volery.cli import graph as command

    output = Output(quiet, as_json, debug)
    run_command(output, lambda: command.graph(output, command.Wanted(source, within, svg)))
