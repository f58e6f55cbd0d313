"""Bounds on observed quantities, watched during a run and judged at its end."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from math import isnan
from typing import Any

from volery.base.time import Ns
from volery.model.system import RequiredBound
from volery.requirements.observables import make_observer
from volery.trace.attachments import RunSetup
from volery.trace.events import Event, Record, Verdict


def bounds_of(setup: RunSetup) -> tuple[RequiredBound, ...]:
    """Return the requirements of a run whose trace was read back."""
    return tuple(
        RequiredBound(
            requirement.name,
            requirement.observable,
            requirement.relation,
            requirement.bound,
            requirement.unit,
        )
        for requirement in setup.requirements
    )


class Observers:
    """A selective listener of the event stream that observes what *bounds* are about."""

    def __init__(self, bounds: Iterable[RequiredBound], setup: RunSetup | None = None) -> None:
        self._observed = [(bound, make_observer(bound.observe, setup)) for bound in bounds]
        self._listening: dict[type[Any], list[Callable[[Any], None]]] = {}
        for _, observer in self._observed:
            for kind in observer.listens:
                self._listening.setdefault(kind, []).append(observer.take)

    def __call__(self, event: Event) -> None:
        """Add an event."""
        for take in self._listening.get(type(event), ()):
            take(event)

    def listener(self, kind: type[Any]) -> Record | None:
        """Return what takes events of *kind*, None if they change no verdict."""
        takers = self._listening.get(kind, [])
        return takers[0] if len(takers) == 1 else self if takers else None

    def values(self, at: Ns) -> Iterator[tuple[RequiredBound, float]]:
        """Yield each bound with what was observed until *at*; NaN where nothing was observed."""
        for bound, observer in self._observed:
            yield bound, observer.value(at)

    def verdicts(self, at: Ns) -> tuple[Verdict, ...]:
        """Return the verdict on each bound, at the end of a run."""
        return tuple(judge(bound, value, at) for bound, value in self.values(at))

    def all_hold(self, at: Ns) -> bool:
        """Return whether every bound holds, as for the model's ``until``."""
        return all(bound.holds(value) for bound, value in self.values(at))


def judge(bound: RequiredBound, observed: float, at: Ns) -> Verdict:
    """Return the verdict on one bound. A quantity that could not be observed does not meet it."""
    met = not isnan(observed) and bound.holds(observed)
    return Verdict(at, bound.name, bound.observe, bound.relation, bound.bound, observed, met)
