"""What computing costs: estimated, measured, calibrated."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.console import Output
from volery.cli.endings import run_command
from volery.cli.options import (
    CATALOGUE,
    Allocation,
    Debug,
    EntryName,
    Fidelity,
    Frequency,
    IntoCatalogue,
    Json,
    Model,
    Overrides,
    Quiet,
    Scenario,
    Seed,
)


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
    catalogue: Annotated[
        Path | None, typer.Option(metavar="FILE", help="What `volery calibrate processor` wrote.")
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
    from volery.cost.native.instrumented_run import Invocation as Run

    output = Output(quiet, as_json, debug)
    run = Run(entry, tuple(before or ()), tuple(argument or ()), tuple(link or ()))
    wanted = command.Wanted(tuple(files), on, run, tuple(flag or ()), catalogue, listing)
    run_command(output, lambda: command.cost(output, wanted))


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


def ros(
    client: Annotated[str, typer.Option(metavar="roscpp|rospy|rclpy", help="The client library.")],
    out: IntoCatalogue = CATALOGUE,
    frequency: Frequency = None,
    name: EntryName = "",
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
    from volery.calibration.ros.campaign import Plan
    from volery.cli import calibrate as command

    output = Output(quiet, as_json, debug)
    plan = Plan(*rounds, within / 100.0)
    wanted = command.Wanted(client, out, frequency, name, python, plan)
    run_command(output, lambda: command.ros(output, wanted))


def python(
    out: IntoCatalogue = CATALOGUE,
    frequency: Frequency = None,
    name: EntryName = "",
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
    from volery.calibration.python.timed_code import Rounds
    from volery.cli import calibrate_python as command

    output = Output(quiet, as_json, debug)
    wanted = command.Wanted(out, frequency, name, Rounds(*rounds, within / 100.0), reference)
    run_command(output, lambda: command.python(output, wanted))


def processor(
    out: IntoCatalogue = CATALOGUE,
    name: EntryName = "",
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Measure what compiled code costs on this machine, and write it as an entry of a catalogue.

    What operations, library calls, wrong predictions, caches and memory take: for `volery cost` and for
    C++ components that are allocated to this machine.

    Each is timed until its median is known to 1 %, or said to be noisy. Ctrl-C keeps what was measured; the
    same command goes on from there. Exit status: 0 if every figure is tight, 2 for bad input, 1 otherwise.
    """
    from volery.cli import calibrate_processor as command

    output = Output(quiet, as_json, debug)
    run_command(output, lambda: command.processor(output, command.Wanted(out, name)))


def components(
    model: Model,
    seed: Seed = 1,
    allocation: Allocation = None,
    scenario: Scenario = None,
    overrides: Overrides = None,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Learn what a model's C++ components cost on the cores that they are allocated to.

    The model runs once while the components tell which blocks of their code they enter; that goes through
    the model of the core. What comes out is kept with the code: later runs at fidelity `code` are charged by
    it, until the code changes. Needs LLVM (Debian: clang-19 and llvm-19).
    """
    from volery.cli import calibrate_components as command

    output = Output(quiet, as_json, debug)
    wanted = command.Wanted(model, allocation, scenario, seed, tuple(overrides or ()))
    run_command(output, lambda: command.components(output, wanted))
