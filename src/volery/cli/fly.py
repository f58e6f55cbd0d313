"""``volery fly``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from volery.base.errors import UsageError
from volery.cli.console import Output
from volery.cli.folders import next_folder
from volery.cli.outcome import pace_of, tell
from volery.cli.progress import shown
from volery.run.assembly.fences import read_fence
from volery.run.fly import Restrictions
from volery.run.fly import fly as run_flight
from volery.run.recording import make_folder
from volery.run.result import Options


@dataclass(frozen=True)
class Wanted:
    """What was asked for."""

    mission: Path
    urls: tuple[str, ...]
    seed: int
    speed: str
    out: Path | None
    fence: Path | None = None
    ceiling: float | None = None
    reserve: str | None = None


def fly(output: Output, wanted: Wanted) -> int:
    """Fly it, show the result; the exit status."""
    if not wanted.mission.is_file():
        what = "a Python file with `def mission(drone: Drone)` is expected"
        raise UsageError(f"there is no file {str(wanted.mission)!r}; {what}")
    pace = pace_of(wanted.speed)
    restrictions = Restrictions(
        fence=read_fence(wanted.fence) if wanted.fence is not None else None,
        highest=wanted.ceiling,
        battery_reserve=_share(wanted.reserve) if wanted.reserve is not None else None,
    )
    folder = make_folder(wanted.out or next_folder(wanted.mission.stem))
    with shown(output, f"{wanted.mission.name} on {', '.join(wanted.urls)}") as show:
        options = Options("hardware", wanted.seed, pace, folder, show, output.note)
        run = run_flight(wanted.mission, wanted.urls, options, restrictions)
    return tell(output, run)


def _share(reserve: str) -> float:
    """``20%`` or ``0.2``."""
    number = reserve.removesuffix("%")
    try:
        share = float(number) / (100.0 if number != reserve else 1.0)
    except ValueError:
        share = -1.0
    if not 0.0 <= share < 1.0:
        raise UsageError(f"--reserve {reserve}: a share of the battery, such as 20% or 0.2")
    return share
