"""Pieces of Python code that are timed, and counted for their operations.

Statements are run in a loop within a function after ``PREAMBLE``. Every operation occurs in several of them
together with different others, so that a fit can separate their costs. Programs are timed as a whole.

Times are CPU time of the thread, to which other programs do not add. They do share caches and the cores'
frequency; so the pieces are timed in rounds over all of them, and the median counts.
"""

from __future__ import annotations

import ast
import gc
import math
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from importlib.resources import files
from statistics import median, quantiles
from time import thread_time_ns
from types import ModuleType

from volery.base.errors import UsageError
from volery.base.time import MS, Ns
from volery.cost import OPERATIONS, STEPS_PER_NS, LibraryTable, StepCounter

PREAMBLE = """
from math import sin, hypot, sqrt, atan2
from collections import deque
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import NamedTuple
class Pair(NamedTuple):
    x: float
    y: float
class Triple(NamedTuple):
    x: float
    y: float
    z: float = 0.0
@dataclass
class Open:
    x: float
    y: float
@dataclass
class Wide:
    x: float
    y: float
    z: float
    name: str = ""
@dataclass(frozen=True)
class Shut:
    x: float
    y: float
@dataclass(frozen=True)
class Sealed:
    x: float
    y: float
    z: float
    name: str = ""
class Plain:
    v = 1
    def __init__(self, a=0):
        self.a = a
        self.b = a
    def nothing(self):
        pass
    def give(self):
        return self.a
    def add(self, other):
        return self.a + other
class Bare:
    pass
def nothing():
    pass
def give(a):
    return a
def three(a, b, c):
    return c
def named(a, key=0):
    return key
def mixed(a, b, limit):
    total = a * b + 1.5
    if total > limit:
        total = limit
    elif total < -limit:
        total = -limit
    return total
def values(n):
    for k in range(n):
        yield k
def fail():
    raise ValueError("no")
class Context:
    def __enter__(self):
        return self
    def __exit__(self, *about):
        return False
def run(n):
    a = 3; b = 4; c = 0; x = 1.25; y = -2.5; z = 0.5; t = True; o = None
    l = [1, 2, 3, 4, 5, 6, 7, 8]; m = [0.5] * 60; w = [3, 1, 2, 9, 7, 8, 4] * 8
    d = {"a": 1, "b": 2}; s = {1, 2, 3}; p = (1.0, 2.0, 3.0); q = deque(l)
    g = [[1.0, 2.0], [3.0, 4.0]]; text = "abcdef"; line = "1,2,3"; words = "one two three four"
    texts = words.split(); e_ = [0] * 20; v_ = dict.fromkeys(range(40)); u = Plain(2); e = Bare()
    r = Pair(x, y); heap = [(k * 0.5, k) for k in range(40)]
    for _ in range(n):
        STATEMENT
"""

