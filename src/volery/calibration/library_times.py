"""Measurement of the times of library calls: the points of ``cost/libraries.json``.

Each call is timed alone in a loop, at several sizes, in CPU time of the thread; the least of several batches
counts, because other programs only add to it. What a call of Python takes by itself is subtracted: the
counted code has it already. Features are measured after the points, each as what a call with it takes beyond
its price so far. Within a program the code of numpy's calls is colder: the time that does not grow with the
size contains the factor between small programs and the sum of their calls in loops. Programs by which the
table is judged take no part in it.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import operator
import pickle
import re
import struct
import zlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from statistics import median
from typing import NamedTuple

import numpy as np

from volery.base.errors import UsageError, choices
from volery.calibration.least_time import BATCHES, least_time
from volery.calibration.picture_times import picture_calls, picture_features
from volery.calibration.timed_code import (
    Rounds,
    TimedCode,
    measure,
    timed_program,
    timed_programs,
)
from volery.calibration.work_times import WorkTimes, work_times
from volery.cost import OWN, WRAPPED, LibraryCall, LibraryTable, call_feature, call_size, operation_table

LONG_CALLS = ("cv2", "gtsam", "small_gicp")
"""Libraries whose calls take long: their code is warm, and their data are their own."""
SEPARATE = (*LONG_CALLS, OWN)
"""Libraries that can be measured without the others: no factor of a context belongs to them."""
COLD_NS, WARM = 1000.0, 0.15
"""Beginning of a call whose code is cold in a program, and the share of the rest."""
SIDES = (1, 4, 16, 32, 64, 100, 181, 256, 512, 1024)
"""Square roots of the elements of the arrays that are timed."""
SMALL_SIDES = (2, 4, 8, 16, 64, 128)
"""Sides of the matrices of linear algebra."""
LENGTHS = (16, 256, 4096, 65536)
METHODS = (
    "sum", "mean", "max", "min", "std", "var", "any", "all", "argmax", "argmin", "cumsum", "copy", "ravel",
)  # fmt: skip
"""Methods of arrays that are functions of numpy as well."""
REDUCTIONS = ("sum", "mean", "max", "min", "std", "var", "any", "all", "argmax", "argmin")
BY_ITEMS = frozenset((
    "std", "var", "cumsum", "array", "tolist", "nonzero", "take", "exp", "sin", "cos",
    "interp", "polyfit", "polyval", "median", "argsort", "random", "normal", "uniform", "integers", "hypot",
    "arctan2", "power", "diff", "unique",
))  # fmt: skip
"""Functions of numpy that take their time by elements whatever the type: they work on one at a time."""


class TimedCall(NamedTuple):
    """A call to be timed.

    Attributes:
        name: Its entry of the table.
        size: Meaning of its size, or the feature that it is to price.
        function: The function.
        arguments: The arguments.
    """

    name: str
    size: str
    function: Callable[..., object]
    arguments: tuple[object, ...]

    def nanoseconds(self) -> float:
        """Return the time of one call on this machine, without what any call of Python takes."""
        own = least_time(self.function, self.arguments)
        if getattr(self.function, "__name__", "") == "<lambda>":
            return max(own - least_time(_NOTHING[len(self.arguments)], self.arguments), 1.0)
        return max(own - least_time(bool, ((),)), 1.0)

    def measured_size(self) -> int:
        """Return the size of the call."""
        return max(1, round(call_size(self.size, self.arguments, self.function(*self.arguments))))


_NOTHING: Sequence[Callable[..., object]] = (
    lambda: None, lambda a: None, lambda a, b: None, lambda a, b, c: None,
)  # fmt: skip
"""Functions that take what any call of a function in Python takes, by their number of arguments."""


def _key(function: Callable[..., object]) -> str:
    return f"numpy.{function.__name__}"


def _of_shape(draw: Callable[..., object], shape: tuple[int, ...]) -> Callable[..., object]:
    return lambda *given: draw(*given, size=shape)


_UNARY = (
    "sqrt", "exp", "sin", "cos", "abs", "floor", "isnan", "isfinite", "asarray", "diff", "count_nonzero",
    "zeros_like",
)  # fmt: skip
ELEMENTWISE = ("sqrt", "exp", "sin", "cos", "abs", "floor", "isnan", "isfinite")
_BINARY = ("add", "subtract", "multiply", "divide", "maximum", "minimum", "hypot", "arctan2", "power")
_LINEAR = ("inv", "solve", "det", "eig", "svd")


def snippets() -> Iterator[TimedCall]:
    """Yield all calls that are timed."""
    generator = np.random.default_rng(1)
    for array in _arrays(generator):
        yield array._replace(size="items") if array.name.removeprefix("numpy.") in BY_ITEMS else array
    yield from _linear_algebra(generator)
    yield from _texts()
    yield from itertools.starmap(TimedCall, picture_calls())


def features() -> Iterator[TimedCall]:
    """Yield the calls that price features, after ``snippets``."""
    generator = np.random.default_rng(2)
    array = generator.random((400, 30)) + 0.5
    other = generator.random((400, 30)) + 0.5
    pairs, wide = generator.random((4000, 2)), generator.random((4000, 4))
    mask, row = generator.random(12_000) > 0.5, generator.random(12_000)
    for name in METHODS:
        yield TimedCall(f"numpy.{name}", "wrapped", getattr(np, name), (np.ones(1),))
    for name in REDUCTIONS:
        yield TimedCall(f"numpy.{name}", "loops", lambda a, name=name: getattr(a, name)(axis=1), (pairs,))
    for name in ("sum", "max", "min", "mean", "argmax", "argmin"):
        yield TimedCall(f"numpy.{name}", "strided", lambda a, name=name: getattr(a, name)(), (array[:, 3],))
    for name in (*ELEMENTWISE, "copy"):
        function = getattr(np, name)
        yield TimedCall(_key(function), "loops", function, (wide[:, :2],))
        yield TimedCall(_key(function), "strided", function, (array[:, 3],))
    functions = {_key(getattr(np, name)): getattr(np, name) for name in _BINARY}
    functions["numpy.operator"] = lambda a, b: a * b
    functions["numpy.less"] = lambda a, b: a < b
    functions["numpy.where"] = lambda a, b: np.where(a > 0.7, a, b)
    for key, binary in functions.items():
        if key != "numpy.where":
            yield TimedCall(key, "loops", binary, (pairs, pairs[0]))
            yield TimedCall(key, "strided", binary, (array[:, 3], other[:, 3]))
            yield TimedCall(key, "cast", binary, (array, (other * 9).astype(np.int32)))
    yield TimedCall("numpy.mask", "selected", lambda a, b: a[b], (array.ravel(), mask))
    yield TimedCall("numpy.putmask", "selected", lambda b, a, v: a.__setitem__(b, v), (mask, row, row[mask]))
    yield TimedCall("numpy.nonzero", "selected", lambda a: a.nonzero(), (mask,))
    yield TimedCall("numpy.nonzero", "coordinates", lambda a: a.nonzero(), (mask.reshape(-1, 40),))
    yield TimedCall("numpy.take", "rows", lambda a, b: a[b], (pairs, generator.integers(0, 4000, 4000)))
    yield TimedCall("numpy.mask", "rows", lambda a, b: a[b], (pairs, mask[:4000]))
    for name in ("matmul", "dot"):
        yield TimedCall(
            f"numpy.{name}", "outputs", getattr(np, name), (generator.random((1000, 3)), np.eye(3))
        )
    yield from _features_of_texts()
    yield from itertools.starmap(TimedCall, picture_features())


def _features_of_texts() -> Iterator[TimedCall]:
    short, long = [k + 0.5 for k in range(400)], [k / 7.0 for k in range(400)]
    rows = [{"id": k, "name": "drone", "ready": k > 9, "at": [k, -k]} for k in range(100)]
    for feature, document in (("values", rows), ("floats", short), ("decimals", long)):
        yield TimedCall("json.dumps", feature, json.dumps, (document,))
        yield TimedCall("json.loads", feature, json.loads, (json.dumps(document),))
    yield TimedCall("json.dumps", "lines", lambda rows: json.dumps(rows, indent=2), (rows,))
    line = "2026-11-23 12:00:01.250 INFO drone_3 battery=15.82 alt=101.5 msg='hold position'"
    lines = "\n".join([line] * 40)
    for name in ("findall", "split", "sub", "search"):
        yield TimedCall(f"re.{name}", "scanned", *_of_pattern(name, r"\s*#.*$", lines))
    for name in ("findall", "split"):
        yield TimedCall(f"re.{name}", "found", *_of_pattern(name, r"battery=(\d+\.\d+)", lines))
    yield TimedCall("re.sub", "removed", *_of_pattern("sub", r"battery=", lines))
    for name in ("match", "fullmatch", "search"):
        yield TimedCall(
            f"re.{name}", "matched", *_of_pattern(name, r"(?P<day>[\d-]+) ([\d:.]+) ([A-Z]+) (\w+).*", line)
        )
    random = np.random.default_rng(3)
    records = b"".join(
        struct.pack("<Qddfff", 1000 * k, 43 + k * 1e-6, -3.8, k % 37, k / 7, 0.0) for k in range(250)
    )
    readings = "\n".join(f"{k / 50:.2f},{random.normal():.4f},{k % 9}" for k in range(500)).encode()
    for data in (records, readings):
        yield TimedCall("zlib.compress", "part packed", zlib.compress, (data,))
        yield TimedCall("zlib.decompress", "part packed", zlib.decompress, (zlib.compress(data),))


def _of_pattern(name: str, pattern: str, text: str) -> tuple[Callable[..., object], tuple[object, ...]]:
    """Return a function of a pattern, called with it first as it is priced, and its arguments."""
    compiled = re.compile(pattern)
    given = ("-", text) if name == "sub" else (text,)
    return (lambda own, *rest: getattr(own, name)(*rest)), (compiled, *given)


def _arrays(generator: np.random.Generator) -> Iterator[TimedCall]:
    for side in SIDES:
        row = generator.random(side * side)
        fitted = (np.linspace(-1.0, 1.0, max(row.size, 5)), np.resize(row, max(row.size, 5)))
        yield TimedCall("numpy.interp", "elements", np.interp, (row, *fitted))
        yield TimedCall("numpy.polyfit", "elements", np.polyfit, (*fitted, 3))
        yield TimedCall("numpy.polyval", "elements", np.polyval, ((0.1, 0.2, 0.3, 0.4), row))
        yield TimedCall("numpy.rfft", "elements", np.fft.rfft, (row,))
        yield TimedCall("numpy.fft", "elements", np.fft.fft, (row,))
        for name in ("column_stack", "stack", "vstack", "hstack"):
            yield TimedCall(f"numpy.{name}", "elements", getattr(np, name), ([row, row],))
        for name in ("sort", "argsort", "median"):
            yield TimedCall(f"numpy.{name}", "elements", getattr(np, name), (row,))
        yield TimedCall("numpy.histogram", "items", np.histogram, (row,))
        yield TimedCall("numpy.percentile", "items", np.percentile, (row, 90.0))
        yield TimedCall("numpy.nonzero", "elements", lambda a: a.nonzero(), (row > 2.0,))
        numbers = generator.integers(0, 20 * row.size, row.size)
        yield TimedCall("numpy.unique", "elements", lambda a: np.unique(a, return_index=True), (numbers,))
        array = generator.random((side, side)) + 0.5
        other = generator.random((side, side)) + 0.5
        for name in _UNARY:
            yield TimedCall(_key(getattr(np, name)), "elements", getattr(np, name), (array,))
        for name in METHODS:
            yield TimedCall(f"numpy.{name}", "elements", getattr(np.ndarray, name), (array,))
        for name in _BINARY:
            yield TimedCall(_key(getattr(np, name)), "elements", getattr(np, name), (array, other))
        yield TimedCall("numpy.operator", "elements", lambda a, b: a * b, (array, other))
        yield TimedCall("numpy.less", "elements", lambda a, b: a < b, (array, other))
        yield TimedCall("numpy.mask", "elements", lambda a, b: a[b], (array, array > 2.0))
        yield TimedCall("numpy.remainder", "elements", lambda a, b: a % b, (array, other))
        yield TimedCall("numpy.where", "elements", np.where, (array > 1.0, array, other))
        yield TimedCall("numpy.clip", "elements", np.clip, (array, 0.2, 0.8))
        yield TimedCall("numpy.concatenate", "elements", lambda a: np.concatenate((a, a)), (array,))
        yield TimedCall("numpy.zeros", "elements", np.zeros, (array.shape,))
        yield TimedCall("numpy.ones", "elements", np.ones, (array.shape,))
        yield TimedCall("numpy.linspace", "elements", np.linspace, (0.0, 1.0, row.size))
        yield TimedCall("numpy.meshgrid", "elements", np.meshgrid, (row[:side], row[:side]))
        yield TimedCall("numpy.subscript", "elements", lambda a: a[a.shape[0] // 2 :, :], (array,))
        yield TimedCall("numpy.roll", "elements", lambda a: np.roll(a, 1, 0), (array,))
        yield TimedCall("numpy.astype", "elements", lambda a: a.astype(np.uint8), (array,))
        yield TimedCall("numpy.tolist", "elements", lambda a: a.tolist(), (array,))
        yield TimedCall(
            "numpy.gradient", "elements", np.gradient, (generator.random((max(side, 2), max(side, 2))),)
        )
        for name in ("random", "normal", "uniform", "integers"):
            given = {"random": (), "normal": (0.0, 1.0), "uniform": (0.0, 1.0), "integers": (0, 9)}[name]
            draw = getattr(generator, name)
            yield TimedCall(f"numpy.{name}", "elements", _of_shape(draw, array.shape), given)
        yield TimedCall("numpy.putmask", "elements", operator.setitem, (array.copy(), array > 2.0, 1.0))
        yield TimedCall("numpy.put", "elements", operator.setitem, (row.copy(), numbers // 20, 1.0))
        yield TimedCall("numpy.take", "elements", lambda a, b: a[b], (row, numbers // 20))
        yield TimedCall("numpy.*", "elements", np.clip, (array, 0.2, 0.8))
    for side in (1, 8, 64):
        vectors = generator.random((side * side, 3))
        yield TimedCall("numpy.cross", "elements", np.cross, (vectors, vectors))
        nested = vectors.tolist()
        yield TimedCall("numpy.array", "elements", np.array, (nested,))
    yield TimedCall("numpy.default_rng", "elements", np.random.default_rng, (1,))
    yield TimedCall("numpy.scalar", "elements", lambda a, b: a * b, (np.float64(1.5), np.float64(2.5)))


def _linear_algebra(generator: np.random.Generator) -> Iterator[TimedCall]:
    for side in SMALL_SIDES:
        matrix = generator.random((side, side)) + np.eye(side) * side
        for name in ("matmul", "dot"):
            yield TimedCall(f"numpy.{name}", "products", getattr(np, name), (matrix, matrix))
        for name in _LINEAR:
            function = getattr(np.linalg, name)
            given = (matrix, matrix[0]) if name == "solve" else (matrix,)
            yield TimedCall(f"numpy.{name}", "cube", function, given)
        tall = generator.random((8 * side, side))
        yield TimedCall("numpy.norm", "elements", np.linalg.norm, (matrix,))
        yield TimedCall("numpy.lstsq", "squares", np.linalg.lstsq, (tall, tall[:, 0]))
        yield TimedCall("numpy.eye", "elements", np.eye, (side,))
        yield TimedCall("numpy.outer", "elements", np.outer, (matrix[0], matrix[0]))


def _texts() -> Iterator[TimedCall]:
    random = np.random.default_rng(4)
    for length in LENGTHS:
        rows = [
            {"id": number, "x": number * 1.5, "name": f"drone_{number}"} for number in range(length // 44 + 1)
        ]
        text = "".join(map(chr, random.integers(97, 123, length)))
        words = ("alpha 12.5 beta; " * (length // 17 + 1))[:length]
        data = words.encode()
        yield TimedCall("json.dumps", "text", json.dumps, (text,))
        yield TimedCall("json.loads", "text", json.loads, (json.dumps(text),))
        for name in ("findall", "sub", "split", "match", "search", "fullmatch"):
            function, given = _of_pattern(name, r"gamma=(\w+) ([0-9.]+)", words)
            yield TimedCall(f"re.{name}", "text", function, given)
        pattern = re.compile(r"(\w+) ([0-9.]+)")
        hit = pattern.match("alpha 12.5")
        assert hit is not None
        yield TimedCall("re.groups", "text", hit.groups, ())
        yield TimedCall("re.group", "text", hit.group, (1,))
        noise = random.integers(0, 150, length, dtype=np.uint8).tobytes()
        yield TimedCall("zlib.compress", "text", zlib.compress, (noise,))
        yield TimedCall("zlib.decompress", "text", zlib.decompress, (zlib.compress(noise),))
        yield TimedCall("zlib.crc32", "text", zlib.crc32, (data,))
        yield TimedCall("hashlib.*", "text", lambda d: hashlib.sha256(d).digest(), (data,))
        yield TimedCall("hashlib.digest", "text", hashlib.sha256(data).digest, ())
        yield TimedCall("hashlib.hexdigest", "text", hashlib.sha256(data).hexdigest, ())
        yield TimedCall("pickle.dumps", "text", pickle.dumps, (rows,))
        yield TimedCall("pickle.loads", "text", pickle.loads, (pickle.dumps(rows),))
    for fields in (1, 4, 16, 64):
        record = struct.Struct(f"<{fields}d")
        values = tuple(range(fields))
        yield TimedCall("struct.pack", "fields", record.pack, values)
        yield TimedCall("struct.unpack", "fields", record.unpack, (record.pack(*values),))
        yield TimedCall("struct.unpack_from", "fields", record.unpack_from, (record.pack(*values), 0))
    for length in LENGTHS:
        rows_of_8 = bytes(length // 64 * 64 + 64)
        yield TimedCall(
            "struct.iter_unpack", "text", lambda b: list(struct.iter_unpack("<8d", b)), (rows_of_8,)
        )
    yield TimedCall("struct.*", "fields", struct.calcsize, ("<8d",))
    yield TimedCall("json.*", "text", json.dumps, ([1],))
    yield TimedCall("re.*", "text", re.compile, ("a",))
    yield TimedCall("pickle.*", "text", pickle.dumps, (1,))
    yield TimedCall("zlib.*", "text", zlib.adler32, (b"abc",))


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
    "occupied cells": """
