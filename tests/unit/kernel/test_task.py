"""A task by itself: its deadline, its pending execution time, its priority, and its scope."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace

import pytest

from volery.base.time import MS
from volery.kernel.task import (
    MAX_SWALLOWED_CANCELLATIONS,
    NO_DEADLINE,
    Cancelled,
    ExecutionContext,
    Scope,
    Task,
)
from volery.trace.events import NONE, Activation

OWN = ExecutionContext("own", priority=3, deadline=20 * MS)


def task_of(context: ExecutionContext = OWN, scope: Scope | None = None) -> Task:
    return Task("t", context, scope or Scope("s"))


def test_a_deadline_counts_from_the_release() -> None:
    task = task_of()
    assert task.deadline == NO_DEADLINE
    task.release(5 * MS)
    assert task.deadline == 25 * MS
    assert task.finish(30 * MS) == Activation(5 * MS, 30 * MS, "own", 25 * MS)
    assert task.finish(31 * MS) is None
    assert task.deadline == NO_DEADLINE


def test_no_deadline_is_the_last_instant_that_64_bits_hold() -> None:
    assert NO_DEADLINE == 9_223_372_036_854_775_807
    task = task_of(replace(OWN, deadline=None))
    task.release(0)
    assert task.deadline == NO_DEADLINE
    assert task.finish(1) == Activation(0, 1, "own", NONE)


def test_a_release_counts_from_its_due_time_unless_another_is_stated() -> None:
    released: list[Task] = []
    task = task_of(replace(OWN, on_release=released.append))
    task.readings["here"] = 4
    task.release(7)
    assert (task.released, task.counted_from, task.readings, released) == (7, 7, {}, [task])
    task.release(8, 11)
    assert (task.released, task.counted_from) == (8, 11)


def test_pending_time_is_what_was_charged_and_what_the_meter_of_the_innermost_context_reads() -> None:
    task = task_of(replace(OWN, meter=lambda: 1000))
    task.charge(3)
    task.charge(4)
    assert [task.take_pending(), task.take_pending()] == [1007, 1000]
    task.enter(ExecutionContext("called", meter=lambda: 50))
    assert task.take_pending() == 50
    task.enter(ExecutionContext("deeper"))
    task.charge(2)
    assert [task.take_pending(), task.take_pending()] == [2, 0]


def test_a_passive_context_inherits_the_priority() -> None:
    task = task_of()
    task.enter(ExecutionContext("passive", priority=None))
    assert (task.priority, task.context.component) == (3, "passive")
    task.enter(ExecutionContext("urgent", priority=9))
    assert task.priority == 9
    assert task_of(ExecutionContext("nowhere", priority=None)).priority == 0
    assert ExecutionContext("plain").priority == 0


def test_a_new_task_is_in_its_scope_and_at_its_beginning() -> None:
    scope = Scope("s")
    task = task_of(scope=scope)
    assert scope.tasks == [task]
    assert (task.pending_ns, task.released, task.counted_from, task.event, task.swallowed) == (
        0,
        None,
        0,
        0,
        0,
    )
    assert (task.done, task.adopted, task.woken, task.pending_cancellation) == (False, False, False, None)
    assert (task.name, task.waiting_for, task.context) == ("t", "", OWN)


def test_a_cancellation_is_delivered_until_the_task_has_swallowed_ten() -> None:
    scope = Scope("s")
    task = task_of(scope=scope)
    task.deliver_cancellation()
    scope.mark("enough")
    for _ in range(MAX_SWALLOWED_CANCELLATIONS):
        with pytest.raises(Cancelled, match="enough"):
            task.deliver_cancellation()
    task.deliver_cancellation()
    assert task.swallowed == MAX_SWALLOWED_CANCELLATIONS + 1 == 11


def test_a_script_is_cancelled_each_time() -> None:
    scope = Scope("s")
    task = task_of(scope=scope)
    task.adopted = True
    scope.mark("enough")
    for _ in range(MAX_SWALLOWED_CANCELLATIONS + 5):
        with pytest.raises(Cancelled):
            task.deliver_cancellation()


def test_another_error_is_raised_once() -> None:
    task = task_of()
    task.pending_cancellation = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        task.deliver_cancellation()
    task.deliver_cancellation()
    assert task.swallowed == 0


def test_a_task_that_is_spawned_in_a_cancelled_scope_is_cancelled() -> None:
    scope = Scope("s", cancelled="gone")
    with pytest.raises(Cancelled, match="gone"):
        task_of(scope=scope).deliver_cancellation()


def test_a_mark_reaches_all_below_and_the_first_reason_stays() -> None:
    top = Scope("top")
    middle = top.child("middle")
    low = middle.child("low")
    inside, outside = task_of(scope=low), task_of(scope=top)
    low.mark("first")
    assert outside.pending_cancellation is None
    top.mark("second")
    assert (low.cancelled, middle.cancelled, top.cancelled) == ("first", "second", "second")
    assert str(inside.pending_cancellation) == "first"
    assert str(outside.pending_cancellation) == "second"
    assert list(top.all_tasks()) == [outside, inside]
    assert top.child("late").cancelled == "second"


def test_children_that_have_ended_are_forgotten() -> None:
    top = Scope("top")
    ended, busy, alive = (top.child(name) for name in ("ended", "busy", "alive"))
    task_of(scope=busy)
    ended.mark("over")
    busy.mark("over")
    new = top.child("new")
    assert top.children == [busy, alive, new]
    assert new.parent is top
    assert alive.is_empty
    assert not busy.is_empty
    assert not top.is_empty


def test_hooks_and_deadlines_are_those_of_the_tasks_own_context_within_a_call_too() -> None:
    released: list[str] = []
    task = task_of(replace(OWN, on_release=lambda one: released.append(one.context.component)))
    task.enter(ExecutionContext("called", deadline=MS, on_release=lambda _: released.append("no")))
    task.release(5 * MS)
    assert (released, task.deadline) == (["called"], 25 * MS)
    assert task.finish(6 * MS) == Activation(5 * MS, 6 * MS, "own", 25 * MS)


def test_contexts_and_scopes_are_themselves_whatever_is_in_them() -> None:
    assert len({OWN, replace(OWN)}) == 2
    assert Scope("s") != Scope("s")
    with pytest.raises(FrozenInstanceError):
        OWN.priority = 4  # type: ignore[misc]
