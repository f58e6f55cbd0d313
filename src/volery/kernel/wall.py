"""Wall-clock time: a task is a thread, one monitor guards the framework, one hub executes its callbacks.

``run`` is the hub in the thread that calls it; ``start`` gives the hub a thread of its own, so that a script
can be a task (``adopt``). Computing takes the time that it takes: pending execution time is dropped. The time
of a ``FollowingKernel`` is set from outside, by ``/clock`` of a real ROS graph.
"""

from __future__ import annotations

import threading
from collections import deque
from contextlib import contextmanager
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from time import monotonic_ns
from typing import TYPE_CHECKING

from volery.base.errors import UsageError
from volery.base.time import Ns, to_seconds
from volery.kernel.api import PeriodicAction
from volery.kernel.auto_reset_event import AutoResetEvent
from volery.kernel.interrupts import LONGEST_WAIT_S, Interrupts
from volery.kernel.task import MAX_SWALLOWED_CANCELLATIONS, Cancelled, ExecutionContext, Scope, Task
from volery.trace.events import Record, ignore

if TYPE_CHECKING:
    from collections.abc import Iterator
    from contextlib import AbstractContextManager

    from volery.kernel.api import Action

FOREVER: Ns = 2**63 - 1
GRACE_S = 2.0


class WallEntry:
    """A framework callback in the heap."""

    __slots__ = ("action",)

    def __init__(self, action: Action) -> None:
        self.action: Action | None = action

    def cancel(self) -> None:
        """Do not execute the action (any more)."""
        self.action = None


@dataclass(eq=False, slots=True)
class TaskThread:
    """The thread of a task."""

    woken: threading.Condition
    thread: threading.Thread | None = None  # None for the flow of a script


