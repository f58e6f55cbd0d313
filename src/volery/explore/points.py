"""What a campaign asks and what it gets: a point of the design space with a seed, and the row of its run."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

Value = Any
"""A value of the model as YAML has it: a text, a number, a truth value, None, a list or a mapping."""

SCENARIO: Final = "scenario"
ALLOCATION: Final = "allocation"
SELECTED: Final = (SCENARIO, ALLOCATION)
"""Keys of a point that name a scenario or an allocation; every other key is a path of the model."""

PATHS: Final = ", "
"""Joins the paths of a key that sets several to one value."""

COMPLETED: Final = "completed"
FAILED: Final = "failed"
INVALID: Final = "invalid"
CRASHED: Final = "crashed"
OVER_TIME: Final = "over time"
OVER_MEMORY: Final = "over memory"
DISCARDED: Final = "discarded"
STATUSES: Final = (COMPLETED, FAILED, INVALID, CRASHED, OVER_TIME, OVER_MEMORY, DISCARDED)
"""How a run ended: to its regular end; with an error of a component or of the run; not begun, since the model
is wrong at this point; with the death of its process; beyond its limit of wall time or of memory; not begun,
since an analysis shows that it cannot meet its requirements."""


@dataclass(frozen=True)
class VariantPoint:
    """One variant of a model and a seed.

    Attributes:
        values: What the variant sets: values by their paths in the model, such as
            ``platform.processors.onboard.frequency``, and names by the keys ``scenario`` and ``allocation``.
            A key with several paths, joined by a comma, sets all of them.
        seed: Seed of the run.
    """

    values: Mapping[str, Value] = field(default_factory=dict)
    seed: int = 1

    @property
    def variant(self) -> str:
        """The values as canonical JSON: equal for the same variant, whatever its seed and order of keys."""
        return json.dumps(self.values, sort_keys=True, separators=(",", ":"), ensure_ascii=False)

    @property
    def key(self) -> tuple[str, int]:
        """What two points share exactly if their runs are the same."""
        return self.variant, self.seed


@dataclass(frozen=True)
class CampaignRow:
    """One run of a campaign.

    Rows of the same point are equal on every machine but for the last four fields.

    Attributes:
        run: Number of the run in the campaign, from 0.
        point: What was run.
        status: One of ``STATUSES``.
        reason: Why it ended so; empty for a regular end.
        verdicts: Whether each requirement was met, by its name; None where it was not judged.
        observables: Every observed quantity by its name, such as ``drone_1.energy``, in SI units. What was
            not observed is missing.
        sim_s: Simulated seconds.
        wall_s: Wall seconds of the run.
        cpu_s: Processor seconds of the run.
        host: Name of the machine.
        attempt: 1, or more if earlier attempts were lost with their worker.
    """

    run: int
    point: VariantPoint
    status: str = COMPLETED
    reason: str = ""
    verdicts: Mapping[str, bool | None] = field(default_factory=dict)
    observables: Mapping[str, float] = field(default_factory=dict)
    sim_s: float = 0.0
    wall_s: float = 0.0
    cpu_s: float = 0.0
    host: str = ""
    attempt: int = 1

    @property
    def completed(self) -> bool:
        """Whether the run came to its regular end; the observables of any other are not comparable."""
        return self.status == COMPLETED

    @property
    def cause(self) -> tuple[str, str]:
        """Status and reason without its numbers: equal for runs that failed alike."""
        return self.status, re.sub(r"-?\d+(\.\d+)?", "#", self.reason)

    @property
    def ok(self) -> bool:
        """Whether the run came to its regular end and met every requirement."""
        return self.completed and all(self.verdicts.values())


class Evaluate(Protocol):
    """Runs points: ``Campaign.evaluate``, or in a test a function that makes the rows itself."""

    def __call__(self, points: Sequence[VariantPoint], /) -> list[CampaignRow]:
        """Return a row for each point, in the order of *points*; rows that exist are not made again."""
