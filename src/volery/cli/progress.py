"""Progress of runs on the terminal: simulated time, speed, state of each vehicle, parcels."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from time import perf_counter

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

Show = Callable[[Progress], None]


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
def live_progress(output: Output) -> Iterator[LiveProgress | None]:
    """Draw on the terminal within the context; yield None if progress is not shown."""
    if not output.shows_progress:
        yield None
        return
    with Live(console=output.notes, transient=True, refresh_per_second=8) as live:
        yield LiveProgress(live)


@contextmanager
def run_progress(output: Output, title: str) -> Iterator[Show | None]:
    """Yield the function to which one run reports its progress, or None if it is not shown."""
    with live_progress(output) as drawings:
        yield None if drawings is None else RateLimited(partial(drawings.show, title))
