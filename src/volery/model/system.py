"""The system model as frozen data: one allocation and one scenario, with every name resolved and units SI.

Times are ``int`` nanoseconds (``_ns``); everything else is SI, and a name that carries another unit says so.
``where`` is the line of the file that a thing was read from, for messages. A model may be made without a
file: build these classes by hand, they are plain data.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath
from typing import Annotated, Any, TypeVar

from volery.base import units
from volery.base.errors import Location, UsageError, choices, did_you_mean
from volery.base.time import MINUTE, Ns
from volery.base.units import Kind, QuantityError
from volery.model import rules
from volery.model.components import ROS_LANGUAGES, Component, Interface, check_frequency
from volery.model.data_types import DataType
from volery.model.design import DesignParameter, Suppression
from volery.model.environment import Environment, VehicleSpec
from volery.model.fields import (
    BANDWIDTH,
    DATA_SIZE,
    FREQUENCY,
    LOSS,
    PERIOD,
    PROCESSOR,
    PROCESSOR_KIND,
    TEXT,
    TIME,
    VEHICLE,
    Key,
    ListOf,
    MapOf,
    NameField,
    OneOf,
    Record,
    Schema,
    Syntax,
    Whole,
    WrongValueError,
)
from volery.model.instances import Instance, component_of
from volery.model.prices import PRICE, StatedPrice
from volery.model.reading import NOTE_PREFIX, NOTE_TIMES, ModelReading, Observable, Provenance, split_note
from volery.model.resources import (
    CACHES,
    POWER_STATES,
    Cache,
    Device,
    MemorySpace,
    OperatingSystem,
    PowerState,
)
from volery.model.rules import BrokenRule
from volery.model.text import Path, TextNode

SCHEDULERS = ("fixed-priority", "round-robin", "fifo", "edf")
"""Fixed-priority is preemptive: a greater number is more urgent, equals go in order of arrival."""

MAINS = "mains"
"""Powers a computer that is not fed by the battery of its vehicle."""


# -- the platform


@dataclass(frozen=True, slots=True)
class ProcessorSpec:
    """A computer. ``operating_system`` is what is allocated to it, None where the model states none.

    ``powered_by`` names the vehicle whose battery it drains, None for mains. ``quantum_ns`` is None for the
    kernel's default.
    """

    name: str
    kind: Annotated[str, Key("is"), PROCESSOR_KIND, "Kind of processor."]
    frequency_hz: Annotated[float, FREQUENCY, "Frequency of all its cores."]
    cores: Annotated[int, Whole(least=1), "Number of cores in use; by default, all that its kind has."] = 1
    scheduler: Annotated[
        str, OneOf(SCHEDULERS), "Scheduler; under `fixed-priority` a greater number is more urgent."
    ] = "fixed-priority"
    quantum_ns: Annotated[Ns | None, PERIOD, "Time slice of round-robin; by default, the kernel's."] = None
    carried_by: Annotated[str | None, VEHICLE, "The vehicle that carries it."] = None
    per: Annotated[str | None, VEHICLE, "The vehicle that it belongs to: with a `count`, one for each."] = (
        None
    )
    powered_by: Annotated[
        str | None,
        NameField("vehicle", lambda reading: reading.names(("environment", "vehicles")), none=MAINS),
        "The vehicle whose battery it drains; by default, the one that carries it.",
    ] = None
    context_switch_ns: Annotated[Ns, TIME, "Time that a core needs to go on with another task."] = 0
    load: Annotated[float, LOSS, "Share of each core that something else takes before all components."] = 0.0
    memory_b: Annotated[float | None, DATA_SIZE, "Memory that its processes may take."] = None
    caches: Annotated[Mapping[str, Cache], CACHES, "Its caches, by name."] = field(default_factory=dict)
    power_states: Annotated[
        Mapping[str, PowerState], POWER_STATES, "States it can be in, and what it draws in each."
    ] = field(default_factory=dict)
    price: Annotated[StatedPrice | None, PRICE, "Its price; by default that of the catalogue."] = None
    operating_system: str | None = None
    where: Location | None = field(default=None, compare=False)

    @property
    def frequency_mhz(self) -> float:
        """The frequency in MHz, the unit of the laws of ROS calls."""
        return self.frequency_hz / 1e6


def _with_kind(node: TextNode, path: Path, reading: ModelReading) -> TextNode:
    """Add the number of cores from the catalogue, and the vehicle that carries the computer as its power."""
    added = dict(node.items)
    kind = reading.vocabulary.processors.get(str(added["is"].value)) if "is" in added else None
    if kind is not None and ("cores" not in added or added["cores"].value is None):
        added["cores"] = TextNode(kind.cores, node.where)
    if "carried_by" in added and ("powered_by" not in added or added["powered_by"].value is None):
        reading.problems.copied((*path, "powered_by"), (*path, "carried_by"))
        added["powered_by"] = added["carried_by"]
    return replace(node, value=added)


class _Processor(Record):
    """A computer within the limits of its kind."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> ProcessorSpec:
        """See ``Syntax``. A frequency between two that can be set is a warning."""
        made: ProcessorSpec = super().read(node, path, reading)
        check_frequency(reading, path, made.kind, made.frequency_hz)
        kind = reading.vocabulary.processors.get(made.kind)
        if kind is None:
            return made
        if made.cores > kind.cores:
            what = f"{made.kind} has {kind.cores} cores, not {made.cores}"
            reading.problems.add((*path, "cores"), what, rule=rules.TOO_MANY_CORES)
        below = [one for one in kind.settings_hz if one < made.frequency_hz]
        above = [one for one in kind.settings_hz if one > made.frequency_hz]
        if made.frequency_hz not in kind.settings_hz and below and above:
            reading.problems.warn(
                (*path, "frequency"),
                f"{made.kind} cannot be set to {made.frequency_hz / 1e6:g} MHz; "
                f"the nearest settings are {below[-1] / 1e6:g} and {above[0] / 1e6:g} MHz",
                rules.FREQUENCY_SETTING,
            )
        return made


