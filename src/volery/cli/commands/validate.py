"""``volery validate``: estimated against measured execution times of a model's nodes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer
from rich.status import Status
from rich.table import Column, Table
from rich.text import Text

from volery.base.errors import UsageError
from volery.base.extras import require_extra
from volery.base.time import from_seconds, to_seconds
from volery.cli.command import FAILED, OK, Commands
from volery.cli.console import Output, make_table, number_column
from volery.cli.options import Allocation, Fidelity, Model, Overrides, Scenario

if TYPE_CHECKING:
    from volery.calibration.validation.node_comparison import NodeComparison, ShowRun
    from volery.model.system import System

commands = Commands("Cost of computing")


@commands.add("quiet", "json", "debug")
def validate(
    output: Output,
    model: Model,
    runs: Annotated[int, typer.Option(help="Number of runs; medians and quartiles are shown.")] = 10,
    seconds: Annotated[
        float | None, typer.Option(help="Duration of each run; by default that of the model.")
    ] = None,
    fidelity: Fidelity = "code",
    allocation: Allocation = None,
    scenario: Scenario = None,
    overrides: Overrides = None,
) -> int:
    """Run a model's nodes on real ROS, measure their CPU time and compare it with the estimate.

    For models whose components are nodes of rospy or roscpp, on a processor that `volery calibrate` has
    measured. Exit status: 0 if every estimate is within 15 %, or within half the quartiles of the runs, which
    must be at most 30 %; 2 for bad input; 1 otherwise.
    """
    require_extra("simulation", "estimates")
    from volery.calibration.validation.node_comparison import (
        MAX_SPREAD,
        compare,
        estimate_nodes,
        measure_runs,
        prepare_nodes,
    )
    from volery.model.system_loader import load
    from volery.run.assembly.vocabulary import vocabulary

    if runs < 1:
        raise UsageError(f"--runs {runs}: give at least 1")
    if seconds is not None and not seconds > 0.0:
        raise UsageError(f"--seconds {seconds:g}: give a number above 0")
    system = load(model, vocabulary(), scenario, allocation, overrides or ())
    if seconds is not None:
        limits = replace(system.limits, duration_ns=from_seconds(seconds), until=None)
        system = replace(system, limits=limits)
    duration = system.limits.duration_ns
    with _status(output, runs, to_seconds(duration)) as show:
        estimate = estimate_nodes(system, fidelity)
        nodes = prepare_nodes(system)
        done, complete = measure_runs(nodes, runs, duration, show)
    found = compare(system, estimate, done)
    output.show(*comparison_tables(found, system))
    output.give({"system": system.name, "nodes": [one.as_data() for one in found], "complete": complete})
    if not complete:
        output.complain(f"interrupted after {len(done)} of {runs} runs")
    far = [one for one in found if not one.holds]
    for one in far:
        if one.is_conclusive:
            output.complain(
                f"{one.node}: the estimate is {one.difference:+.0%} off; allowed are {one.allowed:.0%}"
            )
        else:
            output.complain(
                f"{one.node}: the runs differ by ±{one.half_spread:.0%} (quartiles), which says nothing of "
                f"the estimate; up to ±{MAX_SPREAD:.0%} does: use a quiet machine, longer or more runs"
            )
    return OK if complete and not far else FAILED


@contextmanager
def _status(output: Output, runs: int, seconds: float) -> Iterator[ShowRun]:
    if not output.shows_progress:
        yield lambda done: None
        return
    with Status("compiling and starting", console=output.notes) as status:
        yield lambda done: status.update(f"run {done + 1} of {runs}, {seconds:g} s each")


def comparison_tables(found: Sequence[NodeComparison], system: System) -> Iterator[Table | Text]:
    """Yield the CPU time of each node, estimated and measured, and the value of estimating ROS calls."""
    host = ", ".join(f"{one.kind} at {one.frequency_mhz:g} MHz" for one in system.processors)
    seconds = to_seconds(system.limits.duration_ns)
    yield Text(f"{system.name}: CPU time of each node in {seconds:g} s; estimated for {host}", style="bold")
    yield _cpu_time_table(found)
    yield _ros_share_table(found)


def _cpu_time_table(found: Sequence[NodeComparison]) -> Table:
    shown = _node_table("estimated ms", "of it ROS", "measured ms", "quartiles", "difference", "allowed", "")
    for one in found:
        shown.add_row(
            one.node,
            _ms(one.estimate.whole_s),
            _ms(one.estimate.ros_s),
            _ms(one.measured_s),
            f"±{one.half_spread:.0%}",
            f"{one.difference:+.1%}",
            f"{one.allowed:.0%}",
            _verdict(one),
        )
    return shown


def _verdict(one: NodeComparison) -> Text:
    if not one.is_conclusive:
        return Text("too noisy", style="bold yellow")
    return Text("holds", style="green") if one.holds else Text("too far", style="bold red")


def _ros_share_table(found: Sequence[NodeComparison]) -> Table:
    shown = _node_table("total ms", "ROS", "error of the estimate", "error without one", "improvement")
    for one in found:
        better = f"{1.0 - one.impact / one.ros_share:.1%}" if one.ros_share else ""
        share = f"{one.ros_share:.1%}"
        shown.add_row(one.node, _ms(one.measured_s), share, f"{one.impact:.1%}", share, better)
    return shown


def _node_table(*headings: str) -> Table:
    return make_table(Column("node", no_wrap=True), *map(number_column, headings))


def _ms(seconds: float) -> str:
    return f"{seconds * 1e3:.2f}"
