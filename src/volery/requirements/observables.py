"""Observers: one quantity each, folded over the events of a run as they come.

The same observer serves a run under way and a trace read back. It keeps what its quantity needs and no more;
nothing that was observed is not a number (NaN), never zero.

The published list of what requirements may bound, and the bounds themselves.

``OBSERVABLES`` is the list; ``make_observer`` makes one of its quantities for a subject; ``Observers`` watches all
that a set of bounds needs and gives the verdicts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from math import isnan, nan
from typing import Any

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import Ns, S, to_seconds
from volery.model.reading import Observable
from volery.model.system import Bound
from volery.requirements.ledgers import ChainLedger, ComponentLedger, Distribution, VehicleLedger
from volery.trace.attachments import ComponentSetup, ProcessorSetup, RunSetup, VehicleSetup
from volery.trace.events import (
    NONE,
    Activation,
    Call,
    Event,
    Failure,
    Message,
    Milestone,
    Operation,
    Record,
    Slice,
    VehicleState,
    Verdict,
)

PERIOD_TOLERANCE = 0.1
"""A release is in time if it comes at most this share of the period late."""

PARCEL_KIND = "parcel"
ORDERED, DELIVERED, FAILED = "ordered", "delivered", "failed"
"""The states of a parcel that quantities are defined by. What lies between is the application's own."""

OK = "ok"


@dataclass(frozen=True)
class Observer:
    """One quantity of one subject.

    ``listens`` names the events that matter to it; others may be left out. ``value`` is what it comes to at a
    time in the run.
    """

    listens: tuple[type[Any], ...]
    take: Callable[[Any], None]
    value: Callable[[Ns], float]

    def __call__(self, event: Event) -> None:
        """Take an event into account."""
        if isinstance(event, self.listens):
            self.take(event)


Make = Callable[[str, RunSetup], Observer]
"""Makes the observer of a quantity for a subject."""


# -- components


def _response(reading: Callable[[Distribution], float | None]) -> Make:
    """Of activations from release to end; of calls as callers saw them if there are no activations."""

    def make(component: str, setup: RunSetup) -> Observer:
        ledger = ComponentLedger(ComponentSetup(component), "")

        def take(event: Activation | Call) -> None:
            if isinstance(event, Activation):
                if event.component == component:
                    ledger.activation(event)
            elif event.callee == component:
                ledger.call(event)

        def value(at: Ns) -> float:
            return _seconds(reading(ledger.activations if ledger.activations.count else ledger.calls))

        return Observer((Activation, Call), take, value)

    return make


def _seconds(nanoseconds: float | None) -> float:
    return nan if nanoseconds is None else nanoseconds / S


def _largest(spread: Distribution) -> float | None:
    return spread.largest if spread.count else None


def _deadline_misses(component: str, setup: RunSetup) -> Observer:
    seen = [0, 0]  # activations with a deadline, those of them that missed it

    def take(event: Activation) -> None:
        if event.component == component and event.deadline != NONE:
            seen[0] += 1
            seen[1] += event.finished > event.deadline

    return Observer((Activation,), take, lambda at: float(seen[1]) if seen[0] else nan)


def _activations(component: str, setup: RunSetup) -> Observer:
    seen = [0]

    def take(event: Activation) -> None:
        seen[0] += event.component == component

    return Observer((Activation,), take, lambda at: float(seen[0]))


def _period_violations(component: str, setup: RunSetup) -> Observer:
    """A release that is late violates it; releases in between, such as those by messages, do not."""
    period = next((one.period for one in setup.components if one.name == component), NONE)
    longest = round(period * (1.0 + PERIOD_TOLERANCE))
    seen = [NONE, 0]  # the last release, violations

    def take(event: Activation) -> None:
        if event.component != component:
            return
        if seen[0] != NONE and event.released - seen[0] > longest:
            seen[1] += 1
        seen[0] = max(seen[0], event.released)

    def value(at: Ns) -> float:
        return nan if period == NONE or seen[0] == NONE else float(seen[1])

    return Observer((Activation,), take, value)


def _busy(mine: Callable[[Slice], bool], reading: Callable[[float, float], float]) -> Observer:
    busy = [0]

    def take(event: Slice) -> None:
        if mine(event):
            busy[0] += event.end - event.start

    return Observer((Slice,), take, lambda at: reading(to_seconds(busy[0]), to_seconds(at)) if at else nan)


def _cpu_time(component: str, setup: RunSetup) -> Observer:
    return _busy(lambda event: event.component == component, lambda busy, elapsed: busy)


def _component_utilisation(component: str, setup: RunSetup) -> Observer:
    return _busy(lambda event: event.component == component, lambda busy, elapsed: busy / elapsed)


def _component_failures(component: str, setup: RunSetup) -> Observer:
    return _count(Failure, lambda event: event.who == component)


def _count(kind: type[Any], mine: Callable[[Any], bool]) -> Observer:
    seen = [0]

    def take(event: Any) -> None:
        seen[0] += mine(event)

    return Observer((kind,), take, lambda at: float(seen[0]))


# -- processors


def _utilisation(processor: str, setup: RunSetup) -> Observer:
    known = next((one for one in setup.processors if one.name == processor), ProcessorSetup(processor))
    return _busy(
        lambda event: event.processor == processor, lambda busy, elapsed: busy / (elapsed * known.cores)
    )


# -- vehicles


def _worst(names: tuple[str, ...], error: Callable[[Operation], float]) -> Make:
    """The greatest error of the operations of some names that succeeded."""

    def make(vehicle: str, setup: RunSetup) -> Observer:
        worst = [nan]

        def take(event: Operation) -> None:
            if event.vehicle == vehicle and event.operation in names and event.outcome == OK:
                worst[0] = _larger(worst[0], abs(error(event)))

        return Observer((Operation,), take, lambda at: worst[0])

    return make


