"""Where words go: results to standard output, progress and complaints to standard error."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

from rich import box
from rich.console import Console, RenderableType
from rich.table import Column, Table


def table(*headings: Column | str, title: str | None = None, show_header: bool = True) -> Table:
    """A table as all commands show theirs."""
    return Table(
        *headings,
        title=title,
        title_justify="left",
        title_style="bold",
        show_header=show_header,
        box=box.SIMPLE_HEAD if show_header else None,
        pad_edge=False,
    )


def figures(heading: str) -> Column:
    """A column of numbers."""
    return Column(heading, justify="right")


@dataclass(frozen=True)
class Output:
    """How a command was asked to speak."""

    quiet: bool = False
    json: bool = False
    debug: bool = False
    results: Console = field(default_factory=Console)
    notes: Console = field(default_factory=lambda: Console(stderr=True))

    @property
    def shows_progress(self) -> bool:
        """True if somebody watches: progress is no part of a result."""
        return not self.quiet and self.notes.is_terminal

    def show(self, *things: RenderableType) -> None:
        """Tables and sentences for people; not with ``--quiet`` or ``--json``."""
        if not (self.quiet or self.json):
            for thing in things:
                self.results.print(thing)

    def note(self, text: str) -> None:
        """A remark beside the result."""
        if not self.quiet:
            self.notes.print(text, markup=False, highlight=False, soft_wrap=True)

    def complain(self, text: str) -> None:
        """What is wrong; said in any case."""
        self.notes.print(text, markup=False, highlight=False, soft_wrap=True, style="red")

    def give(self, data: Any) -> None:
        """The result as JSON, with ``--json``."""
        if self.json:
            text = data if isinstance(data, str) else json.dumps(data, indent=2, ensure_ascii=False)
            self.results.print(text, markup=False, highlight=False, soft_wrap=True)
