"""Counting changes nothing that code does, and gives the same steps each time."""

from __future__ import annotations

import ast
import traceback

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.cost.instrumentation import UNIFORM_COSTS, StepCounter
from volery.cost.python_operations import OPERATIONS, STEPS_PER_NS


def load(text, steps=None):
    """The namespace of *text*, counted if *steps* is given."""
    tree = ast.parse(text)
    names = {"__name__": __name__}
    if steps is not None:
        tree = steps.instrument(tree)
        names |= steps.names()
    exec(compile(tree, "user.py", "exec"), names)
    if steps is not None:
        steps.take()
    return names


def count(operation, text, *arguments):
    """How often *operation* is counted while ``f`` of *text* runs."""
    nothing = dict.fromkeys(OPERATIONS, 0.0)
    steps = StepCounter({**nothing, operation: 1.0 / STEPS_PER_NS})
    function = load(text, steps)["f"]
    function(*arguments)
    return steps.take()


LOOP = "def f(n):\n    for i in n:\n        if i > 2:\n            continue\n        i + i\n"
BRANCHES = "def f(n):\n    if n > 0:\n        n + n + n\n    else:\n        n + n\n"
EARLY = "def f(n):\n    if n > 0:\n        return n\n    n + n\n    n + n\n"
SHARES = "def f(n):\n  try:\n    1 / n\n  except ZeroDivisionError:\n    n + n\n  finally:\n    n + n\n"
TWO_LEVELS = "def f(n):\n    [j + j for i in n for j in i]\n"
EITHER = "def f(n):\n    return n == 0 or abs(n) > 1\n"
RECURSION = "def f(n):\n    return n if n < 2 else f(n - 1) + f(n - 2)\n"
FIELDS = """
from dataclasses import dataclass
from typing import NamedTuple
class Named(NamedTuple):
    x: int
@dataclass
class Data:
    x: int
    y: int = 0
def f(n):
    return Named(n), Data(n), Data(n)
"""


@pytest.mark.parametrize(
    ("operation", "text", "argument", "expected"),
    [
        ("arithmetic", "def f(n):\n    a = n + n\n    return a\n", 1, 1),
        ("load", "def f(n):\n    a = n + 1\n    return a\n", 1, 3),
        ("attribute", "def f(n):\n    n.real\n", 1, 1),
        ("divide", "def f(n):\n    n += n / 2\n    n %= 2\n", 1, 2),
        ("format", "def f(n):\n    f'{n} {n}'\n    '%d' % n\n", 1, 3),
        ("arithmetic", "def f(n):\n    for i in range(n):\n        n + i\n", 10, 10),
        ("range()", "def f(n):\n    for i in range(n):\n        n + i\n", 10, 1),
        ("round of a loop", "def f(n):\n    for i in range(n):\n        n + i\n", 10, 10),
        ("unpack", "def f(n):\n    for i, j in enumerate(n):\n        pass\n", "abc", 3),
        ("compare", "def f(n):\n    while n > 0:\n        n = n - 1\n", 5, 5),
        ("arithmetic", BRANCHES, 1, 2),
        ("arithmetic", BRANCHES, -1, 1),
        # what an early return leaves out is not counted
        ("arithmetic", EARLY, 1, 0),
        ("arithmetic", EARLY, 0, 2),
        ("arithmetic", LOOP, [1, 9, 9], 1),
        ("compare", LOOP, [1, 9, 9], 3),
        ("enter a function", "def f(n):\n    g(n)\n    g(n)\ndef g(n):\n    pass\n", 1, 3),
        # comprehensions, generators and lambdas count by the item and by the call
        ("arithmetic", "def f(n):\n    [i + i for i in n]\n", range(7), 7),
        ("item of a comprehension", "def f(n):\n    [i + i for i in n if i > 4]\n", range(7), 7),
        ("arithmetic", "def f(n):\n    [i + i for i in n if i > 4]\n", range(7), 2),
        ("item of a comprehension", TWO_LEVELS, ["ab", "cde"], 7),
        ("arithmetic", TWO_LEVELS, ["ab", "cde"], 5),
        ("resume a generator", "def f(n):\n    sum(i for i in n)\n", range(7), 7),
        ("arithmetic", "def f(n):\n    g = lambda x: x + x\n    g(n)\n    g(n)\n", 1, 2),
        # operands that call something are counted where they are evaluated
        ("abs()", EITHER, 0, 0),
        ("abs()", EITHER, 3, 1),
        ("call", RECURSION, 5, 14),
        ("catch an exception", SHARES, 0, 1),
        ("catch an exception", SHARES, 1, 0),
        # what builtins go through
        ("item of sum()", "def f(n):\n    sum(n)\n    min(3, 2)\n", (1, 2, 3), 3),
        ("item of sum()", "def f(n):\n    sum(i for i in n)\n", (1, 2, 3), 0),
        ("item of join()", "def f(n):\n    ', '.join(n)\n", ["a", "b"], 2),
        ("item of sorted()", "def f(n):\n    sorted(n, key=None)\n", [3, 1, 2, 4], 12),
        # objects whose constructor Python writes
        ("construct a named tuple", FIELDS, 1, 1),
        ("field of a dataclass", FIELDS, 1, 4),
    ],
)
def test_operations_are_counted_as_they_are_executed(operation, text, argument, expected):
    assert count(operation, text, argument) == expected


