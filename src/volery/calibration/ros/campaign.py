"""Rounds of measurement until every figure is known well enough, or the greatest number is reached.

Rounds are kept in a file, a line each, so that an interrupted campaign continues.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from volery.base.errors import UsageError
from volery.base.seeds import stream
from volery.calibration.ros.call_costs import CallCost, Round, Sample, call_costs
from volery.calibration.ros.probe_environment import Pace, ProbeSetup

PERIODS_MS = (20.0, 50.0)
"""Periods of measured cycles, ms, in turn by round: caches are colder after a longer sleep."""

LEAST_ROUNDS = 3
"""Least number of rounds that shows their spread."""


@dataclass(frozen=True)
class Conditions:
    """Conditions of a campaign; rounds under other conditions do not belong to it."""

    client: str
    processor: str
    frequency_mhz: float


@dataclass(frozen=True)
class Plan:
    """Least and greatest number of rounds, and the relative precision ``within`` of each figure."""

    least: int = 10
    most: int = 30
    within: float = 0.1
    seed: int = 1
    pace: Pace = field(default_factory=Pace)

    def pace_of(self, number: int) -> Pace:
        """Return the pace of a round: the least and greatest counts and two others, in random order."""
        counts = self.pace.counts
        random = stream(self.seed, f"calibrate/{number}")
        between = counts[1:-1]
        chosen = [counts[0], counts[-1], *random.sample(between, min(2, len(between)))]
        sleeps = list(self.pace.sleeps_ms)
        random.shuffle(chosen)
        random.shuffle(sleeps)
        period = PERIODS_MS[number % len(PERIODS_MS)]
        return replace(self.pace, period_ms=period, counts=tuple(chosen), sleeps_ms=tuple(sleeps))


@dataclass(frozen=True)
class Progress:
    """State after a round: completed rounds, most rounds, figures that are not known well enough yet."""

    rounds: int
    most: int
    loose: tuple[CallCost, ...]


Show = Callable[[Progress], None]


class CampaignLog:
    """File of completed rounds; raises ``UsageError`` if it has rounds under other conditions."""

    def __init__(self, file: Path, under: Conditions) -> None:
        self._file = file
        self.rounds: list[Round] = []
        header = vars(under)
        if not file.exists():
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(json.dumps(header) + "\n", encoding="utf-8")
            return
        lines = file.read_text(encoding="utf-8").splitlines()
        try:
            known = json.loads(lines[0])
            self.rounds = [tuple(Sample(*one) for one in json.loads(line)) for line in _whole(lines[1:])]
        except (IndexError, ValueError, TypeError) as error:
            raise UsageError(f"{file} holds no rounds of a campaign: remove it") from error
        if known != header:
            raise UsageError(f"{file} holds rounds of {known}, not of {header}: remove it or move it away")

    def keep(self, one: Round) -> None:
        """Append a round."""
        self.rounds.append(one)
        with self._file.open("a", encoding="utf-8") as file:
            file.write(json.dumps(one) + "\n")

    def forget(self) -> None:
        """Delete the file after the campaign."""
        self._file.unlink(missing_ok=True)


def _whole(lines: list[str]) -> Iterator[str]:
    """Yield the lines without a last one that is incomplete after a crash."""
    for number, line in enumerate(lines):
        if number < len(lines) - 1 or line.endswith("]]"):
            yield line


def run_campaign(
    stage: ProbeSetup, plan: Plan, notebook: CampaignLog, show: Show = lambda progress: None
) -> None:
    """Measure rounds until all figures are precise or the plan's greatest number is reached."""
    while True:
        done = len(notebook.rounds)
        loose = uncertain_costs(notebook.rounds, plan.within) if done >= plan.least else ()
        show(Progress(done, plan.most, loose))
        if done >= plan.most or (done >= plan.least and not loose):
            return
        notebook.keep(stage.probe(plan.pace_of(done)))


def uncertain_costs(rounds: Iterable[Round], within: float) -> tuple[CallCost, ...]:
    """Return the costs whose relative precision is worse than ``within``."""
    return tuple(cost for cost in call_costs(list(rounds)).values() if not cost.is_tight(within))
