"""Where text goes: results to standard output, progress and errors to standard error."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

from rich import box
from rich.console import (
    Console,
    ConsoleOptions,
    ConsoleRenderable,
    RenderableType,
    RenderHook,
    RenderResult,
)
from rich.measure import Measurement
from rich.segment import Segment
from rich.table import Column, Table

_CONTROLS = {
    number: f"\\x{number:02x}" for number in (*range(0x20), *range(0x7F, 0xA0)) if chr(number) not in "\n\t"
} | {
    number: f"\\u{number:04x}" for number in (0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A))
}
"""Control characters, and those that change the direction of text, as they are printed."""
LONGEST_ERROR = 20_000
"""Characters of an error that are printed."""


def printable(text: str) -> str:
    r"""Return *text* with control characters written out: ``\x1b``."""
    return text.translate(_CONTROLS)


class _Printable:
    """A renderable whose text has no control characters. The terminal's own controls are kept."""

    def __init__(self, inner: ConsoleRenderable) -> None:
        self._inner = inner

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for segment in console.render(self._inner, options):
            if segment.control is None:
                yield Segment(printable(segment.text), segment.style)
            else:
                yield segment

    def __rich_measure__(self, console: Console, options: ConsoleOptions) -> Measurement:
        return Measurement.get(console, options, self._inner)


class _PrintableOnly(RenderHook):
    """Names and texts of models, vehicles and recordings reach the terminal without control characters."""

    def process_renderables(self, renderables: list[ConsoleRenderable]) -> list[ConsoleRenderable]:
        return [_Printable(renderable) for renderable in renderables]


def _console(*, stderr: bool = False) -> Console:
    """Return a console that prints text as it stands: what is styled is a ``Text`` with a style.

    Names and messages of others may hold what Rich takes for markup (``[bold]``) or an emoji (``:100:``).
    """
    console = Console(stderr=stderr, markup=False, emoji=False)
    console.push_render_hook(_PrintableOnly())
    return console


def make_table(*headings: Column | str, title: str | None = None, show_header: bool = True) -> Table:
    """Return a table in the style of all commands. A narrow terminal folds texts and cuts nothing off."""
    return Table(
        *(Column(heading, overflow="fold") if isinstance(heading, str) else heading for heading in headings),
        title=title,
        title_justify="left",
        title_style="bold",
        show_header=show_header,
        box=box.SIMPLE_HEAD if show_header else None,
        pad_edge=False,
    )


def file_size(size: float) -> str:
    """Return a number of bytes in kB, from a million on in MB."""
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.1f} kB"


def number_column(heading: str) -> Column:
    """Return a column whose cells are aligned to the right."""
    return Column(heading, justify="right", no_wrap=True)


@dataclass(frozen=True)
class CommandOutput:
    """Output of one command, as its options ``--quiet``, ``--json`` and ``--debug`` choose it."""

    quiet: bool = False
    json: bool = False
    debug: bool = False
    results: Console = field(default_factory=_console)
    notes: Console = field(default_factory=lambda: _console(stderr=True))

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
            self.notes.print(text, highlight=False, soft_wrap=True)

    def complain(self, text: str) -> None:
        """Print an error on standard error in any case; only the beginning of a very long one."""
        if len(text) > LONGEST_ERROR:
            text = f"{text[:LONGEST_ERROR]} ... ({len(text) - LONGEST_ERROR} more characters)"
        self.notes.print(text, highlight=False, soft_wrap=True, style="red")

    def give(self, data: Any) -> None:
        """Print the result as JSON if ``--json`` is given. A string is printed as it is."""
        if self.json:
            text = data if isinstance(data, str) else json.dumps(data, indent=2, ensure_ascii=False)
            self.results.print(text, highlight=False, soft_wrap=True)
