"""Calls through ports, worked out by hand on two processors."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field

import pytest

from volery.base.errors import ComponentError, EstimateError, UsageError
from volery.base.time import MS, Ns, S
from volery.components.instance import COMPONENT_MARK, Allocation, RunningInstance
from volery.components.ports import HEADER_BYTES, ComponentPort, PortList, size_of
from volery.components.programs import start
from volery.cost.pricing import FREE, Cost, StatedPricing
from volery.kernel import waiting
from volery.kernel.processor import Processor
from volery.kernel.task import Cancelled, ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.kernel.wall import WallKernel
from volery.trace.events import Call, Charge, Failure, Slice


class Given:
    """A program that becomes an object made by the test."""

    def __init__(self, thing):
        self.thing = thing

    def check(self, given, operations, active):
        pass

    def make(self, given):
        return self.thing

    def run(self, thing):
        thing.run()


class Bench:
    """A kernel with two processors, and what it recorded."""

    def __init__(self):
        self.events = []
        self.kernel = VirtualKernel(self.events.append)
        self.onboard = Processor(self.kernel, "onboard")
        self.ground = Processor(self.kernel, "ground")
        self.failures = []

    def instance(self, name, thing, seat, pricing=None, operations=()):
        instance = RunningInstance(self.kernel, name, seat, pricing or FREE, operations)
        self.things = {**getattr(self, "things", {}), name: (instance, thing)}
        return instance

    def run(self, until=S):
        for instance, thing in self.things.values():
            start(
                instance, Given(thing), {}, self.kernel.root, lambda *failure: self.failures.append(failure)
            )
        self.kernel.run(until)

    def of(self, kind):
        return [event for event in self.events if isinstance(event, kind)]

    def busy(self, processor):
        return [
            (ran.start / MS, ran.end / MS, ran.component)
            for ran in self.of(Slice)
            if ran.processor == processor
        ]

    def travel(self, takes: Ns):
        return lambda size: self.kernel.park(self.kernel.now() + takes, "network")


@dataclass
class Doing:
    """A component that does what a list says, in milliseconds of computing and calls."""

    kernel: object
    steps: list
    log: list = field(default_factory=list)

    def work(self):
        for step in self.steps:
            if callable(step):
                step()
            else:
                self.kernel.current().charge(int(step * MS))
        return "done"

    run = work


def free(**operations):
    return StatedPricing({name: Cost(int(time * MS)) for name, time in operations.items()}, Cost(0))


def test_nested_calls_over_two_processors_under_preemption():
    """a (onboard) computes 4, calls b (ground): 3, which calls c (onboard): 2; b 1 more, a 1 more.

    A trip takes 3 ms. On board an urgent task takes 2..5, on the ground an urgent task takes 11..13.
    """
    bench = Bench()
    kernel = bench.kernel
    c = bench.instance("c", Doing(kernel, []), Allocation(bench.onboard), free(work=2), ("work",))
    to_c = ComponentPort(kernel, "b", c, bench.travel(3 * MS), bench.travel(3 * MS))
    b = bench.instance("b", Doing(kernel, [to_c.work, 1]), Allocation(bench.ground), free(work=3), ("work",))
    to_b = ComponentPort(kernel, "a", b, bench.travel(3 * MS), bench.travel(3 * MS))
    bench.instance("a", Doing(kernel, [4, to_b.work, 1]), Allocation(bench.onboard, priority=1), free())

    def urgent(processor, at, amount):
        def body():
            kernel.sleep_until(int(at * MS))
            kernel.consume(int(amount * MS))

        kernel.spawn(body, "urgent", ExecutionContext("urgent", processor, 9))

    urgent(bench.onboard, 2, 3)
    urgent(bench.ground, 11, 2)
    bench.run()
    # a computes 0..2, is preempted 2..5, computes 5..7; trip 7..10; b computes 10..11, 13..15; trip 15..18;
    # c computes 18..20; trip 20..23; b computes 23..24; trip 24..27; a computes 27..28
    assert bench.busy("onboard") == [(0, 2, "a"), (2, 5, "urgent"), (5, 7, "a"), (18, 20, "c"), (27, 28, "a")]
    assert bench.busy("ground") == [(10, 11, "b"), (11, 13, "urgent"), (13, 15, "b"), (23, 24, "b")]
    calls = [
        (call.start / MS, call.end / MS, call.caller, call.callee, call.outcome) for call in bench.of(Call)
    ]
    assert calls == [(15, 23, "b", "c", "ok"), (7, 27, "a", "b", "ok")]
    charges = [(charge.component, charge.kind, charge.caller / MS) for charge in bench.of(Charge)]
    assert charges == [("b", "operation:work", 3), ("c", "operation:work", 2)]


def test_one_caller_at_a_time_by_priority():
    bench = Bench()
    kernel = bench.kernel
    shared = bench.instance("shared", Doing(kernel, []), Allocation(bench.ground), free(work=10), ("work",))
    ends = []

    def caller(name, priority, at):
        port = ComponentPort(kernel, name, shared, None, None)
        doing = Doing(
            kernel,
            [
                lambda: waiting.sleep(kernel, at * MS),
                port.work,
                lambda: ends.append((name, kernel.now() / MS)),
            ],
        )
        bench.instance(name, doing, Allocation(None, priority=priority), free())

    caller("first", 1, 1)
    caller("second", 1, 2)
    caller("urgent", 5, 3)
    bench.run()
    assert ends == [("first", 11), ("urgent", 21), ("second", 31)]


def test_a_call_has_the_callers_priority_unless_the_callee_states_one():
    bench = Bench()
    kernel = bench.kernel
    seen = {}

    class Looking:
        def __init__(self, name):
            self.name = name

        def look(self):
            seen[self.name] = kernel.current().priority

        def run(self):
            pass

    passive = bench.instance("passive", Looking("passive"), Allocation(bench.ground), free(look=0), ("look",))
    active = bench.instance(
        "active", Looking("active"), Allocation(bench.ground, priority=3), free(look=0), ("look",)
    )
    ports = [ComponentPort(kernel, "caller", callee, None, None) for callee in (passive, active)]
    bench.instance(
        "caller", Doing(kernel, [port.look for port in ports]), Allocation(bench.ground, priority=8), free()
    )
    bench.run()
    assert seen == {"passive": 8, "active": 3}


class Keeper:
    """Keeps what it is given and gives back what it keeps."""

    def __init__(self):
        self.kept = None

    def keep(self, thing):
        self.kept = thing
        return thing


@pytest.mark.parametrize("far", [True, False])
def test_arguments_and_results_are_copied_between_processors_only(far):
    bench = Bench()
    keeper = Keeper()
    kept = bench.instance("keeper", keeper, Allocation(bench.ground), free(keep=0), ("keep",))
    port = ComponentPort(bench.kernel, "caller", kept, None, None)
    mine = {"list": [1]}
    returned = []
    place = bench.onboard if far else bench.ground
    bench.instance(
        "caller",
        Doing(bench.kernel, [lambda: returned.append(port.keep(mine))]),
        Allocation(place, priority=0),
        free(),
    )
    bench.run()
    assert keeper.kept == mine == returned[0]
    assert (keeper.kept is mine) is not far
    assert (returned[0] is keeper.kept) is not far


def test_a_value_that_cannot_be_copied_cannot_be_sent_to_another_processor():
    bench = Bench()
    kernel = bench.kernel
    keeper = bench.instance("keeper", Keeper(), Allocation(bench.ground), free(keep=0), ("keep",))
    port = ComponentPort(kernel, "caller", keeper, None, None)
    said = []

    def attempt(thing):
        try:
            port.keep(thing)
        except UsageError as error:
            said.append(str(error))

    steps = [lambda: attempt(threading.Lock()), lambda: attempt(port)]
    bench.instance("caller", Doing(kernel, steps), Allocation(bench.onboard, priority=0), free())
    bench.run()
    assert said[0].startswith(
        "the arguments of keeper.keep cannot be copied to another processor: cannot pickle"
    )
    assert said[1] == "a port (here: to keeper) cannot be sent to another processor"


class Faulty:
    """Raises in every way."""

    def __init__(self, kernel, other=None):
        self.kernel, self.other = kernel, other

    def boom(self):
        self.kernel.current().charge(2 * MS)
        raise ValueError("no such parcel")

    def pass_on(self):
        return self.other.boom()

    def wait(self):
        self.kernel.park(None, "for ever")


def test_an_error_of_a_callee_names_it_and_leaves_it_usable():
    bench = Bench()
    kernel = bench.kernel
    faulty = bench.instance("faulty", Faulty(kernel), Allocation(bench.ground), free(boom=0), ("boom",))
    middle_port = ComponentPort(kernel, "middle", faulty, None, None)
    middle = bench.instance(
        "middle", Faulty(kernel, middle_port), Allocation(bench.ground), free(pass_on=0), ("pass_on",)
    )
    port = ComponentPort(kernel, "caller", middle, None, None)
    caught = []

    def attempt():
        try:
            port.pass_on()
        except Exception as error:
            caught.append(error)

    bench.instance("caller", Doing(kernel, [attempt, attempt]), Allocation(bench.onboard, priority=0), free())
    bench.run()
    assert [type(error) for error in caught] == [ComponentError, ComponentError]
    assert caught[0].component == "faulty"
    assert "boom raised ValueError: no such parcel (test_ports.py:" in str(caught[0])
    assert isinstance(caught[0].__cause__, ValueError)
    assert [failure.who for failure in bench.of(Failure)] == ["faulty", "faulty"]
    assert bench.failures == []
    assert bench.busy("ground") == [(0, 2, "faulty"), (2, 4, "faulty")]  # what it computed before is paid
    assert {call.outcome for call in bench.of(Call)} == {"ComponentError"}


def test_a_call_that_the_callee_does_not_take_is_the_line_of_the_caller(monkeypatch):
    monkeypatch.setitem(globals(), COMPONENT_MARK, True)  # these lines are component code
    bench = Bench()
    faulty = bench.instance("faulty", Faulty(bench.kernel), Allocation(bench.ground), free(boom=0), ("boom",))
    port = ComponentPort(bench.kernel, "caller", faulty, None, None)

    def call():
        port.boom("too", "much")

    steps, line = [call], call.__code__.co_firstlineno + 1
    bench.instance("caller", Doing(bench.kernel, steps), Allocation(bench.onboard, priority=0), free())
    bench.run()
    assert f"(test_ports.py:{line})" in str(bench.failures[0][1])


def test_an_uncaught_error_ends_the_caller_and_is_reported():
    bench = Bench()
    faulty = bench.instance("faulty", Faulty(bench.kernel), Allocation(bench.ground), free(boom=0), ("boom",))
    port = ComponentPort(bench.kernel, "caller", faulty, None, None)
    bench.instance("caller", Doing(bench.kernel, [port.boom]), Allocation(bench.onboard, priority=0), free())
    bench.run()
    [(who, error)] = bench.failures
    assert who == "caller"
    assert error.component == "faulty"
    assert [failure.who for failure in bench.of(Failure)] == ["faulty", "caller"]


def test_cancellation_passes_through_except_exception_and_frees_the_callee():
    bench = Bench()
    kernel = bench.kernel
    seen = []
    faulty = Faulty(kernel)
    callee = bench.instance("callee", faulty, Allocation(bench.ground), free(wait=0), ("wait",))
    port = ComponentPort(kernel, "caller", callee, None, None)

    def body():
        try:
            try:
                port.wait()
            except Exception:
                seen.append("caught by the user")
        except Cancelled:
            seen.append("cancelled")
            raise

    bench.instance("caller", Doing(kernel, [body]), Allocation(bench.onboard, priority=0), free())
    kernel.call_at(5 * MS, lambda: kernel.cancel(kernel.root, "enough"))
    bench.run()
    assert kernel.close() == []
    assert seen == ["cancelled"]
    assert callee._lock.owner is None


def test_a_missing_figure_is_an_error_before_anything_starts():
    bench = Bench()
    instance = bench.instance("planner", Keeper(), Allocation(bench.ground), StatedPricing({}), ("keep",))
    with pytest.raises(EstimateError, match="planner: no time is stated for its operation 'keep'"):
        start(instance, Given(Keeper()), {}, bench.kernel.root, print)
    active = bench.instance("loop", Keeper(), Allocation(bench.ground, priority=1), StatedPricing({}))
    with pytest.raises(EstimateError, match="loop: it is active, but no time is stated for an activation"):
        start(active, Given(Keeper()), {}, bench.kernel.root, print)


def test_an_activation_is_charged_at_each_release():
    bench = Bench()
    kernel = bench.kernel

    class Loop:
        def run(self):
            rate = waiting.Rate(kernel, 100 * MS)
            while True:
                rate.sleep()

    pricing = StatedPricing({}, Cost(7 * MS, 0.002))
    bench.instance("loop", Loop(), Allocation(bench.onboard, priority=1), pricing)
    bench.run(250 * MS)
    assert bench.busy("onboard") == [(0, 7, "loop"), (107, 114, "loop"), (207, 214, "loop")]
    assert [(charge.kind, charge.energy) for charge in bench.of(Charge)] == [("activation", 0.002)] * 3


def test_calls_wait_for_the_constructor():
    bench = Bench()
    kernel = bench.kernel
    log = []

    class Slow(Given):
        def make(self, given):
            waiting.sleep(kernel, 50 * MS)
            return Keeper()

    slow = RunningInstance(kernel, "slow", Allocation(bench.ground), free(keep=0), ("keep",))
    port = ComponentPort(kernel, "caller", slow, None, None)
    bench.instance(
        "caller",
        Doing(kernel, [lambda: log.append((port.keep(1), kernel.now() / MS))]),
        Allocation(None, priority=0),
    )
    bench.things["slow"] = (slow, None)
    start(slow, Slow(None), {}, kernel.root, print)
    del bench.things["slow"]
    bench.run()
    assert log == [(1, 50)]


def test_a_call_of_a_component_without_an_object_names_it():
    bench = Bench()
    kernel = bench.kernel

    class Broken(Given):
        def make(self, given):
            raise RuntimeError("no camera")

    failures = []
    broken = RunningInstance(kernel, "broken", Allocation(bench.ground), free(keep=0), ("keep",))
    start(broken, Broken(None), {}, kernel.root, lambda *args: failures.append(args))
    port = ComponentPort(kernel, "caller", broken, None, None)
    bench.instance("caller", Doing(kernel, [lambda: port.keep(1)]), Allocation(None, priority=0))
    bench.run()
    assert "its constructor raised RuntimeError: no camera" in str(failures[0][1])
    assert str(bench.failures[0][1]) == "broken: cannot be called: its constructor has failed"


def test_an_unknown_operation_lists_the_valid_ones():
    bench = Bench()
    keeper = bench.instance("keeper", Keeper(), Allocation(), free(keep=0), ("keep",))
    port = ComponentPort(bench.kernel, "caller", keeper, None, None)
    with pytest.raises(
        AttributeError, match="keeper provides no operation 'kepp' \\(did you mean 'keep'\\?\\): keep"
    ):
        port.kepp  # noqa: B018 (looking is the test)
    with pytest.raises(UsageError, match="by a component or a mission only"):
        port.keep(1)


def test_a_port_list_is_read_by_index_and_by_name():
    bench = Bench()
    ports = PortList(
        [
            ComponentPort(
                bench.kernel,
                "caller",
                bench.instance(name, Keeper(), Allocation(), None, ("keep",)),
                None,
                None,
            )
            for name in ("one", "two")
        ]
    )
    assert len(ports) == 2
    assert ports[1] is ports["two"]
    assert [port.component for port in ports] == ["one", "two"] == list(ports.names)
    with pytest.raises(KeyError, match="did you mean 'two'"):
        ports["twoo"]


def test_the_network_receives_the_size_of_arguments_and_result():
    bench = Bench()
    sizes = []
    keeper = bench.instance("keeper", Keeper(), Allocation(bench.ground), free(keep=0), ("keep",))
    port = ComponentPort(bench.kernel, "caller", keeper, sizes.append, sizes.append)
    bench.instance(
        "caller",
        Doing(bench.kernel, [lambda: port.keep("äb")]),
        Allocation(bench.onboard, priority=0),
        free(),
    )
    bench.run()
    text = 4 + 3
    assert sizes == [HEADER_BYTES + 4 + (4 + text) + 4, HEADER_BYTES + text]


@dataclass
class Pair:
    left: float
    right: list


@pytest.mark.parametrize(
    ("value", "size"),
    [
        (None, 1),
        (True, 1),
        (3, 8),
        (2.5, 8),
        ("abc", 7),
        (b"12", 6),
        ([1, 2], 20),
        ({"a": 1}, 17),
        (Pair(1.0, [2]), 20),
    ],
)
def test_sizes(value, size):
    assert size_of(value) == size


def test_calls_work_on_the_wall_clock():
    """Threads instead of greenlets; nothing waits, so nothing takes time here."""
    events, results = [], []
    kernel = WallKernel(record=events.append)
    keeper = Keeper()
    callee = RunningInstance(kernel, "keeper", Allocation(), FREE, ("keep",))
    caller = RunningInstance(kernel, "caller", Allocation(priority=0))
    faulty = RunningInstance(kernel, "faulty", Allocation(), FREE, ("boom",))
    port, broken = (ComponentPort(kernel, "caller", one, None, None) for one in (callee, faulty))

    class Body:
        def run(self):
            results.append(port.keep("parcel"))
            try:
                broken.boom()
            finally:
                kernel.cancel(kernel.root, "seen enough")

    class Broken:
        def boom(self):
            raise ValueError("no")

    failures = []
    for instance, thing in ((callee, keeper), (faulty, Broken()), (caller, Body())):
        start(instance, Given(thing), {}, kernel.root, lambda *failed: failures.append(failed))
    kernel.run(60 * S)
    assert kernel.close() == []
    assert results == ["parcel"] == [keeper.kept]
    calls = [(event.callee, event.outcome) for event in events if isinstance(event, Call)]
    assert calls == [("keeper", "ok"), ("faulty", "ComponentError")]
