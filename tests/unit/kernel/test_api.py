"""What holds on both clocks."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial

import pytest

from volery.base.errors import UsageError
from volery.base.time import MS, S
from volery.kernel.api import Kernel
from volery.kernel.task import Cancelled, ExecutionContext, Task
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import Event, Queue, sleep
from volery.kernel.wall import WallKernel

Spawn = Callable[..., Task]
LONG = 1000 * S  # of the kernel's time: a second on the wall at most


def test_actions_of_one_instant_run_in_the_order_of_the_calls(kernel: Kernel) -> None:
    seen: list[int] = []
    for i in range(5):
        kernel.call_at(10 * MS, lambda i=i: seen.append(i))
    kernel.call_at(0, lambda: seen.append(-1))
    kernel.run(LONG)
    assert seen == [-1, 0, 1, 2, 3, 4]


def test_a_cancelled_action_does_not_happen(kernel: Kernel) -> None:
    seen: list[str] = []
    handle = kernel.call_at(10 * MS, lambda: seen.append("late"))
    kernel.call_at(5 * MS, handle.cancel)
    kernel.call_at(20 * MS, lambda: seen.append("end"))
    kernel.run(LONG)
    assert seen == ["end"]


def test_a_cancellation_between_an_interaction_point_and_a_wait_ends_the_wait(
    kernel: Kernel, spawn: Spawn
) -> None:
    ended: list[str] = []

    def body() -> None:
        kernel.interact()
        kernel.cancel(kernel.root, "enough")
        try:
            kernel.park(None, "nothing")
        except Cancelled as error:
            ended.append(str(error))
            raise

    spawn(body)
    kernel.run(LONG)
    kernel.close()
    assert ended == ["enough"]


def test_every_begins_now_repeats_and_can_be_stopped_from_inside(kernel: Kernel) -> None:
    seen: list[int] = []

    def action() -> None:
        seen.append(len(seen))
        if len(seen) == 4:
            timer.cancel()

    timer = kernel.every(10 * MS, action)
    kernel.run(LONG)
    assert seen == [0, 1, 2, 3]


def test_a_period_must_be_positive(kernel: Kernel) -> None:
    with pytest.raises(UsageError, match="must be above 0"):
        kernel.every(0, lambda: None)


def test_an_action_sees_the_time_it_was_asked_for_or_later(kernel: Kernel) -> None:
    seen: list[int] = []
    kernel.call_at(30 * MS, lambda: seen.append(kernel.now()))
    kernel.run(LONG)
    assert seen[0] >= 30 * MS


def test_the_run_ends_when_nothing_is_left_to_happen(kernel: Kernel, spawn: Spawn) -> None:
    spawn(lambda: sleep(kernel, 10 * MS))
    kernel.run(10**18)  # for ever, if it did not


def test_a_framework_callback_must_not_block(kernel: Kernel) -> None:
    problems: list[str] = []

    def action() -> None:
        for blocking in (lambda: sleep(kernel, MS), lambda: kernel.park(None, "godot")):
            with pytest.raises(UsageError) as caught:
                blocking()
            problems.append(str(caught.value))

    kernel.call_at(0, action)
    kernel.run(LONG)
    assert "only a task can wait" in problems[0]
    assert "godot" in problems[1]


def test_current_is_the_running_task_and_none_in_framework_callbacks(kernel: Kernel, spawn: Spawn) -> None:
    seen: list[object] = []
    looked = Event(kernel, "a callback looked")

    def look() -> None:
        seen.append(kernel.current())
        looked.set()

    def body() -> None:
        seen.append(kernel.current())
        kernel.call_at(kernel.now(), look)
        looked.wait()
        seen.append(kernel.current())

    task = spawn(body)
    kernel.run(LONG)
    assert seen == [task, None, task]
    assert kernel.current() is None


def test_a_task_can_spawn_tasks(kernel: Kernel, spawn: Spawn) -> None:
    done: Queue[str] = Queue(kernel, "done")
    got: list[str] = []

    def parent() -> None:
        for name in ("a", "b"):
            spawn(lambda name=name: done.put(name), name)
        got.append(done.get())
        got.append(done.get())

    spawn(parent, "parent")
    kernel.run(LONG)
    assert sorted(got) == ["a", "b"]


def test_what_escapes_from_a_task_is_raised_by_run_as_it_is(kernel: Kernel, spawn: Spawn) -> None:
    fault = ValueError("an error of the framework")

    def body() -> None:
        sleep(kernel, MS)
        raise fault

    spawn(body)
    with pytest.raises(ValueError, match="an error of the framework") as caught:
        kernel.run(LONG)
    assert caught.value is fault


def test_exceptions_of_framework_callbacks_are_raised_by_run_which_can_continue(
    kernel: Kernel, spawn: Spawn
) -> None:
    seen: list[str] = []
    flag = Event(kernel, "flag")

    def crash() -> None:
        raise ZeroDivisionError

    spawn(lambda: (flag.wait(), seen.append("went on")))
    kernel.call_at(MS, crash)
    with pytest.raises(ZeroDivisionError):
        kernel.run(LONG)
    kernel.call_at(kernel.now(), flag.set)
    kernel.run(LONG)
    assert seen == ["went on"]


def test_run_from_inside_is_refused(kernel: Kernel, spawn: Spawn) -> None:
    seen: list[str] = []

    def body() -> None:
        for refused in (lambda: kernel.run(LONG), kernel.close):
            with pytest.raises(UsageError) as caught:
                refused()
            seen.append(str(caught.value))

    spawn(body)
    kernel.run(LONG)
    assert len(seen) == 2
    assert "from inside" in seen[0]


def test_park_returns_whether_the_task_was_woken(kernel: Kernel, spawn: Spawn) -> None:
    said: list[bool] = []
    parked = Event(kernel, "parked")

    def sleeper() -> None:
        said.append(kernel.park(kernel.now() + MS, "nobody"))
        with kernel.interact():  # nobody wakes it before it waits
            kernel.call_at(kernel.now() + MS, lambda: kernel.wake(task))
            said.append(kernel.park(kernel.now() + LONG, "somebody"))
        parked.set()

    task = spawn(sleeper)
    kernel.run(LONG)
    assert said == [False, True]
    assert parked.is_set()


@pytest.mark.parametrize("kernel", [VirtualKernel(pace=1000.0), WallKernel(speed=1000.0)])
def test_foreign_threads_post_into_a_run_in_which_nothing_else_happens(kernel: Kernel) -> None:
    inbox: Queue[str] = Queue(kernel, "inbox")
    got: list[str] = []

    def reader() -> None:
        while len(got) < 2:
            got.append(inbox.get())
        kernel.cancel(kernel.root, "that was all")

    kernel.spawn(reader, "reader", ExecutionContext("reader"))
    for name in ("a", "b"):
        thread = threading.Thread(target=partial(kernel.post, partial(inbox.put, name)))
        kernel.call_at(0, thread.start)
    kernel.run(10**18)
    assert sorted(got) == ["a", "b"]
    assert kernel.close() == []


def test_what_a_task_costs_nowhere_is_forgotten(kernel: Kernel) -> None:
    meter = iter([7, 0, 5, 0, 0, 0, 0, 0])
    task = kernel.spawn(lambda: sleep(kernel, MS), "t", ExecutionContext("t", meter=lambda: next(meter)))
    task.charge(5)
    kernel.run(LONG)
    assert task.pending_ns == 0
