"""Times of calls of compiled libraries (numpy, json, re, ...) in counted Python code.

Law: time of a call = a function of its size, interpolated between measured points on logarithmic axes, + the
sum of its features (``library_sizes``), each at its measured time. It depends on nothing else, so that the
same run has the same times. Left out are the values of the data and caches; that is its error.
A function without points of its own is priced by one that computes alike. The figures in ``libraries.json``
are in nanoseconds of the machine of ``operation_table``; ``CodeLaw`` scales them to other processors.

Functions of ``volery.autonomy`` say what they did (``base.metered_work``): their time is a sum of amounts of
work, each at its measured time. Their own Python and what they call is part of it and not counted beside.

Calls are found when they happen: in a file that imports one of the libraries every call, operator and
subscript passes through ``LibraryCalls``, which looks at the function and at its arguments.
"""

from __future__ import annotations

import json
import operator
import sys
from bisect import bisect_right
from collections.abc import Callable, Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, field_validator

from volery.base.elementary import exp, log
from volery.base.metered_work import Work, metered
from volery.cost.figures import WithProvenance
from volery.cost.library_sizes import FEATURES, SIZES, call_feature, call_size, new_pages
from volery.cost.python_operations import STEPS_PER_NS

OPERATORS: Mapping[str, Callable[..., Any]] = {
    "USub": operator.neg, "Invert": operator.invert,
    "Add": operator.add, "Sub": operator.sub, "Mult": operator.mul, "Div": operator.truediv,
    "FloorDiv": operator.floordiv, "Mod": operator.mod, "Pow": operator.pow, "MatMult": operator.matmul,
    "BitAnd": operator.and_, "BitOr": operator.or_, "BitXor": operator.xor,
    "Eq": operator.eq, "NotEq": operator.ne, "Lt": operator.lt, "LtE": operator.le, "Gt": operator.gt,
    "GtE": operator.ge, "Subscript": operator.getitem,
}  # fmt: skip
"""Functions of the operators that pass through, by the name of the syntax node."""

UNARY = ("USub", "Invert")

NAMELESS = ("cv2", "cv2.aruco")
"""Modules whose functions do not say where they belong."""

OWN = "autonomy"
"""Library of volery whose functions state their work."""

_PYBIND = "pybind11_builtins"
_OWN_MODULES = f"volery.{OWN}"

WRAPPED = "wrapped"
"""Feature of a function around a method."""

ENTRIES: Mapping[str, str] = {
    "MatMult": "numpy.matmul", "Subscript": "numpy.subscript", "Pow": "numpy.power", "Mod": "numpy.remainder",
    **dict.fromkeys(("Eq", "NotEq", "Lt", "LtE", "Gt", "GtE"), "numpy.less"),
}  # fmt: skip
"""Entries of operators on arrays that differ from that of all others."""

ALIKE: Mapping[str, str] = {
    name: f"numpy.{entry}"
    for entry, names in {
        "exp": "log log2 log10 log1p expm1 exp2 tan arcsin arccos arctan sinh cosh tanh cbrt logaddexp",
        "add": "negative square conjugate sign floor_divide logical_and logical_or logical_not logical_xor "
        "bitwise_and bitwise_or bitwise_xor invert left_shift right_shift "
        "fmax fmin rint ceil trunc reciprocal deg2rad rad2deg radians degrees",
        "less": "greater equal not_equal greater_equal less_equal isinf",
        "copy": "full arange tile repeat flip empty_like full_like ones_like flatten fill compress "
        "ascontiguousarray tobytes frombuffer triu tril diag pad",
        "argsort": "lexsort partition argpartition searchsorted digitize",
        "median": "percentile quantile nanmedian nanpercentile nanquantile",
        "mean": "bincount nanmean nansum nanmax nanmin nanstd average prod ptp trace cov",
        "ravel": "reshape transpose squeeze view swapaxes expand_dims moveaxis real imag item",
        "dot": "einsum tensordot inner vdot",
        "outer": "kron multi_dot",
        "inv": "cholesky qr pinv matrix_rank matrix_power",
        "eig": "eigh eigvals eigvalsh",
        "fft": "ifft irfft fft2 ifft2 rfft2 fftn",
        "random": "standard_normal choice shuffle permutation rand randn",
    }.items()
    for name in names.split()
}
"""Entries that price numpy's functions without an entry of their own, by what they compute."""


