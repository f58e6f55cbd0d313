"""What Python code costs, without touching the user's file: steps are counted as it runs.

At import each straight run of statements is given one counter: an addition of the run's weight, in *steps*,
to one cell (``instrumenting``). A step is a tenth of a nanosecond on the machine that the table of costs was
measured on; the law that turns steps into time on a processor is given from above. Counting is deterministic,
does not look at the host's clock, and covers the files that belong to a component; what a library computes
inside a call (numpy, networkx) is not counted and has to be stated with ``volery.add_time``.

Puts counters into a syntax tree: one addition for each straight run of statements.

What is done a number of times that only the run can tell (the items of a comprehension, a lambda, the second
operand of ``and``) gets a counter of its own inside the expression, if it is worth one: operands that call
nothing are counted with their statement whether they are taken or not.
"""

from __future__ import annotations

import ast
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import repeat
from operator import length_hint
from typing import Any, TypeVar

from volery.cost.python_operations import (
    CATCH,
    ENTER,
    ITEM,
    ITERATING_BUILTINS,
    ITERATING_METHODS,
    OPERATIONS,
    RESUME,
    ROUND,
    STEPS_PER_NS,
    construction_operations,
    item_operation,
    operation_table,
    operations_of,
)

CELL = "__volery_steps__"
TICK = "__volery_tick_"
TAKEN = "__volery_taken_by_"

_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
_COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
_DIVERTS = (ast.Return, ast.Break, ast.Continue, ast.Raise)
_BODIES = ("body", "orelse", "finalbody", "handlers", "cases")
_WORTH_A_TICK = (ast.Call, *_COMPREHENSIONS)

_LEADING_BITS = 5


class Weights:
    """What operations and pieces of syntax weigh, in steps. ``weights["load"]`` is that of an operation.

    Those of counters inside expressions keep five leading bits (3 %), so that not every expression needs an
    iterator of its own, unless weights are to be *exact*.
    """

    def __init__(self, steps: Mapping[str, float], exact: bool = False) -> None:
        self._steps = steps
        self._exact = exact
        self._made: Mapping[str, list[tuple[str, int]]] = {}

    def look_at(self, tree: ast.Module) -> None:
        """From now on *tree* is weighed: whose objects does it make?"""
        self._made = construction_operations(tree)

    def __getitem__(self, operation: str) -> float:
        return self._steps[operation]

    def of(self, node: ast.AST) -> float:
        """Executing *node* once, without what has a counter of its own."""
        own = sum(self._steps[name] * times for name, times in self._operations(node))
        return own + sum(self.of(part) for part in _executed_parts(node))

    def of_tick(self, steps: float) -> int:
        """The weight of a counter inside an expression that is to count *steps*."""
        whole = round(steps)
        unit = 1 if self._exact else 1 << max(0, whole.bit_length() - _LEADING_BITS)
        return whole if unit == 1 else round(whole / unit) * unit

    def _operations(self, node: ast.AST) -> Iterable[tuple[str, int]]:
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in self._made:
            return self._made[node.func.id]
        return operations_of(node)


def _executed_parts(node: ast.AST) -> Iterator[ast.AST]:
    """What is executed with *node*, once each time that it is."""
    if isinstance(node, ast.Lambda):
        return
    if isinstance(node, _COMPREHENSIONS):
        yield node.generators[0].iter
    elif isinstance(node, (*_FUNCTIONS, ast.ClassDef)):
        yield from node.decorator_list
    elif isinstance(node, (ast.For, ast.AsyncFor)):
        yield node.iter
    elif isinstance(node, ast.AnnAssign):
        yield from (node.target, node.value) if node.value else ()
    elif isinstance(node, ast.BoolOp):
        yield node.values[0]
        yield from (value for value in node.values[1:] if not _worth_a_tick(value))
    elif isinstance(node, ast.IfExp):
        yield node.test
        yield from (value for value in (node.body, node.orelse) if not _worth_a_tick(value))
    elif not isinstance(node, ast.While) and not _is_remark(node):
        yield from _fields(node)


def _fields(node: ast.AST) -> Iterator[ast.AST]:
    for name, value in ast.iter_fields(node):
        if name in _BODIES and isinstance(value, list):
            continue
        yield from (
            item for item in (value if isinstance(value, list) else [value]) if isinstance(item, ast.AST)
        )


