"""``volery simulate``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from volery.cli.console import Output
from volery.cli.folders import next_folder
from volery.cli.outcome import pace_of, tell
from volery.cli.progress import shown
from volery.model.reader import load
from volery.run.assembly.vocabulary import vocabulary
from volery.run.recording import make_folder
from volery.run.result import Options
from volery.run.simulate import simulate as run_simulation


@dataclass(frozen=True)
class Wanted:
    """What was asked for."""

    model: Path
    fidelity: str
    allocation: str | None
    scenario: str | None
    seed: int
    overrides: tuple[str, ...]
    speed: str
    out: Path | None
    graph: str = ""


def simulate(output: Output, wanted: Wanted) -> int:
    """Run it, show the result; the exit status."""
    pace = pace_of(wanted.speed)
    system = load(wanted.model, vocabulary(), wanted.scenario, wanted.allocation, wanted.overrides)
    folder = make_folder(wanted.out or next_folder(system.name))  # before anything that takes time
    with shown(output, " · ".join(filter(None, (system.name, system.allocation, system.scenario)))) as show:
        run = run_simulation(
            system,
            Options(wanted.fidelity, wanted.seed, pace, folder, show, output.note, wanted.graph),
        )
    return tell(output, run)