class LibraryCall(BaseModel):
    """Time of one function: ``points`` in ns by size, and ``each`` in ns by feature."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    size: str
    points: Mapping[int, float] = Field(min_length=1)
    each: Mapping[str, float] = {}

    @field_validator("size")
    @classmethod
    def _known(cls, size: str) -> str:
        if size not in SIZES:
            raise ValueError(f"size {size!r}; there is {', '.join(SIZES)}")
        return size

    @field_validator("each")
    @classmethod
    def _of_features(cls, each: Mapping[str, float]) -> Mapping[str, float]:
        unknown = sorted(set(each) - set(FEATURES) - {WRAPPED})
        if unknown:
            raise ValueError(f"feature {unknown[0]!r}; there is {', '.join((*FEATURES, WRAPPED))}")
        return each

    def of_call(self, arguments: tuple[Any, ...], result: Any, wrapped: bool = False) -> float:
        """Return the time of a call with these arguments and this result, ns.

        Args:
            arguments: Arguments; first the object if a method was called.
            result: Result of the call.
            wrapped: A function of the module was called, not a method.
        """
        time = self.nanoseconds(call_size(self.size, arguments, result))
        for name, each in self.each.items():
            time += each * (float(wrapped) if name == WRAPPED else call_feature(name, arguments, result))
        return time

    def nanoseconds(self, size: float) -> float:
        """Return the time; beyond the last of several points it is proportional to the size."""
        sizes = sorted(self.points)
        if size <= sizes[0]:
            return self.points[sizes[0]]
        if size >= sizes[-1]:
            return self.points[sizes[-1]] * (size / sizes[-1] if len(sizes) > 1 else 1.0)
        place = bisect_right(sizes, size)
        low, high = sizes[place - 1], sizes[place]
        share = log(size / low) / log(high / low)
        return exp((1.0 - share) * log(self.points[low]) + share * log(self.points[high]))


class TableError(BaseModel):
    """Relative error of estimates of whole programs: ``mean`` and ``worst`` over a number of them."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    mean: float
    worst: float
    programs: int


class LibraryTable(WithProvenance):
    """Times of calls by ``library.function``, ns, and the errors over programs that they were not fitted to.

    ``numpy.*`` and its like is the entry of functions of the library that have none. ``in_context`` and
    ``data_in_context`` are the factors between calls in programs and in loops, of the part that does not grow
    with the size and of the rest; numpy's times contain them. ``page`` is the time of a page of memory that
    is new to the program, ns. ``work`` are the times of volery's own functions by block of code and
    amount, ns. ``errors`` are by library; ``mean_error`` and ``worst_error`` are of all others.
    """

    machine: str
    in_context: float = 1.0
    data_in_context: float = 1.0
    page: float = 0.0
    programs: int
    mean_error: float
    worst_error: float
    errors: Mapping[str, TableError] = {}
    calls: Mapping[str, LibraryCall]
    work: Mapping[str, Mapping[str, float]] = {}

    @property
    def libraries(self) -> frozenset[str]:
        """Libraries that have an entry."""
        return frozenset((*(name.partition(".")[0] for name in self.calls), *([OWN] if self.work else ())))

    def error_of(self, library: str) -> TableError:
        """Return the error of programs that use a library."""
        rest = TableError(mean=self.mean_error, worst=self.worst_error, programs=self.programs)
        return self.errors.get(library, rest)

    def of_work(self, work: Work) -> float:
        """Return the time of amounts of work, ns. A block or an amount that the table lacks takes none."""
        return sum(
            self.work.get(block, {}).get(name, 0.0) * amount
            for block, amounts in work.items()
            for name, amount in amounts.items()
        )

    def as_text(self) -> str:
        """Return the table as JSON, a line for each function."""
        head = self.model_dump(exclude={"calls", "work"}, exclude_defaults=True)
        rows = [f"    {json.dumps(name)}: {one.model_dump_json()}" for name, one in self.calls.items()]
        lines = [f"  {json.dumps(name)}: {json.dumps(value)}," for name, value in head.items()]
        works = [f"    {json.dumps(name)}: {json.dumps(dict(each))}" for name, each in self.work.items()]
        blocks = (["  },", '  "work": {', ",\n".join(works)]) if works else []
        return "\n".join(["{", *lines, '  "calls": {', ",\n".join(rows), *blocks, "  }", "}", ""])


