"""``volery fly``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from volery.base.errors import UsageError
from volery.cli.console import Output
from volery.cli.folders import next_folder
from volery.cli.progress import shown
from volery.cli.simulate import pace_of, tell
from volery.run.fly import fly as run_flight
from volery.run.recording import make_folder
from volery.run.simulate import Options


@dataclass(frozen=True)
class Wanted:
    """What was asked for."""

    mission: Path
    urls: tuple[str, ...]
    seed: int
    speed: str
    out: Path | None


def fly(output: Output, wanted: Wanted) -> int:
    """Fly it, show the result; the exit status."""
    if not wanted.mission.is_file():
        what = "a Python file with `def mission(drone: Drone)` is expected"
        raise UsageError(f"there is no file {str(wanted.mission)!r}; {what}")
    pace = pace_of(wanted.speed)
    folder = make_folder(wanted.out or next_folder(wanted.mission.stem))
    with shown(output, f"{wanted.mission.name} on {', '.join(wanted.urls)}") as show:
        run = run_flight(wanted.mission, wanted.urls, Options("hardware", wanted.seed, pace, folder, show))
    return tell(output, run)
