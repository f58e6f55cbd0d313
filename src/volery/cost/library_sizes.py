"""What the time of a library call depends on: its size, and features that are priced beside it.

A size places a call between the measured points of its entry. A feature is a count that takes time of its
own: inner loops that numpy starts, elements that a mask selects, values of a JSON text. Both are computed
from arguments and result alone, never from a clock, so that the same run has the same times.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import cache
from math import sqrt
from typing import Any

Values = tuple[Any, ...]

PAGE_WORDS = 512
"""Words of 8 bytes in a page of memory."""
_KEPT_WORDS, _RETURNED_WORDS = 1 << 14, 3 << 16

_DECIMALS = re.compile(r"\.[0-9]+")


def call_size(kind: str, arguments: Values, result: Any) -> float:
    """Return the size of a call. See ``SIZES``."""
    return float(SIZES[kind](arguments, result))


def call_feature(name: str, arguments: Values, result: Any) -> float:
    """Return how often a call has a feature. See ``FEATURES``."""
    return float(FEATURES[name](arguments, result))


def _array_elements(value: Any) -> int:
    size = getattr(value, "size", None)
    return size if isinstance(size, int) else 0


def _words(value: Any) -> int:
    """Return the elements of an array in units of 8 bytes, or of a list."""
    size = getattr(value, "itemsize", 8)
    return _elements(value) * (size if isinstance(size, int) else 8) // 8 or 1


def _elements(value: Any) -> int:
    """Return the elements of an array, or of a list of lists as their product."""
    if isinstance(value, (list, tuple)) and value:
        inner = value[0]
        return len(value) * (len(inner) if isinstance(inner, (list, tuple)) else 1)
    return max(_array_elements(value), 1)


def _arrays(values: Values) -> list[Any]:
    """Return the arrays of one dimension or more."""
    return [
        value for value in values if type(value).__module__ == "numpy" and getattr(value, "shape", ()) != ()
    ]


def _products(arguments: Values, result: Any) -> float:
    """Return the multiplications of a product of two arrays."""
    if len(arguments) < 2:
        return 1.0
    shape = tuple(getattr(arguments[1], "shape", ()))
    columns = float(shape[-1]) if len(shape) > 1 else 1.0
    return max(_array_elements(arguments[0]) * columns, 1.0)


def _squares(arguments: Values, result: Any) -> float:
    """Return the elements of a matrix times its columns."""
    columns = getattr(arguments[0], "shape", ())[-1:] if arguments else ()
    return float(_elements(arguments[0]) * (columns[0] if columns else 1)) if arguments else 1.0


def _cube(arguments: Values, result: Any) -> float:
    """Return the work of a product of square matrices: the elements of one to the power 3/2."""
    elements = max(map(_elements, arguments), default=1)
    return elements * sqrt(elements)


def _outcome(arguments: Values, result: Any) -> int:
    """Return the elements of the result: what a picture becomes."""
    return max(_array_elements(result), 1)


def _window(arguments: Values, result: Any) -> int:
    """Return the elements of a picture times what the side of a filter's window has beyond 3."""
    sides = [max(argument) for argument in arguments[1:2] if isinstance(argument, tuple) and argument]
    sides += [max(array.shape) for array in _arrays(arguments[1:2])]
    sides += [argument for argument in arguments[1:2] if isinstance(argument, int)]
    return _elements(arguments[0]) * max(max(sides, default=3) - 3, 0) if arguments else 0


def _count(value: Any) -> int:
    """Return the points of an array or of an object that states its size."""
    if getattr(value, "shape", ()):
        return len(value)
    size = getattr(value, "size", 0)
    return int(size() if callable(size) else 0)


def _pairs(arguments: Values, result: Any) -> int:
    """Return the pairs of rows of two arrays."""
    counts = [len(array) for array in _arrays(arguments)[:2]]
    return counts[0] * counts[-1] if counts else 1


def _variables(arguments: Values, result: Any) -> int:
    """Return the variables of a solver, which is made or whose method is called."""
    solvers = (getattr(one, "values", None) for one in (*arguments, result) if not isinstance(one, dict))
    return max((_count(values()) for values in solvers if callable(values)), default=1) or 1


