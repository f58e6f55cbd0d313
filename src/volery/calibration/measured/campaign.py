"""Several runs of a model's nodes, and the simulation that they are compared with."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from volery.base.errors import EstimateError, UsageError
from volery.base.time import Ns
from volery.calibration.measured.comparison import Compared, Estimate, compared, estimates
from volery.calibration.measured.programs import NodeProgram, programs
from volery.calibration.measured.runs import Run, running
from volery.calibration.ros.stage import check_client, own_master
from volery.model.system import System
from volery.run.options import Options
from volery.run.simulate import simulate

Show = Callable[[int], None]
"""Told how many runs are done."""


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
) -> tuple[list[Run], bool]:
    """*count* runs on a master of their own; fewer, and false, if Ctrl-C breaks them off."""
    done: list[Run] = []
    try:
        with own_master() as master, running(nodes, master, duration) as run:
            for number in range(count):
                show(number)
                done.append(run())
    except KeyboardInterrupt:
        return done, False
    return done, True


def estimated(system: System, fidelity: str = "code") -> dict[str, Estimate]:
    """What a simulation of *system* charges its nodes. ``EstimateError`` if it does not come to its end."""
    run = simulate(system, Options(fidelity=fidelity))
    if not run.completed:
        reason = run.error or run.record.outcome.reason
        raise EstimateError(f"the simulation that estimates {system.name} failed: {reason}")
    return estimates(run.record, [one.name for one in system.instances if not one.is_environment])


def compare(system: System, estimate: Mapping[str, Estimate], runs: Sequence[Run]) -> tuple[Compared, ...]:
    """Each node's estimate beside what *runs* measured. ``UsageError`` without a run."""
    if not runs:
        raise UsageError("no run was measured to its end")
    languages = {one.name: one.component.language for one in system.instances}
    return tuple(compared(languages, estimate, runs))
