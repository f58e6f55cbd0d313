"""Calls that a component's file may make to its run: ``import volery``, then ``volery.now()`` and so on.

Each call finds the run by the flow of control that makes it. All of them are interaction points: what the
component has computed so far is served first.
"""

from __future__ import annotations

from typing import Any

from volery.base.errors import UsageError
from volery.base.time import from_seconds, to_seconds
from volery.components.instance import ComponentContext, RunningInstance
from volery.kernel import waiting
from volery.kernel.api import Kernel
from volery.kernel.task import Task
from volery.ros.graph import Node
from volery.trace.events import Charge, Milestone, Text

SEVERITIES = {"error": 3, "warning": 4, "info": 6, "debug": 7}
"""Syslog severities that a component may use."""

_kernels: list[Kernel] = []


def register_kernel(kernel: Kernel) -> None:
    """Make ``kernel`` known to the calls of its tasks; kernels of runs that have ended are forgotten."""
    _kernels[:] = [known for known in _kernels if not known.root.cancelled and known is not kernel]
    _kernels.append(kernel)


def caller(what: str) -> tuple[Kernel, Task]:
    """Return the kernel and the task of the caller.

    Raises:
        UsageError: The caller is not a task of a run; the error names the call ``what``.
    """
    for kernel in reversed(_kernels):
        task = kernel.current()
        if task is not None:
            return kernel, task
    raise UsageError(f"{what} works in a component or a mission of a run only")


def component_of(task: Task) -> RunningInstance | None:
    """Return the component whose code ``task`` executes now; None for a mission or a script."""
    context = task.context
    return context.instance if isinstance(context, ComponentContext) else None


def now() -> float:
    """Return the time since the start of the run, s."""
    return to_seconds(waiting.read_clock(caller("volery.now()")[0]))


def sleep(seconds: float) -> None:
    """Block for a time of the run. This ends an activation.

    Args:
        seconds: Duration, s.
    """
    waiting.sleep(caller("volery.sleep()")[0], from_seconds(seconds))


def add_time(seconds: float, at_mhz: float | None = None, energy: float = 0.0) -> None:
    """Charge the component for computing that is neither stated nor counted, such as a library's.

    This does nothing where computing takes no simulated time: in a component of the environment or on real
    hardware.

    Args:
        seconds: Execution time on the component's processor, s.
        at_mhz: Frequency that the time is stated at, MHz, by default the processor's. At half of it the same
            work takes twice as long.
        energy: Energy of the computing, J, where it is known.

    Raises:
        UsageError: The time is negative, or the frequency is not above 0.
    """
    kernel, task = caller("volery.add_time()")
    instance = component_of(task)
    if instance is None or instance.allocation.processor is None:
        return
    factor = 1.0
    if at_mhz is not None:
        if at_mhz <= 0.0:
            raise UsageError(f"volery.add_time(at_mhz={at_mhz}): a frequency is above 0")
        frequency_mhz = instance.allocation.frequency_mhz
        factor = 1.0 if frequency_mhz is None else at_mhz / frequency_mhz
    amount = from_seconds(seconds * factor)
    if amount < 0:
        raise UsageError(f"volery.add_time({seconds}): time cannot be taken back")
    task.charge(amount)
    processor = instance.allocation.processor.name
    with kernel.guard:
        kernel.record(Charge(kernel.now(), instance.name, processor, "stated", amount, 0, energy))


def note(kind: str, subject: str, state: str, detail: str = "") -> None:
    """Record that something which the application follows has entered a state.

    For example ``note("point", "north-east corner", "inspected")``. The report has a table of each kind
    with its subjects and their states; requirements bound ``note.<kind>.<state>``.

    Args:
        kind: Kind of thing.
        subject: Its name. What is no text, such as a number, is written as one; also in the other arguments.
        state: State that it has entered.
        detail: Text for the reader of the report.

    Raises:
        UsageError: An argument is None.
    """
    kernel, task = caller("volery.note()")
    words: dict[str, Any] = {"kind": kind, "subject": subject, "state": state, "detail": detail}
    for name, word in words.items():
        if word is None:
            raise UsageError(f"volery.note(): {name} is None; give a text")
        words[name] = str(word).encode(errors="backslashreplace").decode()  # surrogates are no UTF-8
    with kernel.interact():
        kernel.record(Milestone(kernel.now(), task.context.component, **words))


def node() -> Node:
    """Return the component's node on the ROS graph of the run: the interface ``volery.ros.graph.Node``.

    It joins with the first call, under the component's name. Files for rospy and rclpy have a node by their
    library.

    Raises:
        UsageError: The caller is no component in Python of the application.
    """
    instance = component_of(caller("volery.node()")[1])
    if instance is None or instance.join_graph is None:
        raise UsageError("volery.node() works in a component with `language: python`")
    return instance.join_graph()


def log(text: str, severity: str = "info") -> None:
    """Record a line of text.

    Args:
        text: The line.
        severity: ``error``, ``warning``, ``info`` or ``debug``.

    Raises:
        UsageError: There is no such severity.
    """
    if severity not in SEVERITIES:
        raise UsageError(f"volery.log(severity={severity!r}): choose {', '.join(SEVERITIES)}")
    kernel, task = caller("volery.log()")
    with kernel.interact():
        kernel.record(Text(kernel.now(), task.context.component, SEVERITIES[severity], str(text)))
