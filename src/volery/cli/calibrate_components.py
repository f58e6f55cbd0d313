"""``volery calibrate components``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.table import Table

from volery.calibration.component_profile import ComponentProfile, profile_components
from volery.cli.console import Output, figures, table
from volery.cli.endings import FAILED, OK
from volery.cli.progress import shown
from volery.model.reader import load
from volery.run.assembly.vocabulary import vocabulary
from volery.run.result import Options


@dataclass(frozen=True)
class Wanted:
    """What was asked for."""

    model: Path
    allocation: str | None
    scenario: str | None
    seed: int
    overrides: tuple[str, ...]


def components(output: Output, wanted: Wanted) -> int:
    """Run the model, learn and show; the exit status, 1 if the run failed."""
    system = load(wanted.model, vocabulary(), wanted.scenario, wanted.allocation, wanted.overrides)
    with shown(output, f"{system.name}, traced") as show:
        learnt, run = profile_components(system, Options(seed=wanted.seed, show=show, tell=output.note))
    output.show(_table(learnt))
    output.give([asdict(one) for one in learnt])
    if run.error is not None:
        output.complain(f"volery: what is learnt is of a run that failed: {run.error}")
        return FAILED
    return OK


def _table(learnt: Sequence[ComponentProfile]) -> Table:
    listed = table("component", "on", figures("blocks"), figures("known now"), figures("followed"))
    for one in learnt:
        listed.add_row(
            f"{one.component} ({', '.join(one.instances)})",
            one.core,
            f"{one.blocks:,}",
            f"{one.met:,}",
            f"{one.followed:.1%} of {one.entered:,}",
        )
    return listed
