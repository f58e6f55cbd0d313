"""Pieces of Python code that are timed, and counted for their operations.

Times are CPU time of the thread, to which other programs do not add. They do share caches and the cores'
frequency; so the pieces are timed in rounds over all of them, and the median counts.
"""

from __future__ import annotations

import ast
import gc
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from importlib.resources import files
from statistics import median, quantiles
from time import thread_time_ns
from types import ModuleType

from volery.base.time import MS, Ns
from volery.calibration.python.statements import PREAMBLE, STATEMENTS
from volery.cost import OPERATIONS, STEPS_PER_NS, StepCounter

ShowRounds = Callable[[int, int, int], None]

_NO_STATEMENT = "pass"
_WORTH_TIMING: Ns = 2 * MS
_TIMES = 8
_DIGITS = 32
"""Bits for the count of an operation: enough for any piece here."""


def no_progress(done: int, most: int, pieces: int) -> None:
    """Report nothing."""


@dataclass
class TimedCode:
    """A piece of code.

    Attributes:
        name: Its name.
        text: Its source.
        load: Returns a function that executes it a number of times, instrumented if a counter is given.
        times: Executions in a measurement.
        nanoseconds: Time of one execution by round, ns.
    """

    name: str
    text: str
    load: Callable[[StepCounter | None], Callable[[int], object]]
    times: int = 1
    nanoseconds: list[float] = field(default_factory=list)

    @cached_property
    def _run(self) -> Callable[[int], object]:
        return self.load(None)

    def warm_up(self) -> None:
        """Double the executions of a measurement until it is long enough."""
        while self._cpu() < _WORTH_TIMING:
            self.times *= 2

    def _cpu(self) -> Ns:
        run = self._run  # loaded at the first access, which is not timed
        before = thread_time_ns()
        run(self.times)
        return thread_time_ns() - before

    def measure(self) -> None:
        """Add a round."""
        self.nanoseconds.append(self._cpu() / self.times)

    @property
    def median(self) -> float:
        """Median time of one execution, ns."""
        return median(self.nanoseconds)

    @property
    def spread(self) -> float:
        """Inter-quartile range of the rounds, relative to the median."""
        low, _, high = quantiles(self.nanoseconds, n=4)
        return (high - low) / self.median

    @property
    def half_width(self) -> float:
        """Half of the median's 95 % interval, relative: 1.57 inter-quartile ranges over the square root of n.

        McGill, Tukey and Larsen, *Variations of Box Plots*, The American Statistician 32(1), 1978.
        """
        return 1.57 * self.spread / math.sqrt(len(self.nanoseconds))

    def counted_ns(self, costs: Mapping[str, float]) -> float:
        """Return the time of one execution by ``costs`` of operations, ns."""
        return self._counted(StepCounter(costs)) / STEPS_PER_NS / _TIMES

    def counts(self) -> list[float]:
        """Return the count of each operation in one execution, in the order of ``OPERATIONS``.

        Each is counted in its own digits of one large number.
        """
        steps = StepCounter({name: 1 << place * _DIGITS for place, name in enumerate(OPERATIONS)}, exact=True)
        left = self._counted(steps) // STEPS_PER_NS
        found = []
        for _ in OPERATIONS:
            found.append((left & (1 << _DIGITS) - 1) / _TIMES)
            left >>= _DIGITS
        return found

    def _counted(self, steps: StepCounter) -> int:
        """Return the steps of ``_TIMES`` executions."""
        run = self.load(steps)
        run(0)  # the part outside the executions does not count
        steps.take()
        run(0)
        nothing = steps.take()
        run(_TIMES)
        return steps.take() - nothing


def timed_statements() -> list[TimedCode]:
    """Return the statements of the calibration; the first is empty, which is the part of all others too."""
    return [_snippet(statement) for statement in (_NO_STATEMENT, *STATEMENTS)]


def _snippet(statement: str) -> TimedCode:
    text = PREAMBLE.replace("STATEMENT", statement.replace("\n", "\n        "))

    def load(steps: StepCounter | None) -> Callable[[int], object]:
        run: Callable[[int], object] = _module("snippet", text, steps).run
        return run

    return TimedCode(statement, text, load)


def timed_programs() -> list[TimedCode]:
    """Return the programs of the calibration."""
    folder = files("volery.calibration.python").joinpath("programs")
    found = sorted(
        (file.name, file.read_text(encoding="utf-8")) for file in folder.iterdir() if file.is_file()
    )
    return [timed_program(name.removesuffix(".py"), text) for name, text in found if name.endswith(".py")]


def timed_program(name: str, text: str, seed: int = 1) -> TimedCode:
    """Return a program whose ``run(state)`` is timed and whose ``prepare(seed)`` is not."""

    def load(steps: StepCounter | None) -> Callable[[int], object]:
        module = _module(name, text, steps)
        state = module.prepare(seed)

        def run(times: int) -> None:
            for _ in range(times):
                module.run(state)

        return run

    return TimedCode(name, text, load)


def _module(name: str, text: str, steps: StepCounter | None) -> ModuleType:
    tree = ast.parse(text)
    full_name = f"volery.calibrated.{name}"
    module = sys.modules[full_name] = ModuleType(full_name)  # dataclasses look their module up there
    if steps:
        tree = steps.instrument(tree)
        vars(module).update(steps.names())
    exec(compile(tree, name, "exec"), vars(module))
    return module


@dataclass(frozen=True)
class Rounds:
    """Number of rounds: ``least`` for all, then until each median is known to ``within``, or ``most``."""

    least: int = 9
    most: int = 31
    within: float = 0.03


DEFAULT_ROUNDS = Rounds()


def measure(
    pieces: Sequence[TimedCode], rounds: Rounds = DEFAULT_ROUNDS, show: ShowRounds = no_progress
) -> None:
    """Time each piece once a round; after ``rounds.least`` rounds only those that are not known well enough.

    Args:
        pieces: The pieces, whose ``nanoseconds`` grow.
        rounds: How many rounds.
        show: Called before each round with the completed rounds, the most rounds and the pieces of the round.
    """
    with _no_collection():
        for piece in pieces:
            piece.warm_up()
        left = list(pieces)
        for done in range(rounds.most):
            if done >= rounds.least:
                left = [piece for piece in left if piece.half_width > rounds.within]
            if not left:
                break
            show(done, rounds.most, len(left))
            for piece in left:
                piece.measure()


@contextmanager
def _no_collection() -> Iterator[None]:
    """Disable the garbage collector, whose time would be charged to the running piece."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()