def _candidates(arguments: Values, result: Any) -> int:
    """Return what was found in a picture, and what was looked at for it."""
    if not isinstance(result, tuple) or not result:
        return _rows(arguments, result)
    return sum(len(one) for one in (result[0], result[-1]) if hasattr(one, "__len__"))


def _texts(values: Values) -> list[str | bytes | bytearray]:
    return [value for value in values if isinstance(value, (str, bytes, bytearray))]


def _text(arguments: Values, result: Any) -> int:
    return max(map(len, _texts((*arguments, result))), default=1)


def _fields(arguments: Values, result: Any) -> int:
    """Return the values of a record that is packed or unpacked."""
    return max(len(arguments), len(result) if isinstance(result, tuple) else 1)


SIZES: Mapping[str, Callable[[Values, Any], float]] = {
    "elements": lambda arguments, result: max(map(_words, (*arguments, result))),
    "items": lambda arguments, result: max(map(_elements, (*arguments, result))),
    "products": _products,
    "cube": _cube,
    "squares": _squares,
    "text": _text,
    "fields": _fields,
    "outcome": _outcome,
    "pairs": _pairs,
    "points": lambda arguments, result: max(map(_count, arguments), default=1) or 1,
    "variables": _variables,
}
"""Sizes: elements of the largest array among arguments and result, in units of 8 bytes, because what takes
the time are vectors of so many bytes; elements whatever their type (``items``); multiplications of a matrix
product; elements of a matrix to the power of 1.5 (``cube``), or times its columns (``squares``); length of
the longest text; values of a record; elements of the result (``outcome``); pairs of rows of two arrays;
points of the largest cloud; variables of a solver."""


def _loops(arguments: Values, result: Any) -> int:
    """Return the inner loops beyond the first: numpy joins axes only where all operands lie without a gap."""
    of_arguments, given = _arrays(arguments), _arrays((result,))
    arrays = of_arguments + given
    if not arrays:
        return 0
    largest = max(arrays, key=_array_elements)
    elements = _array_elements(largest)
    if len(largest.shape) < 2 or not elements:
        return 0
    reduced = not given or _array_elements(result) < elements
    together = [largest] if reduced else arrays
    if reduced and given:
        return elements // (largest.shape[-1] or 1) - 1
    if all(one.shape == largest.shape and one.flags.c_contiguous for one in together):
        return 0
    return elements // _joined(together, largest.shape) - 1


def _joined(arrays: list[Any], shape: tuple[int, ...]) -> int:
    """Return the elements of an inner loop over arrays that are broadcast to a shape."""
    steps = []
    for one in arrays:
        missing = len(shape) - len(one.shape)
        own = [0 if length == 1 else step for length, step in zip(one.shape, one.strides, strict=True)]
        steps.append([0] * missing + own)
    inner = shape[-1]
    for axis in range(len(shape) - 2, -1, -1):
        if any(step[axis] != step[axis + 1] * shape[axis + 1] for step in steps):
            break
        inner *= shape[axis]
    return max(inner, 1)


def _strided(arguments: Values, result: Any) -> int:
    """Return the elements that are read with gaps between them."""
    return sum(
        _array_elements(array)
        for array in _arrays(arguments)
        if array.shape[-1] > 1 and array.strides[-1] not in (array.itemsize, 0)
    )


def _cast(arguments: Values, result: Any) -> int:
    """Return the elements that are converted to another type first."""
    arrays = _arrays(arguments)
    if not arrays:
        return 0
    kind = getattr(result, "dtype", None)
    if kind is None or kind.kind == "b":
        kind = max(arrays, key=lambda one: (one.dtype.kind == "f", one.itemsize)).dtype
    return sum(_array_elements(array) for array in arrays if array.dtype != kind)


def _selected(arguments: Values, result: Any) -> int:
    """Return the elements that a mask or a search selects."""
    if isinstance(result, tuple):
        return sum(map(_array_elements, result))
    if result is not None:
        return _array_elements(result)
    return int(arguments[0].sum()) if _arrays(arguments[:1]) else 0


