"""``volery simulate``, ``report`` and ``runs``: runs of a model; ``volery model``: a model without a run."""

from __future__ import annotations

import os
import shutil
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from volery.base.errors import UsageError, did_you_mean
from volery.base.installed import require_extra
from volery.cli.command import OK, Commands
from volery.cli.console import Output, file_size, make_table, number_column
from volery.cli.options import (
    Allocation,
    Fidelity,
    LogFile,
    LogLevel,
    Model,
    Out,
    Overrides,
    Record,
    Scenario,
    Seed,
    Speed,
    parse_speed,
)

if TYPE_CHECKING:
    from volery.requirements.record import RunRecord

model_commands = Commands("Simulate", group="model", summary="Check, draw, analyse and convert models.")


@model_commands.add("debug")
def show(
    output: Output,
    model: Model,
    allocation: Allocation = None,
    scenario: Scenario = None,
    overrides: Overrides = None,
) -> int:
    """Draw one variant of a model in text: allocation and connections."""
    from volery.model.diagram import diagram
    from volery.model.system_loader import load
    from volery.run.assembly.model_checks import vocabulary

    system = load(model, vocabulary(), scenario, allocation, overrides or ())
    output.show(Text(diagram(system), end=""))
    return OK


@model_commands.add()
def schema(output: Output) -> int:
    """Print the JSON Schema of models, for an editor that completes and checks YAML."""
    from volery.model.document import schema as model_schema

    replace(output, json=True).give(model_schema())
    return OK


@model_commands.add("json")
def observables(output: Output) -> int:
    """List the observables that a requirement may bound."""
    from volery.requirements.observables import NOTED, OBSERVABLES

    listed = make_table("observe", "unit", "meaning")
    for one in (*OBSERVABLES, NOTED):
        subject = one.subject if one.subject in ("application", NOTED.subject) else f"<{one.subject}>"
        listed.add_row(f"{subject}.{one.quantity}", one.unit or "-", one.description)
    output.show(listed)
    output.give([asdict(one) for one in (*OBSERVABLES, NOTED)])
    return OK


commands = Commands("Simulate")

RUN_FILE, TRACE_FILE = "run.json", "trace.mcap"
UNFINISHED = "unfinished; `volery report` recovers it"
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


@commands.add("json", "debug")
def runs(
    output: Output,
    folder: Annotated[Path, typer.Argument(help="Folder that contains run folders, at any depth.")] = Path(
        "runs"
    ),
    remove: Annotated[
        list[str] | None,
        typer.Option(metavar="RUN", help="Remove this run folder of the list; may be repeated."),
    ] = None,
) -> int:
    """List run folders with what was run, how it ended and how large they are, the newest last."""
    if not folder.is_dir():
        raise UsageError(f"there is no folder {folder}; `volery simulate` and `volery fly` make ./runs")
    found = sorted(_found(folder), key=lambda one: (one.written, one.folder))
    if remove:
        return _remove(output, folder, found, remove)
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


def _remove(output: Output, folder: Path, found: list[Listed], names: list[str]) -> int:
    known = {one.folder: one for one in found}
    for name in names:
        if name not in known:
            raise UsageError(f"--remove {name}: no run of that name in {folder}{did_you_mean(name, known)}")
        if any(other.startswith(f"{name}/") for other in known):
            raise UsageError(f"--remove {name}: it contains other runs; remove these first")
    for name in names:
        shutil.rmtree(folder if name == str(folder) else folder / name)
        output.note(f"removed {name}, {file_size(known[name].bytes)}")
    return OK


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
def simulate(
    output: Output,
    model: Model,
    fidelity: Fidelity = "code",
    allocation: Allocation = None,
    scenario: Scenario = None,
    seed: Seed = 1,
    overrides: Overrides = None,
    speed: Speed = "max",
    graph: Annotated[
        str,
        typer.Option(
            metavar="ros1|ros2", help="Run each component as a process on that ROS graph, in real time."
        ),
    ] = "",
    deployed: Annotated[
        bool,
        typer.Option(help="With --graph: others start the components, from packages of `volery deploy`."),
    ] = False,
    out: Out = None,
    record: Record = "full",
    log_file: LogFile = None,
    log_level: LogLevel = "info",
) -> int:
    """Run a model in virtual time and judge its requirements.

    Exit status: 0 if the run completed and met every requirement, 2 for bad input, 1 otherwise.
    """
    require_extra("simulation", "simulated runs")
    from volery.cli.run_display import read_log_options, recorded_folder, run_progress, show_outcome
    from volery.model.system_loader import load
    from volery.run.assembly.model_checks import vocabulary
    from volery.run.result import FULL, SUMMARY, Options
    from volery.run.simulate import simulate as run_simulation

    pace = parse_speed(speed)
    if deployed and not graph:
        raise UsageError("--deployed: name the graph of the components, too: --graph ros1 or --graph ros2")
    system = load(model, vocabulary(), scenario, allocation, overrides or ())
    title = " · ".join(filter(None, (system.name, system.allocation, system.scenario)))
    with recorded_folder(out, system.name, record) as folder, run_progress(output, title) as show:
        options = Options(
            fidelity=fidelity,
            seed=seed,
            pace=pace,
            out=folder,
            record=SUMMARY if record == SUMMARY else FULL,
            show=show,
            tell=output.note,
            graph=graph,
            deployed=deployed,
            log=read_log_options(log_file, log_level),
        )
        run = run_simulation(system, options)
    return show_outcome(output, run)


@commands.add("quiet", "json", "debug")
def report(
    output: Output,
    folders: Annotated[list[Path], typer.Argument(help="A run folder; several are compared.")],
    notes: Annotated[
        bool, typer.Option("--notes", help="List the warnings of the run and what was not counted.")
    ] = False,
) -> int:
    """Write the report of a run again from its trace, or compare several runs.

    Also writes the report of a run that was killed. The comparison of several is written as a page into the
    folder that contains them.
    """
    from volery.report.html_report import recover, write_comparison
    from volery.report.terminal import comparison_table, summary_table

    found = [recover(folder) for folder in folders]
    records = [one.record for one in found]
    if len(records) == 1:
        output.show(summary_table(records[0], notes=notes))
    else:
        output.show(comparison_table(records, [folder.name for folder in folders]))
    as_text = [record.model_dump_json(by_alias=True, indent=2) for record in records]
    output.give(as_text[0] if len(as_text) == 1 else f"[{', '.join(as_text)}]")
    for one in found:
        output.note(f"report: {one.report}")
        if one.lost:
            output.note(f"  {one.lost}")
    if len(folders) > 1:
        common = Path(os.path.commonpath([folder.resolve().parent for folder in folders]))
        shown = Path(os.path.relpath(common))
        output.note(f"side by side: {write_comparison(folders, shown)}")
    return OK
