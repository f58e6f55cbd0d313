"""Bounds worked out by hand, and that no simulated response exceeds its bound."""

from __future__ import annotations

from functools import partial

from hypothesis import given, settings
from hypothesis import strategies as st

from volery.base.time import MS, S
from volery.kernel.processor import Processor
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import Rate, current_task, end_activation
from volery.requirements.response_bounds import BackgroundLoad, Demands, TaskDemand, response_bounds
from volery.trace.attachments import ComponentSetup, ProcessorSetup
from volery.trace.events import NONE, Activation, Slice


def bounds(*tasks, loads=(), cores=1):
    demands = [
        TaskDemand.periodic(name, priority, cost * MS, period * MS) for name, priority, cost, period in tasks
    ]
    found = response_bounds(demands, loads, cores)
    return {name: None if bound is None else bound / MS for name, bound in found.items()}


def test_the_example_of_the_text_books():
    found = bounds(("a", 3, 3, 7), ("b", 2, 3, 12), ("c", 1, 5, 20))
    assert found == {"a": 3, "b": 6, "c": 20}


def test_equals_wait_for_each_other():
    assert bounds(("a", 1, 3, 50), ("b", 1, 4, 50)) == {"a": 7, "b": 7}


def test_what_does_not_fit_has_no_bound():
    assert bounds(("a", 2, 6, 10), ("b", 1, 5, 10)) == {"a": 6, "b": None}


def test_other_computing_counts_as_more_urgent():
    assert bounds(("a", 1, 10, 100), loads=[BackgroundLoad(5 * MS)]) == {"a": 35}
    assert bounds(("a", 1, 10, 100), loads=[BackgroundLoad(10 * MS)]) == {"a": None}


def test_two_cores_bear_two_tasks():
    found = bounds(("a", 3, 4, 10), ("b", 2, 4, 10), ("c", 1, 4, 20), cores=2)
    assert found["a"] == 4
    assert found["b"] <= 6
    assert 4 <= found["c"] <= 12


@settings(deadline=None, max_examples=40)
@given(
    costs=st.lists(st.integers(1, 12), min_size=1, max_size=4),
    starts=st.lists(st.integers(0, 20), min_size=4, max_size=4),
    cores=st.integers(1, 2),
)
def test_no_simulated_response_is_longer_than_its_bound(costs, starts, cores):
    events = []
    kernel = VirtualKernel(events.append)
    processor = Processor(kernel, "cpu", cores=cores)
    names = [f"t{number}" for number in range(len(costs))]

    def loop(cost, period):
        rate = Rate(kernel, period * MS)
        for _ in range(12):
            kernel.consume(cost * MS)
            rate.sleep()

    for number, (name, cost, start) in enumerate(zip(names, costs, starts, strict=False)):
        body = partial(loop, cost, 40 + 10 * number)
        kernel.call_at(
            start * MS, partial(kernel.spawn, body, name, ExecutionContext(name, processor, number))
        )
    kernel.run(2 * S)
    kernel.close()
    found, longest = analysed(events, names, cores)
    assert set(found) == set(longest)
    for name, bound in found.items():
        assert bound is None or longest[name] <= bound
    assert found[names[-1]] is not None  # the most urgent


def analysed(events, names, cores=1, period=NONE):
    """The bounds and the longest responses by name; the later in *names*, the more urgent."""
    demands, longest = Demands(), {}
    for event in events:
        if isinstance(event, Slice):
            demands.slice(event)
        elif isinstance(event, Activation):
            longest[event.component] = max(longest.get(event.component, 0), event.finished - event.released)
            demands.activation(event)
    setup = ProcessorSetup("cpu", scheduler="fixed-priority", cores=cores)
    known = {name: ComponentSetup(name, priority=number, period=period) for number, name in enumerate(names)}
    return demands.bounds(setup, known), longest