def _rows(arguments: Values, result: Any) -> int:
    """Return the rows that an index or a mask selects, of an array of several dimensions."""
    return len(result) if len(getattr(result, "shape", ())) > 1 else 0


def _coordinates(arguments: Values, result: Any) -> int:
    """Return the elements of a mask of several dimensions, whose places are given for each dimension."""
    masks = [array for array in _arrays(arguments) if len(array.shape) > 1]
    return sum(map(_array_elements, masks)) if isinstance(result, tuple) else 0


def _longest(arguments: Values, result: Any) -> str:
    texts = [one for one in (*arguments, result) if isinstance(one, str)]
    return max(texts, key=len, default="")


def _values(arguments: Values, result: Any) -> int:
    text = _longest(arguments, result)
    return text.count(",") + text.count(":")


def _part_packed(arguments: Values, result: Any) -> float:
    """Return the bytes between which a packer finds matches, but poor ones: most where half remains."""
    lengths = [len(text) for text in _texts((*arguments, result))]
    if len(lengths) < 2:
        return 0.0
    long, short = max(lengths), min(lengths)
    return 4.0 * short * (long - short) / max(long, 1)


@cache
def _scans(pattern: str) -> bool:
    """Return whether a search tries to match at each character, for want of a literal beginning."""
    bare = re.sub(r"^(\(\?P<\w+>|\(\?:|\()+", "", pattern)
    return bare.startswith(("\\d", "\\w", "\\s", "\\S", "\\D", "\\W", ".", "["))


def _pattern(arguments: Values) -> str:
    first = arguments[0] if arguments else ""
    pattern = getattr(first, "pattern", first)
    return pattern if isinstance(pattern, str) else ""


def _scanned(arguments: Values, result: Any) -> int:
    """Return the characters at which a pattern without a literal beginning is tried."""
    if not _scans(_pattern(arguments)):
        return 0
    end = getattr(result, "end", None)
    return end() if callable(end) else max(map(len, _texts(arguments[1:])), default=0)


def _matched(arguments: Values, result: Any) -> int:
    end = getattr(result, "end", None)
    return end() if callable(end) else 0


def new_pages(result: Any) -> int:
    """Return the pages of a new array that the system has to supply.

    The C library keeps smaller pieces; that larger ones are returned at once, is part of the measured points.
    """
    if type(result).__module__ != "numpy" or getattr(result, "base", result) is not None:
        return 0
    words = _words(result)
    return words // PAGE_WORDS if _KEPT_WORDS <= words < _RETURNED_WORDS else 0


def _removed(arguments: Values, result: Any) -> int:
    """Return by how many characters the text of a substitution became longer or shorter."""
    texts = _texts(arguments[1:])
    return abs(len(texts[-1]) - len(result)) if texts and isinstance(result, str) else 0


FEATURES: Mapping[str, Callable[[Values, Any], float]] = {
    "loops": _loops,
    "strided": _strided,
    "cast": _cast,
    "selected": _selected,
    "rows": _rows,
    "coordinates": _coordinates,
    "outputs": lambda arguments, result: _array_elements(result),
    "values": _values,
    "floats": lambda arguments, result: _longest(arguments, result).count("."),
    "decimals": lambda arguments, result: sum(map(len, _DECIMALS.findall(_longest(arguments, result)))),
    "lines": lambda arguments, result: _longest(arguments, result).count("\n"),
    "part packed": _part_packed,
    "scanned": _scanned,
    "found": lambda arguments, result: len(result) if isinstance(result, list) else 0,
    "matched": _matched,
    "removed": _removed,
    "candidates": _candidates,
    "window": _window,
}
"""Features: inner loops of numpy beyond the first; elements read with gaps, converted first, selected; rows
that are selected; elements that are searched in several dimensions; elements of the result; commas and colons
of a text, its points, the digits after them, its lines; bytes that are searched for matches (n · 4r(1 - r)
with the ratio r of the packed length); characters that a pattern is tried at, results of it, characters of
its match, characters that a substitution removes, what was found in a picture and what was looked at for it,
elements of a picture times what the side of a filter's window has beyond 3.
``wrapped``, which is no property of the arguments, is 1
for ``numpy.sum(x)`` where the points are of the method ``x.sum()``."""
