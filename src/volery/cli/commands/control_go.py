"""``volery control go``: flights under laws of this program, with the operator's safety switch on top."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from volery.base.errors import UsageError
from volery.cli.command import OK, Commands
from volery.cli.console import CommandOutput, make_table, number_column
from volery.cli.options import IfKilled, Out, Seed, Speed, parse_speed

if TYPE_CHECKING:
    from collections.abc import Callable

    from volery.control.manoeuvres import LawManoeuvre
    from volery.control.safety_switch import SwitchSettings
    from volery.run.go import GoSettings
    from volery.trace.events import Event

commands = Commands("control go", "Fly under a control law on this side of the link.")

On = Annotated[str, typer.Option(metavar="URL", help="Address of the vehicle, such as sim:ardupilot.")]
By = Annotated[
    str,
    typer.Option(
        metavar="setpoints|attitude|rc",
        help="Apply commands as velocity or attitude set-points, or by RC override.",
    ),
]
Height = Annotated[float, typer.Option(metavar="METRES", help="Height of the take-off above home.")]
Hold = Annotated[float, typer.Option(metavar="SECONDS", help="Time for each set-point.")]


@dataclass(frozen=True, kw_only=True)
class SwitchOptions:
    """Options of the operator's safety switch."""

    switch: Annotated[
        str | None,
        typer.Option(
            metavar="CHANNEL|none",
            help="RC channel of the safety switch: below 1200 us manual, to 1700 us autonomous, above land. "
            "By default 6; none on a simulated vehicle without a transmitter.",
        ),
    ] = None
    on_rc_loss: Annotated[
        str, typer.Option(metavar="land|release|continue", help="Reaction to the loss of the transmitter.")
    ] = "land"
    on_telemetry_loss: Annotated[
        str, typer.Option(metavar="land|release", help="Reaction to the loss of telemetry.")
    ] = "land"
    emergency: Annotated[
        str,
        typer.Option(
            metavar="autopilot|ramp",
            help="Who flies the emergency landing: the autopilot, which needs no link, or the landing law.",
        ),
    ] = "autopilot"

    def settings(self, on: str, output: CommandOutput) -> SwitchSettings | None:
        """Return the settings of the switch of the vehicle at *on*, or None to fly without.

        Raises:
            UsageError: an option or the address is wrong.
        """
        from volery.control.safety_switch import SwitchSettings, parse_emergency, parse_reaction
        from volery.run.go import has_transmitter

        rc, telemetry = parse_reaction(self.on_rc_loss), parse_reaction(self.on_telemetry_loss)
        emergency = parse_emergency(self.emergency)
        switch = self.switch or ("6" if has_transmitter(on) else "none")
        if self.switch is None and switch == "none":
            output.note(f"{on} has no transmitter: it flies without a safety switch (--switch none)")
        if switch == "none":
            return None
        if not switch.isdecimal():
            raise UsageError(f"--switch {switch}: give the number of an RC channel, or none")
        return SwitchSettings(
            channel=int(switch), on_rc_loss=rc, on_telemetry_loss=telemetry, emergency=emergency
        )


@dataclass(frozen=True, kw_only=True)
class FlightOptions(SwitchOptions):
    """Options of every flight under a law."""

    on: On
    by: By = "setpoints"
    gains: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Gains by loop in TOML; read again while the vehicle flies."),
    ] = None
    graph: Annotated[
        str | None,
        typer.Option(
            "--graph",
            metavar="ros1|ros2",
            help="Gains are parameters of the node volery_go on real ROS, such as ~yaw/kp, also in flight.",
        ),
    ] = None
    if_killed: IfKilled = None
    seed: Seed = 1
    speed: Speed = "max"
    out: Out = None

    def flight(self, height: float, output: CommandOutput) -> GoSettings:
        """Return the settings of a flight that takes off to *height* m.

        Raises:
            UsageError: an option is wrong.
        """
        from volery.run.go import GoSettings

        return GoSettings(
            by=self.by,
            switch=self.settings(self.on, output),
            height=height,
            gains=self.gains,
            graph=self.graph or "",
        )


@commands.add("quiet", "json", "debug")
def rotation(
    output: CommandOutput,
    options: FlightOptions,
    angle: Annotated[
        list[float], typer.Option(help="Heading in degrees, clockwise from north; may be repeated.")
    ],
    hold: Hold = 15.0,
    height: Height = 5.0,
) -> int:
    """Take off, turn to one heading after the other, and land."""
    from volery.control.manoeuvres import Rotation

    return _go(output, "rotation", lambda: Rotation(angle, hold), options, height)


@commands.add("quiet", "json", "debug")
def altitude(
    output: CommandOutput,
    options: FlightOptions,
    to: Annotated[list[float], typer.Option(help="Height above home in metres; may be repeated.")],
    hold: Hold = 15.0,
    height: Height = 3.0,
) -> int:
    """Take off, climb or descend to one height after the other, and land."""
    from volery.control.manoeuvres import Altitude

    return _go(output, "altitude", lambda: Altitude(to, hold), options, height)


