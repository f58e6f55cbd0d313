"""Options and result of a run: what ``simulate`` and ``fly`` take and return."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from volery.base.errors import VoleryError
from volery.base.time import MS, Ns
from volery.run.event_log import LogOptions
from volery.run.progress import Show, Tell

if TYPE_CHECKING:
    from volery.requirements.record import RunRecord


@dataclass(frozen=True)
class Run:
    """One execution.

    Attributes:
        record: Contents of ``run.json``.
        folder: Run folder, or None if nothing was kept.
        error: The error that ended the run early, or None.
        left: Names of tasks that did not end when they were cancelled.
        problems: Files of the run folder that could not be written, in words.
        notes: Documents that were left out because an optional dependency is missing, in words.
    """

    record: RunRecord
    folder: Path | None = None
    error: VoleryError | None = None
    left: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def completed(self) -> bool:
        """True if the run came to its regular end."""
        return self.record.outcome.status == "completed"

    @property
    def ok(self) -> bool:
        """True if the run completed, met every requirement and could be written."""
        return self.completed and self.record.outcome.requirements_met is not False and not self.problems


SAMPLING_PERIOD: Ns = 200 * MS
"""Period at which the state of every vehicle is recorded."""


@dataclass(frozen=True)
class Options:
    """Options of a run.

    Attributes:
        fidelity: ``times`` (stated execution times) or ``code`` (cost of the components' own code).
        seed: Seed of every random stream.
        pace: Simulated seconds per wall second, or None for as fast as possible.
        out: Run folder, or None to keep nothing.
        show: Receives the progress about once a simulated second.
        tell: Receives single lines that the user should read at once.
        graph: ``ros1`` or ``ros2`` to run the components as processes on that graph, at a pace of 1 unless
            ``pace`` is given; empty for the embedded graph.
        log: File into which the run writes what happens, line by line, or None.
        traces: Folder in which C++ components record the basic blocks that they enter, without being charged.
    """

    fidelity: str = "times"
    seed: int = 1
    pace: float | None = None
    out: Path | None = None
    show: Show | None = None
    tell: Tell | None = None
    graph: str = ""
    traces: Path | None = None
    log: LogOptions | None = None


DEFAULT_OPTIONS = Options()
