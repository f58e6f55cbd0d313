"""Several runs of a model's nodes, and the simulation that they are compared with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from volery.base.errors import EstimateError, UsageError
from volery.base.time import Ns
from volery.calibrate.measured.comparison import Compared, compared, estimates
from volery.calibrate.measured.programs import NodeProgram, programs
from volery.calibrate.measured.runs import measure
from volery.calibrate.ros.stage import check_client, own_master
from volery.model.system import System
from volery.run.simulate import Options, simulate

Show = Callable[[int], None]
"""Told how many runs are done."""


@dataclass(frozen=True)
class Measurement:
    """Estimate and measurement of each node. ``complete`` is false if it was broken off."""

    nodes: tuple[Compared, ...]
    complete: bool


def prepared(system: System) -> tuple[NodeProgram, ...]:
    """The nodes of *system*, ready to start. Errors of ``programs``, and ``UsageError`` without ROS."""
    if not any(one.processor for one in system.instances):
        raise UsageError("the model has no node that runs on a processor: nothing is to be measured")
    for language in sorted({one.component.language for one in system.instances}):
        if language in ("rospy", "roscpp"):
            check_client(language)
    return programs(system)


def measured_runs(
    nodes: Sequence[NodeProgram], count: int, duration: Ns, show: Show = lambda done: None
) -> tuple[list[dict[str, Ns]], bool]:
    """*count* runs on a master of their own; fewer, and false, if Ctrl-C breaks them off."""
    done: list[dict[str, Ns]] = []
    try:
        with own_master() as master:
            for number in range(count):
                show(number)
                done.append(measure(nodes, master, duration))
    except KeyboardInterrupt:
        return done, False
    return done, True


def compare(system: System, runs: Sequence[dict[str, Ns]], fidelity: str = "code") -> tuple[Compared, ...]:
    """Simulate *system* and put what it estimates beside what *runs* measured.

    ``UsageError`` without a run, ``EstimateError`` if the simulation does not come to its end.
    """
    if not runs:
        raise UsageError("no run was measured to its end")
    run = simulate(system, Options(fidelity=fidelity))
    if not run.completed:
        reason = run.error or run.record.outcome.reason
        raise EstimateError(f"the simulation that estimates {system.name} failed: {reason}")
    languages = {one.name: one.component.language for one in system.instances}
    return tuple(compared(languages, estimates(run.record, list(runs[0])), runs))
