import re

import pytest

from volery.calibration.queue_measurement import (
    FILLERS,
    INTEGER,
    INTEGER_LOADS,
    INTEGER_VECTOR,
    LOADS,
    VECTOR,
    WINDOW,
    QueueSizes,
    source,
    steps_of,
)
from volery.cost import IssueQueue

COMPUTING = ("integer", "branch", "multiply", "divide")


def test_pipes_whose_operations_fill_one_queue_together_share_it():
    found = QueueSizes({INTEGER: 97, VECTOR: 98, LOADS: 70, INTEGER_VECTOR: 96, INTEGER_LOADS: 130})
    assert found.issue_queues() == (
        IssueQueue(entries=97, pipes=(*COMPUTING, "vector", "slow")),
        IssueQueue(entries=70, pipes=("load",)),
    )


def test_one_queue_of_everything():
    found = QueueSizes({INTEGER: 96, VECTOR: 96, LOADS: 96, INTEGER_VECTOR: 96, INTEGER_LOADS: 96})
    assert found.issue_queues() == (IssueQueue(entries=96, pipes=(*COMPUTING, "vector", "slow", "load")),)


def test_a_queue_of_each():
    found = QueueSizes({INTEGER: 60, VECTOR: 64, LOADS: 40, INTEGER_VECTOR: 120, INTEGER_LOADS: 80})
    assert [(one.entries, one.pipes) for one in found.issue_queues()] == [
        (60, COMPUTING),
        (64, ("vector", "slow")),
        (40, ("load",)),
    ]


def test_a_queue_that_is_not_found_limits_nothing():
    assert QueueSizes({INTEGER: 60, INTEGER_VECTOR: 60}).issue_queues() == (
        IssueQueue(entries=60, pipes=COMPUTING),
    )
    assert QueueSizes({VECTOR: 60}).issue_queues() == ()


@pytest.mark.parametrize(
    ("found", "window", "assumed"), [({WINDOW: 224}, 224, ()), ({}, 512, ("the window",))]
)
def test_a_window_that_is_not_found_is_assumed_and_named(found, window, assumed):
    assert QueueSizes(found).window == window
    assert QueueSizes(found).assumed() == assumed


def test_a_probe_has_its_number_of_instructions_after_each_of_the_two_loads():
    made = dict(re.findall(r"static void (\w+)\(long passes\) \{ CHASE\(\"(.*)\"\); \}", source()))
    assert made.keys() == {f"{kind}_{count}" for kind in FILLERS for count in steps_of(kind)}
    own = made["window_48"].split("; ")
    assert sum(one in ("mov $1, %%r8d", "mov $1, %%r9d") for one in own) == 2 * 24
    assert (sum(one.startswith("addsd ") for one in own), own.count("jc 1f")) == (2 * 12, 2 * 12)
    assert sum(text.startswith("add ") for text in made["integer_vector_12"].split("; ")) == 2 * 6
    assert sum(text.startswith("addsd ") for text in made["integer_vector_12"].split("; ")) == 2 * 6
    assert made["loads_16"].count("(%%rdx,%%rax)") == 2 * 16
