"""The clock on the wall: a task is a thread, the house is one monitor, one hub runs all house code.

``run`` is the hub in the thread that calls it; ``start`` gives the hub a thread of its own, so that a script
can be a task (``adopt``). Computing takes the time that it takes: what a task owes is forgotten.

Time that somebody else keeps: it stands still until it is told to go on (``/clock`` of real ROS).
"""

from __future__ import annotations

import threading
from collections import deque
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from queue import Empty, SimpleQueue
from time import monotonic_ns
from typing import TYPE_CHECKING, Self

from volery.base.errors import UsageError
from volery.base.time import Ns, to_seconds
from volery.kernel.api import PeriodicAction
from volery.kernel.interrupts import LONGEST_WAIT_S, Interrupts
from volery.kernel.task import MAX_SWALLOWED_CANCELLATIONS, Cancelled, ExecutionContext, Scope, Task
from volery.trace.events import Record, ignore

if TYPE_CHECKING:
    from collections.abc import Iterator
    from contextlib import AbstractContextManager
    from types import TracebackType

    from volery.kernel.api import Action

FOREVER: Ns = 2**63 - 1
GRACE_S = 2.0


class Entry:
    """House code in the heap."""

    __slots__ = ("action",)

    def __init__(self, action: Action) -> None:
        self.action: Action | None = action

    def cancel(self) -> None:
        """It will not happen (any more)."""
        self.action = None


@dataclass(eq=False, slots=True)
class Flow:
    """What the kernel knows of a task's thread."""

    woken: threading.Condition
    thread: threading.Thread | None = None  # None: it was there before


