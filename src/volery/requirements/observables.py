"""The quantities that requirements may bound: one table of what there is and how each is observed.

An observer folds one quantity of one subject over the events of a run; the same observer serves a run in
progress and a trace that is read back. It keeps what its quantity needs and no more. Where nothing was
observed the value is NaN, never zero.

A new observable: one entry of ``TABLE``; of another package: a class of the entry points
``volery.observables``. Checks of models, the list of ``volery model observables`` and the reference follow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import fsum, isnan, nan
from typing import Any

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import Ns, S, to_seconds
from volery.model.reading import NOTE_PREFIX, Observable, split_note
from volery.requirements.added_observables import (
    AddedInRun,
    AddedObservables,
    a_kind,
    load_added,
    subjects_of,
)
from volery.requirements.ledgers import (
    AT_THE_END,
    LANDINGS,
    OK,
    PERIOD_TOLERANCE,
    TRAVELS,
    ChainLedger,
    ComponentLedger,
    DurationStatistics,
    VehicleLedger,
    linear_energy,
    processor_energy,
)
from volery.requirements.record import DELIVERY, DELIVERY_KIND
from volery.trace.attachments import ComponentSetup, ProcessorSetup, RunSetup, VehicleSetup
from volery.trace.events import (
    NONE,
    Activation,
    BatteryService,
    Call,
    Charge,
    Collision,
    Event,
    Failure,
    Message,
    Milestone,
    Operation,
    Slice,
    Transmission,
    VehicleState,
)


@dataclass(frozen=True)
class Observer:
    """One quantity of one subject.

    ``listens`` are the kinds of events that matter to it; others may be left out. ``take`` adds an event.
    ``value`` returns the quantity at a time of the run.
    """

    listens: tuple[type[Any], ...]
    take: Callable[[Any], None]
    value: Callable[[Ns], float]

    def __call__(self, event: Event) -> None:
        """Add an event, if its kind matters."""
        if isinstance(event, self.listens):
            self.take(event)


Make = Callable[[str, RunSetup], Observer]
"""Makes the observer of a quantity for a subject."""


# -- components


def _response(reading: Callable[[DurationStatistics], float | None]) -> Make:
    """Observe the responses of a component: see ``ComponentLedger.responses``."""

    def make(component: str, setup: RunSetup) -> Observer:
        known = next((one for one in setup.components if one.name == component), ComponentSetup(component))
        ledger = ComponentLedger(known, "")

        def take(event: Activation | Call) -> None:
            if isinstance(event, Activation):
                if event.component == component:
                    ledger.activation(event)
            elif event.callee == component:
                ledger.call(event)

        return Observer((Activation, Call), take, lambda at: _seconds(reading(ledger.responses())))

    return make


def _serves(subject: str) -> Callable[[Call], bool]:
    """Return what is true for the calls of a component, or of ``<component>.<operation>``.

    A ROS service is an operation by the last word of its name.
    """
    component, _, operation = subject.partition(".")
    return lambda event: event.callee == component and operation in ("", event.operation.rpartition("/")[2])


def _call_times(reading: Callable[[DurationStatistics], float | None]) -> Make:
    """Observe the calls that a component, or one operation of it, served, as their callers saw them."""

    def make(subject: str, setup: RunSetup) -> Observer:
        mine, spread = _serves(subject), DurationStatistics()

        def take(event: Call) -> None:
            if mine(event):
                spread.add(event.end - event.start)

        return Observer((Call,), take, lambda at: _seconds(reading(spread)))

    return make


def _calls(subject: str, setup: RunSetup) -> Observer:
    return _count(Call, _serves(subject))


def _failed_calls(subject: str, setup: RunSetup) -> Observer:
    mine = _serves(subject)
    return _count(Call, lambda event: mine(event) and event.outcome != OK)


def _seconds(nanoseconds: float | None) -> float:
    return nan if nanoseconds is None else nanoseconds / S


def _largest(spread: DurationStatistics) -> float | None:
    return spread.largest if spread.count else None


def _p95(spread: DurationStatistics) -> float | None:
    return spread.quantile(0.95)


def _deadline_misses(component: str, setup: RunSetup) -> Observer:
    seen = [0, 0]  # activations with a deadline, missed deadlines

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
    """Count late releases. Releases in between, such as those by messages, do not matter."""
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


# -- energy of computing


def _energy(reading: Callable[[_Computing, str, float], float | None]) -> Make:
    def make(subject: str, setup: RunSetup) -> Observer:
        computing = _Computing(setup)

        def value(at: Ns) -> float:
            joules = reading(computing, subject, to_seconds(at))
            return nan if joules is None else joules

        return Observer((Slice, Charge), computing.take, value)

    return make


class _Computing:
    """What energy is computed of: the ledgers of all components, and the processors."""

    def __init__(self, setup: RunSetup) -> None:
        self.ledgers = {
            component.name: ComponentLedger(component, component.processor) for component in setup.components
        }
        self.processors = {processor.name: processor for processor in setup.processors}

    def take(self, event: Slice | Charge) -> None:
        name = event.component
        ledger = self.ledgers.get(name)
        if ledger is None:
            ledger = self.ledgers[name] = ComponentLedger(ComponentSetup(name), event.processor)
        if isinstance(event, Slice):
            ledger.executed += event.end - event.start
        else:
            ledger.charge(event)

    def of_component(self, name: str, elapsed_s: float) -> float | None:
        ledger = self.ledgers.get(name)
        return None if ledger is None else ledger.energy(self.processors.get(ledger.processor), linear_energy)

    def of_processor(self, name: str, elapsed_s: float) -> float | None:
        known = self.processors.get(name)
        if known is None:
            return None
        return processor_energy(known, self.ledgers.values(), elapsed_s, linear_energy)

    def of_all(self, name: str, elapsed_s: float) -> float | None:
        """Return the energy of all processors; None if one of them has no figures."""
        found = [self.of_processor(processor, elapsed_s) for processor in self.processors]
        return None if None in found or not found else fsum(one for one in found if one is not None)


# -- networks


def _network_utilisation(network: str, setup: RunSetup) -> Observer:
    occupied = [0]

    def take(event: Transmission) -> None:
        if event.network == network:
            occupied[0] += event.occupied

    return Observer((Transmission,), take, lambda at: min(1.0, occupied[0] / at) if at else nan)


def _delay(reading: Callable[[DurationStatistics], float | None]) -> Make:
    def make(network: str, setup: RunSetup) -> Observer:
        spread = DurationStatistics()

        def take(event: Transmission) -> None:
            if event.network == network and event.received != NONE:
                spread.add(event.received - event.sent)

        return Observer((Transmission,), take, lambda at: _seconds(reading(spread)))

    return make


def _lost_on(network: str, setup: RunSetup) -> Observer:
    return _count(Transmission, lambda event: event.network == network and event.received == NONE)


# -- vehicles


def _worst(names: tuple[str, ...], error: Callable[[Operation], float]) -> Make:
    """Observe the greatest error of the successful operations of some names."""

    def make(vehicle: str, setup: RunSetup) -> Observer:
        worst = [nan]

        def take(event: Operation) -> None:
            if event.vehicle == vehicle and event.operation in names and event.outcome == OK:
                worst[0] = _larger(worst[0], abs(error(event)))

        return Observer((Operation,), take, lambda at: worst[0])

    return make


def _swaps(vehicle: str, setup: RunSetup) -> Observer:
    return _count(BatteryService, lambda event: event.vehicle == vehicle and event.kind == "swap")


def _charging(vehicle: str, setup: RunSetup) -> Observer:
    charged = [0]

    def take(event: BatteryService) -> None:
        if event.vehicle == vehicle:
            charged[0] += event.duration

    return Observer((BatteryService,), take, lambda at: to_seconds(charged[0]))


def _collisions(vehicle: str, setup: RunSetup) -> Observer:
    return _count(Collision, lambda event: event.vehicle == vehicle)


def _larger(one: float, other: float) -> float:
    """Return the larger number; NaN only if both are."""
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
    least = [nan]  # negated, for _larger

    def take(event: VehicleState) -> None:
        if event.vehicle == vehicle:
            least[0] = _larger(least[0], -event.battery)

    return Observer((VehicleState,), take, lambda at: -least[0])


def _failed_operations(vehicle: str, setup: RunSetup) -> Observer:
    return _count(
        Operation,
        lambda event: event.vehicle == vehicle and event.outcome != OK and event.operation != AT_THE_END,
    )


# -- the application


def _noted(kind: str, state: str, quantity: str) -> Observer:
    """Observe the subjects of *kind* that ``volery.note()`` ever put into *state*.

    Without a *quantity* they are counted, each once; the times are from a subject's first state to this one.
    """
    since: dict[str, Ns] = {}
    entered: dict[str, None] = {}
    spread = DurationStatistics()

    def take(event: Milestone) -> None:
        if event.kind == kind:
            since.setdefault(event.subject, event.at)
            if event.state == state and event.subject not in entered:
                entered[event.subject] = None
                spread.add(event.at - since[event.subject])

    readings: dict[str, Callable[[Ns], float]] = {
        "": lambda at: float(spread.count),
        "time_max": lambda at: _seconds(_largest(spread)),
        "time_mean": lambda at: _seconds(spread.mean()),
    }
    return Observer((Milestone,), take, readings[quantity])


def _of_a_delivery(state: str, quantity: str) -> Make:
    return lambda application, setup: _noted(DELIVERY_KIND, state, quantity)


def _failures(application: str, setup: RunSetup) -> Observer:
    return _count(Failure, lambda event: True)


def _lost_messages(application: str, setup: RunSetup) -> Observer:
    return _count(Message, lambda event: event.received == NONE)


# -- chains of topics


def _latency(reading: Callable[[DurationStatistics], float | None]) -> Make:
    def make(chain: str, setup: RunSetup) -> Observer:
        ledger = ChainLedger(next(one for one in setup.chains if one.name == chain))
        return Observer((Message,), ledger.message, lambda at: _seconds(reading(ledger.latencies)))

    return make


# -- the table

TABLE: tuple[tuple[str, str, str, str, Make], ...] = (
    (
        "component",
        "response_time",
        "s",
        "longest response: an active component's activation from release to end, a passive one's call",
        _response(_largest),
    ),
    ("component", "response_time_mean", "s", "mean response", _response(DurationStatistics.mean)),
    (
        "component",
        "response_time_p95",
        "s",
        "response that 95 % do not exceed, at most 0.2 % too high",
        _response(_p95),
    ),
    ("component", "deadline_misses", "", "activations that ended after their deadline", _deadline_misses),
    (
        "component",
        "period_violations",
        "",
        "releases that came more than 10 % of the promised period late",
        _period_violations,
    ),
    ("component", "activations", "", "activations that ended", _activations),
    ("component", "cpu_time", "s", "execution time on its processor", _cpu_time),
    (
        "component",
        "utilisation",
        "",
        "execution time as a share of the run; 1 is one core all the time",
        _component_utilisation,
    ),
    ("component", "failures", "", "number of its failures", _component_failures),
    (
        "component",
        "call_time",
        "s",
        "longest call that it served, as the caller saw it",
        _call_times(_largest),
    ),
    ("component", "call_time_mean", "s", "mean call", _call_times(DurationStatistics.mean)),
    (
        "component",
        "call_time_p95",
        "s",
        "call that 95 % do not exceed, at most 0.2 % too high",
        _call_times(_p95),
    ),
    ("component", "calls", "", "calls that it served", _calls),
    (
        "component",
        "energy",
        "J",
        "energy of its computing: stated for its operations, else above its idle processor",
        _energy(_Computing.of_component),
    ),
    ("operation", "response_time", "s", "longest call, as the caller saw it", _call_times(_largest)),
    ("operation", "response_time_mean", "s", "mean call", _call_times(DurationStatistics.mean)),
    (
        "operation",
        "response_time_p95",
        "s",
        "call that 95 % do not exceed, at most 0.2 % too high",
        _call_times(_p95),
    ),
    ("operation", "calls", "", "calls", _calls),
    ("operation", "failures", "", "calls that ended with an error", _failed_calls),
    ("processor", "utilisation", "", "busy share of all its cores over the run, 0..1", _utilisation),
    ("processor", "energy", "J", "energy over the run, idle and busy", _energy(_Computing.of_processor)),
    (
        "network",
        "utilisation",
        "",
        "share of the run in which the medium was taken, 0..1",
        _network_utilisation,
    ),
    ("network", "delay", "s", "longest time from the sender's request to the delivery", _delay(_largest)),
    ("network", "delay_mean", "s", "mean delay", _delay(DurationStatistics.mean)),
    ("network", "delay_p95", "s", "delay that 95 % do not exceed, at most 0.2 % too high", _delay(_p95)),
    ("network", "lost", "", "transmissions that never arrived", _lost_on),
    (
        "vehicle",
        "landing_offset",
        "m",
        "worst true horizontal distance from the commanded landing point",
        _worst(LANDINGS, lambda event: event.true_horizontal),
    ),
    (
        "vehicle",
        "goto_error",
        "m",
        "worst true horizontal distance from a commanded point on arrival",
        _worst(TRAVELS, lambda event: event.true_horizontal),
    ),
    (
        "vehicle",
        "goto_error_vertical",
        "m",
        "worst true vertical distance from a commanded point on arrival",
        _worst(TRAVELS, lambda event: event.true_vertical),
    ),
    (
        "vehicle",
        "goto_error_by_estimate",
        "m",
        "worst horizontal distance from a commanded point by its own estimate",
        _worst(TRAVELS, lambda event: event.estimate_horizontal),
    ),
    ("vehicle", "battery_min", "", "least charge of the battery, 0..1", _least_battery),
    ("vehicle", "distance", "m", "length of its path", _vehicle(lambda ledger: ledger.distance)),
    (
        "vehicle",
        "airborne_time",
        "s",
        "time armed and above the ground",
        _vehicle(lambda ledger: to_seconds(ledger.airborne)),
    ),
    (
        "vehicle",
        "energy",
        "J",
        "energy drawn from the battery",
        _vehicle(lambda ledger: ledger.joules if ledger.metered else nan),
    ),
    ("vehicle", "battery_swaps", "", "batteries that places swapped", _swaps),
    ("vehicle", "charging_time", "s", "time for which places charged its battery", _charging),
    ("vehicle", "collisions", "", "how often it hit what stands in the world", _collisions),
    ("vehicle", "failures", "", "operations that did not succeed", _failed_operations),
    ("chain", "latency", "s", "greatest age of data at the end of a chain of topics", _latency(_largest)),
    ("chain", "latency_mean", "s", "mean age", _latency(DurationStatistics.mean)),
    ("chain", "latency_p95", "s", "age that 95 % do not exceed, at most 0.2 % too high", _latency(_p95)),
    *(
        (
            "application",
            quantity,
            "s" if "." in words else "",
            f"the same as `{NOTE_PREFIX}.{DELIVERY_KIND}.{words}`",
            _of_a_delivery(*words.partition(".")[::2]),
        )
        for quantity, words in DELIVERY.items()
    ),
    (
        "application",
        "computing_energy",
        "J",
        "energy of all computers over the run, idle and busy",
        _energy(_Computing.of_all),
    ),
    ("application", "messages_lost", "", "ROS messages lost on the way", _lost_messages),
    ("application", "failures", "", "failures of components and of the run", _failures),
)
"""Subject, quantity, unit, description and observer of everything that can be observed."""

OBSERVABLES = tuple(Observable(*row[:4]) for row in TABLE)
"""Everything that can be observed. An empty unit stands for a count or a share."""

NOTED = (
    Observable(
        NOTE_PREFIX,
        "<kind>.<state>",
        "",
        "subjects that volery.note(kind, subject, state) has put into the state, each counted once",
    ),
    Observable(
        NOTE_PREFIX,
        "<kind>.<state>.time_max",
        "s",
        "longest time from the first state of a subject to this one",
    ),
    Observable(NOTE_PREFIX, "<kind>.<state>.time_mean", "s", "mean of these times"),
)
"""What an application observes itself. Kinds and states are its own words, so ``TABLE`` has no entries."""

_MAKERS = {(subject, quantity): make for subject, quantity, _, _, make in TABLE}


def all_observables() -> tuple[Observable, ...]:
    """Return everything that a model's requirements may bound by a subject's name: with other packages'.

    Raises:
        UsageError: Observables of a package cannot be loaded, or two define the same quantity.
    """
    owners = dict.fromkeys(_MAKERS, "volery")
    found = list(OBSERVABLES)
    for name, made in load_added().items():
        for one in made.quantities:
            owner = owners.setdefault((made.subject, one.name), name)
            if owner != name:
                raise UsageError(
                    f"the observables {name!r} and those of {owner!r} both define the quantity {one.name!r} "
                    f"of {a_kind(made.subject)}; rename it in one of the packages, or uninstall one"
                )
            found.append(Observable(made.subject, one.name, one.unit, one.description))
    return tuple(found)


def make_observer(expression: str, setup: RunSetup | None = None) -> Observer:
    """Return the observer of ``<subject>.<quantity>``: ``make_observer("drone_control.deadline_misses")``.

    Args:
        expression: What to observe.
        setup: The kinds of subjects, and what the model promises of them. Without it the subject is of the
            first kind in the table that has such a quantity.

    Raises:
        UsageError: the quantity is neither in the table nor one of a package.
    """
    if (words := split_note(expression)) is not None:
        return _noted(*words)
    circumstances = setup or RunSetup()
    subject, _, quantity = expression.rpartition(".")
    kind = _kind(subject, quantity, circumstances)
    make = _MAKERS.get((kind, quantity)) or _added(kind, quantity)
    if make is None or not subject:
        known = [observable.quantity for observable in all_observables() if observable.subject == kind]
        raise UsageError(
            f"{expression!r}: {a_kind(kind)} has no quantity {quantity!r}{did_you_mean(quantity, known)}; "
            f"there is {choices(known)}"
        )
    return make(subject, circumstances)


def _added(kind: str, quantity: str) -> Make | None:
    """Return what observes a quantity of a package, None if no package defines it."""
    for name, made in load_added().items():
        if made.subject == kind and any(one.name == quantity for one in made.quantities):
            return _from_a_package(name, made, quantity)
    return None


def _from_a_package(name: str, made: type[AddedObservables], quantity: str) -> Make:
    def make(subject: str, setup: RunSetup) -> Observer:
        run = AddedInRun(name, made, setup)
        return Observer(made.listens, run.take, lambda at: run.value(subject, quantity, at))

    return make


def _kind(subject: str, quantity: str, setup: RunSetup) -> str:
    for kind, names in subjects_of(setup).items():
        if subject in names:
            return kind
    if "." in subject:
        return "operation"
    return next((one.subject for one in OBSERVABLES if one.quantity == quantity), "component")
