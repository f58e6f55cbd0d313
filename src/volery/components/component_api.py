"""What a component's file may ask of the run it is part of: ``import volery`` and call.

Each call finds the run by itself: it is that of the flow of control that calls. All of them are interaction
points: what the component has computed so far is served first.
"""

from __future__ import annotations

from weakref import ReferenceType, ref

from volery.base.errors import UsageError
from volery.base.time import from_seconds, to_seconds
from volery.components.instance import ComponentContext, Instance
from volery.kernel import waiting
from volery.kernel.api import Kernel
from volery.kernel.task import Task
from volery.trace.events import Charge, Milestone, Text

SEVERITIES = {"error": 3, "warning": 4, "info": 6, "debug": 7}
"""Words for the syslog severities that a component may use."""

_kernels: list[ReferenceType[Kernel]] = []


def register_kernel(kernel: Kernel) -> None:
    """From now on these calls find *kernel* when one of its tasks makes them. It is not kept alive."""
    _kernels[:] = [known for known in _kernels if known() is not None and known() is not kernel]
    _kernels.append(ref(kernel))


def caller(what: str) -> tuple[Kernel, Task]:
    """The run and the flow of control that *what* was called in; ``UsageError`` if it is none of a run's."""
    for known in reversed(_kernels):
        kernel = known()
        task = kernel.current() if kernel is not None else None
        if kernel is not None and task is not None:
            return kernel, task
    raise UsageError(f"{what} works in a component or a mission of a run only")


def component_of(task: Task) -> Instance | None:
    """The component whose code *task* executes now; ``None`` for a mission or a script."""
    place = task.context
    return place.instance if isinstance(place, ComponentContext) else None


def now() -> float:
    """Seconds since the start of the run."""
    with caller("volery.now()")[0] as kernel:
        return to_seconds(kernel.now())


def sleep(seconds: float) -> None:
    """Do nothing for so long. Ends an activation."""
    waiting.sleep(caller("volery.sleep()")[0], from_seconds(seconds))


def add_time(seconds: float, at_mhz: float | None = None, energy: float = 0.0) -> None:
    """Charge the component with computing that is neither stated nor counted, such as a library's.

    *seconds* of execution time on its processor, at the frequency *at_mhz* if it is given: on a processor at
    half of it the same work takes twice as long. *energy* in joules, where it is known. Where computing costs
    nothing (a component of the environment, real hardware) this does nothing.
    """
    kernel, task = caller("volery.add_time()")
    instance = component_of(task)
    if instance is None or instance.seat.processor is None:
        return
    amount = from_seconds(seconds * _slower(instance, at_mhz))
    if amount < 0:
        raise UsageError(f"volery.add_time({seconds}): time cannot be taken back")
    task.charge(amount)
    charge = Charge(kernel.now(), instance.name, instance.seat.processor.name, "stated", amount, 0, energy)
    with kernel.guard:
        kernel.record(charge)


def _slower(instance: Instance, at_mhz: float | None) -> float:
    """How many times longer work takes on the processor of *instance* than at *at_mhz*."""
    if at_mhz is None:
        return 1.0
    if at_mhz <= 0.0:
        raise UsageError(f"volery.add_time(at_mhz={at_mhz}): a frequency is above 0")
    actual = instance.seat.frequency_mhz
    return 1.0 if actual is None else at_mhz / actual


def note(kind: str, subject: str, state: str, detail: str = "") -> None:
    """Record that something the application follows entered a state: ``note("parcel", "p-1", "ordered")``."""
    kernel, task = caller("volery.note()")
    with kernel:
        kernel.record(Milestone(kernel.now(), task.context.component, kind, subject, state, detail))


def log(text: str, severity: str = "info") -> None:
    """Record a line of text. *severity*: error, warning, info or debug."""
    if severity not in SEVERITIES:
        raise UsageError(f"volery.log(severity={severity!r}): choose {', '.join(SEVERITIES)}")
    kernel, task = caller("volery.log()")
    with kernel:
        kernel.record(Text(kernel.now(), task.context.component, SEVERITIES[severity], str(text)))
