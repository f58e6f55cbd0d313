"""Measurement of the times of library calls: the points of ``cost/libraries.json``.

Each call is timed alone in a loop, at several sizes, in CPU time of the thread; the least of several batches
counts, because other programs only add to it. Within a program the data and the code of numpy's calls are
colder: the points contain the factor between small programs and the sum of their calls in loops. Programs by
which the table is judged take no part in it.
"""

from __future__ import annotations

import hashlib
import json
import pickle
import re
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from statistics import median
from time import thread_time_ns
from typing import NamedTuple

import numpy as np

from volery.calibration.timed_code import (
    Rounds,
    TimedCode,
    measure,
    timed_program,
    timed_programs,
)
from volery.cost import LibraryCall, LibraryTable, call_size, operation_table

BATCH_NS = 4_000_000
BATCHES = 7
SIDES = (1, 4, 16, 64, 256, 1024)
"""Square roots of the elements of the arrays that are timed."""
SMALL_SIDES = (2, 4, 8, 16, 64, 128)
"""Sides of the matrices of linear algebra."""
LENGTHS = (16, 256, 4096, 65536)
BY_ITEMS = frozenset((
    "sum", "mean", "std", "var", "cumsum", "array", "tolist", "nonzero", "take", "exp", "sin", "cos",
    "interp", "polyfit", "polyval", "median", "argsort", "random", "normal", "uniform", "integers", "hypot",
    "arctan2", "power", "diff", "unique",
))  # fmt: skip
"""Functions of numpy that take their time by elements whatever the type: they work on one at a time."""


class Snippet(NamedTuple):
    """A call to be timed: entry of the table, meaning of its size, function and arguments."""

    name: str
    size: str
    function: Callable[..., object]
    arguments: tuple[object, ...]

    def nanoseconds(self) -> float:
        """Return the time of one call on this machine."""
        function, arguments = self.function, self.arguments
        times, most = 1, 0
        while most < BATCH_NS // 4:
            times *= 4
            most = _batch(function, arguments, times)
        return min(_batch(function, arguments, times) for _ in range(BATCHES)) / times

    def measured_size(self) -> int:
        """Return the size of the call."""
        return max(1, round(call_size(self.size, self.arguments, self.function(*self.arguments))))


def _batch(function: Callable[..., object], arguments: tuple[object, ...], times: int) -> int:
    began = thread_time_ns()
    for _ in range(times):
        function(*arguments)
    return thread_time_ns() - began


def _key(function: Callable[..., object]) -> str:
    return f"numpy.{function.__name__}"


def _of_shape(draw: Callable[..., object], shape: tuple[int, ...]) -> Callable[..., object]:
    return lambda *given: draw(*given, size=shape)


_UNARY = (
    "sqrt", "exp", "sin", "cos", "abs", "floor", "isnan", "isfinite", "mean", "max", "min", "std",
    "var", "argmax", "argmin", "any", "all", "cumsum", "copy", "asarray",
    "diff", "count_nonzero", "zeros_like", "ravel",
)  # fmt: skip
_BINARY = ("add", "subtract", "multiply", "divide", "maximum", "minimum", "hypot", "arctan2", "power")
_LINEAR = ("inv", "solve", "det", "norm", "eig", "svd")


def snippets() -> Iterator[Snippet]:
    """Yield all calls that are timed."""
    generator = np.random.default_rng(1)
    for one in _arrays(generator):
        yield one._replace(size="items") if one.name.removeprefix("numpy.") in BY_ITEMS else one
    yield from _linear_algebra(generator)
    yield from _texts()


