"""The deployment of a model as SVG: computers with what they execute, their vehicles and networks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil, sqrt

from volery.base.time import to_seconds
from volery.drawing.layers import LETTER, MARGIN, SMALL_LETTER
from volery.drawing.shapes import LEGEND, document, legend, rect, text
from volery.model.system import NetworkSpec, ProcessorSpec, System

CHIP, GAP, DEPTH = 26.0, 8.0, 9.0
"""Height of a component within a computer, the gap between two, and the depth of a computer, px."""
HEAD, CARRIED = 54.0, 26.0
"""Height of a computer's texts, and of the name of the vehicle that carries it, px."""
GUTTER = 34.0
"""Width between columns, where the stubs of networks run, px."""
BUS = 40.0
"""Distance of two networks, px."""
Places = dict[str, tuple[float, float]]
"""Left and top of each computer, px."""
BUS_COLOURS = ("#2f6fae", "#b0562f", "#3c8a5d", "#7a4fa3", "#a3812c")


@dataclass(frozen=True)
class _Computer:
    """A computer with its contents: texts and kinds of the chips."""

    processor: ProcessorSpec
    chips: tuple[tuple[str, str], ...]
    carrier: str

    @property
    def height(self) -> float:
        """Height with the frame of its vehicle, px."""
        return HEAD + len(self.chips) * (CHIP + GAP) + GAP + DEPTH + (CARRIED + 16.0 if self.carrier else 0.0)


@dataclass(frozen=True)
class _Placed:
    """Computers with their places; those ``above`` the networks stand in one row."""

    places: Places
    above: dict[str, _Computer]
    width: float
    right: float


def deployment_svg(system: System) -> str:
    """Return the deployment of *system*: the chosen allocation on its platform.

    Computers on the ground stand above the networks if they fit into one row, all others below.
    """
    computers = [_computer(system, processor) for processor in system.processors]
    grounded = [computer for computer in computers if not computer.carrier]
    below = [computer for computer in computers if computer.carrier]
    columns = _columns(len(below) or len(computers))
    if len(grounded) > max(columns, 4):
        grounded, below = [], computers
    chips = [words for computer in computers for words, _ in computer.chips]
    width = max(
        [210.0, *(len(chip) * SMALL_LETTER * 1.12 + 44.0 for chip in chips)]
        + [len(_name(computer)) * LETTER + 36.0 for computer in computers]
    )
    bus_top, places = _grid(grounded, max(columns, 4), width, 64.0)
    below_top = bus_top + BUS * len(system.networks) + 16.0
    bottom, more = _grid(below, columns, width, below_top)
    places |= more
    right = max((x for x, _ in places.values()), default=MARGIN) + width + GUTTER
    placed = _Placed(places, {one.processor.name: one for one in grounded}, width, right)
    chosen = f", allocation {system.allocation}" if system.allocation else ""
    heading = f"{system.name}: deployment{chosen}"
    parts = [text("heading", MARGIN, 34, heading)]
    for number, network in enumerate(system.networks):
        parts += _network(network, number, bus_top + BUS * number + BUS / 2, placed)
    for one in computers:
        parts += _draw(one, *places[one.processor.name], width)
    parts += legend(
        list(dict.fromkeys(kind for computer in computers for _, kind in computer.chips)), bottom + 6
    )
    return document(max(right, len(heading) * 10.0) + MARGIN, bottom + LEGEND, parts)


def _columns(count: int) -> int:
    """Return the number of columns for *count* computers: a few more than rows, and full rows."""
    rows = max(1, round(sqrt(count / 1.6)))
    return max(1, ceil(count / rows))


def _computer(system: System, processor: ProcessorSpec) -> _Computer:
    chips = [
        (f"{instance.name}: {instance.component.name}", "active" if instance.activity else "passive")
        for instance in system.instances
        if instance.processor == processor.name
    ]
    chips += [
        (f"node of {vehicle.name}", "vehicle")
        for vehicle in system.vehicles
        if vehicle.processor == processor.name
    ]
    carrier = ""
    if processor.carried_by:
        vehicle = system.vehicle(processor.carried_by)
        fed = "" if processor.powered_by == vehicle.name else ", powered apart"
        carrier = f"on {vehicle.name} ({vehicle.kind}, {vehicle.autopilot}{fed})"
    return _Computer(processor, tuple(chips), carrier)


