"""``volery calibrate``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from volery.base.errors import UsageError
from volery.calibration.machine import at_frequency, this_machine
from volery.calibration.ros.call_costs import CallCost, call_costs
from volery.calibration.ros.campaign import (
    LEAST_ROUNDS,
    CampaignLog,
    Conditions,
    Plan,
    Show,
    run_campaign,
    uncertain_costs,
)
from volery.calibration.ros.campaign import Progress as Rounds
from volery.calibration.ros.probe_environment import check_client, probe_setup
from volery.calibration.ros.results import format_line, plot_svg, ros_law, write_entry
from volery.cli.console import Output, table
from volery.cli.endings import FAILED, OK


@dataclass(frozen=True)
class Wanted:
    """What was asked for. ``name``: of the processor in the catalogue; empty: made from its own."""

    client: str
    out: Path
    frequency: float | None = None
    name: str = ""
    python: str = ""
    plan: Plan = field(default_factory=Plan)


def ros(output: Output, wanted: Wanted) -> int:
    """Measure, fit, write the entry and its picture; the exit status.

    1 if it was broken off, or if a figure is not known as well as was asked for.
    """
    check_client(wanted.client, wanted.python)  # before any file is made
    plan = wanted.plan
    machine = this_machine(wanted.name)
    rounds_file = wanted.out.with_name(f"{wanted.out.name}.{wanted.client}.rounds")
    with at_frequency(machine, wanted.frequency) as mhz:
        under = Conditions(wanted.client, machine.description, mhz)
        notebook = CampaignLog(rounds_file, under)
        if notebook.rounds:
            output.note(f"going on after {len(notebook.rounds)} rounds of {rounds_file}")
        whole = _measure(output, wanted, notebook)
    if len(notebook.rounds) < LEAST_ROUNDS:
        raise UsageError(
            f"{len(notebook.rounds)} rounds were measured, and {LEAST_ROUNDS} are the least: the same "
            f"command goes on from {rounds_file}"
        )
    found = call_costs(notebook.rounds)
    law = write_entry(wanted.out, machine, ros_law(found, under))
    title = f"{wanted.client} on {machine.description}, {mhz:g} MHz: {len(notebook.rounds)} rounds"
    drawn = wanted.out.with_name(f"{wanted.out.stem}-{wanted.client}.svg")
    drawn.write_text(plot_svg(found, title), encoding="utf-8")
    if whole:
        notebook.forget()
    output.show(_table(found, title))
    output.give({"processor": machine.name, "file": str(wanted.out), "law": law.model_dump(mode="json")})
    output.note(f"{wanted.out}: {machine.name}, ros.{wanted.client}, {law.validity}; {drawn}")
    if not whole:
        output.complain(
            f"broken off: these are the figures so far; the same command goes on from {rounds_file}"
        )
    loose = uncertain_costs(notebook.rounds, plan.within)
    for cost in loose:
        output.complain(
            f"{cost.call}: known to {cost.half_width:.0%} only after {len(notebook.rounds)} rounds, "
            f"{plan.within:.0%} were asked for: measure on a quiet machine, or more (--rounds)"
        )
    return OK if whole and not loose else FAILED


def _measure(output: Output, wanted: Wanted, notebook: CampaignLog) -> bool:
    """False if it was broken off by Ctrl-C."""
    try:
        with _shown(output, wanted.client) as show, probe_setup(wanted.client, wanted.python) as where:
            run_campaign(where, wanted.plan, notebook, show)
    except KeyboardInterrupt:
        return False
    return True


@contextmanager
def _shown(output: Output, client: str) -> Iterator[Show]:
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[said]}"))
    with Progress(
        *columns, TimeElapsedColumn(), console=output.notes, disable=not output.shows_progress
    ) as bar:
        task = bar.add_task(f"calibrating {client}", total=None, said="starting")

        def show(progress: Rounds) -> None:
            loose = ", ".join(f"{cost.call} ±{cost.half_width:.0%}" for cost in progress.loose[:3])
            said = f"round {progress.rounds} of at most {progress.most}{'; ' + loose if loose else ''}"
            bar.update(task, total=progress.most, completed=progress.rounds, said=said)

        yield show


def _table(found: Mapping[str, CallCost], title: str) -> Table:
    shown = table(title=title)
    for heading in ("call", "process µs", "caller µs", "known to", "quartiles", "residual"):
        shown.add_column(heading, justify="left" if heading == "call" else "right", no_wrap=True)
    for cost in found.values():
        shown.add_row(
            cost.call,
            format_line(cost.whole, cost.call),
            format_line(cost.caller, cost.call),
            f"±{cost.half_width:.0%}",
            f"±{cost.spread / 2.0:.0%}",
            f"{cost.residual:.0%}" if len(cost.points) > 1 else "",
        )
    shown.caption = "n: subscribers; ms: slept or waited; µs of CPU time"
    return shown