def _arrays(generator: np.random.Generator) -> Iterator[Snippet]:
    for side in SIDES:
        row = generator.random(side * side)
        fitted = (np.linspace(-1.0, 1.0, max(row.size, 5)), np.resize(row, max(row.size, 5)))
        yield Snippet("numpy.interp", "elements", np.interp, (row, *fitted))
        yield Snippet("numpy.polyfit", "elements", np.polyfit, (*fitted, 3))
        yield Snippet("numpy.polyval", "elements", np.polyval, ((0.1, 0.2, 0.3, 0.4), row))
        yield Snippet("numpy.rfft", "elements", np.fft.rfft, (row,))
        yield Snippet("numpy.fft", "elements", np.fft.fft, (row,))
        for name in ("column_stack", "stack", "vstack", "hstack"):
            yield Snippet(f"numpy.{name}", "elements", getattr(np, name), ([row, row],))
        for name in ("sort", "argsort", "median"):
            yield Snippet(f"numpy.{name}", "elements", getattr(np, name), (row,))
        yield Snippet("numpy.nonzero", "elements", np.nonzero, (row > 0.99,))
        numbers = generator.integers(0, 20 * row.size, row.size)
        yield Snippet("numpy.unique", "elements", lambda a: np.unique(a, return_index=True), (numbers,))
        triples = generator.random((side * side // 3 + 1, 3))
        yield Snippet("numpy.sum", "elements", lambda a: a.sum(axis=1), (triples,))
        array = generator.random((side, side)) + 0.5
        other = generator.random((side, side)) + 0.5
        for name in _UNARY:
            yield Snippet(_key(getattr(np, name)), "elements", getattr(np, name), (array,))
        for name in _BINARY:
            yield Snippet(_key(getattr(np, name)), "elements", getattr(np, name), (array, other))
        yield Snippet("numpy.operator", "elements", lambda a, b: a * b, (array, other))
        yield Snippet("numpy.remainder", "elements", lambda a, b: a % b, (array, other))
        yield Snippet("numpy.where", "elements", np.where, (array > 1.0, array, other))
        yield Snippet("numpy.clip", "elements", np.clip, (array, 0.2, 0.8))
        yield Snippet("numpy.concatenate", "elements", lambda a: np.concatenate((a, a)), (array,))
        yield Snippet("numpy.zeros", "elements", np.zeros, (array.shape,))
        yield Snippet("numpy.ones", "elements", np.ones, (array.shape,))
        yield Snippet("numpy.subscript", "elements", lambda a: a[a.shape[0] // 2 :, :], (array,))
        yield Snippet("numpy.roll", "elements", lambda a: np.roll(a, 1, 0), (array,))
        yield Snippet("numpy.astype", "elements", lambda a: a.astype(np.uint8), (array,))
        yield Snippet("numpy.tolist", "elements", lambda a: a.tolist(), (array,))
        yield Snippet(
            "numpy.gradient", "elements", np.gradient, (generator.random((max(side, 2), max(side, 2))),)
        )
        for name in ("random", "normal", "uniform", "integers"):
            given = {"random": (), "normal": (0.0, 1.0), "uniform": (0.0, 1.0), "integers": (0, 9)}[name]
            draw = getattr(generator, name)
            yield Snippet(f"numpy.{name}", "elements", _of_shape(draw, array.shape), given)
        yield Snippet("numpy.take", "elements", lambda a, b: a[b], (array, array > 1.0))
        yield Snippet("numpy.*", "elements", np.clip, (array, 0.2, 0.8))
    for side in (1, 8, 64):
        vectors = generator.random((side * side, 3))
        yield Snippet("numpy.cross", "elements", np.cross, (vectors, vectors))
        nested = vectors.tolist()
        yield Snippet("numpy.array", "elements", np.array, (nested,))
    yield Snippet("numpy.default_rng", "elements", np.random.default_rng, (1,))
    yield Snippet("numpy.scalar", "elements", lambda a, b: a * b, (np.float64(1.5), np.float64(2.5)))


def _linear_algebra(generator: np.random.Generator) -> Iterator[Snippet]:
    for side in SMALL_SIDES:
        matrix = generator.random((side, side)) + np.eye(side) * side
        for name in ("matmul", "dot"):
            yield Snippet(f"numpy.{name}", "products", getattr(np, name), (matrix, matrix))
        for name in _LINEAR:
            function = getattr(np.linalg, name)
            given = (matrix, matrix[0]) if name == "solve" else (matrix,)
            yield Snippet(f"numpy.{name}", "cube", function, given)
        tall = generator.random((8 * side, side))
        yield Snippet("numpy.lstsq", "elements", np.linalg.lstsq, (tall, tall[:, 0]))
        yield Snippet("numpy.eye", "elements", np.eye, (side,))
        yield Snippet("numpy.outer", "elements", np.outer, (matrix[0], matrix[0]))


def _texts() -> Iterator[Snippet]:
    for length in LENGTHS:
        rows = [
            {"id": number, "x": number * 1.5, "name": f"drone_{number}"} for number in range(length // 44 + 1)
        ]
        text = json.dumps(rows)
        words = ("alpha 12.5 beta; " * (length // 17 + 1))[:length]
        data = words.encode()
        yield Snippet("json.dumps", "text", json.dumps, (rows,))
        yield Snippet("json.loads", "text", json.loads, (text,))
        for name in ("findall", "sub", "split", "match", "search", "fullmatch"):
            pattern = re.compile(r"(\w+) ([0-9.]+)")
            texts = ("-", words) if name == "sub" else (words,)
            yield Snippet(f"re.{name}", "text", getattr(pattern, name), texts)
        hit = pattern.match("alpha 12.5")
        assert hit is not None
        yield Snippet("re.groups", "text", hit.groups, ())
        yield Snippet("re.group", "text", hit.group, (1,))
        packed = zlib.compress(text.encode())
        yield Snippet("zlib.compress", "packed", zlib.compress, (text.encode(),))
        yield Snippet("zlib.decompress", "packed", zlib.decompress, (packed,))
        yield Snippet("zlib.crc32", "text", zlib.crc32, (data,))
        yield Snippet("hashlib.*", "text", lambda d: hashlib.sha256(d).digest(), (data,))
        yield Snippet("pickle.dumps", "text", pickle.dumps, (rows,))
        yield Snippet("pickle.loads", "text", pickle.loads, (pickle.dumps(rows),))
    for fields in (1, 4, 16, 64):
        record = struct.Struct(f"<{fields}d")
        values = tuple(range(fields))
        yield Snippet("struct.pack", "fields", record.pack, values)
        yield Snippet("struct.unpack", "fields", record.unpack, (record.pack(*values),))
        yield Snippet("struct.unpack_from", "fields", record.unpack_from, (record.pack(*values), 0))
    for length in LENGTHS:
        rows_of_8 = bytes(length // 64 * 64 + 64)
        yield Snippet(
            "struct.iter_unpack", "text", lambda b: list(struct.iter_unpack("<8d", b)), (rows_of_8,)
        )
    yield Snippet("struct.*", "fields", struct.calcsize, ("<8d",))
    yield Snippet("json.*", "text", json.dumps, ([1],))
    yield Snippet("re.*", "text", re.compile, ("a",))
    yield Snippet("pickle.*", "text", pickle.dumps, (1,))
    yield Snippet("zlib.*", "text", zlib.adler32, (b"abc",))


CONTEXT_PROGRAMS = {
    "attitude filter": """
import numpy as np
def prepare(seed):
    return np.random.default_rng(seed).random((200, 3))
def run(rates):
    attitude, bias, down = np.eye(3), np.zeros(3), np.array([0.0, 0.0, 1.0])
    for rate in rates:
        x, y, z = (rate - bias) * 0.01
        turn = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        attitude = attitude @ (np.eye(3) + turn + turn @ turn * 0.5)
        error = attitude.T @ down
        bias = bias + 0.001 * np.array([error[1], -error[0], 0.0])
        attitude = attitude / np.linalg.norm(attitude[0])
    return attitude
""",
    "height map": """
import numpy as np
def prepare(seed):
    return np.random.default_rng(seed).random((160, 160))
def run(heights):
    slopes = np.hypot(heights[1:, :-1] - heights[:-1, :-1], heights[:-1, 1:] - heights[:-1, :-1])
    smooth = (slopes[1:, 1:] + slopes[:-1, :-1] + slopes[1:, :-1] + slopes[:-1, 1:]) * 0.25
    flat = smooth < smooth.mean()
    level = np.where(flat, smooth, smooth.max())
    best = np.argmin(level.ravel())
    return int(best) + level.sum() + np.sqrt(level).mean()
""",
    "least squares": """
import numpy as np
def prepare(seed):
    rng = np.random.default_rng(seed)
    return rng.random((60, 8, 4)), rng.random((60, 8))
def run(given):
    total = np.zeros(4)
    for rows, wanted in zip(*given):
        normal = rows.T @ rows + 0.01 * np.eye(4)
        found = np.linalg.solve(normal, rows.T @ wanted)
        left = wanted - rows @ found
        weight = 1.0 / (1.0 + left ** 2)
        total = total + np.clip(found, -1.0, 1.0) * weight.mean()
    return total
""",
}
"""Programs of numpy that the factor of the context is fitted to."""


def measure_calls(show: Callable[[str, int], object]) -> dict[str, LibraryCall]:
    """Time all calls on this machine; *show* is called with the name of each and its number."""
    points: dict[str, dict[int, float]] = {}
    sizes: dict[str, str] = {}
    for number, one in enumerate(snippets()):
        show(one.name, number)
        sizes[one.name] = one.size
        points.setdefault(one.name, {})[one.measured_size()] = one.nanoseconds()
    return {
        name: LibraryCall(size=sizes[name], points=dict(sorted(found.items())))
        for name, found in sorted(points.items())
    }


def scaled(calls: Mapping[str, LibraryCall], factor: float, library: str = "") -> dict[str, LibraryCall]:
    """Return entries with their times multiplied, of one library or of all."""
    found = dict(calls)
    for name, one in calls.items():
        if name.startswith(library):
            points = {size: round(value * factor, 1) for size, value in one.points.items()}
            found[name] = LibraryCall(size=one.size, points=points)
    return found


def context_factor(programs: Sequence[TimedCode], table: LibraryTable, slowdown: float) -> float:
    """Return the time of numpy's calls in programs over that in loops.

    Args:
        programs: The programs, timed.
        table: Times of calls in loops, on the machine of ``operation_table``.
        slowdown: Time on this machine over the time on that machine.
    """
    factors = []
    for one in programs:
        own = one.counted_ns(operation_table().nanoseconds, None)
        calls = one.counted_ns(operation_table().nanoseconds, table) - own
        factors.append((one.median / slowdown - own) / calls)
    return median(factors)


def measure_table(
    machine: str,
    rounds: Rounds,
    show: Callable[[str, int], object],
) -> LibraryTable:
    """Measure all calls and programs and return the table, for the machine of ``operation_table``.

    Args:
        machine: Name of this machine.
        rounds: How many rounds of the programs.
        show: See ``measure_calls``.
    """
    own = timed_programs()
    mine = [timed_program(name, text) for name, text in CONTEXT_PROGRAMS.items()]
    measure([*own, *mine], rounds)
    slowdown = median(one.median / one.counted_ns(operation_table().nanoseconds) for one in own)
    calls = scaled(measure_calls(show), 1.0 / slowdown)
    table = LibraryTable(
        provenance="measured",
        source=f"volery calibrate libraries: least CPU time of {BATCHES} batches of each call",
        validity=f"float64 arrays in row order; numpy {np.__version__}",
        machine=machine,
        programs=0,
        mean_error=0.0,
        worst_error=0.0,
        calls=calls,
    )
    factor = context_factor(mine, table, slowdown)
    return table.model_copy(update={"calls": scaled(calls, factor, "numpy"), "in_context": round(factor, 3)})