def _grid(computers: Sequence[_Computer], columns: int, width: float, top: float) -> tuple[float, Places]:
    """Return the bottom of the grid, and the place of each computer."""
    places: Places = {}
    y = top
    for first in range(0, len(computers), columns):
        row = computers[first : first + columns]
        for number, one in enumerate(row):
            places[one.processor.name] = MARGIN + GUTTER + number * (width + GUTTER + 14.0), y
        y += max(one.height for one in row) + 26.0
    return y, places


def _name(one: _Computer) -> str:
    return f"{one.processor.name}: {one.processor.kind}"


def _draw(one: _Computer, x: float, y: float, width: float) -> Iterator[str]:
    if one.carrier:
        yield rect("frame", x - 12, y, width + 24 + DEPTH, one.height, rounded=10)
        yield text("frame-name", x, y + 18, one.carrier)
        y += CARRIED
    height = one.height - DEPTH - (CARRIED + 16.0 if one.carrier else 0.0)
    y += DEPTH
    right, bottom, d = x + width, y + height, DEPTH
    outline = f"M{x:.1f} {y:.1f}l{d} -{d}H{right + d:.1f}V{bottom - d:.1f}L{right:.1f} {bottom:.1f}V{y:.1f}Z"
    yield f'<path class="computer-side" d="{outline}M{right:.1f} {y:.1f}l{d} -{d}"/>'
    yield rect("computer", x, y, width, height)
    middle, processor = x + width / 2, one.processor
    load = f" · {processor.load:.0%} load" if processor.load else ""
    note = f"{processor.cores} × {processor.frequency_mhz:g} MHz · {processor.scheduler}{load}"
    yield text("stereotype", middle, y + 15, "«HwProcessor»", "middle")
    yield text("title", middle, y + 30, _name(one), "middle")
    yield text("note", middle, y + 44, note, "middle")
    for number, (words, kind) in enumerate(one.chips):
        top = y + HEAD + number * (CHIP + GAP)
        yield rect(kind, x + 12, top, width - 24, CHIP, rounded=4)
        yield text("port-name", middle, top + 17, words, "middle")


def _network(network: NetworkSpec, number: int, y: float, placed: _Placed) -> Iterator[str]:
    colour = BUS_COLOURS[number % len(BUS_COLOURS)]
    yield f'<path class="bus" stroke="{colour}" d="M{MARGIN:.1f} {y:.1f}H{placed.right:.1f}"/>'
    for name in network.between:
        x, top = placed.places[name]
        if name in placed.above:
            side = x + placed.width - 26.0 - 12.0 * number
            way = f"M{side:.1f} {top + placed.above[name].height - 1:.1f}V{y:.1f}"
        else:
            side = x - 22.0 - 5.0 * (number % 4)
            way = f"M{side:.1f} {y:.1f}V{top + 70.0 + 12.0 * number:.1f}H{x:.1f}"
        yield f'<path class="stub" stroke="{colour}" d="{way}"/>'
        yield f'<circle cx="{side:.1f}" cy="{y:.1f}" r="3.5" fill="{colour}"/>'
    latency = to_seconds(network.latency_ns) * 1000
    lost = f" · {network.loss * 100:g} % lost" if network.loss else ""
    words = f"{network.name}: {_bandwidth(network.bandwidth_bit_s)} · {latency:g} ms{lost}"
    yield text("frame-name", MARGIN + 4, y - 8, words, colour=colour)


def _bandwidth(bits: float) -> str:
    for factor, unit in ((1e9, "Gbit/s"), (1e6, "Mbit/s"), (1e3, "kbit/s")):
        if bits >= factor:
            return f"{bits / factor:g} {unit}"
    return f"{bits:g} bit/s"
