"""Virtual time: a task is a greenlet, and what is to happen lies in one heap ordered by (time, ticket).

The *hub* is a greenlet of its own that takes from the heap: house code runs there, and from there tasks are
started. A task that blocks hands over to the next task directly where it can (``_yield``), and where nobody
else would notice it does not even hand over (``leap``). A ticket is drawn for every entry; an entry is void
as soon as its target bears another ticket.
"""

from __future__ import annotations

from collections import deque
from contextlib import contextmanager, nullcontext, suppress
from heapq import heappop, heappush
from itertools import count
from queue import Empty, SimpleQueue
from time import monotonic_ns
from typing import TYPE_CHECKING, Any, Self

from greenlet import GreenletExit, getcurrent, greenlet

from volery.base.errors import Deadlock, UsageError
from volery.base.time import Ns, to_seconds
from volery.kernel.interrupt import Interrupts
from volery.kernel.task import STUBBORN, Cancelled, Place, Scope, Task
from volery.kernel.timer import Every
from volery.trace.events import Record, ignore

if TYPE_CHECKING:
    from collections.abc import Iterator
    from contextlib import AbstractContextManager
    from types import TracebackType

    from volery.kernel.api import Action

FOREVER: Ns = 2**63 - 1
NEVER: Ns = -1
VOID = 0
LONGEST_WAIT_S = 3600.0


class Entry:
    """House code in the heap."""

    __slots__ = ("action", "ticket")

    def __init__(self, action: Action, ticket: int) -> None:
        self.action, self.ticket = action, ticket

    def cancel(self) -> None:
        """Make it void."""
        self.ticket = VOID