STATEMENTS = (
    # names, arithmetic
    "c = a", "c = 5", "c = a; a = b; b = c", "c = d = a",
    "c = a + b", "c = x * y", "c = x + y * z - x", "c = a * b - a", "c = a & b", "c = (a << 2) ^ b",
    "c = x / y", "c = a // 2", "c = a % 7", "c = x / y + z / x", "c = x ** 2", "c = a ** 3 + b ** 2",
    "c = -x", "c = -a + -b", "c += 1", "x = x * 0.5 + y", "a += b; a -= b",
    # comparisons and branches
    "c = a < b", "c = x >= y", "c = 0 <= a < b", "c = a in l", "c = a in s", 'c = "a" in d', "c = b not in d",
    "c = a is None", "c = o is not None",
    "if a: pass", "if a < b: c = a", "if a > b: c = a\nelse: c = b", "if not t: c = 1",
    "c = a and b", "c = o or b", "c = x if t else y", "if a < b and x > y: c = a", "if a == b or a == 3: c = 1",
    # attributes, subscripts, unpacking
    "c = u.a", "c = u.a + u.b", "c = u.v", "u.a = a", "u.a += 1", "u.a = u.b", "e.k = a",
    "c = l[1]", "c = l[a]", 'c = d["a"]', "c = g[1][0]", "l[2] = a", 'd["a"] = b', "l[a] += 1", "g[0][1] = x",
    "c = p[0] * p[1]", "c = l[1:4]", "c = text[2:]", "c = l[:]", "c = text[1]",
    "i, j = a, b", "i, j, k = p", "(i, j), k = g[0], a",
    # displays
    "c = (a, b)", "c = a, b, x", "c = (x, (a, b))", "c = [a, b]", "c = []", "c = [x, y, z, a]", "c = {a, b}",
    "c = {}", 'c = {"a": a}', 'c = {"a": a, "b": b, "c": x}', "c = [*l, a]", "c = (*p, x)",
    # calls
    "nothing()", "c = give(a)", "c = three(a, b, x)", "c = named(a, key=b)", "c = give(give(a))", "c = three(*p)",
    "u.nothing()", "c = u.give()", "c = u.add(b)", "c = mixed(x, y, z)", "c = mixed(a, b, 4.0)",
    "c = Plain(a)", "c = Bare()", "c = Plain()",
    "c = sin(x)", "c = hypot(x, y)", "c = sin(x) * y + sin(z)",
    # builtins
    "c = Pair(x, y)", "c = Triple(x, y, z)", "c = Open(x, y)", "c = Wide(x, y, z)", "c = Shut(x, y)", "c = Sealed(x, y, z)",
    "c = r.x", "c = r.x * r.x + r.y * r.y", "c = sqrt(x)", "c = atan2(x, y)",
    "heappush(heap, (x, a)); heappop(heap)", "heappush(heap, (z, b)); heappush(heap, (y, a)); heappop(heap); heappop(heap)",
    "c = len(l)", "c = len(d) + len(l)", "c = abs(x)", "c = abs(a - b)", "c = isinstance(a, int)", "c = ord('a')",
    "c = chr(a)", "c = int(x)", "c = int('12')", "c = int(x * b)", "c = float(a)", "c = float('1.5')", "c = str(a)",
    "c = str(x)", "c = round(x)", "c = round(x, 1)", "c = repr(x)", "c = bool(a)", "c = type(x)", "c = getattr(u, 'a')",
    "c = min(a, b)", "c = min(x, y)", "c = max(x, 0.0)", "c = max(-z, min(z, x))", "c = range(a)", "c = range(a, b)",
    "c = enumerate(l)", "c = zip(l, m)", "c = reversed(l)", "c = next(iter(l))", "c = next(iter(d), a)",
    "c = list()", "c = dict()", "c = set()", "c = super(Plain, u)", "c = bytes(l)", "c = bytearray(l)",
    "c = sum(m)", "c = sum(l)", "c = sum(p)", "c = max(m)", "c = max(l)", "c = max(w)", "c = min(w)", "c = min(p)",
    "c = list(m)", "c = list(l)", "c = tuple(l)", "c = tuple(m)", "c = set(l)", "c = set(w)", "c = set(m)",
    "c = any(e_)", "c = any(e_ + e_)", "c = all(m)", "c = all(l)", "c = dict(d)", "c = dict(v_)", "c = bytes(w)",
    "c = bytearray(w)", "c = sorted(l)", "c = sorted(w)", "c = sorted(m)", "c = sorted(p)", "c = sorted(s)",
    # methods of Python's types
    "l.append(a); l.pop()", "l.append(a); l.append(b); l.pop(); l.pop()", "h = []; h.append(a); h.append(b); h.append(c)",
    "s.add(a)", "s.add(a); s.discard(b)", "q.append(a); q.popleft()", 'c = d.get("a", 0)', 'c = d.get("z")',
    "for k in d.items(): pass", "c = d.items()", "c = d.values()", "c = d.keys()", "c = d.setdefault('a', 1)",
    "c = line.split(',')", "c = words.split()", "c = text.startswith('a')", "c = text.endswith('a')",
    "c = line.partition(',')", "c = text.index('c')", "c = l.index(4)", "c = text.isdigit()", "c = text.strip()",
    "c = ','.join(text)", "c = ' '.join(texts)", "h = []; h.extend(l)", "h = []; h.extend(m)", "h = [a, b]; h.insert(0, c)",
    "h = [a, b]; h.remove(a)", "h = {}; h.update(d)", "h = set(); h.update(w)",
    # loops and comprehensions
    "for k in l: pass", "for k in l: c = k", "for k in range(10): c += k", "for i, k in enumerate(l): c = k",
    "for i, k in zip(l, l): c = i", "for k in m: x = k * 0.5 + z",
    "for row in g:\n    for k in row: c = k", "c = 5\nwhile c > 0: c -= 1", "c = 0\nwhile c < 8:\n    if l[c] > 6: break\n    c += 1",
    "c = [k for k in l]", "c = [k * 2 for k in l]", "c = [k for k in m]", "c = [k for k in l if k > 3]", "c = {k: k for k in l}",
    "c = [i * j for i, j in zip(l, l)]", "c = [i + j for i in p for j in p]", "c = {k for k in l}",
    "c = sum(k for k in l)", "c = sum(k * k for k in m)", "c = any(k > 100 for k in l)",
    "for k in values(8): pass", "for k in values(20): c = k",
    # text
    "c = f'{a}'", "c = f'{a},{x:.2f}'", "c = f'{text} and {line}'", "c = '%d' % a",
    # functions, contexts, exceptions
    "c = lambda: 0", "c = (lambda v: v + 1)(a)", "def inner(v): return v", "def inner(v=a): return v\ninner(b)",
    "with Context(): pass", "with Context() as k: c = a",
    "try: c = a\nexcept ValueError: pass", "try: fail()\nexcept ValueError: c = 1",
    "try: raise KeyError(a)\nexcept KeyError as error: c = 2", "try: c = d['zz']\nexcept KeyError: c = 1",
    "try: int('slow')\nexcept ValueError: c = 1", "try: c = float(text)\nexcept ValueError: c = 0",
    "try: c = u.zz\nexcept AttributeError: c = 1", "try: fail()\nexcept (KeyError, ValueError) as error: c = str(error)",
    "import math", "from math import pi", "class Inner: pass", "class Inner:\n    def f(self): pass",
    # several things at once, as programs have them
    "x1 = x * x + y * y; x2 = x1 / (z + 1.0); c = x2 if x2 > 0.5 else 0.5",
    "error = x - u.a; u.b = u.b + error * 0.02; c = 1.5 * error + 0.3 * u.b",
    "best = 1e9\nfor k in m:\n    gap = k - x\n    if gap < 0.0: gap = -gap\n    if gap < best: best = gap",
    "c = 0\nfor k in w:\n    if k & 1: c ^= (k << 2) & 255\n    else: c = (c >> 1) + k",
    "seen = {}\nfor k in w: seen[k] = seen.get(k, 0) + 1",
    "rows = []\nfor row in g:\n    rows.append([k * z for k in row])",
    "things = []\nfor k in l:\n    if k in s or k > 6: things.append((k, a))",
    "here = (a, b); there = here[0] + 1, here[1] - 1; c = abs(there[0]) + abs(there[1])",
    "u.a = max(-z, min(z, u.b * 0.5)); c = u.add(x)",
    "parts = line.split(',')\nc = int(parts[0]) + int(parts[1])",
    "h = {}\nfor k in text: h[k] = len(h)",
    "c = 0\nfor k in l: c += give(k) * 2",
)  # fmt: skip
"""The statements, grouped by the operations that they are meant for."""


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
        """Execute once, then double the executions of a measurement until it is long enough."""
        self._cpu()
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

    def counted_ns(self, costs: Mapping[str, float], libraries: LibraryTable | None = None) -> float:
        """Return the time of one execution by ``costs`` of operations, and of library calls, ns."""
        return self._counted(StepCounter(costs, libraries=libraries)) / STEPS_PER_NS / _TIMES

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
    text = files("volery.calibration").joinpath("timed_programs.py").read_text(encoding="utf-8")
    _, *parts = re.split(r"^# === (\w+) ===\n", text, flags=re.MULTILINE)
    return [timed_program(name, part) for name, part in zip(parts[::2], parts[1::2], strict=True)]


def timed_program(name: str, text: str, seed: int = 1) -> TimedCode:
    """Return a program whose ``run(state)`` is timed and whose ``prepare(seed)`` is not.

    Args:
        name: Name of the program.
        text: Its source: a module with both functions.
        seed: Argument of ``prepare``, which gives the state.
    """

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

    def __post_init__(self) -> None:
        if not 2 <= self.least <= self.most:
            raise UsageError(f"rounds {self.least} {self.most}: give two numbers from 2, the lower one first")


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
