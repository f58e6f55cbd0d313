"""The system model as frozen data: what a run needs to know, with every name resolved and every unit SI.

One ``System`` is one allocation and one scenario of a model: what was inherited, overridden or left to a
default is settled. Times are ``int`` nanoseconds (``_ns``), everything else is SI and says its unit in its
name; latitude and longitude are WGS-84 degrees. ``where`` is the line of the file that a thing was read from,
for messages.

A model may be made without a file: build these by hand, they are plain data.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import TypeVar

from volery.base.errors import Location, UsageError, choices, did_you_mean
from volery.base.time import MINUTE, Ns
from volery.model.environment import Environment, Vehicle

Value = bool | int | float | str | None | Sequence["Value"] | Mapping[str, "Value"]
"""A parameter: what YAML can say. A number with a unit (``6 / h``) arrives as an SI number.
"""

VEHICLE_INTERFACES: Mapping[str, str] = {"Drone": "multirotor", "Rover": "rover"}
"""Interfaces that a vehicle provides, and the kind of vehicle that does. The component commands it over the
graph.
"""

ENVIRONMENT_INTERFACE = "Environment"
"""The interface whose port hands a component the ``Environment``: places, roads, zones, workload.
"""

LANGUAGES = ("python", "rospy", "rclpy", "c++", "roscpp", "rclcpp")
"""Languages that a model may name. Which of them run is for the ``Vocabulary`` to say."""

CPP_LANGUAGES = ("c++", "roscpp", "rclcpp")
"""Languages that are compiled."""

ROS_LANGUAGES = ("rospy", "rclpy", "roscpp", "rclcpp")
"""Languages that bring ROS into the system by themselves."""

SCHEDULERS = ("fixed-priority", "round-robin", "fifo")
"""Fixed-priority is preemptive: a greater number is more urgent, equals go in order of arrival.
"""

PROVENANCES = ("estimated", "measured", "calculated", "required")
"""Where a figure comes from (MARTE's NFP source)."""


@dataclass(frozen=True, slots=True)
class Argument:
    """An argument of an operation. ``type`` is text for people and generators: ``str``, ``Position[]``."""

    name: str
    type: str


@dataclass(frozen=True, slots=True)
class Signature:
    """An operation of an interface. ``returns`` is empty where nothing comes back."""

    name: str
    arguments: tuple[Argument, ...] = ()
    returns: str = ""


@dataclass(frozen=True, slots=True)
class Interface:
    """A named set of operations. Without operations it stands for publish and subscribe: just needs ROS."""

    name: str
    operations: Mapping[str, Signature] = field(default_factory=dict)
    where: Location | None = field(default=None, compare=False)

    @property
    def is_publish_subscribe(self) -> bool:
        """True if ports of it are not connected: their component publishes and subscribes to topics."""
        return not self.operations


@dataclass(frozen=True, slots=True)
class Figure:
    """What an operation or an activation takes, stated at a processor of the catalogue and a frequency.

    ``energy_j`` is ``None`` where the model states none. What it is at another frequency is a law's to say.
    """

    time_ns: Ns
    energy_j: float | None
    processor: str
    frequency_hz: float
    provenance: str = "estimated"
    where: Location | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Activity:
    """An active component's flow of control.

    ``period_ns`` is a promise that is checked against the releases seen; ``deadline_ns`` counts from each
    release; ``start_ns`` delays the first. A greater ``priority`` is more urgent.
    """

    period_ns: Ns | None = None
    deadline_ns: Ns | None = None
    priority: int = 0
    start_ns: Ns = 0


@dataclass(frozen=True, slots=True)
class RequiredPort:
    """What a component needs: one provider of an interface, or any number (``many``: a list is injected)."""

    name: str
    interface: str
    many: bool = False


@dataclass(frozen=True, slots=True)
class Build:
    """How C++ is compiled: options for the compiler, and libraries by the names that follow ``-l``."""

    flags: tuple[str, ...] = ()
    libraries: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Component:
    """A kind of component in the library.

    ``path`` is as written, relative to the model's folder (``System.file_of`` resolves it), and empty where
    there is no code yet; of C++ it may be a folder. ``class_name`` is the usual one where the model states
    none (``class_stated``). ``provides`` maps a port to its interface. ``activity`` is ``None`` for a passive
    component.
    ``operations`` and ``activation`` hold the figures of fidelity ``times``, one per processor kind.
    """

    name: str
    language: str
    path: str = ""
    class_name: str = ""
    class_stated: bool = False
    provides: Mapping[str, str] = field(default_factory=dict)
    requires: Mapping[str, RequiredPort] = field(default_factory=dict)
    parameters: Mapping[str, Value] = field(default_factory=dict)
    activity: Activity | None = None
    operations: Mapping[str, tuple[Figure, ...]] = field(default_factory=dict)
    activation: tuple[Figure, ...] = ()
    build: Build = Build()
    where: Location | None = field(default=None, compare=False)


class TargetKind(Enum):
    """What stands at the far end of a connection."""

    INSTANCE = "instance"
    VEHICLE = "vehicle"
    ENVIRONMENT = "environment"


@dataclass(frozen=True, slots=True)
class Target:
    """The far end of a connection: a provided ``port`` of an instance, a vehicle, or the environment."""

    kind: TargetKind
    name: str
    port: str = ""

    def __str__(self) -> str:
        return f"{self.name}.{self.port}" if self.port else self.name


@dataclass(frozen=True, slots=True)
class Connection:
    """A required port and what it is connected to: exactly one target, or any number if ``many``."""

    port: str
    interface: str
    targets: tuple[Target, ...]
    many: bool = False


@dataclass(frozen=True, slots=True)
class Instance:
    """A component that exists in the application or in the environment.

    ``parameters`` and ``activity`` are the component's with the instance's own on top. ``processor`` is
    ``None`` for the environment's components: their computing costs nothing. ``namespace`` and ``remap`` are
    ROS's.
    """

    name: str
    component: Component
    connections: Mapping[str, Connection] = field(default_factory=dict)
    parameters: Mapping[str, Value] = field(default_factory=dict)
    activity: Activity | None = None
    processor: str | None = None
    namespace: str = "/"
    remap: Mapping[str, str] = field(default_factory=dict)
    where: Location | None = field(default=None, compare=False)

    @property
    def is_environment(self) -> bool:
        """True for what surrounds the system (requesters, provider): allocated to nothing."""
        return self.processor is None


@dataclass(frozen=True, slots=True)
class Processor:
    """A computer: ``kind`` is its name in the catalogue.

    ``carried_by`` names the vehicle it rides on; ``powered_by`` the vehicle whose battery its power drains,
    ``None`` for mains. ``quantum_ns`` is the time slice of round-robin, ``None`` for the kernel's own choice.
    ``context_switch_ns`` is charged when a core goes on with another task; ``load`` is the share of each
    core, 0..1, that something else takes before all components.
    """

    name: str
    kind: str
    frequency_hz: float
    cores: int = 1
    scheduler: str = "fixed-priority"
    quantum_ns: Ns | None = None
    carried_by: str | None = None
    powered_by: str | None = None
    context_switch_ns: Ns = 0
    load: float = 0.0
    where: Location | None = field(default=None, compare=False)

    @property
    def frequency_mhz(self) -> float:
        """The same in MHz, which the laws of ROS calls are stated in."""
        return self.frequency_hz / 1e6


@dataclass(frozen=True, slots=True)
class Network:
    """Joins processors. ``loss`` is the probability, 0..1, that one transmission is lost."""

    name: str
    between: tuple[str, ...]
    bandwidth_bit_s: float
    latency_ns: Ns
    loss: float = 0.0
    where: Location | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Chain:
    """A row of topics by their full names: a node hears one and says the next."""

    name: str
    topics: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Bound:
    """A requirement: a bound on an observed quantity. ``relation`` is ``max`` or ``min``; both include the
    bound.

    ``observe`` is ``<subject>.<quantity>``; ``bound`` is in ``unit``, the unit of the observable.
    """

    name: str
    observe: str
    relation: str
    bound: float
    unit: str = ""
    description: str = ""
    where: Location | None = field(default=None, compare=False)

    def holds(self, observed: float) -> bool:
        """True if *observed* respects it; NaN (nothing was there to observe) never does."""
        return observed <= self.bound if self.relation == "max" else observed >= self.bound


@dataclass(frozen=True, slots=True)
class RunLimits:
    """How long to run: at most ``duration_ns`` of simulated time, less if ``until`` holds before."""

    duration_ns: Ns
    until: Bound | None = None


@dataclass(frozen=True, slots=True)
class Source:
    """A file that the model was read from, to be attached to the trace. ``name`` is relative to the model's
    folder.
    """

    name: str
    text: str


@dataclass(frozen=True, slots=True)
class Observable:
    """A quantity that requirements may bound: ``<subject>.<quantity>``.

    ``subject`` is the kind of thing it is of: ``component``, ``processor``, ``vehicle``,
    ``chain`` or ``application``.
    """

    subject: str
    quantity: str
    unit: str
    description: str


@dataclass(frozen=True, slots=True)
class ProcessorKind:
    """What the catalogue says of a processor: its cores and the range in which its laws are valid.

    ``settings_hz`` are the frequencies within it that can be set, ascending; empty where they are not known.
    """

    cores: int
    least_hz: float
    greatest_hz: float
    settings_hz: tuple[float, ...] = ()


Kinds = Mapping[str, ProcessorKind]


def _no_catalogue(file: Path) -> Kinds:
    return {}


@dataclass(frozen=True)
class Vocabulary:
    """Names that point out of the model, given from above: the model checks against them and knows no more.

    ``languages`` are those that run today; others of ``LANGUAGES`` are valid in a model. ``faults`` are the
    kinds that a scenario may inject. ``read_catalogue`` gives the processors of a catalogue that the model
    brings along, or raises ``ModelError``.
    """

    processors: Mapping[str, ProcessorKind]
    languages: frozenset[str]
    autopilots: frozenset[str]
    observables: tuple[Observable, ...] = ()
    faults: frozenset[str] = frozenset()
    read_catalogue: Callable[[Path], Kinds] = _no_catalogue


@dataclass(frozen=True)
class System:
    """One allocation and one scenario of a model, checked.

    ``instances`` holds the application's components, then the environment's. ``allocation`` and ``scenario``
    name what was chosen (``scenario`` empty: none), ``allocations`` and ``scenarios`` what there is to choose
    from. ``overrides`` are the ``path=value`` texts that were applied. ``folder`` is where relative paths
    start. ``catalogues`` are the files of processors that the model brings along. ``warnings`` say what is
    doubtful about it.
    """

    name: str
    instances: tuple[Instance, ...]
    processors: tuple[Processor, ...] = ()
    networks: tuple[Network, ...] = ()
    environment: Environment = field(default_factory=Environment)
    chains: tuple[Chain, ...] = ()
    requirements: tuple[Bound, ...] = ()
    limits: RunLimits = field(default_factory=lambda: RunLimits(15 * MINUTE))
    components: Mapping[str, Component] = field(default_factory=dict)
    interfaces: Mapping[str, Interface] = field(default_factory=dict)
    description: str = ""
    allocation: str = ""
    scenario: str = ""
    allocations: tuple[str, ...] = ()
    scenarios: tuple[str, ...] = ()
    overrides: tuple[str, ...] = ()
    sources: tuple[Source, ...] = ()
    folder: Path = field(default=Path(), compare=False)
    catalogues: tuple[Path, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def vehicles(self) -> tuple[Vehicle, ...]:
        """The environment's vehicles, in the order of the model."""
        return self.environment.vehicles

    def instance(self, name: str) -> Instance:
        """The component instance called *name*; ``UsageError`` lists those there are."""
        return _named(self.instances, name, "component instance")

    def processor(self, name: str) -> Processor:
        """The processor called *name*; ``UsageError`` lists those there are."""
        return _named(self.processors, name, "processor")

    def vehicle(self, name: str) -> Vehicle:
        """The vehicle called *name*; ``UsageError`` lists those there are."""
        return _named(self.vehicles, name, "vehicle")

    def network_between(self, one: str, other: str) -> Network | None:
        """The first network of the model that joins two processors, ``None`` if none does."""
        return next((net for net in self.networks if one in net.between and other in net.between), None)

    def file_of(self, component: Component) -> Path:
        """Where the component's code is."""
        return self.folder / component.path

    @property
    def needs_ros(self) -> bool:
        """True if a component's language or a port without operations brings ROS into the system."""
        return any(
            instance.component.language in ROS_LANGUAGES
            or any(self._is_topic_port(name) for name in _interfaces_of(instance.component))
            for instance in self.instances
        )

    def _is_topic_port(self, interface: str) -> bool:
        return interface in self.interfaces and self.interfaces[interface].is_publish_subscribe


def _interfaces_of(component: Component) -> list[str]:
    return [*component.provides.values(), *(port.interface for port in component.requires.values())]


Thing = TypeVar("Thing", Instance, Processor, Vehicle)


def _named(things: tuple[Thing, ...], name: str, noun: str) -> Thing:
    for thing in things:
        if thing.name == name:
            return thing
    names = [thing.name for thing in things]
    raise UsageError(f"no {noun} named {name!r}{did_you_mean(name, names)}; there is {choices(names)}")
