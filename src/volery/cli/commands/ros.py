"""Real ROS graphs and recordings: ``volery ros bridge``, ``graph``, ``messages`` and ``bag``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Column, Table
from rich.text import Text

from volery.base.errors import UsageError
from volery.base.time import Ns, S, clock, from_seconds, to_seconds
from volery.cli.command import LEFT_OUT, OK, Commands
from volery.cli.console import CommandOutput, make_table, number_column
from volery.cli.options import AllowLoss, NewRecording, OnGraph, Recording, Seed, Topics

if TYPE_CHECKING:
    from volery.ros.graph.snapshot import GraphSnapshot
    from volery.ros.messages.bags import Bag, BagConnection
    from volery.trace.events import Event

bag_commands = Commands("ros bag", "Read, play and write rosbag 1, rosbag 2 and MCAP.")

DRAWING_PERIOD: Ns = from_seconds(0.5)


@bag_commands.add("json", "debug")
def info(output: CommandOutput, recording: Recording) -> int:
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
            "connections": [_described(connection) for connection in bag.connections],
            "unreadable": bag.unreadable,
            "omitted": bag.omitted,
        }
    )
    duration = to_seconds(bag.end - bag.start)
    title = f"{recording}: {bag.format}, {duration:.1f} s"
    listed = make_table("topic", "type", number_column("messages"), number_column("Hz"), title=title)
    for topic in bag.topics:
        rate = f"{topic.messages / duration:.3g}" if duration else ""
        listed.add_row(Text(topic.name), Text(topic.type), str(topic.messages), rate)
    output.show(listed)
    for connection in bag.connections:
        words = _offered(connection)
        if words:
            output.show(Text(f"{connection.source.topic}: {words}"))
    _note_defects(output, bag)
    return OK


def _described(connection: BagConnection) -> dict[str, object]:
    source = connection.source
    return {
        "topic": source.topic,
        "type": source.type,
        "messages": connection.messages,
        "encoding": source.encoding,
        "latched": source.offer.latched,
        "sender": source.offer.sender,
        "qos": [
            {
                "reliability": one.reliability.name.lower(),
                "durability": one.durability.name.lower(),
                "history": one.history.name.lower(),
                "depth": one.depth,
            }
            for one in source.offer.qos
        ],
    }


def _offered(connection: BagConnection) -> str:
    """Return what is special about a connection's QoS: latched, best effort; empty if nothing is."""
    offer = connection.source.offer
    words = ["latched"] if offer.latched else []
    if any(one.reliability.name == "BEST_EFFORT" for one in offer.qos):
        words.append("best effort")
    return ", ".join(words) + (f", by {offer.sender}" if words and offer.sender else "")


@bag_commands.add("quiet", "json", "debug")
def play(
    output: CommandOutput,
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
    wait_for_subscribers: Annotated[
        bool, typer.Option("--wait-for-subscribers", help="Wait until each topic has a subscriber.")
    ] = False,
    allow_loss: AllowLoss = False,
) -> int:
    """Play a recording into a real ROS graph."""
    from volery.ros.graph.rosbag import PlayOptions
    from volery.ros.graph.rosbag import play as play_bag
    from volery.ros.messages.bags import OF_THE_RUN, open_bag
    from volery.run.assembly.ros_graphs import on_graph

    bag = open_bag(recording)
    _note_defects(output, bag)
    with (
        _progress_bar(output, to_seconds(bag.end - bag.start), f"playing {recording.name}") as show,
        on_graph(on, "volery ros bag play") as graph,
    ):
        node = graph.node("volery_play", anonymous=True)
        options = PlayOptions(
            rate,
            tuple(topics or ()) or None,
            after,
            clock,
            delay,
            wait_for_subscribers,
            lambda played, at: show(to_seconds(at - bag.start)),
        )
        played = play_bag(node, bag, options)
    _note_damage(output, bag)
    output.give({"played": played})
    output.show(f"played {played} messages")
    lost = bag.damage or (not topics and any(not one.startswith(OF_THE_RUN) for one in bag.unreadable))
    return LEFT_OUT if lost and not allow_loss else OK


