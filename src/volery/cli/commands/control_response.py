"""``volery control response``: step responses in the records of flights."""

from __future__ import annotations

from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from volery.base.errors import UsageError
from volery.cli.command import OK, Commands
from volery.cli.console import CommandOutput, make_table, number_column
from volery.cli.options import Out

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table

    from volery.control.step_response import ControlledSignal, Judgement, StepResponse

commands = Commands("control")

NOTHING = "–"


@commands.add("quiet", "json", "debug")
def response(
    output: CommandOutput,
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
    from volery.control.step_response import as_record, judged
    from volery.report.response_figure import check_format, draw_comparison, draw_records

    if plot is not None:
        check_format(plot)
    if thesis:
        return _thesis(output, out, plot)
    if not files:
        raise UsageError("give the record of a flight, or --thesis")
    if goal is not None and measured is None:
        raise UsageError(f"--goal {goal}: state --measured, too")
    found: list[tuple[Path, ControlledSignal, Judgement]] = []
    for file in files:
        if not file.exists():
            raise UsageError(f"there is no file or folder {file}")
        read = [chosen_signal(file, measured, goal, unit)] if measured else read_signals(file)
        found += [(file, one, judged(one, step)) for one in _chosen(read, signal or [], file)]
    several = len(files) > 1
    shown = [(file, one, result.responses) for file, one, result in found if result.responses]
    output.show(*_tables(shown, several=several))
    output.show(*_not_judged(found, several=several))
    output.give([{"file": str(file), **as_record(one, *result)} for file, one, result in found])
    if plot is not None:
        draw = draw_comparison if several else draw_records
        drawn = shown or [(file, one, result.responses) for file, one, result in found]
        draw([(_named(file, one, several), responses) for file, one, responses in drawn], plot)
        output.note(f"plot: {plot}")
    return OK


def _chosen(signals: Sequence[ControlledSignal], names: Sequence[str], file: Path) -> list[ControlledSignal]:
    """Return the signals called *names*, all if there are none."""
    known = [signal.name for signal in signals]
    for name in names:
        if name not in known:
            raise UsageError(f"{file} has no signal {name!r}; it has {', '.join(known)}")
    return [signal for signal in signals if not names or signal.name in names]


def _named(file: Path, signal: ControlledSignal, several: bool) -> ControlledSignal:
    """Return the signal with the name of its record, if there are several and it names no controller."""
    from dataclasses import replace

    return replace(signal, controller=file.name) if several and not signal.controller else signal


WIDEST_NAME = 8
"""Characters of a record's name that stand beside its figures; longer ones are numbered, and listed below."""


def _tables(
    judged: Sequence[tuple[Path, ControlledSignal, Sequence[StepResponse]]], *, several: bool
) -> list[Table | Text | str]:
    """Return one table for each quantity, with the responses of all records, for 80 characters."""
    from volery.control.step_response import COLUMNS

    names = list(dict.fromkeys((one.name, one.unit) for _, one, _ in judged))
    shown: list[Table | Text | str] = []
    labels: dict[str, str] = {}
    for name, unit in names:
        same = [row for row in judged if (row[1].name, row[1].unit) == (name, unit)]
        titled = several or any(one.controller for _, one, _ in same)
        known = [
            (title, field)
            for title, field in COLUMNS
            if any(not isnan(getattr(found, field)) for _, _, all_found in same for found in all_found)
            or field.startswith("settled")
        ]
        ramps = any(found.ramp for _, _, all_found in same for found in all_found)
        headings = [number_column(title) for title, _ in known]
        if ramps:
            headings.insert(2, number_column("ramp"))
        table = make_table(*(["of", *headings] if titled else headings))
        table.padding = (0, 1, 0, 0)
        for file, one, responses in same:
            record = " ".join(filter(None, (file.name if several else "", one.controller)))
            if len(record) > WIDEST_NAME:
                record = labels.setdefault(record, str(len(labels) + 1))
            for found in responses:
                cells = [_cell(found, field) for _, field in known]
                if ramps:
                    cells.insert(2, f"{found.ramp:.1f}" if found.ramp else NOTHING)
                table.add_row(*((Text(record), *cells) if titled else cells))
        shown += [_title(name, unit, same), table]
    shown += [Text(f"{label}: {record}") for record, label in labels.items()]
    return shown or ["no step was found; --step gives the least size of one"]


def _title(
    name: str, unit: str, same: Sequence[tuple[Path, ControlledSignal, Sequence[StepResponse]]]
) -> Text:
    """Return what a table is about, and by how much its steps may be dated too late."""
    about = [f"{name} in {unit}" if unit else name, "times in s"]
    late = max(found.resolution for _, _, responses in same for found in responses)
    if late > 0.0:
        about.append(f"from the set-point's report, up to {late:.2f} s after it was sent")
    if all(one.goal is None for _, one, _ in same):
        about.append("no set-point: steps to where it rests")
    return Text(", ".join(about), "bold")


def _not_judged(judged: Sequence[tuple[Path, ControlledSignal, Judgement]], *, several: bool) -> list[Text]:
    """Return a line for each reason for which changes of set-points were not judged."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for file, one, result in judged:
        record = f"{file.name} {one.name}" if several else one.name
        for left in result.not_judged:
            reasons.setdefault((record, left.why), []).append(f"{left.start:.1f}")
    lines: dict[tuple[str, str], list[str]] = {}
    for (record, why), times in reasons.items():
        more = f" and {len(times) - MOST_TIMES} more" if len(times) > MOST_TIMES else ""
        lines.setdefault((f"{', '.join(times[:MOST_TIMES])} s{more}", why), []).append(record)
    return [
        Text(f"not judged: {', '.join(records)} at {times}: {why}") for (times, why), records in lines.items()
    ]


MOST_TIMES = 6
"""Times of changes that one reason lists."""


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


def _thesis(output: CommandOutput, out: Path | None, plot: Path | None) -> int:
    from volery.cli.run_display import run_folder
    from volery.control.step_response import as_record
    from volery.report.response_figure import draw_comparison
    from volery.run.thesis_comparison import OFFSET, STEPS, THESIS, fly_thesis_comparison

    with run_folder(out, "thesis") as folder:
        flown = fly_thesis_comparison(folder)
    headings = (number_column(one) for one in ("step", "10 %", "3 %", "over", "steady", "push", "back"))
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
            over = f"{found.overshoot:.1f} ({found.overshoot_share:.0%})"
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
