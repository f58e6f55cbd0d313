"""``volery calibrate python``."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from ruamel.yaml import YAML

from volery.base.errors import UsageError
from volery.calibration.machine import at_frequency, put_law, this_machine
from volery.calibration.python.operation_costs import Calibration, calibrate
from volery.calibration.python.timed_code import Rounds, ShowRounds
from volery.cli.console import Output, figures, table
from volery.cli.endings import FAILED, OK
from volery.cost.python_operations import OPERATIONS, OperationTable, operation_table


@dataclass(frozen=True)
class Wanted:
    """What was asked for. ``name``: of the processor in the catalogue; empty: made from its own.

    ``reference``: where to write the table of operations itself.
    """

    out: Path
    frequency: float | None
    name: str
    rounds: Rounds
    reference: Path | None


def python(output: Output, wanted: Wanted) -> int:
    """Measure, show, write the entry; the exit status: 1 if something is not known as well as asked for."""
    machine = this_machine(wanted.name)
    with at_frequency(machine, wanted.frequency) as mhz, _shown(output) as tell:
        found = calibrate(wanted.rounds, tell)
    law = found.law(machine.description, mhz)
    put_law(wanted.out, machine, ("code", "python"), law, (mhz, mhz))
    if wanted.reference is not None:
        _write_reference(wanted.reference, found.table(machine.description))
    output.show(_operations(found), *_in_words(found))
    output.give({"processor": machine.name, "file": str(wanted.out), "law": law.model_dump(mode="json")})
    output.note(f"{wanted.out}: {machine.name}, code.python, {law.how_good()}")
    for name, width in list(found.loose.items())[:5]:
        output.complain(
            f"{_line(name)}: known to {width:.1%} only, {wanted.rounds.within:.1%} were asked for"
        )
    if found.loose:
        output.complain(
            f"{len(found.loose)} of {found.pieces} pieces: measure on a quiet machine, or more (--rounds)"
        )
    return FAILED if found.loose else OK


@contextmanager
def _shown(output: Output) -> Iterator[ShowRounds]:
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[said]}"))
    with Progress(
        *columns, TimeElapsedColumn(), console=output.notes, disable=not output.shows_progress
    ) as bar:
        task = bar.add_task("calibrating python", total=None, said="warming up")

        def tell(done: int, most: int, pieces: int) -> None:
            said = f"round {done + 1} of at most {most}, {pieces} pieces"
            bar.update(task, total=most, completed=done, said=said)

        yield tell


def _operations(found: Calibration) -> Table:
    shipped = operation_table().nanoseconds
    title = "What CPython's operations take here"
    shown = table("operation", "is", figures("ns"), figures("in volery's table"), title=title)
    for name, what in OPERATIONS.items():
        shown.add_row(name, what, f"{found.costs[name]:.1f}", f"{shipped[name]:.1f}")
    return shown


def _in_words(found: Calibration) -> tuple[str, str, str]:
    left = sorted(abs(error) for error in found.statements.values())
    worst = max(found.programs, key=lambda name: abs(found.programs[name]))
    return (
        f"{len(left)} statements: the costs explain half of them to {left[len(left) // 2]:.0%}, "
        f"nine in ten to {left[len(left) * 9 // 10]:.0%}",
        f"{len(found.programs)} programs take {found.in_context:.2f} times as long as their operations in "
        "loops of one statement; by what the others took, "
        f"each is off by {found.program_error:.0%} on average, {worst} by {found.programs[worst]:+.0%}",
        f"this machine takes {found.slowdown:.2f} times as long as volery's table says, "
        f"± {found.slowdown_spread:.0%} from program to program",
    )


def _line(name: str) -> str:
    return " ".join(name.split())


def _write_reference(file: Path, table: OperationTable) -> None:
    yaml = YAML()
    yaml.width = 110
    text = io.StringIO()
    yaml.dump(table.model_dump(exclude_defaults=True), text)
    head = "# What CPython's operations take, in nanoseconds: by `volery calibrate python --reference`.\n"
    try:
        file.write_text(head + text.getvalue(), encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{file} cannot be written: {error.strerror}") from error
