"""Expressions of launch files, evaluated over their syntax tree: no code is executed.

``$(eval ...)``, ``PythonExpression`` and Python launch files share the operators and the methods of texts,
lists and mappings. What is not known stays ``UnknownValue`` with a reason, in whatever is made of it.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import PurePath
from typing import Any

from volery.exchange.launch.launch_reading import UnresolvedError

LONGEST = 1 << 20
"""Longest text or list that an expression may make."""
GREATEST_POWER, GREATEST = 64, 1 << 512
"""Greatest exponent, and greatest factor of a product."""
MOST_STEPS = 200_000
"""Most expressions and statements that are evaluated for one file: loops end."""


class UnknownValue:
    """A value that is not known without executing something; *why* says so."""

    def __init__(self, why: str) -> None:
        self.why = why


def _words(words: str) -> frozenset[str]:
    return frozenset(words.split())


def _range(*bounds: int) -> list[int]:
    made = range(*bounds)
    if len(made) > MOST_STEPS:
        raise UnresolvedError(f"a loop of {len(made)} turns")
    return list(made)


_BINARY: Mapping[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
    ast.BitOr: operator.or_,
    ast.BitAnd: operator.and_,
}
_COMPARED: Mapping[type, Callable[[Any, Any], Any]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.In: lambda one, other: one in other,
    ast.NotIn: lambda one, other: one not in other,
    ast.Is: operator.is_,
    ast.IsNot: operator.is_not,
}
_UNARY: Mapping[type, Callable[[Any], Any]] = {
    ast.Not: operator.not_,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_METHODS: Mapping[type, frozenset[str]] = {
    str: _words(
        "join split rsplit strip lstrip rstrip lower upper title capitalize replace startswith endswith "
        "partition rpartition removeprefix removesuffix isdigit isalpha format splitlines find count"
    ),
    list: _words("append extend insert index count copy pop reverse"),
    dict: _words("get items keys values update copy setdefault pop"),
    PurePath: _words("joinpath with_name with_suffix as_posix is_absolute"),
}
_ATTRIBUTES = frozenset(("parent", "name", "stem", "suffix", "parts"))
FUNCTIONS: Mapping[str, Any] = {
    "str": lambda value="": str(value),
    "int": int,
    "float": float,
    "bool": bool,
    "len": len,
    "abs": abs,
    "min": min,
    "max": max,
    "round": round,
    "sum": sum,
    "list": lambda value=(): list(value),
    "tuple": lambda value=(): tuple(value),
    "dict": dict,
    "set": lambda value=(): list(dict.fromkeys(value)),
    "sorted": sorted,
    "reversed": lambda value: list(reversed(value)),
    "enumerate": lambda value, start=0: list(enumerate(value, start)),
    "zip": lambda *values: list(zip(*values, strict=False)),
    "any": any,
    "all": all,
    "range": _range,
    "True": True,
    "False": False,
    "None": None,
    "true": True,
    "false": False,
}
"""What expressions can name: functions of Python without effects."""

MATHEMATICS: Mapping[str, Any] = {
    name: getattr(math, name)
    for name in ("pi", "sin", "cos", "tan", "sqrt", "radians", "degrees", "floor", "ceil", "atan2", "fabs")
}
"""What ``$(eval ...)`` and ``PythonExpression`` can name, too."""


class Evaluator:
    """Evaluates expressions with the values of *names*."""

    def __init__(self, names: Mapping[str, Any]) -> None:
        self.names: dict[str, Any] = {**FUNCTIONS, **names}
        self.steps = 0

    def value(self, node: ast.expr) -> Any:
        """Return the value of an expression; an ``UnknownValue`` if it has none here."""
        self.step()
        evaluate = getattr(self, f"_{type(node).__name__.lower()}", None)
        if evaluate is None:
            return UnknownValue(f"`{ast.unparse(node)}` is not evaluated")
        try:
            return evaluate(node)
        except UnresolvedError as error:
            return UnknownValue(str(error))
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            return UnknownValue(f"`{_short(node)}`: {error}")

    def step(self) -> None:
        """Count an expression or a statement. Raises ``UnresolvedError`` if there are too many."""
        self.steps += 1
        if self.steps > MOST_STEPS:
            raise RecursionError("it computes for too long")

    def _constant(self, node: ast.Constant) -> Any:
        return node.value

    def _name(self, node: ast.Name) -> Any:
        if node.id not in self.names:
            return UnknownValue(f"{node.id!r} is not known")
        return self.names[node.id]

    def _list(self, node: ast.List) -> Any:
        made: list[Any] = []
        for each in node.elts:
            if isinstance(each, ast.Starred):
                spread = self.value(each.value)
                made += spread if isinstance(spread, list | tuple) else [spread]
            else:
                made.append(self.value(each))
        return made

    _tuple = _set = _list

    def _dict(self, node: ast.Dict) -> Any:
        made: dict[Any, Any] = {}
        for key, value in zip(node.keys, node.values, strict=True):
            below = self.value(value)
            if key is None:
                made |= below if isinstance(below, dict) else {}
            else:
                made[_hashable(self.value(key))] = below
        return made

    def _joinedstr(self, node: ast.JoinedStr) -> Any:
        return self.joined([self.value(each) for each in node.values])

    def _formattedvalue(self, node: ast.FormattedValue) -> Any:
        value = self.value(node.value)
        if isinstance(value, UnknownValue) or node.format_spec is None:
            return value
        return _formatted("{:" + str(self.value(node.format_spec)) + "}", value)

    def joined(self, parts: list[Any]) -> Any:
        """Return the parts of a formatted text as one text."""
        unknown = next((each for each in parts if isinstance(each, UnknownValue)), None)
        return unknown or "".join(map(str, parts))

    def _binop(self, node: ast.BinOp) -> Any:
        return self.combined(type(node.op), self.value(node.left), self.value(node.right))

    def combined(self, kind: type, left: Any, right: Any) -> Any:
        """Return the result of a binary operator."""
        for each in (left, right):
            if isinstance(each, UnknownValue):
                return each
        if isinstance(left, PurePath) and kind is ast.Div:
            return left / str(right)
        if kind not in _BINARY:
            return UnknownValue(f"the operator {kind.__name__} is not evaluated")
        made = _too_great(kind, left, right) or _BINARY[kind](left, right)
        too_long = isinstance(made, str | list | tuple) and len(made) > LONGEST
        return UnknownValue("a text or a list that is too long") if too_long else made

    def _unaryop(self, node: ast.UnaryOp) -> Any:
        value = self.value(node.operand)
        apply = _UNARY.get(type(node.op))
        return (
            value
            if isinstance(value, UnknownValue)
            else apply(value)
            if apply
            else UnknownValue("an operator")
        )

    def _boolop(self, node: ast.BoolOp) -> Any:
        value: Any = None
        for each in node.values:
            value = self.value(each)
            if isinstance(value, UnknownValue) or bool(value) is isinstance(node.op, ast.Or):
                break
        return value

    def _compare(self, node: ast.Compare) -> Any:
        left = self.value(node.left)
        for kind, each in zip(node.ops, node.comparators, strict=True):
            right = self.value(each)
            for value in (left, right):
                if isinstance(value, UnknownValue):
                    return value
            if not _COMPARED[type(kind)](left, right):
                return False
            left = right
        return True

    def _ifexp(self, node: ast.IfExp) -> Any:
        test = self.value(node.test)
        return test if isinstance(test, UnknownValue) else self.value(node.body if test else node.orelse)

    def _subscript(self, node: ast.Subscript) -> Any:
        value, key = self.value(node.value), self.value(node.slice)
        for each in (value, key):
            if isinstance(each, UnknownValue):
                return each
        return value[key]

    def _slice(self, node: ast.Slice) -> Any:
        bounds = [None if each is None else self.value(each) for each in (node.lower, node.upper, node.step)]
        return slice(*bounds)

    def _listcomp(self, node: ast.ListComp) -> Any:
        return self._comprehended(node.generators, lambda: self.value(node.elt))

    _generatorexp = _setcomp = _listcomp

    def _dictcomp(self, node: ast.DictComp) -> Any:
        return dict(
            self._comprehended(node.generators, lambda: (self.value(node.key), self.value(node.value)))
        )

    def _comprehended(self, generators: list[ast.comprehension], make: Callable[[], Any]) -> list[Any]:
        if not generators:
            return [make()]
        first, *rest = generators
        values = self.value(first.iter)
        if isinstance(values, UnknownValue):
            raise UnresolvedError(values.why)
        made: list[Any] = []
        for each in list(values):
            self.assign(first.target, each)
            if all(_holds(self.value(test)) for test in first.ifs):
                made += self._comprehended(rest, make)
        return made

    def assign(self, target: ast.expr, value: Any) -> None:
        """Give *value* to a name, to several, or to an entry of a mapping or a list."""
        if isinstance(target, ast.Name):
            self.names[target.id] = value
        elif isinstance(target, ast.Tuple | ast.List):
            known = isinstance(value, list | tuple) and len(value) == len(target.elts)
            values = value if known else [UnknownValue("it is not known")] * len(target.elts)
            for each, part in zip(target.elts, values, strict=True):
                self.assign(each, part)
        elif isinstance(target, ast.Subscript):
            owner, key = self.value(target.value), self.value(target.slice)
            if isinstance(owner, dict | list) and not isinstance(key, UnknownValue):
                owner[key] = value

    def _attribute(self, node: ast.Attribute) -> Any:
        return self.attribute(self.value(node.value), node.attr)

    def attribute(self, owner: Any, name: str) -> Any:
        """Return an attribute of a value: a method without effects outside it, or a part of a path."""
        if isinstance(owner, PurePath) and name in _ATTRIBUTES:
            return getattr(owner, name)
        for kind, methods in _METHODS.items():
            if isinstance(owner, kind) and name in methods:
                return _BOUNDED.get(name, getattr)(owner, name)
        if isinstance(owner, UnknownValue):
            return owner
        return UnknownValue(f"`.{name}` is not evaluated")

    def _call(self, node: ast.Call) -> Any:
        function = self.value(node.func)
        arguments = self._list(ast.List(elts=node.args))
        named = {}
        for each in node.keywords:
            value = self.value(each.value)
            if each.arg is not None:
                named[each.arg] = value
            elif isinstance(value, dict):
                named |= value
        return self.call(function, arguments, named, node)

    def call(self, function: Any, arguments: list[Any], named: dict[str, Any], node: ast.Call) -> Any:
        """Return the result of a call to a value that ``value`` returned."""
        if isinstance(function, UnknownValue):
            return function
        if not callable(function):
            return UnknownValue(f"`{_short(node)}` is not evaluated")
        stored = isinstance(getattr(function, "__self__", None), list | dict)
        for each in () if stored else (*arguments, *named.values()):
            if isinstance(each, UnknownValue):
                return each
        return function(*arguments, **named)


def _too_great(kind: type, left: Any, right: Any) -> UnknownValue | None:
    """Return why an operation is refused whose result would be too great, or None."""
    numbers = isinstance(left, int | float) and isinstance(right, int | float)
    if kind is ast.Pow and not (numbers and abs(right) <= GREATEST_POWER and abs(left) <= LONGEST):
        return UnknownValue("a power that is too great")
    if kind is ast.Mult and not numbers and _size(left) * _size(right) > LONGEST:
        return UnknownValue("a text or a list that is too long")
    if kind is ast.Mod and isinstance(left, str) and _WIDE.search(left):
        return UnknownValue("a text that is too long")
    if kind is ast.Mult and numbers and max(abs(left), abs(right)) > GREATEST:
        return UnknownValue("a number that is too great")
    return None


def _formatted(pattern: str, *values: Any, **named: Any) -> str:
    """Return ``str.format``'s text; without attributes of values, and without wide fields."""
    if _WIDE.search(pattern) or re.search(r"\{\w*[.\[]", pattern):
        raise UnresolvedError(f"the format {pattern[:40]!r} is not evaluated")
    return pattern.format(*values, **named)


