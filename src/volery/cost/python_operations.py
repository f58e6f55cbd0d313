"""Operations of CPython: which ones a syntax node executes, and their times on the reference machine.

Operations are distinguished as far as the source text tells them apart and their times differ: an attribute
is looked up, a builtin is called, a function is entered. The types of values are not distinguished. Each rule
gives the operations of one node without its children.

Law: time of code = sum over its operations of (count) x (ns of one). The time of an operation depends on its
neighbours and on the types of its operands, which the law leaves out; that is its error. Operations take
longer in programs than alone in a loop, where a processor predicts every branch. ``in_context`` is this
factor; the times in ``python.yaml`` contain it already. ``CodeLaw`` scales the times to other processors.

Bytecode was rejected as the unit: it changes with every minor version of CPython, and a count would too.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from volery.base.installed import require_extra
from volery.cost.figures import WithProvenance

Operations = Iterator[tuple[str, int]]
"""Names of operations, each with its count."""

ENTER = "enter a function"
ROUND = "round of a loop"
ITEM = "item of a comprehension"
RESUME = "resume a generator"
CATCH = "catch an exception"

TIMED_BUILTINS = (
    "abs", "all", "any", "bool", "bytearray", "bytes", "chr", "dict", "enumerate", "float", "getattr", "int",
    "isinstance", "len", "list", "max", "min", "next", "ord", "range", "repr", "reversed", "round", "set",
    "sorted", "str", "sum", "super", "tuple", "type", "zip",
)  # fmt: skip
"""Builtins with a time of their own, such as ``len()``; others count as any call."""

TIMED_METHODS = (
    "add", "append", "discard", "endswith", "extend", "get", "heappop", "heappush", "index", "insert",
    "isdigit", "items", "join", "keys", "partition", "pop", "popleft", "remove", "setdefault", "split",
    "startswith", "strip", "update", "values",
)  # fmt: skip
"""Methods of Python's own types and functions of its modules, recognised by name: ``.append()``."""

_MATHEMATICS = frozenset(name for name in vars(math) if not name.startswith("_"))

ITERATING_BUILTINS = (
    "all", "any", "bytearray", "bytes", "dict", "list", "max", "min", "set", "sorted", "sum", "tuple",
)  # fmt: skip
"""Builtins that iterate over their only argument."""

ITERATING_METHODS = ("extend", "join", "update")
"""Methods that iterate over their only argument."""


def item_operation(name: str) -> str:
    """Return the operation of one item of an iteration; ``sorted`` has n log2 n of them."""
    return f"item of {name}()"


OPERATIONS: Mapping[str, str] = {
    "load": "a name or a constant",
    "store": "into a name",
    "attribute": "x.y",
    "store attribute": "x.y = ...",
    "subscript": "x[y]",
    "store subscript": "x[y] = ..., del x[y]",
    "slice": "x[y:z], beside the subscript",
    "unpack": "a, b = ..., beside the stores",
    "arithmetic": "x + y and its like",
    "divide": "x / y, x // y, x % y",
    "power": "x ** y",
    "unary": "-x, ~x",
    "compare": "x < y",
    "contains": "x in y",
    "identity": "x is y",
    "branch": "if, and, or, not, the test of while",
    "call": "f(x), beside entering the function",
    "call method": "x.f(y), beside entering the function",
    "call mathematics": "sin(x), math.sin(x)",
    "construct": "Name(x): an object of a class, beside its __init__",
    "construct a named tuple": "Name(x): of a class that the same file derives from NamedTuple",
    "field of a dataclass": "each field that Name(x) sets, of a dataclass of the same file",
    "field of a frozen dataclass": "each field that Name(x) sets, of a frozen one",
    "keyword": "f(y=x), beside the call",
    "star": "f(*x), [*x]",
    "tuple": "(x, y)",
    "list": "[x, y]",
    "set": "{x, y}",
    "dict": "{x: y}",
    "dict item": "each item of a dict display",
    "comprehension": "[... for x in y], beside the items",
    "generator": "(... for x in y), beside the items",
    "format": "each value in an f-string, text % x",
    "join": "an f-string, beside its values",
    "make a function": "def, lambda: when it is executed",
    "make a class": "class: when it is executed",
    "import": "of what has been imported before",
    "with": "a context",
    "raise": "an exception",
    CATCH: "except ... as x",
    "loop": "for: to its first round",
    ROUND: "each round of for, or of while beside its test",
    ITEM: "each item of a comprehension, beside its expressions",
    ENTER: "entering and leaving a function of the file, beside the call",
    RESUME: "each value that a generator gives, beside its expressions",
    **{f"{name}()": "the builtin" for name in TIMED_BUILTINS},
    **{f".{name}()": "the method" for name in TIMED_METHODS},
    **{
        item_operation(name): "each item that it takes from a container"
        for name in (*ITERATING_BUILTINS, *ITERATING_METHODS)
    },
}
"""All operations of a table of costs, with the syntax that each stands for."""


