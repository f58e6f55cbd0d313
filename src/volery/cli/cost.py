"""``volery cost``: what compiled code costs on a processor of which there is only a catalogue entry."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.table import Column, Table
from rich.text import Text

from volery.base.errors import EstimateError, UsageError
from volery.cli.console import Output, figures, table
from volery.cli.endings import OK
from volery.cost.catalogue import Catalogue, load_catalogue
from volery.cost.code_laws import CoreLaw
from volery.cost.native.compilation import compile_program
from volery.cost.native.instrumented_run import Invocation as Run
from volery.cost.native.program_estimate import ProgramEstimate, SourceLineCost, estimate_program

TOP = 8


@dataclass(frozen=True)
class Wanted:
    """What was asked for. ``on``: ``KIND`` or ``KIND@600MHz``; ``catalogue``: what calibrating wrote."""

    sources: tuple[Path, ...]
    on: str
    run: Run
    flags: tuple[str, ...] = ()
    catalogue: Path | None = None
    listing: bool = False


def cost(output: Output, wanted: Wanted) -> int:
    """Estimate and show; the exit status."""
    law, mhz = _core(wanted)
    program = compile_program(wanted.sources, law, wanted.flags)
    found = estimate_program(program, wanted.run)
    seconds = found.seconds(mhz)
    joules = _joules(wanted, law, mhz, seconds)
    within = f", within {law.error:.0%}" if law.error else ""
    output.show(Text(f"{law.name} at {mhz:g} MHz ({law.provenance}{within})", style="bold"))
    output.show(_summary(law, mhz, found, joules), _lines(found.places[:TOP]))
    for remark in found.left_out:
        output.show(Text(f"note: {remark}", style="dim"))
    if wanted.listing:
        for source in wanted.sources:
            output.show(_listing(source, found.places))
    output.give(
        {
            "processor": law.name,
            "frequency_mhz": mhz,
            "time_s": seconds,
            "cycles": found.cycles,
            "memory_s": found.memory_ns * 1e-9,
            "instructions": found.instructions,
            "energy_j": joules,
            "provenance": law.provenance,
            "error": law.error,
            "lines": [{"source": one.source, "share": one.share} for one in found.places[:50]],
            "library_calls": found.library_calls,
            "left_out": list(found.left_out),
        }
    )
    return OK


def _core(wanted: Wanted) -> tuple[CoreLaw, float]:
    kind, _, frequency = wanted.on.partition("@")
    law = _known(wanted).processor(kind).core_law()
    text = frequency.lower().removesuffix("mhz")
    try:
        mhz = float(text) if frequency else law.greatest_mhz
    except ValueError:
        raise UsageError(f"--on {wanted.on}: a frequency such as {kind}@{law.greatest_mhz:g}MHz") from None
    law.check_frequency(mhz)
    return law, mhz


def _known(wanted: Wanted) -> Catalogue:
    return load_catalogue(*([wanted.catalogue] if wanted.catalogue else []))


def _joules(wanted: Wanted, law: CoreLaw, mhz: float, seconds: float) -> float | None:
    """What the busy core draws on top of idle, where the catalogue knows its power."""
    try:
        return _known(wanted).processor(law.name).power_law().core_w(mhz) * seconds
    except EstimateError:
        return None


def _summary(law: CoreLaw, mhz: float, found: ProgramEstimate, joules: float | None) -> Table:
    shown = table(show_header=False)
    shown.add_row("time", _si(found.seconds(mhz), "s"))
    shown.add_row("cycles", f"{found.cycles:,.0f}")
    if law.memory is not None:
        waits = f"{_si(found.memory_ns * 1e-9, 's')} of it, at any frequency"
        shown.add_row("memory", waits if found.memory_ns else "caches serve all of it")
    shown.add_row("instructions", f"{found.instructions:,.0f}  (libraries' own not counted)")
    shown.add_row("energy", "no figures of its power" if joules is None else f"{_si(joules, 'J')} above idle")
    return shown


def _lines(places: tuple[SourceLineCost, ...]) -> Table:
    listed = table(figures("cycles"), Column("line", overflow="fold"), figures("entries"), title="where")
    for one in places:
        file, _, line = one.source.rpartition(":")
        listed.add_row(f"{one.share:.1%}", f"{Path(file).name}:{line}", f"{one.entries:,}")
    return listed


def _listing(source: Path, places: tuple[SourceLineCost, ...]) -> Text:
    """The file, with the share of the cycles before each line."""
    shares = {one.source: one.share for one in places}
    listed = Text(f"\n{source}\n", no_wrap=True, overflow="ignore")
    for number, line in enumerate(source.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
        share = shares.get(f"{source.resolve()}:{number}", shares.get(f"{source}:{number}", 0.0))
        mark = f"{share:6.1%}" if share >= 0.0005 else " " * 6
        listed.append(f"{mark} ", style="yellow" if share >= 0.05 else "dim")
        listed.append(f"{number:5} {line}\n", style="" if share >= 0.0005 else "dim")
    return listed


def _si(value: float, unit: str) -> str:
    for factor, prefix in ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n")):
        if abs(value) >= factor:
            return f"{value / factor:.4g} {prefix}{unit}"
    return f"{value:.4g} {unit}"
