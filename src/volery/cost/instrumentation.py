"""Counters for Python code: the cost of a component's file is counted as it runs, without changing the file.

At import one counter is inserted into the syntax tree for each straight run of statements: an addition of
the run's weight, in steps, to one cell. What is executed a number of times that only the run can tell (the
items of a comprehension, a lambda, the second operand of ``and``) has a counter of its own inside the
expression. Operands without a call are too cheap for one: they are counted with their statement whether they
are evaluated or not.

A step is a tenth of a nanosecond on the machine of ``operation_table``; ``CodeLaw`` converts steps to the
time of a processor. Counting is deterministic, does not read the host's clock, and covers the files of a
component. What a library computes inside a call is priced by ``library_calls`` where the library is in its
table (numpy, json, re); for others it has to be stated with ``volery.add_time``. ``sys.settrace`` and
``sys.monitoring`` were rejected: they slow code down several times and see lines or bytecode, not operations.
"""

from __future__ import annotations

import ast
import copy
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from volery.cost.library_calls import OPERATORS, LibraryCalls, LibraryTable, library_of
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
from volery.cost.ticks import Ticks

CELL = "__volery_steps__"
TICK = "__volery_tick_"
ITERATED = "__volery_iterated_by_"
LIBRARY_CALL = "__volery_call__"
LIBRARY_OPERATOR = "__volery_operator_"
LIBRARY_STORE = "__volery_store__"
_READ_TWICE = (
    ast.Name, ast.Attribute, ast.Subscript, ast.Slice, ast.Tuple, ast.Constant, ast.UnaryOp, ast.BinOp,
    ast.expr_context, ast.operator, ast.unaryop,
)  # fmt: skip
"""Parts of a target that a second reading does not change."""
SLICE = "__volery_slice__"
"""Names (or their beginnings) in the namespace of instrumented code: the cell that statements add to, the
counters inside expressions by weight, the functions that count the items of an argument, and those that
execute calls and operators in files that use libraries."""

_SEES_ITS_CALLER = frozenset({"super", "locals", "globals", "vars", "dir", "eval", "exec"})
"""Builtins that look at the frame that calls them, so that nothing may stand between."""

UNIFORM_COSTS: Mapping[str, float] = dict.fromkeys(OPERATIONS, 1.0 / STEPS_PER_NS)
"""One step for each operation, to count how often operations are executed."""

_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
_COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
_DIVERTS = (ast.Return, ast.Break, ast.Continue, ast.Raise)
_BODIES = ("body", "orelse", "finalbody", "handlers", "cases")
_NEEDS_COUNTER = (ast.Call, *_COMPREHENSIONS)

_LEADING_BITS = 5
_EMPTY: dict[str, str] = {}
_VIEWS: tuple[type, ...] = (type(_EMPTY.keys()), type(_EMPTY.values()), type(_EMPTY.items()))
_CONTAINERS: frozenset[type] = frozenset(
    (list, tuple, dict, set, frozenset, range, str, bytes, bytearray, deque, *_VIEWS)
)
"""Types whose length is known without executing Python code."""


class Weights:
    """Weights of operations and syntax nodes in steps. ``weights["load"]`` is the weight of an operation.

    Weights of counters inside expressions keep five leading bits (3 %) unless they are ``exact``, since each
    different weight needs an iterator.
    """

    def __init__(self, steps: Mapping[str, float], exact: bool = False) -> None:
        self._steps = steps
        self._exact = exact
        self._constructions: Mapping[str, list[tuple[str, int]]] = {}

    def enter_module(self, tree: ast.Module) -> None:
        """Use the classes of ``tree`` to recognise constructions."""
        self._constructions = construction_operations(tree)

    def __getitem__(self, operation: str) -> float:
        return self._steps[operation]

    def of(self, node: ast.AST) -> float:
        """Return the weight of executing ``node`` once, without what has a counter of its own."""
        own = sum(self._steps[name] * times for name, times in self._operations(node))
        return own + sum(self.of(part) for part in _executed_parts(node))

    def of_tick(self, steps: float) -> int:
        """Return the weight of a counter inside an expression that is to count ``steps``."""
        whole = round(steps)
        unit = 1 if self._exact else 1 << max(0, whole.bit_length() - _LEADING_BITS)
        return whole if unit == 1 else round(whole / unit) * unit

    def _operations(self, node: ast.AST) -> Iterable[tuple[str, int]]:
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name)
            and node.func.id in self._constructions
        ):
            return self._constructions[node.func.id]
        return operations_of(node)


