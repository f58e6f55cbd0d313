"""Progress of runs on the terminal: simulated time, speed, state of each vehicle, parcels."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from time import perf_counter
from typing import Protocol

from rich.console import Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from volery.base.time import clock, to_seconds
from volery.cli.console import Output
from volery.run.progress import Progress

DRAWING_PERIOD_S = 0.1
"""Wall seconds between two drawings: to draw takes longer than to simulate one second."""

LINE_PERIOD_S = 10.0
"""Wall seconds between two lines of a run where no terminal can be drawn on, such as a log of CI."""

Show = Callable[[Progress], None]


class Drawings(Protocol):
    """Shows the progress of one or several runs."""

    def show(self, title: str, progress: Progress) -> None:
        """Show the progress of the run called *title*."""


class RateLimited:
    """Calls *show* at most once in ``DRAWING_PERIOD_S``."""

    def __init__(self, show: Show) -> None:
        self._show = show
        self._next = 0.0

    def __call__(self, progress: Progress) -> None:
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

    def show(self, title: str, progress: Progress) -> None:
        """Redraw the run called *title*."""
        self._drawn[title] = draw_progress(title, progress, perf_counter() - self._start)
        self._live.update(Group(*self._drawn.values()))


class LineProgress:
    """Lines of text for one or several runs, where no terminal can be drawn on."""

    def __init__(self, output: Output, read_clock: Callable[[], float] = perf_counter) -> None:
        self._output = output
        self._clock = read_clock
        self._start = read_clock()
        self._last: dict[str, float] = {}

    def show(self, title: str, progress: Progress) -> None:
        """Print a line if the last one of the run called *title* is old enough."""
        now = self._clock()
        if now - self._last.get(title, self._start) < LINE_PERIOD_S:
            return
        self._last[title] = now
        of = f" of at most {clock(progress.limit)[:-4]}" if progress.limit else ""
        pace = to_seconds(progress.now) / (now - self._start)
        parcels = "".join(f", {count} {state}" for state, count in progress.parcels.items())
        self._output.note(f"{title}: {clock(progress.now)[:-4]}{of}, {pace:,.1f}× real time{parcels}")


def draw_progress(title: str, progress: Progress, wall_s: float) -> RenderableType:
    """Return one line for the run and one for each vehicle."""
    simulated = to_seconds(progress.now)
    line = Text(f"{title}  ", style="bold")
    line.append(clock(progress.now)[:-4], style="cyan")
    if wall_s > 0.0:
        line.append(f"  {simulated / wall_s:,.0f}× real time", style="dim")
    parcels = ", ".join(f"{count} {state}" for state, count in progress.parcels.items())
    line.append(f"  {parcels}" if parcels else "")
    vehicles = Table.grid(padding=(0, 2))
    for one in progress.vehicles:
        height = f"{one.height:.1f} m" if one.armed else "on the ground"
        vehicles.add_row(f"  {one.name}", one.mode, "armed" if one.armed else "", height)
    if not progress.limit:
        return Group(line, vehicles)
    return Group(line, ProgressBar(total=progress.limit, completed=progress.now, width=40), vehicles)


@contextmanager
def live_progress(output: Output) -> Iterator[Drawings | None]:
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
def run_progress(output: Output, title: str) -> Iterator[Show | None]:
    """Yield the function to which one run reports its progress, or None if it is not shown."""
    with live_progress(output) as drawings:
        yield None if drawings is None else RateLimited(partial(drawings.show, title))
