"""Campaigns: rounds of measurement until every figure is known well enough, and their results.

Rounds are kept in a file, a line each, so that an interrupted campaign continues. The result is an entry of
the user's catalogue and a plot. A campaign has one frequency, and its law is valid there only. The law of a
second campaign at another frequency joins it to lines over the frequency, as in the paper. The plot shows
publish over subscribers, sleep over its length, and every other call as a bar.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path
from statistics import median

from volery.base.errors import UsageError
from volery.base.seeds import stream
from volery.calibration.host_machine import Machine, put_law
from volery.calibration.ros.call_costs import CallCost, CostLine, ProbeSample, Round, call_costs
from volery.calibration.ros.probe_environment import Pace, ProbeSetup
from volery.cost import CallFigures, Line, RosLaw, line_through, read_catalogue

LEAST_ROUNDS = 3
"""Least number of rounds that shows their spread."""


@dataclass(frozen=True)
class Conditions:
    """Conditions of a campaign; rounds under other conditions do not belong to it."""

    client: str
    processor: str
    frequency_mhz: float


@dataclass(frozen=True)
class RoundPlan:
    """Least and greatest number of rounds, and the relative precision ``within`` of each figure."""

    least: int = 10
    most: int = 30
    within: float = 0.1
    seed: int = 1
    pace: Pace = field(default_factory=Pace)

    def pace_of(self, number: int) -> Pace:
        """Return the pace of a round: the least and greatest counts and two others, in random order."""
        counts = self.pace.counts
        random = stream(self.seed, f"calibrate/{number}")
        between = counts[1:-1]
        chosen = [counts[0], counts[-1], *random.sample(between, min(2, len(between)))]
        sleeps = list(self.pace.sleeps_ms)
        random.shuffle(chosen)
        random.shuffle(sleeps)
        periods = self.pace.periods_ms[:: -1 if number % 2 else 1]
        return replace(self.pace, periods_ms=periods, counts=tuple(chosen), sleeps_ms=tuple(sleeps))


@dataclass(frozen=True)
class RoundProgress:
    """State after a round: completed rounds, most rounds, figures that are not known well enough yet."""

    rounds: int
    most: int
    loose: tuple[CallCost, ...]


Show = Callable[[RoundProgress], None]


class CampaignLog:
    """File of completed rounds; raises ``UsageError`` if it has rounds under other conditions."""

    def __init__(self, file: Path, under: Conditions) -> None:
        self._file = file
        self.rounds: list[Round] = []
        header = vars(under)
        if not file.exists():
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(json.dumps(header) + "\n", encoding="utf-8")
            return
        lines = file.read_text(encoding="utf-8").splitlines()
        try:
            known = json.loads(lines[0])
            self.rounds = [
                tuple(ProbeSample(*load) for load in json.loads(line)) for line in _whole(lines[1:])
            ]
        except (IndexError, ValueError, TypeError, RecursionError) as error:
            raise UsageError(f"{file} holds no rounds of a campaign: remove it") from error
        if known != header:
            raise UsageError(f"{file} holds rounds of {known}, not of {header}: remove it or move it away")

    def keep(self, one: Round) -> None:
        """Append a round."""
        self.rounds.append(one)
        with self._file.open("a", encoding="utf-8") as file:
            file.write(json.dumps(one) + "\n")

    def forget(self) -> None:
        """Delete the file after the campaign."""
        self._file.unlink(missing_ok=True)


def _whole(lines: list[str]) -> Iterator[str]:
    """Yield the lines without a last one that is incomplete after a crash."""
    for number, line in enumerate(lines):
        if number < len(lines) - 1 or line.endswith("]]"):
            yield line


def run_campaign(
    stage: ProbeSetup, plan: RoundPlan, notebook: CampaignLog, show: Show = lambda progress: None
) -> None:
    """Measure rounds until all figures are precise or the plan's greatest number is reached.

    Args:
        stage: The graph with the peers of the probe.
        plan: Numbers of rounds, precision and paces.
        notebook: Where each round is kept; a campaign goes on after the rounds in it.
        show: Called before each round.

    Raises:
        LinkError: A probe fails or does not end.
    """
    while True:
        done = len(notebook.rounds)
        loose = uncertain_costs(notebook.rounds, plan.within) if done >= plan.least else ()
        show(RoundProgress(done, plan.most, loose))
        if done >= plan.most or (done >= plan.least and not loose):
            return
        notebook.keep(stage.probe(plan.pace_of(done)))


def uncertain_costs(rounds: Iterable[Round], within: float) -> tuple[CallCost, ...]:
    """Return the costs whose relative precision is worse than ``within``."""
    return tuple(cost for cost in call_costs(list(rounds)).values() if not cost.is_tight(within))


CALLBACK = ("spin_once_first", "spin_once_next")
"""Calls that the embedded graph prices when a callback begins."""

NO_SPIN = CallFigures(
    provenance="calculated",
    source="rospy has no spinOnce: a message has its whole price where it is received",
    constant=Line(offset=0.0),
)

_PUBLICATIONS = (("publish", "publish_next"), ("publish_often", "publish_next_often"))
_UNITS = {
    **{call: "subscriber" for pair in _PUBLICATIONS for call in pair},
    "sleep": "microsecond slept",
    "wait": "microsecond",
}


def ros_law(costs: Mapping[str, CallCost], under: Conditions) -> RosLaw:
    """Return the law at the frequency of a campaign."""
    calls = {call: _figures(cost) for call, cost in _with_slope(costs).items()}
    if CALLBACK[1] not in calls:
        calls.update(dict.fromkeys(CALLBACK, NO_SPIN))
    rounds = max((len(values) for cost in costs.values() for values in cost.points.values()), default=0)
    return RosLaw(
        client=under.client,
        provenance="measured",
        source=f"volery cost calibrate ros --client {under.client}, {rounds} rounds on {under.processor}",
        validity=f"{under.frequency_mhz:g} MHz only; publishers with a queue (queue_size above 0)",
        error=round(max((cost.spread / 2.0 for cost in _common(costs)), default=0.0), 3),
        least_mhz=under.frequency_mhz,
        greatest_mhz=under.frequency_mhz,
        calls=calls,
    )


def _with_slope(costs: Mapping[str, CallCost]) -> dict[str, CallCost]:
    """Give ``publish_next`` the slope of ``publish`` where it was measured at one number of subscribers."""
    found = dict(costs)
    for name, next_name in _PUBLICATIONS:
        first, following = costs.get(name), costs.get(next_name)
        if first is None or following is None or following.typical <= 0.0:
            found.pop(next_name, None)
        elif len(following.points) == 1:
            [x] = following.points
            whole, caller = (
                _through_point(x, getattr(following, part).at(x), getattr(first, part).per_x)
                for part in ("whole", "caller")
            )
            found[next_name] = replace(following, whole=whole, caller=caller)
    if "publish" not in found and "publish_often" in found:  # rounds of short cycles only
        for name, often in zip(*_PUBLICATIONS, strict=True):
            if often in found:
                found[name] = replace(found[often], call=name)
    return found


def _through_point(x: float, value: float, per_x: float) -> CostLine:
    per_x = min(per_x, value / x)
    return CostLine(value - per_x * x, per_x)


def _common(costs: Mapping[str, CallCost]) -> list[CallCost]:
    """Return the costs of frequent calls, by which a law as a whole is judged."""
    return [costs[call] for call in ("publish", "sleep") if call in costs]


def _figures(cost: CallCost) -> CallFigures:
    unit = _UNITS.get(cost.call)
    spread = f"half the inter-quartile range {cost.spread / 2.0:.0%}"
    residual = f", medians at most {cost.residual:.0%} off the line" if unit else ""
    return CallFigures(
        provenance="measured",
        source=f"{cost.count} measurements, {spread}{residual}",
        constant=_line(cost.whole.constant),
        per_x=_line(cost.whole.per_x) if unit else None,
        caller=_line(cost.caller.constant),
        caller_per_x=_line(cost.caller.per_x) if unit else None,
        error=round(cost.spread / 2.0, 3),
    )


def _line(value: float) -> Line:
    return Line(offset=float(f"{value:.6g}"))


def join_laws(known: RosLaw, new: RosLaw) -> RosLaw:
    """Join two laws of one frequency each to a law between them; else return ``new``."""
    low, high = sorted((known, new), key=lambda law: law.least_mhz)
    one_point = known.least_mhz == known.greatest_mhz
    if not one_point or low.least_mhz == high.least_mhz:
        return new
    calls = {
        call: _through(low.least_mhz, low.calls[call], high.least_mhz, high.calls[call])
        for call in low.calls
        if call in high.calls
    }
    between = f"{low.least_mhz:g} to {high.least_mhz:g} MHz"
    return new.model_copy(
        update={
            "calls": calls,
            "least_mhz": low.least_mhz,
            "greatest_mhz": high.least_mhz,
            "error": max(low.error, high.error),
            "validity": new.validity.replace(f"{new.least_mhz:g} MHz only", between),
        }
    )


def _through(at_low: float, low: CallFigures, at_high: float, high: CallFigures) -> CallFigures:
    def line(name: str) -> Line | None:
        one, other = getattr(low, name), getattr(high, name)
        if one is None or other is None:
            return None
        return line_through({at_low: one.offset, at_high: other.offset})

    parts = ("constant", "per_x", "caller", "caller_per_x")
    errors = [one.error or 0.0 for one in (low, high)]
    return high.model_copy(update={**{name: line(name) for name in parts}, "error": max(errors)})


def write_entry(file: Path, machine: Machine, law: RosLaw) -> RosLaw:
    """Write a law into a catalogue in place of the one of the same library; create the file if it is missing.

    Args:
        file: The catalogue.
        machine: The computer.
        law: The law at one frequency, which is joined with a known one at another frequency.

    Returns:
        The law that was written.

    Raises:
        ModelError: The file exists and is not a catalogue.
        UsageError: The file cannot be written.
    """
    known = read_catalogue(file).processors.get(machine.name) if file.exists() else None
    before = known.ros.get(law.client) if known is not None else None
    made = join_laws(before, law) if before is not None else law
    put_law(file, machine, ("ros", law.client), made, (made.least_mhz, made.greatest_mhz))
    return made


def format_line(line: CostLine, call: str) -> str:
    """Return a cost in microseconds with its part per subscriber (n) or per millisecond."""
    unit = _UNITS.get(call)
    if unit is None:
        return f"{line.constant / 1e3:.1f}"
    constant = f"{line.constant / 1e3:.1f} + " if line.constant else ""
    if unit == "subscriber":
        return f"{constant}{line.per_x / 1e3:.1f} n"
    return f"{constant}{line.per_x:.3f} ms"


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


def plot_svg(costs: Mapping[str, CallCost], title: str) -> str:
    """Return an SVG document with points and lines of the costs."""
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


def _chart(cost: CallCost, left: float, unit: str, scale: float) -> Iterator[str]:
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


def _labels(cost: CallCost, left: float, most: tuple[float, float], unit: str, scale: float) -> Iterator[str]:
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


def _bars(costs: list[CallCost], top: float, width: float) -> Iterator[str]:
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
