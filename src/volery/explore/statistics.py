"""How sure a campaign is: confidence intervals, when there are runs enough, and what a change is worth.

| of | interval |
|---|---|
| a probability | Wilson [1]; Clopper-Pearson while one outcome was seen fewer than 5 times |
| a mean | Student's t |
| a percentile | fractional order statistics [2]: the percentile bootstrap in closed form |
| any other statistic | bootstrap, bias-corrected and accelerated (BCa) [3] |
| a difference of two variants | Student's t over pairs with the same seed [4] |

A percentile is not resampled: the bootstrap's distribution of an order statistic is known, and the correction
BCa divides by an acceleration that is not defined for it.

[1] Brown, Cai and DasGupta, Statistical Science 16 (2001) 101; [2] Hutson, J. Applied Statistics 26 (1999)
343; [3] Efron, J. American Statistical Association 82 (1987) 171; [4] Law, Simulation Modeling and Analysis,
2015, chapter 11.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import ceil, floor, inf, isfinite, isnan, log10, nan, sqrt
from typing import Any

import numpy as np
import numpy.typing as npt

from volery.base import units
from volery.base.errors import UsageError
from volery.explore.points import CampaignRow

Array = npt.NDArray[np.float64]

LEVEL = 0.95
"""Confidence of intervals, if nothing else is asked for."""

LEAST_SEEN = 5
"""Fewer of one outcome than these are too few for Wilson's interval, and to know the probability well."""

LEAST_RUNS = 32
"""Runs before the first decision to stop. With fewer, runs that are alike by chance stop too early."""

GROWTH = 1.5
"""Ratio of the numbers of runs at two decisions: few decisions keep the coverage of the last interval."""

RESAMPLES = 1999


@dataclass(frozen=True)
class Interval:
    """An estimate with its confidence interval.

    Attributes:
        estimate: The estimate; NaN without a run.
        low: Lower end; -inf if the runs are too few to know one.
        high: Upper end; inf if the runs are too few to know one.
        runs: Number of runs that it was made of.
        level: Confidence, 0..1.
        method: Name of the method.
        too_few: Why the runs are too few for the stated confidence or width; empty if they are enough.
    """

    estimate: float
    low: float
    high: float
    runs: int
    level: float = LEVEL
    method: str = ""
    too_few: str = ""

    @property
    def half_width(self) -> float:
        """The greater distance of an end from the estimate."""
        return max(self.high - self.estimate, self.estimate - self.low)

    def __contains__(self, value: float) -> bool:
        """Return whether *value* is inside."""
        return self.low <= value <= self.high

    def sentence(self, what: str, unit: str = "") -> str:
        """Return the interval in words: ``delivered in 8 min: 0.97 to 0.995 (95 %, 200 runs)``.

        Args:
            what: What was estimated.
            unit: Its unit; empty for a share or a count.
        """
        tail = f" {unit}" if unit else ""
        if isnan(self.estimate):
            return f"{what}: not known, no run shows it"
        about = f"{self.level * 100:g} %, {self.runs} run{'' if self.runs == 1 else 's'}"
        warning = f"; {self.too_few}" if self.too_few else ""
        if self.low == -inf or self.high == inf:
            return f"{what}: {self.estimate:.4g}{tail}, no interval ({about}{warning})"
        low, high = _outwards(self.low, self.high)
        return f"{what}: {low} to {high}{tail} ({about}{warning})"


def _outwards(low: float, high: float) -> tuple[str, str]:
    """Return both ends with two digits of their distance, rounded outwards."""
    if not high > low:
        return f"{low:.6g}", f"{high:.6g}"
    digits = max(1 - floor(log10(high - low)), 0)
    scale = 10.0**digits
    ends = (floor(round(low * scale, 6)) / scale, ceil(round(high * scale, 6)) / scale)
    texts = [f"{end:.{digits}f}" for end in ends]
    return tuple(text.rstrip("0").rstrip(".") if "." in text else text for text in texts)  # type: ignore[return-value]  # two texts of two ends


# -- intervals


