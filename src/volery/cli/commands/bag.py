"""``volery bag``: recordings of ROS topics, listed, played, made and converted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.text import Text

from volery.base.errors import UsageError
from volery.base.time import Ns, from_seconds, to_seconds
from volery.cli.command import OK, Commands
from volery.cli.console import Output, make_table, number_column
from volery.cli.options import NewRecording, OnGraph, Recording, Topics

if TYPE_CHECKING:
    from volery.ros.messages.bags import Bag

commands = Commands("ROS", group="bag", summary="Read, play and write rosbag 1, rosbag 2 and MCAP.")

DRAWING_PERIOD: Ns = from_seconds(0.5)


@commands.add("json", "debug")
def info(output: Output, recording: Recording) -> int:
    """List the topics of a recording."""
    from volery.ros.messages.bags import open_bag

    bag = open_bag(recording)
    output.give(
        {
            "format": bag.format,
            "complete": bag.complete,
            "start_ns": bag.start,
            "end_ns": bag.end,
            "topics": [topic._asdict() for topic in bag.topics],
            "unreadable": bag.unreadable,
        }
    )
    duration = to_seconds(bag.end - bag.start)
    title = f"{recording}: {bag.format}, {duration:.1f} s"
    listed = make_table("topic", "type", number_column("messages"), number_column("Hz"), title=title)
    for topic in bag.topics:
        rate = f"{topic.messages / duration:.3g}" if duration else ""
        listed.add_row(Text(topic.name), Text(topic.type), str(topic.messages), rate)
    output.show(listed)
    _note_defects(output, bag)
    return OK


@commands.add("quiet", "json", "debug")
def play(
    output: Output,
    recording: Recording,
    on: OnGraph = "ros1",
    rate: Annotated[float, typer.Option(help="Recorded seconds per second.")] = 1.0,
    topics: Topics = None,
    after: Annotated[float, typer.Option(help="Start this many recorded seconds after the beginning.")] = 0.0,
    clock: Annotated[bool, typer.Option("--clock", help="Publish the recorded time on /clock.")] = False,
    delay: Annotated[
        float,
        typer.Option(help="Seconds to wait before the first and after the last message."),
    ] = 0.5,
) -> int:
    """Play a recording into a real ROS graph."""
    from volery.ros.graph.rosbag import PlayOptions
    from volery.ros.graph.rosbag import play as play_bag
    from volery.ros.messages.bags import open_bag
    from volery.run.assembly.ros_graphs import on_graph

    bag = open_bag(recording)
    _note_defects(output, bag)
    with (
        _progress_bar(output, to_seconds(bag.end - bag.start), f"playing {recording.name}") as show,
        on_graph(on, "volery bag play") as graph,
    ):
        node = graph.node("volery_play", anonymous=True)
        options = PlayOptions(
            rate,
            tuple(topics or ()) or None,
            after,
            clock,
            delay,
            lambda played, at: show(to_seconds(at - bag.start)),
        )
        played = play_bag(node, bag, options)
    _note_damage(output, bag)
    output.give({"played": played})
    output.show(f"played {played} messages")
    return OK


@commands.add("quiet", "json", "debug")
def record(
    output: Output,
    out: NewRecording,
    on: OnGraph = "ros1",
    topics: Topics = None,
    seconds: Annotated[float | None, typer.Option(help="Duration; by default until Ctrl-C.")] = None,
) -> int:
    """Record a real ROS graph: all topics as they appear, or only the named ones."""
    from volery.ros.graph.rosbag import Recorder
    from volery.ros.messages.bag_writer import create_bag
    from volery.run.assembly.ros_graphs import on_graph

    if seconds is not None and not 0.0 < seconds < float("inf"):
        raise UsageError(f"--seconds {seconds:g}: give a number above 0")
    with (
        create_bag(out) as writer,
        _progress_bar(output, seconds or 0.0, f"recording to {out}") as show,
        on_graph(on, "volery bag record") as graph,
    ):
        node = graph.node("volery_record", anonymous=True)
        recorder = Recorder(graph, node, writer, topics=tuple(topics or ()) or None)
        start = graph.kernel.now()
        if seconds is not None:
            graph.kernel.call_at(start + from_seconds(seconds), recorder.stop)
        drawing = graph.kernel.every(DRAWING_PERIOD, lambda: show(to_seconds(graph.kernel.now() - start)))
        try:
            recorder.run()
        except KeyboardInterrupt:
            output.note("stopped")
        finally:
            drawing.cancel()
    output.give({"recorded": recorder.counts, "problems": recorder.problems})
    for topic, why in recorder.problems.items():
        output.note(f"{topic} was not recorded: {why}")
    total, number = sum(recorder.counts.values()), len(recorder.counts)
    output.show(f"recorded {total} messages of {number} topics in {out}")
    return OK


@commands.add("quiet", "json", "debug")
def convert(output: Output, recording: Recording, out: NewRecording, topics: Topics = None) -> int:
    """Write a recording, or the trace of a run, in another format."""
    from volery.ros.messages.bag_writer import create_bag
    from volery.ros.messages.bags import open_bag

    bag = open_bag(recording)
    _note_defects(output, bag)
    if out.resolve() == recording.resolve():
        raise UsageError(f"{out} is the recording itself; give another name")
    left_out: dict[str, str] = {}
    written = 0
    duration = to_seconds(bag.end - bag.start)
    with create_bag(out) as writer, _progress_bar(output, duration, f"writing {out.name}") as show:
        for recorded in bag.messages(tuple(topics or ()) or bag.usual):
            if recorded.topic in left_out:
                continue
            try:
                writer.write(recorded.topic, recorded.at, recorded.message)
            except UsageError as error:
                left_out[recorded.topic] = str(error)
                continue
            written += 1
            show(to_seconds(recorded.at - bag.start))
    for topic, why in left_out.items():
        output.note(f"{topic} is left out: {why}")
    _note_damage(output, bag)
    output.give({"written": written, "left_out": left_out})
    output.show(f"wrote {written} messages to {out}")
    return OK


def _note_defects(output: Output, bag: Bag) -> None:
    if not bag.complete:
        output.note(f"{bag.path} is truncated; only its complete part is read")
    for topic, why in bag.unreadable.items():
        output.note(f"{topic} is left out: {why}")
    _note_damage(output, bag)


def _note_damage(output: Output, bag: Bag) -> None:
    """Report what reading the messages has found to be damaged."""
    for what in bag.damage:
        output.note(what)


@contextmanager
def _progress_bar(output: Output, total: float, words: str) -> Iterator[Callable[[float], None]]:
    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with Progress(*columns, console=output.notes, disable=not output.shows_progress) as progress:
        task = progress.add_task(words, total=total or None)
        yield lambda done: progress.update(task, completed=done)
