"""Virtual time: a task is a greenlet, and future events lie in one heap of their times.

The hub is a greenlet of its own that takes events from the heap: framework callbacks execute there, and tasks
are started from there. A task that blocks executes the timers that are due next and switches directly to the
task that is due after them; it does not switch at all where no event precedes the end of its wait (``skip``).
Threads that pass a baton were measured to be fifty times slower than greenlets, and generators would make
every blocking call of a component visible in its code.

An event is a number in the heap, its time with its ticket in the lower bits, so that events of one time
happen in the order in which they were made and a comparison is one of numbers. What happens then is found by
that number. It is void once its target has another one, or none.
"""

from __future__ import annotations

import threading
from collections import deque
from contextlib import contextmanager, nullcontext
from functools import partial
from heapq import heappop, heappush, heapreplace
from itertools import count
from time import monotonic_ns
from typing import TYPE_CHECKING, Any

from greenlet import GreenletExit, getcurrent, greenlet

from volery.base.errors import Deadlock, UsageError
from volery.base.time import Ns, to_seconds
from volery.kernel.api import PeriodicAction
from volery.kernel.auto_reset_event import AutoResetEvent
from volery.kernel.interrupts import LONGEST_WAIT_S, Interrupts, Watchdog
from volery.kernel.task import Cancelled, ExecutionContext, Scope, Task
from volery.trace.events import Record, ignore

if TYPE_CHECKING:
    from collections.abc import Iterator
    from contextlib import AbstractContextManager

    from volery.kernel.api import Action

FOREVER: Ns = 2**63 - 1
NEVER: Ns = -1
VOID = 0
"""The event of a target that waits for none."""

TICKET_BITS = 48
"""Bits of an event below its time: a ticket for each microsecond of nine years."""


_UNGUARDED = nullcontext()
"""Held after an interaction point: not the guard, which a task that waits would keep from other threads."""

LATE_S = 0.05
"""How late an event may be, s of wall time, for the later ones to be in time again."""


class Pacer:
    """Limits virtual time to `pace` seconds per second of wall time. Time that was lost is not caught up.

    What talks to the run from outside lives in wall time: a vehicle that rushed after a pause would take
    those who command it for silent.
    """

    def __init__(self, pace: float) -> None:
        if pace <= 0.0:
            raise UsageError(f"a pace of {pace}: give seconds per second on the wall, above 0")
        self.pace = pace
        self._anchor: tuple[int, Ns] | None = None  # one instant in wall time and in virtual time
        self._wake_up = AutoResetEvent()

    def rest(self) -> None:
        """Stop virtual time until the next ``wait``."""
        self._anchor = None

    def wake_up(self) -> None:
        """End the wait in progress, or else the next one; from any thread."""
        self._wake_up.set()

    def wait(self, now: Ns, when: Ns) -> Ns | None:
        """Wait for `when`, ns; return None if it has come, else the time after a wait, perhaps short."""
        if self._anchor is None:
            self._anchor = (monotonic_ns(), now)
        wall, virtual = self._anchor
        ahead = to_seconds(when - virtual) / self.pace - to_seconds(monotonic_ns() - wall)
        if ahead <= 0.0:
            if ahead < -LATE_S:
                self._anchor = (monotonic_ns(), when)
            return None
        self._wake_up.wait(min(ahead, LONGEST_WAIT_S))
        passed = int((monotonic_ns() - wall) * self.pace)
        return max(now, min(virtual + passed, when))


class Entry:
    """A framework callback in the heap."""

    __slots__ = ("action", "event")

    def __init__(self, action: Action, event: int = VOID) -> None:
        self.action, self.event = action, event

    def cancel(self) -> None:
        """Make the entry void."""
        self.event = VOID


class ResettableTimer(Entry):
    """A framework callback that its owner sets and cancels again and again, of which one time is in force.

    It executes in the task that blocks, if there is one, which saves two switches.
    """


def _raise(error: BaseException) -> None:
    raise error


def _end_of_time() -> None:
    """Do nothing; the action of the entry that is never reached."""