@commands.add("quiet", "json", "debug")
def waypoints(
    output: CommandOutput,
    options: FlightOptions,
    point: Annotated[
        list[str] | None,
        typer.Option(metavar="NORTH,EAST,UP", help="Way point in metres about home; may be repeated."),
    ] = None,
    cube: Annotated[
        float | None, typer.Option(metavar="METRES", help="Fly the corners of a cube of this side instead.")
    ] = None,
    tolerance: Annotated[
        float, typer.Option(help="Distance within which a point counts as reached, m.")
    ] = 0.5,
    hold: Annotated[float, typer.Option(help="Time within the tolerance before the next point, s.")] = 1.0,
    rounds: Annotated[int, typer.Option(help="How often the sequence is flown.")] = 1,
    height: Height = 5.0,
) -> int:
    """Take off, fly to way points one after the other, and land."""
    from volery.control import manoeuvres

    if (cube is None) == (not point):
        raise UsageError("give --point NORTH,EAST,UP once or more, or --cube METRES")
    if cube is not None and not cube > 0.0:
        raise UsageError(f"--cube {cube:g}: give a side above 0 m")
    points = [_point(one) for one in point or []] if cube is None else manoeuvres.cube(cube, height)

    def make() -> LawManoeuvre:
        return manoeuvres.Waypoints(points, tolerance=tolerance, hold_s=hold, rounds=rounds)

    return _go(output, "waypoints", make, options, height)


@commands.add("quiet", "json", "debug")
def land(
    output: CommandOutput,
    options: FlightOptions,
    height: Height = 10.0,
) -> int:
    """Land in steps of descent with the heading kept, and disarm; take off first if the vehicle stands."""
    from volery.control.manoeuvres import Altitude

    return _go(output, "land", lambda: Altitude([height], 0.1), options, height)


@commands.add("quiet", "json", "debug")
def cube(
    output: CommandOutput,
    graph: Annotated[
        str | None,
        typer.Option(
            "--graph", metavar="ros1|ros2", help="Serve it on real ROS; by default in virtual time."
        ),
    ] = None,
    controller: Annotated[bool, typer.Option(help="Fly it by the thesis's controller.")] = True,
    rounds: Annotated[
        int, typer.Option(help="How often the goals are flown; 0 without end, on real ROS.")
    ] = 1,
    out: Out = None,
) -> int:
    """Simulate a vehicle by its velocities (cmd_vel, poseupdate) and fly the thesis's cube of goals."""
    from volery.cli.run_display import run_folder
    from volery.run.velocity_cube import fly_cube, serve_cube

    if rounds < 0 or (rounds == 0 and graph is None):
        raise UsageError(f"--rounds {rounds}: give 1 or more; 0 is for a vehicle on real ROS")
    if graph is not None:
        output.note(f"on {graph}: cmd_vel, poseupdate, odom; Ctrl-C ends it")
        serve_cube(graph, controlled=controller, rounds=rounds)
        return OK
    if not controller:
        raise UsageError("--no-controller: in virtual time nothing else can fly it; add --graph")
    with run_folder(out, "cube") as folder:
        reached = fly_cube(folder, rounds)
        table = make_table("goal", number_column("at"), number_column("distance"))
        for number, (at, distance) in enumerate(reached, 1):
            table.add_row(str(number), f"{at:.1f} s", f"{distance:.3f} m")
        output.show(table)
        output.give([{"at_s": at, "distance_m": distance} for at, distance in reached])
        output.note(f"run folder: {folder}")
    return OK


def _point(text: str) -> tuple[float, float, float]:
    try:
        north, east, up = (float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"--point {text}: give NORTH,EAST,UP in metres, as in 5,0,10") from None
    return north, east, up


def _go(
    output: CommandOutput, name: str, make: Callable[[], LawManoeuvre], options: FlightOptions, height: float
) -> int:
    from volery.cli.run_display import run_folder, run_progress, show_outcome
    from volery.run.go import go
    from volery.run.result import Options
    from volery.trace.events import ControlSample

    pace = parse_speed(options.speed)
    settings = options.flight(height, output)
    with (
        run_folder(options.out, f"go-{name}") as folder,
        run_progress(output, f"{name} on {options.on}") as show,
    ):
        how = Options(
            fidelity="hardware",
            seed=options.seed,
            pace=pace,
            out=folder,
            show=show,
            tell=output.note,
            if_killed=options.if_killed,
        )
        flown: list[Event] = []

        def note_sample(event: Event) -> None:
            if not flown and isinstance(event, ControlSample):
                flown.append(event)

        run = go(make, options.on, settings, how, listener=note_sample)
    status = show_outcome(output, run)
    if flown:
        output.note(f"volery control response {run.folder} judges its loops")
    return status