@settings(deadline=None, max_examples=40)
@given(
    arrivals=st.lists(
        st.lists(st.tuples(st.integers(0, 60), st.integers(1, 9)), min_size=10, max_size=25),
        min_size=1,
        max_size=3,
    ),
    cores=st.integers(1, 2),
    promised=st.sampled_from([NONE, 5 * MS, 50 * MS]),
)
def test_bursts_of_messages_stay_within_their_bounds(arrivals, cores, promised):
    """Each task works off what arrives at it, in order; gaps are 0 to 60 ms and costs 1 to 9 ms."""
    events = []
    kernel = VirtualKernel(events.append)
    processor = Processor(kernel, "cpu", cores=cores)

    def work_off(gaps):
        due = 0
        for gap, cost in gaps:
            due += gap * MS
            end_activation(kernel)
            kernel.sleep_until(due)
            current_task(kernel).release(due)
            kernel.consume(cost * MS)

    names = [f"t{number}" for number in range(len(arrivals))]
    for number, name in enumerate(names):
        kernel.spawn(
            lambda at=arrivals[number]: work_off(at), name, ExecutionContext(name, processor, number)
        )
    kernel.run(10 * S)
    kernel.close()
    found, longest = analysed(events, names, cores, promised)
    for name, bound in found.items():
        assert bound is None or longest[name] <= bound
    if cores == 1 and promised != 5 * MS and all(gap >= 30 for gaps in arrivals for gap, _ in gaps):
        assert None not in found.values()


def loop_of(costs, releases, *, waits=0):
    """The events of a task ``a`` alone on a processor, which ends each activation *waits* late; in ms."""
    for at, cost in zip(releases, costs, strict=True):
        yield Slice(at * MS, (at + cost) * MS, "cpu", 0, "a", "a")
        yield Activation(at * MS, (at + cost + waits) * MS, "a", NONE)


def test_one_long_start_does_not_count_for_every_activation():
    events = loop_of([36, *[1] * 20], [0, *range(100, 300, 10)])
    found, _ = analysed(events, ["a"])
    assert found == {"a": 36 * MS}


def test_a_burst_waits_for_itself():
    """Three releases at once, each of 2 ms, every 20 ms: the last of them waits for the two before."""
    demand = TaskDemand("a", 0, (2 * MS,), (0, 0, 20 * MS), 0)
    assert response_bounds([demand], [], 1) == {"a": 6 * MS}
    assert [demand.released_within(one * MS) for one in (0, 1, 20, 21)] == [0, 3, 3, 6]


def test_a_promised_period_stands_in_for_releases_that_were_few():
    events = list(loop_of([2, 2, 2], [0, 200, 400]))
    assert analysed(events, ["a"])[0] == {}
    assert analysed(events, ["a"], period=100 * MS)[0] == {"a": 2 * MS}


def test_a_promise_that_is_not_kept_does_not_shorten_a_bound():
    """Two releases of 8 ms come within 1 ms where 100 were promised: the second waits 7 ms."""
    releases = [*range(0, 1000, 100), 1000, 1001]
    events = list(loop_of([8] * 11, releases[:11]))
    events += [Slice(1008 * MS, 1016 * MS, "cpu", 0, "a", "a"), Activation(1001 * MS, 1016 * MS, "a", NONE)]
    found, longest = analysed(events, ["a"], period=100 * MS)
    assert found == {"a": 15 * MS} == longest


def test_there_is_no_bound_for_what_waits_for_something_else():
    found, _ = analysed(loop_of([2] * 20, range(0, 400, 20), waits=5), ["a"])
    assert found == {"a": None}


def test_all_flows_of_control_of_a_component_count():
    events = []
    for at in range(0, 400, 20):
        events.append(Slice(at * MS, (at + 2) * MS, "cpu", 0, "a (timer)", "a"))
        events.append(Slice((at + 2) * MS, (at + 5) * MS, "cpu", 0, "a", "a"))
        events.append(Activation(at * MS, (at + 2) * MS, "a", NONE))
        events.append(Activation(at * MS, (at + 5) * MS, "a", NONE))
    found, longest = analysed(events, ["a"])
    assert found == longest == {"a": 5 * MS}


def test_there_is_no_bound_without_fixed_priorities():
    assert Demands().bounds(ProcessorSetup("cpu", scheduler="round-robin"), {}) == {}
