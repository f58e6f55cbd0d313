"""What the commands share that run something: how fast it is to go, and how it ended."""

from __future__ import annotations

from rich.traceback import Traceback

from volery.base.errors import UsageError
from volery.cli.console import Output
from volery.cli.endings import BAD_INPUT, BAD_INPUTS, FAILED, OK
from volery.report.terminal import summary_table
from volery.requirements.record import RequirementRecord
from volery.run.result import Run


def pace_of(speed: str) -> float | None:
    """Simulated seconds per second; ``None`` for as fast as it goes."""
    if speed == "max":
        return None
    try:
        pace = float(speed)
    except ValueError:
        pace = 0.0
    if not 0.0 < pace < float("inf"):
        raise UsageError(f"--speed {speed}: max, or how many simulated seconds per second, such as 1 or 10")
    return pace


def tell(output: Output, run: Run) -> int:
    """Show a run that has ended, say where it is kept; the exit status."""
    output.show(summary_table(run.record))
    output.give(run.record.model_dump_json(by_alias=True, indent=2))
    if run.folder is not None:
        report = run.folder / "report.html"
        output.note(f"{'report: ' + str(report) if report.exists() else 'run folder: ' + str(run.folder)}")
    if run.error is not None:
        if output.debug:
            output.notes.print(Traceback.from_exception(type(run.error), run.error, run.error.__traceback__))
        output.complain(f"volery: {run.error}")
    elif not run.completed:
        output.complain(f"volery: {run.record.outcome.status}: {run.record.outcome.reason}")
    for name, found in run.record.requirements.items():
        if found.met is False:
            output.complain(f"volery: {unmet(name, found)}")
    for problem in run.problems:
        output.complain(f"volery: {problem}")
    for name in run.left:
        output.complain(f"volery: {name} did not end when it was told to")
    if isinstance(run.error, BAD_INPUTS):
        return BAD_INPUT
    return OK if run.ok else FAILED


def unmet(name: str, found: RequirementRecord) -> str:
    """A requirement that was not met, in one sentence."""
    seen = (
        "nothing was there to observe"
        if found.observed is None
        else f"{found.observed:g} {found.unit}".strip()
    )
    bound = f"{found.relation} {found.bound:g} {found.unit}".strip()
    return f"the requirement {name!r} is not met: {found.observable} is {seen}, {bound} was asked"