class VirtualKernel:
    """Kernel whose time passes as fast as its events are processed, in the thread that first runs it.

    Args:
        record: Receives the events of the run.
        pace: Greatest number of virtual seconds per second of wall time. A kernel with a pace also waits
            for ``post`` of other threads when no event is left.
        watchdog_s: Wall time, s, after which a task that does not block gets a ``ComponentError`` naming its
            component and line; needs the main thread.
    """

    def __init__(
        self, record: Record = ignore, pace: float | None = None, watchdog_s: float | None = None
    ) -> None:
        self.record = record
        self.root = Scope("run")
        self.guard: AbstractContextManager[object] = threading.RLock()  # cheaper than nullcontext()
        self._now: Ns = 0
        self._until: Ns = 0
        self._horizon = VOID  # tasks may switch without the hub to events below it
        end = FOREVER + 1 << TICKET_BITS
        self._heap = [end]
        self._targets: dict[int, Task | Entry] = {end: Entry(_end_of_time, end)}
        self._tickets = count(1)
        self._current: Task | None = None
        self._adopted: Task | None = None
        self._inbox: deque[Action] = deque()
        self.pacer = None if pace is None else Pacer(pace)
        self._hub: Any = None
        self._owner: Any = None  # the flow that the hub returns to
        self._interrupts = Interrupts(self)
        self._watchdog = None if watchdog_s is None else Watchdog(self, self._interrupts, watchdog_s)

    # -- without blocking

    @property
    def pace(self) -> float | None:
        """Greatest number of virtual seconds per second of wall time; it may be set while no time passes."""
        return None if self.pacer is None else self.pacer.pace

    @pace.setter
    def pace(self, pace: float | None) -> None:
        self.pacer = None if pace is None else Pacer(pace)

    def now(self) -> Ns:
        """Return the time since the start of the run, ns."""
        return self._now

    def current(self) -> Task | None:
        """Return the running task; None in a framework callback."""
        return self._current

    def call_at(self, when: Ns, action: Action) -> Entry:
        """Execute a framework callback at `when`, ns, or now if that is past."""
        entry = Entry(action)
        self._schedule(entry, when)
        return entry

    def set_timer(self, timer: ResettableTimer, when: Ns) -> None:
        """Let a timer execute at `when`, ns, or now if that is past, and at no other time."""
        self._schedule(timer, when)

    def _schedule(self, target: Task | Entry, when: Ns) -> None:
        event = ((when if when > self._now else self._now) << TICKET_BITS) + next(self._tickets)
        target.event = event
        self._targets[event] = target
        heappush(self._heap, event)

    def every(self, period: Ns, action: Action) -> PeriodicAction:
        """Execute a framework callback now and then every `period` ns."""
        return PeriodicAction(self, period, action)

    def post(self, action: Action) -> None:
        """Execute a framework callback as soon as possible; from any thread, and from signal handlers."""
        self._inbox.append(action)
        self._horizon = VOID
        if self.pacer is not None:
            self.pacer.wake_up()

    def spawn(self, body: Action, name: str, context: ExecutionContext, scope: Scope | None = None) -> Task:
        """Start a task at this instant, after what is already due."""
        task = Task(name, context, scope or self.root)
        task.woken = True  # it cannot be woken before it has begun
        self.call_at(self._now, partial(self._begin, task, body))
        return task

    def _begin(self, task: Task, body: Action) -> None:
        # in the hub: begun by another task, a greenlet would inherit that task's depth of recursion
        if not task.done:
            task.flow = greenlet(partial(self._live, task, body), self._hub)
            self._resume(task)

    def _live(self, task: Task, body: Action) -> None:
        try:
            if task.pending_cancellation is None:
                task.release(self._now)
                body()
                self.interact()  # spends the execution time of the last activation
                activation = task.finish(self._now)
                if activation is not None:
                    self.record(activation)
        except Cancelled:
            pass
        finally:
            self._bury(task)

    def _bury(self, task: Task) -> None:
        task.done = True
        task.event = VOID
        task.scope.tasks.remove(task)

    # -- interaction points

    def interact(self) -> AbstractContextManager[object]:
        """Spend the pending execution time of the current task, or raise ``Cancelled``."""
        task = self._current
        if task is not None and (
            task.pending_ns or task.pending_cancellation is not None or task.meter is not None
        ):
            self._interact(task)
        return _UNGUARDED

    def _interact(self, task: Task) -> None:
        """Deliver a pending cancellation, else block until the pending execution time has been served."""
        if task.pending_cancellation is not None:
            self._cancel_task(task)
        amount = task.take_pending()
        processor = task.context.processor
        if amount and processor is not None:
            processor.serve(task, amount)

    def _cancel_task(self, task: Task) -> None:
        task.deliver_cancellation()
        while True:  # it has swallowed too many cancellations: this interaction point never returns
            task.event = VOID
            self._switch_to_hub()

    def consume(self, amount: Ns) -> bool:
        """Block the current task until its processor has served `amount` ns; False if there is no task."""
        task = self._current
        if task is None:
            return False
        task.pending_ns += amount
        self._interact(task)
        return True

    def sleep_until(self, when: Ns) -> None:
        """Spend the pending execution time, then block the current task until `when`, ns.

        The most frequent call of a simulation: what it calls otherwise is written out here.
        """
        task = self._current
        if task is None:
            raise UsageError("a framework callback must not block, but waits for a time")
        if task.pending_ns or task.pending_cancellation is not None or task.meter is not None:
            self._interact(task)
        if when <= self._now:
            return
        event = (when << TICKET_BITS) + next(self._tickets)  # the last ticket: after all events of its time
        due = self._heap[0]
        if event < due and event < self._horizon:  # nothing happens meanwhile, a post included
            self._now = when
            return
        task.woken = False
        task.waiting_for = "a time"
        task.event = event
        targets = self._targets
        targets[event] = task
        target = targets[due]
        if due < self._horizon and target.event == due and isinstance(target, Task):
            heapreplace(self._heap, event)
            del targets[due]
            self._now = due >> TICKET_BITS
            self._current = target
            del due, target  # else this frame, resumed, would release objects that have left the caches
            self._current.flow.switch()
        else:
            heappush(self._heap, event)
            self._switch_to_next(task)
        if task.pending_cancellation is not None:
            self._cancel_task(task)

    def skip(self, amount: Ns) -> Ns:
        """Let `amount` ns pass if no event is due meanwhile; return when they began, else ``NEVER``."""
        start = self._now
        end = start + amount
        after = end + 1 << TICKET_BITS
        if after > self._horizon or self._heap[0] < after:
            return NEVER
        self._now = end
        return start

    def park(self, deadline: Ns | None = None, waiting_for: str = "") -> bool:
        """Block the current task until it is woken (True) or `deadline`, ns, has passed (False)."""
        task = self._current
        if task is None:
            raise UsageError(f"a framework callback must not block, but waits for {waiting_for}")
        if task.pending_cancellation is not None:
            self._cancel_task(task)
        task.woken = False
        task.waiting_for = waiting_for
        if deadline is None:
            task.event = VOID
        else:
            self._schedule(task, deadline)
        self._switch_to_next(task)
        if task.pending_cancellation is not None:
            self._cancel_task(task)
        return task.woken

    def wake(self, task: Task) -> None:
        """End the wait that `task` is in."""
        if not task.woken and not task.done and task is not self._current:
            task.woken = True
            self._schedule(task, self._now)

    def cancel(self, scope: Scope, why: str) -> None:
        """Deliver ``Cancelled`` to every task of `scope` at its next interaction point."""
        scope.mark(why)
        for task in scope.all_tasks():
            self.wake(task)

    # -- context switches

    def _switch_to_next(self, task: Task) -> None:
        """Execute the timers that are due next, then switch to the task or, for other events, to the hub."""
        heap, targets = self._heap, self._targets
        while heap[0] < self._horizon:
            due = heap[0]
            target = targets[due]
            if target.event != due:  # void: cancelled, set anew, or woken before its deadline
                del targets[heappop(heap)]
            elif isinstance(target, Task):
                del targets[heappop(heap)]
                self._now = due >> TICKET_BITS
                self._current = target
                if target is not task:  # else a timer has woken the task that is about to wait
                    target.flow.switch()
                return
            elif isinstance(target, ResettableTimer):
                del targets[heappop(heap)]
                self._now = due >> TICKET_BITS
                self._current = None
                self._execute(target)
            else:
                break
        self._switch_to_hub()

    def _execute(self, timer: ResettableTimer) -> None:
        """Execute a timer in the task that blocks. What it raises, or a cancelled run, is left to the hub."""
        try:
            timer.action()
        except BaseException as error:
            self.post(partial(_raise, error))  # to ``run``: this task is not its cause
        if self.root.cancelled:
            self._horizon = VOID  # the hub ends the run before what is due next

    def _switch_to_hub(self) -> None:
        if self._hub is None:
            self._hub = greenlet(self._serve)
        self._hub.switch()

    def _resume(self, task: Task) -> None:
        self._current = task
        task.flow.switch()
        if self.pacer is not None and task.adopted:
            self.pacer.rest()  # time stood still while the script ran

    # -- the hub

    def run(self, until: Ns) -> None:
        """Let time pass up to and including `until`, ns, or until the root scope is cancelled.

        If no event is left at all, return at once, at the time of the last event. Any exception of a
        framework callback or of a task's body is raised here, Ctrl-C included; ``run`` may be called again
        after it.

        Raises:
            Deadlock: no event is left while tasks still wait.
        """
        if self._current is not None or (self._hub is not None and self._hub is getcurrent()):
            raise UsageError("run() from inside the run: time passes while a task blocks")
        self._until = min(until, FOREVER)
        self._owner = getcurrent()
        with self._watched():
            self._switch_to_hub()

    @contextmanager
    def _watched(self) -> Iterator[None]:
        if self._watchdog is not None:
            self._watchdog.start()
        with self._interrupts:
            yield

    def _serve(self) -> None:
        while True:
            error = self._error_of_loop()
            self._horizon = VOID
            self._current = self._adopted
            if self.pacer is not None:
                self.pacer.rest()
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
        heap, targets, inbox, pacer = self._heap, self._targets, self._inbox, self.pacer
        while True:
            self._current = None
            self._horizon = self._until + 1 << TICKET_BITS if pacer is None else VOID
            for _ in range(len(inbox)):  # what is posted meanwhile waits: it must not delay what is due
                inbox.popleft()()
            if self.root.cancelled:
                return
            due = heap[0] >> TICKET_BITS
            if pacer is not None:
                now = pacer.wait(self._now, min(due, self._until))
                if now is not None:
                    self._now = now
                    continue
            if due > self._until:
                self._end_loop()
                return
            event = heappop(heap)
            target = targets.pop(event)
            if target.event == event:
                self._now = due
                if isinstance(target, Task):
                    self._resume(target)
                else:
                    target.action()

    def _end_loop(self) -> None:
        """Advance to the end of ``run``, or raise ``Deadlock`` if no event is left while tasks wait."""
        heap, targets = self._heap, self._targets
        while targets[heap[0]].event != heap[0]:
            del targets[heappop(heap)]
        if len(heap) > 1 or self.pacer is not None:
            self._now = max(self._now, self._until)
            return
        waiting = [f"{task.name} for {task.waiting_for}" for task in self.root.all_tasks()]
        if waiting:
            raise Deadlock("nothing can happen any more; waiting: " + "; ".join(waiting))

    # -- scripts

    @contextmanager
    def adopt(self, name: str) -> Iterator[Task]:
        """Make the calling flow a task. Virtual time runs while the task blocks, else it stands still.

        The cancellation of its scope ends the context silently, as it ends any task.
        """
        if self._current is not None:
            raise UsageError(f"adopt({name!r}): this flow is the task {self._current.name!r} already")
        task = Task(name, ExecutionContext(name), self.root)
        task.adopted = True
        task.flow = self._owner = getcurrent()
        self._script_thread = threading.get_ident()
        self._until = FOREVER
        self._adopted = self._current = task
        try:
            with self._watched():
                yield task
        except Cancelled:
            pass
        finally:
            self._adopted = self._current = None
            self._horizon = VOID
            self._bury(task)

    @contextmanager
    def joined(self) -> Iterator[None]:
        """Raise ``UsageError`` in a thread of a script: it cannot pass virtual time."""
        if self._adopted is not None and threading.get_ident() != self._script_thread:
            raise UsageError(
                f"the thread {threading.current_thread().name!r} cannot wait in virtual time: call simulated "
                "vehicles from the thread that has connected to them; several at once by connect_fleet() and "
                "Fleet.each(), or as components of a model"
            )
        yield

    # -- the end

    def close(self, why: str = "end of run") -> list[str]:
        """Cancel and unwind every task; return the names of those that did not end.

        An exception of a task that is unwound is raised when all have been unwound.
        """
        if self._current is not None:
            raise UsageError("close() from inside a task: leave it first")
        self.cancel(self.root, why)
        if self._watchdog is not None:
            self._watchdog.stop()
        hub, self._hub = self._hub, getcurrent()
        errors = [self._unwind(task) for task in list(self.root.all_tasks())]
        if hub is not None:
            hub.parent = self._hub
            hub.throw()
        self._hub = self._current = None
        for error in errors:
            if error is not None:
                raise error
        return [task.name for task in self.root.all_tasks()]

    def _unwind(self, task: Task) -> BaseException | None:
        try:
            if task.flow is None:
                self._bury(task)
            else:
                task.flow.parent = self._hub  # the flow that it ends in
                self._resume(task)
        except BaseException as error:
            return error
        return None
