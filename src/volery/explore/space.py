"""The design space: parameters, the values that they may take, and plans that sample them.

A parameter maps the unit interval to its values, so that every plan (grid, random, Latin hypercube, Sobol)
and every method of search and sensitivity serves every kind of parameter.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import inf
from statistics import NormalDist
from typing import Any, Final

import numpy as np

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
    """

    values: Sequence[Value]

    def at(self, share: float) -> Value:
        """Return the value at a share of the space, 0..1."""
        return self.values[min(int(share * len(self.values)), len(self.values) - 1)]

    def grid(self) -> Sequence[Value]:
        """Return the values of a grid."""
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


@dataclass(frozen=True)
class Normal:
    """A parameter with a normal distribution, truncated where bounds are given.

    Attributes:
        mean: Mean before the truncation.
        sd: Standard deviation before the truncation.
        unit: Unit of all numbers.
        least: Least value.
        most: Greatest value.
    """

    mean: float
    sd: float
    unit: str = ""
    least: float = -inf
    most: float = inf

    def at(self, share: float) -> Value:
        """Return the quantile at a share, 0..1."""
        spread = NormalDist(self.mean, self.sd)
        low, high = spread.cdf(self.least), spread.cdf(self.most)
        inner = min(max(low + share * (high - low), _TAIL), 1.0 - _TAIL)
        return _stated(min(max(spread.inv_cdf(inner), self.least), self.most), self.unit)

    def grid(self) -> Sequence[Value]:
        """Raise ``UsageError``: a distribution is sampled."""
        raise UsageError(f"a distribution has no grid; choose another plan: {choices(METHODS[1:])}")


_TAIL = 1e-9
"""Share of a normal distribution that is left out on both sides: its quantiles at 0 and 1 are infinite."""


Parameter = Choices | Range | Normal

Space = Mapping[str, Parameter]
"""Parameters by the paths that they set, joined by commas if they are several, or by ``scenario`` and
``allocation``."""


@dataclass(frozen=True)
class Plan:
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
    return {PATHS.join(one.paths): Choices(one.values) for one in system.design_parameters}