def probability(successes: int, runs: int, level: float = LEVEL, method: str = "") -> Interval:
    """Return the interval of a probability.

    Example::

        volery.explore.statistics.probability(197, 200).sentence("delivered in 8 min")

    Args:
        successes: Runs in which it happened.
        runs: All runs.
        level: Confidence.
        method: ``wilson`` (coverage near the level) or ``clopper-pearson`` (never below it). By default
            Wilson, and Clopper-Pearson with a warning while an outcome was seen fewer than 5 times: there
            Wilson's coverage can be 10 % below its level.

    Raises:
        UsageError: More successes than runs, or no such method.
    """
    from scipy.stats import binomtest  # noqa: PLC0415  # optional

    if not 0 <= successes <= runs:
        raise UsageError(f"{successes} successes in {runs} runs")
    known = {"wilson": "wilson", "clopper-pearson": "exact"}
    if method and method not in known:
        raise UsageError(f"no interval {method!r}; there is clopper-pearson or wilson")
    if not runs:
        return Interval(nan, 0.0, 1.0, 0, level, method or "clopper-pearson", "no run")
    rare = min(successes, runs - successes)
    too_few = ""
    if rare < LEAST_SEEN:
        outcome = "failures" if successes > runs - successes else "successes"
        too_few = f"too few runs: {rare} {outcome} seen, {LEAST_SEEN} needed for a narrow interval"
    chosen = method or ("clopper-pearson" if too_few else "wilson")
    found = binomtest(successes, runs).proportion_ci(level, known[chosen])
    return Interval(successes / runs, float(found.low), float(found.high), runs, level, chosen, too_few)


def mean(values: Sequence[float] | Array, level: float = LEVEL) -> Interval:
    """Return the t interval of a mean.

    Args:
        values: One value of each run; NaN is not counted.
        level: Confidence.
    """
    known = _known(values)
    count = len(known)
    if not count:
        return Interval(nan, -inf, inf, 0, level, "t", "no run")
    estimate = float(known.mean())
    if count == 1:
        return Interval(estimate, -inf, inf, 1, level, "t", "too few runs: 2 needed")
    if not isfinite(estimate):
        return Interval(estimate, -inf, inf, count, level, "t", "an infinite value")
    half = _t(level, count - 1) * float(known.std(ddof=1)) / sqrt(count)
    return Interval(estimate, estimate - half, estimate + half, count, level, "t")


def percentile(values: Sequence[float] | Array, share: float, level: float = LEVEL) -> Interval:
    """Return the interval of a percentile by fractional order statistics.

    It needs no assumption about the distribution. An end that lies outside the observed values is unknown:
    a 95th percentile needs about 72 runs.

    Args:
        values: One value of each run; NaN is not counted.
        share: The percentile as a share, such as 0.95.
        level: Confidence.

    Raises:
        UsageError: The share is not between 0 and 1.
    """
    if not 0.0 < share < 1.0:
        raise UsageError(f"a percentile is between 0 and 1, not {share:g}")
    known = np.sort(_known(values))
    count = len(known)
    if not count:
        return Interval(nan, -inf, inf, 0, level, "order statistics", "no run")
    lower, upper = _fractional(count, share, level)
    low, high = _order(known, lower, -inf), _order(known, upper, inf)
    too_few = ""
    if low == -inf or high == inf:
        too_few = f"too few runs: {least_runs(share, level)} needed for this percentile"
    return Interval(float(np.quantile(known, share)), low, high, count, level, "order statistics", too_few)


@lru_cache(maxsize=64)
def least_runs(share: float, level: float = LEVEL) -> int:
    """Return the least number of runs with which both ends of the interval of a percentile are known."""
    count = 2
    while not (_inside(count, share, level)):
        count = ceil(count * 1.1)
    while count > 2 and _inside(count - 1, share, level):
        count -= 1
    return count


def _inside(count: int, share: float, level: float) -> bool:
    lower, upper = _fractional(count, share, level)
    return (count + 1) * lower >= 1.0 and (count + 1) * upper <= count


@lru_cache(maxsize=4096)
def _fractional(count: int, share: float, level: float) -> tuple[float, float]:
    """Return the shares u at which the beta distribution of a fractional order statistic has its tails."""
    from scipy.optimize import brentq  # noqa: PLC0415  # optional
    from scipy.special import betainc  # noqa: PLC0415

    def tail(u: float, wanted: float) -> float:
        return float(betainc((count + 1) * u, (count + 1) * (1.0 - u), share)) - wanted

    lower, upper = (brentq(tail, 1e-9, 1.0 - 1e-9, args=(1.0 - side,)) for side in _sides(level))
    return lower, upper


def _sides(level: float) -> tuple[float, float]:
    return (1.0 - level) / 2.0, (1.0 + level) / 2.0


def _order(known: Array, share: float, beyond: float) -> float:
    """Return a fractional order statistic of sorted values, *beyond* outside them."""
    place = (len(known) + 1) * share - 1.0
    if place < 0.0 or place > len(known) - 1:
        return beyond
    below = floor(place)
    above = min(below + 1, len(known) - 1)
    return float(known[below] + (place - below) * (known[above] - known[below]))