@bag_commands.add("quiet", "json", "debug")
def record(
    output: CommandOutput,
    out: NewRecording,
    on: OnGraph = "ros1",
    topics: Topics = None,
    seconds: Annotated[float | None, typer.Option(help="Duration; by default until Ctrl-C.")] = None,
    allow_loss: AllowLoss = False,
) -> int:
    """Record a real ROS graph: all topics as they appear, or only the named ones."""
    from volery.ros.graph.rosbag import Recorder
    from volery.ros.messages.bags import create_bag
    from volery.run.assembly.ros_graphs import on_graph

    if seconds is not None and not 0.0 < seconds < float("inf"):
        raise UsageError(f"--seconds {seconds:g}: give a number above 0")
    with (
        create_bag(out) as writer,
        _progress_bar(output, seconds or 0.0, f"recording to {out}") as show,
        on_graph(on, "volery ros bag record") as graph,
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
        output.note(f"{topic} was not recorded completely: {why}")
    total, number = sum(recorder.counts.values()), len(recorder.counts)
    output.show(f"recorded {total} messages of {number} topics in {out}")
    return LEFT_OUT if recorder.problems and not allow_loss else OK


@bag_commands.add("quiet", "json", "debug")
def convert(
    output: CommandOutput,
    recording: Recording,
    out: NewRecording,
    topics: Topics = None,
    allow_loss: AllowLoss = False,
) -> int:
    """Write a recording, or the trace of a run, in another format; exit with 3 if something is left out.

    Within ROS 1 and within ROS 2 the definitions of the recording are kept.
    """
    from volery.ros.messages.bags import OF_THE_RUN, create_bag, open_bag

    bag = open_bag(recording)
    if out.resolve() == recording.resolve():
        raise UsageError(f"{out} is the recording itself; give another name")
    recorded = {topic.name for topic in bag.topics}
    chosen = set(topics or (one for one in recorded if not one.startswith(OF_THE_RUN)))
    unknown = chosen - recorded
    if unknown and unknown <= bag.omitted.keys():
        raise UsageError(bag.omission(sorted(unknown)))
    if unknown:
        raise UsageError(f"{recording} has no topic {', '.join(sorted(unknown))}")
    _note_reading(output, bag)
    left_out: dict[str, str] = {}
    written = 0
    duration = to_seconds(bag.end - bag.start)
    with create_bag(out) as writer, _progress_bar(output, duration, f"writing {out.name}") as show:
        for connection, raw in bag.raw(chosen):
            try:
                writer.copy(connection, raw.at, raw.data)
            except UsageError as error:
                left_out.setdefault(raw.source.topic, str(error))
                continue
            written += 1
            show(to_seconds(raw.at - bag.start))
    fields = bag.left_out
    for topic, why in left_out.items():
        output.note(f"{topic}: messages are left out: {why}")
    for topic, why in fields.items():
        output.note(f"{topic}: fields are left out: {why}")
    _note_damage(output, bag)
    output.give({"written": written, "left_out": left_out, "fields_left_out": fields})
    output.show(f"wrote {written} messages to {out}")
    lost = left_out or fields or bag.damage or not bag.complete
    return LEFT_OUT if lost and not allow_loss else OK


def _note_reading(output: CommandOutput, bag: Bag) -> None:
    if bag.omitted:
        output.note(bag.omission(list(bag.omitted)))
    if bag.remark:
        output.note(bag.remark)
    if not bag.complete and all(part.complete for part in bag.parts) and bag.parts:
        output.note(f"{bag.path} may have had more files than are there")
    elif not bag.complete:
        output.note(f"{bag.path} is truncated; only its complete part is read")


def _note_defects(output: CommandOutput, bag: Bag) -> None:
    _note_reading(output, bag)
    for topic, why in bag.unreadable.items():
        output.note(f"{topic} is left out: {why}")
    _note_damage(output, bag)


def _note_damage(output: CommandOutput, bag: Bag) -> None:
    """Report what reading the messages has found: damage, and definitions that differ from ours."""
    for what in (*bag.damage, *bag.differences):
        output.note(what)


@contextmanager
def _progress_bar(output: CommandOutput, total: float, words: str) -> Iterator[Callable[[float], None]]:
    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with Progress(*columns, console=output.notes, disable=not output.shows_progress) as progress:
        task = progress.add_task(words, total=total or None)
        yield lambda done: progress.update(task, completed=done)


commands = Commands("ros", "Put vehicles and models on real ROS; look at graphs and recordings.")

ROS_2 = 2


@commands.add("quiet", "debug")
def bridge(
    output: CommandOutput,
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[URL] [ROS ARGUMENTS]...",
            help="Address of the vehicle, such as ardupilot+serial:///dev/ttyUSB0 or sim:px4; what roslaunch "
            "and ros2 launch add (__name:=, _fcu_url:=, --ros-args) with MAVROS's parameters.",
        ),
    ] = None,
    graph: Annotated[
        str,
        typer.Option(metavar="ros1|ros2", help="ROS graph; by default ros1, and ros2 after --ros-args."),
    ] = "",
    names: Annotated[
        str,
        typer.Option(
            metavar="mavros|roscopter|pprzros|px4|ardupilot",
            help="Names of topics and services. pprzros is for Paparazzi only, px4 (of 1.17; of older "
            "versions px4-1.16, px4-1.15 and px4-1.14) for PX4, ardupilot (of 4.8; also ardupilot-4.5) for "
            "ArduPilot.",
        ),
    ] = "",
    namespace: Annotated[
        str, typer.Option(metavar="/NAME", help="Namespace of the names, such as /mavros.")
    ] = "",
    rate: Annotated[
        int | None,
        typer.Option(
            help="Rate that is requested from the autopilot, Hz; 0 requests nothing. By default 10, and 50 "
            "under PX4's own names, 30 under ArduPilot's."
        ),
    ] = None,
    enable_control: Annotated[
        bool,
        typer.Option(
            "--enable-control", help="Accept roscopter's send_rc. MAVROS's names do not need this option."
        ),
    ] = False,
    source_system: Annotated[int, typer.Option(help="MAVLink system id of the bridge.")] = 255,
    geoid: Annotated[
        str, typer.Option(metavar="egm96|METRES", help="Height of mean sea level above the ellipsoid.")
    ] = "egm96",
    speed: Annotated[
        float, typer.Option(help="Simulated seconds per second, for a simulated vehicle.")
    ] = 1.0,
    seed: Seed = 1,
) -> int:
    """Put a vehicle on a real ROS graph under names of MAVROS, roscopter, pprzros or its own, until Ctrl-C.

    Works in real time over serial lines (57600 baud unless the address says ?baud=...), UDP and TCP. A link
    that breaks is opened again.
    """
    from volery.run.bridge import Bridge, BridgeOptions
    from volery.run.node_arguments import mavros_options, node_arguments, with_server_parameters

    given = node_arguments(words or ())
    url, *rest = given.words or ("",)
    if rest:
        raise UsageError(f"{rest[0]}: one address is expected, and {url} is one already")
    options = BridgeOptions(
        url=url,
        graph=graph or ("ros2" if given.ros == ROS_2 else "ros1"),
        names=names,
        namespace=namespace,
        rate=rate,
        control=enable_control,
        system=source_system,
        geoid=geoid,
        speed=speed,
        seed=seed,
    )
    if given.ros or not url:
        given = with_server_parameters(given) if options.graph == "ros1" else given
        options = mavros_options(options, given, output.note)
    notes = BridgeNotes(output)
    made = Bridge(options, notes.record)
    below = made.namespace.rstrip("/")
    output.show(
        f"bridging {options.url} to {options.graph} under {made.names}'s names, {below}/...; Ctrl-C stops it"
    )
    made.every(S, lambda: notes.status(made.kernel.now(), made.status))
    try:
        made.run()
    except KeyboardInterrupt:
        output.note("stopped")
    return OK


