"""What ``simulate`` and ``fly`` return."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from volery.base.errors import VoleryError
from volery.requirements.record import RunRecord


@dataclass(frozen=True)
class Run:
    """One execution: its record (the contents of ``run.json``) and where the rest of it was kept.

    ``folder`` is ``None`` if nothing was to be kept. ``error`` is what ended the run early, if anything did.
    ``left`` names flows of control that did not end when they were told to. ``problems`` are files of the run
    folder that could not be written.
    """

    record: RunRecord
    folder: Path | None = None
    error: VoleryError | None = None
    left: tuple[str, ...] = ()
    problems: tuple[str, ...] = field(default=())

    @property
    def completed(self) -> bool:
        """True if it came to its own end."""
        return self.record.outcome.status == "completed"

    @property
    def ok(self) -> bool:
        """True if it completed, every requirement was met and everything could be written."""
        return self.completed and self.record.outcome.requirements_met is not False and not self.problems
