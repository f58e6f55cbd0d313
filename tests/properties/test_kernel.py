"""Properties of virtual time and of processors, over made-up workloads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from volery.kernel.processor import SCHEDULERS, Processor
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import Queue, sleep
from volery.trace.events import Event, Slice

FAR = 10**15

Bursts = list[tuple[int, int]]
"""(sleep before, amount to compute)"""


@dataclass(frozen=True)
class Workload:
    cores: int
    scheduler: str
    quantum: int
    tasks: list[tuple[int, Bursts]]  # (priority, bursts)
    background: list[tuple[int, int]]  # (when, amount), at priority 2


WORKLOADS = st.builds(
    Workload,
    cores=st.integers(1, 3),
    scheduler=st.sampled_from(sorted(SCHEDULERS)),
    quantum=st.integers(1, 7),
    tasks=st.lists(
        st.tuples(
            st.integers(0, 4),
            st.lists(st.tuples(st.integers(0, 12), st.integers(0, 9)), min_size=1, max_size=5),
        ),
        min_size=1,
        max_size=6,
    ),
    background=st.lists(st.tuples(st.integers(0, 30), st.integers(1, 9)), max_size=4),
)


@dataclass(frozen=True)
class Job:
    """As the task that asked for it saw it."""

    name: str
    priority: int
    amount: int
    asked: int
    done: int


@dataclass(frozen=True)
class Outcome:
    events: list[Event]
    jobs: list[Job]
    busy: int

    @property
    def slices(self) -> list[Slice]:
        return [event for event in self.events if isinstance(event, Slice)]


def execute(load: Workload) -> Outcome:
    events: list[Event] = []
    jobs: list[Job] = []
    kernel = VirtualKernel(events.append)
    processor = Processor(kernel, "cpu", cores=load.cores, scheduler=load.scheduler, quantum=load.quantum)

    def body(name: str, priority: int, bursts: Bursts) -> Callable[[], None]:
        def run() -> None:
            for pause, amount in bursts:
                kernel.sleep_until(kernel.now() + pause)
                asked = kernel.now()
                kernel.consume(amount)
                jobs.append(Job(name, priority, amount, asked, kernel.now()))

        return run

    for number, (priority, bursts) in enumerate(load.tasks):
        name = f"t{number}"
        kernel.spawn(body(name, priority, bursts), name, ExecutionContext(name, processor, priority))
    node = ExecutionContext("node", processor, 2)
    for when, amount in load.background:
        kernel.call_at(when, lambda amount=amount: processor.load(node, amount))
    kernel.run(FAR)
    busy = processor.busy_ns(kernel.now())
    assert kernel.close() == []
    return Outcome(events, jobs, busy)


@given(WORKLOADS)
def test_everything_that_was_asked_for_is_served_and_nothing_else(load: Workload) -> None:
    outcome = execute(load)
    for number, (_, bursts) in enumerate(load.tasks):
        served = sum(each.end - each.start for each in outcome.slices if each.task == f"t{number}")
        assert served == sum(amount for _, amount in bursts)
    in_background = sum(each.end - each.start for each in outcome.slices if each.component == "node")
    assert in_background == sum(amount for _, amount in load.background)
    assert outcome.busy == sum(each.end - each.start for each in outcome.slices)


@given(WORKLOADS)
def test_a_core_serves_one_at_a_time_and_a_task_is_on_one_core_at_a_time(load: Workload) -> None:
    slices = execute(load).slices
    for one in [
        *([each for each in slices if each.core == core] for core in range(load.cores)),
        *([each for each in slices if each.task == f"t{number}"] for number in range(len(load.tasks))),
        [each for each in slices if each.component == "node"],
    ]:
        ordered = sorted(one)
        assert all(before.end <= after.start for before, after in pairwise(ordered))
    assert all(0 <= each.core < load.cores and each.start < each.end for each in slices)


@given(WORKLOADS)
def test_a_job_takes_at_least_its_amount_and_alone_exactly_that(load: Workload) -> None:
    jobs = execute(load).jobs
    assert len(jobs) == sum(len(bursts) for _, bursts in load.tasks)
    for job in jobs:
        assert job.done - job.asked >= job.amount
        if len(load.tasks) + bool(load.background) <= load.cores:
            assert job.done - job.asked == job.amount


@given(WORKLOADS)
def test_no_core_idles_while_somebody_wants_it_and_the_urgent_go_first(load: Workload) -> None:
    outcome = execute(Workload(load.cores, load.scheduler, load.quantum, load.tasks, background=[]))
    moments = sorted(
        {each.start for each in outcome.slices}
        | {each.end for each in outcome.slices}
        | {job.asked for job in outcome.jobs}
    )
    for start, end in pairwise(moments):
        wanting = [job for job in outcome.jobs if job.asked <= start and end <= job.done]
        running = [each.task for each in outcome.slices if each.start <= start and end <= each.end]
        assert len(running) == min(load.cores, len(wanting))
        if load.scheduler == "fixed-priority":
            served = [job.priority for job in wanting if job.name in running]
            passed_over = [job.priority for job in wanting if job.name not in running]
            assert min(served, default=9) >= max(passed_over, default=0)


@given(WORKLOADS)
def test_first_come_is_first_served(load: Workload) -> None:
    outcome = execute(Workload(load.cores, "fifo", load.quantum, load.tasks, background=[]))
    begun = {
        (job.asked, job.name): min(
            each.start for each in outcome.slices if each.task == job.name and each.start >= job.asked
        )
        for job in outcome.jobs
        if job.amount
    }
    for (asked, _), start in begun.items():
        for (asked_later, _), start_later in begun.items():
            assert asked_later <= asked or start <= start_later


@given(WORKLOADS)
def test_the_same_workload_gives_the_same_trace(load: Workload) -> None:
    assert execute(load) == execute(load)


@given(
    st.lists(st.lists(st.integers(0, 20), min_size=1, max_size=8), min_size=1, max_size=8), st.integers(0, 60)
)
def test_sleepers_wake_when_they_asked_to_however_the_run_is_cut(pauses: list[list[int]], cut: int) -> None:
    def once(*ends: int) -> list[tuple[int, int]]:
        kernel = VirtualKernel()
        seen: list[tuple[int, int]] = []

        def body(number: int) -> Callable[[], None]:
            def run() -> None:
                for pause in pauses[number]:
                    sleep(kernel, pause)
                    seen.append((kernel.now(), number))

            return run

        for number in range(len(pauses)):
            kernel.spawn(body(number), str(number), ExecutionContext(str(number)))
        for end in ends:
            kernel.run(end)
        assert kernel.close() == []
        return seen

    whole = once(FAR)
    assert [when for when, _ in whole] == sorted(when for when, _ in whole)
    for number, own in enumerate(pauses):
        woken = [when for when, who in whole if who == number]
        assert woken == [sum(own[: i + 1]) for i in range(len(own))]
    assert once(cut, FAR) == whole


@given(
    st.lists(st.integers(0, 10), min_size=1, max_size=20),
    st.lists(st.one_of(st.none(), st.integers(0, 10)), min_size=1, max_size=20),
)
def test_a_queue_loses_nothing_and_keeps_the_order(puts: list[int], gets: list[int | None]) -> None:
    kernel = VirtualKernel()
    queue: Queue[int] = Queue(kernel, "queue")
    got: list[int] = []

    def producer() -> None:
        for number, pause in enumerate(puts):
            sleep(kernel, pause)
            queue.put(number)

    def consumer() -> None:
        for within in gets:
            item = queue.get(within if within is not None else FAR)
            if item is not None:
                got.append(item)

    kernel.spawn(producer, "producer", ExecutionContext("producer"))
    kernel.spawn(consumer, "consumer", ExecutionContext("consumer"))
    kernel.run(2 * FAR * len(gets))
    assert got == list(range(len(got)))
    assert len(got) + len(queue) == len(puts)
    assert kernel.close() == []
