"""Plain Python that sleeps, waits, draws and threads runs on the clock and the seed of the run."""

from __future__ import annotations

import textwrap
from types import ModuleType

import pytest

from volery.base.time import MS, S
from volery.components.instance import Allocation, RunningInstance
from volery.components.loader import Loader
from volery.components.programs import load_program, start
from volery.components.virtual_stdlib import EPOCH, virtual_modules
from volery.kernel.virtual import VirtualKernel
from volery.trace.events import Activation, Failure, Text


@pytest.fixture
def run(tmp_path):
    """Return a function that runs bodies of ``run`` methods, one component a name, and returns reports."""

    def running(body, seed=1, names=("user",), seconds=60):
        path = tmp_path / "user.py"
        path.write_text(
            "import datetime, queue, random, threading, time\nfrom log import tell\n\n"
            "class User:\n    def run(self):\n" + textwrap.indent(textwrap.dedent(body), " " * 8)
        )
        events, reported = [], []
        kernel = VirtualKernel(events.append)
        log = ModuleType("log")
        log.tell = reported.append
        loader = Loader({**virtual_modules(kernel, seed), "log": log})
        for name in names:
            instance = RunningInstance(kernel, name, Allocation(priority=0))
            start(instance, load_program(loader, name, path, "User"), {}, kernel.root, lambda *failed: None)
        kernel.run(seconds * S)
        assert kernel.close() == []
        running.events = events
        assert [event.what for event in events if isinstance(event, Failure)] == []
        return reported

    return running


def test_time_is_that_of_the_run(run):
    reported = run(
        """
        tell((time.monotonic(), time.perf_counter_ns(), time.time()))
        time.sleep(2.5)
        tell((time.monotonic(), time.perf_counter_ns(), time.time_ns()))
        tell(time.strftime("%Y-%m-%d %H:%M:%S", time.localtime()))
        tell(time.gmtime(0).tm_year)
        """
    )
    assert reported[0] == (0.0, 0, EPOCH / S)
    assert reported[1] == (2.5, 2_500_000_000, EPOCH + 2_500_000_000)
    assert reported[2:] == ["2023-11-14 22:13:22", 1970]
    assert [event.released for event in run.events if isinstance(event, Activation)] == [0, 2500 * MS]


def test_datetime_is_that_of_the_run(run):
    reported = run(
        """
        now = datetime.datetime.now()
        time.sleep(90)
        tell(str(datetime.datetime.utcnow() - now))
        tell(datetime.datetime.now(datetime.timezone.utc).isoformat())
        tell(datetime.date.today().isoformat())
        tell(isinstance(now, datetime.datetime) and datetime.datetime(2020, 1, 2) < now)
        """,
        seconds=100,
    )
    assert reported == ["0:01:30", "2023-11-14T22:14:50+00:00", "2023-11-14", True]


def test_random_numbers_follow_the_seed_and_the_component(run):
    body = (
        "tell((random.random(), random.randint(1, 9), random.Random().random(), random.Random(3).random()))\n"
    )
    first, again = run(body, names=("one", "two")), run(body, names=("one", "two"))
    other = run(body, seed=2, names=("one", "two"))
    assert first == again
    assert len({draws[:3] for draws in first + other}) == 4
    assert len({draws[3] for draws in first + other}) == 1


def test_another_component_does_not_change_random_numbers(run):
    body = "tell(random.random())\n"
    assert run(body, names=("one",))[0] == run(body, names=("zero", "one"))[1]


def test_queues_pass_items_and_time_out(run):
    reported = run(
        """
        line = queue.Queue(maxsize=2)

        def produce():
            for number in range(4):
                line.put(number)
                tell(("put", number, time.monotonic()))

        threading.Thread(target=produce).start()
        time.sleep(1)
        while True:
            try:
                item = line.get(timeout=3)
            except queue.Empty:
                break
            tell(("got", item))
            line.task_done()
        tell((time.monotonic(), line.empty(), line.qsize()))
        line.join()
        try:
            line.get_nowait()
        except queue.Empty:
            tell("empty")
        line.put(1), line.put(2)
        tell(line.full())
        try:
            line.put_nowait(3)
        except queue.Full:
            tell("full")
        urgent, stack = queue.PriorityQueue(), queue.LifoQueue()
        for item in (3, 1, 2):
            urgent.put(item), stack.put(item)
        tell([urgent.get(), urgent.get(), stack.get(), stack.get()])
        """
    )
    assert [entry for entry in reported[:4] if entry[0] == "put"] == [("put", 0, 0.0), ("put", 1, 0.0)]
    assert [entry[1] for entry in reported[:8] if entry[0] == "got"] == [0, 1, 2, 3]
    assert reported[8:] == [(4.0, True, 0), "empty", True, "full", [1, 2, 2, 1]]


