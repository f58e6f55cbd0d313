"""A ROS graph as an SVG: publishers on the left, topics in the middle, subscribers on the right."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path

from volery.base.errors import UsageError
from volery.base.time import to_seconds
from volery.model.instances import TargetKind
from volery.model.system import System
from volery.ros.graph.interface import (
    ServiceState,
    absolute_name,
    absolute_remaps,
    full_node_name,
)
from volery.ros.graph.snapshot import GraphSnapshot, TopicSnapshot
from volery.ros.graph.unserved import PUBLISHED, SUBSCRIBED
from volery.trace.events import Call, Message, Omitted, Published, Unserved
from volery.trace.mcap_writer import TRACE_FILE
from volery.trace.reader import OpenTrace

GRAPH_NAME_PREFIX = "/"

_NOT_XML = dict.fromkeys((*range(32), *range(127, 160), *range(55296, 57344), 65534, 65535), "�")
"""Characters of a name that XML forbids, and controls of a terminal."""


def graph_of_run(folder: Path) -> GraphSnapshot:
    """Return the graph of a finished run from its trace; rates are means over the whole run.

    Raises:
        UsageError: The folder has no trace, or nothing was published.
    """
    types: dict[str, str] = {}
    messages: Counter[str] = Counter()
    publishers: dict[str, dict[str, None]] = {}
    subscribers: dict[str, dict[str, None]] = {}
    services: dict[str, str] = {}
    last = 0
    with OpenTrace(folder / TRACE_FILE) as reading:
        for event in reading.events():
            if isinstance(event, Published | Omitted):
                types[event.topic] = event.type
                messages[event.topic] += 1
                publishers.setdefault(event.topic, {})[event.publisher] = None
                last = max(last, event.at)
            elif isinstance(event, Message):
                publishers.setdefault(event.topic, {})[event.publisher] = None
                subscribers.setdefault(event.topic, {})[event.subscriber] = None
            elif isinstance(event, Call) and event.operation.startswith(GRAPH_NAME_PREFIX):
                services[event.operation] = event.callee
            elif isinstance(event, Unserved) and event.kind in (PUBLISHED, SUBSCRIBED):
                types.setdefault(event.name, event.type)
                side = publishers if event.kind == PUBLISHED else subscribers
                side.setdefault(event.name, {}).update(dict.fromkeys(event.who.split(", ")))
    if not publishers and not subscribers:
        raise UsageError(f"{folder}: nothing was published in this run, so there is no graph to show")
    seconds = to_seconds(last) or 1.0
    topics = tuple(
        TopicSnapshot(
            name,
            types.get(name, ""),
            tuple(sorted(publishers.get(name, ()))),
            tuple(sorted(subscribers.get(name, ()))),
            messages[name] / seconds if name in messages else None,
        )
        for name in sorted({*publishers, *subscribers})
    )
    nodes = {node for topic in topics for node in (*topic.publishers, *topic.subscribers)}
    served = tuple(ServiceState(name, "", server) for name, server in sorted(services.items()))
    return GraphSnapshot(tuple(sorted(nodes)), topics, served)


def graph_of_model(system: System) -> GraphSnapshot:
    """Return the topics that a model states, and for each vehicle those of the node that serves it.

    Raises:
        UsageError: The model has neither.
    """
    publishers: dict[str, list[str]] = {}
    subscribers: dict[str, list[str]] = {}
    types: dict[str, str] = {}
    for instance in system.instances:
        node, component = (
            full_node_name(instance.node_name or instance.name, instance.namespace),
            instance.component,
        )
        remaps = absolute_remaps(instance.remap, instance.namespace, node)
        for stated, found in ((component.publishes, publishers), (component.subscribes, subscribers)):
            for name, topic in stated.items():
                absolute = absolute_name(name, instance.namespace, node)
                absolute = remaps.get(absolute, absolute)
                types[absolute] = topic.type
                found.setdefault(absolute, []).append(node)
        for connection in instance.connections.values():
            for target in connection.targets:
                if target.kind is TargetKind.VEHICLE and not instance.is_environment:
                    state, commands = f"/{target.name}/… (state)", f"/{target.name}/… (commands)"
                    publishers.setdefault(state, [f"/{target.name}"])
                    subscribers.setdefault(state, []).append(node)
                    publishers.setdefault(commands, []).append(node)
                    subscribers.setdefault(commands, [f"/{target.name}"])
    names = sorted({*publishers, *subscribers})
    if not names:
        raise UsageError(f"{system.name}: the model states no topics; volery ros graph shows those of a run")
    topics = tuple(
        TopicSnapshot(
            name,
            types.get(name, ""),
            tuple(dict.fromkeys(publishers.get(name, ()))),
            tuple(dict.fromkeys(subscribers.get(name, ()))),
            None,
        )
        for name in names
    )
    nodes = {node for topic in topics for node in (*topic.publishers, *topic.subscribers)}
    return GraphSnapshot(tuple(sorted(nodes)), topics, ())


ROW, PAD, TOP = 34, 20, 46
RATE = 70
"""Width for a rate beside the name of a topic."""
LETTER = 7.2
"""Approximate width of a letter."""
_STYLE = """
text { font: 12px ui-monospace, monospace; fill: #1d2733; }
.head { font-weight: 600; fill: #5b6b7c; }
.node { fill: #eaf2fb; stroke: #3b78b5; }
.topic { fill: #f6f3ea; stroke: #a08643; }
.rate { fill: #7a6a3d; font-size: 11px; }
.wire { fill: none; stroke: #8fa3b8; stroke-width: 1.2; }
"""


def graph_svg(graph: GraphSnapshot) -> str:
    """Return the SVG document. A node that publishes and subscribes is on both sides."""
    topics = [topic for topic in graph.topics if topic.publishers or topic.subscribers]
    left = _ordered(topic.publishers for topic in topics)
    right = _ordered(topic.subscribers for topic in topics)
    alone = [node for node in graph.nodes if node not in left and node not in right]
    widths = (_width([*left, *alone]), _width([topic.name for topic in topics]) + RATE, _width(right))
    starts = (PAD, PAD + widths[0] + 120, PAD + widths[0] + widths[1] + 240)
    rows = max(len(left) + len(alone), len(topics), len(right), 1)
    height, width = TOP + rows * ROW + PAD, starts[2] + widths[2] + PAD
    places = [
        _column([*left, *alone], rows),
        _column([topic.name for topic in topics], rows),
        _column(right, rows),
    ]
    body = [
        *_heads(starts),
        *_wires(topics, places, starts, widths),
        *_boxes(places[0], starts[0], widths[0], "node"),
        *_boxes(places[1], starts[1], widths[1], "topic", {topic.name: _rate(topic) for topic in topics}),
        *_boxes(places[2], starts[2], widths[2], "node"),
    ]
    size = f'width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.0f} {height:.0f}"'
    inside = "\n".join(body)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n<style>{_STYLE}</style>\n'
        f'<rect width="100%" height="100%" fill="#ffffff"/>\n{inside}\n</svg>\n'
    )


def _ordered(groups: Iterable[Sequence[str]]) -> list[str]:
    """Return the names in order of first appearance, which keeps the lines short."""
    return list(dict.fromkeys(name for group in groups for name in group))


def _width(names: Iterable[str]) -> float:
    return max((len(name) for name in names), default=8) * LETTER + 24


def _column(names: Sequence[str], rows: int) -> dict[str, float]:
    """Return the middle of each row, spread over the height."""
    step = rows * ROW / max(1, len(names))
    return {name: TOP + (number + 0.5) * step for number, name in enumerate(names)}


def _heads(starts: Sequence[float]) -> Iterable[str]:
    for x, word in zip(starts, ("publishes", "topic", "subscribes"), strict=True):
        yield f'<text class="head" x="{x:.0f}" y="24">{word}</text>'


def _wires(
    topics: Iterable[TopicSnapshot],
    places: Sequence[Mapping[str, float]],
    starts: Sequence[float],
    widths: Sequence[float],
) -> Iterable[str]:
    for topic in topics:
        middle = places[1][topic.name]
        for name in topic.publishers:
            yield _wire(starts[0] + widths[0], places[0][name], starts[1], middle)
        for name in topic.subscribers:
            yield _wire(starts[1] + widths[1], middle, starts[2], places[2][name])


def _wire(x0: float, y0: float, x1: float, y1: float) -> str:
    half = (x0 + x1) / 2
    curve = f"M{x0:.1f} {y0:.1f} C{half:.1f} {y0:.1f} {half:.1f} {y1:.1f} {x1:.1f} {y1:.1f}"
    return f'<path class="wire" d="{curve}"/>'


def _boxes(
    places: Mapping[str, float], x: float, width: float, kind: str, notes: Mapping[str, str] | None = None
) -> Iterable[str]:
    radius = 12 if kind == "node" else 3
    for name, y in places.items():
        box = f'x="{x:.1f}" y="{y - 12:.1f}" width="{width:.1f}" height="24" rx="{radius}"'
        yield f'<rect class="{kind}" {box}/>'
        yield f'<text x="{x + 12:.1f}" y="{y + 4:.1f}">{escape(name.translate(_NOT_XML))}</text>'
        note = notes.get(name, "") if notes else ""
        if note:
            at = f'x="{x + width - 8:.1f}" y="{y + 4:.1f}" text-anchor="end"'
            yield f'<text class="rate" {at}>{note}</text>'


def _rate(topic: TopicSnapshot) -> str:
    return "" if topic.rate is None else f"{topic.rate:.3g} Hz"