@dataclass(frozen=True, slots=True)
class NetworkSpec:
    """A network that joins processors."""

    name: str
    between: Annotated[tuple[str, ...], ListOf(PROCESSOR, least=2), "Processors that it joins."]
    bandwidth_bit_s: Annotated[float, BANDWIDTH, "Bandwidth, shared by all that is sent."]
    latency_ns: Annotated[Ns, TIME, "Time from the end of a transmission to its arrival."] = 0
    loss: Annotated[float, LOSS, "Probability that one transmission is lost."] = 0.0
    per: Annotated[str | None, VEHICLE, "The vehicle that it belongs to: with a `count`, one for each."] = (
        None
    )
    price: Annotated[
        StatedPrice | None, PRICE, "Price of the radio at one end; by default that of the catalogue."
    ] = None
    where: Location | None = field(default=None, compare=False)


class _Network(Record):
    """A network that joins each processor once."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> NetworkSpec:
        """See ``Syntax``."""
        made: NetworkSpec = super().read(node, path, reading)
        if len(set(made.between)) != len(made.between):
            reading.problems.add(
                (*path, "between"), "a processor stands here twice", rule=rules.DUPLICATE_NAME
            )
        return made


PROCESSORS = MapOf(_Processor(ProcessorSpec, prepare=_with_kind), values_only=True)
NETWORKS = MapOf(_Network(NetworkSpec), values_only=True)


# -- requirements


@dataclass(frozen=True, slots=True)
class Chain:
    """A chain of topics by their full names: a node receives one and publishes the next."""

    name: str
    topics: tuple[str, ...]
    where: Location | None = field(default=None, compare=False)


class _Chain(Syntax):
    """The full names of topics, in order."""

    topics = ListOf(TEXT, least=1)

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Chain:
        """See ``Syntax``."""
        topics = self.topics.read(node, path, reading)
        for place, topic in enumerate(topics):
            if not topic.startswith("/"):
                what = f"{topic!r}: write a topic's full name, such as '/{topic}'"
                reading.problems.add((*path, place), what, rule=rules.BAD_ROS_NAME)
        return Chain(str(path[-1]), topics, node.where)

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return self.topics.schema(definitions)


class _BoundValue(Syntax):
    """A number in the unit of the observed quantity; it is read when the quantity is known."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Any:
        """See ``Syntax``."""
        if isinstance(node.value, dict | list | bool) or node.value is None:
            raise WrongValueError("a number, with the unit of the observed quantity, is expected")
        return node.value

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"type": ["string", "number"]}


@dataclass(frozen=True, slots=True)
class BoundText:
    """A bound on an observed quantity: exactly one of `max` and `min`, with its unit."""

    observe: Annotated[str, TEXT, "What is observed: `<subject>.<quantity>`. See the list of observables."]
    max: Annotated[Any, _BoundValue(), "Greatest value that is allowed, with its unit."] = None
    min: Annotated[Any, _BoundValue(), "Least value that is allowed, with its unit."] = None
    description: Annotated[str, TEXT, "What it is for."] = ""


