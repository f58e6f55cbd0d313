"""Virtual time: a task is a greenlet, and what is to happen lies in one heap ordered by (time, ticket).

The *hub* is a greenlet of its own that takes from the heap: house code runs there, and from there tasks are
started. A task that blocks hands over directly to a task that is next (``_yield``), and does not even do that
where nobody would notice (``leap``). A ticket is drawn for every entry; an entry is void once its target
bears another.

Keeps virtual time from running ahead of the clock on the wall.
"""

from __future__ import annotations

from collections import deque
from contextlib import contextmanager, nullcontext, suppress
from heapq import heappop, heappush, heapreplace
from itertools import count
from queue import Empty, SimpleQueue
from time import monotonic_ns
from typing import TYPE_CHECKING, Any, Self

from greenlet import GreenletExit, getcurrent, greenlet

from volery.base.errors import Deadlock, UsageError
from volery.base.time import Ns, to_seconds
from volery.kernel.api import PeriodicAction
from volery.kernel.interrupts import LONGEST_WAIT_S, Interrupts, Watchdog
from volery.kernel.task import Cancelled, ExecutionContext, Scope, Task
from volery.trace.events import Record, ignore

if TYPE_CHECKING:
    from collections.abc import Iterator
    from contextlib import AbstractContextManager
    from types import TracebackType

    from volery.base.time import Ns
    from volery.kernel.api import Action


class Pacer:
    """Lets *pace* seconds pass in one second on the wall, at most: time that was lost is not made good."""

    def __init__(self, pace: float) -> None:
        if pace <= 0.0:
            raise UsageError(f"a pace of {pace}: give seconds per second on the wall, above 0")
        self._pace = pace
        self._anchor: tuple[int, Ns] | None = None  # a moment on the wall and in virtual time
        self._bell: SimpleQueue[None] = (
            SimpleQueue()
        )  # unlike an Event's, its ring is safe in a signal handler

    def rest(self) -> None:
        """Virtual time stands still until the next ``wait``."""
        self._anchor = None

    def ring(self) -> None:
        """End the wait that is under way, or else the next; from any thread."""
        self._bell.put(None)

    def wait(self, now: Ns, when: Ns) -> Ns | None:
        """``None`` if *when* has come; else what time it is after a wait, which may have been cut short."""
        if self._anchor is None:
            self._anchor = (monotonic_ns(), now)
        wall, virtual = self._anchor
        ahead = to_seconds(when - virtual) / self._pace - to_seconds(monotonic_ns() - wall)
        if ahead <= 0.0:
            return None
        with suppress(Empty):
            self._bell.get(timeout=min(ahead, LONGEST_WAIT_S))
        passed = int((monotonic_ns() - wall) * self._pace)
        return max(now, min(virtual + passed, when))


FOREVER: Ns = 2**63 - 1
NEVER: Ns = -1
VOID = 0


class Entry:
    """House code in the heap."""

    __slots__ = ("action", "ticket")

    def __init__(self, action: Action, ticket: int) -> None:
        self.action, self.ticket = action, ticket

    def cancel(self) -> None:
        """Make it void."""
        self.ticket = VOID


def _nothing() -> None:
    """What happens at the end of time."""


