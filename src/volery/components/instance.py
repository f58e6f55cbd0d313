"""A component that exists in a run: its object, where it computes, what that costs, and one call at a time.

An instance depends neither on the model nor on a language. The run states its ``Allocation`` and its
``Pricing`` and gives it the object that a ``Program`` has made.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from traceback import walk_stack, walk_tb
from types import FrameType
from typing import Protocol

from greenlet import GreenletExit

from volery.base.errors import ComponentError, VoleryError
from volery.base.time import Ns
from volery.cost import FREE, STEPS_PER_NS, Cost, Pricing
from volery.kernel.api import Kernel
from volery.kernel.task import Cancelled, ComputeResource, ExecutionContext, Scope, Task
from volery.kernel.waiting import Lock, Signal, executing_in
from volery.ros.graph import Node
from volery.trace.events import Charge, Failure

COMPONENT_MARK = "__volery_user__"
"""A name in every module of a component, by which its frames are recognised in a traceback."""

_ENDS_OF_TASKS = (Cancelled, GreenletExit, KeyboardInterrupt)
"""What the kernel and the operator raise in a task, and no error of its code."""

OnFailure = Callable[[str, Exception], None]
"""Called with the name of a component whose flow of control has ended with an error, and the error."""


class Joinable(Protocol):
    """A thread of component code."""

    def join(self) -> None:
        """Wait until it has ended."""

    def is_alive(self) -> bool:
        """Return whether it has not ended."""


ReadSteps = Callable[[], int]
"""Returns the steps of counted code since the last call."""


@dataclass(frozen=True)
class Allocation:
    """Where a component computes, and its scheduling parameters.

    Attributes:
        processor: Processor, or None if computing takes no simulated time.
        frequency_mhz: Frequency of the processor, MHz.
        priority: Priority of an active component; None for a passive one, which has its caller's.
        deadline: Deadline of an activation, relative to its release, ns.
        period: Time between its releases, ns.
        starts_at: Time at which ``run`` of an active component starts, ns.
    """

    processor: ComputeResource | None = None
    frequency_mhz: float | None = None
    priority: int | None = None
    deadline: Ns | None = None
    starts_at: Ns = 0
    period: Ns | None = None

    @property
    def is_active(self) -> bool:
        """Whether the component has a flow of control of its own."""
        return self.priority is not None


@dataclass(frozen=True, eq=False)
class ComponentContext(ExecutionContext):
    """An execution context with its instance, so that calls of component code find their component."""

    instance: RunningInstance = field(kw_only=True)


class RunningInstance:
    """One component of the application or of its environment.

    Args:
        kernel: The run's kernel.
        name: Name of the instance.
        allocation: Where it computes.
        pricing: What its computing costs.
        operations: Names of the operations that it provides.
        read_steps: Reader of the steps of counted code. A component whose steps cost nothing has one too, so
            that its steps are not charged to others.
    """

    def __init__(
        self,
        kernel: Kernel,
        name: str,
        allocation: Allocation = Allocation(),
        pricing: Pricing = FREE,
        operations: tuple[str, ...] = (),
        read_steps: ReadSteps | None = None,
    ) -> None:
        self.kernel = kernel
        self.name = name
        self.allocation = allocation
        self.pricing = pricing
        self.operations = operations
        self.object: object | None = None  # until its constructor has returned
        self.scope: Scope | None = None
        self.join_graph: Callable[[], Node] | None = None  # returns its node, if it may have one
        self.on_failure: OnFailure = lambda name, error: None
        self.on_thread_failure: OnFailure = lambda name, error: None
        self.threads: list[Joinable] = []  # those that the end of a script waits for
        self._unavailable = ""  # why there will never be an object
        self._read_steps = read_steps
        self._uncharged: Ns = 0
        self._lock = Lock(kernel, f"{name} (busy)")
        self._constructed = Signal(kernel, f"{name} (being constructed)")
        self.context = ComponentContext(
            name,
            allocation.processor,
            allocation.priority,
            allocation.deadline,
            allocation.period,
            meter=self._read_meter if read_steps else None,
            on_release=self._on_release if allocation.is_active and pricing is not FREE else None,
            instance=self,
        )

    def _read_meter(self) -> Ns:
        steps = self._read_steps() if self._read_steps else 0
        if self.allocation.processor is None:
            return steps // STEPS_PER_NS
        amount = round(steps * self.pricing.ns_per_step)
        self._uncharged += amount
        return amount

    def set_object(self, made: object) -> None:
        """Set the constructed object; the component can be called from now on."""
        self.object = made
        self._constructed.notify()

    def set_unavailable(self, reason: str) -> None:
        """Record that there is no object any more; waiting and later calls raise ``ComponentError``."""
        self.object = None
        self._unavailable = reason
        self._constructed.notify()

    def _on_release(self, task: Task) -> None:
        """Charge ``task`` for an activation as the model states it."""
        self.flush_charges()
        self._charge(task, "activation", self.pricing.activation(self.name))

    def _charge(self, task: Task, kind: str, cost: Cost) -> None:
        if cost.time or cost.energy:
            task.charge(cost.time)
            self._record_charge(kind, cost)

    def _record_charge(self, kind: str, cost: Cost) -> None:
        processor = self.allocation.processor
        where = processor.name if processor else ""
        with self.kernel.guard:
            self.kernel.record(Charge(self.kernel.now(), self.name, where, kind, cost.time, 0, cost.energy))

    def flush_charges(self) -> None:
        """Record what has been counted since the last record as one charge."""
        if self._uncharged:
            amount, self._uncharged = self._uncharged, 0
            self._record_charge("code", Cost(amount))

    def component_error(self, error: BaseException, doing: str) -> ComponentError:
        """Record an error of the component's code in ``doing``; return the error to raise instead."""
        wrapped = ComponentError(self.name, f"{doing} raised {describe(error)}")
        self._record_failure(wrapped.what)
        return wrapped

    def _record_failure(self, what: str) -> None:
        """Record a failure, after the time that the code has computed; at once if its task is cancelled."""
        with suppress(Cancelled):
            self.kernel.interact()
        with self.kernel.guard:
            self.kernel.record(Failure(self.kernel.now(), self.name, what))

    def run_guarded(self, body: Callable[[], object], doing: str) -> bool:
        """Run component code at the root of a task; record and report its errors.

        ``sys.exit()`` ends it, which is an error if the exit status is not 0.

        Returns:
            Whether the code ended without an error.
        """
        try:
            body()
        except SystemExit as end:
            status = exit_status(end)
            if not status:
                return True
            self.report_exit(status, end)
        except VoleryError as error:
            self._record_failure(self._words_of(error))
            self.on_failure(self.name, error)
        except _ENDS_OF_TASKS:
            raise
        except BaseException as error:
            wrapped = self.component_error(error, doing)
            wrapped.__cause__ = error
            self.on_failure(self.name, wrapped)
        else:
            return True
        return False

    def run_thread(self, body: Callable[[], object], name: str) -> None:
        """Run a thread of component code: what it raises ends the thread alone, as in Python."""
        try:
            body()
        except SystemExit:
            pass
        except _ENDS_OF_TASKS:
            raise
        except BaseException as error:
            self.report_thread(error, f"thread {name}")

    def report_thread(self, error: BaseException, doing: str) -> None:
        """Record and report what ended one flow of control in ``doing``, while others go on."""
        if isinstance(error, VoleryError):
            self._record_failure(self._words_of(error))
            self.on_thread_failure(self.name, error)
        else:
            self.on_thread_failure(self.name, self.component_error(error, doing))

    def _words_of(self, error: VoleryError) -> str:
        """Return the text of an error without this component's name, which stands before it."""
        return str(error).removeprefix(f"{self.name}: ")

    def report_exit(self, status: int, end: SystemExit | None = None) -> None:
        """Record and report that the component has ended with an exit status that is not 0."""
        text = f": {_encodable(end.code)}" if end is not None and isinstance(end.code, str) else ""
        what = f"ended with exit status {status}{text}{place_of(end) if end is not None else ''}"
        self._record_failure(what)
        self.on_failure(self.name, ComponentError(self.name, what))

    @contextmanager
    def serving(self, task: Task, operation: str) -> Iterator[object]:
        """Execute ``operation`` in this component's context: one caller at a time.

        The cost of the operation is served here, before its effects are visible and before the caller
        leaves. Yields the object.
        """
        cost = self.pricing.operation(self.name, operation)
        made = self._wait_for_object()
        with self._lock:
            try:
                with executing_in(self.kernel, self.context):
                    self._charge(task, f"operation:{operation}", cost)
                    yield made
            finally:
                self.flush_charges()

    def _wait_for_object(self) -> object:
        made = self.object
        if made is None:
            self._constructed.wait_for(lambda: self.object is not None or self._unavailable)
            made = self.object
            if made is None:
                raise ComponentError(self.name, f"cannot be called: {self._unavailable}")
        return made


