"""Virtual time alone: determinism, deadlock, pacing, the watchdog."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable

import pytest
from numba import njit
from numba.core import event

from volery.base.errors import ComponentError, Deadlock, UsageError
from volery.base.time import MS, S
from volery.kernel.interrupts import Watchdog, is_compiling
from volery.kernel.task import MAX_SWALLOWED_CANCELLATIONS, Cancelled, ExecutionContext, Scope, Task
from volery.kernel.virtual import NEVER, Pacer, VirtualKernel
from volery.kernel.waiting import Event, Queue, Signal, sleep

Spawn = Callable[..., Task]


def test_time_jumps_from_event_to_event(virtual: VirtualKernel, spawn: Spawn) -> None:
    seen: list[int] = []

    def body() -> None:
        for duration in (S, 3600 * S):
            sleep(virtual, duration)
            seen.append(virtual.now())

    spawn(body)
    virtual.run(10_000 * S)
    assert seen == [S, 3601 * S]


def test_what_is_due_at_the_end_of_the_run_still_happens_and_nothing_after_it(virtual: VirtualKernel) -> None:
    seen: list[int] = []
    for when in (10, 20, 21):
        virtual.call_at(when, lambda when=when: seen.append(when))
    virtual.run(20)
    assert seen == [10, 20]
    assert virtual.now() == 20
    virtual.run(30)
    assert seen == [10, 20, 21]
    assert virtual.now() == 21  # nothing was left to happen


def test_a_cancelled_entry_does_not_prolong_the_run(virtual: VirtualKernel) -> None:
    virtual.call_at(5, lambda: None)
    virtual.call_at(50, lambda: None).cancel()
    virtual.run(20)
    assert virtual.now() == 5


def test_tasks_of_one_instant_run_in_the_order_in_which_they_asked(
    virtual: VirtualKernel, spawn: Spawn
) -> None:
    seen: list[str] = []

    def body(name: str) -> Callable[[], None]:
        def loop() -> None:
            for _ in range(3):
                sleep(virtual, 10)
                seen.append(name)

        return loop

    for name in "abc":
        spawn(body(name), name)
    virtual.call_at(20, lambda: seen.append("framework"))
    virtual.run(S)
    assert "".join(each[0] for each in seen) == "abcfabcabc"


def test_a_lone_task_leaps_but_not_over_an_action_nor_over_the_end(
    virtual: VirtualKernel, spawn: Spawn
) -> None:
    seen: list[int] = []

    def body() -> None:
        for _ in range(4):
            sleep(virtual, 10)
            seen.append(virtual.now())

    spawn(body)
    virtual.call_at(15, lambda: seen.append(-1))
    virtual.run(30)
    assert seen == [10, -1, 20, 30]
    virtual.run(100)
    assert seen[-1] == 40


def test_a_deadlock_names_the_waiting_tasks_and_their_reasons(virtual: VirtualKernel, spawn: Spawn) -> None:
    queue: Queue[int] = Queue(virtual, "orders")
    flag = Event(virtual, "godot")
    spawn(queue.get, "clerk")
    spawn(flag.wait, "vladimir")
    with pytest.raises(Deadlock) as caught:
        virtual.run(S)
    assert str(caught.value) == "nothing can happen any more; waiting: clerk for orders; vladimir for godot"


def test_after_a_deadlock_the_run_can_go_on(virtual: VirtualKernel, spawn: Spawn) -> None:
    queue: Queue[int] = Queue(virtual, "orders")
    got: list[int] = []
    spawn(lambda: got.append(queue.get()), "clerk")
    with pytest.raises(Deadlock):
        virtual.run(S)
    queue.put(7)
    virtual.run(2 * S)
    assert got == [7]


def test_a_time_out_that_was_not_needed_does_not_disturb_a_later_wait(
    virtual: VirtualKernel, spawn: Spawn
) -> None:
    seen: list[tuple[bool, int]] = []
    first, second = Event(virtual, "first"), Event(virtual, "second")

    def body() -> None:
        seen.append((first.wait(100), virtual.now()))
        seen.append((second.wait(500), virtual.now()))

    spawn(body)
    virtual.call_at(50, first.set)
    virtual.run(S)
    assert seen == [(True, 50), (False, 550)]


def test_waking_twice_or_a_task_that_is_gone_changes_nothing(virtual: VirtualKernel, spawn: Spawn) -> None:
    seen: list[int] = []

    def body() -> None:
        virtual.park(None, "a first wake")
        seen.append(virtual.now())
        virtual.park(100, "another")
        seen.append(virtual.now())

    task = spawn(body)
    virtual.wake(task)  # it has not begun
    virtual.call_at(10, lambda: (virtual.wake(task), virtual.wake(task)))
    virtual.run(S)
    virtual.wake(task)
    assert seen == [10, 100]


def test_two_runs_record_the_same(spawn: Spawn) -> None:
    def once() -> list[tuple[int, str]]:
        kernel = VirtualKernel()
        seen: list[tuple[int, str]] = []
        queue: Queue[str] = Queue(kernel, "queue")

        def producer(name: str, period: int) -> Callable[[], None]:
            def loop() -> None:
                for _ in range(20):
                    sleep(kernel, period)
                    queue.put(name)

            return loop

        def consumer() -> None:
            for _ in range(60):
                seen.append((kernel.now(), queue.get()))

        for name, period in (("a", 3), ("b", 5), ("c", 3)):
            kernel.spawn(producer(name, period), name, ExecutionContext(name))
        kernel.spawn(consumer, "consumer", ExecutionContext("consumer"))
        kernel.run(S)
        return seen

    assert once() == once()


def test_many_tasks_can_come_and_go(virtual: VirtualKernel, spawn: Spawn) -> None:
    finished: list[int] = []

    def child(number: int) -> Callable[[], None]:
        def body() -> None:
            sleep(virtual, number % 7)
            finished.append(number)

        return body

    def parent() -> None:
        for number in range(2000):
            spawn(child(number), str(number))
            sleep(virtual, 1)

    spawn(parent, "parent")
    virtual.run(S)
    assert sorted(finished) == list(range(2000))
    assert virtual.root.tasks == []


def test_a_post_gets_in_between_tasks_that_hand_over_directly(virtual: VirtualKernel, spawn: Spawn) -> None:
    posted: list[int] = []

    def body() -> None:
        for number in range(10):
            sleep(virtual, 10)
            if number == 4:
                virtual.post(lambda: posted.append(virtual.now()))

    spawn(body, "a")
    spawn(body, "b")
    virtual.run(S)
    assert posted == [50, 50]


@pytest.mark.parametrize("pace", [0.0, -1.0])
def test_a_pace_must_be_positive(pace: float) -> None:
    with pytest.raises(UsageError, match="above 0"):
        VirtualKernel(pace=pace)


def test_with_a_pace_everything_happens_at_the_same_virtual_times() -> None:
    def once(pace: float | None) -> list[int]:
        kernel = VirtualKernel(pace=pace)
        seen: list[int] = []
        kernel.every(30 * MS, lambda: seen.append(kernel.now()))

        def body() -> None:
            for _ in range(5):
                sleep(kernel, 70 * MS)
                seen.append(kernel.now())

        kernel.spawn(body, "sleeper", ExecutionContext("sleeper"))
        kernel.run(S)
        assert kernel.now() == S
        kernel.close()
        return seen

    assert once(1000.0) == once(None)


def test_with_a_pace_an_empty_run_lasts_to_its_end() -> None:
    kernel = VirtualKernel(pace=1e6)
    kernel.run(S)
    assert kernel.now() == S


def test_with_a_pace_a_post_is_dated_between_the_events_around_it() -> None:
    kernel = VirtualKernel(pace=1.0)
    seen: list[int] = []

    def posted() -> None:
        seen.append(kernel.now())
        kernel.cancel(kernel.root, "seen")

    kernel.call_at(MS, lambda: kernel.post(posted))
    kernel.call_at(3600 * S, lambda: None)
    kernel.run(3601 * S)
    assert MS <= seen[0] < 3600 * S


def test_with_a_pace_a_post_ends_the_wait_for_the_wall() -> None:
    kernel = VirtualKernel(pace=1.0)
    heard = threading.Semaphore(0)

    def visitor() -> None:
        for _ in range(200):  # some of them while the kernel waits
            kernel.post(heard.release)
            heard.acquire()
        kernel.post(lambda: kernel.cancel(kernel.root, "served"))

    kernel.call_at(0, threading.Thread(target=visitor).start)
    kernel.run(10**18)
    kernel.close()


def test_a_pacer_lets_pass_what_passes_on_the_wall_and_makes_nothing_good(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wall = [0]
    monkeypatch.setattr("volery.kernel.virtual.monotonic_ns", lambda: wall[0])
    pacer = Pacer(2.0)

    def cut_short(now: int, when: int) -> int | None:
        pacer.wake_up()
        return pacer.wait(now, when)

    assert cut_short(0, 10 * S) == 0
    wall[0] = 3 * S
    assert cut_short(0, 10 * S) == 6 * S
    assert pacer.wait(6 * S, 6 * S) is None
    wall[0] = 5 * S
    assert pacer.wait(6 * S, 10 * S) is None  # no ring: it would wait for ever
    wall[0] = 9 * S
    assert pacer.wait(10 * S, 11 * S) is None  # 7 s too late
    assert cut_short(11 * S, 19 * S) == 11 * S
    pacer.rest()
    wall[0] = 500 * S
    assert cut_short(11 * S, 12 * S) == 11 * S


def test_the_watchdog_names_component_and_line_of_code_that_freezes_virtual_time() -> None:
    kernel = VirtualKernel(watchdog_s=0.02)

    def endless() -> None:
        sleep(kernel, MS)
        while True:
            pass

    kernel.spawn(endless, "spinner", ExecutionContext("spinner"))
    with pytest.raises(ComponentError, match=r"spinner: virtual time is frozen: .* in .*test_virtual.py:\d+"):
        kernel.run(S)
    assert kernel.close() == []


def test_the_watchdog_also_names_code_that_only_looks() -> None:
    kernel = VirtualKernel(watchdog_s=0.02)
    flag = Event(kernel, "flag")

    def polling() -> None:
        while not flag.is_set():
            pass

    kernel.spawn(polling, "poller", ExecutionContext("poller"))
    with pytest.raises(ComponentError, match=r"poller: virtual time is frozen: .*test_virtual.py:\d+"):
        kernel.run(S)
    assert kernel.close() == []


def test_the_watchdog_reaches_code_that_blocks_the_host() -> None:
    kernel = VirtualKernel(watchdog_s=0.02)
    kernel.spawn(signal.pause, "blocker", ExecutionContext("blocker"))
    with pytest.raises(ComponentError, match="blocker: virtual time is frozen"):
        kernel.run(S)
    kernel.close()


class Accused:
    """Stands in for what delivers an accusation."""

    def __init__(self) -> None:
        self.whom: list[tuple[str, int]] = []

    def report_stall(self, task: Task, now: int, what: str) -> None:
        self.whom.append((task.name, now))


class Still:
    """A kernel as the watchdog sees it."""

    def __init__(self) -> None:
        self.task: Task | None = None
        self.time = 0

    def current(self) -> Task | None:
        return self.task

    def now(self) -> int:
        return self.time


def test_the_watchdog_reports_only_the_task_that_does_not_block() -> None:
    kernel, accused = Still(), Accused()
    dog = Watchdog(kernel, accused, patience_s=10.0)
    a, b = (Task(name, ExecutionContext(name), Scope("run")) for name in "ab")

    def look(moment: float, task: Task | None, time: int) -> None:
        kernel.task, kernel.time = task, time
        dog.check(moment)

    look(0.0, a, 5)
    look(9.0, a, 6)  # time has moved
    look(18.0, b, 6)  # another task
    look(27.0, None, 6)  # a framework callback, such as a first compilation
    look(36.0, b, 6)
    assert accused.whom == []
    look(46.0, b, 6)
    assert accused.whom == [("b", 6)]
    look(55.0, b, 6)  # given time to end
    assert len(accused.whom) == 1
    look(56.0, b, 6)
    assert len(accused.whom) == 2
    a.adopted = True
    for moment in (60.0, 80.0):
        look(moment, a, 6)  # a script may take its time
    assert len(accused.whom) == 2


def test_a_task_that_compiles_is_not_stuck() -> None:
    kernel, accused = Still(), Accused()
    dog = Watchdog(kernel, accused, patience_s=10.0)
    kernel.task, kernel.time = Task("a", ExecutionContext("a"), Scope("run")), 5
    for moment in range(0, 100, 5):
        dog.check(float(moment), compiling=True)
    dog.check(104.0)
    assert accused.whom == []
    dog.check(106.0)  # what it has compiled does not end
    assert accused.whom == [("a", 5)]


def test_the_first_call_of_a_numba_function_compiles_and_the_second_does_not() -> None:
    seen: dict[str, bool] = {}

    class Look(event.Listener):
        def on_start(self, started: event.Event) -> None:
            seen["while it compiles"] = is_compiling(sys._getframe())

        def on_end(self, ended: event.Event) -> None:
            pass

    function = njit(lambda number: number + 1)
    with event.install_listener("numba:compile", Look()):
        assert function(1) == 2
    assert seen == {"while it compiles": True}
    assert not is_compiling(sys._getframe())


def test_the_watchdogs_patience_must_be_positive() -> None:
    with pytest.raises(UsageError, match="above 0"):
        VirtualKernel(watchdog_s=0.0)


def test_a_sleep_until_now_hands_over_to_no_other_task(virtual: VirtualKernel, spawn: Spawn) -> None:
    seen: list[str] = []

    def sleeper() -> None:
        virtual.sleep_until(MS)
        seen.append("before")
        virtual.sleep_until(virtual.now())
        seen.append("after")

    def other() -> None:
        virtual.sleep_until(MS)
        seen.append("other")

    spawn(sleeper, "sleeper")
    spawn(other, "other")
    virtual.run(S)
    assert seen == ["before", "after", "other"]


def test_with_a_pace_a_lone_task_waits_for_the_wall_too(monkeypatch: pytest.MonkeyPatch) -> None:
    waits: list[int] = []
    wait = Pacer.wait

    def waiting(pacer: Pacer, now: int, when: int) -> int | None:
        waits.append(when)
        return wait(pacer, now, when)

    monkeypatch.setattr(Pacer, "wait", waiting)
    kernel = VirtualKernel(pace=1e6)

    def body() -> None:
        for number in range(1, 4):
            kernel.sleep_until(number * MS)

    kernel.spawn(body, "sleeper", ExecutionContext("sleeper"))
    kernel.run(S)
    kernel.close()
    assert {MS, 2 * MS, 3 * MS} <= set(waits)


def test_with_a_pace_the_time_of_each_step_of_a_script_is_not_made_good(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rests: list[int] = []
    rest = Pacer.rest

    def resting(pacer: Pacer) -> None:
        rests.append(kernel.now())
        rest(pacer)

    kernel = VirtualKernel(pace=1e6)
    with kernel.adopt("script"):
        sleep(kernel, S)
        monkeypatch.setattr(Pacer, "rest", resting)
        sleep(kernel, S)
        sleep(kernel, S)
    assert rests == [S, 2 * S]
    kernel.close()


def test_the_reason_of_a_close_reaches_its_tasks(virtual: VirtualKernel, spawn: Spawn) -> None:
    seen: list[str] = []

    def body() -> None:
        try:
            virtual.park()
        except Cancelled as error:
            seen.append(str(error))
            raise

    spawn(body, "waiting")
    with pytest.raises(Deadlock):
        virtual.run(S)
    assert virtual.close("power off") == []
    assert seen == ["power off"]
    assert virtual.root.cancelled == "power off"


def test_time_begins_at_0_and_is_skipped_up_to_the_next_event_and_the_end(
    virtual: VirtualKernel, spawn: Spawn
) -> None:
    assert virtual.now() == 0
    found: list[int] = []

    def body() -> None:
        found.append(virtual.skip(5 * MS))  # something is due then
        found.append(virtual.skip(4 * MS))
        virtual.sleep_until(6 * MS)
        found.append(virtual.skip(5 * MS))  # beyond the end
        found.append(virtual.skip(4 * MS))
        found.append(virtual.now())

    virtual.call_at(5 * MS, lambda: None)
    spawn(body)
    virtual.run(10 * MS)
    assert found == [NEVER, 0, NEVER, 6 * MS, 10 * MS]


@pytest.mark.parametrize("waits", ["sleep", "signal"])
def test_a_task_that_swallows_too_many_cancellations_never_runs_again(
    waits: str, virtual: VirtualKernel, spawn: Spawn
) -> None:
    changed, scope = Signal(virtual, "level"), Scope("mission", virtual.root)
    swallowed: list[int] = []

    def body() -> None:
        while True:
            try:
                if waits == "sleep":
                    virtual.sleep_until(virtual.now() + MS)
                else:
                    changed.wait_for(lambda: False, MS)
            except Cancelled:
                swallowed.append(virtual.now())

    others: list[int] = []
    virtual.every(MS, lambda: others.append(virtual.now()))
    task = spawn(body, scope=scope)
    virtual.call_at(5 * MS, lambda: virtual.cancel(scope, "enough"))
    virtual.run(20 * MS)
    assert swallowed == [5 * MS] * MAX_SWALLOWED_CANCELLATIONS
    assert others[-1] == 20 * MS
    assert not task.done


def test_a_callback_cannot_sleep_and_has_nothing_to_compute(virtual: VirtualKernel, spawn: Spawn) -> None:
    consumed: list[bool] = []
    virtual.call_at(MS, lambda: consumed.append(virtual.consume(MS)))
    spawn(lambda: consumed.append(virtual.consume(MS)))
    virtual.run(S)
    assert consumed == [True, False]
    virtual.call_at(virtual.now(), lambda: virtual.sleep_until(5 * S))
    with pytest.raises(UsageError, match="a framework callback must not block, but waits for a time"):
        virtual.run(S)


def test_the_watchdog_ends_with_its_kernel() -> None:
    kernel = VirtualKernel(watchdog_s=0.04)
    kernel.call_at(MS, lambda: None)
    kernel.run(S)
    (dog,) = [thread for thread in threading.enumerate() if thread.name == "watchdog"]
    kernel.close()
    dog.join(5.0)
    assert not dog.is_alive()
