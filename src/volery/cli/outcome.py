"""What commands that run something share: the run folder, the picture of the run, how it ended."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rich.traceback import Traceback

from volery.cli.command import BAD_INPUT, BAD_INPUT_ERRORS, FAILED, OK
from volery.cli.console import Output
from volery.report.terminal import summary_table
from volery.requirements.record import RequirementRecord
from volery.run.event_log import LogOptions, parse_level
from volery.run.recording import make_folder
from volery.run.result import Run

RUNS = Path("runs")


def next_folder(name: str) -> Path:
    """Return the path of a run folder that does not exist yet, such as ``runs/hospital-delivery-3``."""
    stem = re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("-.") or "run"
    taken = [path.name.removeprefix(f"{stem}-") for path in RUNS.glob(f"{stem}-*")]
    number = max((int(text) for text in taken if text.isdigit()), default=0) + 1
    return RUNS / f"{stem}-{number}"


@contextmanager
def run_folder(out: Path | None, name: str) -> Iterator[Path]:
    """Make the folder of a run before anything that takes time; remove it if it stays empty.

    Args:
        out: The folder; None for a new one in ``RUNS``.
        name: Name of a new folder, without its number.

    Raises:
        UsageError: The folder cannot be written.
    """
    folder = out or next_folder(name)
    missing = [one for one in (folder, *folder.parents) if not one.exists()]
    make_folder(folder)
    try:
        yield folder
    finally:
        with suppress(OSError):  # it is not empty
            for one in missing:
                one.rmdir()


def read_log_options(file: Path | None, level: str) -> LogOptions | None:
    """Return the options of the log that ``--log-file`` asks for, or None.

    Raises:
        UsageError: There is no such level.
    """
    severity = parse_level(level)
    return None if file is None else LogOptions(file, severity)


def show_outcome(output: Output, run: Run) -> int:
    """Show a finished run and where it is kept. Return the exit status."""
    output.show(summary_table(run.record))
    output.give(run.record.model_dump_json(by_alias=True, indent=2))
    if run.folder is not None:
        report = run.folder / "report.html"
        output.note(f"report: {report}" if report.exists() else f"run folder: {run.folder}")
    if run.error is not None:
        if output.debug:
            output.notes.print(Traceback.from_exception(type(run.error), run.error, run.error.__traceback__))
        output.complain(f"volery: {run.error}")
    elif not run.completed:
        output.complain(f"volery: {run.record.outcome.status}: {run.record.outcome.reason}")
    for name, found in run.record.requirements.items():
        if found.met is False:
            output.complain(f"volery: {unmet(name, found)}")
    for note in run.notes:
        output.note(f"volery: {note}")
    for problem in (*run.problems, *(f"{name} did not end when it was cancelled" for name in run.left)):
        output.complain(f"volery: {problem}")
    if isinstance(run.error, BAD_INPUT_ERRORS):
        return BAD_INPUT
    return OK if run.ok else FAILED


def unmet(name: str, found: RequirementRecord) -> str:
    """Return one sentence about a requirement that was not met."""
    bound = f"{found.relation} {found.bound:g} {found.unit}".strip()
    value = "" if found.observed is None else f"{found.observed:g} {found.unit}".strip()
    seen = f"is {value}" if value else "was never observed"
    return f"the requirement {name!r} is not met: {found.observable} {seen}, required is {bound}"
