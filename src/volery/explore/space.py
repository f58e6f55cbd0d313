"""The design space: parameters, the values that they may take, and plans that sample them.

A parameter maps the unit interval to its values, so that every plan (grid, random, Latin hypercube, Sobol)
and every method of search and sensitivity serves every kind of parameter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from volery.explore.points import Value

Space = Mapping[str, "Parameter"]
"""Parameters by their paths in the model, or by ``scenario`` and ``allocation``."""


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
        number = (
            self.low * (self.high / self.low) ** share
            if self.log
            else self.low + share * (self.high - self.low)
        )
        return self.value(number)

    def value(self, number: float) -> Value:
        """Return a number as the model states it: with its unit."""
        rounded = round(number) if self.integer else number
        return f"{rounded!r} {self.unit}" if self.unit else rounded


Parameter = Choices | Range
