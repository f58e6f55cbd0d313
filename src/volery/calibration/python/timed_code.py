"""Pieces of Python that can be run for their time, and counted for what they do.

Times are CPU time of the thread, which other programs do not add to; that they share caches and cores' upper
speed is why each piece is timed in rounds that go through all of them, and the median counts.
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
from volery.cost import StepCounter
from volery.cost.python_operations import OPERATIONS, STEPS_PER_NS

ShowRounds = Callable[[int, int, int], None]

_NO_STATEMENT = "pass"
_WORTH_TIMING: Ns = 2 * MS
_TIMES = 8
_DIGITS = 32
"""Bits for how often an operation is done: enough for any piece here."""


def no_progress(done: int, most: int, pieces: int) -> None:
    """Tells nobody."""


@dataclass
class TimedCode:
    """A piece of code. ``run`` does it once *times* times over; ``nanoseconds`` are of one time, by round."""

    name: str
    text: str
    load: Callable[[StepCounter | None], Callable[[int], object]]
    times: int = 1
    nanoseconds: list[float] = field(default_factory=list)

    @cached_property
    def _run(self) -> Callable[[int], object]:
        return self.load(None)

    def warm_up(self) -> None:
        """Find out how often it must be run to be worth timing."""
        while self._cpu() < _WORTH_TIMING:
            self.times *= 2

    def _cpu(self) -> Ns:
        run = self._run  # loads it the first time, which is not to be timed
        before = thread_time_ns()
        run(self.times)
        return thread_time_ns() - before

    def measure(self) -> None:
        """One more round."""
        self.nanoseconds.append(self._cpu() / self.times)

    @property
    def median(self) -> float:
        """Nanoseconds of one time."""
        return median(self.nanoseconds)

    @property
    def spread(self) -> float:
        """The middle half of the rounds, relative to the median."""
        low, _, high = quantiles(self.nanoseconds, n=4)
        return (high - low) / self.median

    @property
    def half_width(self) -> float:
        """Of the median's 95 % interval, relative: 1.57 quartile distances over the square root of n.

        McGill, Tukey and Larsen, *Variations of Box Plots*, The American Statistician 32(1), 1978.
        """
        return 1.57 * self.spread / math.sqrt(len(self.nanoseconds))

    def counted_ns(self, costs: Mapping[str, float]) -> float:
        """What one time takes by *costs* of operations."""
        return self._counted(StepCounter(costs)) / STEPS_PER_NS / _TIMES

    def counts(self) -> list[float]:
        """How often each operation is done in one time, in the order of ``OPERATIONS``.

        Each is counted in digits of its own of one great number.
        """
        steps = StepCounter({name: 1 << place * _DIGITS for place, name in enumerate(OPERATIONS)}, exact=True)
        left = self._counted(steps) // STEPS_PER_NS
        found = []
        for _ in OPERATIONS:
            found.append((left & (1 << _DIGITS) - 1) / _TIMES)
            left >>= _DIGITS
        return found

    def _counted(self, steps: StepCounter) -> int:
        """Steps of doing it ``_TIMES`` times."""
        run = self.load(steps)
        run(0)  # what happens however often it is run does not count
        steps.take()
        run(0)
        nothing = steps.take()
        run(_TIMES)
        return steps.take() - nothing


def timed_statements() -> list[TimedCode]:
    """The calibration's own statements; the first is none at all: what the others contain beside theirs."""
    return [_snippet(statement) for statement in (_NO_STATEMENT, *STATEMENTS)]


def _snippet(statement: str) -> TimedCode:
    text = PREAMBLE.replace("STATEMENT", statement.replace("\n", "\n        "))

    def load(steps: StepCounter | None) -> Callable[[int], object]:
        run: Callable[[int], object] = _module("snippet", text, steps).run
        return run

    return TimedCode(statement, text, load)


def timed_programs() -> list[TimedCode]:
    """The calibration's own programs."""
    folder = files("volery.calibration.python").joinpath("programs")
    found = sorted(
        (file.name, file.read_text(encoding="utf-8")) for file in folder.iterdir() if file.is_file()
    )
    return [timed_program(name.removesuffix(".py"), text) for name, text in found if name.endswith(".py")]


def timed_program(name: str, text: str, seed: int = 1) -> TimedCode:
    """A program with ``prepare(seed)``, which is not timed, and ``run(state)``, which is."""

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
    """How often pieces are timed: *least* times, then until each median is known to *within*, or *most*."""

    least: int = 9
    most: int = 31
    within: float = 0.03


DEFAULT_ROUNDS = Rounds()


def measure(
    pieces: Sequence[TimedCode], rounds: Rounds = DEFAULT_ROUNDS, tell: ShowRounds = no_progress
) -> None:
    """Time each of *pieces* once a round; in the end only those that are not known well enough.

    *tell* is told how many rounds are done, of how many, and how many pieces the next one is for.
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
            tell(done, rounds.most, len(left))
            for piece in left:
                piece.measure()


@contextmanager
def _no_collection() -> Iterator[None]:
    """Without the garbage collector, whose time would fall on whoever is running."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()
