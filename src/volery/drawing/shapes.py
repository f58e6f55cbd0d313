"""Placed diagrams as SVG: components with ports and lollipops, in the notation of UML."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from itertools import pairwise

from volery.drawing.boxes import Box
from volery.drawing.layers import MARGIN, SMALL_LETTER, LinkRoute, Placed, place, port_height
from volery.drawing.views import functional, verification
from volery.model.system import System

STEM, BALL, SOCKET = 16.0, 5.0, 8.5
"""Length of the stem of a lollipop and the radii of its ball and of the socket around it, px."""
PORT = 9.0
LEGEND = 34.0
KINDS = {
    "active": "active component (RtUnit)",
    "passive": "passive component (PpUnit)",
    "environment": "component of the environment",
    "vehicle": "vehicle with its autopilot",
    "system": "the system",
}
"""What the colours of boxes mean."""
STYLE = """
text { font-family: "Inter", "Segoe UI", "Helvetica Neue", Arial, sans-serif; fill: #1c2733; }
.title { font-size: 13.5px; font-weight: 600; }
.stereotype { font-size: 10.5px; fill: #5d6b7a; }
.note { font-size: 10.5px; fill: #5d6b7a; }
.port-name { font-size: 11px; fill: #33475b; }
.interface { font-size: 10.5px; fill: #2f5d8a; font-style: italic; paint-order: stroke; stroke: #f6f8fb;
  stroke-width: 4px; stroke-linejoin: round; }
.heading { font-size: 17px; font-weight: 600; }
.frame-name { font-size: 12.5px; font-weight: 600; fill: #4a5a6b; }
.frame { fill: #f6f8fb; stroke: #b9c6d4; stroke-width: 1.2; }
.box { stroke-width: 1.4; filter: url(#shadow); }
.active { fill: #e8f1fb; stroke: #2f6fae; }
.passive { fill: #ffffff; stroke: #6a87a3; }
.environment { fill: #fdf6e7; stroke: #b98b2c; }
.vehicle { fill: #e9f6ee; stroke: #3c8a5d; }
.system { fill: #e8f1fb; stroke: #2f6fae; }
.computer { fill: #ffffff; stroke: #5d7184; }
.computer-side { fill: #dfe6ed; stroke: #5d7184; stroke-width: 1.2; }
.side { stroke-width: 1.4; fill: none; }
.port { fill: #ffffff; stroke: #33475b; stroke-width: 1.2; }
.ball { fill: #ffffff; stroke: #33475b; stroke-width: 1.4; }
.stem, .socket { fill: none; stroke: #33475b; stroke-width: 1.4; }
.link { fill: none; stroke: #7c92a8; stroke-width: 1.4; }
.bus { fill: none; stroke-width: 5; stroke-linecap: round; }
.stub { fill: none; stroke-width: 1.8; }
"""
_SHADOW = (
    '<defs><filter id="shadow" x="-5%" y="-5%" width="112%" height="118%"><feDropShadow dx="0" dy="1.2" '
    'stdDeviation="1.4" flood-color="#1c2733" flood-opacity="0.14"/></filter></defs>'
)
_NOT_XML = dict.fromkeys((*range(32), *range(127, 160), *range(55296, 57344), 65534, 65535), "�")


def functional_svg(system: System) -> str:
    """Return the functional architecture of *system* as SVG."""
    return _svg(place(functional(system)))


def verification_svg(system: System) -> str:
    """Return the verification environment of *system* as SVG."""
    return _svg(place(verification(system)))


def text_of(words: str) -> str:
    """Return *words* as they may stand in SVG."""
    return escape(words.translate(_NOT_XML))


def rect(kind: str, x: float, y: float, width: float, height: float, *, rounded: float = 0.0) -> str:
    """Return a rectangle of a class of the style sheet."""
    size = f'width="{width:.1f}" height="{height:.1f}" rx="{rounded}"'
    return f'<rect class="{kind}" x="{x:.1f}" y="{y:.1f}" {size} stroke-width="1.3"/>'


def text(kind: str, x: float, y: float, words: str, anchor: str = "start", colour: str = "") -> str:
    """Return a text of a class of the style sheet at its baseline.

    *anchor* is ``start``, ``middle`` or ``end``.
    """
    style = f' style="fill:{colour}"' if colour else ""
    where = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{style}'
    return f'<text class="{kind}" {where}>{text_of(words)}</text>'


def document(width: float, height: float, parts: Iterator[str] | list[str]) -> str:
    """Return the SVG document of *parts*."""
    size = f'width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.0f} {height:.0f}"'
    inside = "\n".join(parts)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n<style>{STYLE}</style>\n{_SHADOW}\n'
        f'<rect width="100%" height="100%" fill="#ffffff"/>\n{inside}\n</svg>\n'
    )


def _svg(placed: Placed) -> str:
    heading = f'<text class="heading" x="{MARGIN:.0f}" y="34">{text_of(placed.diagram.title)}</text>'
    parts = [heading, *_frame(placed)]
    parts += [_link(route) for route in placed.routes]
    sockets = {(route.link.target, route.link.target_port) for route in placed.routes}
    for one in placed.places.values():
        if one.box is not None:
            parts += _box(one.box, one.x, one.y, one.width, one.height, sockets)
    kinds = list(dict.fromkeys(box.kind for box in placed.diagram.boxes))
    parts += legend(kinds, placed.height)
    return document(placed.width, placed.height + LEGEND, parts)


def legend(kinds: list[str], y: float) -> Iterator[str]:
    """Yield what the colours mean."""
    x = MARGIN
    for kind in kinds:
        name = KINDS[kind]
        yield rect(kind, x, y, 14, 14, rounded=3)
        yield text("note", x + 20, y + 11, name)
        x += 20 + len(name) * SMALL_LETTER + 22


def _frame(placed: Placed) -> Iterator[str]:
    inside = [placed.places[key] for key in placed.diagram.framed] if placed.diagram.frame else []
    if inside:
        left = min(one.x for one in inside) - 46
        right = max(one.x + one.width for one in inside) + 26
        top = min(one.y for one in inside) - 34
        bottom = max(one.y + one.height for one in inside) + 18
        yield rect("frame", left, top, right - left, bottom - top, rounded=10)
        name = f"«System» {placed.diagram.frame}"
        yield text("frame-name", left + 14, top + 20, name)


def _link(route: LinkRoute) -> str:
    """Return a smooth line from the required port to the socket, through the places in between."""
    first, *between, last = route.places
    assert first.box is not None
    assert last.box is not None
    start = port_height(first.box, route.link.source_port, provided=False)
    end = port_height(last.box, route.link.target_port, provided=True)
    points = [(first.x + first.width + PORT / 2, first.y + start)]
    for one in between:
        points += [(one.x, one.middle), (one.x + one.width, one.middle)]
    points.append((last.x - STEM - BALL - SOCKET, last.y + end))
    path = f"M{points[0][0]:.1f} {points[0][1]:.1f}"
    for (x0, y0), (x1, y1) in pairwise(points):
        if abs(y1 - y0) < 0.5:
            path += f" L{x1:.1f} {y1:.1f}"
        else:
            half = (x0 + x1) / 2
            path += f" C{half:.1f} {y0:.1f} {half:.1f} {y1:.1f} {x1:.1f} {y1:.1f}"
    return f'<path class="link" d="{path}"/>'


def _box(
    box: Box, x: float, y: float, width: float, height: float, sockets: set[tuple[str, str]]
) -> Iterator[str]:
    yield rect(f"box {box.kind}", x, y, width, height, rounded=5)
    if box.active:  # UML's active class has double sides
        for side in (x + 4.5, x + width - 4.5):
            yield f'<path class="side {box.kind}" d="M{side:.1f} {y:.1f}V{y + height:.1f}"/>'
    middle = x + width / 2
    yield text("stereotype", middle, y + 15, f"«{box.stereotype}»", "middle")
    yield text("title", middle, y + 30, box.title, "middle")
    yield text("note", middle, y + 44, box.note, "middle")
    for port in box.provided:
        at = y + port_height(box, port.name, provided=True)
        yield from _provided(x, at, port.name, port.interface, connected=(box.key, port.name) in sockets)
    for port in box.required:
        at = y + port_height(box, port.name, provided=False)
        edge = x + width
        yield _square(edge, at)
        yield text("port-name", edge - 11, at + 4, port.name, "end")


def _provided(x: float, y: float, name: str, interface: str, *, connected: bool) -> Iterator[str]:
    yield f'<path class="stem" d="M{x:.1f} {y:.1f}H{x - STEM:.1f}"/>'
    yield f'<circle class="ball" cx="{x - STEM - BALL + 1:.1f}" cy="{y:.1f}" r="{BALL}"/>'
    if connected:
        centre, top, bottom = x - STEM - BALL + 1, y - SOCKET, y + SOCKET
        arc = f"M{centre:.1f} {top:.1f}A{SOCKET} {SOCKET} 0 0 0 {centre:.1f} {bottom:.1f}"
        yield f'<path class="socket" d="{arc}"/>'
    yield _square(x, y)
    yield text("port-name", x + 11, y + 4, name)
    yield text("interface", x - 8, y - 11, interface, "end")


def _square(x: float, y: float) -> str:
    return rect("port", x - PORT / 2, y - PORT / 2, PORT, PORT)