class WallKernel:
    """Time that passes by itself, *speed* times as fast as on the wall."""

    def __init__(self, record: Record = ignore, speed: float = 1.0) -> None:
        if speed <= 0.0:
            raise UsageError(f"a speed of {speed}; it must be above 0")
        self.record = record
        self.root = Scope("run")
        self._monitor = threading.RLock()
        self.guard: AbstractContextManager[object] = self._monitor
        self._speed = speed
        self._began: int | None = None
        self._gone = threading.Condition(self._monitor)  # a task has ended, or never will
        self._heap: list[tuple[Ns, int, Entry]] = []
        self._tickets = count(1)
        self._inbox: deque[Action] = deque()
        self._bell: SimpleQueue[None] = SimpleQueue()  # wakes the hub; may be rung from a signal handler
        self._local = threading.local()
        self._adopted: Task | None = None
        self._fault: BaseException | None = None
        self._hub: threading.Thread | None = None
        self._stopping = False
        self._interrupts = Interrupts(self)

    # -- what is asked without blocking

    def now(self) -> Ns:
        """Nanoseconds since the start of the run; 0 before it."""
        if self._began is None:
            return 0
        return int((monotonic_ns() - self._began) * self._speed)

    def current(self) -> Task | None:
        """The task that runs now; ``None`` in house code."""
        task: Task | None = getattr(self._local, "task", None)
        return task

    def call_at(self, when: Ns, action: Action) -> Entry:
        """Run house code at *when*, or as soon as possible if that is past."""
        entry = Entry(action)
        with self._monitor:
            heappush(self._heap, (when, next(self._tickets), entry))
            if self._heap[0][2] is entry:
                self._bell.put(None)
        return entry

    def every(self, period: Ns, action: Action) -> PeriodicAction:
        """Run house code now and then each *period*."""
        return PeriodicAction(self, period, action)

    def post(self, action: Action) -> None:
        """Run house code as soon as possible; from any thread, and from signal handlers."""
        self._inbox.append(action)
        self._bell.put(None)

    def spawn(self, body: Action, name: str, place: ExecutionContext, scope: Scope | None = None) -> Task:
        """Start a flow of control; before the run has begun it waits for that."""
        with self._monitor:
            task = Task(name, place, scope or self.root)
            thread = threading.Thread(
                target=self._live, args=(task, body, self.now()), name=name, daemon=True
            )
            task.flow = Flow(threading.Condition(self._monitor), thread)
            if self._began is not None:
                thread.start()
        return task

    def _live(self, task: Task, body: Action, spawned: Ns) -> None:
        self._local.task = task
        try:
            with self:
                task.release(spawned)
            body()
            with self:
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
            self._bell.put(None)
            self._gone.notify_all()

    def _fail(self, error: BaseException) -> None:
        """Remember what run(), or the script that is adopted, is to be told."""
        with self._monitor:
            if self._adopted is not None:
                self._adopted.summons = self._adopted.summons or error
                self.wake(self._adopted)
            else:
                self._fault = self._fault or error
                self._bell.put(None)

    def _raise_fault(self) -> None:
        fault, self._fault = self._fault, None
        if fault is not None:
            raise fault

    # -- interaction points

    def __enter__(self) -> Self:
        self._monitor.acquire()
        task = self.current()
        if task is not None:
            task.take_debt()
            if task.summons is not None:
                try:
                    self._answer(task)
                finally:
                    self._monitor.release()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._monitor.release()

    def pay(self, amount: Ns) -> None:
        """An interaction point; the computing itself has taken its time already."""
        with self:
            pass

    def sleep_until(self, when: Ns) -> None:
        """Block the current task until *when*."""
        with self:
            if when > self.now():
                self.park(when, "time")

    def park(self, deadline: Ns | None = None, waiting_for: str = "") -> bool:
        """Block the current task until it is woken (True) or *deadline* has passed (False)."""
        task = self.current()
        if task is None:
            raise UsageError(f"house code must not block, but waits for {waiting_for}")
        with self:
            task.woken = False
            task.waiting_for = waiting_for
            while not task.woken and (deadline is None or self.now() < deadline):
                task.flow.woken.wait(self._patience(task, deadline))
            if task.summons is not None:
                self._answer(task)
            return task.woken

    def _patience(self, task: Task, deadline: Ns | None) -> float | None:
        """How long *task* may wait at a stretch, in seconds on the wall."""
        if deadline is None:
            return LONGEST_WAIT_S if task.adopted else None
        left = self._wall_seconds(deadline)
        return min(left, LONGEST_WAIT_S) if task.adopted else left

    def _wall_seconds(self, until: Ns) -> float:
        return min(to_seconds(until - self.now()) / self._speed, threading.TIMEOUT_MAX)

    def wake(self, task: Task) -> None:
        """End the wait that *task* is in."""
        with self._monitor:
            task.woken = True
            task.flow.woken.notify()

    def cancel(self, scope: Scope, why: str) -> None:
        """Deliver ``Cancelled`` to every task of *scope* at its next interaction point."""
        with self._monitor:
            scope.mark(why)
            for task in scope.all_tasks():
                self.wake(task)
            self._bell.put(None)

    def _answer(self, task: Task) -> None:
        task.answer()
        self._gone.notify_all()
        while True:  # it swallows its end: this interaction point never returns
            task.flow.woken.wait()

    # -- the hub

    def run(self, until: Ns) -> None:
        """Let things happen up to *until*, or until the root scope is cancelled or nothing is left to do.

        Whatever escapes from house code or from the body of a task is raised here, Ctrl-C included; ``run``
        may be called again after that.
        """
        if self.current() is not None:
            raise UsageError("run() from inside a task: time runs by itself")
        self._stop()
        self._begin()
        with self._interrupts:
            while self._goes_on(until):
                pass

    def _goes_on(self, until: Ns) -> bool:
        """Do one thing that is due, or wait for it; False if there will be none."""
        with self._monitor:
            self._raise_fault()
            if self.root.cancelled:
                return False
            if self._do_next(until):
                return True
            if self.now() >= until or self._is_over():
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

    def _is_over(self) -> bool:
        return not self._heap and not any(self.root.all_tasks())

    def _wait(self, due: Ns) -> None:
        with suppress(Empty):
            self._bell.get(timeout=max(0.0, min(self._wall_seconds(due), LONGEST_WAIT_S)))

    def _begin(self) -> None:
        with self._monitor:
            if self._began is None:
                self._began = monotonic_ns()
                for task in self.root.all_tasks():
                    if task.flow.thread is not None:
                        task.flow.thread.start()

    # -- a hub of its own, for scripts

    def start(self) -> None:
        """Let things happen in a thread of the kernel's own, until ``run`` or ``close``."""
        if self._hub is None:
            self._begin()
            self._stopping = False
            self._hub = threading.Thread(target=self._serve, name="hub", daemon=True)
            self._hub.start()

    def _stop(self) -> None:
        if self._hub is not None:
            self._stopping = True
            self._bell.put(None)
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

        The end of its scope ends the context quietly, as it ends any task.
        """
        current = self.current()
        if current is not None:
            raise UsageError(f"adopt({name!r}): this flow is the task {current.name!r} already")
        task = Task(name, ExecutionContext(name), self.root)
        task.adopted = True
        task.flow = Flow(threading.Condition(self._monitor))
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

    # -- the end

    def _is_unwound(self) -> bool:
        return all(task.refusals > MAX_SWALLOWED_CANCELLATIONS for task in self.root.all_tasks())

    def close(self, why: str = "end of run", grace_s: float = GRACE_S) -> list[str]:
        """Unwind every task; returns the names of those that would not go within *grace_s* in all.

        What escapes from one of them meanwhile is raised when all are unwound.
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
    """A kernel on threads whose time goes on by ``advance`` alone.

    What waits for a time waits until it has been told of it, however long that takes on the wall.
    """

    def __init__(self, record: Record = ignore) -> None:
        super().__init__(record)
        self._now: Ns = 0

    def now(self) -> Ns:
        """The sum of all advances."""
        return self._now

    def advance(self, by: Ns) -> None:
        """Let time pass; from any thread. What has become due happens."""
        with self._monitor:
            self._now += max(0, by)
            for task in self.root.all_tasks():
                task.flow.woken.notify()  # it looks itself whether its time has come
            self._bell.put(None)

    def _wall_seconds(self, until: Ns) -> float:
        return 0.0 if until <= self._now else LONGEST_WAIT_S
