"""``volery fly``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from volery.cli.console import Output
from volery.cli.folders import next_folder
from volery.cli.progress import shown
from volery.cli.simulate import pace_of, tell
from volery.run.fly import fly as run_flight
from volery.run.simulate import Options


@dataclass(frozen=True)
class Wanted:
    """What was asked for."""

    mission: Path
    url: str
    seed: int
    speed: str
    out: Path | None


def fly(output: Output, wanted: Wanted) -> int:
    """Fly it, show the result; the exit status."""
    folder = wanted.out or next_folder(wanted.mission.stem)
    with shown(output, f"{wanted.mission.name} on {wanted.url}") as show:
        options = Options(seed=wanted.seed, pace=pace_of(wanted.speed), out=folder, show=show)
        run = run_flight(wanted.mission, wanted.url, options)
    return tell(output, run)
