"""Points and lines as an SVG: publish over subscribers, sleep over its length, every other call as a bar."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from statistics import median

from volery.calibration.ros.fitting import Cost

WIDE, HIGH, LEFT, TOP = 420, 260, 64, 44
ROW = 24
LABEL = 22.0
"""Room for a label below an axis."""
_STYLE = """
text { font: 12px ui-monospace, monospace; fill: #1d2733; }
.title { font-weight: 600; }
.small { font-size: 11px; fill: #5b6b7c; }
.axis { stroke: #8fa3b8; fill: none; }
.point { fill: #3b78b5; fill-opacity: 0.35; }
.median { fill: #1d4f80; }
.law { stroke: #c2571a; stroke-width: 1.6; fill: none; }
.bar { fill: #3b78b5; fill-opacity: 0.55; }
.whisker { stroke: #1d2733; }
"""


def picture(costs: Mapping[str, Cost], title: str) -> str:
    """The whole SVG document."""
    lines = [costs[call] for call in ("publish", "sleep") if call in costs]
    single = [cost for call, cost in costs.items() if call not in ("publish", "sleep", "wait")]
    height = TOP + HIGH + 70 + ROW * len(single) + 20
    width = 2 * (LEFT + WIDE + 40)
    body = [f'<text class="title" x="16" y="22">{escape(title)}</text>']
    names = {"publish": ("subscribers", 1.0), "sleep": ("ms slept", 1e-3)}
    for number, cost in enumerate(lines):
        body += _chart(cost, LEFT + number * (LEFT + WIDE + 40), *names[cost.call])
    body += _bars(single, TOP + HIGH + 70, width)
    inside = "\n".join(body)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'viewBox="0 0 {width} {height}">\n<style>{_STYLE}</style>\n'
        f'<rect width="100%" height="100%" fill="#ffffff"/>\n{inside}\n</svg>\n'
    )


def _chart(cost: Cost, left: float, unit: str, scale: float) -> Iterator[str]:
    most_x = max(cost.points) * 1.05
    most_y = max(max(cost.whole.at(most_x), *map(median, cost.points.values())) * 1.4, 1.0)

    def place(x: float, y: float) -> tuple[float, float]:
        return left + WIDE * x / most_x, TOP + HIGH * (1.0 - min(y, most_y) / most_y)

    (x0, y0), (x1, y1) = place(0.0, cost.whole.constant), place(most_x, cost.whole.at(most_x))
    yield f'<path class="axis" d="M{left} {TOP}V{TOP + HIGH}H{left + WIDE}"/>'
    yield f'<text class="title" x="{left}" y="{TOP - 6}">{cost.call}, µs</text>'
    yield from _labels(cost, left, (most_x, most_y), unit, scale)
    for x, values in cost.points.items():
        for value in values:
            yield _dot("point", *place(x, max(value, 0.0)), 2.5)
        yield _dot("median", *place(x, max(median(values), 0.0)), 4.0)
    yield f'<path class="law" d="M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}"/>'


def _labels(cost: Cost, left: float, most: tuple[float, float], unit: str, scale: float) -> Iterator[str]:
    most_x, most_y = most
    last = left - LABEL
    for x in sorted(cost.points):
        at = left + WIDE * x / most_x
        if at - last < LABEL:
            continue
        last = at
        where = f'x="{at:.1f}" y="{TOP + HIGH + 16}" text-anchor="middle"'
        yield f'<text class="small" {where}>{x * scale:g}</text>'
    yield f'<text class="small" x="{left + WIDE}" y="{TOP + HIGH + 34}" text-anchor="end">{unit}</text>'
    for share in (0.0, 0.5, 1.0):
        y = TOP + HIGH * (1.0 - share)
        text = f"{most_y * share / 1e3:.0f}"
        yield f'<text class="small" x="{left - 6}" y="{y + 4:.1f}" text-anchor="end">{text}</text>'


def _bars(costs: list[Cost], top: float, width: float) -> Iterator[str]:
    longest = max((cost.high for cost in costs), default=1.0)
    start, room = 220.0, width - 220.0 - 140.0
    for number, cost in enumerate(costs):
        y = top + number * ROW
        end, low, high = (start + room * max(v, 0.0) / longest for v in (cost.typical, cost.low, cost.high))
        yield f'<text x="{start - 10}" y="{y + 13}" text-anchor="end">{cost.call}</text>'
        yield f'<rect class="bar" x="{start}" y="{y + 2}" width="{end - start:.1f}" height="14"/>'
        yield f'<path class="whisker" d="M{low:.1f} {y + 9}H{high:.1f}"/>'
        yield f'<text class="small" x="{high + 8:.1f}" y="{y + 13}">{cost.typical / 1e3:.1f} µs</text>'


def _dot(kind: str, x: float, y: float, radius: float) -> str:
    return f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="{radius}"/>'