class VirtualKernel:
    """Time that passes as fast as there is nothing to do, or *pace* times as fast as the clock on the wall.

    With a *pace* the kernel waits for what other threads ``post`` even when nothing else is left to happen.
    """

    def __init__(self, record: Record = ignore, pace: float | None = None) -> None:
        if pace is not None and pace <= 0.0:
            raise UsageError(f"a pace of {pace}: give seconds per second on the wall, above 0")
        self.record = record
        self.root = Scope("run")
        self.guard: AbstractContextManager[object] = nullcontext()
        self.events = 0
        self._now: Ns = 0
        self._until: Ns = 0
        self._horizon: Ns = NEVER  # up to here tasks may hand over without the hub
        self._heap: list[tuple[Ns, int, Any]] = []
        self._tickets = count(1)
        self._current: Task | None = None
        self._adopted: Task | None = None
        self._inbox: deque[Action] = deque()
        self._bell: SimpleQueue[None] = SimpleQueue()
        self._pace = pace
        self._anchor: tuple[int, Ns] | None = None  # (on the wall, in virtual time): where pacing began
        self._hub: Any = None
        self._owner: Any = None  # the flow that is told how the hub ended
        self._interrupts = Interrupts(self)

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

    def every(self, period: Ns, action: Action) -> Every:
        """Run house code now and then each *period*."""
        return Every(self, period, action)

    def post(self, action: Action) -> None:
        """Run house code as soon as possible; from any thread, and from signal handlers."""
        self._inbox.append(action)
        self._horizon = NEVER
        if self._pace:
            self._bell.put(None)

    def spawn(self, body: Action, name: str, place: Place, scope: Scope | None = None) -> Task:
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
            if not task.scope.cancelled:
                task.release(self._now)
                body()
                with self:  # the last computing is paid as well
                    activation = task.finish(self._now)
                    if activation is not None:
                        self.record(activation)
        except Cancelled:
            pass
        except KeyboardInterrupt:
            if not self._interrupts.pending:
                raise
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
            if task.scope.cancelled:
                self._end(task)
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

    def pay(self, amount: Ns) -> None:
        """Block the current task until its processor has served *amount*."""
        task = self._current
        if task is None or not amount:
            return
        if task.scope.cancelled:
            self._end(task)
        processor = task.places[-1].processor
        if processor is not None:
            processor.serve(task, amount)

    def sleep_until(self, when: Ns) -> None:
        """Pay, then block the current task until *when*."""
        task = self._current
        if task is None:
            raise _house_blocks("sleep")
        if task.debt or task.places[-1].meter is not None or task.scope.cancelled:
            self.__enter__()
        if when <= self._now or self.leap(when):
            return
        task.woken = False
        task.waiting_for = "time"
        task.ticket = next(self._tickets)
        heappush(self._heap, (when, task.ticket, task))
        self._yield(task)
        if task.scope.cancelled:
            self._end(task)

    def leap(self, to: Ns) -> bool:
        """Advance to *to* without blocking anybody, if nothing else is to happen until then."""
        if to > self._horizon or (self._heap and self._heap[0][0] <= to):
            return False
        self._now = to
        self.events += 1
        return True

    def park(self, deadline: Ns | None = None, waiting_for: str = "") -> bool:
        """Block the current task until it is woken (True) or *deadline* has passed (False)."""
        task = self._current
        if task is None:
            raise _house_blocks(waiting_for)
        if task.scope.cancelled:
            self._end(task)
        task.woken = False
        task.waiting_for = waiting_for
        task.ticket = next(self._tickets)
        if deadline is not None:
            heappush(self._heap, (max(deadline, self._now), task.ticket, task))
        self._yield(task)
        if task.scope.cancelled:
            self._end(task)
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
        self._horizon = NEVER  # the hub looks whether the run has ended
        for task in scope.all_tasks():
            self.wake(task)

    def _end(self, task: Task) -> None:
        task.refusals += 1
        if task.refusals <= STUBBORN or task.adopted:
            raise Cancelled(task.scope.cancelled)
        while True:  # it swallows its end: this interaction point never returns
            task.ticket = VOID
            self._hub_runs()

    # -- handing over

    def _yield(self, task: Task) -> None:
        """To whoever is next: directly if that is a task, through the hub if it is house code."""
        heap = self._heap
        if heap and heap[0][0] <= self._horizon:
            when, ticket, target = heap[0]
            if type(target) is Task and target.ticket == ticket:
                heappop(heap)
                self._now = when
                self.events += 1
                if target is not task:
                    self._current = target
                    target.flow.switch()
                return
        self._hub_runs()

    def _hub_runs(self) -> None:
        if self._hub is None:
            self._hub = greenlet(self._serve)
        self._hub.switch()

    def _resume(self, task: Task) -> None:
        self._current = task
        task.flow.switch()

    # -- the hub

    def run(self, until: Ns) -> None:
        """Let things happen up to and including *until*, or until the root scope is cancelled.

        If nothing at all is left to happen it returns at once, at the time of the last event. Whatever
        escapes from house code or from the body of a task is raised here, Ctrl-C included; ``run`` may be
        called again after that.

        Raises:
            Deadlock: nothing is left to happen while tasks still wait.
        """
        if self._current is not None or self._adopted is not None:
            raise UsageError("run() from inside a task: time runs by itself while the task blocks")
        self._until = until
        self._owner = getcurrent()
        with self._interrupts:
            self._hub_runs()

    def _serve(self) -> None:
        while True:
            error = self._loop_until_error()
            self._horizon = NEVER
            self._anchor = None
            self._current = self._adopted
            if error is None:
                self._owner.switch()
            else:
                self._owner.throw(type(error), error, error.__traceback__)

    def _loop_until_error(self) -> BaseException | None:
        try:
            self._loop()
        except GreenletExit:
            raise
        except BaseException as error:
            return error
        return None

    def _loop(self) -> None:
        heap, inbox = self._heap, self._inbox
        while True:
            self._current = None
            self._horizon = NEVER if self._pace else self._until
            while inbox:
                inbox.popleft()()
            if self.root.cancelled and self._adopted is None:
                return
            when = heap[0][0] if heap else FOREVER
            if self._pace and self._waits_for(min(when, self._until)):
                continue
            if not heap or when > self._until:
                self._come_to_rest()
                return
            _, ticket, target = heappop(heap)
            if target.ticket == ticket:
                self._now = when
                self.events += 1
                if type(target) is Task:
                    self._resume(target)
                else:
                    target.action()

    def _come_to_rest(self) -> None:
        heap = self._heap
        while heap and heap[0][2].ticket != heap[0][1]:
            heappop(heap)
        if heap or self._pace:
            self._now = max(self._now, self._until)
            return
        waiting = [f"{task.name} for {task.waiting_for}" for task in self.root.all_tasks()]
        if waiting:
            raise Deadlock("nothing can happen any more; waiting: " + "; ".join(waiting))

    def _waits_for(self, when: Ns) -> bool:
        """False if *when* has come on the wall; else True after a wait, in which things may have changed."""
        assert self._pace is not None
        if self._anchor is None:
            self._anchor = (monotonic_ns(), self._now)
        wall, virtual = self._anchor
        ahead = to_seconds(when - virtual) / self._pace - to_seconds(monotonic_ns() - wall)
        if ahead <= 0.0:
            return False
        with suppress(Empty):
            self._bell.get(timeout=min(ahead, LONGEST_WAIT_S))
        passed = int((monotonic_ns() - wall) * self._pace)
        self._now = max(self._now, min(virtual + passed, when))
        return True

    # -- scripts

    @contextmanager
    def adopt(self, name: str) -> Iterator[Task]:
        """Make the calling flow a task. Virtual time runs while it blocks, else it stands still.

        The end of its scope ends the context quietly, as it ends any task.
        """
        if self._current is not None:
            raise UsageError(f"adopt({name!r}): this flow is the task {self._current.name!r} already")
        task = Task(name, Place(name), self.root)
        task.adopted = True
        task.flow = self._owner = getcurrent()
        self._until = FOREVER
        self._adopted = self._current = task
        try:
            with self._interrupts:
                yield task
        except Cancelled:
            pass
        finally:
            self._adopted = self._current = None
            self._horizon = NEVER
            self._bury(task)

    # -- the end

    def close(self, why: str = "end of run") -> list[str]:
        """Unwind every task; returns the names of those that would not go."""
        if self._current is not None:
            raise UsageError("close() from inside a task: leave it first")
        self.cancel(self.root, why)
        hub, self._hub = self._hub, getcurrent()
        for task in list(self.root.all_tasks()):
            if task.flow is None:
                self._bury(task)
            else:
                task.flow.parent = self._hub
                self._resume(task)
        self._current = None
        if hub is not None:
            hub.parent = getcurrent()
            hub.throw()
        return [task.name for task in self.root.all_tasks()]


def _house_blocks(waiting_for: str) -> UsageError:
    return UsageError(f"house code must not block, but waits for {waiting_for}")
