"""A component that exists in a run: its object, its place, what it costs, and one call at a time.

Knows no model and no language: whoever builds the run says where it stands (``Allocation``), what its computing
costs (``Pricing``) and hands it the object that a host made.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from traceback import walk_tb

from volery.base.errors import ComponentError, VoleryError
from volery.base.time import Ns
from volery.cost import FREE, Cost, Pricing
from volery.kernel.api import Kernel
from volery.kernel.task import ComputeResource, ExecutionContext, Scope, Task
from volery.kernel.waiting import Lock, Signal, executing_in
from volery.trace.events import Charge, Failure

COMPONENT_MARK = "__volery_user__"
"""A name that every module of a component has: it tells the user's part of a traceback from a library's."""

OnFailure = Callable[[str, Exception], None]
"""Told the name of a component whose flow of control has ended with an error, and the error."""

ReadSteps = Callable[[], int]
"""Steps of Python code that were executed since it was last asked."""


@dataclass(frozen=True)
class Allocation:
    """Where a component computes.

    ``processor`` ``None``: computing takes no simulated time. ``frequency_mhz`` is the processor's.
    ``priority`` ``None``: the caller's; it is that of every passive component, and an active one states its
    own. ``deadline`` counts from each release of an activation, ns; ``starts_at`` delays an active
    component's ``run``.
    """

    processor: ComputeResource | None = None
    frequency_mhz: float | None = None
    priority: int | None = None
    deadline: Ns | None = None
    starts_at: Ns = 0

    @property
    def is_active(self) -> bool:
        """Whether it has a flow of control of its own."""
        return self.priority is not None


@dataclass(frozen=True, eq=False)
class ComponentContext(ExecutionContext):
    """A place that knows whose it is, so that services called by user code find their component."""

    instance: Instance = field(kw_only=True)


class Instance:
    """One component of the application or of its environment.

    ``operations`` are the names it provides. ``counter`` gives the steps of counted code, where code is
    counted: also for components whose steps cost nothing, lest others pay for them. ``object`` is ``None``
    until its constructor has returned.
    """

    def __init__(
        self,
        kernel: Kernel,
        name: str,
        seat: Allocation = Allocation(),
        pricing: Pricing = FREE,
        operations: tuple[str, ...] = (),
        counter: ReadSteps | None = None,
    ) -> None:
        self.kernel = kernel
        self.name = name
        self.seat = seat
        self.pricing = pricing
        self.operations = operations
        self.object: object | None = None
        self.broken = ""  # why there will never be an object
        self.scope: Scope | None = None
        self.failed: OnFailure = _forget
        self._counter = counter
        self._uncharged: Ns = 0
        self._lock = Lock(kernel, f"{name} (busy)")
        self._made = Signal(kernel, f"{name} (being constructed)")
        self.context = ComponentContext(
            name,
            seat.processor,
            seat.priority,
            seat.deadline,
            meter=self._read_meter if counter else None,
            on_release=self._released if seat.is_active and pricing is not FREE else None,
            instance=self,
        )

    def _read_meter(self) -> Ns:
        steps = self._counter() if self._counter else 0
        amount = round(steps * self.pricing.ns_per_step)
        self._uncharged += amount
        return amount

    def complete(self, thing: object) -> None:
        """Its constructor has returned *thing*: from now on it can be called."""
        self.object = thing
        self._made.notify()

    def give_up(self, why: str) -> None:
        """Its constructor has failed: whoever calls it is told so."""
        self.broken = why
        self._made.notify()

    def _released(self, task: Task) -> None:
        """An activation of it begins: *task* owes what the model states for one."""
        self.flush()
        self._charge(task, "activation", self.pricing.activation(self.name))

    def _charge(self, task: Task, kind: str, cost: Cost) -> None:
        if cost.time or cost.energy:
            task.charge(cost.time)
            self._record_charge(kind, cost)

    def _record_charge(self, kind: str, cost: Cost) -> None:
        processor = self.seat.processor
        where = processor.name if processor else ""
        with self.kernel.guard:
            self.kernel.record(Charge(self.kernel.now(), self.name, where, kind, cost.time, 0, cost.energy))

    def flush(self) -> None:
        """Record as one charge what was counted since the last."""
        if self._uncharged:
            amount, self._uncharged = self._uncharged, 0
            self._record_charge("code", Cost(amount))

    def fail(self, error: Exception, doing: str) -> ComponentError:
        """Record that its code raised *error* while *doing*; returns what to raise instead."""
        wrapped = ComponentError(self.name, f"{doing} raised {describe(error)}")
        with self.kernel as kernel:
            kernel.record(Failure(kernel.now(), self.name, wrapped.what))
        return wrapped

    def report(self, error: Exception) -> None:
        """Record that its flow of control has ended with *error* and tell whoever started it."""
        with self.kernel as kernel:
            kernel.record(Failure(kernel.now(), self.name, str(error)))
        self.failed(self.name, error)

    def guard(self, body: Callable[[], object], doing: str) -> bool:
        """Run its code at the root of a task: what it raises is recorded and reported. True if nothing was
        raised.
        """
        try:
            body()
        except VoleryError as error:
            self.report(error)
        except Exception as error:
            wrapped = self.fail(error, doing)
            wrapped.__cause__ = error
            self.failed(self.name, wrapped)
        else:
            return True
        return False

    @contextmanager
    def visited(self, task: Task, operation: str) -> Iterator[object]:
        """*task* comes to this component's place to execute *operation*: one visitor at a time.

        What the operation costs is served here, before anything it does is seen and before the visitor
        leaves. Gives the object.
        """
        cost = self.pricing.operation(self.name, operation)
        thing = self._ready()
        with self._lock:
            try:
                with executing_in(self.kernel, self.context):
                    self._charge(task, f"operation:{operation}", cost)
                    yield thing
            finally:
                self.flush()

    def _ready(self) -> object:
        if self.object is None:
            self._made.wait_for(lambda: self.object is not None or self.broken)
            if self.object is None:
                raise ComponentError(self.name, f"cannot be called: {self.broken}")
        return self.object


class ForeignError(Exception):
    """An error of code that is not Python: it says itself what it is."""


def describe(error: BaseException) -> str:
    """``ValueError: no such parcel (delivery_central.py:41)``: what was raised, and where in their code."""
    if isinstance(error, ForeignError):
        return str(error)
    said = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    frames = [
        (trace.f_globals, trace.f_code.co_filename, line) for trace, line in walk_tb(error.__traceback__)
    ]
    theirs = [frame for frame in frames if COMPONENT_MARK in frame[0]] or frames
    if not theirs:
        return said
    _, file, line = theirs[-1]
    return f"{said} ({file.rpartition('/')[2]}:{line})"


def _forget(name: str, error: Exception) -> None:
    """What a component without anybody to tell does with its failure."""
