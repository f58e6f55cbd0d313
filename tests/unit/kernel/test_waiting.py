"""Waits, and the activations that they end."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any

import pytest

from volery.base.errors import UsageError
from volery.base.time import MS, S
from volery.kernel.api import Kernel
from volery.kernel.network import Network
from volery.kernel.processor import Processor
from volery.kernel.task import ExecutionContext, Task
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import (
    Event,
    Lock,
    Queue,
    Rate,
    Signal,
    _place_of_caller,
    current_task,
    end_activation,
    executing_in,
    next_release,
    read_clock,
    sleep,
)
from volery.trace.events import NONE, Activation
from volery.trace.events import Event as Recorded

Spawn = Callable[..., Task]
LONG = 1000 * S


# -- signals, events, queues


def test_a_signal_waits_for_its_predicate(kernel: Kernel, spawn: Spawn) -> None:
    changed = Signal(kernel, "level")
    level = [0]
    seen: list[int] = []

    def raise_level() -> None:
        level[0] += 1
        changed.notify()

    def body() -> None:
        assert changed.wait_for(lambda: level[0] >= 3)
        seen.append(level[0])

    spawn(body)
    for i in range(3):
        kernel.call_at(i * MS, raise_level)
    kernel.run(LONG)
    assert seen == [3]


def test_a_signal_looks_before_it_waits_and_a_last_time_when_time_is_up(
    virtual: VirtualKernel, spawn: Spawn
) -> None:
    changed = Signal(virtual, "level")
    seen: list[tuple[bool, int]] = []

    def body() -> None:
        seen.append((changed.wait_for(lambda: True), virtual.now()))
        seen.append((changed.wait_for(lambda: False, within=5), virtual.now()))
        seen.append(
            (changed.wait_for(lambda: virtual.now() >= 10, within=5), virtual.now())
        )  # nobody notifies

    spawn(body)
    virtual.run(S)
    assert seen == [(True, 0), (False, 5), (True, 10)]


def test_only_tasks_whose_predicate_holds_are_woken(virtual: VirtualKernel, spawn: Spawn) -> None:
    changed = Signal(virtual, "level")
    level = [0]
    looks: list[int] = []

    def waiter(needed: int) -> Callable[[], None]:
        def body() -> None:
            changed.wait_for(lambda: level[0] >= needed)
            looks.append(needed)

        return body

    for needed in (2, 1):
        spawn(waiter(needed))

    def rise() -> None:
        level[0] += 1
        changed.notify()

    virtual.call_at(1, rise)
    virtual.call_at(2, rise)
    virtual.run(S)
    assert looks == [1, 2]


def test_a_predicate_that_raises_raises_where_the_wait_is(kernel: Kernel, spawn: Spawn) -> None:
    changed = Signal(kernel, "level")
    broken = [False]
    seen: list[str] = []

    def predicate() -> bool:
        if broken[0]:
            raise ZeroDivisionError
        return False

    def body() -> None:
        with pytest.raises(ZeroDivisionError):
            changed.wait_for(predicate)
        seen.append("raised here")

    def break_it() -> None:
        broken[0] = True
        changed.notify()

    spawn(body)
    kernel.call_at(MS, break_it)
    kernel.run(LONG)
    assert seen == ["raised here"]


def test_a_signal_keeps_no_task_that_no_longer_waits(virtual: VirtualKernel, spawn: Spawn) -> None:
    changed = Signal(virtual, "level")
    woken: list[int] = []

    def body() -> None:
        changed.wait_for(lambda: virtual.now() > 10, within=5)
        virtual.sleep_until(100)
        woken.append(virtual.now())

    spawn(body)
    virtual.call_at(50, changed.notify)
    virtual.run(S)
    assert woken == [100]


def test_an_event_lets_everybody_go_on(kernel: Kernel, spawn: Spawn) -> None:
    flag = Event(kernel, "flag")
    gone: Queue[str] = Queue(kernel, "gone")
    for name in "ab":
        spawn(lambda name=name: (flag.wait(), gone.put(name)))
    kernel.call_at(MS, flag.set)
    kernel.run(LONG)
    assert len(gone) == 2
    flag.clear()
    assert not flag.is_set()


def test_an_event_times_out(kernel: Kernel, spawn: Spawn) -> None:
    seen: list[bool] = []
    spawn(lambda: seen.append(Event(kernel, "flag").wait(within=MS)))
    kernel.run(LONG)
    assert seen == [False]


def test_a_queue_is_first_in_first_out(kernel: Kernel, spawn: Spawn) -> None:
    queue: Queue[int] = Queue(kernel, "queue")
    got: list[int] = []

    def consumer() -> None:
        while len(got) < 10:
            got.append(queue.get())

    spawn(consumer)
    for i in range(10):
        kernel.call_at(i * MS, lambda i=i: queue.put(i))
    kernel.run(LONG)
    assert got == list(range(10))


def test_a_full_queue_drops_the_oldest_and_reports_it(kernel: Kernel, spawn: Spawn) -> None:
    queue: Queue[int] = Queue(kernel, "queue", depth=2)
    assert [queue.put(i) for i in range(4)] == [True, True, False, False]
    assert len(queue) == 2
    got: list[int] = []
    spawn(lambda: got.extend((queue.get(), queue.get())))
    kernel.run(LONG)
    assert got == [2, 3]


def test_a_queue_times_out_with_nothing(kernel: Kernel, spawn: Spawn) -> None:
    got: list[object] = []
    spawn(lambda: got.append(Queue[int](kernel, "queue").get(within=MS)))
    kernel.run(LONG)
    assert got == [None]


def test_one_item_goes_to_one_of_the_waiting_tasks(virtual: VirtualKernel, spawn: Spawn) -> None:
    queue: Queue[str] = Queue(virtual, "queue")
    got: list[tuple[str, str | None]] = []
    for name in "ab":
        spawn(lambda name=name: got.append((name, queue.get(within=100))))
    virtual.call_at(10, lambda: queue.put("x"))
    virtual.run(S)
    assert got == [("a", "x"), ("b", None)]


@pytest.mark.parametrize("depth", [0, -1])
def test_a_queue_has_room_for_something(virtual: VirtualKernel, depth: int) -> None:
    with pytest.raises(UsageError, match="inbox: a depth of"):
        Queue(virtual, "inbox", depth)


# -- locks


def test_a_lock_admits_one_task_at_a_time_as_often_as_it_likes(virtual: VirtualKernel, spawn: Spawn) -> None:
    lock = Lock(virtual, "lock")
    seen: list[tuple[str, int]] = []

    def body(name: str) -> Callable[[], None]:
        def run() -> None:
            with lock:
                seen.append((name, virtual.now()))
                with lock:
                    sleep(virtual, 10)

        return run

    for name in "abc":
        spawn(body(name), name)
    virtual.run(S)
    assert seen == [("a", 0), ("b", 10), ("c", 20)]


def test_a_lock_goes_to_the_most_urgent_and_among_equals_to_the_first(virtual: VirtualKernel) -> None:
    lock = Lock(virtual, "lock")
    seen: list[str] = []

    def body(name: str) -> Callable[[], None]:
        def run() -> None:
            with lock:
                seen.append(name)
                sleep(virtual, 10)

        return run

    for name, priority in (("first", 0), ("low", 1), ("high", 9), ("high too", 9)):
        virtual.spawn(body(name), name, ExecutionContext(name, None, priority))
    virtual.run(S)
    assert seen == ["first", "high", "high too", "low"]


# -- activations


@pytest.fixture
def activations(events: list[Recorded]) -> Callable[[], list[tuple[float, float, str, float]]]:
    """(released, finished, component, deadline), in milliseconds."""

    def read() -> list[tuple[float, float, str, float]]:
        return [
            (each.released / MS, each.finished / MS, each.component, each.deadline / MS)
            for each in events
            if isinstance(each, Activation)
        ]

    return read


Activations = Callable[[], list[tuple[float, float, str, float]]]


@pytest.fixture
def core(virtual: VirtualKernel) -> Processor:
    return Processor(virtual, "core")


def computing(virtual: VirtualKernel, loads: list[int], wait: Callable[[], object]) -> Callable[[], None]:
    """Compute each of these milliseconds and then wait."""

    def body() -> None:
        task = virtual.current()
        assert task is not None
        for load in loads:
            task.charge(load * MS)
            wait()

    return body


def test_an_activation_lasts_from_its_release_to_the_next_wait_of_component_code(
    virtual: VirtualKernel, core: Processor, activations: Activations
) -> None:
    place = ExecutionContext("loop", core, deadline=50 * MS)
    virtual.call_at(5 * MS, lambda: None)
    virtual.spawn(computing(virtual, [10, 20], lambda: sleep(virtual, 100 * MS)), "loop", place)
    virtual.run(S)
    assert activations() == [(0, 10, "loop", 50), (110, 130, "loop", 160), (230, 230, "loop", 280)]


def test_an_activation_without_a_deadline(virtual: VirtualKernel, events: list[Recorded]) -> None:
    virtual.spawn(lambda: sleep(virtual, MS), "loop", ExecutionContext("loop"))
    virtual.run(S)
    assert events == [Activation(0, 0, "loop", NONE), Activation(MS, MS, "loop", NONE)]


def test_a_late_rate_catches_up_and_its_activations_count_from_when_they_were_due(
    virtual: VirtualKernel, core: Processor, activations: Activations
) -> None:
    def body() -> None:
        rate = Rate(virtual, 100 * MS)
        computing(virtual, [150, 120, 10, 10], rate.sleep)()

    virtual.spawn(body, "loop", ExecutionContext("loop", core))
    virtual.run(10 * S)
    assert [(released, finished) for released, finished, *_ in activations()] == [
        (0, 150),  # due at 100 and late by 50: goes on at once
        (100, 270),  # due at 200
        (200, 280),
        (300, 310),
        (400, 400),
    ]


def test_a_rate_that_is_more_than_two_periods_late_starts_anew(
    virtual: VirtualKernel, core: Processor, activations: Activations
) -> None:
    def body() -> None:
        rate = Rate(virtual, 100 * MS)
        computing(virtual, [300, 350, 10], rate.sleep)()

    virtual.spawn(body, "loop", ExecutionContext("loop", core))
    virtual.run(10 * S)
    assert [(released, finished) for released, finished, *_ in activations()] == [
        (0, 300),  # due at 100, late by exactly two periods: catches up
        (100, 650),  # due at 200, late by 450: starts anew from 650
        (200, 660),
        (750, 750),
    ]


# -- loops of component code that time themselves


def self_timed(
    virtual: VirtualKernel, costs: list[int], rest: Callable[[int], None], period: int = 50 * MS
) -> Callable[[], None]:
    """Return a loop that computes `costs`, ms, and calls `rest` with the time that is left, ns, maybe < 0."""

    def body() -> None:
        due = read_clock(virtual)
        for cost in costs:
            read_clock(virtual)  # a second place, as for a stamp
            virtual.consume(cost * MS)
            due += period
            rest(due - read_clock(virtual))

    return body


@pytest.mark.parametrize("style", ["if", "max"])
@pytest.mark.parametrize(
    ("costs", "spans"),
    [
        ([10, 20, 30], [(0, 10), (50, 70), (100, 130), (150, 150)]),
        ([10, 80, 10, 10], [(0, 10), (50, 130), (100, 140), (150, 160), (200, 200)]),
        ([10, *[146] * 4], [(0, 10), (50, 196), (100, 342), (150, 488), (392, 634)]),
        ([146] * 4, [(0, 146), (50, 292), (100, 438), (342, 584)]),
    ],
    ids=["on time", "late once", "late for ever", "late from the start"],
)
def test_a_loop_that_is_too_late_to_sleep_ends_an_activation_each_time_round(
    virtual: VirtualKernel,
    core: Processor,
    activations: Activations,
    style: str,
    costs: list[int],
    spans: list[tuple[int, int]],
) -> None:
    def rest(left: int) -> None:
        if style == "max":
            sleep(virtual, max(0, left))
        elif left > 0:
            sleep(virtual, left)

    place = ExecutionContext("loop", core, deadline=50 * MS, period=50 * MS)
    virtual.spawn(self_timed(virtual, costs, rest), "loop", place)
    virtual.run(10 * S)
    found = [(released, finished) for released, finished, *_ in activations()]
    assert found[: len(spans)] == spans
    assert len(found) - len(spans) <= (style == "max")  # what follows the last sleep of no length


def test_a_long_wait_within_an_activation_is_one_activation(
    virtual: VirtualKernel, activations: Activations
) -> None:
    def body() -> None:
        for _ in range(2):
            read_clock(virtual)
            for _ in range(100):
                virtual.sleep_until(virtual.now() + 10 * MS)  # as an operation of a vehicle waits
            sleep(virtual, 50 * MS)

    virtual.spawn(body, "mission", ExecutionContext("mission", period=50 * MS, deadline=50 * MS))
    virtual.run(10 * S)
    spans = [(released, finished) for released, finished, *_ in activations()]
    assert spans == [(0, 1000), (1050, 2050), (2100, 2100)]


def test_a_loop_with_a_deadline_only_is_late_by_its_deadline(
    virtual: VirtualKernel, core: Processor, activations: Activations
) -> None:
    body = self_timed(virtual, [80, 80, 80], lambda left: sleep(virtual, left) if left > 0 else None)
    virtual.spawn(body, "loop", ExecutionContext("loop", core, deadline=50 * MS))
    virtual.run(10 * S)
    spans = [(released, finished) for released, finished, *_ in activations()]
    assert spans == [(0, 80), (80, 160), (160, 240)]


def test_reading_the_clock_without_a_period_or_a_deadline_ends_nothing(
    virtual: VirtualKernel, core: Processor, activations: Activations
) -> None:
    virtual.spawn(self_timed(virtual, [80, 80], lambda left: None), "loop", ExecutionContext("loop", core))
    virtual.run(10 * S)
    assert [(released, finished) for released, finished, *_ in activations()] == [(0, 160)]


def test_a_rate_always_ends_the_activation(virtual: VirtualKernel, activations: Activations) -> None:
    def body() -> None:
        rate = Rate(virtual, 10 * MS)
        virtual.sleep_until(30 * MS)  # of the framework: no end of an activation
        for _ in range(4):
            rate.sleep()

    virtual.spawn(body, "loop", ExecutionContext("loop"))
    virtual.run(S)
    assert [(released, finished) for released, finished, *_ in activations()] == [
        (0, 30), (10, 30), (20, 30), (30, 30), (40, 40)
    ]  # fmt: skip


def test_a_period_must_be_positive(virtual: VirtualKernel) -> None:
    with pytest.raises(UsageError, match="a period of 0 ns"):
        Rate(virtual, 0)


def test_a_message_releases_and_one_that_is_there_already_does_not_end_the_activation(
    virtual: VirtualKernel, activations: Activations
) -> None:
    queue: Queue[int] = Queue(virtual, "queue")

    def body() -> None:
        for _ in range(3):
            queue.get()
        queue.get(within=100 * MS)

    virtual.spawn(body, "reader", ExecutionContext("reader"))
    for when in (10, 20, 20):
        virtual.call_at(when * MS, lambda: queue.put(0))
    virtual.run(S)
    assert [(released, finished) for released, finished, *_ in activations()] == [
        (0, 0), (10, 10), (20, 20), (120, 120)
    ]  # fmt: skip


def test_waits_of_the_framework_end_no_activation(
    virtual: VirtualKernel, core: Processor, activations: Activations
) -> None:
    radio = Network(virtual, "radio", bandwidth_bit_s=8000, latency=2 * MS, loss=0.0, stream=Random(1))
    lock = Lock(virtual, "lock")
    changed = Signal(virtual, "changed")
    flag = Event(virtual, "flag")

    def body() -> None:
        virtual.consume(10 * MS)
        radio.carry(1)
        with lock:
            changed.wait_for(lambda: False, within=5 * MS)
            virtual.sleep_until(50 * MS)
        changed.wait_for(lambda: False, within=10 * MS, ends_activation=True)
        flag.wait(within=10 * MS)

    virtual.spawn(body, "component", ExecutionContext("component", core))
    virtual.run(S)
    assert [(released, finished) for released, finished, *_ in activations()] == [(0, 50), (60, 60), (70, 70)]


def test_a_task_that_is_ended_finishes_no_activation(
    virtual: VirtualKernel, activations: Activations
) -> None:
    scope = virtual.root.child("components")
    virtual.spawn(lambda: virtual.sleep_until(S), "component", ExecutionContext("component"), scope)
    virtual.call_at(10 * MS, lambda: virtual.cancel(scope, "enough"))
    virtual.run(S)
    assert activations() == []


def test_each_release_can_be_charged(
    virtual: VirtualKernel, core: Processor, activations: Activations
) -> None:
    place = ExecutionContext("loop", core, on_release=lambda task: task.charge(7 * MS))

    def body() -> None:
        rate = Rate(virtual, 20 * MS)  # an interaction point: counts from 7 ms
        for _ in range(2):
            rate.sleep()

    virtual.spawn(body, "loop", place)
    virtual.run(S)
    assert [(released, finished) for released, finished, *_ in activations()] == [(0, 7), (27, 34), (47, 54)]


# -- places


def test_a_context_is_entered_and_left_after_pending_time_is_spent(
    virtual: VirtualKernel, core: Processor, slices: Callable[[], list[tuple[float, float, str, str]]]
) -> None:
    other = Processor(virtual, "other")
    left: list[int] = []

    def body() -> None:
        task = virtual.current()
        assert task is not None
        task.charge(3 * MS)
        with executing_in(virtual, ExecutionContext("callee", other, None)):
            assert task.priority == 4
            task.charge(5 * MS)
        left.append(virtual.now())
        assert task.context.component == "caller"
        task.charge(2 * MS)

    virtual.spawn(body, "caller", ExecutionContext("caller", core, 4))
    virtual.run(S)
    assert left == [8 * MS]
    assert slices() == [(0, 3, "core.0", "caller"), (3, 8, "other.0", "callee"), (8, 10, "core.0", "caller")]


def test_an_exception_that_leaves_a_context_spends_its_time_too(
    virtual: VirtualKernel, core: Processor
) -> None:
    left: list[int] = []

    def visit(task: Task) -> None:
        with executing_in(virtual, ExecutionContext("callee", core)):
            task.charge(5 * MS)
            raise ZeroDivisionError

    def body() -> None:
        task = virtual.current()
        assert task is not None
        with pytest.raises(ZeroDivisionError):
            visit(task)
        left.append(virtual.now())
        assert not task.is_in_call

    virtual.spawn(body, "caller", ExecutionContext("caller", core))
    virtual.run(S)
    assert left == [5 * MS]


def test_a_task_cancelled_in_a_context_has_no_pending_time(virtual: VirtualKernel, core: Processor) -> None:
    scope = virtual.root.child("components")
    meter = iter([0, 100 * MS, 0])
    place = ExecutionContext("callee", core, meter=lambda: next(meter, 0))
    tasks: list[Task] = []

    def body() -> None:
        task = virtual.current()
        assert task is not None
        tasks.append(task)
        with executing_in(virtual, place):
            virtual.cancel(scope, "enough")
            task.charge(50 * MS)
            sleep(virtual, 1)

    virtual.spawn(body, "caller", ExecutionContext("caller", core), scope)
    virtual.run(S)
    assert core.busy_ns(virtual.now()) == 0
    assert not tasks[0].is_in_call
    assert tasks[0].pending_ns == 0


def test_a_meter_is_pulled_at_every_interaction_point(
    virtual: VirtualKernel, slices: Callable[[], list[tuple[float, float, str, str]]], core: Processor
) -> None:
    counted = [0]

    def meter() -> int:
        steps, counted[0] = counted[0], 0
        return steps * MS

    def body() -> None:
        counted[0] += 2
        with virtual.interact():
            assert virtual.now() == 2 * MS
        counted[0] += 3
        virtual.sleep_until(15 * MS)
        counted[0] += 4

    virtual.spawn(body, "counted", ExecutionContext("counted", core, meter=meter))
    virtual.run(S)
    assert [(start, end) for start, end, *_ in slices()] == [(0, 2), (2, 5), (15, 19)]


def test_a_lock_is_what_it_is_entered_as(virtual: VirtualKernel, spawn: Spawn) -> None:
    lock = Lock(virtual, "l")
    entered: list[Lock] = []

    def body() -> None:
        with lock as one:
            entered.append(one)

    spawn(body)
    virtual.run(LONG)
    assert entered == [lock]


@pytest.mark.parametrize(
    "wait",
    [
        current_task,
        end_activation,
        lambda kernel: sleep(kernel, MS),
        lambda kernel: Lock(kernel, "l").__enter__(),
        lambda kernel: Queue(kernel, "q").get(MS),
        lambda kernel: Event(kernel, "e").wait(MS),
    ],
)
def test_outside_of_tasks_no_wait_begins(virtual: VirtualKernel, wait: Callable[[Kernel], object]) -> None:
    with pytest.raises(UsageError, match="only a task can wait"):
        wait(virtual)


def test_a_place_is_where_component_code_calls_the_framework() -> None:
    framework: dict[str, Any] = {"__name__": "volery.somewhere", "place": _place_of_caller}
    exec("def read(): return place()", framework)
    first = [framework["read"]() for _ in range(2)]
    second = framework["read"]()
    assert first[0] == first[1] != second


def test_a_loop_counts_anew_when_it_is_more_than_two_periods_late() -> None:
    assert next_release(0, 10, 30) == (10, 10)
    assert next_release(0, 10, 31) == (10, 31)


def test_the_clock_is_read_outside_of_tasks_too(virtual: VirtualKernel) -> None:
    read: list[int] = []
    virtual.call_at(3 * MS, lambda: read.append(read_clock(virtual)))
    virtual.run(S)
    assert read == [3 * MS]


def test_the_shortest_sleep_is_one_nanosecond(virtual: VirtualKernel, spawn: Spawn) -> None:
    woken: list[int] = []

    def body() -> None:
        sleep(virtual, 1)
        woken.append(virtual.now())

    spawn(body)
    virtual.run(S)
    assert woken == [1]


def test_the_next_release_of_a_rate_is_due_a_period_later(virtual: VirtualKernel) -> None:
    found: list[int] = []

    def body() -> None:
        rate = Rate(virtual, 10 * MS)
        found.append(rate.due)
        rate.sleep()
        found.append(rate.due)

    virtual.spawn(body, "loop", ExecutionContext("loop"))
    virtual.run(S)
    assert found == [10 * MS, 20 * MS]


@pytest.mark.parametrize(("computed", "ended"), [(10, 1), (9, 0)])
def test_a_loop_that_asks_for_no_sleep_has_ended_its_activation_where_it_is_late(
    computed: int, ended: int, virtual: VirtualKernel, events: list[Recorded]
) -> None:
    until: list[int] = []

    def body() -> None:
        virtual.consume(computed * MS)
        sleep(virtual, 0)
        until.append(len([event for event in events if isinstance(event, Activation)]))

    cpu = Processor(virtual, "cpu")
    virtual.spawn(body, "loop", ExecutionContext("loop", cpu, 1, period=10 * MS))
    virtual.run(S)
    assert until == [ended]
