"""``volery cost``, ``profile`` and ``validate``: cost of compiled code on another core, and its error."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.status import Status
from rich.table import Column, Table
from rich.text import Text

from volery.base.errors import EstimateError, UsageError
from volery.base.installed import require_extra
from volery.base.time import from_seconds, to_seconds
from volery.cli.command import FAILED, OK, Commands
from volery.cli.console import CommandOutput, make_table, number_column
from volery.cli.options import Allocation, Fidelity, Model, Overrides, Scenario, Seed

if TYPE_CHECKING:
    from volery.calibration.component_profile import ComponentProfile
    from volery.calibration.node_comparison import NodeComparison, ShowRun
    from volery.cost import Catalogue, CoreLaw
    from volery.cost.native import ProgramEstimate, SourceLineCost
    from volery.model.system import System

commands = Commands("cost", "Estimate what code costs on another processor; calibrate, profile, validate.")

TOP = 8
"""Number of source lines in the table."""
VISIBLE_SHARE, HIGH_SHARE = 0.0005, 0.05
"""Shares of the cycles from which on a line of the listing is marked."""


@commands.add("quiet", "json", "debug")
def cost(
    output: CommandOutput,
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Sources in C or C++.")],
    on: Annotated[
        str,
        typer.Option(
            metavar="KIND[@MHZ]", help="Processor, such as rpi4-cortex-a72@600MHz or intel-i5-3470."
        ),
    ] = "rpi4-cortex-a72",
    entry: Annotated[
        str,
        typer.Option(metavar="CALL", help="Function to call, such as 'step(3, 0.5)'; by default main."),
    ] = "",
    before: Annotated[
        list[str] | None,
        typer.Option(metavar="CALL", help="Call to make first without counting it; may be repeated."),
    ] = None,
    argument: Annotated[
        list[str] | None, typer.Option("--arg", help="Argument for main; may be repeated.")
    ] = None,
    flag: Annotated[
        list[str] | None, typer.Option(help="Compiler flag, such as -Iinclude; may be repeated.")
    ] = None,
    link: Annotated[
        list[str] | None, typer.Option(help="Linker flag, such as -lpthread; may be repeated.")
    ] = None,
    catalogue: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Catalogue that `volery cost calibrate processor` wrote."),
    ] = None,
    listing: Annotated[
        bool, typer.Option("--listing", help="Show the sources with each line's share of the cycles.")
    ] = False,
) -> int:
    """Estimate what C or C++ code costs on another processor.

    The code runs once on this machine and its basic blocks are counted. Each block costs what a model of the
    processor's core computes for it. The result is time, cycles, instructions, energy, the most expensive
    lines, and what is left out. Needs LLVM (Debian: clang-19 and llvm-19).
    """
    require_extra("simulation", "estimates")
    from volery.cost import load_catalogue
    from volery.cost.native import Invocation, compile_program, estimate_program

    known = load_catalogue(*([catalogue] if catalogue else []))
    law, mhz = _core_law(known, on)
    program = compile_program(files, law, flag or ())
    invocation = Invocation(entry, tuple(before or ()), tuple(argument or ()), tuple(link or ()))
    found = estimate_program(program, invocation)
    try:  # what the busy core draws above idle
        joules: float | None = known.processor(law.name).power_law().core_w(mhz) * found.seconds(mhz)
    except EstimateError:
        joules = None
    within = f", within {law.error:.0%}" if law.error else ""
    output.show(Text(f"{law.name} at {mhz:g} MHz ({law.provenance}{within})", style="bold"))
    output.show(_estimate_table(law, mhz, found, joules), _line_table(found.places[:TOP]))
    for remark in found.left_out:
        output.show(Text(f"note: {remark}", style="dim"))
    if listing:
        for source in files:
            output.show(_listing(source, found.places))
    output.give(_as_data(law, mhz, found, joules))
    return OK


def _core_law(known: Catalogue, on: str) -> tuple[CoreLaw, float]:
    """Return the law of the core and the frequency [MHz] that ``KIND[@MHZ]`` names."""
    kind, _, frequency = on.partition("@")
    law = known.processor(kind).core_law()
    text = frequency.lower().removesuffix("mhz")
    try:
        mhz = float(text) if frequency else law.greatest_mhz
    except ValueError:
        raise UsageError(f"--on {on}: give a frequency such as {kind}@{law.greatest_mhz:g}MHz") from None
    law.check_frequency(mhz)
    return law, mhz


def _as_data(law: CoreLaw, mhz: float, found: ProgramEstimate, joules: float | None) -> dict[str, object]:
    return {
        "processor": law.name,
        "frequency_mhz": mhz,
        "time_s": found.seconds(mhz),
        "cycles": found.cycles,
        "memory_s": found.memory_ns * 1e-9,
        "instructions": found.instructions,
        "energy_j": joules,
        "provenance": law.provenance,
        "error": law.error,
        "measured_over_estimate": [found.band.low, found.band.high],
        "lines": [{"source": one.source, "share": one.share} for one in found.places[:50]],
        "library_calls": found.library_calls,
        "left_out": list(found.left_out),
    }


def _estimate_table(law: CoreLaw, mhz: float, found: ProgramEstimate, joules: float | None) -> Table:
    shown = make_table(show_header=False)
    shown.add_row("time", _si(found.seconds(mhz), "s"))
    shown.add_row("", f"measured were {found.band}")
    shown.add_row("cycles", f"{found.cycles:,.0f}")
    if law.memory is not None:
        waits = f"{_si(found.memory_ns * 1e-9, 's')} of the time, at any frequency"
        shown.add_row("memory", waits if found.memory_ns else "all accesses hit the caches")
    shown.add_row("instructions", f"{found.instructions:,.0f}  (without those of libraries)")
    shown.add_row(
        "energy", "unknown: no power figures" if joules is None else f"{_si(joules, 'J')} above idle"
    )
    return shown


def _line_table(places: tuple[SourceLineCost, ...]) -> Table:
    listed = make_table(
        number_column("cycles"), Column("line", overflow="fold"), number_column("entries"), title="where"
    )
    for one in places:
        file, _, line = one.source.rpartition(":")
        listed.add_row(f"{one.share:.1%}", f"{Path(file).name}:{line}", f"{one.entries:,}")
    return listed


def _listing(source: Path, places: tuple[SourceLineCost, ...]) -> Text:
    """Return the file with the share of the cycles before each line."""
    shares = {one.source: one.share for one in places}
    listed = Text(f"\n{source}\n", no_wrap=True, overflow="ignore")
    for number, line in enumerate(source.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
        share = shares.get(f"{source.resolve()}:{number}", shares.get(f"{source}:{number}", 0.0))
        mark = f"{share:6.1%}" if share >= VISIBLE_SHARE else " " * 6
        listed.append(f"{mark} ", style="yellow" if share >= HIGH_SHARE else "dim")
        listed.append(f"{number:5} {line}\n", style="" if share >= VISIBLE_SHARE else "dim")
    return listed


def _si(value: float, unit: str) -> str:
    for factor, prefix in ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n")):
        if abs(value) >= factor:
            return f"{value / factor:.4g} {prefix}{unit}"
    return f"{value:.4g} {unit}"


@commands.add("quiet", "json", "debug")
def profile(
    output: CommandOutput,
    model: Model,
    seed: Seed = 1,
    allocation: Allocation = None,
    scenario: Scenario = None,
    overrides: Overrides = None,
) -> int:
    """Profile a model's C++ components on the cores that they are allocated to.

    The model runs once while the components record which basic blocks they enter. A model of the core
    computes the cost of each block from this trace. The costs are stored with the compiled code: later runs
    at fidelity `code` charge them, until the code changes. Needs LLVM (Debian: clang-19 and llvm-19).
    """
    require_extra("simulation", "profiles")
    from volery.calibration.component_profile import profile_components
    from volery.cli.run_display import run_progress
    from volery.model.system_loader import load
    from volery.run.assembly.component_builder import with_executables
    from volery.run.assembly.model_checks import vocabulary
    from volery.run.result import Options

    system = with_executables(load(model, vocabulary(), scenario, allocation, overrides or ()))
    with run_progress(output, f"{system.name}, traced") as show:
        profiles, run = profile_components(system, Options(seed=seed, show=show, tell=output.note))
    output.show(_profile_table(profiles))
    output.give([asdict(one) for one in profiles])
    if run.error is not None:
        output.complain(f"volery: the profiled run failed: {run.error}")
        return FAILED
    return OK


def _profile_table(profiles: Sequence[ComponentProfile]) -> Table:
    listed = make_table(
        "component", "core", number_column("blocks"), number_column("profiled"), number_column("followed")
    )
    for one in profiles:
        listed.add_row(
            f"{one.component} ({', '.join(one.instances)})",
            one.core,
            f"{one.blocks:,}",
            f"{one.met:,}",
            f"{one.followed:.1%} of {one.entered:,}",
        )
    return listed


@commands.add("quiet", "json", "debug")
def validate(
    output: CommandOutput,
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

    For models whose components are nodes of rospy or roscpp, on a processor that `volery cost calibrate` has
    measured. Exit status: 0 if every estimate is within 15 %, or within half the quartiles of the runs, which
    must be at most 30 %; 2 for bad input; 1 otherwise.
    """
    require_extra("simulation", "estimates")
    from volery.calibration.node_comparison import (
        MAX_SPREAD,
        compare,
        estimate_nodes,
        measure_runs,
        prepare_nodes,
    )
    from volery.model.system_loader import load
    from volery.run.assembly.component_builder import with_executables
    from volery.run.assembly.model_checks import vocabulary

    if runs < 1:
        raise UsageError(f"--runs {runs}: give at least 1")
    if seconds is not None and not seconds > 0.0:
        raise UsageError(f"--seconds {seconds:g}: give a number above 0")
    system = with_executables(load(model, vocabulary(), scenario, allocation, overrides or ()))
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
def _status(output: CommandOutput, runs: int, seconds: float) -> Iterator[ShowRun]:
    if not output.shows_progress:
        yield lambda done: None
        return
    with Status("compiling and starting", console=output.notes) as status:
        yield lambda done: status.update(f"run {done + 1} of {runs}, {seconds:g} s each")


def comparison_tables(found: Sequence[NodeComparison], system: System) -> Iterator[Table | Text]:
    """Yield the CPU time of each node, estimated and measured, and the value of estimating ROS calls."""
    host = ", ".join(
        f"{processor.kind} at {processor.frequency_mhz:g} MHz" for processor in system.processors
    )
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
