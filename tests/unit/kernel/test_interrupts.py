"""Ctrl-C: a real SIGINT, raised where the kernel is in a known state."""

from __future__ import annotations

import gc
import os
import signal
from collections.abc import Callable, Iterator

import pytest

from volery.base.time import MS, S
from volery.kernel.api import Kernel
from volery.kernel.interrupts import Interrupts
from volery.kernel.task import Task
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import Event, Queue, sleep
from volery.kernel.wall import WallKernel

Spawn = Callable[..., Task]
LONG = 1000 * S


def ctrl_c() -> None:
    os.kill(os.getpid(), signal.SIGINT)


def ctrl_c_and_spin() -> None:
    ctrl_c()
    while True:
        pass


@pytest.fixture(autouse=True)
def pythons_own_handler() -> Iterator[None]:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    gc.disable()  # an interrupt in a collector's callback, as hypothesis installs one, would be lost
    yield
    gc.enable()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    signal.signal(signal.SIGINT, before)


def test_an_interrupt_ends_the_run_between_two_events_and_the_run_can_go_on(
    kernel: Kernel, spawn: Spawn
) -> None:
    seen: list[str] = []
    landed = Event(kernel, "landed")

    def action() -> None:
        ctrl_c()
        seen.append("the action was not cut short")

    def lander() -> None:
        landed.wait()
        seen.append("landed")

    spawn(lander)
    kernel.call_at(10 * MS, action)
    never = kernel.call_at(10**17, lambda: seen.append("never"))
    with pytest.raises(KeyboardInterrupt):
        kernel.run(10**18)
    assert seen == ["the action was not cut short"]
    assert kernel.current() is None
    landed.set()
    never.cancel()
    kernel.run(kernel.now() + LONG)
    assert seen[1:] == ["landed"]


def test_tasks_that_hand_over_directly_are_interrupted_too(virtual: VirtualKernel, spawn: Spawn) -> None:
    def body() -> None:
        while True:
            sleep(virtual, MS)

    for name in "ab":
        spawn(body, name)
    virtual.call_at(100 * MS, ctrl_c)
    with pytest.raises(KeyboardInterrupt):
        virtual.run(10**18)
    assert 100 * MS <= virtual.now() <= 101 * MS
    assert virtual.close() == []


def test_component_code_in_an_endless_loop_is_interrupted_at_once(
    virtual: VirtualKernel, spawn: Spawn
) -> None:
    seen: list[str] = []

    def endless() -> None:
        try:
            ctrl_c_and_spin()
        finally:
            seen.append("unwound")

    def other() -> None:
        sleep(virtual, S)
        seen.append("the others live on")

    spawn(other)
    spawn(endless)
    with pytest.raises(KeyboardInterrupt):
        virtual.run(10 * S)
    assert seen == ["unwound"]
    virtual.run(10 * S)
    assert seen[1:] == ["the others live on"]


def test_component_code_cannot_swallow_an_interrupt(virtual: VirtualKernel, spawn: Spawn) -> None:
    seen: list[str] = []

    def body() -> None:
        try:
            ctrl_c_and_spin()
        except KeyboardInterrupt:
            seen.append("swallowed")
        sleep(virtual, MS)
        seen.append("goes on")

    spawn(body)
    with pytest.raises(KeyboardInterrupt):
        virtual.run(S)
    virtual.run(S)
    assert seen == ["swallowed", "goes on"]


def test_a_script_that_blocks_is_interrupted_in_its_wait(kernel: Kernel) -> None:
    never: Queue[int] = Queue(kernel, "never")

    def once_it_waits() -> None:
        if script.waiting_for == "never":
            ctrl_c()
        else:
            kernel.call_at(kernel.now() + MS, once_it_waits)

    with kernel.adopt("script") as script:
        kernel.call_at(0, once_it_waits)
        with pytest.raises(KeyboardInterrupt):
            never.get()
        sleep(kernel, MS)  # and may go on


def test_a_script_that_computes_is_interrupted_at_once_and_once(kernel: Kernel) -> None:
    with kernel.adopt("script"):
        with pytest.raises(KeyboardInterrupt):
            ctrl_c_and_spin()
        sleep(kernel, MS)


def test_a_prompt_between_two_calls_is_interrupted_at_once(kernel: Kernel) -> None:
    handler = Interrupts(kernel)
    with kernel.adopt("script"), handler:
        handler._before = signal.default_int_handler
        with pytest.raises(KeyboardInterrupt):
            handler._handle(signal.SIGINT, None)  # as a prompt that waits in a library written in C
        sleep(kernel, MS)


def test_an_interrupt_just_before_the_end_is_not_lost(kernel: Kernel) -> None:
    kernel.call_at(10 * MS, ctrl_c)
    with pytest.raises(KeyboardInterrupt):
        kernel.run(LONG)


def test_a_handler_that_was_there_before_is_called_instead(kernel: Kernel) -> None:
    called: list[int] = []
    signal.signal(signal.SIGINT, lambda number, frame: called.append(number))
    kernel.call_at(10 * MS, ctrl_c)
    kernel.run(LONG)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    assert called == [signal.SIGINT]


def test_a_second_interrupt_is_raised_on_the_spot(virtual: VirtualKernel) -> None:
    seen: list[str] = []

    def stuck() -> None:
        ctrl_c()
        seen.append("the first waits for the end of the event")
        ctrl_c()
        seen.append("never")

    virtual.call_at(10, stuck)
    with pytest.raises(KeyboardInterrupt):
        virtual.run(S)
    assert seen == ["the first waits for the end of the event"]


@pytest.mark.parametrize("kernel", [VirtualKernel(pace=1.0), WallKernel()])
def test_a_kernel_that_waits_for_the_wall_is_interrupted(kernel: Kernel) -> None:
    kernel.call_at(0, ctrl_c)
    kernel.call_at(10**18, lambda: None)
    with pytest.raises(KeyboardInterrupt):
        kernel.run(10**18)
    kernel.close()
