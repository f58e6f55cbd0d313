"""``volery bag``: recordings of ROS topics, looked at, played, made and converted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from volery.base.errors import UsageError
from volery.base.time import Ns, from_seconds, to_seconds
from volery.cli.console import Output, figures, table
from volery.cli.endings import OK
from volery.ros.graph.rosbag import PlayOptions, Recorder, play
from volery.ros.messages.bag_writer import create_bag
from volery.ros.messages.bags import Bag, open_bag
from volery.run.assembly.ros_graphs import on_graph

_TICK: Ns = from_seconds(0.5)


@dataclass(frozen=True)
class Wanted:
    """How a recording is played or made: on which graph, which topics (none: all) and, for playing, how."""

    graph: str
    topics: tuple[str, ...]
    rate: float = 1.0
    after: float = 0.0
    clock: bool = False
    delay: float = 0.0


def info(output: Output, path: Path) -> int:
    """What is in a recording; the exit status."""
    bag = open_bag(path)
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
    lasts = to_seconds(bag.end - bag.start)
    title = f"{path}: {bag.format}, {lasts:.1f} s"
    listed = table("topic", "type", figures("messages"), figures("Hz"), title=title)
    for topic in bag.topics:
        rate = f"{topic.messages / lasts:.3g}" if lasts else ""
        listed.add_row(topic.name, topic.type, str(topic.messages), rate)
    output.show(listed)
    _remark(output, bag)
    return OK


def _remark(output: Output, bag: Bag) -> None:
    if not bag.complete:
        output.note(f"{bag.path} was cut short; this is what is whole")
    for topic, why in bag.unreadable.items():
        output.note(f"{topic} is left out: {why}")


@contextmanager
def _bar(output: Output, total: float, words: str) -> Iterator[Callable[[float], None]]:
    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with Progress(*columns, console=output.notes, disable=not output.shows_progress) as progress:
        task = progress.add_task(words, total=total or None)
        yield lambda done: progress.update(task, completed=done)


def play_bag(output: Output, path: Path, wanted: Wanted) -> int:
    """Play a recording into a real graph; the exit status."""
    bag = open_bag(path)
    _remark(output, bag)
    with (
        _bar(output, to_seconds(bag.end - bag.start), f"playing {path.name}") as show,
        on_graph(wanted.graph, "volery bag play") as graph,
    ):

        def told(played: int, at: Ns) -> None:
            show(to_seconds(at - bag.start))

        node = graph.node("volery_play", anonymous=True)
        how = PlayOptions(wanted.rate, wanted.topics or None, wanted.after, wanted.clock, wanted.delay, told)
        played = play(node, bag, how)
    output.give({"played": played})
    output.show(f"played {played} messages")
    return OK


def record(output: Output, out: Path, wanted: Wanted, seconds: float | None) -> int:
    """Record a real graph until Ctrl-C, or for so many seconds; the exit status."""
    if seconds is not None and not 0.0 < seconds < float("inf"):
        raise UsageError(f"--seconds {seconds:g}: give a number above 0")
    with (
        create_bag(out) as writer,
        _bar(output, seconds or 0.0, f"recording to {out}") as show,
        on_graph(wanted.graph, "volery bag record") as graph,
    ):
        node = graph.node("volery_record", anonymous=True)
        recorder = Recorder(graph, node, writer, topics=wanted.topics or None)
        began = graph.kernel.now()
        if seconds is not None:
            graph.kernel.call_at(graph.kernel.now() + from_seconds(seconds), recorder.stop)
        ticking = graph.kernel.every(_TICK, lambda: show(to_seconds(graph.kernel.now() - began)))
        try:
            recorder.run()
        except KeyboardInterrupt:
            output.note("stopped")
        finally:
            ticking.cancel()
    output.give({"recorded": recorder.counts, "problems": recorder.problems})
    for topic, why in recorder.problems.items():
        output.note(f"{topic} was not recorded: {why}")
    total, topics = sum(recorder.counts.values()), len(recorder.counts)
    output.show(f"recorded {total} messages of {topics} topics in {out}")
    return OK


def convert(output: Output, path: Path, out: Path, topics: tuple[str, ...]) -> int:
    """Write a recording in another format; the exit status."""
    bag = open_bag(path)
    _remark(output, bag)
    if out.resolve() == path.resolve():
        raise UsageError(f"{out} is the recording itself; give another name")
    left_out: dict[str, str] = {}
    written = 0
    lasts = to_seconds(bag.end - bag.start)
    with create_bag(out) as writer, _bar(output, lasts, f"writing {out.name}") as show:
        for recorded in bag.messages(topics or bag.usual):
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
    output.give({"written": written, "left_out": left_out})
    output.show(f"wrote {written} messages to {out}")
    return OK
