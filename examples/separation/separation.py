"""Separation: the least distance between vehicles in the air, for requirements and the report of a run."""

from __future__ import annotations

from itertools import combinations
from math import dist, inf, nan

from volery.base.time import Ns, to_seconds
from volery.requirements.added_observables import AddedObservables, ObservedQuantity
from volery.requirements.record import TableRecord
from volery.trace.attachments import RunSetup
from volery.trace.events import VehicleState

ALOFT_M = 0.5
"""A vehicle this far above where it last stood disarmed is in the air."""


class Separation(AddedObservables):
    """Distances between the centres of vehicles, at each state of either while both are in the air."""

    subject = "vehicle"
    quantities = (ObservedQuantity("separation_min", "m", "least distance to another vehicle in the air"),)
    listens = (VehicleState,)

    def __init__(self, setup: RunSetup) -> None:
        super().__init__(setup)
        self._ground: dict[str, float] = {}
        self._aloft: dict[str, tuple[float, float, float]] = {}
        self._nearest: dict[frozenset[str], tuple[float, Ns]] = {}

    def take(self, event: VehicleState) -> None:
        """Measure the distance to all others that are in the air."""
        name, where = event.vehicle, event.where()
        if not event.armed or name not in self._ground:
            self._ground[name] = where[2]
        if not where[2] > self._ground[name] + ALOFT_M:  # true also where the position is unknown
            self._aloft.pop(name, None)
            return
        self._aloft[name] = where
        for other, there in self._aloft.items():
            if other != name:
                pair, away = frozenset((name, other)), dist(where, there)
                if away < self._nearest.get(pair, (inf, 0))[0]:
                    self._nearest[pair] = away, event.at

    def value(self, subject: str, quantity: str, at: Ns) -> float:
        """Return the least distance of a vehicle [m]; NaN if no other one flew while it did."""
        return min((away for pair, (away, _) in self._nearest.items() if subject in pair), default=nan)

    def table(self, at: Ns) -> TableRecord:
        """Return the pairs of vehicles that have flown at the same time."""
        rows: list[list[str | float | None]] = []
        for one, other in combinations([vehicle.name for vehicle in self.setup.vehicles], 2):
            if (nearest := self._nearest.get(frozenset((one, other)))) is not None:
                rows.append([one, other, nearest[0], to_seconds(nearest[1])])
        columns = ["vehicle", "other", "least distance m", "at s"]
        return TableRecord(title="Separation in the air", columns=columns, rows=rows)
