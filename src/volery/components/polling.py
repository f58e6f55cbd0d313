"""Loops of component code that poll: time passes in them, and others run.

On a vehicle the callbacks of a script run in threads of their own, so that ``while not ready: pass`` ends. In
virtual time nothing happens until a task lets go. So a call is compiled into each ``while`` loop:

* a turn that does nothing, and whose conditions change nothing, executes ``IDLE``, which stands for the
  thousands of turns until something changes;
* another turn executes ``TURN`` after ``FREE_TURNS`` turns at one instant.

Turns are counted, so the same run has the same trace; so are the operations of their code, also where code
takes no time otherwise. A loop that polls is named once, in a warning.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Container
from itertools import chain, repeat
from pathlib import Path
from typing import Any

from volery.base.time import US, Ns
from volery.cost import STEPS_PER_NS, StepCounter
from volery.kernel.api import Kernel
from volery.kernel.waiting import FREE_POLLS, execute_polled, execute_polling
from volery.trace.events import Text

IDLE: Ns = 100 * US
"""What a turn that does nothing executes, ns. Python itself switches threads each 5 ms."""

TURN: Ns = 100
"""What another turn executes at least, ns, where its code is not counted."""

TURNS = 64
"""Turns of all loops from one look at the clock to the next."""

FREE_TURNS = 20_000
"""Turns of one task at one instant that are taken for computing."""

_ASKING = frozenset(
    [
        "is_alive",
        "is_shutdown",
        "ok",
        "is_set",
        "done",
        "get_time",
        "get_rostime",
        "get_clock",
        "now",
        "to_sec",
        "time",
        "monotonic",
        "perf_counter",
    ]
)
"""Methods and functions of ROS, of threads and of clocks that change nothing."""

_WAITING = ("sleep", "spin", "wait", "join", "get")
"""How names of functions begin that let others run."""

_EMPTY, _TURN, _LOOK = "__volery_empty_turn__", "__volery_turn__", "__volery_look__"
_FRAMEWORK, _WARNING = "volery", 4


Place = tuple[int, int]
"""Line and column of a statement."""


def empty_turns(tree: ast.Module) -> set[Place]:
    """Return where a file does nothing but wait: loops without a body, and each ``if`` that is all of a body.

    What they ask must not change anything. Names that get what was asked, as in ``now = time.time()``, may
    stand before the ``if``.
    """
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.While) and _only_asks(node.test):
            last: ast.stmt = node
            body = _without_readings([one for one in node.body if not _is_nothing(one)])
            while len(body) == 1 and isinstance(body[0], ast.If) and _only_asks(body[0].test):
                last, body = body[0], body[0].orelse
            if not body:
                found.add(_place(last))
    return found


def has_busy_loop(tree: ast.Module) -> bool:
    """Return whether a file has a ``while`` loop in which nothing seems to wait."""
    return any(
        isinstance(node, ast.While)
        and not any(
            _name_of(part).startswith(_WAITING) for part in ast.walk(node) if isinstance(part, ast.Call)
        )
        for node in ast.walk(tree)
    )


class Polling:
    """The polling of all components of one run.

    Args:
        kernel: The run's kernel.
        counts: Count the code of loops that poll, since the run counts none.
    """

    def __init__(self, kernel: Kernel, counts: bool = False) -> None:
        self._kernel = kernel
        self.steps = StepCounter() if counts else None
        self._named: set[str] = set()
        self._turn: Callable[[], int] = self._turns().__next__
        self._task: object = None
        self._now: Ns = -1
        self._turns_here = 0

    @staticmethod
    def _turns() -> chain[int]:
        """Return an iterator of zeros with a one in each ``TURNS``."""
        one_round = (*repeat(0, TURNS - 1), 1)
        return chain.from_iterable(repeat(one_round))

    def instrument(self, tree: ast.Module, path: Path, empty: Container[Place]) -> ast.Module:
        """Insert the calls into *tree*, which may have counters; *empty*: see ``empty_turns``."""
        for node in ast.walk(tree):
            if not isinstance(node, ast.While | ast.If):
                continue
            where = repr(f"{path.name}:{node.lineno}")
            if _place(node) in empty:
                body = node.body if isinstance(node, ast.While) else node.orelse
                body.insert(0, _call(f"{_EMPTY}({where})", node))
            elif isinstance(node, ast.While):
                node.body.insert(0, _call(f"{_TURN}() and {_LOOK}({where})", node))
        return tree

    def names(self) -> dict[str, Any]:
        """Return the names that the inserted calls need."""
        counters = self.steps.names() if self.steps else {}
        return {_EMPTY: self._empty_turn, _TURN: self._turn, _LOOK: self._look, **counters}

    def _empty_turn(self, where: str) -> None:
        self._warn(where, "has no sleep and does nothing")
        execute_polling(self._kernel, IDLE)

    def _look(self, where: str) -> None:
        """Execute the last turns if the task has been at one instant for too many of them."""
        counted = self.steps.take() // STEPS_PER_NS if self.steps else 0
        kernel = self._kernel
        task, now = kernel.current(), kernel.now()
        if task is None or task.adopted:
            return
        if task.polls > FREE_POLLS:
            self._warn(where, f"asks {FREE_POLLS} times whether something has changed, without a wait")
            task.polled_ns += counted
            if counted:
                execute_polled(kernel, task)
            return
        if (task, now) != (self._task, self._now):
            self._task, self._now, self._turns_here = task, now, 0
        self._turns_here += TURNS
        if self._turns_here <= FREE_TURNS:
            return
        if task.meter is None:
            task.polled_ns += max(counted, TURNS * TURN)
        execute_polled(kernel, task)
        self._now = kernel.now()
        self._warn(where, f"has taken {FREE_TURNS} turns without a sleep")

    def _warn(self, where: str, what: str) -> None:
        if where not in self._named:
            self._named.add(where)
            text = f"the loop of {where} {what}: it keeps a core busy; wait with a rate, a sleep or spin"
            self._kernel.record(Text(self._kernel.now(), _FRAMEWORK, _WARNING, text))


def _call(text: str, at: ast.stmt) -> ast.stmt:
    (made,) = ast.parse(text).body
    for part in ast.walk(made):
        if isinstance(part, ast.expr | ast.stmt):
            ast.copy_location(part, at)
    return made


def _place(node: ast.stmt) -> Place:
    return node.lineno, node.col_offset


def _name_of(call: ast.Call) -> str:
    """Return the last part of the name of what is called, or nothing."""
    if isinstance(call.func, ast.Attribute):
        return call.func.attr
    return call.func.id if isinstance(call.func, ast.Name) else ""


def _is_nothing(one: ast.stmt) -> bool:
    return isinstance(one, ast.Pass | ast.Continue) or (
        isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant)
    )


def _without_readings(body: list[ast.stmt]) -> list[ast.stmt]:
    """Return a body without what it begins with: names that get what was asked for."""
    given: set[str] = set()
    used: set[str] = set()
    for index, one in enumerate(body):
        target = one.targets[0] if isinstance(one, ast.Assign) else None
        if not (isinstance(one, ast.Assign) and isinstance(target, ast.Name) and _only_asks(one.value)):
            return body[index:]
        given |= {target.id}
        used |= {part.id for part in ast.walk(one.value) if isinstance(part, ast.Name)}
        if given & used:
            return body
    return []


def _only_asks(test: ast.expr) -> bool:
    """Return whether an expression has the same value until others have run or time has passed."""
    for part in ast.walk(test):
        if isinstance(part, ast.Call):
            name = _name_of(part) if isinstance(part.func, ast.Attribute) else ""
            if name not in _ASKING or part.args or part.keywords:
                return False
        elif isinstance(part, ast.Await | ast.Yield | ast.YieldFrom | ast.NamedExpr):
            return False
    return True