def test_threads_are_tasks_of_their_component(run):
    reported = run(
        """
        class Worker(threading.Thread):
            def run(self):
                time.sleep(2)
                tell(("worker", time.monotonic()))

        worker = Worker(name="w", daemon=True)
        worker.start()
        tell((worker.is_alive(), worker.name))
        worker.join(timeout=1)
        tell((worker.is_alive(), time.monotonic()))
        worker.join()
        tell((worker.is_alive(), time.monotonic()))
        timer = threading.Timer(5, tell, args=("never",))
        timer.start()
        timer.cancel()
        threading.Timer(3, tell, args=("later",)).start()
        """
    )
    assert reported == [(True, "w"), (True, 1.0), ("worker", 2.0), (False, 2.0), "later"]


def test_locks_events_semaphores_and_conditions(run):
    reported = run(
        """
        lock, again, ready = threading.Lock(), threading.RLock(), threading.Event()
        slots, condition, items = threading.Semaphore(1), threading.Condition(), []

        def other():
            with lock:
                tell(("other has it", time.monotonic()))
            ready.wait()
            tell(("ready", time.monotonic()))
            with condition:
                items.append(1)
                condition.notify()

        with lock, again, again:
            threading.Thread(target=other).start()
            time.sleep(1)
            tell((lock.acquire(blocking=False), lock.acquire(timeout=0.5), lock.locked()))
        time.sleep(0.5)
        tell(ready.wait(0.25))
        with condition:
            ready.set()
            tell((condition.wait_for(lambda: items, timeout=5), time.monotonic()))
            tell((condition.wait(0.5), time.monotonic()))
        tell((slots.acquire(), slots.acquire(timeout=1)))
        slots.release()
        with slots:
            tell(time.monotonic())
        try:
            threading.BoundedSemaphore(1).release()
        except ValueError as error:
            tell(str(error))
        """
    )
    assert reported == [
        (False, False, True),
        ("other has it", 1.5),
        False,
        ("ready", 2.25),
        ([1], 2.25),
        (False, 2.75),
        (True, False),
        3.75,
        "Semaphore released too many times",
    ]


def test_the_end_of_a_run_unwinds_threads_that_hold_and_wait(run):
    reported = run(
        """
        lock, condition = threading.Lock(), threading.Condition()

        def wait():
            try:
                with condition:
                    condition.wait()
            finally:
                tell("unwound")

        threading.Thread(target=wait).start()
        with lock:
            time.sleep(1000)
        """
    )
    assert reported == ["unwound"]


def test_the_threads_of_a_component_are_counted(run):
    reported = run(
        """
        tell((threading.active_count(), threading.current_thread() is threading.main_thread()))
        threading.Thread(target=lambda: tell(threading.current_thread() is threading.main_thread())).start()
        tell(threading.active_count())
        time.sleep(1.0)
        """,
        names=("user", "other"),
    )
    assert reported == [(1, True), 2, (1, True), 2, False, False]


def test_a_thread_that_waits_for_its_own_lock_is_named(run):
    run(
        """
        threading.Thread(target=lambda: time.sleep(1000)).start()
        lock = threading.Lock()
        with lock:
            lock.acquire(timeout=1.0)
            lock.acquire()
        """
    )
    (warning,) = (event.text for event in run.events if isinstance(event, Text))
    assert warning.startswith("waits for a lock that the same thread holds (user.py:11)")


def test_a_missing_name_states_the_reason(run):
    reported = run(
        """
        try:
            threading.Barrier(2)
        except AttributeError as error:
            tell(str(error))
        """
    )
    assert reported[0].startswith("threading.Barrier is not available in the files of components")


def test_an_error_of_a_thread_is_a_failure_of_the_component(tmp_path):
    path = tmp_path / "user.py"
    path.write_text(
        "import threading\nclass User:\n    def run(self):\n"
        "        threading.Thread(target=self.work, name='w').start()\n"
        "    def work(self):\n        raise KeyError('x')\n"
    )
    failed = []
    kernel = VirtualKernel()
    instance = RunningInstance(kernel, "user", Allocation(priority=0))
    program = load_program(Loader(virtual_modules(kernel, 1)), "user", path, "User")
    start(instance, program, {}, kernel.root, lambda *failure: failed.append(failure))
    kernel.run(S)
    assert str(failed[0][1]) == "user: thread w raised KeyError: 'x' (user.py:6)"
