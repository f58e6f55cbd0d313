"""``volery runs``: the run folders that there are, and how each run ended."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

import typer

from volery.base.errors import UsageError
from volery.cli.command import OK, Commands
from volery.cli.console import Output, make_table, number_column

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
    outcome: str = ""
    met: bool | None = None
    simulated_s: float | None = None


@commands.add("json", "debug")
def runs(
    output: Output,
    folder: Annotated[Path, typer.Argument(help="Folder that contains run folders, at any depth.")] = Path(
        "runs"
    ),
) -> int:
    """List run folders with what was run and how it ended, the newest last."""
    if not folder.is_dir():
        raise UsageError(f"there is no folder {folder}; `volery simulate` and `volery fly` make ./runs")
    found = sorted(_found(folder), key=lambda one: (one.written, one.folder))
    listed = make_table("folder", "written", "run", "outcome", "requirements", number_column("time"))
    for one in found:
        run = " · ".join(filter(None, (one.system, one.allocation, one.scenario, one.fidelity)))
        met = {None: "-", True: "met", False: "not met"}[one.met]
        seconds = "-" if one.simulated_s is None else f"{one.simulated_s:.1f} s"
        listed.add_row(one.folder, one.written, run or "-", one.outcome, met, seconds)
    output.show(listed if found else f"no run folder in {folder}")
    output.give([asdict(one) for one in found])
    return OK


def _found(folder: Path) -> Iterator[Listed]:
    for name, below, files in os.walk(folder):
        here = Path(name)
        if RUN_FILE in files or TRACE_FILE in files:
            yield _listed(here, folder)
        elif here != folder and not below and not files:
            yield Listed(_name(here, folder), _written(here), outcome=EMPTY)


def _listed(here: Path, folder: Path) -> Listed:
    record = _record(here / RUN_FILE)
    if record is None:
        return Listed(_name(here, folder), _written(here), outcome=UNFINISHED)
    outcome = record["outcome"]
    return Listed(
        _name(here, folder),
        _written(here / RUN_FILE),
        record["system"],
        record["allocation"],
        record["scenario"],
        record["fidelity"],
        outcome["status"],
        outcome["requirements_met"],
        record["sim_s"],
    )


def _record(file: Path) -> dict[str, Any] | None:
    """Return the content of a ``run.json``, None if it is missing or is something else."""
    try:
        record = json.loads(file.read_bytes())
        keys = ("outcome", "system", "allocation", "scenario", "fidelity", "sim_s")
        return record if all(key in record for key in keys) else None
    except (OSError, ValueError, TypeError):
        return None


def _name(here: Path, folder: Path) -> str:
    return str(here.relative_to(folder)) if here != folder else str(here)


def _written(path: Path) -> str:
    return datetime.fromtimestamp(path.stat().st_mtime).isoformat(" ", "seconds")
