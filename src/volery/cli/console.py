"""Where words go: results to standard output, progress and complaints to standard error."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

from rich.console import Console, RenderableType


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