EVERYTHING = '''"""A docstring."""
from __future__ import annotations
import functools
LOG = []

class Base:
    """Another."""
    kind = "base"
    __slots__ = ("value",)
    def __init__(self, value):
        """And another."""
        self.value = value
    @property
    def double(self):
        return self.value * 2
    @functools.lru_cache
    def cached(n):
        return n + 1

class Child(Base):
    def __eq__(self, other):
        return isinstance(other, Child) and self.value == other.value
    __hash__ = None

def generator(n):
    received = 0
    while received is not None and n:
        received = yield n + received
        n -= 1
    return "end"

def outer(n):
    total = 0
    def inner(by=n, *rest, **named):
        nonlocal total
        total += by + len(rest) + len(named)
        return total
    inner()
    inner(1, 2, x=3)
    return total

def compounds(n, things):
    global LOG
    found = {key: [item for item in value if item != n] for key, value in things.items() if key}
    for number, thing in enumerate(sorted(things)):
        if not thing:
            continue
        elif number > 3:
            break
        else:
            LOG = [*LOG, (number, thing)]
    else:
        LOG.append("all")
    try:
        1 / n
    except ZeroDivisionError as error:
        LOG.append(str(error))
    else:
        LOG.append(f"{n!r:>4}")
    finally:
        LOG.append("finally")
    with open("/dev/null") as nothing, open("/dev/null"):
        LOG.append(nothing.read())
    match n:
        case 0:
            LOG.append("zero")
        case int() if n > 2:
            LOG.append("many")
        case _:
            LOG.append("few")
    assert n is not None, "never"
    lists = [*map(list, (things, range(n))), tuple(things), sorted(things, reverse=True), ",".join(things)]
    LOG.append(lists)
    return found, LOG, {x for x in range(n)}, sum(y for y in range(n) if y), n if n else -n, n and 1 or 2

def drive(n, things):
    gen = generator(n)
    sent = [next(gen, None)]
    try:
        while True:
            sent.append(gen.send(1))
    except StopIteration as stop:
        sent.append(stop.value)
    key = (lambda *a, k=2: a[0] * k)(n)
    walrus = [half for x in range(n) if (half := x // 2) > 1]
    return compounds(n, things), outer(n), sent, key, walrus, Child(n) == Child(n), Base(n).double, __doc__
'''


@given(
    n=st.integers(0, 9),
    things=st.dictionaries(st.text("ab", max_size=2), st.lists(st.integers(0, 9), max_size=3)),
)
def test_counted_code_does_what_it_did(n, things):
    steps = StepCounter(UNIFORM_COSTS)
    plain, counted = load(EVERYTHING), load(EVERYTHING, steps)
    assert repr(counted["drive"](n, things)) == repr(plain["drive"](n, things))
    first = steps.take()
    again = load(EVERYTHING, steps)
    again["drive"](n, things)
    assert first == steps.take() > 0
    assert counted["Base"].__doc__ == "Another."
    assert counted["Base"].__init__.__doc__ == "And another."


def test_lines_in_tracebacks_are_those_of_the_file():
    text = "def f(n):\n    if n:\n        n += 1\n    return [1 / i for i in range(n)]\n"
    lines = []
    for steps in (None, StepCounter(UNIFORM_COSTS)):
        with pytest.raises(ZeroDivisionError) as caught:
            load(text, steps)["f"](3)
        lines.append([frame.lineno for frame in traceback.extract_tb(caught.value.__traceback__)][1:])
    assert lines[0] == lines[1]
