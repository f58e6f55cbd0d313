"""``volery runs``: what earlier runs have left, listed, reported, compared and removed."""

from __future__ import annotations

import os
import re
import shutil
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from volery.base.errors import UsageError, did_you_mean
from volery.cli.command import OK, Commands
from volery.cli.console import CommandOutput, file_size, make_table, number_column
from volery.cli.options import Seed

if TYPE_CHECKING:
    from rich.console import RenderableType

    from volery.report.comparison_page import Comparison
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
    output: CommandOutput,
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
    output: CommandOutput,
    names: Annotated[list[str], typer.Argument(metavar="RUN...", help="Run folders of the list.")],
    folder: Annotated[Path, typer.Option(help="Folder that was listed.")] = RUNS,
) -> int:
    """Remove run folders, all or none of those that are named."""
    known = {one.folder: one for one in _runs_in(folder)}
    for name in (chosen := [_known_name(name, folder, known) for name in names]):
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
    return Counter(vehicle.autopilot for vehicle in record.vehicles.values())


def _name(here: Path, folder: Path) -> str:
    return str(here.relative_to(folder)) if here != folder else str(here)


def _written(path: Path) -> str:
    return datetime.fromtimestamp(path.stat().st_mtime).isoformat(" ", "seconds")


@commands.add("quiet", "json", "debug")
def report(
    output: CommandOutput,
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


ADDRESS = re.compile(r"[A-Za-z][\w.-]*(\+\w+)?:")
MOST_PHASES, MOST_ROWS = 40, 12
"""Rows of the tables of phases, and of each one of answers or texts, that the terminal shows."""


@commands.add("quiet", "json", "debug")
def compare(
    output: CommandOutput,
    records: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="RECORD...",
            help="Run folders, tlogs, DataFlash logs or ULogs, at least two; with `--between` the mission "
            "that is flown on an address.",
        ),
    ] = None,
    between: Annotated[
        tuple[str, str] | None,
        typer.Option(
            metavar="A B",
            help="Compare two, each an address such as sim:px4, on which the mission is flown first, a run "
            "folder or a log.",
        ),
    ] = None,
    within: Annotated[
        float, typer.Option(metavar="METRES", help="Distance between the ways of phases that are alike.")
    ] = 2.0,
    seed: Seed = 1,
) -> int:
    """Compare runs and flight logs side by side and phase by phase, in the terminal and as a page.

    The page is written into the folder that contains the run folders, of logs alone into the current one.
    Exit status: 0, however they differ.
    """
    from volery.report.comparison_page import Comparison, Side, read_side
    from volery.report.html_report import recover

    if not within > 0.0:
        raise UsageError(f"--within {within:g}: give a distance in metres above 0")
    given = records or []
    names = _checked_sides(given, between)
    sides: dict[int, Side] = {}
    for number, name in enumerate(names):
        if not _is_address(name):
            sides[number] = read_side(Path(name))
    for number, name in enumerate(names):
        if number not in sides:
            sides[number] = read_side(_fly(output, Path(given[0]), name, seed), name)
    compared = Comparison([sides[number] for number in range(len(names))], within)
    output.show(*_shown(compared))
    output.give(compared.plain())
    folders = [side.path for side in compared.sides if side.record is not None]
    for folder in folders:
        _note_report(output, recover(folder))
    common = os.path.commonpath([folder.resolve().parent for folder in folders]) if folders else Path.cwd()
    output.note(f"side by side: {compared.write(Path(os.path.relpath(common)))}")
    return OK


def _is_address(name: str) -> bool:
    return ADDRESS.match(name) is not None and not Path(name).exists()


def _checked_sides(given: Sequence[str], between: tuple[str, str] | None) -> Sequence[str]:
    """Return what is compared, once nothing is missing that a flight would need.

    Raises:
        UsageError: A side or the mission is missing, is none, or is too many.
    """
    for name in between or given:
        if not _is_address(name) and not Path(name).exists():
            raise UsageError(
                f"there is no {name!r}; give a run folder, a flight log or an address as sim:px4"
            )
    if between is not None:
        _check_mission(given, [name for name in between if _is_address(name)])
        return between
    for name in given:
        if _is_address(name) or name.endswith(".py"):
            hint = "volery runs compare MISSION.py --between sim:px4 sim:ardupilot"
            raise UsageError(f"{name} is to be flown: write `{hint}`")
    if len(given) < 2:
        raise UsageError(
            f"give a second run or log to compare {given[0]} with"
            if given
            else "give two run folders or flight logs, or a mission and --between ADDRESS ADDRESS"
        )
    return given


def _check_mission(given: Sequence[str], addresses: Sequence[str]) -> None:
    """Raise ``UsageError`` unless there is one mission for the addresses, and none without an address."""
    from volery.vehicles.address import parse

    if len(given) > 1:
        raise UsageError(f"--between compares two, with one mission before it; {given[1]} is too much")
    if addresses and not given:
        raise UsageError(f"{addresses[0]} is an address: give the mission to fly on it before --between")
    if given and not addresses:
        raise UsageError(f"{given[0]} would not be flown, since neither side is an address: leave it out")
    for address in addresses:
        parse(address)
    if addresses and not Path(given[0]).is_file():
        expected = "a Python file with `def mission(drone: Drone)` is expected"
        raise UsageError(f"there is no file {given[0]!r}; {expected}")


def _fly(output: CommandOutput, mission: Path, address: str, seed: int) -> Path:
    """Fly a mission into a new run folder and return it; how it ends is part of the comparison."""
    from volery.cli.run_display import recorded_folder, run_progress
    from volery.run.fly import fly
    from volery.run.result import TRACE, Options

    with (
        recorded_folder(None, mission.stem, TRACE) as folder,
        run_progress(output, f"{mission.name} on {address}") as show,
    ):
        assert folder is not None  # it is recorded
        run = fly(mission, address, Options("hardware", seed, out=folder, show=show, tell=output.note))
    if run.record.outcome.status == "interrupted":
        raise UsageError(f"interrupted on {address}; the run is kept in {folder}")
    if not run.completed:
        output.complain(f"volery: {address}: {run.record.outcome.status}: {run.record.outcome.reason}")
    return folder


def _shown(compared: Comparison) -> Iterator[RenderableType]:
    """Yield the tables of a comparison for the terminal."""
    from rich.text import Text

    from volery.report.flight_comparison import answer_grid, phase_grid, text_grid
    from volery.report.terminal import GridTable

    yield from map(GridTable, compared.run_grids)
    flights = compared.all_flights
    if sum(len(flight.phases) for flight in flights) <= MOST_PHASES:
        for one in flights:
            yield GridTable(phase_grid(one))
            for grid in filter(None, (answer_grid(one), text_grid(one))):
                yield GridTable(replace(grid, rows=grid.rows[:MOST_ROWS]))
                if len(grid.rows) > MOST_ROWS:
                    yield Text(f"and {len(grid.rows) - MOST_ROWS} more on the page", style="dim")
    for one in flights:
        alike = all(phase.alike for phase in one.phases)
        yield Text(one.verdict, style="green" if alike else "yellow")


def _as_json(found: Recovered) -> str:
    return found.record.model_dump_json(by_alias=True, indent=2)


def _note_report(output: CommandOutput, found: Recovered) -> None:
    output.note(f"report: {found.report}")
    if found.lost:
        output.note(f"  {found.lost}")
