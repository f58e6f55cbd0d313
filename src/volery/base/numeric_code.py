"""Functions of numbers and arrays that execute as machine code, not as Python.

A function marked ``numeric`` is plain Python for its callers in Python. A ``NumericCode`` is an entry point:
a function that calls such functions and is compiled with all of them. It executes from the object code that a
wheel carries (``scripts/compile_numerics.py``), so that neither numba nor a compiler is needed at run time.
Where that is missing or was made from other sources, numba compiles it at the first use and keeps it in its
cache. Both are compiled without fused or reordered operations and give the same bits on every processor.
"""

from __future__ import annotations

import ctypes
import hashlib
import platform
import struct
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from logging import getLogger
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar, cast

import numpy as np

from volery.base.errors import UsageError

OBJECT_CODE = Path(__file__).parent / "object_code"
"""Folder of the object code of a wheel. In a checkout it is empty until the script has been run."""

ELEMENTARY = Path(__file__).with_name("elementary.py")
"""Functions that any entry point may call."""

F = TypeVar("F", bound=Callable[..., Any])
_numeric: set[tuple[str, str]] = set()
"""Module and name of each numeric function."""


def numeric(function: F) -> F:
    """Mark a function that machine code may call. It may use numbers, arrays and numeric functions only."""
    _numeric.add((function.__module__, function.__name__))
    return function


def _numeric_function(value: Any) -> FunctionType | None:
    """Return a function that is marked as numeric; None for other values."""
    if isinstance(value, FunctionType) and (value.__module__, value.__name__) in _numeric:
        return value
    return None


def digest_of(files: Iterable[Path]) -> str:
    """Return a digest of the files' contents, independent of their order."""
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(file.read_bytes())
    return digest.hexdigest()


class NumericCode:
    """An entry point, compiled.

    Args:
        name: Name of the entry point, unique in volery.
        compose: Returns the Python function, given the digest of its sources. The function must use the
            digest as a free variable, because numba's cache sees only the source file of the function itself.
            It returns 1, or 0 where a result is not a finite number: a division by zero gives an infinity.
        sources: Source files of what is compiled, constants included; those of ``base`` need not be named.
        arguments: Types of the arguments, in numba's notation, such as ``float64[:,::1]`` and ``int64``.
    """

    def __init__(
        self,
        name: str,
        compose: Callable[[str], Callable[..., int]],
        sources: Iterable[Path],
        arguments: Sequence[str],
    ) -> None:
        self.name = name
        self.arguments = tuple(arguments)
        self._digest = digest_of([Path(__file__), ELEMENTARY, *sources])
        self._function = compose(self._digest)

    @property
    def library(self) -> Path:
        """File of the object code for this machine and these sources."""
        return OBJECT_CODE / f"{self.name}-{platform.machine()}-{self._digest[:16]}.so"

    @property
    def shipped(self) -> bool:
        """Whether there is object code for this machine and these sources."""
        return self.library.exists()

    def bind(self, *arguments: Any) -> Callable[[], None]:
        """Return a function that executes on these arguments.

        Arrays must be contiguous and stay where they are; their contents may change between two calls. The
        returned function raises ``ArithmeticError`` where a result is not finite.

        Raises:
            UsageError: An array has another type or another layout than declared.
        """
        for declared, value in zip(self.arguments, arguments, strict=True):
            _check(self.name, declared, value)
        if self.shipped:
            function, values = self._loaded, (_packed(self.arguments, arguments),)
        else:
            function, values = self._compiled, arguments

        def call(held: Sequence[Any] = arguments) -> None:  # holds the arrays while their addresses are used
            if not function(*values):
                raise ArithmeticError(f"{self.name}: invalid arithmetic, such as a division by zero")

        return call

    @cached_property
    def _loaded(self) -> Callable[..., int]:
        function = ctypes.CDLL(str(self.library))[self.name]
        function.restype = ctypes.c_int64
        return function

    @cached_property
    def _compiled(self) -> Callable[..., int]:
        return cast("Callable[..., int]", self.by_numba(cache=True))

    def by_numba(self, *, cache: bool) -> Any:
        """Return the function compiled by numba for the declared types."""
        from numba import njit  # noqa: PLC0415  # takes 0.4 s, and only the lack of object code needs it
        from numba.core import event  # noqa: PLC0415  # likewise

        entry = _linked(self._function, {}, njit)

        name = self.name

        class Notice(event.Listener):
            """Says that the entry point is compiled and not read from the cache."""

            def on_start(self, started: Any) -> None:
                if started.data["dispatcher"].py_func is entry:
                    getLogger("volery").warning("compiling %s for this computer, once: some 20 s", name)

            def on_end(self, ended: Any) -> None:
                pass

        with event.install_listener("numba:compile", Notice()):
            return njit(f"int64({', '.join(self.arguments)})", cache=cache, error_model="numpy")(entry)


def _linked(function: Callable[..., Any], known: dict[Any, Any], njit: Callable[..., Any]) -> FunctionType:
    """Return a copy of *function* whose numeric globals are compiled by numba, and theirs in turn."""
    source = cast("FunctionType", function)
    scope = dict(source.__globals__)
    for name in source.__code__.co_names:
        value = _numeric_function(scope.get(name))
        if value is not None:
            if value not in known:
                known[value] = njit(_linked(value, known, njit), error_model="numpy")
            scope[name] = known[value]
    return FunctionType(source.__code__, scope, source.__name__, source.__defaults__, source.__closure__)


def parsed(argument: str) -> tuple[str, int]:
    """Return the type of the numbers and the number of dimensions: ``float64[:,::1]`` has two."""
    kind, _, layout = argument.partition("[")
    return kind, max(0, layout.count(":") - 1)


def _check(name: str, declared: str, value: Any) -> None:
    kind, dimensions = parsed(declared)
    if dimensions:
        right = (
            isinstance(value, np.ndarray)
            and value.dtype == np.dtype(kind)
            and value.ndim == dimensions
            and value.flags.c_contiguous
        )
        if not right:
            raise UsageError(f"{name}: an argument must be a contiguous array {declared}")


def _packed(declared: Sequence[str], arguments: Sequence[Any]) -> ctypes.Array[ctypes.c_char]:
    """Return the block of words from which object code reads its arguments: of an array address and sizes."""
    block = b""
    for kind, value in zip(declared, arguments, strict=True):
        if isinstance(value, np.ndarray):
            block += struct.pack(f"{1 + value.ndim}q", value.ctypes.data, *value.shape)
        else:
            block += struct.pack("d" if kind == "float64" else "q", value)
    return ctypes.create_string_buffer(block, len(block))
