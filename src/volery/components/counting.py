"""What Python code costs, without touching the user's file: steps are counted as it runs.

At import each straight run of statements is given one counter: an addition of the run's weight, in *steps*,
to one cell (``instrumenting``). A step is a tenth of a nanosecond on the machine that the table of costs was
measured on; the law that turns steps into time on a processor is given from above. Counting is deterministic,
does not look at the host's clock, and covers the files that belong to a component; what a library computes
inside a call (numpy, networkx) is not counted and has to be stated with ``volery.add_time``.
"""

from __future__ import annotations

import ast
from collections import deque
from collections.abc import Callable, Mapping
from itertools import repeat
from operator import length_hint
from typing import Any

from volery.components import operations
from volery.components.instrumenting import CELL, TAKEN, TICK, Weights, with_counters
from volery.components.operations import SIZED, SIZED_METHODS
from volery.cost.interpreter import STEPS_PER_NS, python_operations

UNIFORM: Mapping[str, float] = dict.fromkeys(operations.OPERATIONS, 1.0 / STEPS_PER_NS)
"""One step for each operation: for those who want to know how often something is done, not what it takes."""

_PLENTY = 2**62
_EMPTY: dict[str, str] = {}
_VIEWS: tuple[type, ...] = (type(_EMPTY.keys()), type(_EMPTY.values()), type(_EMPTY.items()))
_PLAIN: frozenset[type] = frozenset(
    (list, tuple, dict, set, frozenset, range, str, bytes, bytearray, deque, *_VIEWS)
)
"""Types whose length is known without executing anybody's code."""


class Steps:
    """Counts what instrumented code of one run executes. One flow of control runs at a time.

    *costs* are nanoseconds by the name of an operation, for all of ``operations.OPERATIONS``; by default
    those that come with volery. Statements add to one cell. Inside expressions, where nothing can be
    assigned, an iterator of ``None`` is advanced, one for each weight: that is cheap, false, and tells how
    often it was done. *exact*: as many weights as it takes, not rounded.
    """

    def __init__(self, costs: Mapping[str, float] | None = None, exact: bool = False) -> None:
        costs = python_operations().nanoseconds if costs is None else costs
        steps = {name: STEPS_PER_NS * costs[name] for name in operations.OPERATIONS}
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
            **{f"{TAKEN}{name}__": self._taking(name) for name in (*SIZED, *SIZED_METHODS)},
            **{f"{TICK}{weight}__": tick.__next__ for weight, (tick, _) in self._ticks.items()},
        }

    def _taking(self, name: str) -> Callable[[Any], Any]:
        """What the argument of builtin or method *name* goes through: it comes out as it was."""
        cell, weight, sorts = self._cell, self._weights[operations.item_of(name)], name == "sorted"

        def take(things: Any) -> Any:
            if type(things) in _PLAIN:
                count = len(things)
                cell[0] += round(weight * (count * count.bit_length() if sorts else count))
            return things

        return take
