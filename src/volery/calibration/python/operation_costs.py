"""Costs that explain measured times: none is negative, and a few odd measurements do not bend the rest.

Minimises sum of rho(relative residual) over c >= 0, rho growing like the square for small residuals and like
the absolute value for large ones: iteratively reweighted least squares, each by coordinate descent.

``volery calibrate python``: what Python's operations take on the machine at hand.

Many statements are timed in a loop, each with a few operations in it, and the costs are found that explain
all of them (``nonnegative``). Then whole programs are timed: they take longer than the sum of their
operations in loops, since a processor foresees less of a program, by a factor that differs little from
program to program. That factor goes into the costs, and its spread is their error. No program that the costs
are judged by elsewhere takes part in this.
"""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import mean, median

import numpy as np
from numpy.typing import NDArray

from volery.calibration.python.timed_code import (
    DEFAULT_ROUNDS,
    Rounds,
    ShowRounds,
    TimedCode,
    measure,
    no_progress,
    timed_programs,
    timed_statements,
)
from volery.cost.code_laws import CodeLaw
from volery.cost.figures import Figure
from volery.cost.python_operations import OPERATIONS, OperationTable, operation_table

Floats = NDArray[np.float64]

_ROUNDS = 25
_SWEEPS = 40
_SMALL = 0.03  # a relative residual below it counts by its square


def fit_costs(counts: Floats, times: Floats, weights: Floats, floor: float) -> Floats:
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


FLOOR_NS = 10.0
"""Statements below it are judged by nanoseconds, not by percent: that much does the loop around vary."""
LEAST_NS = 0.1


@dataclass(frozen=True)
class Calibration:
    """What came out. ``costs`` are nanoseconds by operation, in context; errors are relative."""

    costs: dict[str, float]
    in_context: float
    statements: dict[str, float]
    """Error of each statement, without the context."""
    programs: dict[str, float]
    """Error of each program by the costs and the context that the others gave."""
    loose: Mapping[str, float]
    """Pieces whose medians are not known as well as was asked for, and how well they are: the half of the
    95 % interval."""
    slowdown: float
    """Times as long as by the table that comes with volery: this machine against the one it was made on."""
    slowdown_spread: float
    rounds: int
    """That every piece had at least."""

    @property
    def program_error(self) -> float:
        """The mean size of the errors of programs."""
        return mean(abs(error) for error in self.programs.values())

    @property
    def pieces(self) -> int:
        """How many were timed."""
        return len(self.statements) + len(self.programs) + 1

    def law(self, machine: str, frequency_mhz: float) -> CodeLaw:
        """The law of the processor that was measured, which ran at *frequency_mhz*."""
        source = f"volery calibrate python: CPU time of {len(self.programs)} programs on {machine}"
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
        """As the package keeps it; *machine* is what it was measured on."""
        errors = [abs(error) for error in self.programs.values()]
        return OperationTable(
            provenance="measured",
            source=f"volery calibrate python: CPU time of {len(self.statements)} statements and "
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
    rounds: Rounds = DEFAULT_ROUNDS, tell: ShowRounds = no_progress, beside: Sequence[TimedCode] = ()
) -> Calibration:
    """Time everything and find the costs; *tell* as in ``pieces.measure``.

    *beside* are pieces to be timed in the same rounds, which the costs do not know of.
    """
    statements, whole = timed_statements(), timed_programs()
    measure([*statements, *whole, *beside], rounds, tell)
    return evaluate(statements, whole, rounds)


def evaluate(statements: Sequence[TimedCode], whole: Sequence[TimedCode], rounds: Rounds) -> Calibration:
    """The costs from pieces that have been timed; the first statement is the empty one."""
    empty, counts = statements[0], np.array([one.counts() for one in statements])
    counts = counts[1:] - counts[0]
    times = np.array([one.median for one in statements[1:]]) - empty.median
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
    """The error of each program by the context that the others gave."""
    errors = {}
    for index, name in enumerate(names):
        others = [*ratios[:index], *ratios[index + 1 :]]
        errors[name] = median(others) / ratios[index] - 1.0
    return errors


def _shipped_ratio(one: TimedCode) -> float:
    return one.median / one.counted_ns(operation_table().nanoseconds)


def interpreter() -> str:
    """``CPython 3.11``."""
    return f"{platform.python_implementation()} {'.'.join(platform.python_version_tuple()[:2])}"