def _replacing(owner: str, name: str) -> Callable[..., Any]:
    def replace(old: str, new: str, count: int = -1) -> str:
        if len(owner) * max(len(new), 1) > LONGEST:
            raise UnresolvedError("a text that is too long")
        return owner.replace(old, new, count)

    return replace


_BOUNDED: Mapping[str, Callable[[Any, str], Any]] = {
    "format": lambda owner, name: partial(_formatted, owner),
    "replace": _replacing,
}
_WIDE = re.compile(r"\d{4}|[*{]\s*\{|%\*")
"""A field of a format that may be wide."""


def _holds(value: Any) -> bool:
    if isinstance(value, UnknownValue):
        raise UnresolvedError(value.why)
    return bool(value)


def _hashable(key: Any) -> Any:
    return key if isinstance(key, str | int | float | bool | None) else str(key)


def _size(value: Any) -> int:
    return len(value) if isinstance(value, str | list | tuple) else abs(value) if type(value) is int else 1


def _short(node: ast.AST) -> str:
    text = " ".join(ast.unparse(node).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def evaluated(text: str, names: Mapping[str, Any]) -> Any:
    """Return the value of an expression's text. Raises ``UnresolvedError``."""
    try:
        tree = ast.parse(text.strip(), mode="eval")
        value = Evaluator({**MATHEMATICS, **names}).value(tree.body)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise UnresolvedError(f"the expression {text.strip()!r} cannot be evaluated: {error}") from None
    if isinstance(value, UnknownValue):
        raise UnresolvedError(f"the expression {text.strip()!r}: {value.why}")
    return value
