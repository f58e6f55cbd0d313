"""What was estimated beside what was measured: the paper's Table III for each node, and its Table IV.

Estimated is what a simulation of the same model charges a node in the same time: ROS calls by the law of its
client library, its own code as the fidelity says. Measured is the CPU time of the node's process, whole; what
of it is ROS is what the estimate of the node's own code leaves.

Several runs of a model's nodes, and the simulation that they are compared with.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median, quantiles

from volery.base.errors import EstimateError, UsageError
from volery.base.time import Ns, S
from volery.calibration.ros.probe_environment import check_client, own_master
from volery.calibration.validation.node_processes import (
    MeasuredRun,
    NodeProgram,
    measurement_session,
    node_programs,
)
from volery.model.system import System
from volery.requirements.record import RunRecord
from volery.run.result import Options
from volery.run.simulate import simulate

TOLERANCE = 0.15
"""Of the measured time: how far an estimate may be off, where the measured runs themselves do not differ by
more.
"""


@dataclass(frozen=True)
class NodeEstimate:
    """CPU seconds of one node: what ROS takes, what its own code takes, and how often it called what."""

    ros_s: float
    code_s: float
    calls: Mapping[str, int]

    @property
    def whole_s(self) -> float:
        """Together."""
        return self.ros_s + self.code_s


@dataclass(frozen=True)
class NodeComparison:
    """One node: the estimate, and the measured CPU seconds of every run."""

    node: str
    language: str
    estimate: NodeEstimate
    runs_s: tuple[float, ...]

    @property
    def measured_s(self) -> float:
        """The median run."""
        return median(self.runs_s)

    @property
    def spread_s(self) -> float:
        """The inter-quartile range of the runs; 0 for a single one."""
        if len(self.runs_s) < 2:
            return 0.0
        low, _, high = quantiles(self.runs_s, n=4, method="inclusive")
        return high - low

    @property
    def difference(self) -> float:
        """Estimated minus measured, relative to measured."""
        return (self.estimate.whole_s - self.measured_s) / self.measured_s

    @property
    def allowed(self) -> float:
        """The greater of ``TOLERANCE`` and half the spread, relative to measured."""
        return max(TOLERANCE, self.spread_s / 2.0 / self.measured_s)

    @property
    def holds(self) -> bool:
        """Whether the estimate is as near as is allowed."""
        return abs(self.difference) <= self.allowed

    # -- Table IV

    @property
    def measured_ros_s(self) -> float:
        """What the estimate of its own code leaves of the measured time."""
        return max(0.0, self.measured_s - self.estimate.code_s)

    @property
    def ros_share(self) -> float:
        """Of the measured time."""
        return self.measured_ros_s / self.measured_s

    @property
    def ros_error(self) -> float:
        """Of the estimate of ROS time, relative to the measured."""
        if not self.measured_ros_s:
            return 0.0
        return abs(self.estimate.ros_s - self.measured_ros_s) / self.measured_ros_s

    @property
    def impact(self) -> float:
        """What that error does to the estimate of the whole; without any estimate it is ``ros_share``."""
        return self.ros_share * self.ros_error

    def as_data(self) -> dict[str, object]:
        """For JSON."""
        return {
            "node": self.node,
            "language": self.language,
            "estimated_ros_s": self.estimate.ros_s,
            "estimated_code_s": self.estimate.code_s,
            "calls": dict(self.estimate.calls),
            "measured_s": self.measured_s,
            "measured_runs_s": list(self.runs_s),
            "spread_s": self.spread_s,
            "difference": self.difference,
            "allowed": self.allowed,
            "holds": self.holds,
            "ros_share": self.ros_share,
            "impact_of_ros_error": self.impact,
        }


def node_estimates(record: RunRecord, nodes: Sequence[str]) -> dict[str, NodeEstimate]:
    """What a simulation has charged each of *nodes*."""
    found = {}
    for name in nodes:
        one = record.components[name]
        found[name] = NodeEstimate(one.ros_cpu_s, max(0.0, one.cpu_s - one.ros_cpu_s), one.ros_calls)
    return found


def compare_nodes(
    languages: Mapping[str, str], estimated: Mapping[str, NodeEstimate], runs: Sequence[Mapping[str, Ns]]
) -> list[NodeComparison]:
    """One line for each node that *runs* measured; *languages* by node."""
    return [
        NodeComparison(node, languages[node], estimated[node], tuple(run[node] / S for run in runs))
        for node in runs[0]
    ]


ShowRun = Callable[[int], None]
"""Told how many runs are done."""


def prepare_nodes(system: System) -> tuple[NodeProgram, ...]:
    """The nodes of *system*, ready to start. Errors of ``node_programs``, and ``UsageError`` without ROS."""
    if not any(one.processor for one in system.instances):
        raise UsageError("the model has no node that runs on a processor: nothing is to be measured")
    for language in sorted({one.component.language for one in system.instances}):
        if language in ("rospy", "roscpp"):
            check_client(language)
    return node_programs(system)


def measure_runs(
    nodes: Sequence[NodeProgram], count: int, duration: Ns, show: ShowRun = lambda done: None
) -> tuple[list[MeasuredRun], bool]:
    """*count* runs on a master of their own; fewer, and false, if Ctrl-C breaks them off."""
    done: list[MeasuredRun] = []
    try:
        with own_master() as master, measurement_session(nodes, master, duration) as run:
            for number in range(count):
                show(number)
                done.append(run())
    except KeyboardInterrupt:
        return done, False
    return done, True


def estimate_nodes(system: System, fidelity: str = "code") -> dict[str, NodeEstimate]:
    """What a simulation of *system* charges its nodes. ``EstimateError`` if it does not come to its end."""
    run = simulate(system, Options(fidelity=fidelity))
    if not run.completed:
        reason = run.error or run.record.outcome.reason
        raise EstimateError(f"the simulation that estimates {system.name} failed: {reason}")
    return node_estimates(run.record, [one.name for one in system.instances if not one.is_environment])


def compare(
    system: System, estimate: Mapping[str, NodeEstimate], runs: Sequence[MeasuredRun]
) -> tuple[NodeComparison, ...]:
    """Each node's estimate beside what *runs* measured. ``UsageError`` without a run."""
    if not runs:
        raise UsageError("no run was measured to its end")
    languages = {one.name: one.component.language for one in system.instances}
    return tuple(compare_nodes(languages, estimate, runs))