def bootstrap(
    values: Sequence[float] | Array,
    statistic: Callable[..., Any],
    level: float = LEVEL,
    seed: int = 1,
) -> Interval:
    """Return the BCa bootstrap interval of any smooth statistic, such as a ratio or a trimmed mean.

    Example::

        bootstrap(times, lambda values, axis: scipy.stats.trim_mean(values, 0.1, axis))

    Args:
        values: One value of each run; NaN is not counted.
        statistic: Called with values and ``axis``, as ``numpy.mean``.
        level: Confidence.
        seed: Seed of the resampling.
    """
    from scipy.stats import bootstrap as resample  # noqa: PLC0415  # optional

    known = _known(values)
    if len(known) < 2:
        estimate = float(statistic(known, axis=-1)) if len(known) else nan
        return Interval(estimate, -inf, inf, len(known), level, "BCa bootstrap", "too few runs: 2 needed")
    estimate = float(statistic(known, axis=-1))
    if not np.ptp(known):
        return Interval(estimate, estimate, estimate, len(known), level, "BCa bootstrap")
    found = resample(
        (known,),
        statistic,
        confidence_level=level,
        n_resamples=RESAMPLES,
        rng=np.random.default_rng(seed),
        vectorized=True,
    ).confidence_interval
    return Interval(estimate, float(found.low), float(found.high), len(known), level, "BCa bootstrap")


@lru_cache(maxsize=4096)
def _t(level: float, freedom: int) -> float:
    from scipy.stats import t  # noqa: PLC0415  # optional

    return float(t.ppf((1.0 + level) / 2.0, freedom))


def _known(values: Sequence[float] | Array) -> Array:
    found: Array = np.asarray(values, dtype=float)
    known: Array = found[~np.isnan(found)]
    return known


# -- of rows


def observed(rows: Iterable[CampaignRow], name: str) -> Array:
    """Return an observable of rows; NaN where the run did not complete or did not observe it."""
    return np.array([row.observables.get(name, nan) if row.completed else nan for row in rows], dtype=float)


def met(rows: Iterable[CampaignRow], requirement: str, level: float = LEVEL) -> Interval:
    """Return the probability that a requirement is met. A run that did not complete does not meet it.

    Raises:
        UsageError: No row has a verdict on such a requirement.
    """
    found = list(rows)
    if not any(requirement in one.verdicts for one in found):
        names = dict.fromkeys(name for one in found for name in one.verdicts)
        raise UsageError(
            f"no run judges a requirement {requirement!r}; there is {', '.join(names) or 'none'}"
        )
    successes = sum(one.completed and bool(one.verdicts.get(requirement)) for one in found)
    return probability(successes, len(found), level)


# -- enough runs


@dataclass(frozen=True)
class Until:
    """Runs are enough when an interval is narrow: ``delivery_time.p95 within 5 %``.

    The decision is made at ``LEAST_RUNS`` runs and then each time they have grown by ``GROWTH`` (Chow and
    Robbins, Annals of Mathematical Statistics 36 (1965) 457: the last interval keeps its coverage as the
    width shrinks; few decisions after enough runs keep it at usual widths, too).

    Attributes:
        name: An observable, or a requirement whose probability is meant.
        statistic: ``mean``, ``probability``, or a percentile such as ``p95``.
        within: Half width of the interval: a share of the estimate if ``relative``, else in SI units.
        relative: Whether ``within`` is a share of the estimate.
        level: Confidence.
    """

    name: str
    statistic: str
    within: float
    relative: bool
    level: float = LEVEL

    def interval(self, rows: Iterable[CampaignRow]) -> Interval:
        """Return the interval after these rows."""
        if self.statistic == "probability":
            return met(rows, self.name, self.level)
        return self.of(observed(rows, self.name))

    def of(self, values: Sequence[float] | Array) -> Interval:
        """Return the interval of values of the observable, one a run."""
        if self.statistic == "mean":
            return mean(values, self.level)
        return percentile(values, self._share, self.level)

    def reached(self, interval: Interval) -> bool:
        """Return whether an interval is narrow enough."""
        wanted = self.within * abs(interval.estimate) if self.relative else self.within
        return interval.half_width <= wanted

    def enough(self, interval_after: Callable[[int], Interval], most: int) -> Interval:
        """Return the interval of the first number of runs that is enough, or of *most* runs.

        A percentile must be narrow at two decisions in succession: its width varies by chance as well, and
        to stop at the first narrow one would keep 92 % instead of 95 %.

        Example::

            until = read_until("drone_1.energy.p95 within 5 %")
            until.enough(lambda runs: until.interval(campaign.evaluate(points[:runs])), most=len(points))

        Args:
            interval_after: Makes that many runs and returns the interval, as ``interval`` of their rows.
            most: Runs that are not exceeded.
        """
        in_succession = 0
        for runs in self.decisions(most):
            found = interval_after(runs)
            in_succession = in_succession + 1 if self.reached(found) else 0
            if in_succession > self._is_percentile:
                return found
        return found if self.reached(found) else replace(found, too_few=f"not {self} after {most} runs")

    def decisions(self, most: int) -> Iterator[int]:
        """Yield the numbers of runs after which it is decided, up to *most*."""
        least = least_runs(self._share, self.level) if self._is_percentile else 0
        runs = max(least, LEAST_RUNS)
        while runs < most:
            yield runs
            runs = ceil(runs * GROWTH)
        yield most

    def __str__(self) -> str:
        width = f"{self.within * 100:g} %" if self.relative else f"{self.within:g}"
        return f"{self.name}.{self.statistic} within {width}"

    @property
    def _is_percentile(self) -> bool:
        return self.statistic not in ("mean", "probability")

    @property
    def _share(self) -> float:
        return float(self.statistic[1:]) / 100.0


