"""``volery runs``: what earlier runs have left, listed, reported, compared and removed."""

from __future__ import annotations

import os
import shutil
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from volery.base.errors import UsageError, did_you_mean
from volery.cli.command import OK, Commands
from volery.cli.console import Output, file_size, make_table, number_column

if TYPE_CHECKING:
    from volery.report.html_report import Recovered
    from volery.requirements.record import RunRecord

commands = Commands("runs", "List, report, compare and remove earlier runs.")

RUNS = Path("runs")
RUN_FILE, TRACE_FILE = "run.json", "trace.mcap"
UNFINISHED = "unfinished; `volery runs report` recovers it"
EMPTY = "empty"


@dataclass(frozen=True)
class Listed:
    """A run folder. ``met`` is None if no requirement was judged, ``simulated_s`` if the run has no end."""

    folder: str
    written: str
    system: str = ""
    allocation: str = ""
    scenario: str = ""
    fidelity: str = ""
    vehicles: str = ""
    outcome: str = ""
    met: bool | None = None
    simulated_s: float | None = None
    bytes: int = 0


@commands.add("json", "debug", name="runs")
@commands.add("json", "debug", name="list")
def list_runs(
    output: Output,
    folder: Annotated[Path, typer.Argument(help="Folder that contains run folders, at any depth.")] = RUNS,
) -> int:
    """List run folders with what was run, how it ended and how large they are, the newest last."""
    found = _runs_in(folder)
    listed = make_table(
        "folder", "written", "run", "vehicles", "outcome", number_column("time"), number_column("size")
    )
    for one in found:
        run = " · ".join(filter(None, (one.system, one.allocation, one.scenario, one.fidelity)))
        met = {None: "", True: ", met", False: ", not met"}[one.met]
        seconds = "-" if one.simulated_s is None else f"{one.simulated_s:.1f} s"
        outcome, size = f"{one.outcome}{met}", file_size(one.bytes)
        listed.add_row(one.folder, one.written[:-3], run or "-", one.vehicles or "-", outcome, seconds, size)
    output.show(listed if found else f"no run folder in {folder}")
    output.give([asdict(one) for one in found])
    return OK


@commands.add("debug")
def remove(
    output: Output,
    names: Annotated[list[str], typer.Argument(metavar="RUN...", help="Run folders of the list.")],
    folder: Annotated[Path, typer.Option(help="Folder that was listed.")] = RUNS,
) -> int:
    """Remove run folders, all or none of those that are named."""
    known = {one.folder: one for one in _runs_in(folder)}
    for name in (chosen := [_known_name(one, folder, known) for one in names]):
        if any(other.startswith(f"{name}/") for other in known):
            raise UsageError(f"{name}: it contains other runs; remove these first")
    for name in chosen:
        shutil.rmtree(folder if name == str(folder) else folder / name)
        output.note(f"removed {name}, {file_size(known[name].bytes)}")
    return OK


def _known_name(given: str, folder: Path, known: Mapping[str, Listed]) -> str:
    """Return the name in the list of *folder*; what a shell completes, ``runs/patrol-1/``, is one, too."""
    path = Path(given)
    below = str(path.relative_to(folder)) if path.is_relative_to(folder) else str(path)
    for name in (given, below):
        if name in known:
            return name
    raise UsageError(f"{given}: no run of that name in {folder}{did_you_mean(below, known)}")


def _runs_in(folder: Path) -> list[Listed]:
    if not folder.is_dir():
        raise UsageError(f"there is no folder {folder}; `volery simulate` and `volery fly` make ./runs")
    return sorted(_found(folder), key=lambda one: (one.written, one.folder))


def _found(folder: Path) -> Iterator[Listed]:
    for name, below, files in os.walk(folder):
        here = Path(name)
        if RUN_FILE in files or TRACE_FILE in files:
            size = sum((here / file).lstat().st_size for file in files)
            yield replace(_listed(here, folder), bytes=size)
        elif here != folder and not below and not files:
            yield Listed(_name(here, folder), _written(here), outcome=EMPTY)


def _listed(here: Path, folder: Path) -> Listed:
    from volery.requirements.record import read_record

    try:
        record = read_record(here)
    except UsageError:
        return Listed(_name(here, folder), _written(here), outcome=UNFINISHED)
    return Listed(
        _name(here, folder),
        _written(here / RUN_FILE),
        record.system,
        record.allocation,
        record.scenario,
        record.fidelity,
        ", ".join(f"{count} {name}" if count > 1 else name for name, count in _autopilots(record).items()),
        record.outcome.status,
        record.outcome.requirements_met,
        record.sim_s,
    )


def _autopilots(record: RunRecord) -> Counter[str]:
    return Counter(one.autopilot for one in record.vehicles.values())


def _name(here: Path, folder: Path) -> str:
    return str(here.relative_to(folder)) if here != folder else str(here)


def _written(path: Path) -> str:
    return datetime.fromtimestamp(path.stat().st_mtime).isoformat(" ", "seconds")


@commands.add("quiet", "json", "debug")
def report(
    output: Output,
    folder: Annotated[Path, typer.Argument(help="Run folder.")],
    notes: Annotated[
        bool, typer.Option("--notes", help="List the warnings of the run and what was not counted.")
    ] = False,
) -> int:
    """Write the report of a run again from its trace, also of one that was killed."""
    from volery.report.html_report import recover
    from volery.report.terminal import summary_table

    found = recover(folder)
    output.show(summary_table(found.record, notes=notes))
    output.give(_as_json(found))
    _note_report(output, found)
    return OK


@commands.add("quiet", "json", "debug")
def compare(
    output: Output,
    folders: Annotated[list[Path], typer.Argument(metavar="FOLDER...", help="Run folders, at least two.")],
) -> int:
    """Compare runs side by side, in the terminal and as a page in the folder that contains them."""
    from volery.report.html_report import recover, write_comparison
    from volery.report.terminal import comparison_table

    if len(folders) < 2:
        raise UsageError(f"give a second run to compare {folders[0]} with")
    found = [recover(folder) for folder in folders]
    output.show(comparison_table([one.record for one in found], [folder.name for folder in folders]))
    output.give(f"[{', '.join(map(_as_json, found))}]")
    for one in found:
        _note_report(output, one)
    common = Path(os.path.commonpath([folder.resolve().parent for folder in folders]))
    output.note(f"side by side: {write_comparison(folders, Path(os.path.relpath(common)))}")
    return OK


def _as_json(found: Recovered) -> str:
    return found.record.model_dump_json(by_alias=True, indent=2)


def _note_report(output: Output, found: Recovered) -> None:
    output.note(f"report: {found.report}")
    if found.lost:
        output.note(f"  {found.lost}")
