"""``volery response``: step responses in the records of flights."""

from __future__ import annotations

from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from volery.base.errors import UsageError
from volery.cli.command import OK, Commands
from volery.cli.console import Output, make_table, number_column
from volery.cli.options import Out

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table

    from volery.control.step_response import Signal, StepResponse

commands = Commands("Fly")

NOTHING = "–"


@commands.add("quiet", "json", "debug")
def response(
    output: Output,
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="FILE...",
            help="Run folder, rosbag, tlog, DataFlash log (.bin) or ULog (.ulg); several are compared.",
        ),
    ] = None,
    thesis: Annotated[
        bool,
        typer.Option(
            help="Fly the thesis's On/Off, P and PID laws and ours on a simulated ArduCopter, and compare."
        ),
    ] = False,
    out: Out = None,
    signal: Annotated[
        list[str] | None, typer.Option(help="Only this signal, such as yaw; may be repeated.")
    ] = None,
    step: Annotated[
        float | None,
        typer.Option(
            metavar="SIZE", help="Least size of a step; by default 5 degrees, or a tenth of the range."
        ),
    ] = None,
    measured: Annotated[
        str | None, typer.Option(metavar="TABLE.COLUMN", help="Column to judge, such as RATE.Y.")
    ] = None,
    goal: Annotated[str | None, typer.Option(metavar="TABLE.COLUMN", help="Its set-point.")] = None,
    unit: Annotated[str, typer.Option(help="Unit of these columns; deg and rad are angles.")] = "",
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the records into a .png, .svg or .pdf file.")
    ] = None,
) -> int:
    """Find the steps in records of flights; print rise time, overshoot, settling, steady error and more."""
    from volery.control.log_signals import chosen_signal, read_signals
    from volery.control.step_response import as_record, step_responses
    from volery.report.response_figure import check_format, draw_comparison, draw_records

    if plot is not None:
        check_format(plot)
    if thesis:
        return _thesis(output, out, plot)
    if not files:
        raise UsageError("give the record of a flight, or --thesis")
    if goal is not None and measured is None:
        raise UsageError(f"--goal {goal}: state --measured, too")
    judged = []
    for file in files:
        if not file.exists():
            raise UsageError(f"there is no file or folder {file}")
        found = [chosen_signal(file, measured, goal, unit)] if measured else read_signals(file)
        for one in _chosen(found, signal or [], file):
            judged.append((file, one, step_responses(one, step)))
    shown = [one for one in judged if one[2]] or judged
    output.show(*_tables(shown, several=len(files) > 1))
    output.give([{"file": str(file), **as_record(one, responses)} for file, one, responses in judged])
    if plot is not None:
        draw = draw_comparison if len(files) > 1 else draw_records
        draw([(_named(file, one, len(files) > 1), responses) for file, one, responses in shown], plot)
        output.note(f"plot: {plot}")
    return OK


def _chosen(signals: Sequence[Signal], names: Sequence[str], file: Path) -> list[Signal]:
    """Return the signals called *names*, all if there are none."""
    known = [one.name for one in signals]
    for name in names:
        if name not in known:
            raise UsageError(f"{file} has no signal {name!r}; it has {', '.join(known)}")
    return [one for one in signals if not names or one.name in names]


def _named(file: Path, signal: Signal, several: bool) -> Signal:
    """Return the signal with the name of its record, if there are several and it names no controller."""
    from dataclasses import replace

    return replace(signal, controller=file.name) if several and not signal.controller else signal


def _tables(
    judged: Sequence[tuple[Path, Signal, Sequence[StepResponse]]], *, several: bool
) -> list[Table | str]:
    """Return one table for each quantity, with the responses of all records."""
    from rich.table import Column

    from volery.control.step_response import COLUMNS

    names = list(dict.fromkeys((one.name, one.unit) for _, one, responses in judged if responses))
    shown: list[Table | str] = []
    for name, unit in names:
        same = [row for row in judged if (row[1].name, row[1].unit) == (name, unit)]
        titled = several or any(one.controller for _, one, _ in same)
        headings = [number_column(title) for title, _ in COLUMNS]
        columns = (Column("record", min_width=12, overflow="fold"), *headings) if titled else headings
        rests = all(one.goal is None for _, one, _ in same)
        what = f"{name} in {unit}" if unit else name
        title = f"{what}, times in s{', no set-point: steps to where it rests' if rests else ''}"
        table = make_table(*columns, title=title)
        table.padding = (0, 1, 0, 0)
        for file, one, responses in same:
            record = " ".join(filter(None, (file.name if several else "", one.controller)))
            for found in responses:
                cells = [_cell(found, field) for _, field in COLUMNS]
                table.add_row(*((record, *cells) if titled else cells))
        shown.append(table)
    return shown or ["no step was found; --step gives the least size of one"]


def _cell(found: StepResponse, field: str) -> str:
    value: float = getattr(found, field)
    if isnan(value):
        return "never" if field.startswith("settled") else NOTHING
    match field:
        case "overshoot":
            return f"{found.overshoot_share:.1%}"
        case "steady_error":
            return f"{found.steady_share:.1%}"
        case "size":
            return f"{value:+.3g}"
        case "iae" | "itae":
            return f"{value:.3g}"
    return f"{value:.1f}" if field == "start" else f"{value:.2f}"


def _thesis(output: Output, out: Path | None, plot: Path | None) -> int:
    from volery.cli.run_display import run_folder
    from volery.control.step_response import as_record
    from volery.report.response_figure import draw_comparison
    from volery.run.thesis_comparison import OFFSET, STEPS, THESIS, fly_thesis_comparison

    with run_folder(out, "thesis") as folder:
        flown = fly_thesis_comparison(folder)
    headings = (number_column(one) for one in ("step", "10 %", "3 %", "over", "steady", "push", "recovery"))
    table = make_table(
        "law", *headings, title="yaw in deg, times in s, on a simulated ArduCopter by RC override"
    )
    table.padding = (0, 1, 0, 0)
    for row in THESIS:
        table.add_row(
            "thesis's PID", row.steps, row.settled_10, row.settled_3, row.overshoot, NOTHING, "hand", NOTHING
        )
    for one in flown:
        for step, found in zip(STEPS, one.responses, strict=True):
            pushed = NOTHING if isnan(found.pushed) else f"{found.pushed:.0f}"
            over = f"{found.overshoot:.1f} ({_cell(found, 'overshoot')})"
            shown = (_cell(found, name) for name in ("settled_10", "settled_3"))
            table.add_row(
                one.law,
                f"{step:g}",
                *shown,
                over,
                _cell(found, "steady_error"),
                pushed,
                _cell(found, "recovery"),
            )
    output.show(table, OFFSET)
    output.give([as_record(one.signal, one.responses) for one in flown])
    if plot is not None:
        draw_comparison([(one.signal, one.responses) for one in flown], plot)
        output.note(f"plot: {plot}")
    output.note(f"runs: {folder}")
    return OK
