"""What commands that run something share: the run folder, the progress on the terminal, how the run ended."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Protocol

from rich.console import Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from volery.base.errors import UsageError
from volery.base.time import clock, to_seconds
from volery.cli.command import BAD_INPUT, BAD_INPUT_ERRORS, FAILED, OK
from volery.cli.console import CommandOutput
from volery.report.grids import by_state, plural
from volery.report.terminal import summary_table
from volery.requirements.record import RunRecord
from volery.run.event_log import LogOptions, parse_level
from volery.run.recording import make_folder
from volery.run.result import FULL, NOTHING, SUMMARY, TRACE, Run, RunProgress, check_record

DRAWING_PERIOD_S = 0.1
"""Wall seconds between two drawings: to draw takes longer than to simulate one second."""

LINE_PERIOD_S = 10.0
"""Wall seconds between two lines of a run where no terminal can be drawn on, such as a log of CI."""

Show = Callable[[RunProgress], None]


class Drawings(Protocol):
    """Shows the progress of one or several runs."""

    def show(self, title: str, progress: RunProgress) -> None:
        """Show the progress of the run called *title*."""


class RateLimited:
    """Calls *show* at most once in ``DRAWING_PERIOD_S``."""

    def __init__(self, show: Show) -> None:
        self._show = show
        self._next = 0.0

    def __call__(self, progress: RunProgress) -> None:
        """Show *progress* if the last drawing is old enough."""
        now = perf_counter()
        if now >= self._next:
            self._next = now + DRAWING_PERIOD_S
            self._show(progress)


class LiveProgress:
    """Drawings of one or several runs, one below the other."""

    def __init__(self, live: Live) -> None:
        self._live = live
        self._start = perf_counter()
        self._drawn: dict[str, RenderableType] = {}

    def show(self, title: str, progress: RunProgress) -> None:
        """Redraw the run called *title*."""
        self._drawn[title] = draw_progress(title, progress, perf_counter() - self._start)
        self._live.update(Group(*self._drawn.values()))


class LineProgress:
    """Lines of text for one or several runs, where no terminal can be drawn on."""

    def __init__(self, output: CommandOutput, read_clock: Callable[[], float] = perf_counter) -> None:
        self._output = output
        self._clock = read_clock
        self._start = read_clock()
        self._last: dict[str, float] = {}

    def show(self, title: str, progress: RunProgress) -> None:
        """Print a line if the last one of the run called *title* is old enough."""
        now = self._clock()
        if now - self._last.get(title, self._start) < LINE_PERIOD_S:
            return
        self._last[title] = now
        of = f" of at most {clock(progress.limit)[:-4]}" if progress.limit else ""
        pace = to_seconds(progress.now) / (now - self._start)
        noted = "".join(f", {words}" for words in _noted(progress))
        self._output.note(f"{title}: {clock(progress.now)[:-4]}{of}, {pace:,.1f}× real time{noted}")


def _noted(progress: RunProgress) -> list[str]:
    """Return how many subjects of notes are in each state: ``parcels: 2 delivered``."""
    return [f"{plural(kind)}: {by_state(states)}" for kind, states in progress.notes.items()]


def draw_progress(title: str, progress: RunProgress, wall_s: float) -> RenderableType:
    """Return one line for the run and one for each vehicle."""
    simulated = to_seconds(progress.now)
    line = Text(f"{title}  ", style="bold")
    line.append(clock(progress.now)[:-4], style="cyan")
    if wall_s > 0.0:
        line.append(f"  {simulated / wall_s:,.0f}× real time", style="dim")
    noted = ", ".join(_noted(progress))
    line.append(f"  {noted}" if noted else "")
    vehicles = Table.grid(padding=(0, 2))
    for vehicle in progress.vehicles:
        height = f"{vehicle.height:.1f} m" if vehicle.armed else "on the ground"
        vehicles.add_row(f"  {vehicle.name}", vehicle.mode, "armed" if vehicle.armed else "", height)
    if not progress.limit:
        return Group(line, vehicles)
    return Group(line, ProgressBar(total=progress.limit, completed=progress.now, width=40), vehicles)


@contextmanager
def live_progress(output: CommandOutput) -> Iterator[Drawings | None]:
    """Draw on the terminal within the context, or print lines; yield None if progress is not shown."""
    if output.quiet:
        yield None
        return
    if not output.notes.is_terminal:
        yield LineProgress(output)
        return
    with Live(console=output.notes, transient=True, refresh_per_second=8) as live:
        yield LiveProgress(live)


@contextmanager
def run_progress(output: CommandOutput, title: str) -> Iterator[Show | None]:
    """Yield the function to which one run reports its progress, or None if it is not shown."""
    with live_progress(output) as drawings:
        yield None if drawings is None else RateLimited(partial(drawings.show, title))


@contextmanager
def status_line(output: CommandOutput) -> Iterator[Callable[[str], None]]:
    """Yield what shows one line that is renewed on a terminal; elsewhere a line each ``LINE_PERIOD_S``."""
    if output.shows_progress:
        with Live(console=output.notes, transient=True, refresh_per_second=4) as live:
            yield lambda text: live.update(Text(text, no_wrap=True, overflow="ellipsis"))
        return
    due = 0.0

    def note(text: str) -> None:
        nonlocal due
        if perf_counter() >= due:
            due = perf_counter() + LINE_PERIOD_S
            output.note(text)

    yield note


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


@contextmanager
def recorded_folder(out: Path | None, name: str, record: str) -> Iterator[Path | None]:
    """Make the folder of a run as ``run_folder`` does, or yield None if nothing is recorded.

    Args:
        out: The folder; None for a new one in ``RUNS``.
        name: Name of a new folder, without its number.
        record: As ``Options.record``, or ``none``.

    Raises:
        UsageError: The folder cannot be written, there is no such record, or a folder is named for none.
    """
    check_record(record, (FULL, TRACE, SUMMARY, NOTHING), "--record")
    if record != NOTHING:
        with run_folder(out, name) as folder:
            yield folder
    elif out is not None:
        raise UsageError(f"--record none writes no run folder; leave out --out {out}")
    else:
        yield None


def read_log_options(file: Path | None, level: str) -> LogOptions | None:
    """Return the options of the log that ``--log-file`` asks for, or None.

    Raises:
        UsageError: There is no such level.
    """
    severity = parse_level(level)
    return None if file is None else LogOptions(file, severity)


def show_outcome(output: CommandOutput, run: Run) -> int:
    """Show a finished run and where it is kept. Return the exit status."""
    output.show(summary_table(run.record))
    output.give(run.record.model_dump_json(by_alias=True, indent=2))
    if run.folder is not None:
        report = run.folder / "report.html"
        output.note(f"report: {report}" if report.exists() else f"run folder: {run.folder}")
    if run.error is not None:
        if output.debug:
            from rich.traceback import Traceback  # noqa: PLC0415  # loads the highlighter of source text

            output.notes.print(Traceback.from_exception(type(run.error), run.error, run.error.__traceback__))
        output.complain(f"volery: {run.error}")
    elif not run.completed:
        output.complain(f"volery: {run.record.outcome.status}: {run.record.outcome.reason}")
    for name, found in run.record.requirements.items():
        if found.met is False:
            output.complain(f"volery: {unmet(run.record, name)}")
    for note in run.notes:
        output.note(f"volery: {note}")
    for problem in (*run.problems, *(f"{name} did not end when it was cancelled" for name in run.left)):
        output.complain(f"volery: {problem}")
    if isinstance(run.error, BAD_INPUT_ERRORS):
        return BAD_INPUT
    return OK if run.ok else FAILED


def unmet(record: RunRecord, name: str) -> str:
    """Return one sentence about a requirement that was not met."""
    requirement = record.requirements[name]
    bound = f"{requirement.relation} {requirement.bound:g} {requirement.unit}".strip()
    value = "" if requirement.observed is None else f"{requirement.observed:g} {requirement.unit}".strip()
    chain = record.chains.get(requirement.observable.rpartition(".")[0])
    why = f" ({chain.unobserved})" if chain is not None and chain.unobserved else ""
    seen = f"is {value}" if value else f"was never observed{why}"
    return f"the requirement {name!r} is not met: {requirement.observable} {seen}, required is {bound}"
