"""How to run, for what is flown as for what is simulated."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from volery.base.time import MS, Ns
from volery.run.progress import Show, Tell

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


AS_USUAL = Options()
