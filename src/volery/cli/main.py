"""``volery``: the commands and their options."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from volery.cli.console import Output
from volery.cli.endings import FAILED, run_command

app = typer.Typer(
    help="Model a drone-and-rover service once, simulate it, fly it, and know what it costs the computers.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
model_app = typer.Typer(help="Look at a model without running it.", no_args_is_help=True)
app.add_typer(model_app, name="model")
bag_app = typer.Typer(help="Recordings of ROS topics: rosbag 1, rosbag 2 and MCAP.", no_args_is_help=True)
app.add_typer(bag_app, name="bag")
calibrate_app = typer.Typer(help="Measure what computing takes on this machine.", no_args_is_help=True)
app.add_typer(calibrate_app, name="calibrate")

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing but what is wrong.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on standard output.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
Seed = Annotated[int, typer.Option(help="Seeds every random stream of the run.")]
Out = Annotated[Path | None, typer.Option(help="The run folder; by default a new one in ./runs.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="Override a value of the model; may be repeated."),
]
Fidelity = Annotated[
    str,
    typer.Option(metavar="times|code", help="Stated times, or the cost of the components' own code."),
]
On = Annotated[
    list[str],
    typer.Option(metavar="URL", help="sim:ardupilot, ardupilot+tcp://127.0.0.1:5760 ...; one per vehicle."),
]
Listen = Annotated[
    str | None,
    typer.Option(metavar="URL", help="tcp://HOST:PORT or udp://:PORT; without it, send to UDP 14550."),
]
Scenario = Annotated[str | None, typer.Option(help="A scenario of the model.")]
Allocation = Annotated[str | None, typer.Option(help="An allocation of the model; by default its first.")]
OnGraph = Annotated[str, typer.Option("--graph", metavar="ros1|ros2", help="The graph.")]
Topics = Annotated[
    list[str] | None, typer.Option("--topic", metavar="NAME", help="Only this topic; may be repeated.")
]
Recording = Annotated[Path, typer.Argument(help="A .bag or .mcap file, or the folder of a rosbag 2.")]
Model = Annotated[Path, typer.Argument(help="A model file, or a folder with a model.yaml.")]


def version(wanted: bool) -> None:
    """Print the version and stop."""
    if wanted:
        from volery.run.circumstances import own_version

        typer.echo(f"volery {own_version()}")
        raise typer.Exit


@app.callback()
def root(
    show_version: Annotated[
        bool, typer.Option("--version", callback=version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Model a drone-and-rover service once, simulate it, fly it, and know what it costs the computers."""


@app.command()
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