class WallKernel:
    """Kernel whose time passes by itself, `speed` times as fast as wall time."""

    def __init__(self, record: Record = ignore, speed: float = 1.0) -> None:
        if speed <= 0.0:
            raise UsageError(f"a speed of {speed}; it must be above 0")
        self.record = record
        self.root = Scope("run")
        self._monitor = threading.RLock()
        self.guard: AbstractContextManager[object] = self._monitor
        self._speed = speed
        self._began: int | None = None
        self._gone = threading.Condition(self._monitor)  # a task has ended or will never end
        self._heap: list[tuple[Ns, int, WallEntry]] = []
        self._tickets = count(1)
        self._inbox: deque[Action] = deque()
        self._wake_up = AutoResetEvent()  # wakes the hub
        self._local = threading.local()
        self._adopted: Task | None = None
        self._fault: BaseException | None = None
        self._hub: threading.Thread | None = None
        self._stopping = False
        self._interrupts = Interrupts(self)

    # -- without blocking

    def now(self) -> Ns:
        """Return the time since the start of the run, ns; 0 before it."""
        if self._began is None:
            return 0
        return int((monotonic_ns() - self._began) * self._speed)

    def current(self) -> Task | None:
        """Return the running task; None in a framework callback."""
        task: Task | None = getattr(self._local, "task", None)
        return task

    def call_at(self, when: Ns, action: Action) -> WallEntry:
        """Execute a framework callback at `when`, ns, or as soon as possible if that is past."""
        entry = WallEntry(action)
        with self._monitor:
            heappush(self._heap, (when, next(self._tickets), entry))
            if self._heap[0][2] is entry:
                self._wake_up.set()
        return entry

    def every(self, period: Ns, action: Action) -> PeriodicAction:
        """Execute a framework callback now and then every `period` ns."""
        return PeriodicAction(self, period, action)

    def post(self, action: Action) -> None:
        """Execute a framework callback as soon as possible; from any thread, and from signal handlers."""
        self._inbox.append(action)
        self._wake_up.set()

    def spawn(self, body: Action, name: str, context: ExecutionContext, scope: Scope | None = None) -> Task:
        """Start a task; before the run has begun, the task waits for that."""
        with self._monitor:
            task = Task(name, context, scope or self.root)
            thread = threading.Thread(
                target=self._live, args=(task, body, self.now()), name=name, daemon=True
            )
            task.flow = TaskThread(threading.Condition(self._monitor), thread)
            if self._began is not None:
                thread.start()
        return task

    def _live(self, task: Task, body: Action, spawned: Ns) -> None:
        self._local.task = task
        try:
            with self.interact():
                task.release(spawned)
            body()
            with self.interact():
                activation = task.finish(self.now())
                if activation is not None:
                    self.record(activation)
        except Cancelled:
            pass
        except BaseException as error:
            self._fail(error)
        finally:
            self._bury(task)

    def _bury(self, task: Task) -> None:
        with self._monitor:
            task.done = True
            task.scope.tasks.remove(task)
            self._wake_up.set()
            self._gone.notify_all()

    def _fail(self, error: BaseException) -> None:
        """Keep an exception for ``run``, or deliver it to the script that is adopted."""
        with self._monitor:
            if self._adopted is not None:
                self._adopted.pending_cancellation = self._adopted.pending_cancellation or error
                self.wake(self._adopted)
            else:
                self._fault = self._fault or error
                self._wake_up.set()

    def _raise_fault(self) -> None:
        fault, self._fault = self._fault, None
        if fault is not None:
            raise fault

    # -- interaction points

    def interact(self) -> AbstractContextManager[object]:
        """Raise ``Cancelled`` if the current task is cancelled; return the monitor, which is not held yet."""
        task = self.current()
        if task is not None:
            with self._monitor:
                task.take_pending()
                if task.pending_cancellation is not None:
                    self._cancel_task(task)
        return self._monitor

    def consume(self, amount: Ns) -> bool:
        """Return whether there is a current task; the computing itself has taken its time already."""
        self.interact()
        return self.current() is not None

    def sleep_until(self, when: Ns) -> None:
        """Block the current task until `when`, ns."""
        with self.interact():
            if when > self.now():
                self.park(when, "time")

    def park(self, deadline: Ns | None = None, waiting_for: str = "") -> bool:
        """Block the current task until it is woken (True) or `deadline`, ns, has passed (False)."""
        task = self.current()
        if task is None:
            raise UsageError(f"a framework callback must not block, but waits for {waiting_for}")
        with self._monitor:
            self.interact()  # a cancellation may have come since the last one, and it wakes only once
            task.woken = False
            task.waiting_for = waiting_for
            while not task.woken and (deadline is None or self.now() < deadline):
                task.flow.woken.wait(self._patience(task, deadline))
            if task.pending_cancellation is not None:
                self._cancel_task(task)
            return task.woken

    def _patience(self, task: Task, deadline: Ns | None) -> float | None:
        """Return how long `task` may wait without a break, s of wall time; None for no limit."""
        if deadline is None:
            return LONGEST_WAIT_S if task.adopted else None
        left = self._wall_seconds(deadline)
        return min(left, LONGEST_WAIT_S) if task.adopted else left

    def _wall_seconds(self, until: Ns) -> float:
        return min(to_seconds(until - self.now()) / self._speed, threading.TIMEOUT_MAX)

    def wake(self, task: Task) -> None:
        """End the wait that `task` is in."""
        with self._monitor:
            task.woken = True
            task.flow.woken.notify()

    def cancel(self, scope: Scope, why: str) -> None:
        """Deliver ``Cancelled`` to every task of `scope` at its next interaction point."""
        with self._monitor:
            scope.mark(why)
            for task in scope.all_tasks():
                self.wake(task)
            self._wake_up.set()

    def _cancel_task(self, task: Task) -> None:
        task.deliver_cancellation()
        self._gone.notify_all()
        while True:  # it has swallowed too many cancellations: this interaction point never returns
            task.flow.woken.wait()

    # -- the hub

    def run(self, until: Ns) -> None:
        """Execute events up to `until`, ns, until the root scope is cancelled, or until nothing is left.

        Any exception of a framework callback or of a task's body is raised here, Ctrl-C included; ``run`` may
        be called again after it.
        """
        if self.current() is not None:
            raise UsageError("run() from inside a task: time runs by itself")
        self._stop()
        self._begin()
        self._local.runs = True
        try:
            with self._interrupts:
                while self._step(until):
                    pass
        finally:
            self._local.runs = False

    def _step(self, until: Ns) -> bool:
        """Execute one due event, or wait for one; return False if there will be none."""
        with self._monitor:
            self._raise_fault()
            if self.root.cancelled:
                return False
            if self._do_next(until):
                return True
            if self.now() >= until or not (self._heap or any(self.root.all_tasks())):
                return False
            due = min(until, self._heap[0][0]) if self._heap else until
        self._wait(due)
        return True

    def _do_next(self, until: Ns) -> bool:
        heap = self._heap
        if self._inbox:
            self._inbox.popleft()()
            return True
        while heap and heap[0][2].action is None:
            heappop(heap)
        if not heap or heap[0][0] > min(until, self.now()):
            return False
        action = heappop(heap)[2].action
        if action is not None:
            action()
        return True

    def _wait(self, due: Ns) -> None:
        self._wake_up.wait(min(self._wall_seconds(due), LONGEST_WAIT_S))

    def _begin(self) -> None:
        with self._monitor:
            if self._began is None:
                self._began = monotonic_ns()
                for task in self.root.all_tasks():
                    if task.flow.thread is not None:
                        task.flow.thread.start()

    # -- a hub of its own, for scripts

    def start(self) -> None:
        """Execute events in a thread of the kernel's own, until ``run`` or ``close``."""
        if self._hub is None:
            self._begin()
            self._stopping = False
            self._hub = threading.Thread(target=self._serve, name="hub", daemon=True)
            self._hub.start()

    def _stop(self) -> None:
        if self._hub is not None:
            self._stopping = True
            self._wake_up.set()
            self._hub.join()
            self._hub = None

    def _serve(self) -> None:
        while not self._stopping:
            try:
                with self._monitor:
                    if self._do_next(FOREVER):
                        continue
                    due = self._heap[0][0] if self._heap else FOREVER
            except BaseException as error:
                self._fail(error)
            else:
                self._wait(due)

    @contextmanager
    def adopt(self, name: str) -> Iterator[Task]:
        """Make the calling flow a task; the hub gets a thread of its own.

        The cancellation of its scope ends the context silently, as it ends any task.
        """
        current = self.current()
        if current is not None:
            raise UsageError(f"adopt({name!r}): this flow is the task {current.name!r} already")
        task = Task(name, ExecutionContext(name), self.root)
        task.adopted = True
        task.flow = TaskThread(threading.Condition(self._monitor))
        self.start()
        self._local.task = self._adopted = task
        try:
            with self._interrupts:
                yield task
        except Cancelled:
            pass
        finally:
            self._local.task = self._adopted = None
            self._bury(task)

    @contextmanager
    def joined(self) -> Iterator[None]:
        """Make the calling thread a task, unless it is one, until the context ends.

        Raises:
            UsageError: In a framework callback; or the kernel is closed meanwhile.
        """
        if self.current() is not None:
            yield
            return
        if threading.current_thread() is self._hub or getattr(self._local, "runs", False):
            raise UsageError("a framework callback must not wait")
        name = threading.current_thread().name
        with self._monitor:
            task = Task(name, ExecutionContext(name), self.root)
            task.flow = TaskThread(threading.Condition(self._monitor))
        self._local.task = task
        try:
            yield
        except Cancelled as cancelled:
            raise UsageError(f"{name}: the connection was closed meanwhile: {cancelled}") from None
        finally:
            self._local.task = None
            self._bury(task)

    # -- the end

    def _is_unwound(self) -> bool:
        return all(task.swallowed > MAX_SWALLOWED_CANCELLATIONS for task in self.root.all_tasks())

    def close(self, why: str = "end of run", grace_s: float = GRACE_S) -> list[str]:
        """Cancel and unwind every task; return the names of those that did not end within `grace_s` s in all.

        An exception of a task that is unwound is raised when all have been unwound.
        """
        if self.current() is not None:
            raise UsageError("close() from inside a task: leave it first")
        self.cancel(self.root, why)
        with self._monitor:
            if self._began is None:
                for task in list(self.root.all_tasks()):
                    self._bury(task)
            self._gone.wait_for(self._is_unwound, grace_s)
        self._stop()
        self._raise_fault()
        return [task.name for task in self.root.all_tasks()]


class FollowingKernel(WallKernel):
    """Kernel on threads whose time passes by ``advance`` only.

    A wait until a given time lasts until that time has been announced, however long that takes in wall time.
    """

    def __init__(self, record: Record = ignore) -> None:
        super().__init__(record)
        self._now: Ns = 0

    def now(self) -> Ns:
        """Return the sum of all advances, ns."""
        return self._now

    def advance(self, by: Ns) -> None:
        """Let `by` ns pass, from any thread, and execute what has become due."""
        with self._monitor:
            self._now += max(0, by)
            for task in self.root.all_tasks():
                task.flow.woken.notify()  # it checks itself whether its deadline has passed
            self._wake_up.set()

    def _wall_seconds(self, until: Ns) -> float:
        return 0.0 if until <= self._now else LONGEST_WAIT_S
