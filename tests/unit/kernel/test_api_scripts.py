"""A script or a REPL as a task."""

from __future__ import annotations

import threading
from collections.abc import Callable

import pytest

from volery.base.errors import Deadlock, UsageError
from volery.base.time import MS, S
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext, Task
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import Event, Queue, sleep
from volery.kernel.wall import WallKernel
from volery.trace.events import Event as Recorded

Spawn = Callable[..., Task]


def test_virtual_time_runs_while_the_script_blocks_and_stands_still_while_it_does_not(
    virtual: VirtualKernel,
) -> None:
    ticks: list[int] = []
    virtual.every(S, lambda: ticks.append(virtual.now()))
    with virtual.adopt("script"):
        assert ticks == []
        sleep(virtual, 3 * S + 1)
        assert len(ticks) == 4
        assert virtual.now() == 3 * S + 1
    with virtual.adopt("script"):
        assert virtual.now() == 3 * S + 1
        sleep(virtual, 10 * S)
        assert len(ticks) == 14


def test_a_script_and_tasks_hand_things_to_each_other(kernel: Kernel, spawn: Spawn) -> None:
    questions: Queue[int] = Queue(kernel, "questions")
    answers: Queue[int] = Queue(kernel, "answers")

    def server() -> None:
        while True:
            question = questions.get()
            sleep(kernel, 10 * MS)
            answers.put(question * question)

    spawn(server)
    for _ in range(3):  # as at a prompt
        with kernel.adopt("prompt"):
            for number in range(5):
                questions.put(number)
                assert answers.get() == number * number


def test_a_script_can_spawn(kernel: Kernel, spawn: Spawn) -> None:
    with kernel.adopt("script"):
        done = Event(kernel, "done")
        spawn(done.set)
        assert done.wait(1000 * S)


def test_after_a_script_a_run_goes_on(kernel: Kernel, spawn: Spawn) -> None:
    seen: list[str] = []
    with kernel.adopt("script"):
        sleep(kernel, MS)
    spawn(lambda: (sleep(kernel, MS), seen.append("ran")))
    kernel.run(kernel.now() + 1000 * S)
    assert seen == ["ran"]
    with kernel.adopt("script"):
        sleep(kernel, MS)


def test_a_script_gets_exceptions_of_framework_callbacks(kernel: Kernel) -> None:
    never = Event(kernel, "never")

    def crash() -> None:
        raise ZeroDivisionError

    with kernel.adopt("script"):
        kernel.call_at(kernel.now() + MS, crash)
        with pytest.raises(ZeroDivisionError):
            never.wait()
        sleep(kernel, MS)


def test_a_script_gets_what_escapes_from_a_task(kernel: Kernel, spawn: Spawn) -> None:
    never = Event(kernel, "never")

    def crash() -> None:
        raise ZeroDivisionError

    with kernel.adopt("script"):
        spawn(crash)
        with pytest.raises(ZeroDivisionError):
            never.wait()


def test_a_script_gets_the_deadlock_it_is_in(virtual: VirtualKernel) -> None:
    with (
        pytest.raises(Deadlock, match="nothing can happen any more; waiting: script for godot"),
        virtual.adopt("script"),
    ):
        Event(virtual, "godot").wait()
    with virtual.adopt("script"):
        sleep(virtual, S)


def test_a_wait_of_a_script_that_was_cut_short_does_not_disturb_its_next_wait(virtual: VirtualKernel) -> None:
    def crash() -> None:
        raise ZeroDivisionError

    with virtual.adopt("script"):
        virtual.call_at(10, crash)
        with pytest.raises(ZeroDivisionError):
            sleep(virtual, 100)
        assert virtual.now() == 10
        sleep(virtual, 1000)
        assert virtual.now() == 1010


def test_an_error_of_the_script_passes_through(kernel: Kernel) -> None:
    def script() -> None:
        with kernel.adopt("script"):
            sleep(kernel, MS)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        script()
    assert kernel.current() is None


def test_the_end_of_everything_ends_the_context_quietly(kernel: Kernel) -> None:
    seen: list[str] = []
    with kernel.adopt("script"):
        kernel.call_at(kernel.now() + MS, lambda: kernel.cancel(kernel.root, "over"))
        sleep(kernel, 3600 * S)
        seen.append("never")
    assert seen == []
    assert kernel.close() == []


def test_a_flow_is_adopted_once_and_does_not_run_the_kernel_itself(kernel: Kernel) -> None:
    with kernel.adopt("script"):
        with pytest.raises(UsageError, match="is the task 'script' already"), kernel.adopt("again"):
            pass
        with pytest.raises(UsageError, match="from inside"):
            kernel.run(S)
        with pytest.raises(UsageError, match="from inside"):
            kernel.close()


def test_with_a_pace_too_time_stands_still_while_the_script_computes() -> None:
    kernel = VirtualKernel(pace=1000.0)
    with kernel.adopt("script"):
        sleep(kernel, S)
        before = kernel.now()
        sum(range(100_000))
        assert kernel.now() == before
        sleep(kernel, S)
        assert kernel.now() == before + S
    kernel.close()


def test_a_script_has_no_activations(events: list[Recorded], kernel: Kernel) -> None:
    with kernel.adopt("script"):
        sleep(kernel, MS)
    assert events == []


def test_the_wall_runs_on_between_scripts() -> None:
    kernel = WallKernel(speed=1000.0)
    ticked = Event(kernel, "ticked")
    with kernel.adopt("script"):
        pass
    kernel.spawn(ticked.set, "background", ExecutionContext("background"))
    with kernel.adopt("script"):
        assert ticked.wait(1000 * S)
    assert kernel.close() == []


def test_only_the_thread_of_a_script_passes_virtual_time(virtual: VirtualKernel) -> None:
    said: list[str] = []

    def elsewhere() -> None:
        try:
            with virtual.joined():
                said.append("joined")
        except UsageError as error:
            said.append(str(error).partition(":")[0])

    def in_another_thread() -> None:
        thread = threading.Thread(target=elsewhere, name="worker")
        thread.start()
        thread.join()

    in_another_thread()
    with virtual.adopt("script"):
        elsewhere()
        in_another_thread()
    assert said == ["joined", "joined", "the thread 'worker' cannot wait in virtual time"]