@cache
def library_table() -> LibraryTable:
    """Return the table that comes with volery."""
    text = files("volery.cost").joinpath("libraries.json").read_text(encoding="utf-8")
    return LibraryTable.model_validate_json(text)


class LibraryCalls:
    """Adds the times of library calls to a cell of steps.

    Attributes:
        steps: Steps by library, over the whole run.
        unpriced: Number of calls by ``library.function`` for which there is no entry.
        libraries: Libraries that are in the table.

    Args:
        cell: Cell of the counter that the steps are added to.
        table: The times.
    """

    def __init__(self, cell: list[int], table: LibraryTable) -> None:
        self.steps: dict[str, int] = {}
        self.unpriced: dict[str, int] = {}
        self._cell = cell
        self._calls = table.calls
        self._table = table
        self._page = table.page
        self.libraries = table.libraries

    def call(self, function: Any, /, *arguments: Any, **named: Any) -> Any:
        """Call a function, and add its time if it belongs to a library."""
        if library_of(getattr(function, "__module__", None) or "") == OWN and OWN in self.libraries:
            return self._work(function, arguments, named)
        name = self._name(function)
        if not name:
            return function(*arguments, **named)
        before = self._cell[0]
        result = function(*arguments, **named)
        of_callbacks = self._cell[0] - before
        own = getattr(function, "__self__", None)
        method = own is not None and not isinstance(own, type(sys))
        given = (own, *arguments) if method else arguments
        self._add(name, given, result, of_callbacks, not method)
        return result

    def _work(self, function: Any, arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
        """Call a function of volery, and add the time of the work that it did."""
        with metered() as work:
            result = function(*arguments, **named)
        if not work and not isinstance(function, type):
            name = f"{OWN}.{function.__name__}"
            self.unpriced[name] = self.unpriced.get(name, 0) + 1
        self._take(OWN, self._table.of_work(work))
        return result

    def _name(self, function: Any) -> str:
        """Return ``library.function`` of a function of a library, else an empty text."""
        owner = getattr(function, "__self__", None)
        if owner is None or isinstance(owner, type(sys)):
            kind = function if isinstance(function, type) or hasattr(function, "__name__") else type(function)
            module = getattr(kind, "__module__", None) or _owner_of(function) or type(function).__module__
        else:
            module = getattr(owner, "__module__", None) if isinstance(owner, type) else type(owner).__module__
            if module == _PYBIND:  # functions of modules, too, are bound to an object there
                module = getattr(function, "__module__", None)
        top = library_of(module or "")
        if top not in self.libraries:
            return ""
        return f"{top}.{getattr(function, '__name__', type(function).__name__)}"

    def _add(
        self, name: str, arguments: tuple[Any, ...], result: Any, already: int = 0, wrapped: bool = False
    ) -> None:
        library = name.partition(".")[0]
        entry = self._calls.get(name)
        if entry is None:
            self.unpriced[name] = self.unpriced.get(name, 0) + 1
            like = ALIKE.get(name.removeprefix("numpy."), "") if library == "numpy" else ""
            entry = self._calls.get(like) or self._calls.get(f"{library}.*")
            if entry is None:
                return
        time = entry.of_call(arguments, result, wrapped) + self._page * new_pages(result)
        self._take(library, time, already)

    def _take(self, library: str, time: float, already: int = 0) -> None:
        """Add a time [ns] beyond the steps that are counted already."""
        steps = max(0, round(STEPS_PER_NS * time) - already)
        self._cell[0] += steps
        self.steps[library] = self.steps.get(library, 0) + steps

    def operators(self) -> dict[str, Callable[[Any, Any], Any]]:
        """Return the functions that execute operators, by the name of the syntax node."""
        return {name: self._operator(name, function) for name, function in OPERATORS.items()}

    def store(self, value: Any, target: Any, kind: str, index: Any = None) -> Any:
        """Add the time of storing a value in an array or of an operator in place; return the value.

        Args:
            value: What is stored.
            target: What it is stored into.
            kind: ``Item`` for an item, else the operator's name.
            index: The item.
        """
        if kind != "Item":
            if _is_numpy(target) or _is_numpy(value):
                self._add(_entry(_operator_entry(kind, value), target), (target, value), None)
        elif _is_numpy(target):
            if getattr(index, "shape", ()):
                self._add(_picking(index, "putmask", "put"), (index, value), None)
            elif isinstance(index, slice) or (isinstance(index, tuple) and slice in map(type, index)):
                self._add("numpy.copy", (target[index],), None)
            else:
                self._add("numpy.scalar", (value,), None)
        return value

    def _operator(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        key = ENTRIES.get(name, "numpy.operator")
        if name in UNARY:

            def change(one: Any) -> Any:
                result = function(one)
                if _is_numpy(one):
                    self._add(_entry(key, result), (one,), result)
                return result

            return change

        def operate(left: Any, right: Any) -> Any:
            result = function(left, right)
            if _is_numpy(left) or _is_numpy(right):
                if name == "Subscript":
                    picked = getattr(right, "shape", ())
                    self._add(
                        _picking(right) if picked else _entry(key, result),
                        (right if picked else result,),
                        result,
                    )
                else:
                    self._add(_entry(_operator_entry(name, right), result), (left, right), result)
            return result

        return operate


def _owner_of(function: Any) -> str:
    """Return the module among ``NAMELESS`` that has a function, else an empty text."""
    name = getattr(function, "__name__", "")
    return next((one for one in NAMELESS if getattr(sys.modules.get(one), name, None) is function), "")


def library_of(module: str) -> str:
    """Return the library that a module belongs to, as the table names it."""
    if module == _OWN_MODULES or module.startswith(f"{_OWN_MODULES}."):
        return OWN
    return module.partition(".")[0].lstrip("_")


def _picking(index: Any, of_mask: str = "mask", of_indices: str = "take") -> str:
    """Return the entry of a subscript with an array: a mask, or indices."""
    return f"numpy.{of_mask if index.dtype.kind == 'b' else of_indices}"


def _operator_entry(name: str, right: Any) -> str:
    """Return the entry of an operator on arrays; numpy squares and takes roots without ``power``."""
    if name == "Pow" and isinstance(right, (int, float)) and right in (2, 1, 0.5, -1):
        return "numpy.operator"
    return ENTRIES.get(name, "numpy.operator")


def _entry(key: str, result: Any) -> str:
    """Return the entry of an operator: scalars, and subscripts that copy, have entries of their own."""
    single = getattr(result, "shape", ()) == ()
    if key == "numpy.subscript":
        return key if single or result.base is not None else "numpy.take"
    return "numpy.scalar" if single and key != "numpy.matmul" else key


def _is_numpy(value: Any) -> bool:
    return type(value).__module__ == "numpy"