class BridgeNotes:
    """Prints the events of a bridge, and its status when it changes."""

    def __init__(self, output: CommandOutput) -> None:
        self._output = output
        self._last = ""

    def record(self, event: Event) -> None:
        """Print a link that is lost or restored, or a warning."""
        from volery.trace.events import LinkState, Text

        if isinstance(event, LinkState):
            self._output.note(f"{clock(event.at)}  link {event.state}: {event.detail}")
        elif isinstance(event, Text):
            self._output.note(f"{clock(event.at)}  {event.text}")

    def status(self, now: int, text: str) -> None:
        """Print *text* if it differs from the last status."""
        if text != self._last:
            self._last = text
            self._output.note(f"{clock(now)}  {text}")


@commands.add("quiet", "json", "debug")
def graph(
    output: CommandOutput,
    source: Annotated[
        str, typer.Argument(metavar="ros1|ros2|FOLDER", help="A real ROS graph, or a run folder.")
    ],
    within: Annotated[
        float, typer.Option(help="Seconds for which the rates of a real graph are counted.")
    ] = 2.0,
    svg: Annotated[Path | None, typer.Option(metavar="FILE", help="Also draw the graph as SVG.")] = None,
) -> int:
    """Show the nodes, topics, rates and connections of a ROS graph."""
    if not 0.0 <= within < 3600.0:
        raise UsageError(f"--within {within:g}: give seconds from 0 to 3600")
    seen = _read_graph(source, within)
    output.give(seen.as_dict())
    output.show(*_graph_tables(seen))
    if not seen.nodes:
        output.note(f"no node is in this graph; {_WHERE_NODES_ARE.get(source, 'the run recorded none')}")
    if svg is not None:
        from volery.report.graph_picture import graph_svg

        try:
            svg.write_text(graph_svg(seen), encoding="utf-8")
        except OSError as error:
            raise UsageError(f"{svg} cannot be written: {error.strerror or error}") from error
        output.note(f"drawn in {svg}")
    return OK


