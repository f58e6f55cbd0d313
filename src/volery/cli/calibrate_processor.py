"""``volery calibrate processor``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Table

from volery.calibration.machine import put_law, this_machine
from volery.calibration.processor.core_fit import core_law
from volery.calibration.processor.microbenchmarks import isa, measure, noisy_snippets
from volery.cli.console import Output, figures, table
from volery.cli.endings import FAILED, OK
from volery.cost.code_laws import CoreLaw


@dataclass(frozen=True)
class Wanted:
    """What was asked for. ``name``: of the core in the file; empty: made from the processor's own."""

    out: Path
    name: str = ""


def processor(output: Output, wanted: Wanted) -> int:
    """Measure and write; the exit status, 1 if a figure is not tight."""
    machine, here = this_machine(wanted.name), isa()
    notes = wanted.out.with_name(f"{wanted.out.name}.notes")
    bar = Progress(TextColumn("{task.description}"), BarColumn(), console=output.notes)
    bar.disable = not output.shows_progress
    with bar:
        line = bar.add_task("building")
        taken = measure(
            notes, lambda name, done, whole: bar.update(line, description=name, completed=done, total=whole)
        )
    law = core_law(machine, here, taken)
    put_law(
        wanted.out,
        machine,
        ("core_model",),
        law.model_copy(update={"name": ""}),
        (law.least_mhz, law.greatest_mhz),
    )
    notes.unlink(missing_ok=True)
    output.show(_table(law))
    output.give(law.model_dump())
    output.note(f"{law.name} in {wanted.out}: volery cost FILE --on {law.name} --catalogue {wanted.out}")
    noisy = noisy_snippets(taken)
    if noisy:
        output.note(f"not tight, the machine was busy: {', '.join(noisy)}")
    return FAILED if noisy else OK


def _table(law: CoreLaw) -> Table:
    title = f"{law.name} at {law.greatest_mhz:g} MHz"
    shown = table("operation", figures("cycles"), figures("starts per cycle"), title=title)
    for name, one in law.operations.items():
        shown.add_row(name, f"{one.latency:g}", f"{one.per_cycle:g}")
    if law.memory is not None:
        for level, cache in enumerate(law.memory.caches, 1):
            shown.add_row(f"load from cache {level}, {cache.bytes >> 10} KiB", f"{cache.latency:g}", "")
        shown.add_row(
            "load from memory", f"{law.memory.latency_ns:g} ns", f"{law.memory.bytes_per_ns:g} GB/s"
        )
    return shown
