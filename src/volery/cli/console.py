"""Where text goes: results to standard output, progress and errors to standard error."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

from rich import box
from rich.console import Console, RenderableType
from rich.table import Column, Table


def make_table(*headings: Column | str, title: str | None = None, show_header: bool = True) -> Table:
    """Return a table in the style of all commands."""
    return Table(
        *headings,
        title=title,
        title_justify="left",
        title_style="bold",
        show_header=show_header,
        box=box.SIMPLE_HEAD if show_header else None,
        pad_edge=False,
    )


def number_column(heading: str) -> Column:
    """Return a column whose cells are aligned to the right."""
    return Column(heading, justify="right")


@dataclass(frozen=True)
class Output:
    """Output of one command, as its options ``--quiet``, ``--json`` and ``--debug`` choose it."""

    quiet: bool = False
    json: bool = False
    debug: bool = False
    results: Console = field(default_factory=Console)
    notes: Console = field(default_factory=lambda: Console(stderr=True))

    @property
    def shows_progress(self) -> bool:
        """True if standard error is a terminal and ``--quiet`` is not given."""
        return not self.quiet and self.notes.is_terminal

    def show(self, *things: RenderableType) -> None:
        """Print tables and sentences for people, unless ``--quiet`` or ``--json`` is given."""
        if not (self.quiet or self.json):
            for thing in things:
                self.results.print(thing)

    def note(self, text: str) -> None:
        """Print a remark on standard error, unless ``--quiet`` is given."""
        if not self.quiet:
            self.notes.print(text, markup=False, highlight=False, soft_wrap=True)

    def complain(self, text: str) -> None:
        """Print an error on standard error in any case."""
        self.notes.print(text, markup=False, highlight=False, soft_wrap=True, style="red")

    def give(self, data: Any) -> None:
        """Print the result as JSON if ``--json`` is given. A string is printed as it is."""
        if self.json:
            text = data if isinstance(data, str) else json.dumps(data, indent=2, ensure_ascii=False)
            self.results.print(text, markup=False, highlight=False, soft_wrap=True)
