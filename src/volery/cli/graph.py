"""``volery graph``: nodes, topics, rates and connections of a ROS graph, or of a run's."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.table import Column, Table

from volery.base.errors import UsageError
from volery.base.time import from_seconds
from volery.cli.console import Output, table
from volery.cli.endings import OK
from volery.report.graph_picture import graph_of_run, graph_svg
from volery.ros.graph.snapshot import GraphSnapshot, snapshot
from volery.run.assembly.ros_graphs import GRAPHS, on_graph


@dataclass(frozen=True)
class Wanted:
    """What was asked for: ``source`` is a graph's name or a run folder; ``within`` seconds to count rates."""

    source: str
    within: float
    svg: Path | None


def graph(output: Output, wanted: Wanted) -> int:
    """Show it; the exit status."""
    if not 0.0 <= wanted.within < 3600.0:
        raise UsageError(f"--within {wanted.within:g}: seconds from 0 to 3600")
    seen = _look(wanted)
    output.give(seen.as_dict())
    output.show(*_tables(seen))
    if wanted.svg is not None:
        try:
            wanted.svg.write_text(graph_svg(seen), encoding="utf-8")
        except OSError as error:
            raise UsageError(f"{wanted.svg} cannot be written: {error.strerror or error}") from error
        output.note(f"drawn in {wanted.svg}")
    return OK


def _look(wanted: Wanted) -> GraphSnapshot:
    folder = Path(wanted.source)
    if wanted.source not in GRAPHS and folder.is_dir():
        return graph_of_run(folder)
    if wanted.source not in GRAPHS and folder.exists():
        raise UsageError(f"{folder} is no run folder")
    with on_graph(wanted.source, "volery graph") as there:
        return snapshot(there, from_seconds(wanted.within))


def _tables(seen: GraphSnapshot) -> list[Table]:
    nodes = table(_folded("node"), "publishes", "subscribes", "serves", title="nodes")
    for name in seen.nodes:
        published = sum(name in line.publishers for line in seen.topics)
        heard = sum(name in line.subscribers for line in seen.topics)
        served = sum(service.server == name for service in seen.services)
        nodes.add_row(name, *(str(count or "") for count in (published, heard, served)))
    topics = table(
        _folded("topic and type"), "Hz", _folded("publishers"), _folded("subscribers"), title="topics"
    )
    for line in seen.topics:
        rate = "" if line.rate is None else f"{line.rate:.3g}"
        topics.add_row(
            f"{line.name}\n[dim]{line.type}", rate, "\n".join(line.publishers), "\n".join(line.subscribers)
        )
    return [nodes, topics]


def _folded(head: str) -> Column:
    """A long name goes on in the next line; nothing is cut off."""
    return Column(head, overflow="fold")
