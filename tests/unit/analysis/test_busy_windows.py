"""Bounds equal those of published examples: the authors' own reference implementations and text books."""

from __future__ import annotations

import pytest

from volery.analysis.busy_windows import (
    Callback,
    DeadlineTask,
    Dedicated,
    LeftOver,
    PeriodicReservation,
    callback_bound,
    edf_bounds,
    executor_bounds,
    fifo_bound,
)
from volery.requirements.response_bounds import OneCore, TaskDemand, response_bounds


def demand(cost, period, jitter=0, name="t"):
    return TaskDemand.periodic(name, 0, cost, period, jitter)


def fixed_priority(*tasks):
    """Bounds of (cost, period), the most urgent first."""
    demands = [
        TaskDemand.periodic(str(number), -number, cost, period) for number, (cost, period) in enumerate(tasks)
    ]
    return list(response_bounds(demands, (), 1).values())


@pytest.mark.parametrize(
    ("tasks", "bounds"),
    [
        # Lehoczky, RTSS 1990, example 2 with either task the more urgent, and example 3
        ([(52, 100), (52, 140)], [52, 156]),
        ([(52, 140), (52, 100)], [52, 108]),
        ([(26, 70), (62, 100)], [26, 118]),
        # Burns and Wellings, Real-Time Systems and Programming Languages: table of response-time analysis
        ([(3, 7), (3, 12), (5, 20)], [3, 6, 20]),
        # SchedCAT's reference task sets, the first and the third of them
        ([(5995, 43000), (2497, 44000), (18376, 52000), (7724, 55000)], [5995, 8492, 26868, 34592]),
        ([(1274, 13000), (5840, 16000), (1433, 15000), (1579, 13000)], [1274, 7114, 8547, 10126]),
    ],
)
def test_fixed_priorities(tasks, bounds):
    assert fixed_priority(*tasks) == bounds


@pytest.mark.parametrize(
    ("tasks", "bounds"),
    [
        # (cost, period, deadline): examples of the reference implementation of Bozhko and Brandenburg
        ([(79, 120, 50), (11, 34, 100), (1, 190, 120)], [79, 101, 121]),
        ([(1, 5, 5), (100, 1000, 1000), (2, 10, 10), (5, 20, 45), (10, 50, 50)], [1, 694, 3, 22, 27]),
        ([(6, 10, 10), (5, 10, 10)], [None, None]),
    ],
)
def test_edf(tasks, bounds):
    given = [
        DeadlineTask(demand(cost, period, name=str(number)), deadline)
        for number, (cost, period, deadline) in enumerate(tasks)
    ]
    assert list(edf_bounds(given).values()) == bounds


def test_fifo():
    assert fifo_bound([demand(79, 120), demand(11, 34), demand(1, 190)]) == 91
    assert fifo_bound([demand(2, 4), demand(2, 8), demand(4, 12)]) is None


RESERVED = PeriodicReservation(5, 3)


def test_a_reservation_supplies_its_budget_late_at_worst():
    assert [RESERVED.time_for(service) for service in (0, 1, 2, 3, 4, 7, 10, 15)] == [
        0,
        5,
        6,
        7,
        10,
        15,
        20,
        27,
    ]


def test_callbacks_of_the_default_executor_under_a_reservation():
    """Casini et al., ECRTS 2019: examples of the authors' reference implementation."""
    own, others = demand(1, 10), [demand(1, 10), demand(3, 20)]
    assert callback_bound(own, others, RESERVED) == 12
    assert callback_bound(own, others, RESERVED, blocking=4) == 20
    assert callback_bound(own, [demand(1, 10), demand(3, 20, jitter=10)], RESERVED) == 17
    assert callback_bound(demand(1, 10), [demand(1, 10), demand(8, 10)], RESERVED) is None


def test_a_chain_of_callbacks():
    """Lemma 8 of Casini et al., with its example: chains of 1 + 2 + 3, 1 + 1 + 1 and 2 + 1."""
    others = [demand(3, 20, jitter=25), demand(3, 20, jitter=25)]
    assert callback_bound(demand(3, 25), [demand(3, 25), *others], RESERVED, steps=demand(6, 25)) == 72


def test_timers_come_before_subscriptions():
    callbacks = [
        Callback(demand(2, 20, name="image")),
        Callback(demand(1, 10, name="first"), timer=True),
        Callback(demand(1, 10, name="second"), timer=True),
    ]
    assert executor_bounds(callbacks, Dedicated()) == {"image": 4, "first": 3, "second": 4}


def test_what_more_urgent_tasks_leave():
    supply = LeftOver(OneCore([demand(3, 7), demand(3, 12)], ()))
    assert supply.time_for(5) == 20
    assert LeftOver(OneCore([demand(7, 7)], ())).time_for(1) is None
