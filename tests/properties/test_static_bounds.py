"""No simulated response exceeds its static bound: 1,000 random task sets on the project's own processors."""

from __future__ import annotations

from functools import partial

from hypothesis import event, given, settings
from hypothesis import strategies as st

from volery.analysis.busy_windows import (
    Callback,
    DeadlineTask,
    Dedicated,
    edf_bounds,
    executor_bounds,
    fifo_bound,
)
from volery.base.time import MS, US
from volery.kernel.processor import Processor
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import current_task, end_activation
from volery.requirements.response_bounds import TaskDemand, response_bounds
from volery.trace.events import Activation

ACTIVATIONS = 15

TASK = st.fixed_dictionaries(
    {
        "period": st.sampled_from([5, 8, 10, 14, 20, 25, 40]),
        "share": st.integers(3, 30),  # per cent of a core
        "offset": st.integers(0, 10),
        "jitter": st.sampled_from([0, 0, 2, 7, 15]),
        "late": st.lists(st.integers(0, 100), min_size=ACTIVATIONS, max_size=ACTIVATIONS),
        "takes": st.lists(st.integers(30, 100), min_size=ACTIVATIONS, max_size=ACTIVATIONS),
        "deadline": st.integers(50, 200),  # per cent of the period
    }
)


def periodic(kernel, task, cost):
    """Execute up to *cost* at each release, which is up to the jitter late; no release passes another."""
    last = 0
    for number, (late, takes) in enumerate(zip(task["late"], task["takes"], strict=True)):
        due = (task["offset"] + number * task["period"]) * MS + task["jitter"] * MS * late // 100
        last = due = max(due, last)
        end_activation(kernel)
        kernel.sleep_until(due)
        current_task(kernel).release(due)
        kernel.consume(cost * takes // 100)


def longest_responses(tasks, costs, scheduler, switch):
    longest = {}

    def record(seen):
        if isinstance(seen, Activation):
            longest[seen.component] = max(longest.get(seen.component, 0), seen.finished - seen.released)

    kernel = VirtualKernel(record)
    processor = Processor(kernel, "cpu", scheduler=scheduler, context_switch=switch)
    for number, (task, cost) in enumerate(zip(tasks, costs, strict=True)):
        name, deadline = str(number), task["period"] * MS * task["deadline"] // 100
        context = ExecutionContext(name, processor, -number, deadline=deadline)
        kernel.spawn(partial(periodic, kernel, task, cost), name, context)
    kernel.run(10_000 * MS)
    kernel.close()
    return longest


def bounds_of(tasks, costs, scheduler, switch):
    demands = [
        TaskDemand.periodic(str(number), -number, cost + 2 * switch, task["period"] * MS, task["jitter"] * MS)
        for number, (task, cost) in enumerate(zip(tasks, costs, strict=True))
    ]
    if scheduler == "fixed-priority":
        return response_bounds(demands, (), 1)
    if scheduler == "edf":
        return edf_bounds(
            [
                DeadlineTask(demand, task["period"] * MS * task["deadline"] // 100)
                for demand, task in zip(demands, tasks, strict=True)
            ]
        )
    return dict.fromkeys((one.name for one in demands), fifo_bound(demands))


@settings(deadline=None, max_examples=1000)
@given(
    tasks=st.lists(TASK, min_size=1, max_size=6),
    scheduler=st.sampled_from(["fixed-priority", "edf", "fifo"]),
    switch=st.sampled_from([0, 40 * US]),
)
def test_no_simulated_response_exceeds_its_static_bound(tasks, scheduler, switch):
    costs = [task["period"] * MS * task["share"] // 100 for task in tasks]
    bounds = bounds_of(tasks, costs, scheduler, switch)
    longest = longest_responses(tasks, costs, scheduler, switch)
    event(f"{scheduler}: {sum(one is not None for one in bounds.values())} of {len(bounds)} bounded")
    for name, response in longest.items():
        bound = bounds[name]
        assert bound is None or response <= bound, (name, response, bound)


@settings(deadline=None, max_examples=100)
@given(tasks=st.lists(TASK, min_size=1, max_size=5))
def test_the_bound_of_any_callback_covers_executors_in_order_of_arrival(tasks):
    """The default executor's bound of subscriptions assumes no order among those that wait."""
    costs = [task["period"] * MS * task["share"] // 100 for task in tasks]
    callbacks = [
        Callback(TaskDemand.periodic(str(number), 0, cost, task["period"] * MS, task["jitter"] * MS))
        for number, (task, cost) in enumerate(zip(tasks, costs, strict=True))
    ]
    bounds = executor_bounds(callbacks, Dedicated())
    for name, response in longest_responses(tasks, costs, "fifo", 0).items():
        bound = bounds[name]
        assert bound is None or response <= bound