def _executed_parts(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the children that are executed once each time that ``node`` is."""
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
        yield from (value for value in node.values[1:] if not _needs_counter(value))
    elif isinstance(node, ast.IfExp):
        yield node.test
        yield from (value for value in (node.body, node.orelse) if not _needs_counter(value))
    elif not isinstance(node, ast.While):
        yield from _children_outside_bodies(node)


def _children_outside_bodies(node: ast.AST) -> Iterator[ast.AST]:
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return  # a constant that stands alone is dropped by the compiler
    for name, value in ast.iter_fields(node):
        if name in _BODIES and isinstance(value, list):
            continue
        items = value if isinstance(value, list) else [value]
        yield from (item for item in items if isinstance(item, ast.AST))


def _needs_counter(operand: ast.expr) -> bool:
    return any(isinstance(part, _NEEDS_COUNTER) for part in ast.walk(operand))


def with_counters(
    tree: ast.Module, weights: Weights, libraries: Iterable[str] = ()
) -> tuple[ast.Module, set[int]]:
    """Insert counters into ``tree``; line numbers stay as they are.

    Args:
        tree: The file.
        weights: Weights of the counters.
        libraries: Libraries whose calls pass through ``LibraryCalls``.

    Returns:
        The tree, and the weights of the counters inside expressions.
    """
    weights.enter_module(tree)
    inserter = _CounterInserter(weights, uses_libraries(tree, libraries))
    counted: ast.Module = inserter.visit(tree)
    return ast.fix_missing_locations(counted), inserter.ticks


def uses_libraries(tree: ast.Module, libraries: Iterable[str]) -> bool:
    """Return whether a file imports one of these libraries."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        else:
            continue
        if any(library_of(name) in libraries for name in names):
            return True
    return False


class _CounterInserter(ast.NodeTransformer):
    """Inserts counters; ``ticks`` are the weights of those inside expressions.

    Args:
        weights: Weights of the counters.
        libraries: Let calls and operators pass through ``LibraryCalls``.
    """

    def __init__(self, weights: Weights, libraries: bool) -> None:
        self._weights = weights
        self._libraries = libraries
        self.ticks: set[int] = set()

    # -- statements

    def _block(self, body: list[ast.stmt], extra: float = 0) -> list[ast.stmt]:
        """Count each straight run of ``body``; a run ends with a statement that may leave the block."""
        counted: list[ast.stmt] = []
        run: list[ast.stmt] = []
        for statement in body:
            run.append(statement)
            if _may_leave(statement):
                counted += self._run(run, extra)
                run, extra = [], 0
        return counted + (self._run(run, extra) if run else [])

    def _run(self, statements: list[ast.stmt], extra: float) -> list[ast.stmt]:
        """Put ``__volery_steps__[0] += steps`` before a straight run."""
        steps = round(extra + sum(self._weights.of(statement) for statement in statements))
        visited: list[ast.stmt] = [self.visit(statement) for statement in statements]
        if not steps:
            return visited
        cell = ast.Subscript(ast.Name(CELL, ast.Load()), ast.Constant(0), ast.Store())
        counter = ast.AugAssign(cell, ast.Add(), ast.Constant(steps))
        return [ast.copy_location(counter, statements[0]), *visited]

    def visit_Module(self, node: ast.Module) -> ast.Module:
        head = _prologue_length(node.body)
        node.body = node.body[:head] + self._block(node.body[head:])
        return node

    def _visit_function(self, node: ast.FunctionDef | ast.AsyncFunctionDef) -> ast.AST:
        head = 1 if ast.get_docstring(node, clean=False) is not None else 0
        body = node.body[head:] or [ast.copy_location(ast.Pass(), node)]  # a docstring may be all there is
        node.body = node.body[:head] + self._block(body, self._weights[ENTER])
        return node

    visit_FunctionDef = visit_AsyncFunctionDef = _visit_function  # noqa: N815 (ast's naming)

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        node.body = [self.visit(statement) for statement in node.body]
        return node

    def generic_visit(self, node: ast.AST) -> ast.AST:
        """Make blocks of the bodies of compound statements; search the rest for lambdas and the like."""
        extra = self._per_iteration(node)
        for name, value in ast.iter_fields(node):
            if isinstance(value, list) and value and isinstance(value[0], ast.stmt):
                setattr(node, name, self._block(value, extra if name == "body" else 0))
            elif isinstance(value, list):
                visited = [self.visit(item) if isinstance(item, ast.AST) else item for item in value]
                setattr(node, name, visited)
            elif isinstance(value, ast.AST):
                setattr(node, name, self.visit(value))
        return node

    def _per_iteration(self, node: ast.AST) -> float:
        """Return the weight of entering the body of ``node`` each time, without the body."""
        weights = self._weights
        if isinstance(node, (ast.For, ast.AsyncFor)):
            return weights[ROUND] + weights.of(node.target)
        if isinstance(node, ast.While):
            return weights[ROUND] + weights["branch"] + weights.of(node.test)
        return weights[CATCH] if isinstance(node, ast.ExceptHandler) else 0

    # -- expressions

    def visit_Lambda(self, node: ast.Lambda) -> ast.AST:
        steps = self._weights[ENTER] + self._weights.of(node.body)
        node.body = self._counted(steps, self.visit(node.body))
        return node

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        node.values = [self.visit(node.values[0]), *(self._operand(value) for value in node.values[1:])]
        return node

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        node.test = self.visit(node.test)
        node.body, node.orelse = self._operand(node.body), self._operand(node.orelse)
        return node

    def _operand(self, operand: ast.expr) -> ast.expr:
        """Count an operand that may not be evaluated, if it is worth a counter."""
        if not _needs_counter(operand):
            return operand
        steps = self._weights.of(operand)
        return self._counted(steps, self.visit(operand))

    def visit_Call(self, node: ast.Call) -> ast.AST:
        iterating = _iterating_call(node)
        self.generic_visit(node)
        if iterating:
            argument = node.args[0]
            counting = ast.Call(ast.Name(f"{ITERATED}{iterating}__", ast.Load()), [argument], [])
            node.args = [ast.copy_location(counting, argument)]
        if not self._libraries or (isinstance(node.func, ast.Name) and node.func.id in _SEES_ITS_CALLER):
            return node
        return ast.copy_location(_call(LIBRARY_CALL, node.func, *node.args, keywords=node.keywords), node)

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        return self._operated(node, type(node.op).__name__, node.left, node.right)

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        self.generic_visit(node)
        if len(node.ops) > 1:
            return node
        return self._operated(node, type(node.ops[0]).__name__, node.left, node.comparators[0])

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        self.generic_visit(node)
        if not isinstance(node.ctx, ast.Load) or not self._libraries:
            return node
        return self._operated(node, "Subscript", node.value, _index(node.slice))

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        self.generic_visit(node)
        name = type(node.op).__name__
        if not self._libraries or name not in OPERATORS or isinstance(node.operand, ast.Constant):
            return node
        return ast.copy_location(_call(f"{LIBRARY_OPERATOR}{name}__", node.operand), node)

    def visit_Assign(self, node: ast.Assign) -> ast.AST:
        """Price an assignment into an array (``array[..] = value``) with its value."""
        target = copy.deepcopy(node.targets[0]) if len(node.targets) == 1 else None
        self.generic_visit(node)
        return self._stored(node, target)

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        """Price ``array += value`` and ``array[..] += value`` with the value."""
        target = copy.deepcopy(node.target)
        self.generic_visit(node)
        return self._stored(node, target)

    def _stored(self, node: Any, read: ast.expr | None) -> ast.AST:
        """Let the value pass through ``LibraryCalls`` with its target, which is read again.

        ``read`` is a copy without counters. That is done only where a second reading changes nothing: a
        target of names, attributes and items.
        """
        item = isinstance(read, ast.Subscript)
        if not self._libraries or read is None or not (item or isinstance(node, ast.AugAssign)):
            return node  # type: ignore[no-any-return] # it is one of two kinds of node
        read.ctx = ast.Load()  # type: ignore[attr-defined] # what can be assigned to has a context
        if not all(isinstance(one, _READ_TWICE) for one in ast.walk(read)):
            return node  # type: ignore[no-any-return]
        index: ast.expr = ast.Constant(None)
        kind = "Item"
        if isinstance(read, ast.Subscript):
            index, read = _index(read.slice), read.value
        else:
            kind = type(node.op).__name__
        node.value = ast.copy_location(
            _call(LIBRARY_STORE, node.value, read, ast.Constant(kind), index), node.value
        )
        return node  # type: ignore[no-any-return]

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        """Leave the annotation as it is."""
        if node.value is not None:
            node.value = self.visit(node.value)
        return node

    def _operated(self, node: ast.expr, name: str, left: ast.expr, right: ast.expr) -> ast.expr:
        """Let an operator pass through ``LibraryCalls``."""
        if not self._libraries or name not in OPERATORS or _is_text(left) or _are_constants(left, right):
            return node
        return ast.copy_location(_call(f"{LIBRARY_OPERATOR}{name}__", left, right), node)

    def _visit_comprehension(self, node: Any) -> ast.AST:
        weights = self._weights
        pending: float = 0  # steps for each item that reached the next part
        for number, generator in enumerate(node.generators):
            steps = pending + weights["loop"] + weights.of(generator.iter)
            generator.iter = self.visit(generator.iter)
            if number:  # the first one is evaluated with the statement
                generator.iter = self._counted(steps, generator.iter)
            pending = weights[ITEM] + weights.of(generator.target)
            if generator.ifs:
                steps = pending + sum(weights["branch"] + weights.of(test) for test in generator.ifs)
                generator.ifs = [self.visit(test) for test in generator.ifs]
                generator.ifs[0] = self._counted(steps, generator.ifs[0])
                pending = 0
        parts = [name for name in ("key", "value", "elt") if hasattr(node, name)]
        pending += weights[RESUME] if isinstance(node, ast.GeneratorExp) else 0
        pending += sum(weights.of(getattr(node, name)) for name in parts)
        for name in parts:
            setattr(node, name, self.visit(getattr(node, name)))
        setattr(node, parts[-1], self._counted(pending, getattr(node, parts[-1])))
        return node  # type: ignore[no-any-return] # it is one of four kinds of node

    visit_ListComp = visit_SetComp = _visit_comprehension  # noqa: N815 (ast's naming)
    visit_DictComp = visit_GeneratorExp = _visit_comprehension  # noqa: N815 (ast's naming)

    def _counted(self, steps: float, expression: ast.expr) -> ast.expr:
        """Return ``(__volery_tick_7__() or expression)``; the tick returns None."""
        weight = self._weights.of_tick(steps)
        if not weight:
            return expression
        self.ticks.add(weight)
        tick = ast.Call(ast.Name(f"{TICK}{weight}__", ast.Load()), [], [])
        return ast.copy_location(ast.BoolOp(ast.Or(), [tick, expression]), expression)


def _call(name: str, *arguments: ast.expr, keywords: list[ast.keyword] | None = None) -> ast.Call:
    return ast.Call(ast.Name(name, ast.Load()), list(arguments), keywords or [])


def _is_text(operand: ast.expr) -> bool:
    return isinstance(operand, ast.Constant) and isinstance(operand.value, (str, bytes))


def _are_constants(*operands: ast.expr) -> bool:
    return all(isinstance(operand, ast.Constant) for operand in operands)


def _index(index: ast.expr) -> ast.expr:
    """Return an index as an expression of its own: slices are calls of ``slice``."""
    if isinstance(index, ast.Slice):
        parts = (part or ast.Constant(None) for part in (index.lower, index.upper, index.step))
        return ast.copy_location(_call(SLICE, *parts), index)
    if isinstance(index, ast.Tuple):
        return ast.copy_location(ast.Tuple([_index(part) for part in index.elts], ast.Load()), index)
    return index


def _iterating_call(node: ast.Call) -> str:
    """Return the name of the builtin or method if the call iterates over its only argument, else "".

    A generator counts its items itself.
    """
    if len(node.args) != 1 or isinstance(node.args[0], (ast.Starred, ast.GeneratorExp)):
        return ""
    if isinstance(node.func, ast.Name) and node.func.id in ITERATING_BUILTINS:
        return node.func.id
    return (
        node.func.attr if isinstance(node.func, ast.Attribute) and node.func.attr in ITERATING_METHODS else ""
    )


def _may_leave(statement: ast.stmt) -> bool:
    """Return whether the statements after ``statement`` in its block may be skipped."""
    if isinstance(statement, (*_FUNCTIONS, ast.ClassDef)):
        return False
    if isinstance(statement, _DIVERTS):
        return True
    return any(_may_leave(child) for child in _child_statements(statement))


def _child_statements(statement: ast.stmt) -> Iterator[ast.stmt]:
    for child in ast.iter_child_nodes(statement):
        if isinstance(child, ast.stmt):
            yield child
        elif isinstance(child, (ast.ExceptHandler, ast.match_case)):
            yield from child.body


def _prologue_length(body: list[ast.stmt]) -> int:
    """Return how many statements must stay first: the docstring and ``from __future__`` imports."""
    count = 0
    for number, statement in enumerate(body):
        docstring = (
            number == 0 and isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
        )
        if not docstring and not (isinstance(statement, ast.ImportFrom) and statement.module == "__future__"):
            break
        count += 1
    return count


class StepCounter:
    """Counts what the instrumented code of one run executes. One flow of control runs at a time.

    Statements add to one cell. Inside expressions, where nothing can be assigned, a counter of ``Ticks`` is
    called, one for each weight: its value is false.

    Attributes:
        taken: Steps of the whole run.
        libraries: Library calls, whose steps are among them; None if they are left out.

    Args:
        costs: Times of all ``OPERATIONS``, ns; by default those that come with volery.
        exact: Do not round the weights of counters inside expressions.
        libraries: Times of library calls; None to leave them out.
    """

    def __init__(
        self,
        costs: Mapping[str, float] | None = None,
        exact: bool = False,
        libraries: LibraryTable | None = None,
    ) -> None:
        costs = operation_table().nanoseconds if costs is None else costs
        self._weights = Weights({name: STEPS_PER_NS * costs[name] for name in OPERATIONS}, exact)
        self._cell = [0]
        self.taken = 0
        self.libraries = LibraryCalls(self._cell, libraries) if libraries else None
        self._ticks = Ticks()
        self._counters: dict[int, Callable[[], None]] = {}  # by weight

    def take(self) -> int:
        """Return the steps since the last call."""
        steps, self._cell[0] = self._cell[0] + self._ticks.take(), 0
        self.taken += steps
        return steps

    def instrument(self, tree: ast.Module) -> ast.Module:
        """Insert counters into ``tree``; line numbers stay as they are."""
        counted, ticks = with_counters(
            tree, self._weights, self.libraries.libraries if self.libraries else ()
        )
        for weight in sorted(ticks):
            if weight not in self._counters:
                self._counters[weight] = self._ticks.counter(weight)
        return counted

    def names(self) -> dict[str, Any]:
        """Return the names that instrumented code needs in its namespace."""
        return {
            CELL: self._cell,
            **self._library_names(),
            **{
                f"{ITERATED}{name}__": self._item_counter(name)
                for name in (*ITERATING_BUILTINS, *ITERATING_METHODS)
            },
            **{f"{TICK}{weight}__": counter for weight, counter in self._counters.items()},
        }

    def _library_names(self) -> dict[str, Any]:
        if self.libraries is None:
            return {}
        operators = self.libraries.operators()
        named = {f"{LIBRARY_OPERATOR}{name}__": one for name, one in operators.items()}
        calls = {LIBRARY_CALL: self.libraries.call, LIBRARY_STORE: self.libraries.store}
        return {**calls, SLICE: slice, **named}

    def _item_counter(self, name: str) -> Callable[[Any], Any]:
        """Return the function that counts the items of an argument of ``name`` and passes it on."""
        cell, weight, sorts = self._cell, self._weights[item_operation(name)], name == "sorted"

        def count_items(argument: Any) -> Any:
            if type(argument) in _CONTAINERS:
                count = len(argument)
                cell[0] += round(weight * (count * count.bit_length() if sorts else count))
            return argument

        return count_items
