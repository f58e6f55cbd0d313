"""Costs that explain measured times: none is negative, and a few odd measurements do not bend the rest.

Minimises sum of rho(relative residual) over c >= 0, rho growing like the square for small residuals and like
the absolute value for large ones: iteratively reweighted least squares, each by coordinate descent.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_ROUNDS = 25
_SWEEPS = 40
_SMALL = 0.03  # a relative residual below it counts by its square


def explain(counts: Floats, times: Floats, weights: Floats, floor: float) -> Floats:
    """Costs by column of *counts* (measurements x operations), so that counts @ costs are near *times*.

    Residuals are relative to the time, or to *floor* where that is greater; *weights* say how much a
    measurement matters. An operation that no measurement contains costs 0.
    """
    scale = 1.0 / np.maximum(times, floor)
    costs = np.zeros(counts.shape[1])
    trust = np.sqrt(weights)
    for _ in range(_ROUNDS):
        costs = _descend(counts * (trust * scale)[:, None], times * trust * scale, costs)
        residuals = np.abs(counts @ costs - times) * scale
        trust = np.sqrt(weights / np.maximum(residuals, _SMALL))
    return costs


def _descend(matrix: Floats, wanted: Floats, start: Floats) -> Floats:
    """Least squares of matrix @ c - wanted over c >= 0, from *start*."""
    costs = start.copy()
    lengths = (matrix * matrix).sum(axis=0)
    left = wanted - matrix @ costs
    for _ in range(_SWEEPS):
        for column in np.flatnonzero(lengths):
            better = max(0.0, costs[column] + matrix[:, column] @ left / lengths[column])
            left -= matrix[:, column] * (better - costs[column])
            costs[column] = better
    return costs
