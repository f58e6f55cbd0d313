"""``volery bag``: recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.console import Output
from volery.cli.endings import run_command
from volery.cli.options import Debug, Json, OnGraph, Quiet, Recording, Topics


def info(recording: Recording, as_json: Json = False, debug: Debug = False) -> None:
    """List what was recorded."""
    from volery.cli import bag as command

    output = Output(False, as_json, debug)
    run_command(output, lambda: command.info(output, recording))


def play(
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


def record(
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


def convert(
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
