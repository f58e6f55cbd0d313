"""What a run says while it goes on: simulated time, speed, what the vehicles do, where the parcels are."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

from rich.console import Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from volery.base.time import clock, to_seconds
from volery.cli.console import Output
from volery.run.progress import Progress
from volery.run.recording import Stopwatch

BETWEEN_S = 0.1
"""Wall seconds between two pictures: drawing takes longer than a simulated second."""

Show = Callable[[Progress], None]


class Seldom:
    """Passes on what it is shown, unless it did so a moment ago."""

    def __init__(self, show: Show) -> None:
        self._show = show
        self._watch = Stopwatch()
        self._next = 0.0

    def __call__(self, progress: Progress) -> None:
        """Show it, or not."""
        now = self._watch.seconds()
        if now >= self._next:
            self._next = now + BETWEEN_S
            self._show(progress)


class Pictures:
    """The pictures of the runs under way, one below the other."""

    def __init__(self, live: Live) -> None:
        self._live = live
        self._watch = Stopwatch()
        self._drawn: dict[str, RenderableType] = {}

    def show(self, title: str, progress: Progress) -> None:
        """Draw the run called *title* anew."""
        self._drawn[title] = picture(title, progress, self._watch.seconds())
        self._live.update(Group(*self._drawn.values()))


def picture(title: str, progress: Progress, wall_s: float) -> RenderableType:
    """One line about the run and one for each vehicle."""
    simulated = to_seconds(progress.now)
    line = Text(f"{title}  ", style="bold")
    line.append(clock(progress.now)[:-4], style="cyan")
    if wall_s > 0.0:
        line.append(f"  {simulated / wall_s:,.0f}× real time", style="dim")
    parcels = ", ".join(f"{count} {state}" for state, count in progress.parcels.items())
    line.append(f"  {parcels}" if parcels else "")
    if not progress.limit:
        return Group(line, _vehicles(progress))
    bar = ProgressBar(total=progress.limit, completed=progress.now, width=40)
    return Group(line, bar, _vehicles(progress))


def _vehicles(progress: Progress) -> Table:
    table = Table.grid(padding=(0, 2))
    for one in progress.vehicles:
        doing = f"{one.height:.1f} m" if one.armed else "on the ground"
        table.add_row(f"  {one.name}", one.mode, "armed" if one.armed else "", doing)
    return table


@contextmanager
def drawn(output: Output) -> Iterator[Pictures | None]:
    """Pictures on the terminal for as long as the context lasts; ``None`` where nobody watches."""
    if not output.shows_progress:
        yield None
        return
    with Live(console=output.notes, transient=True, refresh_per_second=8) as live:
        yield Pictures(live)


@contextmanager
def shown(output: Output, title: str) -> Iterator[Show | None]:
    """What one run is to call; ``None`` where nobody watches."""
    with drawn(output) as pictures:
        yield None if pictures is None else Seldom(partial(pictures.show, title))