def _larger(one: float, other: float) -> float:
    """The larger one; NaN gives way to a number."""
    return other if isnan(one) or other > one else one


def _vehicle(reading: Callable[[VehicleLedger], float]) -> Make:
    def make(vehicle: str, setup: RunSetup) -> Observer:
        known = next((one for one in setup.vehicles if one.name == vehicle), VehicleSetup(vehicle))
        ledger = VehicleLedger(known)

        def take(event: VehicleState) -> None:
            if event.vehicle == vehicle:
                ledger.state(event)

        return Observer((VehicleState,), take, lambda at: nan if ledger.last is None else reading(ledger))

    return make


def _least_battery(vehicle: str, setup: RunSetup) -> Observer:
    least = [nan]  # negated, as _larger wants it

    def take(event: VehicleState) -> None:
        if event.vehicle == vehicle:
            least[0] = _larger(least[0], -event.battery)

    return Observer((VehicleState,), take, lambda at: -least[0])


def _failed_operations(vehicle: str, setup: RunSetup) -> Observer:
    return _count(Operation, lambda event: event.vehicle == vehicle and event.outcome != OK)


# -- the application


def _parcels(state: str) -> Make:
    """How many parcels ever were in a state."""

    def make(application: str, setup: RunSetup) -> Observer:
        seen: dict[str, None] = {}

        def take(event: Milestone) -> None:
            if event.kind == PARCEL_KIND and event.state == state:
                seen[event.subject] = None

        return Observer((Milestone,), take, lambda at: float(len(seen)))

    return make


def _delivery_time(reading: Callable[[Distribution], float | None]) -> Make:
    """From a parcel's first state to its delivery."""

    def make(application: str, setup: RunSetup) -> Observer:
        since: dict[str, Ns] = {}
        delivered: dict[str, None] = {}
        spread = Distribution()

        def take(event: Milestone) -> None:
            if event.kind != PARCEL_KIND:
                return
            since.setdefault(event.subject, event.at)
            if event.state == DELIVERED and event.subject not in delivered:
                delivered[event.subject] = None
                spread.add(event.at - since[event.subject])

        return Observer((Milestone,), take, lambda at: _seconds(reading(spread)))

    return make


def _failures(application: str, setup: RunSetup) -> Observer:
    return _count(Failure, lambda event: True)


def _lost_messages(application: str, setup: RunSetup) -> Observer:
    return _count(Message, lambda event: event.received == NONE)


# -- chains of topics


def _latency(reading: Callable[[Distribution], float | None]) -> Make:
    def make(chain: str, setup: RunSetup) -> Observer:
        ledger = ChainLedger(next(one for one in setup.chains if one.name == chain))
        return Observer((Message,), ledger.message, lambda at: _seconds(reading(ledger.latencies)))

    return make


LANDINGS = ("land", "return_home")
"""Operations that end on the ground."""

TRAVELS = ("goto", "drive")
"""Operations that go to a point."""

COMPONENT: dict[str, Make] = {
    "response_time": _response(_largest),
    "response_time_mean": _response(Distribution.mean),
    "response_time_p95": _response(lambda spread: spread.quantile(0.95)),
    "deadline_misses": _deadline_misses,
    "period_violations": _period_violations,
    "activations": _activations,
    "cpu_time": _cpu_time,
    "utilisation": _component_utilisation,
    "failures": _component_failures,
}
PROCESSOR: dict[str, Make] = {"utilisation": _utilisation}
VEHICLE: dict[str, Make] = {
    "landing_offset": _worst(LANDINGS, lambda event: event.true_horizontal),
    "goto_error": _worst(TRAVELS, lambda event: event.true_horizontal),
    "goto_error_vertical": _worst(TRAVELS, lambda event: event.true_vertical),
    "goto_error_by_estimate": _worst(TRAVELS, lambda event: event.estimate_horizontal),
    "battery_min": _least_battery,
    "distance": _vehicle(lambda ledger: ledger.distance),
    "airborne_time": _vehicle(lambda ledger: to_seconds(ledger.airborne)),
    "energy": _vehicle(lambda ledger: ledger.joules if ledger.metered else nan),
    "failures": _failed_operations,
}
CHAIN: dict[str, Make] = {
    "latency": _latency(_largest),
    "latency_mean": _latency(Distribution.mean),
    "latency_p95": _latency(lambda spread: spread.quantile(0.95)),
}
APPLICATION: dict[str, Make] = {
    "ordered": _parcels(ORDERED),
    "delivered": _parcels(DELIVERED),
    "undelivered": _parcels(FAILED),
    "delivery_time_max": _delivery_time(_largest),
    "delivery_time_mean": _delivery_time(Distribution.mean),
    "messages_lost": _lost_messages,
    "failures": _failures,
}
"""By the quantity's name."""


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
    "component": COMPONENT,
    "processor": PROCESSOR,
    "vehicle": VEHICLE,
    "chain": CHAIN,
    "application": APPLICATION,
}

OBSERVABLES: tuple[Observable, ...] = tuple(
    Observable(subject, quantity, unit, description)
    for subject, quantities in _DESCRIBED.items()
    for quantity, (unit, description) in quantities.items()
)
"""Everything that can be observed. An empty unit stands for a count or a share."""


def make_observer(expression: str, setup: RunSetup | None = None) -> Observer:
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
        self._watched = [(bound, make_observer(bound.observe, setup)) for bound in bounds]
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
