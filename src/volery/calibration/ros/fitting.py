"""From points to laws: straight lines, how far the points lie from them, and how sure they are.

A line goes through the medians at each x, with weights that make *relative* residuals least: a call that is
cheap is to be estimated as well as one that is dear. How sure it is: the same from rounds drawn with
repetition (bootstrap over whole rounds, since what one probe measures hangs together).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple

from volery.base.seeds import stream
from volery.calibration.ros.samples import Points, Round, merged, points_of

TYPICAL_X = {"publish": 4.0, "publish_next": 2.0, "sleep": 50_000.0, "wait": 1_000_000.0}
"""Where a law is judged: four subscribers (two), 50 ms, a second."""

DRAWS = 200
NEGLIGIBLE_NS = 5_000.0
"""An interval of less to each side is tight whatever the figure: a twentieth of what a cycle takes."""

LOW, HIGH = 0.025, 0.975


class Straight(NamedTuple):
    """``constant + per_x * x``, ns."""

    constant: float
    per_x: float = 0.0

    def at(self, x: float) -> float:
        """Its value."""
        return self.constant + self.per_x * x


@dataclass(frozen=True)
class Cost:
    """What one call takes. ``caller`` is the part of ``whole`` that the calling thread spends.

    ``low`` and ``high`` bound a typical call (95 per cent); ``spread`` is the inter-quartile range of single
    measurements relative to the law; ``residual`` the greatest distance of a median from the line, relative.
    """

    call: str
    whole: Straight
    caller: Straight
    low: float
    high: float
    spread: float
    residual: float
    count: int
    points: dict[float, list[float]]

    @property
    def typical(self) -> float:
        """What a typical call takes, ns."""
        return self.whole.at(TYPICAL_X.get(self.call, 0.0))

    @property
    def half_width(self) -> float:
        """Half of the interval, relative to a typical call, or to ``NEGLIGIBLE_NS`` if that takes less."""
        return (self.high - self.low) / 2.0 / max(self.typical, NEGLIGIBLE_NS)

    def is_tight(self, within: float) -> bool:
        """Whether it is known to *within* (relative)."""
        return self.half_width <= within or (self.high - self.low) / 2.0 <= NEGLIGIBLE_NS


def fit(by_x: dict[float, list[float]]) -> Straight:
    """The line through the medians at each x, nowhere below zero for an x that is not.

    With one x only: a constant if that is 0, else proportional.
    """
    medians = {x: median(values) for x, values in by_x.items()}
    if len(medians) == 1:
        [(x, value)] = medians.items()
        return Straight(0.0, max(0.0, value) / x) if x else Straight(max(0.0, value))
    constant, per_x = _least_squares(medians)
    if per_x < 0.0:  # noise has turned a part of it below zero, which no cost is
        return Straight(max(0.0, median(medians.values())))
    if constant < 0.0:
        return Straight(0.0, max(0.0, median(value / x for x, value in medians.items() if x)))
    return Straight(constant, per_x)


def _least_squares(medians: dict[float, float]) -> tuple[float, float]:
    """Constant and slope, residuals weighted by the value."""
    weights = {x: max(value, NEGLIGIBLE_NS) ** -2 for x, value in medians.items()}
    total = sum(weights.values())
    mean_x = sum(weights[x] * x for x in medians) / total
    mean_y = sum(weights[x] * value for x, value in medians.items()) / total
    spread_x = sum(weights[x] * (x - mean_x) ** 2 for x in medians)
    slope = sum(weights[x] * (x - mean_x) * (value - mean_y) for x, value in medians.items()) / spread_x
    return mean_y - slope * mean_x, slope


def costs(rounds: Sequence[Round], seed: int = 1) -> dict[str, Cost]:
    """What every call takes, by the rounds so far."""
    whole = [points_of(one, "process_ns") for one in rounds]
    together, callers = merged(whole), merged([points_of(one, "caller_ns") for one in rounds])
    drawn = _drawn(whole, seed)
    return {
        call: _cost(call, by_x, callers[call], sorted(drawn[call])) for call, by_x in sorted(together.items())
    }


def _cost(
    call: str, by_x: dict[float, list[float]], of_caller: dict[float, list[float]], drawn: list[float]
) -> Cost:
    line = fit(by_x)
    away = sorted(
        (value - line.at(x)) / max(line.at(x), NEGLIGIBLE_NS)
        for x, values in by_x.items()
        for value in values
    )
    from_line = [
        abs(median(values) - line.at(x)) / max(line.at(x), NEGLIGIBLE_NS) for x, values in by_x.items()
    ]
    return Cost(
        call=call,
        whole=line,
        caller=fit(of_caller),
        low=_quantile(drawn, LOW),
        high=_quantile(drawn, HIGH),
        spread=_quantile(away, 0.75) - _quantile(away, 0.25),
        residual=max(from_line),
        count=len(away),
        points=by_x,
    )


def _drawn(rounds: Sequence[Points], seed: int) -> dict[str, list[float]]:
    """The typical cost of each call, from as many rounds drawn with repetition, many times."""
    random = stream(seed, "calibrate/bootstrap")
    found: dict[str, list[float]] = {}
    for _ in range(DRAWS):
        chosen = merged(random.choices(rounds, k=len(rounds)))
        for call, by_x in chosen.items():
            found.setdefault(call, []).append(fit(by_x).at(TYPICAL_X.get(call, 0.0)))
    return found


def _quantile(ordered: Sequence[float], share: float) -> float:
    """Linear between order statistics."""
    place = share * (len(ordered) - 1)
    below = int(place)
    above = min(below + 1, len(ordered) - 1)
    return ordered[below] + (ordered[above] - ordered[below]) * (place - below)
