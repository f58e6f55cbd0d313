"""The names outside a model that it may use, as this installation defines them."""

from __future__ import annotations

from pathlib import Path

from volery.cost import load_catalogue
from volery.model.reading import ProcessorKind, Vocabulary
from volery.requirements.observables import OBSERVABLES
from volery.simulation.autopilots.firmware import firmwares

LANGUAGES = frozenset({"c++", "python", "rclpy", "roscpp", "rospy"})
"""Languages of components that can run."""


def vocabulary() -> Vocabulary:
    """Return the names that a model is checked against."""
    autopilots = frozenset(firmwares.names())
    return Vocabulary(_kinds(), LANGUAGES, autopilots, OBSERVABLES, _kinds)


def _kinds(*more: Path) -> dict[str, ProcessorKind]:
    return {
        name: ProcessorKind(
            entry.cores,
            entry.least_mhz * 1e6,
            entry.greatest_mhz * 1e6,
            tuple(one * 1e6 for one in entry.set_to()),
        )
        for name, entry in load_catalogue(*more).processors.items()
    }
