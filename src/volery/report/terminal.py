"""Tables for the terminal, from records alone."""

from __future__ import annotations

from collections.abc import Sequence

from rich import box
from rich.console import Console, ConsoleOptions, Group, JustifyMethod, RenderableType, RenderResult
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from volery.report.comparison import all_comparisons, cost_matrix, outcome_comparison, requirements_comparison
from volery.report.grids import Cell, Grid, all_grids, cost_grid, labels
from volery.requirements.record import RunRecord

_UNLIMITED = 10_000
_STYLES = {"": "", "good": "green", "bad": "bold red", "warn": "yellow", "quiet": "dim"}


class GridTable:
    """Grid that omits inessential columns on a narrow terminal, and then wraps cells between words."""

    def __init__(self, grid: Grid) -> None:
        self.grid = grid

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the table with all columns if they fit without folding, else the essential ones."""
        unlimited = options.update(max_width=_UNLIMITED)
        for table in (_table(self.grid), _table(self.grid, essential=True)):
            if Measurement.get(console, unlimited, table).maximum <= options.max_width:
                yield table
                return
        yield _table(self.grid, essential=True, wrapped=True)


def _table(grid: Grid, *, essential: bool = False, wrapped: bool = False) -> Table:
    table = Table(
        title=grid.title,
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        collapse_padding=True,
    )
    shown = [index for index, column in enumerate(grid.columns) if column.essential or not essential]
    for index in shown:
        column = grid.columns[index]
        whole = column.numeric or index == 0  # a truncated name or figure would mislead
        side: JustifyMethod = "right" if column.numeric else "left"
        table.add_column(
            column.title,
            justify=side,
            no_wrap=whole and not wrapped,
            overflow="fold",
            min_width=_longest_word(grid, index) if wrapped else None,
        )
    for row in grid.rows:
        table.add_row(*(_text(row[index]) for index in shown))
    return table


def _longest_word(grid: Grid, index: int) -> int:
    """Return the width below which a column would be broken inside a word."""
    texts = (grid.columns[index].title, *(row[index].text for row in grid.rows))
    return max((len(word) for text in texts for word in text.split()), default=1)


def _text(cell: Cell) -> Text:
    return Text(cell.text, style=_STYLES[cell.status])


def headline(record: RunRecord) -> Text:
    """Return one line with the name, outcome and speed of a run."""
    name = " · ".join(part for part in (record.system, record.allocation, record.fidelity) if part)
    good = record.outcome.status == "completed" and record.outcome.requirements_met is not False
    line = Text(name, style="bold")
    line.append(f"  {record.outcome.status}", style="green" if good else "bold red")
    if record.outcome.reason:
        line.append(f" ({record.outcome.reason})")
    line.append(f"  {record.sim_s:.1f} s{'' if record.is_real else ' simulated'}", style="dim")
    if not record.is_real and record.wall_s is not None and record.real_time_factor is not None:
        line.append(f" in {record.wall_s:.1f} s, {record.real_time_factor:.0f}× real time", style="dim")
    return line


UNSERVED_LINES = 6
"""How many lines of a summary name what no node took or served."""


def summary_table(record: RunRecord, *, notes: bool = False) -> RenderableType:
    """Return the summary of one run.

    Args:
        record: The run.
        notes: List warnings and what was not counted; else one line says how many there are.
    """
    parts: list[RenderableType] = [headline(record)]
    parts += [GridTable(grid) for grid in all_grids(record)]
    parts += [
        Text(f"chain {name}: no latency was observed: {one.unobserved}", style="yellow")
        for name, one in record.chains.items()
        if one.unobserved
    ]
    shown = record.unserved if notes else record.unserved[:UNSERVED_LINES]
    parts += [Text(f"⚠ {line}", style="yellow") for line in shown]
    if len(record.unserved) > len(shown):
        parts.append(Text(f"⚠ and {len(record.unserved) - len(shown)} more in the report", style="yellow"))
    if notes:
        parts += [Text(f"⚠ {line}", style="yellow") for line in record.warnings]
        parts += [Text(f"not counted: {line}", style="dim") for line in record.not_counted]
    elif record.warnings or record.not_counted:
        numbers = f"warnings: {len(record.warnings)}, not counted: {len(record.not_counted)}"
        line = f"{numbers}; see the report, or `volery runs report --notes`"
        parts.append(Text(line, style="yellow" if record.warnings else "dim"))
    return Group(*parts)


def cost_table(record: RunRecord) -> RenderableType:
    """Return the cost table of one run."""
    return GridTable(cost_grid(record))


def comparison_table(records: Sequence[RunRecord], names: Sequence[str] = ()) -> RenderableType:
    """Return the comparison of runs. *names* are used if their allocations are the same."""
    called = labels(records, names or [f"run {index}" for index in range(1, len(records) + 1)])
    return Group(*(GridTable(grid) for grid in all_comparisons(called, records)))


def short_comparison(records: Sequence[RunRecord], names: Sequence[str] = ()) -> RenderableType:
    """Return the outcomes, requirements and costs of runs."""
    called = labels(records, names or [f"run {index}" for index in range(1, len(records) + 1)])
    grids = (make(called, records) for make in (outcome_comparison, requirements_comparison, cost_matrix))
    return Group(*(GridTable(grid) for grid in grids if grid))
