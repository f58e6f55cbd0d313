"""What Python code costs, without touching the user's file: steps are counted as it runs.

At import each straight run of statements is given one counter: an addition of the run's weight, in *steps*,
to one cell. A step is about one simple operation of the interpreter (``WEIGHTS``); the law that turns steps
into time on a processor is given from above. Counting is deterministic, does not look at the host's clock,
and covers the files that belong to a component; what a library computes inside a call (numpy, networkx) is
not counted and has to be stated with ``volery.add_time``.

Both sides of ``and``, ``or`` and of a conditional expression are counted whichever is taken.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from itertools import repeat
from operator import length_hint
from typing import Any, TypeVar

CELL = "__volery_steps__"
TICK = "__volery_tick_"

WEIGHTS: Mapping[type[ast.AST], int] = {
    ast.Attribute: 1,
    ast.AugAssign: 2,
    ast.Await: 4,
    ast.BinOp: 1,
    ast.BoolOp: 1,
    ast.Call: 3,
    ast.ClassDef: 1000,
    ast.Compare: 1,
    ast.Delete: 1,
    ast.Dict: 7,
    ast.DictComp: 14,
    ast.FormattedValue: 8,
    ast.FunctionDef: 7,
    ast.GeneratorExp: 25,
    ast.IfExp: 1,
    ast.Import: 20,
    ast.ImportFrom: 20,
    ast.Lambda: 7,
    ast.List: 4,
    ast.ListComp: 12,
    ast.Raise: 18,
    ast.Set: 7,
    ast.SetComp: 14,
    ast.Subscript: 1,
    ast.Tuple: 2,
    ast.UnaryOp: 1,
    ast.With: 10,
    ast.Yield: 4,
}
"""Steps by kind of syntax. One step is the addition of two local integers with the store of its result; the
others are rounded ratios to it, as ``bench/counting.py`` measures them on CPython 3.11. Names, constants and
plain stores are less than half a step and count as none.
"""

PER_ROUND = 2
"""Steps that a loop takes for each round beside its body."""

PER_ITEM = 4
"""Steps that a comprehension takes for each item beside its expressions."""

_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
_COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
_DIVERTS = (ast.Return, ast.Break, ast.Continue, ast.Raise)


_PLENTY = 2**62


class Steps:
    """Counts what instrumented code of one run executes. One flow of control runs at a time.

    Statements add to one cell. Inside expressions, where nothing can be assigned, an iterator of ``None`` is
    advanced, one for each weight: that is cheap, false, and tells how often it was done.
    """

    def __init__(self) -> None:
        self._cell = [0]
        self._ticks: dict[int, tuple[repeat[None], int]] = {}

    def take(self) -> int:
        """Steps since it was last asked."""
        steps, self._cell[0] = self._cell[0], 0
        for weight, (tick, left) in self._ticks.items():
            now_left = length_hint(tick)
            if now_left != left:
                steps += weight * (left - now_left)
                self._ticks[weight] = tick, now_left
        return steps

    def instrument(self, tree: ast.Module) -> ast.Module:
        """*tree* with counters; line numbers stay as they were."""
        counters = _Counters()
        counted: ast.Module = counters.visit(tree)
        for weight in counters.ticks:
            self._ticks.setdefault(weight, (repeat(None, _PLENTY), _PLENTY))
        return ast.fix_missing_locations(counted)

    def names(self) -> dict[str, Any]:
        """What a namespace needs for code that was instrumented here to run in it."""
        return {
            CELL: self._cell,
            **{f"{TICK}{weight}__": tick.__next__ for weight, (tick, _) in self._ticks.items()},
        }


def weigh(node: ast.AST) -> int:
    """Steps of executing *node* once, without the bodies that have counters of their own."""
    return WEIGHTS.get(type(node), 0) + sum(weigh(part) for part in _parts(node))


def _parts(node: ast.AST) -> Iterator[ast.AST]:
    if isinstance(node, ast.Lambda):
        return
    if isinstance(node, _COMPREHENSIONS):
        yield node.generators[0].iter  # evaluated once; the rest is counted by the round
        return
    if isinstance(node, (*_FUNCTIONS, ast.ClassDef)):
        yield from node.decorator_list
        return
    for name, value in ast.iter_fields(node):
        if name in ("body", "orelse", "finalbody", "handlers", "cases") and isinstance(value, list):
            continue
        if isinstance(node, ast.While) and name == "test":
            continue  # evaluated in each round
        yield from (
            item for item in (value if isinstance(value, list) else [value]) if isinstance(item, ast.AST)
        )


class _Counters(ast.NodeTransformer):
    """Puts a counter before each straight run of statements and into each comprehension and lambda.

    ``ticks`` are the weights of those that are inside expressions.
    """

    def __init__(self) -> None:
        self.ticks: set[int] = set()

    def _block(self, body: list[ast.stmt], extra: int = 0) -> list[ast.stmt]:
        """*body* cut into straight runs: a new one starts behind each statement that may leave the block."""
        counted: list[ast.stmt] = []
        run: list[ast.stmt] = []
        for statement in body:
            run.append(statement)
            if _may_leave(statement):
                counted += self._run(run, extra)
                run, extra = [], 0
        return counted + (self._run(run, extra) if run else [])

    def _run(self, statements: list[ast.stmt], extra: int) -> list[ast.stmt]:
        steps = extra + sum(weigh(statement) for statement in statements)
        visited: list[ast.stmt] = [self.visit(statement) for statement in statements]
        return [_add(steps, statements[0]), *visited] if steps else visited

    def visit_Module(self, node: ast.Module) -> ast.Module:
        head = _prologue(node.body)
        node.body = node.body[:head] + self._block(node.body[head:])
        return node

    def _visit_function(self, node: ast.FunctionDef | ast.AsyncFunctionDef) -> ast.AST:
        head = 1 if ast.get_docstring(node, clean=False) is not None else 0
        node.body = node.body[:head] + self._block(node.body[head:])
        return node

    visit_FunctionDef = visit_AsyncFunctionDef = _visit_function  # noqa: N815 (ast's naming)

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        node.body = [self.visit(statement) for statement in node.body]
        return node

    def generic_visit(self, node: ast.AST) -> ast.AST:
        """Bodies of compound statements become blocks; the rest is searched for lambdas and the like."""
        extra = 0
        if isinstance(node, (ast.For, ast.AsyncFor)):
            extra = PER_ROUND
        elif isinstance(node, ast.While):
            extra = PER_ROUND + weigh(node.test)
        for name, value in ast.iter_fields(node):
            if isinstance(value, list) and value and isinstance(value[0], ast.stmt):
                setattr(node, name, self._block(value, extra if name == "body" else 0))
            elif isinstance(value, list):
                setattr(
                    node, name, [self.visit(item) if isinstance(item, ast.AST) else item for item in value]
                )
            elif isinstance(value, ast.AST):
                setattr(node, name, self.visit(value))
        return node

    def visit_Lambda(self, node: ast.Lambda) -> ast.AST:
        node.body = self._ticking(weigh(node.body) + 1, self.visit(node.body))
        return node

    def _visit_comprehension(self, node: Any) -> ast.AST:
        steps = PER_ITEM + sum(
            weigh(part) for name in ("elt", "key", "value") if (part := getattr(node, name, None)) is not None
        )
        for number, generator in enumerate(node.generators):
            inner = 0 if number == 0 else weigh(generator.iter)
            tests = sum(weigh(test) for test in generator.ifs)
            if generator.ifs:
                generator.ifs[0] = self._ticking(PER_ITEM + inner + tests, self.visit(generator.ifs[0]))
            else:
                steps += inner
            generator.iter = self.visit(generator.iter)
        last = "value" if isinstance(node, ast.DictComp) else "elt"
        setattr(node, last, self._ticking(steps, self.visit(getattr(node, last))))
        return node  # type: ignore[no-any-return] # it is one of four kinds of node

    def _ticking(self, steps: int, expression: ast.expr) -> ast.expr:
        """``(__volery_tick_7__() or expression)``: the tick gives ``None``."""
        self.ticks.add(steps)
        tick = ast.Call(ast.Name(f"{TICK}{steps}__", ast.Load()), [], [])
        return _at(ast.BoolOp(ast.Or(), [tick, expression]), expression)

    visit_ListComp = visit_SetComp = _visit_comprehension  # noqa: N815 (ast's naming)
    visit_DictComp = visit_GeneratorExp = _visit_comprehension  # noqa: N815 (ast's naming)


def _may_leave(statement: ast.stmt) -> bool:
    """Whether what follows *statement* in its block may be left out."""
    if isinstance(statement, (*_FUNCTIONS, ast.ClassDef)):
        return False
    if isinstance(statement, _DIVERTS):
        return True
    return any(_may_leave(child) for child in _statements_in(statement))


def _statements_in(statement: ast.stmt) -> Iterator[ast.stmt]:
    for child in ast.iter_child_nodes(statement):
        if isinstance(child, ast.stmt):
            yield child
        elif isinstance(child, (ast.ExceptHandler, ast.match_case)):
            yield from child.body


def _prologue(body: list[ast.stmt]) -> int:
    """How many leading statements must stay first: the docstring and ``from __future__`` imports."""
    count = 0
    for number, statement in enumerate(body):
        docstring = (
            number == 0 and isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
        )
        if not docstring and not (isinstance(statement, ast.ImportFrom) and statement.module == "__future__"):
            break
        count += 1
    return count


def _add(steps: int, place: ast.stmt) -> ast.stmt:
    """``__volery_steps__[0] += steps``."""
    cell = ast.Subscript(ast.Name(CELL, ast.Load()), ast.Constant(0), ast.Store())
    return _at(ast.AugAssign(cell, ast.Add(), ast.Constant(steps)), place)


Node = TypeVar("Node", ast.stmt, ast.expr)


def _at(new: Node, place: ast.AST) -> Node:
    return ast.copy_location(new, place)
