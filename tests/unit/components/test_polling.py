"""Time passes in loops that poll, others run meanwhile, and the loop is named once."""

from __future__ import annotations

import ast

import pytest

from volery.base.time import MS, US, S
from volery.components.loader import Loader, parse
from volery.components.polling import IDLE, Polling, has_busy_loop
from volery.cost import StepCounter
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import poll
from volery.trace.events import Text

READY = 200 * MS
EMPTY = "while not ready: pass\n"
FULL = "turns = 0\nwhile not ready:\n    turns += 1\n"
BEGIN = "ready = []\ngive(ready)\nclass poll:\n    ok = time = staticmethod(lambda: False)\n"


@pytest.fixture
def run(tmp_path):
    """Execute a file whose list ``ready`` gets an item at 0.2 s; return its end, ns, and the warnings."""

    def execute(text, steps=None, counts=False):
        file = tmp_path / "busy.py"
        file.write_text(BEGIN + text)
        events = []
        told.clear()
        kernel = VirtualKernel(events.append)
        loader = Loader({}, steps, Polling(kernel, counts))
        ends = []

        def body():
            source = parse(file)
            module = loader.shared.module("busy", file)
            module.give = lambda ready: kernel.call_at(READY, lambda: ready.append(1))
            module.ask = lambda: poll(kernel, 30)
            module.tell = told.append
            exec(loader.compile(source, module), vars(module))
            ends.append(kernel.now())

        kernel.spawn(body, "busy", ExecutionContext("busy"))
        kernel.run(S)
        (end,) = ends
        return end, [event.text for event in events if isinstance(event, Text)]

    return execute


told = []
COMPUTES = """turns = 0
while not ready:
    ask()
    turns += 1
    total = 0
    for number in range(200): total += number
tell(turns)
"""
CLOCK = "while True:\n    now = poll.time()\n    if ready:\n        break\n"
IF = """while True:
    if ready:
        break
    elif len(ready) > 1:
        pass
"""


@pytest.mark.parametrize(
    "text",
    [
        EMPTY,
        CLOCK,
        IF.replace("len(ready) > 1", "ready is None"),
        EMPTY.replace("not", "not poll.ok() and not"),
    ],
)
@pytest.mark.parametrize("counted", [False, True])
def test_an_empty_loop_ends_soon_after_what_it_waits_for(run, text, counted):
    end, warnings = run(text, StepCounter() if counted else None)
    assert READY <= end <= READY + IDLE
    assert len(warnings) == 1
    assert warnings[0].startswith("the loop of busy.py:")
    assert "has no sleep" in warnings[0]


def test_a_loop_that_counts_ends_too_and_computes_for_free_until_it_is_long(run):
    end, warnings = run(FULL)
    assert READY <= end <= READY + MS
    assert [text[:22] for text in warnings] == ["the loop of busy.py:6 "]
    assert run("n = 0\nwhile n < 15000: n += 1\n") == (0, [])


def test_turns_are_counted_so_that_each_run_is_the_same(run):
    assert run(FULL) == run(FULL)


@pytest.mark.parametrize("counted", [False, True])
def test_only_the_turns_that_do_nothing_wait(run, counted):
    text = "n = 0\nwhile n < 900:\n    if n < 899: n += 1\n    elif ready: n += 1\n"
    end, _ = run(text, StepCounter() if counted else None)
    assert READY <= end <= READY + IDLE


def test_a_condition_that_calls_is_no_empty_loop(run):
    end, warnings = run("items = iter(range(100))\nwhile next(items) < 90: pass\n")
    assert (end, warnings) == (0, [])


def test_what_a_loop_computes_takes_time_where_no_code_is_counted(run):
    end, warnings = run(COMPUTES, counts=True)
    (turns,) = told
    assert READY <= end <= READY + 2 * MS
    assert len(warnings) == 1
    assert 2 * US < READY / turns < 20 * US  # 200 additions
    assert run(COMPUTES, counts=True) == (end, warnings)
    assert told == [turns]


def test_a_file_whose_loops_wait_is_not_counted():
    waits = "while True:\n    rate.sleep()\nwhile not rospy.is_shutdown(): rclpy.spin_once(node)\n"
    assert not has_busy_loop(ast.parse(waits))
    assert has_busy_loop(ast.parse(f"{waits}while not rospy.is_shutdown(): compute()\n"))
