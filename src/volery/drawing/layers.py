"""Places for the boxes of a diagram: layers from left to right, callers before those that they call.

The method of Sugiyama, Tagawa and Toda (*Methods for Visual Understanding of Hierarchical System
Structures*, IEEE SMC 11(2), 1981): layers by longest path, order by the mean place of neighbours, then
heights that make links straight. Links over several layers pass through empty places.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

from volery.drawing.boxes import Box, BoxLink, BoxPort, Diagram

LETTER, SMALL_LETTER = 8.2, 6.2
"""Approximate widths of letters of titles and of small text, px."""
HEAD, ROW, FOOT = 50.0, 22.0, 8.0
"""Height of a box above its ports, of a port, and below, px."""
GAP_X, GAP_Y, THIN = 116.0, 22.0, 16.0
"""Least distances of layers and of boxes, and the height of an empty place, px."""
SWEEPS = 12
PASSES = 2
MARGIN = 40.0


@dataclass(eq=False)
class LayerSlot:
    """A box, or an empty place that a link passes through (``box`` None)."""

    box: Box | None
    layer: int
    height: float
    width: float
    x: float = 0.0
    y: float = 0.0
    neighbours: list[tuple[LayerSlot, float, float]] = field(default_factory=list)
    """Those in the layer before, each with the distance of its port and of the own one from the tops."""
    followers: list[tuple[LayerSlot, float, float]] = field(default_factory=list)

    @property
    def middle(self) -> float:
        """Height of its middle."""
        return self.y + self.height / 2


@dataclass(frozen=True)
class LinkRoute:
    """The places that a link passes, from its source to its target."""

    link: BoxLink
    places: tuple[LayerSlot, ...]


@dataclass(frozen=True)
class Placed:
    """A diagram with places."""

    diagram: Diagram
    places: dict[str, LayerSlot]
    routes: tuple[LinkRoute, ...]
    width: float
    height: float


def place(diagram: Diagram) -> Placed:
    """Place all boxes of *diagram*, with the required ports of each in the order of what they lead to."""
    placed = _place(diagram)
    for _ in range(PASSES):
        placed = _place(_with_sorted_ports(placed))
    return placed


def _with_sorted_ports(placed: Placed) -> Diagram:
    heights: dict[tuple[str, str], list[float]] = {}
    for route in placed.routes:
        heights.setdefault((route.link.source, route.link.source_port), []).append(route.places[1].middle)

    def height(box: Box, port: BoxPort) -> float:
        found = heights.get((box.key, port.name), [])
        return sum(found) / len(found) if found else float("inf")

    def sorted_ports(box: Box) -> Box:
        required = sorted(box.required, key=lambda port: height(box, port))
        return replace(box, ports=(*box.provided, *required))

    diagram = placed.diagram
    return replace(diagram, boxes=tuple(map(sorted_ports, diagram.boxes)))


def _place(diagram: Diagram) -> Placed:
    layers = _layers(diagram)
    places = {
        box.key: LayerSlot(box, layers[box.key], box_height(box), box_width(box)) for box in diagram.boxes
    }
    routes, empty = _routes(diagram, places)
    columns: list[list[LayerSlot]] = [[] for _ in range(max(layers.values(), default=0) + 1)]
    for one in (*places.values(), *empty):
        columns[one.layer].append(one)
    columns = [column for column in columns if column]
    _order(columns)
    _set_heights(columns)
    x = MARGIN
    for column in columns:
        widest = max((one.width for one in column), default=0.0)
        for one in column:
            one.x, one.width = x, widest
        x += widest + GAP_X
    top = min((one.y for column in columns for one in column), default=0.0)
    for column in columns:
        for one in column:
            one.y += 2 * MARGIN - top
    bottom = max((one.y + one.height for column in columns for one in column), default=0.0)
    return Placed(diagram, places, tuple(routes), x - GAP_X + MARGIN, bottom + MARGIN)


def box_height(box: Box) -> float:
    """Return the height of a box, px."""
    rows = max(len(box.provided), len(box.required), 0)
    return HEAD + ROW * rows + (FOOT if rows else 0.0)


def box_width(box: Box) -> float:
    """Return the width that the texts of a box need, px."""
    left = max((len(one.name) for one in box.provided), default=0)
    right = max((len(one.name) for one in box.required), default=0)
    widest = max(len(box.title) * LETTER, len(box.note) * SMALL_LETTER, (left + right + 3) * SMALL_LETTER)
    return widest + 36.0


def port_height(box: Box, name: str, *, provided: bool) -> float:
    """Return the distance of a port from the top of its box, px."""
    ports: Sequence[BoxPort] = box.provided if provided else box.required
    names = [port.name for port in ports]
    return HEAD + ROW * (names.index(name) + 0.5)


def _layers(diagram: Diagram) -> dict[str, int]:
    """Return the layer of each box: callers of the frame, its boxes by longest path, then the rest."""
    before: dict[str, list[str]] = {box.key: [] for box in diagram.boxes}
    for link in diagram.links:
        before[link.target].append(link.source)
    inner = {
        key: [one for one in before[key] if one in diagram.framed] for key in before if key in diagram.framed
    }
    outer = {
        key: [one for one in before[key] if one not in diagram.framed and one not in diagram.before]
        for key in before
        if key not in diagram.framed and key not in diagram.before
    }
    found = dict.fromkeys(diagram.before, 0)
    for group in (inner, outer):
        first = 1 + max(found.values(), default=-1)
        depth: dict[str, int] = {}
        for key in group:
            _longest(key, group, depth)
        found |= {key: first + depth[key] for key in group}
    return found


def _longest(key: str, after: dict[str, list[str]], depth: dict[str, int]) -> None:
    """Set the longest path from *key*, without recursion; a cycle counts once."""
    stack = [(key, iter(after[key]))]
    open_ = {key}
    while stack:
        here, targets = stack[-1]
        for target in targets:
            if target not in depth and target not in open_:
                open_.add(target)
                stack.append((target, iter(after[target])))
                break
        else:
            depth[here] = 1 + max((depth[one] for one in after[here] if one in depth), default=-1)
            open_.discard(here)
            stack.pop()


def _routes(diagram: Diagram, places: dict[str, LayerSlot]) -> tuple[list[LinkRoute], list[LayerSlot]]:
    """Return the way of each link, with empty places in the layers between; one way a pair of boxes."""
    empty: list[LayerSlot] = []
    shared: dict[tuple[str, int], LayerSlot] = {}
    routes = []
    for link in diagram.links:
        source, target = places[link.source], places[link.target]
        way = [source]
        for layer in range(source.layer + 1, target.layer):
            key = f"{link.target}.{link.target_port}", layer
            thin = shared.get(key)
            if thin is None:
                thin = shared[key] = LayerSlot(None, layer, THIN, 0.0)
                empty.append(thin)
            way.append(thin)
        way.append(target)
        routes.append(LinkRoute(link, tuple(way)))
        for one, other in pairwise(way):
            there = port_height(one.box, link.source_port, provided=False) if one.box else THIN / 2
            here = port_height(other.box, link.target_port, provided=True) if other.box else THIN / 2
            other.neighbours.append((one, there, here))
            one.followers.append((other, here, there))
    return routes, empty


def _order(columns: list[list[LayerSlot]]) -> None:
    """Order each column by the mean place of its neighbours, forwards and backwards."""
    for sweep in range(SWEEPS):
        forward = sweep % 2 == 0
        for column in columns[1:] if forward else reversed(columns[:-1]):
            where = {id(one): number for other in columns for number, one in enumerate(other)}
            keys = {}
            for number, one in enumerate(column):
                beside = one.neighbours if forward else one.followers
                keys[id(one)] = (
                    sum(where[id(other)] + there / 1000.0 for other, there, _ in beside) / len(beside)
                    if beside
                    else float(number)
                )
            column.sort(key=lambda one: keys[id(one)])


def _set_heights(columns: list[list[LayerSlot]]) -> None:
    for column in columns:
        y = 0.0
        for one in column:
            one.y = y
            y += one.height + GAP_Y
    for sweep in range(SWEEPS):
        forward = sweep % 2 == 0
        for column in columns if forward else reversed(columns):
            wanted = []
            for one in column:
                beside = (
                    [*one.neighbours, *one.followers]
                    if sweep >= SWEEPS - 2
                    else (one.neighbours if forward else one.followers)
                )
                wanted.append(
                    sum(other.y + there - here for other, there, here in beside) / len(beside)
                    if beside
                    else one.y
                )
            _spread(column, wanted)


def _spread(column: Sequence[LayerSlot], wanted: Sequence[float]) -> None:
    """Move the places of a column to the wanted heights, as near as their order and gaps allow.

    Places that would overlap form a block, which stands at the mean of what its members want.
    """
    blocks: list[tuple[list[int], float, float]] = []  # members, top, height
    for number, one in enumerate(column):
        members, top, height = [number], wanted[number], one.height
        while blocks and blocks[-1][1] + blocks[-1][2] + GAP_Y > top:
            before, _, tall = blocks.pop()
            members = before + members
            height = tall + GAP_Y + height
            top = _mean_top(column, wanted, members)
        blocks.append((members, top, height))
    for members, top, _ in blocks:
        y = top
        for number in members:
            column[number].y = y
            y += column[number].height + GAP_Y


def _mean_top(column: Sequence[LayerSlot], wanted: Sequence[float], members: Iterable[int]) -> float:
    tops, y = [], 0.0
    for number in members:
        tops.append(wanted[number] - y)
        y += column[number].height + GAP_Y
    return sum(tops) / len(tops)
