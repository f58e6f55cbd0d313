"""Blocking-process events per second of the kernels, as ratios to SimPy and to threads handing a baton.

Everything is measured in this one run, in rounds that take turns; the figures are medians over the rounds.

    python bench/kernel.py [--quick]
"""

from __future__ import annotations

import argparse
import gc
import os
import threading
from collections.abc import Callable, Generator
from functools import partial
from heapq import heappop, heapreplace
from statistics import median
from time import perf_counter
from typing import Any

import simpy

from volery.base.time import MS, US
from volery.kernel.processor import Processor
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import Queue, current_task

FOREVER = 10**18


def timed(action: Callable[[], object]) -> float:
    gc.collect()
    start = perf_counter()
    action()
    return perf_counter() - start


def sleepers(processes: int, events: int) -> float:
    """Processes that sleep, each with its own period."""
    kernel = VirtualKernel()
    each = events // processes

    def body(period: int) -> None:
        for _ in range(each):
            kernel.sleep_until(kernel.now() + period)

    for i in range(processes):
        kernel.spawn(partial(body, MS + i), str(i), ExecutionContext(str(i)))
    return each * processes / timed(lambda: kernel.run(FOREVER))


def simpy_sleepers(processes: int, events: int) -> float:
    environment = simpy.Environment()
    each = events // processes

    def body(period: int) -> Generator[simpy.Event, Any, None]:
        for _ in range(each):
            yield environment.timeout(period)

    for i in range(processes):
        environment.process(body(MS + i))
    return each * processes / timed(environment.run)


def computing(processes: int, events: int) -> float:
    """Processes that compute 5 us on one preemptive core and sleep: an event is one of both."""
    kernel = VirtualKernel()
    processor = Processor(kernel, "core")
    each = events // processes // 2

    def body(period: int) -> None:
        task = current_task(kernel)
        for _ in range(each):
            task.charge(5 * US)
            kernel.sleep_until(kernel.now() + period)

    for i in range(processes):
        kernel.spawn(partial(body, MS + i), str(i), ExecutionContext(str(i), processor, i))
    return 2 * each * processes / timed(lambda: kernel.run(FOREVER))


def simpy_computing(processes: int, events: int) -> float:
    environment = simpy.Environment()
    core = simpy.PriorityResource(environment)
    each = events // processes // 2

    def body(number: int) -> Generator[simpy.Event, Any, None]:
        for _ in range(each):
            with core.request(-number) as request:
                yield request
                yield environment.timeout(5 * US)
            yield environment.timeout(MS + number)

    for i in range(processes):
        environment.process(body(i))
    return 2 * each * processes / timed(environment.run)


def handover(events: int) -> float:
    """Two processes that hand an item back and forth through queues."""
    kernel = VirtualKernel()
    there: Queue[int] = Queue(kernel, "there")
    back: Queue[int] = Queue(kernel, "back")

    def body(first: Queue[int], second: Queue[int]) -> Callable[[], None]:
        def loop() -> None:
            for _ in range(events // 2):
                first.put(1)
                second.get()

        return loop

    kernel.spawn(body(there, back), "a", ExecutionContext("a"))
    kernel.spawn(body(back, there), "b", ExecutionContext("b"))
    return events / timed(lambda: kernel.run(FOREVER))


def simpy_handover(events: int) -> float:
    environment = simpy.Environment()
    there, back = simpy.Store(environment), simpy.Store(environment)

    def body(first: simpy.Store, second: simpy.Store) -> Generator[simpy.Event, Any, None]:
        for _ in range(events // 2):
            yield first.put(1)
            yield second.get()

    environment.process(body(there, back))
    environment.process(body(back, there))
    return events / timed(environment.run)


def baton(processes: int, events: int) -> float:
    """The sleepers as threads: a sleeping thread wakes the thread that is due next."""
    each = events // processes
    due = [(0, number) for number in range(processes)]
    turns = [threading.Semaphore(0) for _ in due]
    over = threading.Semaphore(0)

    def pass_on() -> None:
        (turns[due[0][1]] if due else over).release()

    def body(number: int) -> None:
        now = 0
        turns[number].acquire()
        for _ in range(each):
            now += MS + number
            heapreplace(due, (now, number))
            if due[0][1] != number:
                pass_on()
                turns[number].acquire()
        heappop(due)
        pass_on()

    threads = [threading.Thread(target=body, args=(number,)) for number in range(processes)]
    for thread in threads:
        thread.start()

    def go() -> None:
        pass_on()
        over.acquire()

    rate = each * processes / timed(go)
    for thread in threads:
        thread.join()
    return rate


def on_one_core(measure: Callable[[], float]) -> float:
    """Threads that share a core wake each other about as fast as they can; left alone they often do not."""
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(allowed)})
    try:
        return measure()
    finally:
        os.sched_setaffinity(0, allowed)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="3 rounds of a tenth of the events")
    quick = parser.parse_args().quick
    rounds, events = (3, 20_000) if quick else (7, 200_000)
    runs: dict[str, Callable[[], float]] = {
        "volery, 1 process": lambda: sleepers(1, events),
        "SimPy, 1 process": lambda: simpy_sleepers(1, events),
        "volery, 100 processes": lambda: sleepers(100, events),
        "SimPy, 100 processes": lambda: simpy_sleepers(100, events),
        "volery, 20 processes computing on a core": lambda: computing(20, events // 2),
        "SimPy, 20 processes computing on a core": lambda: simpy_computing(20, events // 2),
        "volery, 10,000 processes of 60 events": lambda: sleepers(10_000, 600_000),
        "SimPy, 10,000 processes of 60 events": lambda: simpy_sleepers(10_000, 600_000),
        "volery, queue handed to and fro": lambda: handover(events // 2),
        "SimPy, store handed to and fro": lambda: simpy_handover(events // 2),
        "100 threads handing a baton": lambda: baton(100, events // 10),
        "100 threads handing a baton on one core": lambda: on_one_core(lambda: baton(100, events // 10)),
    }
    taken: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            taken[name].append(run())
    rate = {name: median(values) for name, values in taken.items()}
    for name, value in rate.items():
        print(f"{name:42} {value:12,.0f} events/s")
    print()
    hundred = rate["volery, 100 processes"]
    for what, ratio in (
        ("1 process, to SimPy's", rate["volery, 1 process"] / rate["SimPy, 1 process"]),
        ("100 processes, to SimPy's", hundred / rate["SimPy, 100 processes"]),
        (
            "computing on a core, to SimPy's (which does not preempt)",
            rate["volery, 20 processes computing on a core"]
            / rate["SimPy, 20 processes computing on a core"],
        ),
        (
            "10,000 processes of 60 events, to SimPy's",
            rate["volery, 10,000 processes of 60 events"] / rate["SimPy, 10,000 processes of 60 events"],
        ),
        (
            "queues, to SimPy's stores",
            rate["volery, queue handed to and fro"] / rate["SimPy, store handed to and fro"],
        ),
        ("100 processes, to threads handing a baton", hundred / rate["100 threads handing a baton"]),
        (
            "100 processes, to threads that are held on one core",
            hundred / rate["100 threads handing a baton on one core"],
        ),
    ):
        print(f"{what:60} {ratio:6.2f}")


if __name__ == "__main__":
    main()