class VirtualKernel:
    """Time that passes as fast as there is nothing to do; with a *pace*, at most that many seconds a second.

    A kernel with a pace also serves other threads: it waits for what they ``post`` when nothing else is left
    to happen. With *watchdog_s*, a task that runs that long on the wall while virtual time stands gets a
    ``ComponentError`` that names its component and line; this needs the main thread.

    A kernel belongs to the thread that first runs it.
    """

    def __init__(
        self, record: Record = ignore, pace: float | None = None, watchdog_s: float | None = None
    ) -> None:
        self.record = record
        self.root = Scope("run")
        self.guard: AbstractContextManager[object] = nullcontext()
        self._now: Ns = 0
        self._until: Ns = 0
        self._horizon: Ns = NEVER  # up to here tasks may hand over without the hub
        self._heap: list[tuple[Ns, int, Any]] = [(FOREVER + 1, VOID, Entry(_nothing, VOID))]  # never empty
        self._tickets = count(1)
        self._current: Task | None = None
        self._adopted: Task | None = None
        self._inbox: deque[Action] = deque()
        self._pacer = None if pace is None else Pacer(pace)
        self._hub: Any = None
        self._owner: Any = None  # the flow that is told how the hub ended
        self._interrupts = Interrupts(self)
        self._watchdog = None if watchdog_s is None else Watchdog(self, self._interrupts, watchdog_s)

    # -- what is asked without blocking

    def now(self) -> Ns:
        """Nanoseconds since the start of the run."""
        return self._now

    def current(self) -> Task | None:
        """The task that runs now; ``None`` in house code."""
        return self._current

    def call_at(self, when: Ns, action: Action) -> Entry:
        """Run house code at *when*, or now if that is past."""
        ticket = next(self._tickets)
        entry = Entry(action, ticket)
        heappush(self._heap, (when if when > self._now else self._now, ticket, entry))
        return entry

    def every(self, period: Ns, action: Action) -> PeriodicAction:
        """Run house code now and then each *period*."""
        return PeriodicAction(self, period, action)

    def post(self, action: Action) -> None:
        """Run house code as soon as possible; from any thread, and from signal handlers."""
        self._inbox.append(action)
        self._horizon = NEVER
        if self._pacer is not None:
            self._pacer.ring()

    def spawn(self, body: Action, name: str, place: ExecutionContext, scope: Scope | None = None) -> Task:
        """Start a flow of control; it begins at this instant, after what is already due."""
        task = Task(name, place, scope or self.root)
        task.woken = True  # nothing to wake before it has begun

        def begin() -> None:
            if not task.done:
                task.flow = greenlet(lambda: self._live(task, body), self._hub)
                self._resume(task)

        self.call_at(self._now, begin)
        return task

    def _live(self, task: Task, body: Action) -> None:
        try:
            if task.summons is None:
                task.release(self._now)
                body()
                with self:  # the last computing is paid as well
                    activation = task.finish(self._now)
                    if activation is not None:
                        self.record(activation)
        except Cancelled:
            pass
        finally:
            self._bury(task)

    def _bury(self, task: Task) -> None:
        task.done = True
        task.ticket = VOID
        task.scope.tasks.remove(task)

    # -- interaction points

    def __enter__(self) -> Self:
        task = self._current
        if task is not None:
            if task.summons is not None:
                self._answer(task)
            amount = task.take_debt()
            if amount:
                processor = task.places[-1].processor
                if processor is not None:
                    processor.serve(task, amount)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        pass

    def _answer(self, task: Task) -> None:
        task.answer()
        while True:  # it swallows its end: this interaction point never returns
            task.ticket = VOID
            self._hub_runs()

    def pay(self, amount: Ns) -> None:
        """Block the current task until its processor has served *amount*."""
        task = self._current
        if task is not None:
            task.debt += amount
            self.__enter__()

    def sleep_until(self, when: Ns) -> None:
        """Pay, then block the current task until *when*. The hot path: leap, park and yield, written out."""
        task = self._current
        if task is None:
            raise _house_blocks("a time")
        if task.debt or task.summons is not None or task.places[-1].meter is not None:
            self.__enter__()
        if when <= self._now:
            return
        due, due_ticket, target = self._heap[0]
        if when < due and when <= self._horizon:
            self._now = when
            return
        task.woken = False
        task.waiting_for = "a time"
        task.ticket = ticket = next(self._tickets)
        if due <= self._horizon and target.ticket == due_ticket and type(target) is Task:
            heapreplace(self._heap, (when, ticket, task))
            self._now = due
            self._current = target
            target.flow.switch()
        else:
            heappush(self._heap, (when, ticket, task))
            self._hub_runs()
        if task.summons is not None:
            self._answer(task)

    def leap(self, to: Ns) -> bool:
        """Advance to *to* without blocking anybody, if nothing else is to happen until then."""
        if to > self._horizon or self._heap[0][0] <= to:
            return False
        self._now = to
        return True

    def park(self, deadline: Ns | None = None, waiting_for: str = "") -> bool:
        """Block the current task until it is woken (True) or *deadline* has passed (False)."""
        task = self._current
        if task is None:
            raise _house_blocks(waiting_for)
        if task.summons is not None:
            self._answer(task)
        task.woken = False
        task.waiting_for = waiting_for
        task.ticket = next(self._tickets)
        if deadline is not None:
            heappush(self._heap, (max(deadline, self._now), task.ticket, task))
        self._yield(task)
        if task.summons is not None:
            self._answer(task)
        return task.woken

    def wake(self, task: Task) -> None:
        """End the wait that *task* is in."""
        if not task.woken and not task.done and task is not self._current:
            task.woken = True
            task.ticket = next(self._tickets)
            heappush(self._heap, (self._now, task.ticket, task))

    def cancel(self, scope: Scope, why: str) -> None:
        """Deliver ``Cancelled`` to every task of *scope* at its next interaction point."""
        scope.mark(why)
        for task in scope.all_tasks():
            self.wake(task)

    # -- handing over

    def _yield(self, task: Task) -> None:
        """To whoever is next: directly if that is a task, through the hub if it is house code."""
        due, ticket, target = self._heap[0]
        if due <= self._horizon and target.ticket == ticket and type(target) is Task:
            heappop(self._heap)
            self._now = due
            if target is not task:
                self._current = target
                target.flow.switch()
        else:
            self._hub_runs()

    def _hub_runs(self) -> None:
        if self._hub is None:
            self._hub = greenlet(self._serve)
        self._hub.switch()

    def _resume(self, task: Task) -> None:
        self._current = task
        task.flow.switch()
        if self._pacer is not None and task.adopted:
            self._pacer.rest()  # time stood still while the script ran

    # -- the hub

    def run(self, until: Ns) -> None:
        """Let things happen up to and including *until*, or until the root scope is cancelled.

        If nothing at all is left to happen it returns at once, at the time of the last event. Whatever
        escapes from house code or from the body of a task is raised here, Ctrl-C included; ``run`` may be
        called again after that.

        Raises:
            Deadlock: nothing is left to happen while tasks still wait.
        """
        if self._current is not None or (self._hub is not None and self._hub is getcurrent()):
            raise UsageError("run() from inside the run: time passes while a task blocks")
        self._until = min(until, FOREVER)
        self._owner = getcurrent()
        with self._watched():
            self._hub_runs()

    @contextmanager
    def _watched(self) -> Iterator[None]:
        if self._watchdog is not None:
            self._watchdog.start()
        with self._interrupts:
            yield

    def _serve(self) -> None:
        while True:
            error = self._error_of_loop()
            self._horizon = NEVER
            self._current = self._adopted
            if self._pacer is not None:
                self._pacer.rest()
            if error is None:
                self._owner.switch()
            else:
                self._owner.throw(type(error), error, error.__traceback__)

    def _error_of_loop(self) -> BaseException | None:
        try:
            self._loop()
        except GreenletExit:
            raise
        except BaseException as error:
            return error
        return None

    def _loop(self) -> None:
        heap, inbox, pacer = self._heap, self._inbox, self._pacer
        while True:
            self._current = None
            self._horizon = self._until if pacer is None else NEVER
            while inbox:
                inbox.popleft()()
            if self.root.cancelled:
                return
            due = heap[0][0]
            if pacer is not None:
                now = pacer.wait(self._now, min(due, self._until))
                if now is not None:
                    self._now = now
                    continue
            if due > self._until:
                self._come_to_rest()
                return
            _, ticket, target = heappop(heap)
            if target.ticket == ticket:
                self._now = due
                if type(target) is Task:
                    self._resume(target)
                else:
                    target.action()

    def _come_to_rest(self) -> None:
        heap = self._heap
        while heap[0][2].ticket != heap[0][1]:
            heappop(heap)
        if len(heap) > 1 or self._pacer is not None:
            self._now = max(self._now, self._until)
            return
        waiting = [f"{task.name} for {task.waiting_for}" for task in self.root.all_tasks()]
        if waiting:
            raise Deadlock("nothing can happen any more; waiting: " + "; ".join(waiting))

    # -- scripts

    @contextmanager
    def adopt(self, name: str) -> Iterator[Task]:
        """Make the calling flow a task. Virtual time runs while it blocks, else it stands still.

        The end of its scope ends the context quietly, as it ends any task.
        """
        if self._current is not None:
            raise UsageError(f"adopt({name!r}): this flow is the task {self._current.name!r} already")
        task = Task(name, ExecutionContext(name), self.root)
        task.adopted = True
        task.flow = self._owner = getcurrent()
        self._until = FOREVER
        self._adopted = self._current = task
        try:
            with self._watched():
                yield task
        except Cancelled:
            pass
        finally:
            self._adopted = self._current = None
            self._horizon = NEVER
            self._bury(task)

    # -- the end

    def close(self, why: str = "end of run") -> list[str]:
        """Unwind every task; returns the names of those that would not go.

        What escapes from one of them meanwhile is raised when all are unwound.
        """
        if self._current is not None:
            raise UsageError("close() from inside a task: leave it first")
        self.cancel(self.root, why)
        if self._watchdog is not None:
            self._watchdog.stop()
        hub, self._hub = self._hub, getcurrent()
        faults = [self._unwind(task) for task in list(self.root.all_tasks())]
        if hub is not None:
            hub.parent = self._hub
            hub.throw()
        self._hub = self._current = None
        for fault in faults:
            if fault is not None:
                raise fault
        return [task.name for task in self.root.all_tasks()]

    def _unwind(self, task: Task) -> BaseException | None:
        try:
            if task.flow is None:
                self._bury(task)
            else:
                task.flow.parent = self._hub  # where it ends
                self._resume(task)
        except BaseException as fault:
            return fault
        return None


def _house_blocks(waiting_for: str) -> UsageError:
    return UsageError(f"house code must not block, but waits for {waiting_for}")