@dataclass(frozen=True, slots=True)
class RequiredBound:
    """A requirement: a bound on an observed quantity.

    ``relation`` is ``max`` or ``min``; both include the bound. ``observe`` is ``<subject>.<quantity>``;
    ``bound`` is in ``unit``, the unit of the observable.
    """

    name: str
    observe: str
    relation: str
    bound: float
    unit: str = ""
    description: str = ""
    where: Location | None = field(default=None, compare=False)

    def holds(self, observed: float) -> bool:
        """Return whether *observed* respects the bound; NaN (nothing was observed) never does."""
        return observed <= self.bound if self.relation == "max" else observed >= self.bound


class _Bound(Syntax):
    """A bound on an observable, in its unit."""

    text = Record(BoundText)

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> RequiredBound:
        """See ``Syntax``."""
        text: BoundText = self.text.read(node, path, reading)
        observable = _observable(reading, (*path, "observe"), text.observe)
        stated = [one for one in (("max", text.max), ("min", text.min)) if one[1] is not None]
        if len(stated) != 1:
            raise WrongValueError("give exactly one of max and min", rules.BAD_BOUND)
        if observable is None:
            raise WrongValueError("")
        (relation, value), unit = stated[0], observable.unit
        try:
            number = units.read(value, Kind("bound", unit or "1", f"0.5 {unit}" if unit else "3"))
        except QuantityError as error:
            measured = f"measured in {unit}" if unit else "a plain number"
            what = f"{text.observe} is {measured}: {error}"
            reading.problems.add((*path, relation), what, rule=rules.WRONG_QUANTITY)
            raise WrongValueError("") from None
        return RequiredBound(
            str(path[-1]), text.observe, relation, number, unit, text.description, node.where
        )

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return self.text.schema(definitions)


def _observable(reading: ModelReading, path: Path, text: str) -> Observable | None:
    if text.partition(".")[0] == NOTE_PREFIX:
        return _noted(reading, path, text)
    subject, _, quantity = text.rpartition(".")
    kinds = {
        **dict.fromkeys(reading.names(("platform", "networks")), "network"),
        "application": "application",
        **dict.fromkeys(reading.names(("application",), ("environment", "components")), "component"),
        **dict.fromkeys(reading.names(("platform", "processors")), "processor"),
        **dict.fromkeys(reading.names(("environment", "vehicles")), "vehicle"),
        **dict.fromkeys(reading.names(("chains",)), "chain"),
    }
    owner, dot, operation = subject.partition(".")
    if dot and kinds.get(owner) == "component":
        if not _is_operation(reading, path, owner, operation):
            return None
        kind = "operation"
    elif reading.known(path, subject, "subject to observe", kinds, rules.UNKNOWN_OBSERVABLE):
        kind = kinds[subject]
    else:
        return None
    offered = {
        observable.quantity: observable
        for observable in reading.vocabulary.observables
        if observable.subject == kind
    }
    noun = f"quantity of a {kind}"
    return (
        offered[quantity] if reading.known(path, quantity, noun, offered, rules.UNKNOWN_OBSERVABLE) else None
    )


def _is_operation(reading: ModelReading, path: Path, instance: str, operation: str) -> bool:
    """Return whether an instance provides an operation; the services of a ROS node are known when it runs."""
    component = component_of(reading, instance)
    if component is None or component.language in ROS_LANGUAGES:
        return True
    provided = [
        name for interface in component.provides.values() for name in reading.names(("interfaces", interface))
    ]
    noun = f"operation of {instance}"
    return reading.known(path, operation, noun, provided, rules.UNKNOWN_OBSERVABLE)


def _noted(reading: ModelReading, path: Path, text: str) -> Observable | None:
    """Return what is observed of the notes of one state; the words are the application's."""
    words = split_note(text)
    if words is not None:
        return Observable(
            NOTE_PREFIX, text, "s" if words[2] in NOTE_TIMES else "", "subjects, or their times"
        )
    what = f"{text!r}: write {NOTE_PREFIX}.<kind>.<state>, as in volery.note(kind, subject, state)"
    reading.problems.add(path, what, rule=rules.UNKNOWN_OBSERVABLE)
    return None


BOUND = _Bound()
CHAINS = MapOf(_Chain(), values_only=True)
BOUNDS = MapOf(BOUND, values_only=True)


