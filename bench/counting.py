"""What the steps of counted Python are worth on this machine, and what counting costs.

One step is the addition of two local integers with the store of its result. The table sets the weights that
``volery.components.counting`` gives to other syntax beside what they take here, in hot loops of this
interpreter.

    python bench/counting.py
"""

from __future__ import annotations

import ast
import platform
import timeit

from volery.components.counting import PER_ROUND, Steps

ROUNDS = 100_000
STATEMENTS = (
    "c = a + b",
    "c += 1",
    "a < b",
    "x.v",
    "l[1]",
    "d['a']",
    "f()",
    "x.m()",
    "len(l)",
    "isinstance(a, int)",
    "(a, b)",
    "[a, b]",
    "{a: b}",
    "f'{a}'",
    "-a",
    "a and b",
    "a if a else b",
    "lambda: 0",
    "[q for q in l]",
    "sum(q for q in l)",
    "for q in l: pass",
)
PREAMBLE = """
class X:
    v = 1
    def m(self): pass
def f(): pass
def run(n):
    a = 3; b = 4; c = 0; l = [1, 2, 3]; d = {'a': 1}; x = X()
    for _ in range(n):
        STATEMENT
"""
PROGRAM = """
from math import sin
def run(n):
    total, path = 0.0, []
    for number in range(n):
        point = (number * 0.1, sin(number), number % 7)
        if point[2] > 3:
            path.append(point)
        elif total > 1e6:
            total = 0.0
        total += sum(part * part for part in point)
    return total, len(path)
"""


def namespace(text: str, steps: Steps | None = None) -> dict:
    tree = ast.parse(text)
    names = {}
    if steps:
        tree = steps.instrument(tree)
        names = steps.names()
    exec(compile(tree, "bench", "exec"), names)
    return names


def nanoseconds(statement: str) -> float:
    run = namespace(PREAMBLE.replace("STATEMENT", statement))["run"]
    return min(timeit.repeat(lambda: run(ROUNDS), number=1, repeat=5)) / ROUNDS * 1e9


def steps_of(statement: str) -> int:
    steps = Steps()
    run = namespace(PREAMBLE.replace("STATEMENT", statement), steps)["run"]
    steps.take()
    run(0)
    empty = steps.take()
    run(1)
    return steps.take() - empty - PER_ROUND


def main() -> None:
    empty = nanoseconds("pass")
    step = nanoseconds("c = a + b") - empty
    print(f"{platform.python_implementation()} {platform.python_version()}: a step takes {step:.1f} ns")
    print(f"{'':24}{'measured':>10}{'counted':>10}  steps")
    for statement in STATEMENTS:
        measured = (nanoseconds(statement) - empty) / step
        print(f"{statement:24}{measured:10.1f}{steps_of(statement):10d}")
    plain, counted = namespace(PROGRAM)["run"], namespace(PROGRAM, steps := Steps())["run"]
    both = [min(timeit.repeat(lambda run=run: run(20_000), number=1, repeat=7)) for run in (plain, counted)]
    steps.take()
    counted(20_000)
    taken = both[0] / steps.take() * 1e9
    print(f"a program takes {taken:.1f} ns a step; counting makes it {both[1] / both[0]:.2f} times slower")


if __name__ == "__main__":
    main()
