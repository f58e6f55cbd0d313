"""Fit of the costs of Python's operations to measured times: ``volery cost calibrate python``.

Many statements are timed in a loop, each with a few operations, and the costs are found that explain all of
them. Then whole programs are timed. They take longer than the sum of their operations in loops, since a
processor predicts less of a program, by a factor that differs little from program to program. The costs
contain that factor; its spread is their error. Programs by which the costs are judged elsewhere take no part
in the fit.

The fit minimises the sum of rho(relative residual) over c >= 0, where rho is quadratic for small residuals
and linear for large ones, so that a few outliers do not distort it: iteratively reweighted least squares,
each by coordinate descent. scipy would be a dependency for this one function.
"""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import mean, median

import numpy as np
from numpy.typing import NDArray

from volery.calibration.timed_code import (
    DEFAULT_ROUNDS,
    Rounds,
    ShowRounds,
    TimedCode,
    measure,
    no_progress,
    timed_programs,
    timed_statements,
)
from volery.cost import OPERATIONS, CodeLaw, Figure, OperationTable, operation_table

Floats = NDArray[np.float64]

_ROUNDS = 25
_SWEEPS = 40
_SMALL = 0.03  # relative residuals below it count by their square


def fit_costs(counts: Floats, times: Floats, weights: Floats, floor: float) -> Floats:
    """Fit costs so that ``counts @ costs`` is near ``times``.

    Residuals are relative to the time, or to ``floor`` where that is greater. An operation that no
    measurement contains costs 0.

    Args:
        counts: Counts of operations, measurements x operations.
        times: Measured times.
        weights: Weights of the measurements.
        floor: Least time that residuals are related to.

    Returns:
        Costs by operation, in the unit of the times.
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
    """Minimise the squares of ``matrix @ c - wanted`` over c >= 0 by coordinate descent from ``start``."""
    costs = start.copy()
    lengths = (matrix * matrix).sum(axis=0)
    left = wanted - matrix @ costs
    for _ in range(_SWEEPS):
        for column in np.flatnonzero(lengths):
            better = max(0.0, costs[column] + matrix[:, column] @ left / lengths[column])
            left -= matrix[:, column] * (better - costs[column])
            costs[column] = better
    return costs


FLOOR_NS = 10.0
"""Errors of shorter statements are absolute, ns, since the time of the loop around them varies as much."""
LEAST_NS = 0.1


@dataclass(frozen=True)
class Calibration:
    """Result of a calibration; all errors are relative.

    Attributes:
        costs: Times of operations in programs, ns.
        in_context: Time of programs over the sum of their operations alone in loops.
        statements: Error of each statement, without the context.
        programs: Error of each program by the costs and the context that the others gave.
        loose: Pieces whose median is not known well enough, and half of its 95 % interval.
        slowdown: Time on this machine over the time by the table that comes with volery.
        slowdown_spread: Mean deviation of the programs' slowdowns.
        rounds: Rounds that every piece had at least.
    """

    costs: dict[str, float]
    in_context: float
    statements: dict[str, float]
    programs: dict[str, float]
    loose: Mapping[str, float]
    slowdown: float
    slowdown_spread: float
    rounds: int

    @property
    def program_error(self) -> float:
        """Mean absolute error of the programs."""
        return mean(abs(error) for error in self.programs.values())

    @property
    def pieces(self) -> int:
        """Number of pieces that were timed."""
        return len(self.statements) + len(self.programs) + 1

    def law(self, machine: str, frequency_mhz: float) -> CodeLaw:
        """Return the law of the measured processor, which ran at ``frequency_mhz``."""
        source = f"volery cost calibrate python: CPU time of {len(self.programs)} programs on {machine}"
        slowdown = Figure(
            value=round(self.slowdown, 3),
            error=round(self.slowdown_spread, 3),
            provenance="measured",
            source=f"median over the programs, of {self.rounds} rounds or more",
        )
        return CodeLaw(
            language="python",
            provenance="measured",
            source=source,
            validity=interpreter(),
            at_mhz=frequency_mhz,
            slowdown=slowdown,
        )

    def table(self, machine: str) -> OperationTable:
        """Return the table of operations for the package; ``machine`` names the computer."""
        errors = [abs(error) for error in self.programs.values()]
        return OperationTable(
            provenance="measured",
            source=f"volery cost calibrate python: CPU time of {len(self.statements)} statements and "
            f"{len(errors)} programs, medians of {self.rounds} rounds",
            validity=f"pure Python with warm caches, {interpreter()}",
            interpreter=interpreter(),
            machine=machine,
            in_context=round(self.in_context, 3),
            programs=len(errors),
            mean_error=round(mean(errors), 3),
            worst_error=round(max(errors), 3),
            nanoseconds={name: round(cost, 1) for name, cost in self.costs.items()},
        )


def calibrate(
    rounds: Rounds = DEFAULT_ROUNDS, show: ShowRounds = no_progress, beside: Sequence[TimedCode] = ()
) -> Calibration:
    """Time all statements and programs and fit the costs.

    Args:
        rounds: How many rounds.
        show: See ``timed_code.measure``.
        beside: Pieces that are timed in the same rounds and do not take part in the fit.
    """
    statements, whole = timed_statements(), timed_programs()
    measure([*statements, *whole, *beside], rounds, show)
    return evaluate(statements, whole, rounds)


def evaluate(statements: Sequence[TimedCode], whole: Sequence[TimedCode], rounds: Rounds) -> Calibration:
    """Fit the costs to pieces that have been timed.

    Args:
        statements: Timed statements; the first is the empty one, whose time the others contain.
        whole: Timed programs: they give the factor between programs and loops, and the error.
        rounds: The precision by which pieces count as uncertain.
    """
    empty, counts = statements[0], np.array([statement.counts() for statement in statements])
    counts = counts[1:] - counts[0]
    times = np.array([statement.median for statement in statements[1:]]) - empty.median
    alone = np.maximum(fit_costs(counts, times, np.ones(len(times)), FLOOR_NS), LEAST_NS)
    ratios = [
        one.median / float(np.dot(done, alone))
        for one, done in zip(whole, [one.counts() for one in whole], strict=True)
    ]
    context = median(ratios)
    shipped = [_shipped_ratio(one) for one in whole]
    residuals = (counts @ alone - times) / np.maximum(times, FLOOR_NS)
    return Calibration(
        costs=dict(zip(OPERATIONS, (alone * context).tolist(), strict=True)),
        in_context=context,
        statements={one.name: float(left) for one, left in zip(statements[1:], residuals, strict=True)},
        programs=_without_itself([one.name for one in whole], ratios),
        loose={one.name: one.half_width for one in [*statements, *whole] if one.half_width > rounds.within},
        slowdown=median(shipped),
        slowdown_spread=mean(abs(one / median(shipped) - 1.0) for one in shipped),
        rounds=rounds.least,
    )


def _without_itself(names: Sequence[str], ratios: Sequence[float]) -> dict[str, float]:
    """Return the error of each program by the context that the others gave (leave-one-out)."""
    errors = {}
    for index, name in enumerate(names):
        others = [*ratios[:index], *ratios[index + 1 :]]
        errors[name] = median(others) / ratios[index] - 1.0
    return errors


def _shipped_ratio(one: TimedCode) -> float:
    return one.median / one.counted_ns(operation_table().nanoseconds)


def interpreter() -> str:
    """Return the name and version of the interpreter, such as ``CPython 3.11``."""
    return f"{platform.python_implementation()} {'.'.join(platform.python_version_tuple()[:2])}"