def operations_of(node: ast.AST) -> Operations:
    """Yield the operations of executing ``node`` once, without its children."""
    found = _RULES.get(type(node))
    return found(node) if found else iter(())


def construction_operations(tree: ast.AST) -> dict[str, list[tuple[str, int]]]:
    """Return the operations of constructing an object, by class, where ``__init__`` is generated.

    These are the named tuples and dataclasses in ``tree``.
    """
    classes = [node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    return {klass.name: operations for klass in classes if (operations := _generated_init(klass))}


def _generated_init(made: ast.ClassDef) -> list[tuple[str, int]]:
    if any(ast.unparse(base).endswith("NamedTuple") for base in made.bases):
        return [("construct a named tuple", 1)]
    fields = sum(isinstance(statement, ast.AnnAssign) for statement in made.body)
    for decorator in map(ast.unparse, made.decorator_list):
        if "dataclass" in decorator:
            kind = "frozen dataclass" if "frozen=True" in decorator else "dataclass"
            return [("construct", 1), (ENTER, 1), (f"field of a {kind}", fields)]
    return []


def _always(*names: str) -> Callable[[Any], Operations]:
    return lambda node: iter([(name, 1) for name in names])


def _by_context(load: str, store: str) -> Callable[[Any], Operations]:
    def rule(node: ast.Name | ast.Attribute | ast.Subscript) -> Operations:
        yield (load if isinstance(node.ctx, ast.Load) else store), 1

    return rule


def _binary(node: ast.BinOp | ast.AugAssign) -> Operations:
    if isinstance(node.op, ast.Mod) and _is_text(getattr(node, "left", None)):
        yield "format", 1
    elif isinstance(node.op, (ast.Div, ast.FloorDiv, ast.Mod)):
        yield "divide", 1
    else:
        yield "power" if isinstance(node.op, ast.Pow) else "arithmetic", 1
    if isinstance(node, ast.AugAssign):  # its target is read before it is stored into
        yield _READ[type(node.target)], 1


def _is_text(node: ast.AST | None) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


_READ: Mapping[type[ast.expr], str] = {
    ast.Name: "load",
    ast.Attribute: "attribute",
    ast.Subscript: "subscript",
}


def _compare(node: ast.Compare) -> Operations:
    for operator in node.ops:
        if isinstance(operator, (ast.In, ast.NotIn)):
            yield "contains", 1
        else:
            yield "identity" if isinstance(operator, (ast.Is, ast.IsNot)) else "compare", 1


def _unary(node: ast.UnaryOp) -> Operations:
    if not isinstance(node.operand, ast.Constant):  # -1 is a constant
        yield "branch" if isinstance(node.op, ast.Not) else "unary", 1


def _call(node: ast.Call) -> Operations:
    yield _kind_of_call(node.func), 1
    if node.keywords:
        yield "keyword", len(node.keywords)


def _kind_of_call(called: ast.expr) -> str:
    if isinstance(called, ast.Attribute):
        return _kind_by_name(called.attr) or "call method"
    if isinstance(called, ast.Name):
        return f"{called.id}()" if called.id in TIMED_BUILTINS else _kind_by_name(called.id) or "call"
    return "call"


def _kind_by_name(name: str) -> str:
    if name in TIMED_METHODS:
        return f".{name}()"
    if name in _MATHEMATICS:
        return "call mathematics"
    return "construct" if _is_class(name) else ""


def _is_class(name: str) -> bool:
    """Return whether a name is that of a class by the usual spelling: ``Position``, not ``LIMIT``."""
    bare = name.lstrip("_")
    return bare[:1].isupper() and not bare.isupper()


def _tuple_display(node: ast.Tuple) -> Operations:
    if isinstance(node.ctx, ast.Load):
        if not all(isinstance(part, ast.Constant) for part in node.elts):  # else it is a constant itself
            yield "tuple", 1
    else:
        yield "unpack", 1


def _list_display(node: ast.List) -> Operations:
    yield ("list" if isinstance(node.ctx, ast.Load) else "unpack"), 1


def _dict_display(node: ast.Dict) -> Operations:
    yield "dict", 1
    yield "dict item", len(node.keys)


def _bool_op(node: ast.BoolOp) -> Operations:
    yield "branch", len(node.values) - 1


_RULES: Mapping[type[ast.AST], Callable[[Any], Operations]] = {
    ast.Name: _by_context("load", "store"),
    ast.Constant: _always("load"),
    ast.Attribute: _by_context("attribute", "store attribute"),
    ast.Subscript: _by_context("subscript", "store subscript"),
    ast.Slice: _always("slice"),
    ast.BinOp: _binary,
    ast.AugAssign: _binary,
    ast.UnaryOp: _unary,
    ast.Compare: _compare,
    ast.BoolOp: _bool_op,
    ast.IfExp: _always("branch"),
    ast.If: _always("branch"),
    ast.Assert: _always("branch"),
    ast.Call: _call,
    ast.Starred: _always("star"),
    ast.Tuple: _tuple_display,
    ast.List: _list_display,
    ast.Set: _always("set"),
    ast.Dict: _dict_display,
    ast.ListComp: _always("comprehension"),
    ast.SetComp: _always("comprehension"),
    ast.DictComp: _always("comprehension"),
    ast.GeneratorExp: _always("generator"),
    ast.JoinedStr: _always("join"),
    ast.FormattedValue: _always("format"),
    ast.FunctionDef: _always("make a function", "store"),
    ast.AsyncFunctionDef: _always("make a function", "store"),
    ast.Lambda: _always("make a function"),
    ast.ClassDef: _always("make a class"),
    ast.Import: _always("import"),
    ast.ImportFrom: _always("import"),
    ast.With: _always("with"),
    ast.AsyncWith: _always("with"),
    ast.Raise: _always("raise"),
    ast.For: _always("loop"),
    ast.AsyncFor: _always("loop"),
    ast.Yield: _always(RESUME),
    ast.YieldFrom: _always(RESUME),
    ast.Await: _always(RESUME),
    ast.MatchValue: _always("compare"),
    ast.MatchSingleton: _always("identity"),
    ast.MatchClass: _always("isinstance()"),
}


STEPS_PER_NS = 10
"""Counting is in whole steps: tenths of a nanosecond on the reference machine."""


class OperationTable(WithProvenance):
    """Times by operation, ns, of one interpreter on one machine.

    ``mean_error`` and ``worst_error`` are relative, over ``programs`` that the table was not fitted to.
    """

    interpreter: str
    machine: str
    in_context: float
    programs: int
    mean_error: float
    worst_error: float
    nanoseconds: Mapping[str, float]


@cache
def operation_table() -> OperationTable:
    """Return the table that counted Python is priced by. It was measured on a server processor."""
    text = files("volery.cost").joinpath("python.yaml").read_text(encoding="utf-8")
    require_extra("model", "the table of operations")
    from ruamel.yaml import YAML

    return OperationTable.model_validate(YAML(typ="safe").load(text))
