"""Counting changes nothing that code does, and gives the same steps each time."""

from __future__ import annotations

import ast
import traceback

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.components.counting import PER_ITEM, PER_ROUND, WEIGHTS, Steps


def load(text, steps=None):
    """The namespace of *text*, counted if *steps* is given."""
    tree = ast.parse(text)
    names = {"__name__": "user"}
    if steps is not None:
        tree = steps.instrument(tree)
        names |= steps.names()
    exec(compile(tree, "user.py", "exec"), names)
    if steps is not None:
        steps.take()
    return names


def count(text, *arguments):
    steps = Steps()
    function = load(text, steps)["f"]
    function(*arguments)
    return steps.take()


CALL, BIN, COMPARE = WEIGHTS[ast.Call], WEIGHTS[ast.BinOp], WEIGHTS[ast.Compare]


@pytest.mark.parametrize(
    ("text", "argument", "expected"),
    [
        ("def f(n):\n    a = n + n\n    return a\n", 1, BIN),
        ("def f(n):\n    for i in range(n):\n        n + i\n", 10, CALL + 10 * (PER_ROUND + BIN)),
        ("def f(n):\n    while n > 0:\n        n = n - 1\n", 5, 5 * (PER_ROUND + COMPARE + BIN)),
        ("def f(n):\n    if n > 0:\n        n + n + n\n    else:\n        n + n\n", 1, COMPARE + 2 * BIN),
        ("def f(n):\n    if n > 0:\n        n + n + n\n    else:\n        n + n\n", -1, COMPARE + BIN),
        # what an early return leaves out is not counted
        ("def f(n):\n    if n > 0:\n        return n\n    n + n\n    n + n\n", 1, COMPARE),
        ("def f(n):\n    if n > 0:\n        return n\n    n + n\n    n + n\n", 0, COMPARE + 2 * BIN),
        (
            "def f(n):\n    for i in n:\n        if i > 2:\n            continue\n        i + i\n",
            [1, 9, 9],
            3 * (PER_ROUND + COMPARE) + BIN,
        ),
        # comprehensions and lambdas count by the item and by the call
        ("def f(n):\n    [i + i for i in n]\n", range(7), WEIGHTS[ast.ListComp] + 7 * (PER_ITEM + BIN)),
        (
            "def f(n):\n    [i + i for i in n if i > 4]\n",
            range(7),
            WEIGHTS[ast.ListComp] + 7 * (PER_ITEM + COMPARE) + 2 * (PER_ITEM + BIN),
        ),
        (
            "def f(n):\n    g = lambda x: x + x\n    g(n)\n    g(n)\n",
            1,
            WEIGHTS[ast.Lambda] + 2 * CALL + 2 * (BIN + 1),
        ),
        (
            "def f(n):\n  try:\n    n + n\n  except ValueError:\n    n + n\n  finally:\n    n + n\n",
            1,
            2 * BIN,
        ),
    ],
)
def test_steps_are_what_was_executed(text, argument, expected):
    assert count(text, argument) == expected


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
    steps = Steps()
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
    for steps in (None, Steps()):
        with pytest.raises(ZeroDivisionError) as caught:
            load(text, steps)["f"](3)
        lines.append([frame.lineno for frame in traceback.extract_tb(caught.value.__traceback__)][1:])
    assert lines[0] == lines[1]
