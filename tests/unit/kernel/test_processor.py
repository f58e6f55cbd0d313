"""Schedules worked out by hand."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

import pytest

from volery.base.errors import UsageError
from volery.base.time import MS, S
from volery.kernel.network import Network
from volery.kernel.processor import Processor
from volery.kernel.task import ExecutionContext, Scope
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import current_task, executing_in
from volery.trace.events import Event, Preemption, Slice

Slices = Callable[[], list[tuple[float, float, str, str]]]


def compute(
    kernel: VirtualKernel, processor: Processor, name: str, *, at: int, ms: int, priority: int = 0
) -> None:
    """From *at* milliseconds on, a task called *name* wants *ms* milliseconds."""

    def body() -> None:
        kernel.sleep_until(at * MS)
        kernel.consume(ms * MS)

    kernel.spawn(body, name, ExecutionContext(name, processor, priority))


def test_the_more_urgent_preempts_at_once(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu")
    compute(virtual, core, "low", at=0, ms=10, priority=1)
    compute(virtual, core, "high", at=4, ms=3, priority=2)
    compute(virtual, core, "lowest", at=0, ms=1, priority=0)
    virtual.run(S)
    assert slices() == [
        (0, 4, "cpu.0", "low"),
        (4, 7, "cpu.0", "high"),
        (7, 13, "cpu.0", "low"),
        (13, 14, "cpu.0", "lowest"),
    ]


def test_equals_do_not_preempt_and_a_preempted_job_keeps_its_turn(
    virtual: VirtualKernel, slices: Slices
) -> None:
    core = Processor(virtual, "cpu")
    compute(virtual, core, "a", at=0, ms=4, priority=1)
    compute(virtual, core, "b", at=1, ms=4, priority=1)
    compute(virtual, core, "urgent", at=2, ms=1, priority=9)
    virtual.run(S)
    assert slices() == [
        (0, 2, "cpu.0", "a"),
        (2, 3, "cpu.0", "urgent"),
        (3, 5, "cpu.0", "a"),
        (5, 9, "cpu.0", "b"),
    ]


def test_a_job_that_ends_at_the_instant_of_its_preemption_is_complete(
    virtual: VirtualKernel, slices: Slices
) -> None:
    core = Processor(virtual, "cpu")
    done: list[int] = []

    def low() -> None:
        virtual.consume(5 * MS)
        done.append(virtual.now())

    def high() -> None:
        virtual.sleep_until(5 * MS)
        virtual.consume(10 * MS)

    virtual.spawn(
        high, "high", ExecutionContext("high", core, 9)
    )  # its timer is set first: it comes first at 5 ms
    virtual.spawn(low, "low", ExecutionContext("low", core, 1))
    virtual.run(S)
    assert done == [5 * MS]
    assert slices() == [(0, 5, "cpu.0", "low"), (5, 15, "cpu.0", "high")]


def test_first_come_first_served_does_not_preempt(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu", scheduler="fifo")
    compute(virtual, core, "a", at=0, ms=10, priority=1)
    compute(virtual, core, "b", at=4, ms=3, priority=9)
    compute(virtual, core, "c", at=3, ms=2, priority=5)
    virtual.run(S)
    assert slices() == [(0, 10, "cpu.0", "a"), (10, 12, "cpu.0", "c"), (12, 15, "cpu.0", "b")]


def test_round_robin_takes_turns_of_a_quantum(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu", scheduler="round-robin", quantum=4 * MS)
    compute(virtual, core, "a", at=0, ms=10)
    compute(virtual, core, "b", at=0, ms=5, priority=9)
    compute(virtual, core, "c", at=5, ms=2)
    virtual.run(S)
    assert slices() == [
        (0, 4, "cpu.0", "a"),
        (4, 8, "cpu.0", "b"),
        (8, 12, "cpu.0", "a"),  # was behind b, and before c came
        (12, 14, "cpu.0", "c"),
        (14, 15, "cpu.0", "b"),
        (15, 17, "cpu.0", "a"),
    ]


def test_round_robin_continues_a_job_for_which_no_other_waits(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu", scheduler="round-robin", quantum=4 * MS)
    compute(virtual, core, "a", at=0, ms=20)
    compute(virtual, core, "b", at=10, ms=1)
    virtual.run(S)
    assert slices() == [(0, 12, "cpu.0", "a"), (12, 13, "cpu.0", "b"), (13, 21, "cpu.0", "a")]


def test_the_earliest_deadline_runs_first(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu", scheduler="edf")

    def spawn(name: str, at: int, ms: int, deadline: int | None) -> None:
        context = ExecutionContext(name, core, 9, deadline=None if deadline is None else deadline * MS)

        def body() -> None:
            virtual.sleep_until(at * MS)
            current_task(virtual).release(at * MS)
            virtual.consume(ms * MS)

        virtual.spawn(body, name, context)

    spawn("late", 0, 6, 20)
    spawn("soon", 2, 3, 10)
    spawn("later", 3, 2, 40)
    spawn("none", 0, 1, None)
    virtual.run(S)
    assert slices() == [
        (0, 2, "cpu.0", "late"),
        (2, 5, "cpu.0", "soon"),
        (5, 9, "cpu.0", "late"),
        (9, 11, "cpu.0", "later"),
        (11, 12, "cpu.0", "none"),
    ]


def test_two_cores_run_the_two_most_urgent(virtual: VirtualKernel, slices: Slices) -> None:
    cores = Processor(virtual, "cpu", cores=2)
    compute(virtual, cores, "a", at=0, ms=10, priority=1)
    compute(virtual, cores, "b", at=0, ms=10, priority=2)
    compute(virtual, cores, "c", at=4, ms=3, priority=3)
    virtual.run(S)
    assert sorted(slices()) == [
        (0, 4, "cpu.0", "a"),
        (0, 10, "cpu.1", "b"),
        (4, 7, "cpu.0", "c"),
        (7, 13, "cpu.0", "a"),
    ]


def test_a_job_keeps_its_core_and_a_new_one_takes_the_lowest_that_is_free(
    virtual: VirtualKernel, slices: Slices
) -> None:
    cores = Processor(virtual, "cpu", cores=3)
    compute(virtual, cores, "short", at=0, ms=2)
    compute(virtual, cores, "long", at=0, ms=10)
    compute(virtual, cores, "next", at=5, ms=1)
    virtual.run(S)
    assert sorted(slices()) == [
        (0, 2, "cpu.0", "short"),
        (0, 10, "cpu.1", "long"),
        (5, 6, "cpu.0", "next"),
    ]


def test_nested_calls_over_two_processors_with_preemption(virtual: VirtualKernel, slices: Slices) -> None:
    """a on ``onboard`` calls b on ``ground``, which calls c on ``onboard`` (passive: at a's priority).

    200 bytes take 1 ms of the medium and 2 ms to arrive.
    """
    onboard, ground = Processor(virtual, "onboard"), Processor(virtual, "ground")
    radio = Network(virtual, "radio", bandwidth_bit_s=1_600_000, latency=2 * MS, loss=0.0, stream=Random(1))
    result: list[float] = []

    def call(
        place: ExecutionContext, ms_before: int, ms_after: int, inner: Callable[[], None] | None = None
    ) -> None:
        radio.carry(200)
        with executing_in(virtual, place):
            virtual.consume(ms_before * MS)
            if inner is not None:
                inner()
            virtual.consume(ms_after * MS)
        radio.carry(200)

    def a() -> None:
        virtual.consume(4 * MS)
        c = ExecutionContext("c", onboard, None)
        call(ExecutionContext("b", ground, 5), 3, 1, inner=lambda: call(c, 2, 0))
        virtual.consume(1 * MS)
        result.append(virtual.now() / MS)

    virtual.spawn(a, "a", ExecutionContext("a", onboard, 1))
    compute(virtual, onboard, "urgent", at=2, ms=3, priority=9)
    compute(virtual, ground, "busy", at=11, ms=2, priority=9)
    virtual.run(S)
    assert slices() == [
        (0, 2, "onboard.0", "a"),
        (2, 5, "onboard.0", "urgent"),
        (5, 7, "onboard.0", "a"),
        (10, 11, "ground.0", "b"),
        (11, 13, "ground.0", "busy"),
        (13, 15, "ground.0", "b"),
        (18, 20, "onboard.0", "c"),
        (23, 24, "ground.0", "b"),
        (27, 28, "onboard.0", "a"),
    ]
    assert result == [28]


def test_a_passive_component_computes_at_its_callers_priority(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu")

    def caller() -> None:
        with executing_in(virtual, ExecutionContext("passive", core, None)):
            virtual.consume(4 * MS)

    virtual.spawn(caller, "caller", ExecutionContext("caller", core, 5))
    compute(virtual, core, "middle", at=1, ms=2, priority=3)
    virtual.run(S)
    assert slices() == [(0, 4, "cpu.0", "passive"), (4, 6, "cpu.0", "middle")]


def test_background_computing_contends_without_blocking_a_task(
    virtual: VirtualKernel, slices: Slices
) -> None:
    core = Processor(virtual, "cpu")
    ros = ExecutionContext("node", core, 5)
    compute(virtual, core, "low", at=0, ms=5, priority=1)
    compute(virtual, core, "high", at=3, ms=1, priority=9)
    virtual.call_at(2 * MS, lambda: core.load(ros, 2 * MS))
    virtual.run(S)
    assert slices() == [
        (0, 2, "cpu.0", "low"),
        (2, 3, "cpu.0", "node"),
        (3, 4, "cpu.0", "high"),
        (4, 5, "cpu.0", "node"),
        (5, 8, "cpu.0", "low"),
    ]


def test_the_background_of_a_context_is_one_thread(virtual: VirtualKernel, slices: Slices) -> None:
    cores = Processor(virtual, "cpu", cores=2)
    node = ExecutionContext("node", cores)
    for when in (0, 0, 3, 10):
        virtual.call_at(when * MS, lambda: cores.load(node, 2 * MS))
    virtual.run(S)
    assert slices() == [(0, 6, "cpu.0", "node"), (10, 12, "cpu.0", "node")]


def test_putting_another_job_on_a_core_takes_a_context_switch(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu", context_switch=1 * MS)
    compute(virtual, core, "low", at=0, ms=10, priority=1)
    compute(virtual, core, "high", at=5, ms=3, priority=2)
    virtual.run(S)
    assert slices() == [(0, 5, "cpu.0", "low"), (5, 9, "cpu.0", "high"), (9, 16, "cpu.0", "low")]


def test_going_on_with_the_same_task_takes_no_context_switch(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu", context_switch=1 * MS)

    def body() -> None:
        virtual.consume(2 * MS)
        virtual.sleep_until(10 * MS)
        virtual.consume(2 * MS)

    virtual.spawn(body, "a", ExecutionContext("a", core))
    virtual.run(S)
    assert slices() == [(0, 3, "cpu.0", "a"), (10, 12, "cpu.0", "a")]


def test_nor_does_it_when_something_happens_meanwhile(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu", context_switch=1 * MS)

    def body() -> None:
        for _ in range(3):
            virtual.consume(2 * MS)

    virtual.spawn(body, "a", ExecutionContext("a", core))
    for when in range(10):
        virtual.call_at(when * MS, lambda: None)
    virtual.run(S)
    assert [(start, end) for start, end, *_ in slices()] == [(0, 3), (3, 5), (5, 7)]


def test_a_job_that_ends_with_its_turn_is_done(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu", scheduler="round-robin", quantum=4 * MS)
    done: list[float] = []

    def body() -> None:
        virtual.consume(8 * MS)
        done.append(virtual.now() / MS)

    virtual.spawn(body, "a", ExecutionContext("a", core))
    compute(virtual, core, "b", at=6, ms=4)
    virtual.run(S)
    assert done == [8]
    assert slices() == [(0, 8, "cpu.0", "a"), (8, 12, "cpu.0", "b")]


def test_what_happens_at_the_instant_a_job_ends_comes_in_the_order_asked_for(virtual: VirtualKernel) -> None:
    core = Processor(virtual, "cpu")
    seen: list[str] = []

    def body() -> None:
        virtual.consume(5 * MS)
        seen.append("done")

    virtual.call_at(5 * MS, lambda: seen.append("asked for before"))
    virtual.spawn(body, "a", ExecutionContext("a", core))
    virtual.run(S)
    assert seen == ["asked for before", "done"]


def test_busy_time_is_known_while_jobs_run(virtual: VirtualKernel) -> None:
    cores = Processor(virtual, "cpu", cores=2)
    compute(virtual, cores, "a", at=0, ms=10)
    compute(virtual, cores, "b", at=5, ms=10)
    seen: list[float] = []
    for when in (2, 7, 20):
        virtual.call_at(when * MS, lambda: seen.append(cores.busy_ns(virtual.now()) / MS))
    virtual.run(S)
    assert seen == [2, 9, 20]


def test_nothing_takes_no_time(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu", context_switch=MS)
    compute(virtual, core, "idle", at=0, ms=0)
    core.load(ExecutionContext("node", core), 0)
    task = virtual.spawn(lambda: core.serve(task, 0), "nothing", ExecutionContext("nothing", core))
    virtual.run(S)
    assert slices() == []
    assert virtual.now() == 0


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"scheduler": "round-robbin"}, "cpu: no scheduler 'round-robbin' .did you mean 'round-robin'.*fifo"),
        ({"cores": 0}, "cpu: cores 0"),
        ({"quantum": 0}, "cpu: .*quantum 0 ns"),
        ({"context_switch": -1}, "cpu: .*context switch -1 ns"),
    ],
)
def test_a_processor_that_cannot_be_is_refused(
    virtual: VirtualKernel, wrong: dict[str, int], said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        Processor(virtual, "cpu", **wrong)


def test_preemptions_are_recorded_with_both_jobs(virtual: VirtualKernel, events: list[Event]) -> None:
    core = Processor(virtual, "cpu")
    compute(virtual, core, "low", at=0, ms=10, priority=1)
    compute(virtual, core, "high", at=4, ms=3, priority=2)
    compute(virtual, core, "equal", at=8, ms=3, priority=1)
    virtual.run(S)
    told = [event for event in events if isinstance(event, Preemption)]
    assert told == [Preemption(4 * MS, "cpu", 0, "low", "high")]


def test_busy_time_leaves_out_jobs_that_wait_for_a_core(virtual: VirtualKernel) -> None:
    core = Processor(virtual, "cpu")
    compute(virtual, core, "a", at=0, ms=4)
    compute(virtual, core, "b", at=1, ms=4)
    seen: list[float] = []
    for when in (3, 6):
        virtual.call_at(when * MS, lambda: seen.append(core.busy_ns(virtual.now()) / MS))
    virtual.run(S)
    assert seen == [3, 6]


def test_a_halted_processor_continues_where_it_stopped(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu")
    compute(virtual, core, "a", at=0, ms=6, priority=2)
    compute(virtual, core, "b", at=3, ms=1, priority=1)
    virtual.call_at(2 * MS, core.halt)
    seen: list[float] = []
    virtual.call_at(8 * MS, lambda: seen.append(core.busy_ns(virtual.now()) / MS))
    virtual.call_at(10 * MS, core.resume)
    virtual.run(S)
    assert slices() == [(0, 2, "cpu.0", "a"), (10, 14, "cpu.0", "a"), (14, 15, "cpu.0", "b")]
    assert seen == [2]


def test_a_job_that_ends_at_the_instant_of_a_halt_is_complete(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu")
    done: list[int] = []

    def body() -> None:
        virtual.sleep_until(MS)
        virtual.consume(4 * MS)
        with virtual.interact():
            done.append(virtual.now())

    virtual.call_at(5 * MS, core.halt)  # asked for before the timer of the job
    virtual.spawn(body, "a", ExecutionContext("a", core))
    virtual.run(S)
    assert done == [5 * MS]
    assert slices() == [(1, 5, "cpu.0", "a")]


def test_nothing_starts_on_a_halted_processor(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu")
    core.halt()
    compute(virtual, core, "a", at=1, ms=2)
    virtual.call_at(5 * MS, core.resume)
    virtual.run(S)
    assert slices() == [(5, 7, "cpu.0", "a")]


def test_background_computing_that_waits_for_a_core_can_grow(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu")
    node = ExecutionContext("node", core, 1)
    compute(virtual, core, "high", at=0, ms=5, priority=9)
    for when in (1, 2):
        virtual.call_at(when * MS, lambda: core.load(node, 2 * MS))
    virtual.run(S)
    assert slices() == [(0, 5, "cpu.0", "high"), (5, 9, "cpu.0", "node")]


def test_background_computing_has_the_deadline_of_its_context(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu", scheduler="edf")
    late, soon = (ExecutionContext(name, core, deadline=ms * MS) for name, ms in (("late", 50), ("soon", 20)))
    virtual.call_at(0, lambda: core.load(late, 4 * MS))
    virtual.call_at(MS, lambda: core.load(soon, 2 * MS))
    compute(virtual, core, "without", at=0, ms=1, priority=9)
    virtual.run(S)
    assert slices() == [
        (0, 1, "cpu.0", "late"),
        (1, 3, "cpu.0", "soon"),
        (3, 6, "cpu.0", "late"),
        (6, 7, "cpu.0", "without"),
    ]


@pytest.mark.parametrize("of", ["the job that runs", "a job that waits"])
def test_a_cancelled_task_leaves_its_core_to_the_next(
    virtual: VirtualKernel, slices: Slices, of: str
) -> None:
    core = Processor(virtual, "cpu")
    scope = Scope("mission", virtual.root)

    def body() -> None:
        virtual.consume(20 * MS)

    first, second = (9, 1) if of == "the job that runs" else (1, 9)
    virtual.spawn(body, "cancelled", ExecutionContext("cancelled", core, first), scope)
    compute(virtual, core, "other", at=0, ms=6, priority=second)
    virtual.call_at(3 * MS, lambda: virtual.cancel(scope, "enough"))
    virtual.run(S)
    other = [(3, 9, "cpu.0", "other")] if first > second else [(0, 6, "cpu.0", "other")]
    assert slices() == ([(0, 3, "cpu.0", "cancelled")] if first > second else []) + other


def test_the_least_that_a_processor_can_have(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu", cores=1, scheduler="round-robin", quantum=1, context_switch=0)
    compute(virtual, core, "a", at=0, ms=1)
    virtual.run(S)
    assert slices() == [(0, 1, "cpu.0", "a")]


def test_busy_time_counts_what_ran_alone(virtual: VirtualKernel) -> None:
    core = Processor(virtual, "cpu", context_switch=MS)
    compute(virtual, core, "a", at=0, ms=10)
    virtual.run(S)
    assert core.busy_ns(virtual.now()) == 11 * MS


def test_background_computing_without_a_priority_has_the_least(
    virtual: VirtualKernel, slices: Slices
) -> None:
    core = Processor(virtual, "cpu")
    node = ExecutionContext("node", core, None)
    virtual.call_at(0, lambda: core.load(node, 4 * MS))
    compute(virtual, core, "task", at=1, ms=2, priority=1)
    virtual.run(S)
    assert slices() == [(0, 1, "cpu.0", "node"), (1, 3, "cpu.0", "task"), (3, 6, "cpu.0", "node")]


def test_an_error_of_a_listener_within_a_timer_ends_the_run_and_leaves_the_kernel_usable() -> None:
    errors = [OSError("no space left on device")]

    def refuse(event: Event) -> None:
        if isinstance(event, Slice) and event.task == "high" and errors:
            raise errors.pop()

    kernel = VirtualKernel(refuse)
    core = Processor(kernel, "cpu")
    compute(kernel, core, "low", at=0, ms=10, priority=1)
    compute(kernel, core, "high", at=4, ms=3, priority=2)
    with pytest.raises(OSError, match="no space"):
        kernel.run(S)
    assert kernel.now() == 7 * MS
    kernel.close()


def test_a_run_that_a_listener_cancels_within_a_timer_stops_there() -> None:
    slices = []

    def listen(event: Event) -> None:
        slices.append(event)
        if isinstance(event, Slice) and event.task == "high":
            kernel.cancel(kernel.root, "enough")

    kernel = VirtualKernel(listen)
    core = Processor(kernel, "cpu")
    compute(kernel, core, "low", at=0, ms=10, priority=1)
    compute(kernel, core, "high", at=4, ms=3, priority=2)
    kernel.run(S)
    assert kernel.now() == 7 * MS
    assert [event.task for event in slices if isinstance(event, Slice)] == ["low", "high"]
    kernel.close()


def test_a_quantum_that_is_not_stated_is_10_ms(virtual: VirtualKernel, slices: Slices) -> None:
    core = Processor(virtual, "cpu", scheduler="round-robin")
    compute(virtual, core, "a", at=0, ms=15)
    compute(virtual, core, "b", at=0, ms=1)
    virtual.run(S)
    assert slices() == [(0, 10, "cpu.0", "a"), (10, 11, "cpu.0", "b"), (11, 16, "cpu.0", "a")]


def test_background_computing_without_a_priority_comes_before_what_is_less_than_0(
    virtual: VirtualKernel, slices: Slices
) -> None:
    core = Processor(virtual, "cpu")
    node = ExecutionContext("node", core, None)
    compute(virtual, core, "idle", at=0, ms=4, priority=-1)
    virtual.call_at(MS, lambda: core.load(node, 2 * MS))
    virtual.run(S)
    assert slices() == [(0, 1, "cpu.0", "idle"), (1, 3, "cpu.0", "node"), (3, 6, "cpu.0", "idle")]


def test_a_job_that_ends_as_it_would_be_preempted_is_no_preemption(
    virtual: VirtualKernel, events: list[Event]
) -> None:
    core = Processor(virtual, "cpu")
    compute(virtual, core, "high", at=4, ms=3, priority=2)
    compute(virtual, core, "low", at=0, ms=4, priority=1)
    virtual.run(S)
    assert [event for event in events if isinstance(event, Preemption)] == []
