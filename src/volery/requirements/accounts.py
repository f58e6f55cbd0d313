"""The accounts of a run: one fold over its events, the same during the run and from a trace read back.

Memory does not grow with time, only with the number of parts of the run and of what the application tracks
(subjects of notes, vehicle operations, failures). Nothing is priced here: the energy law of processors is an
argument.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from math import fsum, isnan
from typing import Any, NamedTuple

from volery.base.time import Ns, S, to_seconds
from volery.requirements.added_observables import AddedInRun, load_added
from volery.requirements.ledgers import (
    ChainLedger,
    ComponentLedger,
    DurationStatistics,
    EnergyLaw,
    NetworkLedger,
    Quantities,
    VehicleLedger,
    known,
    linear_energy,
    processor_energy,
)
from volery.requirements.record import (
    DELIVERY,
    DELIVERY_KIND,
    ComponentRecord,
    FailureRecord,
    LawRecord,
    NoteRecord,
    OutcomeRecord,
    PreemptionRecord,
    ProcessorRecord,
    RequirementRecord,
    RunRecord,
    Status,
    StepRecord,
    UnservedRecord,
)
from volery.requirements.response_bounds import Demands
from volery.trace.attachments import ComponentSetup, ProcessorSetup, RunSetup, VehicleSetup
from volery.trace.events import (
    NONE,
    WARNING,
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
    Preemption,
    Record,
    Slice,
    Text,
    Transmission,
    Unserved,
    VehicleState,
    Verdict,
)

APPLICATION = "application"
FRAMEWORK = "volery"
"""The source of texts of the framework: its warnings become warnings of the record."""


class Circumstances(NamedTuple):
    """What differs from one execution of a run to the next, and so is stored in ``run.json`` alone."""

    wall_s: float | None = None
    versions: Mapping[str, str] = {}


UNKNOWN_CIRCUMSTANCES = Circumstances()


class Accounts:
    """A listener of the event stream that keeps the accounts of a run; see ``record``.

    ``last`` is the time of the latest event.

    Args:
        setup: The set-up of the run.
        energy: Energy law of processors.
    """

    def __init__(self, setup: RunSetup, energy: EnergyLaw = linear_energy) -> None:
        self.setup = setup
        self._energy = energy
        self._components = {
            component.name: ComponentLedger(component, component.processor) for component in setup.components
        }
        self._declared = tuple(self._components)
        self._processors = {processor.name: processor for processor in setup.processors}
        self._busy: dict[str, Ns] = dict.fromkeys(self._processors, 0)
        self._vehicles = {vehicle.name: VehicleLedger(vehicle) for vehicle in setup.vehicles}
        self._notes: dict[str, dict[str, list[Milestone]]] = {}
        self._added = tuple(AddedInRun(name, made, setup) for name, made in load_added().items())
        self._verdicts: dict[str, Verdict] = {}
        self._chains = {chain.name: ChainLedger(chain) for chain in setup.chains}
        self._networks = {network.name: NetworkLedger() for network in setup.networks}
        self._collisions: Counter[str] = Counter()
        self._lost_messages = 0
        self._demands = Demands()
        self._preemptions: dict[tuple[str, str, str], int] = {}
        self._failures: list[Failure] = []
        self._unserved: list[UnservedRecord] = []
        self._warnings = dict.fromkeys(setup.warnings)
        self._listening: dict[type[Any], Record] = {}
        self.last: Ns = 0
        self._listeners: dict[type[Any], Record] = {
            Slice: self._slice,
            Preemption: self._preemption,
            Message: self._message,
            Transmission: self._transmission,
            Charge: self._charge,
            Activation: self._activation,
            Call: self._call,
            VehicleState: self._vehicle_state,
            Operation: self._operation,
            Milestone: self._milestone,
            Failure: self._failure,
            Collision: self._collision,
            BatteryService: self._served,
            Verdict: self._verdict,
            Text: self._text,
            Unserved: self._unserved_want,
        }

    def __call__(self, event: Event) -> None:
        """Add an event."""
        self.listener(type(event))(event)

    def listener(self, kind: type[Any]) -> Record:
        """Return what adds events of *kind*; of kinds without an account, only the time counts."""
        if kind not in self._listening:
            takers = [one.take for one in self._added if one.listens_to(kind)]
            own = self._listeners.get(kind, self._other)
            self._listening[kind] = _all_of(own, takers) if takers else own
        return self._listening[kind]

    def _component(self, name: str, processor: str) -> ComponentLedger:
        """Return the ledger of a component that is not in the set-up."""
        ledger = self._components[name] = ComponentLedger(ComponentSetup(name), processor)
        return ledger

    def _other(self, event: Any) -> None:
        at = event[0]
        self.last = at if at > self.last else self.last  # half the time of max(), for every event of a run

    def _slice(self, event: Slice) -> None:
        start, at, processor, _, _, component = event  # the time of an event is its end
        ran = at - start
        ledger = self._components.get(component) or self._component(component, processor)
        ledger.executed += ran
        if processor not in self._busy:
            self._processors[processor] = ProcessorSetup(processor)
            self._busy[processor] = 0
        self._busy[processor] += ran
        self._demands.slice(event)
        self.last = at if at > self.last else self.last

    def _preemption(self, event: Preemption) -> None:
        key = event.processor, event.preempted, event.by
        self._preemptions[key] = self._preemptions.get(key, 0) + 1
        self._other(event)

    def _message(self, event: Message) -> None:
        for chain in self._chains.values():
            chain.message(event)
        if event.received == NONE:
            self._lost_messages += 1
        at = event.sent if event.received == NONE else event.received
        self.last = at if at > self.last else self.last

    def _transmission(self, event: Transmission) -> None:
        ledger = self._networks.get(event.network)
        if ledger is not None:
            ledger.transmission(event)
        self._other(event)

    def _charge(self, event: Charge) -> None:
        at, component, processor = event[:3]
        ledger = self._components.get(component) or self._component(component, processor)
        ledger.charge(event)
        self.last = at if at > self.last else self.last

    def _activation(self, event: Activation) -> None:
        at, component = event.finished, event.component
        ledger = self._components.get(component) or self._component(component, "")
        ledger.activation(event)
        if self._processors:  # bounds are those of processors
            self._demands.activation(event)
        self.last = at if at > self.last else self.last

    def _call(self, event: Call) -> None:
        ledger = self._components.get(event.callee) or self._component(event.callee, "")
        ledger.call(event)
        self.last = event.end if event.end > self.last else self.last

    def _vehicle(self, name: str) -> VehicleLedger:
        ledger = self._vehicles.get(name)
        if ledger is None:
            ledger = self._vehicles[name] = VehicleLedger(VehicleSetup(name))
        return ledger

    def _vehicle_state(self, event: VehicleState) -> None:
        self._vehicle(event.vehicle).state(event)
        self._other(event)

    def _operation(self, event: Operation) -> None:
        self._vehicle(event.vehicle).operations.append(event)
        self.last = event.end if event.end > self.last else self.last

    def _milestone(self, event: Milestone) -> None:
        self._notes.setdefault(event.kind, {}).setdefault(event.subject, []).append(event)
        self._other(event)

    def _failure(self, event: Failure) -> None:
        self._failures.append(event)
        self._other(event)

    def _collision(self, event: Collision) -> None:
        self._collisions[event.vehicle] += 1
        self._failure(Failure(event.at, event.vehicle, str(event)))

    def _served(self, event: BatteryService) -> None:
        if event.vehicle in self._vehicles:
            self._vehicles[event.vehicle].served(event)
        self._other(event)

    def _verdict(self, event: Verdict) -> None:
        self._verdicts[event.requirement] = event
        self._other(event)

    def _text(self, event: Text) -> None:
        if event.source == FRAMEWORK and event.severity <= WARNING:
            self._warnings[event.text] = None
        self._other(event)

    def _unserved_want(self, event: Unserved) -> None:
        self._unserved.append(
            UnservedRecord(
                kind=event.kind,
                name=event.name,
                type=event.type,
                who=event.who,
                count=event.times,
                since_s=to_seconds(event.since),
                hint=event.hint,
            )
        )
        self._other(event)

    def record(
        self,
        status: Status,
        reason: str = "",
        ended: Ns | None = None,
        circumstances: Circumstances = UNKNOWN_CIRCUMSTANCES,
    ) -> RunRecord:
        """Return the contents of ``run.json`` for a run that ended at *ended*; default: its last event."""
        setup = self.setup
        end = self.last if ended is None else ended
        elapsed = to_seconds(end)
        added = {one.name: one.record(end) for one in self._added}
        wall = circumstances.wall_s
        return RunRecord(
            system=setup.system,
            fidelity=setup.fidelity,
            allocation=setup.allocation,
            scenario=setup.scenario,
            seed=setup.seed,
            outcome=OutcomeRecord(status=status, reason=reason, requirements_met=self._all_met()),
            components=self._component_records(),
            processors={name: self._processor_record(name, elapsed) for name in self._processors},
            vehicles={name: ledger.record() for name, ledger in self._vehicles.items()},
            notes={
                kind: {subject: _history(steps) for subject, steps in subjects.items()}
                for kind, subjects in self._notes.items()
            },
            added=added,
            requirements=self._requirements(),
            chains={name: chain.record() for name, chain in self._chains.items()},
            preemptions=self._preemption_records(),
            failures=[_failure(failure) for failure in self._failures],
            laws=[LawRecord.model_validate(asdict(law)) for law in setup.laws],
            not_counted=[*setup.not_counted, *self._not_counted()],
            warnings=[*self._warnings, *(one.failed for one in self._added if one.failed)],
            unserved=self._unserved,
            versions=dict(sorted(circumstances.versions.items())),
            sim_s=elapsed,
            wall_s=wall,
            real_time_factor=elapsed / wall if wall else None,
        )

    def observables(self, ended: Ns) -> dict[str, float]:
        """Return every quantity that requirements may bound, by its name, for a run that ended at *ended*.

        Equal to what ``make_observer`` observes, at no cost for each event. What was not observed is missing.
        Quantities of single operations and of the requirements of other packages are missing as well, unless
        a requirement is about them.
        """
        found = {
            f"{subject}.{quantity}": value
            for subject, quantities in self._quantities(ended)
            for quantity, value in quantities.items()
            if value is not None
        }
        for verdict in self._verdicts.values():
            if not isnan(verdict.observed):
                found.setdefault(verdict.observable, verdict.observed)
        return found

    def _quantities(self, ended: Ns) -> Iterator[tuple[str, Quantities]]:
        """Yield each subject with what was observed of it."""
        elapsed = to_seconds(ended)
        failures = Counter(failure.who for failure in self._failures)
        for name in self._declared:
            ledger = self._components[name]
            joules = ledger.energy(self._processors.get(ledger.processor), self._energy)
            yield name, ledger.quantities(elapsed, joules) | {"failures": float(failures[name])}
        energies = []
        for name, known_as in self._processors.items():
            energies.append(processor_energy(known_as, self._components.values(), elapsed, self._energy))
            busy = to_seconds(self._busy[name])
            utilisation = busy / (elapsed * known_as.cores) if elapsed else None
            yield name, {"utilisation": utilisation, "energy": energies[-1]}
        for name, network in self._networks.items():
            yield name, network.quantities(ended)
        for name, vehicle in self._vehicles.items():
            yield name, vehicle.quantities() | {"collisions": float(self._collisions[name])}
        for name, chain in self._chains.items():
            yield name, chain.latencies.seconds("latency")
        noted = self._noted()
        for kind, quantities in noted.items():
            yield f"note.{kind}", quantities  # as `model.reading.NOTE_PREFIX`, which needs the extra `model`
        parcels = noted.get(DELIVERY_KIND, {})
        delivery = {
            name: parcels.get(words, None if "." in words else 0.0) for name, words in DELIVERY.items()
        }
        computing = [energy for energy in energies if energy is not None]
        yield (
            APPLICATION,
            {
                **delivery,
                "computing_energy": fsum(computing) if len(computing) == len(energies) > 0 else None,
                "messages_lost": float(self._lost_messages),
                "failures": float(len(self._failures) - self._collisions.total()),
            },
        )
        for one in self._added:
            values = one.record(ended).values
            for name, value in values.items():
                subject, _, quantity = name.rpartition(".")
                yield subject, {quantity: value}

    def _noted(self) -> dict[str, Quantities]:
        """Return, by kind, how many subjects each state was noted of, and the times to it."""
        found: dict[str, Quantities] = {}
        for kind, subjects in self._notes.items():
            spreads: dict[str, DurationStatistics] = {}
            for steps in subjects.values():
                for state in dict.fromkeys(step.state for step in steps):
                    entered = next(step.at for step in steps if step.state == state)
                    spreads.setdefault(state, DurationStatistics()).add(entered - steps[0].at)
            found[kind] = {
                name: value
                for state, spread in spreads.items()
                for name, value in (
                    (state, float(spread.count)),
                    (f"{state}.time_max", spread.largest / S),
                    (f"{state}.time_mean", spread.total / spread.count / S),
                )
            }
        return found

    def _component_records(self) -> dict[str, ComponentRecord]:
        """Return the records of components, without the framework's own tasks, which are not set up."""
        bounds = self._response_bounds()
        return {
            name: ledger.record(
                ledger.energy(self._processors.get(ledger.processor), self._energy), bounds.get(name)
            )
            for name, ledger in self._components.items()
            if ledger.processor or name in self._declared
        }

    def _response_bounds(self) -> dict[str, Ns | None]:
        known = {component.name: component for component in self.setup.components}
        bounds = {name: self._demands.bounds(one, known) for name, one in self._processors.items()}
        return {
            name: bounds[one.processor].get(name) for name, one in known.items() if one.processor in bounds
        }

    def _preemption_records(self) -> list[PreemptionRecord]:
        """Return the records of preemptions, the most frequent first."""
        often = sorted(self._preemptions.items(), key=lambda one: (-one[1], one[0]))
        return [
            PreemptionRecord(processor=processor, preempted=preempted, by=by, count=count)
            for (processor, preempted, by), count in often
        ]

    def _processor_record(self, name: str, elapsed: float) -> ProcessorRecord:
        setup = self._processors[name]
        joules = processor_energy(setup, self._components.values(), elapsed, self._energy)
        busy = to_seconds(self._busy[name])
        return ProcessorRecord(
            kind=setup.kind,
            frequency_mhz=setup.frequency_mhz,
            scheduler=setup.scheduler,
            cores=setup.cores,
            utilisation=busy / (elapsed * setup.cores) if elapsed else 0.0,
            energy_j=joules,
            energy_error=None if joules is None else setup.power_error,
        )

    def _requirements(self) -> dict[str, RequirementRecord]:
        units = {requirement.name: requirement.unit for requirement in self.setup.requirements}
        found = {
            requirement.name: RequirementRecord(
                observable=requirement.observable,
                relation=requirement.relation,
                bound=requirement.bound,
                unit=requirement.unit,
                observed=None,
                met=None,
            )
            for requirement in self.setup.requirements
        }
        for name, verdict in self._verdicts.items():
            found[name] = RequirementRecord(
                observable=verdict.observable,
                relation=verdict.relation,
                bound=verdict.bound,
                unit=units.get(name, ""),
                observed=known(verdict.observed),
                met=verdict.met,
            )
        return found

    def _all_met(self) -> bool | None:
        if not self._verdicts:
            return None
        return all(verdict.met for verdict in self._verdicts.values())

    def _not_counted(self) -> list[str]:
        """Return what is missing in the accounts."""
        unallocated = [name for name in self._declared if not self._components[name].processor]
        uncounted = [
            name for name, ledger in self._components.items() if ledger.processor and ledger.uncounted()
        ]
        powerless = [
            f"{name} ({setup.kind or 'unknown'})"
            for name, setup in self._processors.items()
            if self._energy(setup, 1.0, 1.0) is None
        ]
        missing = (
            ("their own code, of which nothing but ROS calls was counted", uncounted),
            ("all computing, since they are allocated to no processor", unallocated),
            ("energy, for want of power figures", powerless),
        )
        return [f"{', '.join(names)}: {what}" for what, names in missing if names]


def _all_of(own: Record, takers: Sequence[Record]) -> Record:
    def take(event: Any) -> None:
        own(event)
        for taker in takers:
            taker(event)

    return take


def _failure(event: Failure) -> FailureRecord:
    return FailureRecord(at_s=to_seconds(event.at), who=event.who, what=event.what)


def _history(steps: list[Milestone]) -> NoteRecord:
    return NoteRecord(
        state=steps[-1].state,
        history=[
            StepRecord(
                at_s=to_seconds(step.at), state=step.state, component=step.component, detail=step.detail
            )
            for step in steps
        ],
    )