import numpy as np
def prepare(seed):
    return np.random.default_rng(seed).random((260, 300)), np.arange(8)
def run(given):
    cells, shifts = given
    hits = np.zeros(cells.shape, dtype=np.int32)
    for shift in shifts:
        moved = np.roll(cells, shift, axis=1)
        near = np.abs(moved - cells) < 0.3
        hits[near] += 1
        hits[5:-5, 5:-5] += near[4:-6, 4:-6]
    rows, columns = np.nonzero(hits > 5)
    return rows.sum() + columns.max() + hits[rows, columns].mean() + cells[hits > 6].std()
""",
    "pairs of a fleet": """
import numpy as np
def prepare(seed):
    return np.random.default_rng(seed).random((70, 3)) * 50.0
def run(places):
    total = 0.0
    for _ in range(4):
        apart = places[:, None, :] - places[None, :, :]
        far = np.sqrt((apart * apart).sum(axis=2)) + 1e-6
        push = (apart / (far ** 3)[:, :, None]).sum(axis=1)
        places = places + np.clip(push, -0.1, 0.1)
        total += far.max() + far.mean(axis=0).min()
    return total
""",
}
"""Programs of numpy that the factors of the context are fitted to."""

TEXT_PROGRAMS = {
    "reports": """
import json
import re
LINE = re.compile(r"unit=(\\w+) t=([0-9.]+) volt=([0-9.]+)")
def prepare(seed):
    return [f"INFO unit=uav{n % 7} t={n * 0.25 + seed:.2f} volt={15.0 + n % 9 / 10}" for n in range(150)]