def _is_remark(node: ast.AST) -> bool:
    """A constant that stands alone, which the compiler drops."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _worth_a_tick(operand: ast.expr) -> bool:
    return any(isinstance(part, _WORTH_A_TICK) for part in ast.walk(operand))


def with_counters(tree: ast.Module, weights: Weights) -> tuple[ast.Module, set[int]]:
    """*tree* with counters, and the weights of those that are inside expressions. Lines stay as they were."""
    weights.look_at(tree)
    counters = _Counters(weights)
    counted: ast.Module = counters.visit(tree)
    return ast.fix_missing_locations(counted), counters.ticks


class _Counters(ast.NodeTransformer):
    """``ticks`` are the weights of the counters that are inside expressions."""

    def __init__(self, weights: Weights) -> None:
        self._weights = weights
        self.ticks: set[int] = set()

    # -- statements

    def _block(self, body: list[ast.stmt], extra: float = 0) -> list[ast.stmt]:
        """*body* cut into straight runs: a new one starts behind each statement that may leave the block."""
        counted: list[ast.stmt] = []
        run: list[ast.stmt] = []
        for statement in body:
            run.append(statement)
            if _may_leave(statement):
                counted += self._run(run, extra)
                run, extra = [], 0
        return counted + (self._run(run, extra) if run else [])

    def _run(self, statements: list[ast.stmt], extra: float) -> list[ast.stmt]:
        steps = round(extra + sum(self._weights.of(statement) for statement in statements))
        visited: list[ast.stmt] = [self.visit(statement) for statement in statements]
        return [_add(steps, statements[0]), *visited] if steps else visited

    def visit_Module(self, node: ast.Module) -> ast.Module:
        head = _prologue(node.body)
        node.body = node.body[:head] + self._block(node.body[head:])
        return node

    def _visit_function(self, node: ast.FunctionDef | ast.AsyncFunctionDef) -> ast.AST:
        head = 1 if ast.get_docstring(node, clean=False) is not None else 0
        body = node.body[head:] or [_at(ast.Pass(), node)]  # a docstring may be all there is
        node.body = node.body[:head] + self._block(body, self._weights[ENTER])
        return node

    visit_FunctionDef = visit_AsyncFunctionDef = _visit_function  # noqa: N815 (ast's naming)

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        node.body = [self.visit(statement) for statement in node.body]
        return node

    def generic_visit(self, node: ast.AST) -> ast.AST:
        """Bodies of compound statements become blocks; the rest is searched for lambdas and the like."""
        extra = self._each_time(node)
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

    def _each_time(self, node: ast.AST) -> float:
        """What it takes to come into the body of *node* each time, beside the body."""
        weights = self._weights
        if isinstance(node, (ast.For, ast.AsyncFor)):
            return weights[ROUND] + weights.of(node.target)
        if isinstance(node, ast.While):
            return weights[ROUND] + weights["branch"] + weights.of(node.test)
        return weights[CATCH] if isinstance(node, ast.ExceptHandler) else 0

    # -- expressions

    def visit_Lambda(self, node: ast.Lambda) -> ast.AST:
        steps = self._weights[ENTER] + self._weights.of(node.body)
        node.body = self._ticking(steps, self.visit(node.body))
        return node

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        node.values = [self.visit(node.values[0]), *(self._operand(value) for value in node.values[1:])]
        return node

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        node.test = self.visit(node.test)
        node.body, node.orelse = self._operand(node.body), self._operand(node.orelse)
        return node

    def _operand(self, operand: ast.expr) -> ast.expr:
        """One that may not be evaluated."""
        if not _worth_a_tick(operand):
            return operand
        steps = self._weights.of(operand)
        return self._ticking(steps, self.visit(operand))

    def visit_Call(self, node: ast.Call) -> ast.AST:
        taker = _taker(node)
        self.generic_visit(node)
        if taker:
            things = node.args[0]
            node.args = [_at(ast.Call(ast.Name(f"{TAKEN}{taker}__", ast.Load()), [things], []), things)]
        return node

    def _visit_comprehension(self, node: Any) -> ast.AST:
        weights = self._weights
        pending: float = 0  # steps for each item that reached the next part
        for number, generator in enumerate(node.generators):
            steps = pending + weights["loop"] + weights.of(generator.iter)
            generator.iter = self.visit(generator.iter)
            if number:  # the first one is evaluated with the statement
                generator.iter = self._ticking(steps, generator.iter)
            pending = weights[ITEM] + weights.of(generator.target)
            if generator.ifs:
                steps = pending + sum(weights["branch"] + weights.of(test) for test in generator.ifs)
                generator.ifs = [self.visit(test) for test in generator.ifs]
                generator.ifs[0] = self._ticking(steps, generator.ifs[0])
                pending = 0
        parts = [name for name in ("key", "value", "elt") if hasattr(node, name)]
        pending += weights[RESUME] if isinstance(node, ast.GeneratorExp) else 0
        pending += sum(weights.of(getattr(node, name)) for name in parts)
        for name in parts:
            setattr(node, name, self.visit(getattr(node, name)))
        setattr(node, parts[-1], self._ticking(pending, getattr(node, parts[-1])))
        return node  # type: ignore[no-any-return] # it is one of four kinds of node

    visit_ListComp = visit_SetComp = _visit_comprehension  # noqa: N815 (ast's naming)
    visit_DictComp = visit_GeneratorExp = _visit_comprehension  # noqa: N815 (ast's naming)

    def _ticking(self, steps: float, expression: ast.expr) -> ast.expr:
        """``(__volery_tick_7__() or expression)``: the tick gives ``None``."""
        weight = self._weights.of_tick(steps)
        if not weight:
            return expression
        self.ticks.add(weight)
        tick = ast.Call(ast.Name(f"{TICK}{weight}__", ast.Load()), [], [])
        return _at(ast.BoolOp(ast.Or(), [tick, expression]), expression)


def _taker(node: ast.Call) -> str:
    """The builtin or method that is about to go through the only argument; a generator counts its items."""
    if len(node.args) != 1 or isinstance(node.args[0], (ast.Starred, ast.GeneratorExp)):
        return ""
    if isinstance(node.func, ast.Name) and node.func.id in ITERATING_BUILTINS:
        return node.func.id
    return (
        node.func.attr if isinstance(node.func, ast.Attribute) and node.func.attr in ITERATING_METHODS else ""
    )


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


UNIFORM_COSTS: Mapping[str, float] = dict.fromkeys(OPERATIONS, 1.0 / STEPS_PER_NS)
"""One step for each operation: for those who want to know how often something is done, not what it takes."""

_PLENTY = 2**62
_EMPTY: dict[str, str] = {}
_VIEWS: tuple[type, ...] = (type(_EMPTY.keys()), type(_EMPTY.values()), type(_EMPTY.items()))
_PLAIN: frozenset[type] = frozenset(
    (list, tuple, dict, set, frozenset, range, str, bytes, bytearray, deque, *_VIEWS)
)
"""Types whose length is known without executing anybody's code."""