_WHERE_NODES_ARE = {
    "ros1": "is ROS_MASTER_URI that of your nodes?",
    "ros2": "are ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE those of your nodes?",
}
"""What to check for a graph without nodes."""


def _read_graph(source: str, within: float) -> GraphSnapshot:
    from volery.report.graph_picture import graph_of_run
    from volery.ros.graph.snapshot import snapshot
    from volery.run.assembly.ros_graphs import GRAPHS, on_graph

    folder = Path(source)
    if source not in GRAPHS and folder.is_dir():
        return graph_of_run(folder)
    if source not in GRAPHS and folder.exists():
        raise UsageError(f"{folder} is not a run folder")
    with on_graph(source, "volery ros graph") as there:
        return snapshot(there, from_seconds(within))


def _graph_tables(seen: GraphSnapshot) -> list[Table]:
    nodes = make_table(_folded("node"), "publishes", "subscribes", "serves", title="nodes")
    for name in seen.nodes:
        published = sum(name in line.publishers for line in seen.topics)
        subscribed = sum(name in line.subscribers for line in seen.topics)
        served = sum(service.server == name for service in seen.services)
        nodes.add_row(name, *(str(count or "") for count in (published, subscribed, served)))
    topics = make_table(
        _folded("topic and type"), "Hz", _folded("publishers"), _folded("subscribers"), title="topics"
    )
    for line in seen.topics:
        rate = "" if line.rate is None else f"{line.rate:.3g}"
        topics.add_row(
            Text.assemble(f"{line.name}\n", (line.type, "dim")),
            rate,
            "\n".join(line.publishers),
            "\n".join(line.subscribers),
        )
    return [nodes, topics]


def _folded(heading: str) -> Column:
    """Return a column that folds long names instead of cutting them off."""
    return Column(heading, overflow="fold")


@commands.add("quiet", "debug")
def messages(
    output: CommandOutput,
    packages: Annotated[
        list[str], typer.Argument(help="Packages, such as roscopter, mavros_msgs, pprzros_msgs.")
    ],
    out: Annotated[Path, typer.Option(help="Folder in which each package gets a folder.")] = Path(),
) -> int:
    """Write packages of messages and services, so that rostopic and rosservice know their types."""
    from volery.ros.transports.ros1.rospy_copy import write_package

    for package in packages:
        output.show(f"written: {write_package(package, out)}")
    output.show(f"for ROS 1's tools: export PYTHONPATH={out.resolve()}:$PYTHONPATH")
    return OK