def run(lines):
    units = {}
    for line in lines:
        found = LINE.search(line)
        if found:
            unit, time, volt = found.groups()
            units.setdefault(unit, []).append({"t": float(time), "v": float(volt), "ok": True})
    text = json.dumps(units)
    return sum(len(rows) for rows in json.loads(text).values()) + len(text)
""",
    "parameter files": """
import json
import struct
def prepare(seed):
    return {f"PARAM_{n}": {"value": n * 0.5 + seed, "type": n % 9, "text": "a setting"} for n in range(90)}
def run(parameters):
    text = json.dumps(parameters, indent=1)
    total = 0.0
    for name, one in json.loads(text).items():
        packed = struct.pack("<fB16s", one["value"], one["type"], name.encode())
        value, kind, _ = struct.unpack("<fB16s", packed)
        total += value + kind
    return total
""",
}
"""Programs that the factor of the other libraries is fitted to."""


def measure_calls(
    show: Callable[[str, int, int], object], only: Collection[str] = ()
) -> dict[str, LibraryCall]:
    """Time all calls on this machine: first the points, then the features of their entries.

    Args:
        show: Called with the name of each call, its number and the number of all.
        only: Libraries whose calls are timed; all by default.

    Returns:
        Entries by ``library.function``, ns of this machine, as in loops.
    """
    points: dict[str, dict[int, float]] = {}
    sizes: dict[str, str] = {}
    of_sizes, of_features = (
        [one for one in given if not only or one.name.partition(".")[0] in only]
        for given in (snippets(), features())
    )
    for number, one in enumerate(of_sizes):
        show(one.name, number, len(of_sizes) + len(of_features))
        sizes[one.name] = one.size
        points.setdefault(one.name, {})[one.measured_size()] = one.nanoseconds()
    found = {
        name: LibraryCall(size=sizes[name], points=dict(sorted(measured.items())))
        for name, measured in sorted(points.items())
    }
    beyond: dict[tuple[str, str], list[float]] = {}
    for place, one in enumerate(of_features, len(of_sizes)):
        show(one.name, place, len(of_sizes) + len(of_features))
        beyond.setdefault((one.name, one.size), []).append(_of_feature(one, found[one.name]))
        each = {**found[one.name].each, one.size: round(max(0.0, median(beyond[one.name, one.size])), 3)}
        found[one.name] = found[one.name].model_copy(update={"each": each})
    return found


def _of_feature(one: TimedCall, law: LibraryCall) -> float:
    """Return the time of a feature, ns: what the call takes beyond its price without it, over its count."""
    result = one.function(*one.arguments)
    rest = law.model_copy(
        update={"each": {name: each for name, each in law.each.items() if name != one.size}}
    )
    beyond = one.nanoseconds() - rest.of_call(one.arguments, result)
    return beyond if one.size == WRAPPED else beyond / call_feature(one.size, one.arguments, result)


def scaled(calls: Mapping[str, LibraryCall], factor: float, library: str = "") -> dict[str, LibraryCall]:
    """Return entries with their times multiplied.

    Args:
        calls: Entries by ``library.function``.
        factor: The factor.
        library: Beginning of the names of the entries that are changed; by default all.
    """
    found = dict(calls)
    for name, one in calls.items():
        if name.startswith(library):
            points = {size: round(value * factor, 1) for size, value in one.points.items()}
            each = {feature: round(value * factor, 3) for feature, value in one.each.items()}
            found[name] = LibraryCall(size=one.size, points=points, each=each)
    return found


def in_context(
    calls: Mapping[str, LibraryCall], constant: float, growth: float, library: str = ""
) -> dict[str, LibraryCall]:
    """Return entries as in programs.

    Args:
        calls: Entries as in loops.
        constant: Factor of the part of a time that does not grow with the size, whose code is cold. A call
            that takes longer than ``COLD_NS`` is written in Python, or repeats itself: its code is warm.
        growth: Factor of the rest, whose data are cold.
        library: Beginning of the names of the entries that are changed.
    """
    found = dict(calls)
    for name, one in calls.items():
        if name.startswith(library):
            least = min(one.points.values())
            first = least + (constant - 1.0) * (min(least, COLD_NS) + WARM * max(0.0, least - COLD_NS))
            points = {size: round(first + growth * (value - least), 1) for size, value in one.points.items()}
            each = {
                feature: round(value * (constant if feature == WRAPPED else growth), 3)
                for feature, value in one.each.items()
            }
            found[name] = LibraryCall(size=one.size, points=points, each=each)
    return found


def context_factors(
    programs: Sequence[TimedCode], table: LibraryTable, slowdown: float, library: str
) -> tuple[float, float, float]:
    """Return the factors of ``in_context`` and the time of a page, ns, with the least relative errors.

    Args:
        programs: The programs, timed.
        table: Times of calls in loops, on the machine of ``operation_table``.
        slowdown: Time on this machine over the time on that machine.
        library: Beginning of the names of the entries.
    """
    operations = operation_table().nanoseconds

    def estimate(program: TimedCode, constant: float, growth: float, page: float) -> float:
        calls = in_context(table.calls, constant, growth, library)
        return program.counted_ns(operations, table.model_copy(update={"calls": calls, "page": page}))

    rows, rest = [], []
    for program in programs:
        took = program.median / slowdown
        whole = estimate(program, 1.0, 1.0, 0.0)
        steps = ((2.0, 1.0, 0.0), (1.0, 2.0, 0.0), (1.0, 1.0, 1000.0))
        rows.append([(estimate(program, *each) - whole) / took for each in steps])
        rest.append((took - whole) / took)
    constant, growth, page = np.linalg.lstsq(np.array(rows), np.array(rest), rcond=None)[0]
    return 1.0 + max(0.0, float(constant)), 1.0 + max(0.0, float(growth)), max(0.0, float(page)) * 1000.0


def measure_table(machine: str, rounds: Rounds, show: Callable[[str, int, int], object]) -> LibraryTable:
    """Measure all calls and programs and return the table, for the machine of ``operation_table``.

    Args:
        machine: Name of this machine.
        rounds: How many rounds of the programs.
        show: See ``measure_calls``.
    """
    own = timed_programs()
    with_numpy, with_text = (
        [timed_program(name, text) for name, text in programs.items()]
        for programs in (CONTEXT_PROGRAMS, TEXT_PROGRAMS)
    )
    measure([*own, *with_numpy, *with_text], rounds)
    slowdown = _slowdown(own)
    table = LibraryTable(
        provenance="measured",
        source=f"volery cost calibrate libraries: least CPU time of {BATCHES} batches of each call",
        validity=f"float64 arrays in row order; numpy {np.__version__}",
        machine=machine,
        programs=0,
        mean_error=0.0,
        worst_error=0.0,
        calls=scaled(measure_calls(show), 1.0 / slowdown),
        work=_scaled_work(work_times(show), 1.0 / slowdown),
    )
    cold, data, page = context_factors(with_numpy, table, slowdown, "numpy")
    of_text = context_factors(with_text, table, slowdown, "")[:2]
    of_numpy = in_context(table.calls, cold, data)
    calls = {
        **in_context(table.calls, *of_text),
        **{name: of_numpy[name] for name in of_numpy if name.startswith("numpy")},
        **{name: one for name, one in table.calls.items() if name.startswith(LONG_CALLS)},
    }
    fitted = {"in_context": round(cold, 3), "data_in_context": round(data, 3), "page": round(page, 1)}
    return table.model_copy(update={"calls": calls, **fitted})


def measured_again(
    table: LibraryTable, only: Collection[str], rounds: Rounds, show: Callable[[str, int, int], object]
) -> LibraryTable:
    """Return a table in which some of the libraries ``SEPARATE`` are measured anew.

    Raises:
        UsageError: There is no such library among them, or it is not installed.
    """
    wrong = sorted(set(only) - set(SEPARATE))
    if wrong:
        raise UsageError(
            f"library {wrong[0]!r} by itself; give {choices(SEPARATE)}, or none for all of the table"
        )
    own = timed_programs()
    measure(own, rounds)
    factor = 1.0 / _slowdown(own)
    wanted = set(only) - {OWN}
    calls = scaled(measure_calls(show, wanted), factor) if wanted else {}
    missing = sorted(wanted - {name.partition(".")[0] for name in calls})
    if missing:
        raise UsageError(f"{missing[0]} is not installed: pip install {missing[0]}")
    kept = {name: one for name, one in table.calls.items() if name.partition(".")[0] not in wanted}
    work = _scaled_work(work_times(show), factor) if OWN in only else table.work
    return table.model_copy(update={"calls": dict(sorted({**kept, **calls}.items())), "work": work})


def _slowdown(programs: Sequence[TimedCode]) -> float:
    """Return the time on this machine over that on the machine of ``operation_table``.

    Of least times, like those of calls: on a busy machine medians are longer by a factor.
    """
    return median(
        min(program.nanoseconds) / program.counted_ns(operation_table().nanoseconds) for program in programs
    )


def _scaled_work(times: WorkTimes, factor: float) -> WorkTimes:
    return {
        block: {name: float(f"{each * factor:.4g}") for name, each in amounts.items() if each}
        for block, amounts in times.items()
    }