class StepCounter:
    """Counts what instrumented code of one run executes. One flow of control runs at a time.

    *costs* are nanoseconds by the name of an operation, for all of ``operations.OPERATIONS``; by default
    those that come with volery. Statements add to one cell. Inside expressions, where nothing can be
    assigned, an iterator of ``None`` is advanced, one for each weight: that is cheap, false, and tells how
    often it was done. *exact*: as many weights as it takes, not rounded.
    """

    def __init__(self, costs: Mapping[str, float] | None = None, exact: bool = False) -> None:
        costs = operation_table().nanoseconds if costs is None else costs
        steps = {name: STEPS_PER_NS * costs[name] for name in OPERATIONS}
        self._weights = Weights(steps, exact)
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
        counted, ticks = with_counters(tree, self._weights)
        for weight in sorted(ticks):
            self._ticks.setdefault(weight, (repeat(None, _PLENTY), _PLENTY))
        return counted

    def names(self) -> dict[str, Any]:
        """What a namespace needs for code that was instrumented here to run in it."""
        return {
            CELL: self._cell,
            **{f"{TAKEN}{name}__": self._taking(name) for name in (*ITERATING_BUILTINS, *ITERATING_METHODS)},
            **{f"{TICK}{weight}__": tick.__next__ for weight, (tick, _) in self._ticks.items()},
        }

    def _taking(self, name: str) -> Callable[[Any], Any]:
        """What the argument of builtin or method *name* goes through: it comes out as it was."""
        cell, weight, sorts = self._cell, self._weights[item_operation(name)], name == "sorted"

        def take(things: Any) -> Any:
            if type(things) in _PLAIN:
                count = len(things)
                cell[0] += round(weight * (count * count.bit_length() if sorts else count))
            return things

        return take