class ForeignError(Exception):
    """An exception that code in another language did not catch; its text describes it completely.

    Args:
        kind: Type of the exception, as its language names it.
        what: Its own text; may be empty.
    """

    def __init__(self, kind: str, what: str) -> None:
        super().__init__(f"{kind}: {what}" if what else kind)


def _encodable(text: str) -> str:
    """Return a text that UTF-8 can carry: the bytes of a file's name that Python could not decode cannot."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def exit_status(end: SystemExit) -> int:
    """Return the exit status of a process that ends by ``sys.exit()``, as Python does."""
    if end.code is None:
        return 0
    return int(end.code) if isinstance(end.code, int) else 1


def describe(error: BaseException) -> str:
    """Return what was raised, and the line of the component's code that did it or made the call.

    For example ``ValueError: no such order (delivery_central.py:41)``. A call that the callee does not take
    is raised by the framework on behalf of its caller: then it is the caller's line.
    """
    if isinstance(error, ForeignError):
        return str(error)
    name = type(error).__name__
    try:
        words = _encodable(str(error))
    except Exception as fault:  # its own method fails
        words = f"(its __str__ raised {type(fault).__name__})"
    text = f"{name}: {words}" if words else name
    if type(error).__module__ == "termios":
        text = f"termios.{text}: the file reads keys of a terminal, and a component has none; {_NO_KEYS}"
    return f"{text}{place_of(error)}"


def place_of(error: BaseException) -> str:
    """Return the line of the component's code that raised an error, as `` (part.py:41)``, or ""."""
    raised = [(frame, line) for frame, line in walk_tb(error.__traceback__)]
    outer = walk_stack(raised[0][0].f_back) if raised else ()
    own = [one for one in raised if _is_component_code(one[0])]
    own = own or [one for one in outer if _is_component_code(one[0])][:1]
    own = own or [one for one in raised if not one[0].f_globals.get("__name__", "").startswith(_FRAMEWORK)]
    if not own:
        return ""
    frame, line = own[-1]
    return f" ({frame.f_code.co_filename.rpartition('/')[2]}:{line})"


def place_of_call() -> str:
    """Return the line of the component's code that called the framework, as `` (part.py:41)``, or ""."""
    own = next((one for one in walk_stack(None) if _is_component_code(one[0])), None)
    return "" if own is None else f" ({own[0].f_code.co_filename.rpartition('/')[2]}:{own[1]})"


_FRAMEWORK = "volery."
_NO_KEYS = "let another component publish what its keys would"


def _is_component_code(frame: FrameType) -> bool:
    return COMPONENT_MARK in frame.f_globals
