"""The design space: parameters, the values that they may take, and plans that sample them.

A parameter maps the unit interval to its values, so that every plan (grid, random, Latin hypercube, Sobol)
and every method of search and sensitivity serves every kind of parameter.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise, product
from math import erfc, inf, sqrt
from statistics import NormalDist
from typing import Any, Final, NamedTuple

import numpy as np

from volery.base.elementary import exp, log
from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.installed import require_extra
from volery.explore.points import PATHS, Value
from volery.model.system import System

GRID, RANDOM, LATIN_HYPERCUBE, SOBOL = "grid", "random", "latin-hypercube", "sobol"
METHODS: Final = (GRID, RANDOM, LATIN_HYPERCUBE, SOBOL)


def _stated(number: float, unit: str) -> Value:
    """Return a number as the model states it: with its unit."""
    plain = number if isinstance(number, int) else float(number)
    return f"{plain!r} {unit}" if unit else plain


@dataclass(frozen=True)
class Choices:
    """A parameter with a list of values.

    Attributes:
        values: The values; their order carries no meaning.
        weights: How frequent each is in a sample, relative to the others; all alike if it is empty.

    Raises:
        UsageError: There are fewer or more weights than values, one is negative, or all are 0.
    """

    values: Sequence[Value]
    weights: Sequence[float] = ()

    def __post_init__(self) -> None:
        """Check the weights."""
        if not self.weights:
            return
        if len(self.weights) != len(self.values):
            raise UsageError(f"{len(self.values)} values have {len(self.weights)} weights; give one for each")
        if not all(0.0 <= weight < inf for weight in self.weights) or not any(self.weights):
            raise UsageError("weights are numbers from 0 on, and one at least is more than 0")

    def at(self, share: float) -> Value:
        """Return the value at a share of the space, 0..1."""
        if not self.weights:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        ends = list(accumulate(self.weights))
        place = bisect_right(ends, share * ends[-1])
        return self.values[min(place, bisect_left(ends, ends[-1]))]

    def grid(self) -> Sequence[Value]:
        """Return the values of a grid: all, whatever their weights."""
        return self.values


@dataclass(frozen=True)
class Range:
    """A parameter with all numbers between two.

    Attributes:
        low: Least number.
        high: Greatest number.
        unit: Unit of both, such as ``MHz``; empty for a bare number.
        log: Whether ratios count, not differences.
        integer: Whether the values are whole numbers.
        steps: Number of values in a grid, evenly spaced from ``low`` to ``high``.
    """

    low: float
    high: float
    unit: str = ""
    log: bool = False
    integer: bool = False
    steps: int = 0

    def at(self, share: float) -> Value:
        """Return the value at a share of the space, 0..1."""
        if self.integer and not self.log:
            return self.value(min(self.low + int(share * (self.high - self.low + 1)), self.high))
        return self.value(self.number(share))

    def value(self, number: float) -> Value:
        """Return a number as the model states it: with its unit."""
        return _stated(round(number) if self.integer else number, self.unit)

    def grid(self) -> Sequence[Value]:
        """Return the values of a grid. Raises ``UsageError`` if their number is not known."""
        if self.steps:
            last = max(self.steps - 1, 1)
            numbers = (self.number(place / last) for place in range(self.steps))
            return list(dict.fromkeys(map(self.value, numbers)))
        if self.integer:
            return [self.value(number) for number in range(round(self.low), round(self.high) + 1)]
        raise UsageError(
            f"a grid from {self.value(self.low)} to {self.value(self.high)} needs `steps`, the number of its "
            f"values; or choose another plan: {choices(METHODS[1:])}"
        )

    def number(self, share: float) -> float:
        """Return the number at a share of the range, 0..1, whole or not."""
        if self.log:
            ratio: float = (self.high / self.low) ** share
            return self.low * ratio
        return self.low + share * (self.high - self.low)


class DistributionKind(NamedTuple):
    """A kind of distribution.

    Attributes:
        needed: Names of the numbers that it needs.
        usual: Further numbers with their usual values.
        bare: Those of them that have no unit.
        positive: Those that must be more than 0.
        quantile: Returns the quantile at a share, 0..1, from the share and all numbers.
    """

    needed: tuple[str, ...]
    usual: Mapping[str, float]
    bare: tuple[str, ...]
    positive: tuple[str, ...]
    quantile: Callable[[float, Mapping[str, float]], float]


def _normal(share: float, mean: float, sd: float, least: float, most: float) -> float:
    """Return a quantile of a normal distribution that is truncated."""
    if least > mean:  # the upper tail has no digits left below 1: use the lower one
        return 2.0 * mean - _normal(1.0 - share, mean, sd, 2.0 * mean - most, 2.0 * mean - least)
    low, high = (0.5 * erfc((mean - one) / (sd * sqrt(2.0))) for one in (least, most))
    if not high:
        return most  # so far out that all of it is at the bound
    inner = low + share * (high - low)
    if not low:
        inner = max(inner, _TAIL * high)
    if high == 1.0:
        inner = min(inner, 1.0 - _TAIL)
    return min(max(NormalDist(mean, sd).inv_cdf(inner), least), most)


def _lognormal(share: float, of: Mapping[str, float]) -> float:
    """Return a quantile of a distribution whose logarithm is normal, truncated."""
    bounds = (
        log(one) if 0.0 < one < inf else inf if one > 0.0 else -inf for one in (of["least"], of["most"])
    )
    return exp(_normal(share, log(of["median"]), of["sigma"], *bounds))


def _triangular(share: float, of: Mapping[str, float]) -> float:
    low, mode, high = of["least"], of["mode"], of["most"]
    width, left = high - low, mode - low
    if share * width < left:
        return low + sqrt(share * width * left)
    return high - sqrt((1.0 - share) * width * (high - mode))


def _beta(share: float, of: Mapping[str, float]) -> float:
    require_extra("explore", "a beta distribution")
    from scipy.special import betaincinv  # noqa: PLC0415  # optional

    return of["least"] + (of["most"] - of["least"]) * float(betaincinv(of["a"], of["b"], share))


_TAIL = 1e-9
"""Share of a normal distribution that is left out on a side without a bound: its quantile is infinite."""

_UNBOUNDED = {"least": -inf, "most": inf}
LAWS: Final = {
    "normal": DistributionKind(
        ("mean", "sd"),
        _UNBOUNDED,
        (),
        ("sd",),
        lambda share, of: _normal(share, of["mean"], of["sd"], of["least"], of["most"]),
    ),
    "lognormal": DistributionKind(
        ("median", "sigma"), _UNBOUNDED, ("sigma",), ("median", "sigma"), _lognormal
    ),
    "triangular": DistributionKind(("least", "mode", "most"), {}, (), (), _triangular),
    "beta": DistributionKind(("a", "b", "least", "most"), {}, ("a", "b"), ("a", "b"), _beta),
}
"""Distributions by their names."""


@dataclass(frozen=True)
class DistributedParameter:
    """A parameter with a distribution.

    Example::

        Distribution("normal", {"mean": 2.0, "sd": 0.5, "least": 1.0}, "ms")

    Attributes:
        law: ``normal`` with ``mean`` and ``sd``, truncated where ``least`` and ``most`` say so;
            ``lognormal`` with ``median`` and ``sigma``, the standard deviation of the logarithm, truncated
            likewise; ``triangular`` with ``least``, ``mode`` and ``most``; ``beta`` with ``a`` and ``b``
            between ``least`` and ``most``.
        numbers: Numbers of the law by their names.
        unit: Unit of all of them but ``sigma``, ``a`` and ``b``.

    Raises:
        UsageError: There is no such law, or no distribution has these numbers.
    """

    law: str
    numbers: Mapping[str, float]
    unit: str = ""

    def __post_init__(self) -> None:
        """Check the numbers."""
        if self.law not in LAWS:
            raise UsageError(
                f"no distribution {self.law!r}{did_you_mean(self.law, LAWS)}; there is {choices(LAWS)}"
            )
        law = LAWS[self.law]
        wrong = [name for name in self.numbers if name not in (*law.needed, *law.usual)]
        missing = [name for name in law.needed if name not in self.numbers]
        if wrong or missing:
            what = f"has no number {wrong[0]!r}" if wrong else f"needs `{missing[0]}`"
            named = ", ".join((*law.needed, *(f"{name} (optional)" for name in law.usual)))
            raise UsageError(f"a {self.law} distribution {what}; its numbers are {named}")
        known = self._known
        for name in law.positive:
            if not known[name] > 0.0:
                raise UsageError(f"`{name}` of a {self.law} distribution must be more than 0")
        in_order = [name for name in ("least", "mode", "most") if name in known]
        for one, other in pairwise(in_order):
            if known[one] > known[other] or (known["least"] >= known["most"]):
                raise UsageError(f"`{one}` of a {self.law} distribution must be less than `{other}`")
        if self.law == "lognormal" and known["most"] <= 0.0:
            raise UsageError("`most` of a lognormal distribution must be more than 0, as all its values are")

    @property
    def _known(self) -> Mapping[str, float]:
        return {**LAWS[self.law].usual, **self.numbers}

    def at(self, share: float) -> Value:
        """Return the quantile at a share, 0..1."""
        return _stated(LAWS[self.law].quantile(share, self._known), self.unit)

    def grid(self) -> Sequence[Value]:
        """Raise ``UsageError``: a distribution is sampled."""
        raise UsageError(f"a distribution has no grid; choose another plan: {choices(METHODS[1:])}")


Parameter = Choices | Range | DistributedParameter

Space = Mapping[str, Parameter]
"""Parameters by the paths that they set, joined by commas if they are several, or by ``scenario`` and
``allocation``."""


@dataclass(frozen=True)
class SamplingPlan:
    """How a space is sampled.

    Attributes:
        method: One of ``METHODS``.
        size: Number of points; a grid has its own.
    """

    method: str = GRID
    size: int = 0

    def __post_init__(self) -> None:
        """Check the method and the size."""
        if self.method not in METHODS:
            hint = did_you_mean(self.method, METHODS)
            raise UsageError(f"no plan {self.method!r}{hint}; there is {choices(METHODS)}")
        if self.method != GRID and self.size < 1:
            raise UsageError(f"the plan {self.method} needs its number of points")
        if self.method == SOBOL and self.size & (self.size - 1):
            raise UsageError(f"{self.size} points of Sobol's sequence are unbalanced; give a power of 2")

    def variants(self, space: Space, seed: int) -> Iterator[dict[str, Value]]:
        """Yield the values of each point.

        Args:
            space: What is sampled.
            seed: Seed of the plan; the same seed gives the same points.

        Raises:
            UsageError: A parameter has no grid.
        """
        if self.method == GRID:
            grids = [parameter.grid() for parameter in space.values()]
            yield from (dict(zip(space, values, strict=True)) for values in product(*grids))
            return
        for shares in self._shares(len(space), seed):
            yield {
                path: parameter.at(float(share))
                for (path, parameter), share in zip(space.items(), shares, strict=True)
            }

    def _shares(self, dimensions: int, seed: int) -> Any:
        """Return points of the unit cube."""
        random = np.random.default_rng(np.random.SeedSequence(seed))
        if self.method == RANDOM or not dimensions:
            return random.random((self.size, dimensions))
        require_extra("explore", f"the plan {self.method}")
        from scipy.stats import qmc  # noqa: PLC0415  # optional

        made = qmc.Sobol if self.method == SOBOL else qmc.LatinHypercube
        return made(dimensions, rng=random).random(self.size)


def default_space(system: System) -> Space:
    """Return the space of the model's own design parameters."""
    return {PATHS.join(parameter.paths): Choices(parameter.values) for parameter in system.design_parameters}
