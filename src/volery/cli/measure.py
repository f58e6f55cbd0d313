"""``volery measure``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from rich.status import Status
from rich.table import Column, Table
from rich.text import Text

from volery.base.errors import UsageError
from volery.base.time import from_seconds, to_seconds
from volery.calibration.validation.comparison import (
    NodeComparison,
    ShowRun,
    compare,
    estimate_nodes,
    measure_runs,
    prepare_nodes,
)
from volery.cli.console import Output, figures, table
from volery.cli.endings import FAILED, OK
from volery.model.reader import load
from volery.model.system import System
from volery.run.assembly.vocabulary import vocabulary


@dataclass(frozen=True)
class Wanted:
    """What was asked for. ``seconds``: of each run; ``None``: as long as the model says."""

    model: Path
    runs: int
    seconds: float | None
    fidelity: str
    allocation: str | None
    scenario: str | None
    overrides: tuple[str, ...]


def measure(output: Output, wanted: Wanted) -> int:
    """Measure, estimate, show both; the exit status.

    1 if it was broken off or if an estimate is further off than is allowed.
    """
    if wanted.runs < 1:
        raise UsageError(f"--runs {wanted.runs}: at least one is needed")
    system = load(wanted.model, vocabulary(), wanted.scenario, wanted.allocation, wanted.overrides)
    system = _lasting(system, wanted.seconds)
    duration = system.limits.duration_ns
    with _shown(output, wanted.runs, to_seconds(duration)) as show:
        estimate = estimate_nodes(system, wanted.fidelity)
        nodes = prepare_nodes(system)
        done, whole = measure_runs(nodes, wanted.runs, duration, show)
    found = compare(system, estimate, done)
    output.show(*tables(found, system))
    output.give({"system": system.name, "nodes": [one.as_data() for one in found], "complete": whole})
    if not whole:
        output.complain(f"broken off after {len(done)} of {wanted.runs} runs")
    far = [one for one in found if not one.holds]
    for one in far:
        output.complain(
            f"{one.node}: the estimate is {one.difference:+.0%} off; {one.allowed:.0%} would be allowed"
        )
    return OK if whole and not far else FAILED


def _lasting(system: System, seconds: float | None) -> System:
    if seconds is None:
        return system
    if seconds <= 0.0:
        raise UsageError(f"--seconds {seconds:g}: a run lasts longer than nothing")
    return replace(system, limits=replace(system.limits, duration_ns=from_seconds(seconds), until=None))


@contextmanager
def _shown(output: Output, runs: int, seconds: float) -> Iterator[ShowRun]:
    if not output.shows_progress:
        yield lambda done: None
        return
    with Status("compiling and starting", console=output.notes) as status:
        yield lambda done: status.update(f"run {done + 1} of {runs}, {seconds:g} s each")


def tables(found: Sequence[NodeComparison], system: System) -> Iterator[Table | Text]:
    """Table III, a line each node, and Table IV."""
    host = ", ".join(f"{one.kind} at {one.frequency_mhz:g} MHz" for one in system.processors)
    seconds = to_seconds(system.limits.duration_ns)
    yield Text(f"{system.name}: CPU time of each node in {seconds:g} s; estimated for {host}", style="bold")
    yield _table_iii(found)
    yield _table_iv(found)


def _table_iii(found: Sequence[NodeComparison]) -> Table:
    shown = _table(
        "node", "estimated ms", "of it ROS", "measured ms", "quartiles", "difference", "allowed", ""
    )
    for one in found:
        shown.add_row(
            one.node,
            _ms(one.estimate.whole_s),
            _ms(one.estimate.ros_s),
            _ms(one.measured_s),
            f"±{one.spread_s / 2.0 / one.measured_s:.0%}",
            f"{one.difference:+.1%}",
            f"{one.allowed:.0%}",
            Text("holds", style="green") if one.holds else Text("too far", style="bold red"),
        )
    return shown


def _table_iv(found: Sequence[NodeComparison]) -> Table:
    shown = _table("node", "total ms", "ROS", "its error costs", "no estimate costs", "improvement")
    for one in found:
        better = f"{1.0 - one.impact / one.ros_share:.1%}" if one.ros_share else ""
        shown.add_row(
            one.node, _ms(one.measured_s), f"{one.ros_share:.1%}", f"{one.impact:.1%}",
            f"{one.ros_share:.1%}", better,
        )  # fmt: skip
    return shown


def _table(first: str, *others: str) -> Table:
    return table(Column(first, no_wrap=True), *map(figures, others))


def _ms(seconds: float) -> str:
    return f"{seconds * 1e3:.2f}"