_UNTIL = re.compile(
    r"(?P<name>\S+?)(?:\.(?P<statistic>mean|probability|p\d+(?:\.\d+)?))?\s+within\s+(?P<width>.+?)"
    r"(?:\s+at\s+(?P<level>[\d.]+)\s*%)?"
)
_UNTIL_FORM = (
    "write `delivery_time.p95 within 5 %`, `drone_1.energy within 200 J` or `in_time.probability within 1 %`"
)


def read_until(text: str) -> Until:
    """Return the condition ``<name>[.mean|.pNN|.probability] within <width> [at <level> %]``.

    A width in per cent is a share of the estimate; of a probability it is percentage points.

    Raises:
        UsageError: The text has another form, or a width or level that no runs can reach.
    """
    parts = _UNTIL.fullmatch(text.strip())
    if parts is None:
        raise UsageError(f"{text!r} is no condition; {_UNTIL_FORM}")
    width, statistic = parts["width"].strip(), parts["statistic"] or "mean"
    percent = re.fullmatch(r"([\d.]+(?:e-?\d+)?)\s*%", width)
    try:
        within = float(percent[1]) / 100.0 if percent else float(units.parse(width).value)
        level = float(parts["level"]) / 100.0 if parts["level"] else LEVEL
    except ValueError as error:
        raise UsageError(f"{text!r}: no width: {error}; {_UNTIL_FORM}") from None
    if not within > 0.0 or not 0.5 <= level < 1.0:
        raise UsageError(
            f"{text!r}: a width is greater than 0, a level from 50 % to below 100 %; {_UNTIL_FORM}"
        )
    relative = percent is not None and statistic != "probability"
    if statistic not in ("mean", "probability") and not 0.0 < float(statistic[1:]) < 100.0:
        raise UsageError(f"{text!r}: a percentile is between p0 and p100")
    return Until(parts["name"], statistic, within, relative, level)


# -- comparison


@dataclass(frozen=True)
class Paired:
    """The difference of two variants that ran with the same seeds.

    Attributes:
        difference: Second minus first, mean over the pairs.
        correlation: Of the two variants over the seeds; NaN if one does not vary.
        saved: How many times as many runs independent seeds would have needed; below 1 common seeds harm.
        left_out: Pairs of which a run did not complete.
    """

    difference: Interval
    correlation: float
    saved: float
    left_out: int

    @property
    def differs(self) -> bool:
        """Whether the variants differ at the level of confidence."""
        return 0.0 not in self.difference


def paired(first: Mapping[int, float], second: Mapping[int, float], level: float = LEVEL) -> Paired:
    """Compare two variants under common random numbers.

    Args:
        first: Values by seed; NaN for a run that did not complete.
        second: Those of the other variant.
        level: Confidence.

    Raises:
        UsageError: They have fewer than two seeds in common.
    """
    seeds = [seed for seed in first if seed in second]
    pairs = np.array([(first[seed], second[seed]) for seed in seeds], dtype=float).reshape(-1, 2)
    pairs = pairs[~np.isnan(pairs).any(axis=1)]
    if len(pairs) < 2:
        raise UsageError(
            f"the variants have {len(pairs)} completed runs with the same seed; a comparison needs 2 and more"
        )
    difference = mean(pairs[:, 1] - pairs[:, 0], level)
    apart = pairs.var(axis=0, ddof=1)
    together = float((pairs[:, 1] - pairs[:, 0]).var(ddof=1))
    varied = bool((apart > 0.0).all())
    correlation = float(np.corrcoef(pairs.T)[0, 1]) if varied else nan
    saved = float(apart.sum()) / together if together > 0.0 else inf
    return Paired(difference, correlation, saved, len(seeds) - len(pairs))


def compared(
    first: Iterable[CampaignRow], second: Iterable[CampaignRow], name: str, level: float = LEVEL
) -> Paired:
    """Compare an observable of the rows of two variants, paired by seed. See ``paired``."""
    values = [
        dict(zip((row.point.seed for row in rows), observed(rows, name), strict=True))
        for rows in (list(first), list(second))
    ]
    return paired(values[0], values[1], level)
