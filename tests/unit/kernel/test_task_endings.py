"""Cancellation and close, the same on both clocks."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from volery.base.time import MS, S
from volery.kernel.api import Kernel
from volery.kernel.processor import Processor
from volery.kernel.task import MAX_SWALLOWED_CANCELLATIONS, Cancelled, ExecutionContext, Task
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import Event, Lock, Queue, Rate, sleep

Spawn = Callable[..., Task]
LONG = 1000 * S


def test_an_end_comes_at_the_next_interaction_point_and_not_before(kernel: Kernel, spawn: Spawn) -> None:
    scope = kernel.root.child("components")
    seen: list[str] = []

    def body() -> None:
        kernel.cancel(scope, "enough")
        seen.append("computes on")
        try:
            with kernel.interact():
                seen.append("never")
        except Cancelled as end:
            seen.append(str(end))
            raise

    spawn(body, scope=scope)
    kernel.run(LONG)
    assert seen == ["computes on", "enough"]


@pytest.mark.parametrize(
    "point",
    [
        lambda kernel: sleep(kernel, 3600 * S),
        lambda kernel: kernel.sleep_until(0),
        lambda kernel: kernel.consume(0),
        lambda kernel: kernel.park(0, "nothing"),
        lambda kernel: Event(kernel, "event").is_set(),
        lambda kernel: Queue(kernel, "queue").put(1),
        lambda kernel: Rate(kernel, MS),
        lambda kernel: Lock(kernel, "lock").__enter__(),
    ],
    ids=["sleep", "sleep_until", "pay", "park", "is_set", "put", "Rate", "Lock"],
)
def test_every_call_that_leaves_the_component_is_an_interaction_point(
    kernel: Kernel, spawn: Spawn, point: Callable[[Kernel], object]
) -> None:
    scope = kernel.root.child("components")
    seen: list[str] = []

    def body() -> None:
        kernel.cancel(scope, "enough")
        with pytest.raises(Cancelled):
            point(kernel)
        seen.append("ended there")

    spawn(body, scope=scope)
    kernel.run(LONG)
    assert seen == ["ended there"]


def test_a_task_that_waits_is_ended_in_its_wait_and_cleans_up(kernel: Kernel, spawn: Spawn) -> None:
    scope = kernel.root.child("components")
    waiting = Event(kernel, "waiting")
    seen: list[str] = []

    def body() -> None:
        try:
            waiting.set()
            sleep(kernel, 3600 * S)
        except Exception:
            seen.append("an Exception, which it must not be")
        finally:
            seen.append("cleaned up")

    def supervisor() -> None:
        waiting.wait()
        kernel.cancel(scope, "enough")

    spawn(body, scope=scope)
    spawn(supervisor)
    kernel.run(LONG)
    assert seen == ["cleaned up"]


def test_a_scope_ends_with_its_parent_and_without_its_siblings(kernel: Kernel, spawn: Spawn) -> None:
    components, safety = kernel.root.child("components"), kernel.root.child("safety")
    begun: Queue[str] = Queue(kernel, "begun")
    go = Event(kernel, "go")
    ended: list[str] = []

    def body(name: str) -> Callable[[], None]:
        def run() -> None:
            begun.put(name)
            try:
                go.wait()
            except Cancelled:
                ended.append(name)
                raise

        return run

    def supervisor() -> None:
        for _ in range(3):
            begun.get()
        kernel.cancel(components, "enough")
        go.set()

    spawn(body("a"), scope=components.child("a"))
    spawn(body("b"), scope=components.child("b"))
    spawn(body("lander"), scope=safety)
    spawn(supervisor)
    kernel.run(LONG)
    assert sorted(ended) == ["a", "b"]


def test_nothing_begins_in_a_scope_that_has_ended(kernel: Kernel, spawn: Spawn) -> None:
    scope = kernel.root.child("components")
    seen: list[str] = []
    spawn(lambda: seen.append("begun"), scope=scope)
    kernel.cancel(scope, "enough")
    task = spawn(lambda: seen.append("begun"), scope=scope)
    later = scope.child("later")
    spawn(lambda: seen.append("begun"), scope=later)
    kernel.run(LONG)
    assert seen == []
    assert task.done
    assert later.cancelled == "enough"


def test_the_run_ends_when_the_root_scope_does(kernel: Kernel, spawn: Spawn) -> None:
    kernel.every(10 * MS, lambda: None)
    kernel.call_at(50 * MS, lambda: kernel.cancel(kernel.root, "enough"))
    kernel.run(10**18)
    assert kernel.close() == []


def test_close_unwinds_every_task(kernel: Kernel, spawn: Spawn) -> None:
    seen: list[str] = []
    begun = Event(kernel, "begun")

    def body() -> None:
        try:
            begun.set()
            sleep(kernel, 3600 * S)
        finally:
            seen.append("unwound")

    spawn(body)
    spawn(lambda: (begun.wait(), kernel.cancel(kernel.root, "over")))
    kernel.run(LONG)
    assert kernel.close() == []
    assert seen == ["unwound"]
    assert kernel.root.tasks == []


def test_what_escapes_while_closing_is_raised_when_all_are_unwound(kernel: Kernel, spawn: Spawn) -> None:
    seen: list[str] = []
    begun: Queue[str] = Queue(kernel, "begun")

    def clumsy() -> None:
        try:
            begun.put("clumsy")
            sleep(kernel, 3600 * S)
        finally:
            raise ZeroDivisionError

    def tidy() -> None:
        try:
            begun.put("tidy")
            sleep(kernel, 3600 * S)
        finally:
            seen.append("unwound")

    def interrupted() -> None:
        raise KeyboardInterrupt

    def supervisor() -> None:
        for _ in range(2):
            begun.get()
        kernel.post(interrupted)

    for body in (clumsy, tidy, supervisor):
        spawn(body)
    with pytest.raises(KeyboardInterrupt):
        kernel.run(LONG)
    with pytest.raises(ZeroDivisionError):
        kernel.close()
    assert seen == ["unwound"]
    assert kernel.close() == []


def test_close_without_a_run_begins_nothing(kernel: Kernel, spawn: Spawn) -> None:
    seen: list[str] = []
    spawn(lambda: seen.append("begun"))
    assert kernel.close() == []
    assert seen == []


def test_close_names_the_tasks_that_did_not_end(kernel: Kernel, spawn: Spawn) -> None:
    begun = Event(kernel, "begun")
    tries: list[int] = []

    def stubborn() -> None:
        while True:
            try:
                begun.set()
                sleep(kernel, 3600 * S)
            except BaseException:
                tries.append(1)

    spawn(stubborn, "mule")
    spawn(lambda: (begun.wait(), kernel.cancel(kernel.root, "over")))
    kernel.run(LONG)
    assert kernel.close() == ["mule"]
    assert len(tries) == MAX_SWALLOWED_CANCELLATIONS


def test_a_script_is_never_left_where_it_is(kernel: Kernel) -> None:
    tries: list[int] = []
    with kernel.adopt("script"):
        kernel.cancel(kernel.root, "over")
        while len(tries) < 2 * MAX_SWALLOWED_CANCELLATIONS:
            try:
                sleep(kernel, MS)
            except Cancelled:
                tries.append(1)
    assert len(tries) == 2 * MAX_SWALLOWED_CANCELLATIONS


def test_an_end_with_several_clean_ups_is_not_stubborn(kernel: Kernel, spawn: Spawn) -> None:
    flag, begun = Event(kernel, "flag"), Event(kernel, "begun")
    seen: list[int] = []

    def nest(depth: int) -> None:
        try:
            if depth:
                nest(depth - 1)
            else:
                begun.set()
                flag.wait()
        finally:
            seen.append(depth)
            flag.is_set()

    spawn(lambda: nest(MAX_SWALLOWED_CANCELLATIONS - 2))
    spawn(lambda: (begun.wait(), kernel.cancel(kernel.root, "over")))
    kernel.run(LONG)
    assert kernel.close() == []
    assert seen == list(range(MAX_SWALLOWED_CANCELLATIONS - 1))


def test_a_lock_passes_on_when_its_owner_is_ended(kernel: Kernel, spawn: Spawn) -> None:
    scope = kernel.root.child("components")
    lock = Lock(kernel, "lock")
    held, waited = Event(kernel, "held"), Queue[str](kernel, "waited")
    got: list[str] = []

    def owner() -> None:
        with lock, lock:
            held.set()
            sleep(kernel, 3600 * S)

    def next_one() -> None:
        held.wait()
        with lock:
            got.append("passed on")

    spawn(owner, scope=scope)
    spawn(next_one)
    spawn(lambda: (held.wait(), waited.put(""), kernel.cancel(scope, "enough")))
    kernel.run(LONG)
    assert got == ["passed on"]
    assert lock.owner is None


def test_a_task_cancelled_while_waiting_for_a_lock_is_removed(kernel: Kernel, spawn: Spawn) -> None:
    scope = kernel.root.child("components")
    lock = Lock(kernel, "lock")
    held, queued = Event(kernel, "held"), Event(kernel, "queued")
    got: list[str] = []

    def owner() -> None:
        with lock:
            held.set()
            queued.wait()
            kernel.cancel(scope, "enough")

    def impatient() -> None:
        held.wait()
        queued.set()
        with lock:
            got.append("never")

    spawn(owner)
    spawn(impatient, scope=scope)
    spawn(lambda: (queued.wait(), lock.__enter__(), got.append("third"), lock.__exit__(None, None, None)))
    kernel.run(LONG)
    assert got == ["third"]
    assert lock.owner is None


def test_the_lock_was_just_handed_to_a_task_that_is_ended(virtual: VirtualKernel, spawn: Spawn) -> None:
    scope = virtual.root.child("components")
    lock = Lock(virtual, "lock")
    got: list[str] = []

    def owner() -> None:
        with lock:
            sleep(virtual, 10)
        virtual.cancel(scope, "at the instant of the hand-over")

    def taker(name: str) -> Callable[[], None]:
        def run() -> None:
            sleep(virtual, 1)
            with lock:
                got.append(name)

        return run

    spawn(owner)
    spawn(taker("ended"), scope=scope)
    spawn(taker("alive"))
    virtual.run(S)
    assert got == ["alive"]
    assert lock.owner is None


def test_a_task_ended_while_it_computes_leaves_the_processor_clean(virtual: VirtualKernel) -> None:
    scope = virtual.root.child("components")
    processor = Processor(virtual, "core")
    ends: list[int] = []

    def compute(amount: int) -> Callable[[], None]:
        def body() -> None:
            virtual.consume(amount)
            ends.append(virtual.now())

        return body

    virtual.spawn(compute(100 * MS), "ended", ExecutionContext("ended", processor, 5), scope)
    virtual.spawn(compute(10 * MS), "waits", ExecutionContext("waits", processor, 1))
    virtual.call_at(30 * MS, lambda: virtual.cancel(scope, "enough"))
    virtual.run(S)
    assert ends == [40 * MS]
    assert processor.busy_ns(virtual.now()) == 40 * MS
    virtual.spawn(compute(5 * MS), "after", ExecutionContext("after", processor, 1))
    virtual.run(2 * S)
    assert ends == [40 * MS, 45 * MS]
