"""Bounds worked out by hand, and that no simulated response exceeds its bound."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from volery.base.time import MS, S
from volery.kernel.processor import Processor
from volery.kernel.task import Place
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import Rate
from volery.requirements.demand import Demands
from volery.requirements.response_bounds import Demand, Load, response_bounds
from volery.trace.events import Activation, Slice
from volery.trace.setup import ComponentSetup, ProcessorSetup


def bounds(*tasks, loads=(), cores=1):
    demands = [Demand(name, priority, cost * MS, period * MS) for name, priority, cost, period in tasks]
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
    assert bounds(("a", 1, 10, 100), loads=[Load(5 * MS)]) == {"a": 35}
    assert bounds(("a", 1, 10, 100), loads=[Load(10 * MS)]) == {"a": None}


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

    def loop(start, cost, period):
        kernel.sleep_until(start * MS)
        rate = Rate(kernel, period * MS)
        for _ in range(12):
            kernel.pay(cost * MS)
            rate.sleep()

    for number, (name, cost, start) in enumerate(zip(names, costs, starts, strict=False)):
        body = lambda at=(start, cost, 40 + 10 * number): loop(*at)  # noqa: E731
        kernel.spawn(body, name, Place(name, processor, number))
    kernel.run(2 * S)
    kernel.close()
    demands, longest = Demands(), {}
    for event in events:
        if isinstance(event, Slice):
            demands.slice(event)
        elif isinstance(event, Activation) and event.released >= 100 * MS:
            longest[event.component] = max(longest.get(event.component, 0), event.finished - event.released)
        if isinstance(event, Activation):
            demands.activation(event)
    setup = ProcessorSetup("cpu", scheduler="fixed-priority", cores=cores)
    known = {name: ComponentSetup(name, priority=number) for number, name in enumerate(names)}
    found = demands.bounds(setup, known)
    assert set(found) == set(longest)
    for name, bound in found.items():
        assert bound is None or longest[name] <= bound
    assert found[names[-1]] is not None  # the most urgent


def test_there_is_no_bound_without_fixed_priorities():
    assert Demands().bounds(ProcessorSetup("cpu", scheduler="round-robin"), {}) == {}
