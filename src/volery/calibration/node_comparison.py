"""Comparison of estimated and measured CPU time of a model's nodes: Tables III and IV of the paper.

The nodes run as plain processes of rospy and roscpp on a real ROS master. A process has nothing of volery in
it but a meter that records the beginning of ``main``.

The estimate is what a simulation of the same model charges a node in the same time: ROS calls by the law of
its client library, its own code by the fidelity. The measurement is the CPU time of the node's process. The
measured ROS time is the measurement less the estimate of the node's own code.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median, quantiles

from volery.base.errors import EstimateError, UsageError
from volery.base.time import Ns, S
from volery.calibration.node_processes import MeasuredRun, NodeProgram, measurement_session, node_programs
from volery.calibration.ros.probe_environment import check_client
from volery.model.system import System
from volery.requirements.record import RunRecord
from volery.ros.transports.ros1.master import own_roscore
from volery.run.result import Options
from volery.run.simulate import simulate

TOLERANCE = 0.15
"""Allowed relative error of an estimate, unless the measured runs differ by more."""

MAX_SPREAD = 0.3
"""Greatest half of the inter-quartile range, relative to the measured time, that judges an estimate."""


@dataclass(frozen=True)
class NodeEstimate:
    """Estimated CPU time of one node, s: of ROS, of its own code; and its ROS calls by name."""

    ros_s: float
    code_s: float
    calls: Mapping[str, int]

    @property
    def whole_s(self) -> float:
        """CPU time of ROS and of its own code, s."""
        return self.ros_s + self.code_s


@dataclass(frozen=True)
class NodeComparison:
    """One node: the estimate, and the measured CPU time of each run, s."""

    node: str
    language: str
    estimate: NodeEstimate
    runs_s: tuple[float, ...]

    @property
    def measured_s(self) -> float:
        """CPU time of the median run, s."""
        return median(self.runs_s)

    @property
    def spread_s(self) -> float:
        """Inter-quartile range of the runs, s; 0 for a single run."""
        if len(self.runs_s) < 2:
            return 0.0
        low, _, high = quantiles(self.runs_s, n=4, method="inclusive")
        return high - low

    @property
    def difference(self) -> float:
        """Estimated minus measured time, relative to the measured time."""
        return (self.estimate.whole_s - self.measured_s) / self.measured_s

    @property
    def allowed(self) -> float:
        """The greater of ``TOLERANCE`` and half the spread, relative to the measured time."""
        return max(TOLERANCE, self.half_spread)

    @property
    def half_spread(self) -> float:
        """Half the inter-quartile range of the runs, relative to the measured time."""
        return self.spread_s / 2.0 / self.measured_s

    @property
    def is_conclusive(self) -> bool:
        """Whether the runs agree well enough to judge an estimate by them."""
        return self.half_spread <= MAX_SPREAD

    @property
    def holds(self) -> bool:
        """Whether the runs are conclusive and the estimate is within the allowed error."""
        return self.is_conclusive and abs(self.difference) <= self.allowed

    # -- Table IV

    @property
    def measured_ros_s(self) -> float:
        """Measured time less the estimate of the node's own code, s."""
        return max(0.0, self.measured_s - self.estimate.code_s)

    @property
    def ros_share(self) -> float:
        """Share of ROS in the measured time."""
        return self.measured_ros_s / self.measured_s

    @property
    def ros_error(self) -> float:
        """Error of the estimate of ROS time, relative to the measured ROS time."""
        if not self.measured_ros_s:
            return 0.0
        return abs(self.estimate.ros_s - self.measured_ros_s) / self.measured_ros_s

    @property
    def impact(self) -> float:
        """Effect of ``ros_error`` on the whole estimate; it is ``ros_share`` without any estimate of ROS."""
        return self.ros_share * self.ros_error

    def as_data(self) -> dict[str, object]:
        """Return the comparison as JSON data."""
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
            "conclusive": self.is_conclusive,
            "holds": self.holds,
            "ros_share": self.ros_share,
            "impact_of_ros_error": self.impact,
        }


def node_estimates(record: RunRecord, nodes: Sequence[str]) -> dict[str, NodeEstimate]:
    """Return what a simulation has charged each node."""
    found = {}
    for name in nodes:
        component = record.components[name]
        found[name] = NodeEstimate(
            component.ros_cpu_s, max(0.0, component.cpu_s - component.ros_cpu_s), component.ros_calls
        )
    return found


def compare_nodes(
    languages: Mapping[str, str], estimated: Mapping[str, NodeEstimate], runs: Sequence[Mapping[str, Ns]]
) -> list[NodeComparison]:
    """Return a comparison for each node that the runs have measured.

    Args:
        languages: Client library by node.
        estimated: Estimate by node.
        runs: CPU time by node of each run, ns; at least one run.
    """
    return [
        NodeComparison(node, languages[node], estimated[node], tuple(run[node] / S for run in runs))
        for node in runs[0]
    ]


ShowRun = Callable[[int], None]
"""Called with the number of completed runs."""


def prepare_nodes(system: System) -> tuple[NodeProgram, ...]:
    """Return the nodes of a system, ready to start.

    Raises:
        ModelError: A component is not a node of rospy or roscpp.
        UsageError: No node is measured, or ROS or a compiler is missing.
    """
    if not any(instance.processor for instance in system.instances):
        raise UsageError("the model has no node that runs on a processor, so there is nothing to measure")
    for language in sorted({instance.component.language for instance in system.instances}):
        if language in ("rospy", "roscpp"):
            check_client(language)
    return node_programs(system)


def measure_runs(
    nodes: Sequence[NodeProgram], count: int, duration: Ns, show: ShowRun = lambda done: None
) -> tuple[list[MeasuredRun], bool]:
    """Measure ``count`` runs on a ROS master of their own.

    Args:
        nodes: The nodes, from ``prepare_nodes``.
        count: Number of runs.
        duration: Duration of a run after the nodes' start, ns.
        show: Called before each run.

    Returns:
        The runs, and False if Ctrl-C has ended the measurement early.
    """
    done: list[MeasuredRun] = []
    try:
        with own_roscore() as core, measurement_session(nodes, core.uri, duration) as run:
            for number in range(count):
                show(number)
                done.append(run())
    except KeyboardInterrupt:
        return done, False
    return done, True


def estimate_nodes(system: System, fidelity: str = "code") -> dict[str, NodeEstimate]:
    """Return what a simulation of a system charges its nodes.

    Raises:
        EstimateError: The simulation fails.
    """
    run = simulate(system, Options(fidelity=fidelity))
    if not run.completed:
        reason = run.error or run.record.outcome.reason
        raise EstimateError(f"the simulation that estimates {system.name} failed: {reason}")
    return node_estimates(
        run.record, [instance.name for instance in system.instances if not instance.is_environment]
    )


def compare(
    system: System, estimate: Mapping[str, NodeEstimate], runs: Sequence[MeasuredRun]
) -> tuple[NodeComparison, ...]:
    """Compare each node's estimate with the measured runs.

    Args:
        system: The system whose nodes were measured.
        estimate: Estimate by node, from ``estimate_nodes``.
        runs: Runs from ``measure_runs``.

    Raises:
        UsageError: There is no run.
    """
    if not runs:
        raise UsageError("no run was measured to its end")
    languages = {instance.name: instance.component.language for instance in system.instances}
    return tuple(compare_nodes(languages, estimate, runs))
