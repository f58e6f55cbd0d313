"""What ``simulate`` and ``fly`` return.

How to run, for what is flown as for what is simulated.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from volery.base.errors import VoleryError
from volery.base.time import MS, Ns
from volery.requirements.record import RunRecord
from volery.run.progress import Show, Tell


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


SAMPLING_PERIOD: Ns = 200 * MS
"""How often the state of every vehicle is recorded."""


@dataclass(frozen=True)
class Options:
    """How to run. ``pace``: virtual seconds per second on the wall, ``None``: as fast as it goes.

    ``show`` is given pictures of how it goes, ``tell`` lines that are worth reading at once. ``graph``
    (``ros1``, ``ros2``): with the components as processes on that graph, at a pace of 1 unless one is given.
    ``traces``: a folder in which C++ components tell what they execute, instead of being charged for it.
    """

    fidelity: str = "times"
    seed: int = 1
    pace: float | None = None
    out: Path | None = None
    show: Show | None = None
    tell: Tell | None = None
    graph: str = ""
    traces: Path | None = None


DEFAULT_OPTIONS = Options()