@dataclass(frozen=True, slots=True)
class RunLimits:
    """How long a run lasts."""

    duration_ns: Annotated[Ns, PERIOD, "Longest simulated time."] = 15 * MINUTE
    until: Annotated[RequiredBound | None, BOUND, "Bound that ends the run as soon as it holds."] = None


# -- the system


@dataclass(frozen=True, slots=True)
class ModelFile:
    """A file that the model was read from, for the trace. ``name`` is relative to the model's folder."""

    name: str
    text: str


@dataclass(frozen=True)
class System:
    """One allocation and one scenario of a model, checked.

    ``instances`` holds the application's components, then the environment's. ``allocation`` and ``scenario``
    name what was chosen (``scenario`` empty: none), ``allocations`` and ``scenarios`` the choices.
    ``overrides`` are the ``path=value`` texts that were applied. ``folder`` is where relative paths start.
    ``catalogues`` are the files of processors that the model refers to. ``warnings`` state what is
    doubtful, ``suppressions`` which rules the model suppresses. ``provenances`` are those of quantities, by
    their paths in the model.
    """

    name: str
    instances: tuple[Instance, ...]
    processors: tuple[ProcessorSpec, ...] = ()
    networks: tuple[NetworkSpec, ...] = ()
    environment: Environment = field(default_factory=Environment)
    chains: tuple[Chain, ...] = ()
    requirements: tuple[RequiredBound, ...] = ()
    memory_spaces: tuple[MemorySpace, ...] = ()
    operating_systems: tuple[OperatingSystem, ...] = ()
    devices: tuple[Device, ...] = ()
    types: Mapping[str, DataType] = field(default_factory=dict)
    design_parameters: tuple[DesignParameter, ...] = ()
    provenances: Mapping[str, Provenance] = field(default_factory=dict)
    suppressions: tuple[Suppression, ...] = ()
    limits: RunLimits = RunLimits()
    components: Mapping[str, Component] = field(default_factory=dict)
    interfaces: Mapping[str, Interface] = field(default_factory=dict)
    description: str = ""
    allocation: str = ""
    scenario: str = ""
    allocations: tuple[str, ...] = ()
    scenarios: tuple[str, ...] = ()
    overrides: tuple[str, ...] = ()
    sources: tuple[ModelFile, ...] = ()
    folder: FilePath = field(default=FilePath(), compare=False)
    catalogues: tuple[FilePath, ...] = ()
    warnings: tuple[BrokenRule, ...] = ()

    @property
    def vehicles(self) -> tuple[VehicleSpec, ...]:
        """The environment's vehicles, in the order of the model."""
        return self.environment.vehicles

    def instance(self, name: str) -> Instance:
        """Return the component instance called *name*.

        Raises:
            UsageError: there is none; lists those there are.
        """
        return _named(self.instances, name, "component instance")

    def processor(self, name: str) -> ProcessorSpec:
        """Return the processor called *name*.

        Raises:
            UsageError: there is none; lists those there are.
        """
        return _named(self.processors, name, "processor")

    def vehicle(self, name: str) -> VehicleSpec:
        """Return the vehicle called *name*.

        Raises:
            UsageError: there is none; lists those there are.
        """
        return _named(self.vehicles, name, "vehicle")

    def network_between(self, one: str, other: str) -> NetworkSpec | None:
        """Return the first network of the model that joins two processors, None if none does."""
        return next((net for net in self.networks if one in net.between and other in net.between), None)

    def file_of(self, component: Component) -> FilePath:
        """Return the path of a component's code."""
        return self.folder / component.path

    @property
    def needs_ros(self) -> bool:
        """True if a component's language or a port without operations brings ROS into the system."""
        for instance in self.instances:
            component = instance.component
            ports = [*component.provides.values(), *(port.interface for port in component.requires.values())]
            if component.language in ROS_LANGUAGES or any(map(self._is_topic_port, ports)):
                return True
        return False

    def _is_topic_port(self, interface: str) -> bool:
        return interface in self.interfaces and self.interfaces[interface].is_publish_subscribe


Thing = TypeVar("Thing", Instance, ProcessorSpec, VehicleSpec)


def _named(things: tuple[Thing, ...], name: str, noun: str) -> Thing:
    for thing in things:
        if thing.name == name:
            return thing
    names = [thing.name for thing in things]
    raise UsageError(f"no {noun} named {name!r}{did_you_mean(name, names)}; there is {choices(names)}")
