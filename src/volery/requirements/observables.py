"""The published list of what requirements may bound, and the bounds themselves.

``OBSERVABLES`` is the list; ``observer`` makes one of its quantities for a subject; ``Observers`` watches all
that a set of bounds needs and gives the verdicts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from math import isnan
from typing import Any

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import Ns
from volery.model.system import Bound, Observable
from volery.requirements import observers
from volery.requirements.observers import Make, Observer
from volery.trace.events import Event, Record, Verdict
from volery.trace.setup import RunSetup

_DESCRIBED: dict[str, dict[str, tuple[str, str]]] = {
    "component": {
        "response_time": ("s", "longest response: of activations from release to end, else of calls served"),
        "response_time_mean": ("s", "mean response"),
        "response_time_p95": ("s", "response that 95 % do not exceed, at most 0.2 % too high"),
        "deadline_misses": ("", "activations that ended after their deadline"),
        "period_violations": ("", "releases that came more than 10 % of the promised period late"),
        "activations": ("", "activations that ended"),
        "cpu_time": ("s", "execution time on its processor"),
        "utilisation": ("", "execution time as a share of the run; 1 is one core all the time"),
        "failures": ("", "how often it failed"),
    },
    "processor": {
        "utilisation": ("", "busy share of all its cores over the run, 0..1"),
    },
    "vehicle": {
        "landing_offset": ("m", "worst true horizontal distance from where a landing was asked"),
        "goto_error": ("m", "worst true horizontal distance from an asked point on arrival"),
        "goto_error_vertical": ("m", "worst true vertical distance from an asked point on arrival"),
        "goto_error_by_estimate": ("m", "worst horizontal distance from an asked point by its own estimate"),
        "battery_min": ("", "least charge of the battery, 0..1"),
        "distance": ("m", "length of the way it went"),
        "airborne_time": ("s", "time armed and above the ground"),
        "energy": ("J", "energy drawn from the battery"),
        "failures": ("", "operations that did not succeed"),
    },
    "chain": {
        "latency": ("s", "greatest age of what arrived at the end of a chain of topics"),
        "latency_mean": ("s", "mean age"),
        "latency_p95": ("s", "age that 95 % do not exceed, at most 0.2 % too high"),
    },
    "application": {
        "ordered": ("", "parcels ordered"),
        "delivered": ("", "parcels delivered"),
        "undelivered": ("", "parcels that were given up"),
        "delivery_time_max": ("s", "longest time from a parcel's first state to its delivery"),
        "delivery_time_mean": ("s", "mean time from a parcel's first state to its delivery"),
        "messages_lost": ("", "ROS messages lost on the way"),
        "failures": ("", "failures of components and of the run"),
    },
}
_MAKERS: dict[str, dict[str, Make]] = {
    "component": observers.COMPONENT,
    "processor": observers.PROCESSOR,
    "vehicle": observers.VEHICLE,
    "chain": observers.CHAIN,
    "application": observers.APPLICATION,
}

OBSERVABLES: tuple[Observable, ...] = tuple(
    Observable(subject, quantity, unit, description)
    for subject, quantities in _DESCRIBED.items()
    for quantity, (unit, description) in quantities.items()
)
"""Everything that can be observed. An empty unit stands for a count or a share."""


def observer(expression: str, setup: RunSetup | None = None) -> Observer:
    """The observer of ``<subject>.<quantity>``: ``observer("drone_control.deadline_misses")``.

    *setup* says what the subject is and what its model promises; without it the kind is that of the first
    kind in the list that has such a quantity. Raises ``UsageError`` for a quantity that is not in the list.
    """
    circumstances = setup or RunSetup()
    subject, _, quantity = expression.rpartition(".")
    kind = _kind(subject, quantity, circumstances)
    make = _MAKERS[kind].get(quantity)
    if make is None or not subject:
        known = [one.quantity for one in OBSERVABLES if one.subject == kind]
        raise UsageError(
            f"{expression!r}: a {kind} has no quantity {quantity!r}{did_you_mean(quantity, known)}; "
            f"there is {choices(known)}"
        )
    return make(subject, circumstances)


def _kind(subject: str, quantity: str, setup: RunSetup) -> str:
    if subject == "application":
        return subject
    for kind, things in (
        ("component", setup.components),
        ("processor", setup.processors),
        ("vehicle", setup.vehicles),
        ("chain", setup.chains),
    ):
        if any(one.name == subject for one in things):
            return kind
    return next((one.subject for one in OBSERVABLES if one.quantity == quantity), "component")


def bounds_of(setup: RunSetup) -> tuple[Bound, ...]:
    """The requirements of a run whose trace was read back."""
    return tuple(
        Bound(one.name, one.observable, one.relation, one.bound, one.unit) for one in setup.requirements
    )


class Observers:
    """A tap of the stream that watches what *bounds* are about."""

    def __init__(self, bounds: Iterable[Bound], setup: RunSetup | None = None) -> None:
        self._watched = [(bound, observer(bound.observe, setup)) for bound in bounds]
        self._listening: dict[type[Any], list[Callable[[Any], None]]] = {}
        for _, watching in self._watched:
            for kind in watching.listens:
                self._listening.setdefault(kind, []).append(watching.take)

    def __call__(self, event: Event) -> None:
        """Take an event into account."""
        for take in self._listening.get(type(event), ()):
            take(event)

    def listener(self, kind: type[Any]) -> Record | None:
        """Who is to be told events of *kind*; ``None`` if they change no verdict."""
        takers = self._listening.get(kind, [])
        return takers[0] if len(takers) == 1 else self if takers else None

    def values(self, at: Ns) -> Iterator[tuple[Bound, float]]:
        """Each bound and what was observed until *at*; NaN where nothing was there to observe."""
        for bound, watching in self._watched:
            yield bound, watching.value(at)

    def verdicts(self, at: Ns) -> tuple[Verdict, ...]:
        """Judge: one verdict for each bound, at the end of a run."""
        return tuple(judge(bound, value, at) for bound, value in self.values(at))

    def all_hold(self, at: Ns) -> bool:
        """True if every bound holds, as the model's ``until`` asks."""
        return all(bound.holds(value) for bound, value in self.values(at))


def judge(bound: Bound, observed: float, at: Ns) -> Verdict:
    """The verdict on one bound. What could not be observed is not met."""
    met = not isnan(observed) and bound.holds(observed)
    return Verdict(at, bound.name, bound.observe, bound.relation, bound.bound, observed, met)