@app.command()
def new(
    folder: Annotated[Path, typer.Argument(help="The folder to make.")],
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Make a small model that runs, to start from."""
    from volery.cli import new as command

    output = Output(quiet, False, debug)
    run_command(output, lambda: command.new(output, folder))


@app.command()
def doctor(as_json: Json = False, debug: Debug = False) -> None:
    """What is installed, what each missing part would enable, and how to get it."""
    from volery.cli import doctor as command

    output = Output(False, as_json, debug)
    run_command(output, lambda: command.doctor(output))


@app.command()
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


@app.command()
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


@app.command()
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


@app.command()
def bridge(
    url: Annotated[str, typer.Argument(metavar="URL", help="ardupilot+serial:///dev/ttyUSB0, sim:px4 ...")],
    graph: Annotated[
        str, typer.Option(metavar="ros1|ros2", help="The graph to put the vehicle on.")
    ] = "ros1",
    names: Annotated[
        str, typer.Option(metavar="mavros|roscopter|pprzros", help="Whose names; else the usual ones.")
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
    from volery.run.bridging import Bridging

    output = Output(quiet, False, debug)
    wanted = Bridging(
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


@app.command()
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


@app.command()
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


@app.command()
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


@bag_app.command("info")
def bag_info(recording: Recording, as_json: Json = False, debug: Debug = False) -> None:
    """List what was recorded."""
    from volery.cli import bag as command

    output = Output(False, as_json, debug)
    run_command(output, lambda: command.info(output, recording))


@bag_app.command("play")
def bag_play(
    recording: Recording,
    on: OnGraph = "ros1",
    rate: Annotated[float, typer.Option(help="Recorded seconds per second.")] = 1.0,
    topics: Topics = None,
    after: Annotated[float, typer.Option(help="Begin so many recorded seconds from the start.")] = 0.0,
    clock: Annotated[bool, typer.Option("--clock", help="Publish the recorded time on /clock.")] = False,
    delay: Annotated[float, typer.Option(help="Seconds for others to connect, and to hear the last.")] = 0.5,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Play a recording into a real graph."""
    from volery.cli import bag as command

    output = Output(quiet, as_json, debug)
    wanted = command.Wanted(on, tuple(topics or ()), rate, after, clock, delay)
    run_command(output, lambda: command.play_bag(output, recording, wanted))


@bag_app.command("record")
def bag_record(
    out: Annotated[Path, typer.Argument(help="NAME.bag for a rosbag 1; else the folder of a rosbag 2.")],
    on: OnGraph = "ros1",
    topics: Topics = None,
    seconds: Annotated[float | None, typer.Option(help="How long; else until Ctrl-C.")] = None,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Record a real graph: every topic as it appears, or those that are named."""
    from volery.cli import bag as command

    output = Output(quiet, as_json, debug)
    wanted = command.Wanted(on, tuple(topics or ()))
    run_command(output, lambda: command.record(output, out, wanted, seconds))


@bag_app.command("convert")
def bag_convert(
    recording: Recording,
    out: Annotated[Path, typer.Argument(help="NAME.bag for a rosbag 1; else the folder of a rosbag 2.")],
    topics: Topics = None,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Write a recording, or the trace of a run, in another format."""
    from volery.cli import bag as command

    output = Output(quiet, as_json, debug)
    run_command(output, lambda: command.convert(output, recording, out, tuple(topics or ())))


@calibrate_app.command("ros")
def calibrate_ros(
    client: Annotated[str, typer.Option(metavar="roscpp|rospy|rclpy", help="The client library.")],
    out: Annotated[
        Path, typer.Option(metavar="FILE", help="The catalogue to write the entry into; made if need be.")
    ] = Path("catalogue.yaml"),
    frequency: Annotated[
        float | None, typer.Option(metavar="MHZ", help="Of all cores, where it can be set (needs root).")
    ] = None,
    name: Annotated[str, typer.Option(help="The entry's name; by default made from the processor's.")] = "",
    python: Annotated[
        str, typer.Option(metavar="PATH", help="The Python that has rospy or rclpy; by default this one.")
    ] = "",
    rounds: Annotated[
        tuple[int, int], typer.Option(metavar="LEAST MOST", help="How many fresh processes are measured.")
    ] = (10, 30),
    within: Annotated[
        float, typer.Option(metavar="PERCENT", help="How well each figure is to be known: 95 % intervals.")
    ] = 10.0,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Measure what ROS calls cost here, and write it as an entry of a catalogue.

    CPU time of whole cycles minus idle cycles: publish to 1 to 8 subscribers, sleeps of several lengths,
    spinOnce, messages received, registrations by fresh processes. Ctrl-C keeps what was measured; the same
    command goes on from there. Exit status: 0 if every figure is known as well as asked for, 2 for bad
    input, 1 otherwise.
    """
    from volery.cli import calibrate as command

    output = Output(quiet, as_json, debug)
    plan = command.Plan(*rounds, within / 100.0)
    wanted = command.Wanted(client, out, frequency, name, python, plan)
    run_command(output, lambda: command.ros(output, wanted))


@app.command()
def measure(
    model: Model,
    runs: Annotated[int, typer.Option(help="How often; medians and quartiles are shown.")] = 10,
    seconds: Annotated[
        float | None, typer.Option(help="How long each run is; by default as the model's.")
    ] = None,
    fidelity: Fidelity = "code",
    allocation: Allocation = None,
    scenario: Scenario = None,
    overrides: Overrides = None,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Run a model's nodes on real ROS here, measure what each takes, and compare with the estimate.

    For models whose components are nodes of rospy or roscpp, on a processor that `volery calibrate` has
    measured. Exit status: 0 if every estimate is near enough (15 %, or half the quartiles of the runs), 2 for
    bad input, 1 otherwise.
    """
    from volery.cli import measure as command

    output = Output(quiet, as_json, debug)
    changes = tuple(overrides or ())
    wanted = command.Wanted(model, runs, seconds, fidelity, allocation, scenario, changes)
    run_command(output, lambda: command.measure(output, wanted))


@calibrate_app.command("python")
def calibrate_python(
    out: Annotated[
        Path, typer.Option(metavar="FILE", help="The catalogue to write the entry into; made if need be.")
    ] = Path("catalogue.yaml"),
    frequency: Annotated[
        float | None, typer.Option(metavar="MHZ", help="Of all cores, where it can be set (needs root).")
    ] = None,
    name: Annotated[str, typer.Option(help="The entry's name; by default made from the processor's.")] = "",
    rounds: Annotated[
        tuple[int, int], typer.Option(metavar="LEAST MOST", help="How often each piece of code is timed.")
    ] = (9, 31),
    within: Annotated[
        float, typer.Option(metavar="PERCENT", help="How well each median is to be known: 95 % intervals.")
    ] = 3.0,
    reference: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the table of operations itself, too.")
    ] = None,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Measure what Python code costs here, and write it as an entry of a catalogue.

    CPU time of some 250 statements and of whole programs: what each kind of operation takes, and how much
    slower this machine is than the one of volery's table. On a robot's own computer this replaces the
    estimated factor by a measured one. Exit status: 0 if every time is known as well as asked for, 2 for
    bad input, 1 otherwise.
    """
    from volery.calibrate.python.pieces import Rounds
    from volery.cli import calibrate_python as command

    output = Output(quiet, as_json, debug)
    wanted = command.Wanted(out, frequency, name, Rounds(*rounds, within / 100.0), reference)
    run_command(output, lambda: command.python(output, wanted))


@model_app.command("check")
def model_check(
    model: Model,
    overrides: Overrides = None,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Check a model with each of its allocations and scenarios."""
    from volery.cli import model as command

    output = Output(quiet, as_json, debug)
    run_command(output, lambda: command.check(output, model, tuple(overrides or ())))


@model_app.command("show")
def model_show(
    model: Model,
    allocation: Allocation = None,
    scenario: Scenario = None,
    overrides: Overrides = None,
    debug: Debug = False,
) -> None:
    """Draw a model in text: what runs on what, what is connected to what."""
    from volery.cli import model as command

    output = Output(False, False, debug)
    run_command(output, lambda: command.show(output, model, allocation, scenario, tuple(overrides or ())))


@model_app.command("schema")
def model_schema() -> None:
    """Print the JSON Schema of models: give it to your editor."""
    from volery.cli import model as command

    output = Output(False, True, False)
    run_command(output, lambda: command.print_schema(output))


@model_app.command("observables")
def model_observables(as_json: Json = False) -> None:
    """List what requirements may bound."""
    from volery.cli import model as command

    output = Output(False, as_json, False)
    run_command(output, lambda: command.print_observables(output))


@app.command()
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


@app.command()
def cost(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Sources in C or C++.")],
    on: Annotated[
        str, typer.Option(metavar="KIND[@MHZ]", help="rpi4-cortex-a72@600MHz, intel-i5-3470, ...")
    ] = "rpi4-cortex-a72",
    entry: Annotated[
        str, typer.Option(metavar="CALL", help="A function, such as 'step(3, 0.5)'; by default main.")
    ] = "",
    before: Annotated[
        list[str] | None, typer.Option(metavar="CALL", help="Call this first, uncounted; may be repeated.")
    ] = None,
    argument: Annotated[
        list[str] | None, typer.Option("--arg", help="An argument for main; may be repeated.")
    ] = None,
    flag: Annotated[
        list[str] | None, typer.Option(help="For the compiler, such as -Iinclude; may be repeated.")
    ] = None,
    link: Annotated[
        list[str] | None, typer.Option(help="For the linker, such as -lpthread; may be repeated.")
    ] = None,
    cores: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Cores that `volery calibrate processor` wrote.")
    ] = None,
    listing: Annotated[
        bool, typer.Option("--listing", help="Show the sources with each line's share of the cycles.")
    ] = False,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Estimate what C or C++ code costs on a processor that is not here.

    The code runs on this machine, once; its blocks are counted and cost what they do on the processor's core:
    time, cycles, instructions, energy, the lines that take most, and what is left out. Needs LLVM (Debian:
    clang-19 and llvm-19).
    """
    from volery.cli import cost as command

    output = Output(quiet, as_json, debug)
    run = command.Run(entry, tuple(before or ()), tuple(argument or ()), tuple(link or ()))
    wanted = command.Wanted(tuple(files), on, run, tuple(flag or ()), cores, listing)
    run_command(output, lambda: command.cost(output, wanted))


@calibrate_app.command("processor")
def calibrate_processor(
    out: Annotated[
        Path, typer.Option(metavar="FILE", help="The file of cores to write the entry into; made if need be.")
    ] = Path("cores.yaml"),
    name: Annotated[str, typer.Option(help="The entry's name; by default made from the processor's.")] = "",
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Measure what operations and library calls take on this machine, for `volery cost`.

    Each is timed until its median is known to 1 %, or said to be noisy. Ctrl-C keeps what was measured; the
    same command goes on from there. Exit status: 0 if every figure is tight, 2 for bad input, 1 otherwise.
    """
    from volery.cli import calibrate_processor as command

    output = Output(quiet, as_json, debug)
    run_command(output, lambda: command.processor(output, command.Wanted(out, name)))


def main() -> None:
    """The entry point."""
    try:
        app(prog_name="volery")
    except ImportError as error:
        Output().complain(f"volery: a part is missing: {error}; `volery doctor` says how to get it")
        sys.exit(FAILED)
