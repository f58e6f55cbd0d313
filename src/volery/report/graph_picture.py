"""A graph as an SVG: who publishes on the left, topics in the middle, who subscribes on the right."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape

from volery.ros.graph.snapshot import GraphSnapshot, TopicSnapshot

ROW, PAD, TOP = 34, 20, 46
RATE = 70
"""Room for a rate beside a topic's name."""
LETTER = 7.2
"""Width of a letter in the picture's font, about."""
_STYLE = """
text { font: 12px ui-monospace, monospace; fill: #1d2733; }
.head { font-weight: 600; fill: #5b6b7c; }
.node { fill: #eaf2fb; stroke: #3b78b5; }
.topic { fill: #f6f3ea; stroke: #a08643; }
.rate { fill: #7a6a3d; font-size: 11px; }
.wire { fill: none; stroke: #8fa3b8; stroke-width: 1.2; }
"""


def picture(graph: GraphSnapshot) -> str:
    """The whole SVG document. A node that does both stands on both sides."""
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
    """In the order of first appearance: that keeps lines short."""
    return list(dict.fromkeys(name for group in groups for name in group))


def _width(names: Iterable[str]) -> float:
    return max((len(name) for name in names), default=8) * LETTER + 24


def _column(names: Sequence[str], rows: int) -> dict[str, float]:
    """The middle of each row, spread over the height."""
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
        yield f'<text x="{x + 12:.1f}" y="{y + 4:.1f}">{escape(name)}</text>'
        note = notes.get(name, "") if notes else ""
        if note:
            at = f'x="{x + width - 8:.1f}" y="{y + 4:.1f}" text-anchor="end"'
            yield f'<text class="rate" {at}>{note}</text>'


def _rate(topic: TopicSnapshot) -> str:
    return "" if topic.rate is None else f"{topic.rate:.3g} Hz"
