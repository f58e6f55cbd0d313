"""What resolving needs at hand: the form, the vocabulary, and where to put problems.

Interfaces and components: from their forms to frozen data, with what they refer to checked.

Processors, networks, and who runs where.

Instances and what they are connected to, in the application and around it.

The environment: every point in degrees and in metres, vehicles, what breaks.

Requirements: bounds on published observables, in their unit.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from math import cos, hypot, pi, sin
from pathlib import Path as FilePath
from typing import Any

from volery.base import units
from volery.base.errors import Location, ModelError
from volery.base.frames import LocalFrame
from volery.base.units import Kind, QuantityError
from volery.model.document import (
    ActivityForm,
    BoundForm,
    ComponentForm,
    FigureForm,
    InstanceForm,
    ModelForm,
    NetworkForm,
    PlaceForm,
    PointForm,
    PrismForm,
    ProcessorForm,
    ReferenceForm,
    SignatureForm,
    VehicleForm,
    WaysForm,
)
from volery.model.environment import (
    Battery,
    Environment,
    Fault,
    Place,
    Prism,
    Vehicle,
    Ways,
    Wind,
    Workload,
)
from volery.model.system import (
    CPP_LANGUAGES,
    ENVIRONMENT_INTERFACE,
    VEHICLE_INTERFACES,
    Activity,
    Argument,
    Bound,
    Build,
    Chain,
    Component,
    Connection,
    Figure,
    Instance,
    Interface,
    Network,
    Observable,
    Processor,
    ProcessorKind,
    RequiredPort,
    RunLimits,
    Signature,
    Target,
    TargetKind,
    Value,
    Vocabulary,
)
from volery.model.text import Node, Path, Problems

RESERVED = ("application", "environment")
"""Names that messages, observables and ports use for the whole."""


@dataclass(frozen=True)
class Context:
    """One resolution: form to system."""

    form: ModelForm
    vocabulary: Vocabulary
    problems: Problems
    folder: FilePath

    def where(self, path: Path) -> Location | None:
        """Where *path* stands."""
        return self.problems.where(path)

    def known(self, path: Path, name: str, noun: str, valid: Iterable[str]) -> bool:
        """True if *name* is one of the *valid* ones; otherwise notes the problem."""
        names = list(valid)
        if name not in names:
            self.problems.unknown(path, name, noun, names)
        return name in names


SPECIAL = (*VEHICLE_INTERFACES, ENVIRONMENT_INTERFACE)
INSTANCE_KEYS = ("is", "component", "parameters", "active", "namespace", "remap")
_MANY = "[]"


def interfaces(context: Context) -> dict[str, Interface]:
    """The model's interfaces. Those of vehicles and of the environment exist by themselves."""
    found = {}
    for name, operations in context.form.interfaces.items():
        path: Path = ("interfaces", name)
        if name in SPECIAL:
            context.problems.add(path, f"{name} is there in every model; choose another name")
        signatures = {operation: _signature(operation, form) for operation, form in operations.items()}
        found[name] = Interface(name, signatures, context.where(path))
    return found


def _signature(name: str, form: SignatureForm) -> Signature:
    return Signature(name, tuple(Argument(*pair) for pair in form.args.items()), form.returns)


def components(context: Context, known: dict[str, Interface]) -> dict[str, Component]:
    """The library."""
    return {name: _component(context, name, form, known) for name, form in context.form.components.items()}


def _component(context: Context, name: str, form: ComponentForm, known: dict[str, Interface]) -> Component:
    path: Path = ("components", name)
    _check_file(context, path, form)
    for port, interface in form.provides.items():
        _check_provided(context, (*path, "provides", port), interface, known)
    requires = {
        port: _required(context, (*path, "requires", port), port, text, known)
        for port, text in form.requires.items()
    }
    operations = {
        operation: _figures(context, (*path, "operations", operation), figures, form.at)
        for operation, figures in form.operations.items()
    }
    _check_operations(context, path, form, known)
    return Component(
        name=name,
        language=form.language,
        path=form.path,
        class_name=form.class_name or camel_case(name),
        class_stated=bool(form.class_name),
        provides=form.provides,
        requires=requires,
        parameters=parameters(form.parameters),
        activity=activity(form.active),
        operations=operations,
        activation=_figures(context, (*path, "activation"), form.activation, form.at),
        build=Build(tuple(form.build.flags), tuple(form.build.libraries)),
        where=context.where(path),
    )


def camel_case(name: str) -> str:
    """The class that a component's file is expected to define: ``drone_control`` gives ``DroneControl``."""
    return "".join(part[:1].upper() + part[1:] for part in re.split(r"[_-]+", name))


def parameters(written: dict[str, Value]) -> dict[str, Value]:
    """A copy of its own."""
    return dict(written)


def activity(form: ActivityForm | None) -> Activity | None:
    """An active component's flow of control. Without a deadline, a period is one."""
    if form is None:
        return None
    deadline = form.deadline if form.deadline is not None else form.period
    return Activity(form.period, deadline, form.priority, form.start)


def _check_file(context: Context, path: Path, form: ComponentForm) -> None:
    file = context.folder / form.path
    if form.path and not (file.is_file() or (form.language in CPP_LANGUAGES and file.is_dir())):
        there = sorted(found.name for found in file.parent.glob("*") if found.is_file())
        beside = f"; in that folder there is {', '.join(there[:8])}" if there else ""
        context.problems.add((*path, "path"), f"there is no file {form.path!r} beside the model{beside}")


def _check_provided(context: Context, path: Path, interface: str, known: dict[str, Interface]) -> None:
    if interface in SPECIAL:
        who = "the environment" if interface == ENVIRONMENT_INTERFACE else "a vehicle"
        context.problems.add(path, f"{interface} is provided by {who}, not by a component")
    else:
        context.known(path, interface, "interface", known)


def _required(
    context: Context, path: Path, port: str, text: str, known: dict[str, Interface]
) -> RequiredPort:
    many = text.endswith(_MANY)
    interface = text.removesuffix(_MANY).strip()
    context.known(path, interface, "interface", [*known, *SPECIAL])
    if port in INSTANCE_KEYS:
        context.problems.add(
            path, f"a required port cannot be called {port!r}: instances have a key of that name"
        )
    return RequiredPort(port, interface, many)


def _check_operations(context: Context, path: Path, form: ComponentForm, known: dict[str, Interface]) -> None:
    offered = [
        operation
        for interface in form.provides.values()
        if interface in known
        for operation in known[interface].operations
    ]
    for operation in form.operations:
        context.known((*path, "operations", operation), operation, "operation of its provided ports", offered)


def _figures(
    context: Context, path: Path, forms: list[FigureForm], default: ReferenceForm | None
) -> tuple[Figure, ...]:
    found = (_figure(context, path, form, form.at or default) for form in forms)
    return tuple(figure for figure in found if figure is not None)


def _figure(context: Context, path: Path, form: FigureForm, at: ReferenceForm | None) -> Figure | None:
    if at is None:
        what = "a time means nothing without where it was taken: add `at: {processor: ..., frequency: ...}`"
        context.problems.add(path, what)
        return None
    check_processor(context, (*path, "at"), "processor", at.processor, at.frequency)
    return Figure(form.time, form.energy, at.processor, at.frequency, form.provenance, context.where(path))


def check_processor(context: Context, path: Path, key: str, kind: str, frequency_hz: float) -> None:
    """Note it if the catalogue has no such processor (named by *key*), or none at that frequency."""
    catalogue = context.vocabulary.processors
    if not context.known((*path, key), kind, "processor in the catalogue", catalogue):
        return
    least, greatest = catalogue[kind].least_hz, catalogue[kind].greatest_hz
    if not least <= frequency_hz <= greatest:
        context.problems.add(
            (*path, "frequency"),
            f"{frequency_hz / 1e6:g} MHz is outside what is known of {kind}: "
            f"{least / 1e6:g} to {greatest / 1e6:g} MHz",
        )


def catalogues(context: Context) -> tuple[FilePath, ...]:
    """The files of processors that the model brings along."""
    return tuple(context.folder / name for name in context.form.platform.catalogues)


def with_catalogues(context: Context) -> Context:
    """The same with the processors of those files among the names that are known."""
    known = dict(context.vocabulary.processors)
    for position, file in enumerate(catalogues(context)):
        try:
            known.update(context.vocabulary.read_catalogue(file))
        except ModelError as error:
            context.problems.add(("platform", "catalogues", position), str(error))
    return replace(context, vocabulary=replace(context.vocabulary, processors=known))


def processors(context: Context) -> tuple[Processor, ...]:
    """The platform's computers, checked against the catalogue."""
    forms = context.form.platform.processors
    return tuple(_processor(context, name, form) for name, form in forms.items())


def _processor(context: Context, name: str, form: ProcessorForm) -> Processor:
    path: Path = ("platform", "processors", name)
    check_processor(context, path, "is", form.kind, form.frequency)
    kind = context.vocabulary.processors.get(form.kind)
    if kind is not None:
        _check_setting(context, (*path, "frequency"), form, kind)
    vehicles = context.form.environment.vehicles
    for key, vehicle in (("carried_by", form.carried_by), ("powered_by", form.powered_by)):
        if vehicle is not None and (key, vehicle) != ("powered_by", "mains"):
            context.known((*path, key), vehicle, "vehicle", vehicles)
    if kind is not None and form.cores is not None and form.cores > kind.cores:
        context.problems.add((*path, "cores"), f"{form.kind} has {kind.cores} cores, not {form.cores}")
    powered_by = form.powered_by if form.powered_by is not None else form.carried_by
    return Processor(
        name=name,
        kind=form.kind,
        frequency_hz=form.frequency,
        cores=form.cores or (kind.cores if kind else 1),
        scheduler=form.scheduler,
        quantum_ns=form.quantum,
        context_switch_ns=form.context_switch,
        load=form.load,
        carried_by=form.carried_by,
        powered_by=None if powered_by == "mains" else powered_by,
        where=context.where(path),
    )


def _check_setting(context: Context, path: Path, form: ProcessorForm, kind: ProcessorKind) -> None:
    """Warn of a frequency between two that the processor can be set to."""
    below = [one for one in kind.settings_hz if one < form.frequency]
    above = [one for one in kind.settings_hz if one > form.frequency]
    if form.frequency not in kind.settings_hz and below and above:
        context.problems.warn(
            path,
            f"{form.kind} cannot be set to {form.frequency / 1e6:g} MHz; "
            f"the nearest settings are {below[-1] / 1e6:g} and {above[0] / 1e6:g} MHz",
        )


def networks(context: Context) -> tuple[Network, ...]:
    """What joins the computers."""
    return tuple(_network(context, name, form) for name, form in context.form.platform.networks.items())


def _network(context: Context, name: str, form: NetworkForm) -> Network:
    path: Path = ("platform", "networks", name)
    for position, end in enumerate(form.between):
        context.known((*path, "between", position), end, "processor", context.form.platform.processors)
    if len(set(form.between)) != len(form.between):
        context.problems.add((*path, "between"), "a processor stands here twice")
    between = tuple(form.between)
    return Network(name, between, form.bandwidth, form.latency, form.loss, context.where(path))


def check_names(context: Context) -> None:
    """Observables and allocations go by name, so no two things of a run may share one."""
    environment = context.form.environment
    taken: dict[str, str] = dict.fromkeys(RESERVED, "a word of the model")
    sections: tuple[tuple[Path, list[str], str], ...] = (
        (("application",), list(context.form.application), "a component instance"),
        (("environment", "components"), list(environment.components), "a component instance"),
        (("environment", "vehicles"), list(environment.vehicles), "a vehicle"),
        (("platform", "processors"), list(context.form.platform.processors), "a processor"),
        (("chains",), list(context.form.chains), "a chain"),
    )
    for section, names, what in sections:
        for name in names:
            if name in taken:
                context.problems.add(
                    (*section, name), f"{name!r} is already {taken[name]}; choose another name"
                )
            taken.setdefault(name, what)


def check_all_variants(context: Context) -> None:
    """Every allocation and scenario of the model, chosen or not, speaks of things that exist."""
    allocations, scenarios = context.form.allocations, context.form.scenarios
    for name, scenario in scenarios.items():
        if scenario.extends is not None:
            context.known(("scenarios", name, "extends"), scenario.extends, "scenario", scenarios)
        if scenario.allocation is not None:
            context.known(("scenarios", name, "allocation"), scenario.allocation, "allocation", allocations)
    for name, form in allocations.items():
        if form.extends is not None:
            context.known(("allocations", name, "extends"), form.extends, "allocation", allocations)
        for who, processor in form.places.items():
            _check_place(context, ("allocations", name, who), who, processor)


def _check_place(context: Context, path: Path, who: str, processor: str) -> None:
    environment = context.form.environment
    if who in environment.components:
        context.problems.add(path, f"{who} belongs to the environment: it runs nowhere and costs nothing")
        return
    if context.known(
        path, who, "component instance or vehicle", [*context.form.application, *environment.vehicles]
    ):
        context.known(path, processor, "processor", context.form.platform.processors)


def places(context: Context, allocation: str, chosen: dict[str, Node] | None) -> dict[str, str]:
    """Instance or vehicle to processor, by the chosen allocation; notes instances that run nowhere."""
    found = {who: str(node.value) for who, node in (chosen or {}).items()}
    for name in context.form.application:
        if name not in found:
            path: Path = ("allocations", allocation) if allocation else ("application", name)
            which = f"allocation {allocation!r}" if allocation else "this model has no allocation and"
            context.problems.add(path, f"{which} does not say where {name} runs")
    return found


def vehicle_processor(context: Context, vehicle: str, found: dict[str, str]) -> str | None:
    """Where the node runs that serves *vehicle*: as allocated, or the one computer that it carries."""
    if vehicle in found:
        return found[vehicle]
    carried = [name for name, form in context.form.platform.processors.items() if form.carried_by == vehicle]
    if len(carried) > 1:
        context.problems.add(
            ("environment", "vehicles", vehicle),
            f"it carries {' and '.join(carried)}: the allocation must say where its node runs, "
            f"such as `{vehicle}: {carried[0]}`",
        )
    return carried[0] if len(carried) == 1 else None


def check_reach(context: Context, made: tuple[Instance, ...], joined: tuple[Network, ...]) -> None:
    """A call between two computers needs a network."""
    processor_of = {instance.name: instance.processor for instance in made}
    for instance in made:
        for connection in instance.connections.values():
            for target in connection.targets:
                here, there = instance.processor, processor_of.get(target.name)
                if target.kind is TargetKind.INSTANCE and not _joined(here, there, joined):
                    context.problems.add(
                        ("application", instance.name, connection.port),
                        f"{instance.name} on {here} calls {target.name} on {there}: no network joins them",
                    )


def _joined(here: str | None, there: str | None, joined: tuple[Network, ...]) -> bool:
    """True if a call gets from *here* to *there*; the environment (``None``) is everywhere."""
    if here is None or there is None or here == there:
        return True
    return any(here in network.between and there in network.between for network in joined)


APPLICATION_PATH: Path = ("application",)
AROUND: Path = ("environment", "components")


@dataclass(frozen=True)
class Surroundings:
    """What connections may refer to."""

    context: Context
    interfaces: dict[str, Interface]
    components: dict[str, Component]

    @property
    def forms(self) -> dict[str, InstanceForm]:
        """All instances, the application's first."""
        return {**self.context.form.environment.components, **self.context.form.application}

    def component_of(self, instance: str) -> Component | None:
        """What an instance is; ``None`` if that is unknown."""
        form = self.forms.get(instance)
        return self.components.get(form.component) if form else None


def instances(surroundings: Surroundings, processors: dict[str, str]) -> tuple[Instance, ...]:
    """The application's instances on their *processors*, then the environment's."""
    form = surroundings.context.form
    sections = ((APPLICATION_PATH, form.application), (AROUND, form.environment.components))
    found = [
        _instance(
            surroundings,
            (*section, name),
            entry,
            processors.get(name) if section == APPLICATION_PATH else None,
        )
        for section, entries in sections
        for name, entry in entries.items()
    ]
    made = tuple(instance for instance in found if instance is not None)
    _check_cycles(surroundings.context, made)
    return made


def _instance(
    surroundings: Surroundings, path: Path, form: InstanceForm, processor: str | None
) -> Instance | None:
    context = surroundings.context
    if not context.known((*path, "is"), form.component, "component", surroundings.components):
        return None
    component = surroundings.components[form.component]
    settings = _merged(component.parameters, form.parameters)
    for name in settings:
        if name in component.requires:
            what = f"{name!r} is a required port of {component.name}; a parameter needs another name"
            context.problems.add((*path, "parameters", name), what)
    return Instance(
        name=str(path[-1]),
        component=component,
        connections=_connections(surroundings, path, form, component),
        parameters=settings,
        activity=_activity(component.activity, form),
        processor=processor,
        namespace=form.namespace,
        remap=form.remap,
        where=context.where(path),
    )


def _merged(default: Any, own: Any) -> dict[str, Any]:
    return {**default, **own}


def _activity(default: Activity | None, form: InstanceForm) -> Activity | None:
    """The instance's own words on top of the component's."""
    if "active" not in form.model_fields_set:
        return default
    if default is None or form.active is None:
        return activity(form.active)
    said = form.active.model_fields_set
    base = ActivityForm.model_construct(
        period=form.active.period if "period" in said else default.period_ns,
        deadline=form.active.deadline if said & {"deadline", "period"} else default.deadline_ns,
        priority=form.active.priority if "priority" in said else default.priority,
        start=form.active.start if "start" in said else default.start_ns,
    )
    return activity(base)


def _connections(
    surroundings: Surroundings, path: Path, form: InstanceForm, component: Component
) -> dict[str, Connection]:
    context = surroundings.context
    found = {}
    for port, texts in form.ports.items():
        if context.known((*path, port), port, f"required port of {component.name}", component.requires):
            connection = _connection(surroundings, (*path, port), component.requires[port], texts)
            if connection is not None:
                found[port] = connection
    for required in component.requires.values():
        if required.name not in form.ports and not _is_topic(surroundings, required.interface):
            candidates = _candidates(surroundings, required.interface)
            context.problems.add(path, f"the required port {required.name!r} is not connected; {candidates}")
    return found


def _is_topic(surroundings: Surroundings, interface: str) -> bool:
    known = surroundings.interfaces.get(interface)
    return known is not None and known.is_publish_subscribe


def _candidates(surroundings: Surroundings, interface: str) -> str:
    """What a port of an interface could be connected to."""
    if interface == ENVIRONMENT_INTERFACE:
        return f"{interface} is provided by environment"
    if interface in VEHICLE_INTERFACES:
        kind = VEHICLE_INTERFACES[interface]
        vehicles = surroundings.context.form.environment.vehicles
        names = [name for name, vehicle in vehicles.items() if vehicle.kind == kind]
    else:
        names = [
            f"{name}.{port}"
            for name, form in surroundings.forms.items()
            if (component := surroundings.components.get(form.component)) is not None
            for port, provided in component.provides.items()
            if provided == interface
        ]
    return f"{interface} is provided by {' and '.join(names) or 'nothing in this model'}"


def _connection(
    surroundings: Surroundings, path: Path, port: RequiredPort, texts: list[str]
) -> Connection | None:
    problems = surroundings.context.problems
    if _is_topic(surroundings, port.interface):
        problems.add(
            path, f"{port.interface} has no operations: it is publish and subscribe, nothing is connected"
        )
        return None
    if not port.many and len(texts) != 1:
        problems.add(path, f"one {port.interface} is required here; for a list, require {port.interface}[]")
        return None
    targets = [_target(surroundings, path, port, text) for text in texts]
    if any(target is None for target in targets):
        return None
    return Connection(port.name, port.interface, tuple(filter(None, targets)), port.many)


def _target(surroundings: Surroundings, path: Path, port: RequiredPort, text: str) -> Target | None:
    if port.interface in VEHICLE_INTERFACES:
        return _vehicle_target(surroundings, path, port.interface, text)
    if port.interface == ENVIRONMENT_INTERFACE:
        known = surroundings.context.known(path, text, "provider of Environment", ["environment"])
        return Target(TargetKind.ENVIRONMENT, text) if known else None
    return _provided(surroundings, path, port.interface, text)


def _vehicle_target(surroundings: Surroundings, path: Path, interface: str, text: str) -> Target | None:
    vehicles = surroundings.context.form.environment.vehicles
    if not surroundings.context.known(path, text, "vehicle", vehicles):
        return None
    if vehicles[text].kind != VEHICLE_INTERFACES[interface]:
        what = f"{text} is a {vehicles[text].kind}; {_candidates(surroundings, interface)}"
        surroundings.context.problems.add(path, what)
        return None
    return Target(TargetKind.VEHICLE, text)


def _provided(surroundings: Surroundings, path: Path, interface: str, text: str) -> Target | None:
    context = surroundings.context
    name, dot, port = text.partition(".")
    if not context.known(path, name, "component instance", surroundings.forms):
        return None
    component = surroundings.component_of(name)
    if component is None:
        return None
    if not dot or port not in component.provides:
        has = ", ".join(f"{name}.{provided}" for provided in component.provides) or "no provided port"
        context.problems.add(path, f"{text!r} is no provided port; {name} has {has}")
        return None
    if component.provides[port] != interface:
        candidates = _candidates(surroundings, interface)
        what = f"{text} provides {component.provides[port]}, not {interface}; {candidates}"
        context.problems.add(path, what)
        return None
    return Target(TargetKind.INSTANCE, name, port)


def _check_cycles(context: Context, made: tuple[Instance, ...]) -> None:
    """A call waits for its callee, so calls that lead back to their caller would wait for themselves."""
    calls = {
        instance.name: [
            target.name
            for connection in instance.connections.values()
            for target in connection.targets
            if target.kind is TargetKind.INSTANCE
        ]
        for instance in made
    }
    try:
        TopologicalSorter(calls).prepare()
    except CycleError as error:
        around = list(reversed(error.args[1]))
        section = APPLICATION_PATH if around[0] in context.form.application else AROUND
        context.problems.add(
            (*section, around[0]),
            f"a cycle of required ports: {' -> '.join(around)}; a call would wait for itself. "
            "Let one of them tell the other by a topic (an interface without operations)",
        )


CIRCLE_CORNERS = 32
FARTHEST_M = 100_000.0
"""A local frame is a tangent plane: beyond this its ground has curved away by hundreds of metres."""

_ENVIRONMENT: Path = ("environment",)


class _Geography:
    """Points of the text to places of the model."""

    def __init__(self, context: Context) -> None:
        self.context = context
        origin = context.form.environment.origin
        self.frame = LocalFrame(origin.latitude, origin.longitude, origin.amsl)
        self.places: dict[str, Place] = {}

    def point(self, path: Path, name: str, form: PointForm, role: str = "") -> Place | None:
        """The place of a point; ``None``, with the problem noted, if it is not one."""
        said = {
            key
            for key in ("place", "east", "north", "latitude", "longitude")
            if getattr(form, key) is not None
        }
        if said == {"place"} and form.place is not None:
            known = self.context.known(path, form.place, "place", self.places)
            return self.places[form.place] if known else None
        if said == {"latitude", "longitude"} and form.latitude is not None and form.longitude is not None:
            east, north, _ = self.frame.to_enu(form.latitude, form.longitude, self.frame.amsl)
            latitude, longitude = form.latitude, form.longitude
        elif said <= {"east", "north"} and said:
            east, north = form.east or 0.0, form.north or 0.0
            latitude, longitude, _ = self.frame.from_enu((east, north, 0.0))
        else:
            self.context.problems.add(
                path,
                "a point is {east, north} from the origin, {latitude, longitude}, or the name of a place",
            )
            return None
        if hypot(east, north) > FARTHEST_M:
            away = hypot(east, north) / 1000.0
            what = f"{away:.0f} km from the origin; at most {FARTHEST_M / 1000:.0f} km make sense"
            self.context.problems.add(path, what)
        return Place(name, latitude, longitude, self.frame.amsl, east, north, role)

    def read_places(self, forms: dict[str, PlaceForm]) -> None:
        """Places may stand where another one does; those come after the others."""
        later = [name for name, form in forms.items() if form.place is not None]
        for name in [*(name for name in forms if name not in later), *later]:
            form = forms[name]
            made = self.point((*_ENVIRONMENT, "places", name), name, form, form.role)
            if made is not None:
                own = Place(
                    name, made.latitude, made.longitude, made.amsl_m, made.east_m, made.north_m, form.role
                )
                self.places[name] = own
        self.places = {name: self.places[name] for name in forms if name in self.places}


def environment(context: Context, found: dict[str, str]) -> Environment:
    """All of it. *found* says on which processors the vehicles' nodes are allocated."""
    form = context.form.environment
    geography = _Geography(context)
    geography.read_places(form.places)
    return Environment(
        origin=geography.frame,
        places=geography.places,
        roads=_ways(geography, (*_ENVIRONMENT, "roads"), form.roads),
        corridors=_ways(geography, (*_ENVIRONMENT, "corridors"), form.corridors),
        no_fly_zones=_prisms(geography, (*_ENVIRONMENT, "no_fly_zones"), form.no_fly_zones),
        buildings=_prisms(geography, (*_ENVIRONMENT, "buildings"), form.buildings),
        wind=Wind(form.wind.speed, form.wind.direction % 360.0, form.wind.gusts),
        vehicles=_vehicles(geography, found),
        workload=_workload(context),
        faults=_faults(context),
    )


def _workload(context: Context) -> Workload:
    form = context.form.environment.workload
    orders = form.orders
    return Workload(form.requesters, orders.rate, orders.count, orders.first, orders.seed)


def _ways(geography: _Geography, path: Path, form: WaysForm) -> Ways:
    junctions = {
        name: geography.point((*path, "junctions", name), name, point)
        for name, point in form.junctions.items()
    }
    known = {**geography.places, **{name: place for name, place in junctions.items() if place is not None}}
    edges: list[tuple[str, str, float]] = []
    for number, way in enumerate(form.ways):
        here: Path = (*path, "ways", number)
        if len(way) < 2:
            geography.context.problems.add(here, "a way joins at least two places or junctions")
        ends = [
            known[name] for name in way if geography.context.known(here, name, "place or junction", known)
        ]
        edges += [_edge(one, other) for one, other in pairwise(ends)]
    used = {name for edge in edges for name in edge[:2]}
    return Ways({name: place for name, place in known.items() if name in used}, tuple(edges), form.height)


def _edge(one: Place, other: Place) -> tuple[str, str, float]:
    return one.name, other.name, hypot(other.east_m - one.east_m, other.north_m - one.north_m)


def _prisms(geography: _Geography, path: Path, forms: dict[str, PrismForm]) -> tuple[Prism, ...]:
    found = (_prism(geography, (*path, name), name, form) for name, form in forms.items())
    return tuple(prism for prism in found if prism is not None)


def _prism(geography: _Geography, path: Path, name: str, form: PrismForm) -> Prism | None:
    ceiling = form.ceiling if form.ceiling is not None else float("inf")
    if ceiling <= form.floor:
        geography.context.problems.add(
            path, f"its ceiling ({ceiling:g} m) is not above its floor ({form.floor:g} m)"
        )
    if form.centre is not None and form.radius and not form.corners:
        centre = geography.point((*path, "centre"), name, form.centre)
        return Prism(name, _circle(centre, form.radius), form.floor, ceiling) if centre else None
    if len(form.corners) >= 3 and form.centre is None and form.radius is None:
        corners = [
            geography.point((*path, "corners", number), name, point)
            for number, point in enumerate(form.corners)
        ]
        flat = tuple((corner.east_m, corner.north_m) for corner in corners if corner is not None)
        return Prism(name, flat, form.floor, ceiling) if len(flat) == len(corners) else None
    geography.context.problems.add(path, "give at least three corners, or a centre and a radius")
    return None


def _circle(centre: Place, radius: float) -> tuple[tuple[float, float], ...]:
    """The regular polygon around the circle: no part of the circle is outside it."""
    outer = radius / cos(pi / CIRCLE_CORNERS)
    angles = [2.0 * pi * corner / CIRCLE_CORNERS for corner in range(CIRCLE_CORNERS)]
    return tuple(
        (centre.east_m + outer * cos(angle), centre.north_m + outer * sin(angle)) for angle in angles
    )


def _vehicles(geography: _Geography, found: dict[str, str]) -> tuple[Vehicle, ...]:
    forms = geography.context.form.environment.vehicles
    made = (_vehicle(geography, name, form, found) for name, form in forms.items())
    return tuple(vehicle for vehicle in made if vehicle is not None)


def _vehicle(geography: _Geography, name: str, form: VehicleForm, found: dict[str, str]) -> Vehicle | None:
    context = geography.context
    path: Path = (*_ENVIRONMENT, "vehicles", name)
    context.known((*path, "autopilot"), form.autopilot, "autopilot", sorted(context.vocabulary.autopilots))
    processor = vehicle_processor(context, name, found)
    at = geography.point((*path, "at"), name, form.at)
    if at is None:
        return None
    battery: Any = form.battery
    return Vehicle(
        name=name,
        kind=form.kind,
        autopilot=form.autopilot,
        at=at,
        heading_deg=form.heading % 360.0,
        battery=Battery(battery.capacity, battery.charge, battery.voltage) if battery else None,
        sensors=form.sensors,
        started=form.started,
        parameters=form.parameters,
        processor=processor,
        where=context.where(path),
    )


def _faults(context: Context) -> tuple[Fault, ...]:
    form = context.form.environment
    for name, fault in form.faults.items():
        path: Path = (*_ENVIRONMENT, "faults", name)
        context.known((*path, "kind"), fault.kind, "kind of fault", sorted(context.vocabulary.faults))
        context.known((*path, "vehicle"), fault.vehicle, "vehicle", form.vehicles)
    return tuple(
        Fault(name, fault.kind, fault.vehicle, fault.at, fault.duration)
        for name, fault in form.faults.items()
    )


APPLICATION = "application"


def requirements(context: Context) -> tuple[Bound, ...]:
    """The model's requirements."""
    found = (
        bound(context, ("requirements", name), name, form) for name, form in context.form.requirements.items()
    )
    return tuple(requirement for requirement in found if requirement is not None)


def chains(context: Context) -> tuple[Chain, ...]:
    """The model's chains of topics."""
    for name, topics in context.form.chains.items():
        for place, topic in enumerate(topics):
            if not topic.startswith("/"):
                context.problems.add(
                    ("chains", name, place), f"{topic!r}: write a topic's full name, such as '/{topic}'"
                )
    return tuple(Chain(name, tuple(topics)) for name, topics in context.form.chains.items())


def limits(context: Context) -> RunLimits:
    """How long to run."""
    form = context.form.run
    until = bound(context, ("run", "until"), "until", form.until) if form.until else None
    return RunLimits(form.duration, until)


def bound(context: Context, path: Path, name: str, form: BoundForm) -> Bound | None:
    """One bound; ``None``, with the problem noted, if it makes no sense."""
    observable = _observable(context, (*path, "observe"), form.observe)
    said = [
        (relation, value) for relation, value in (("max", form.max), ("min", form.min)) if value is not None
    ]
    if len(said) != 1:
        context.problems.add(path, "give exactly one of max and min")
        return None
    if observable is None:
        return None
    relation, value = said[0]
    try:
        number = units.read(value, _kind(observable))
    except QuantityError as error:
        context.problems.add((*path, relation), f"{form.observe} is {_measured(observable)}: {error}")
        return None
    where = context.where(path)
    return Bound(name, form.observe, relation, number, observable.unit, form.description, where)


def _kind(observable: Observable) -> Kind:
    unit = observable.unit
    return Kind("bound", unit or "1", f"0.5 {unit}" if unit else "3")


def _measured(observable: Observable) -> str:
    return f"measured in {observable.unit}" if observable.unit else "a plain number"


def _observable(context: Context, path: Path, text: str) -> Observable | None:
    subject, _, quantity = text.rpartition(".")
    kinds = subjects(context)
    if not context.known(path, subject, "subject to observe", kinds):
        return None
    offered = {
        observable.quantity: observable
        for observable in context.vocabulary.observables
        if observable.subject == kinds[subject]
    }
    if not context.known(path, quantity, f"quantity of a {kinds[subject]}", offered):
        return None
    return offered[quantity]


def subjects(context: Context) -> dict[str, str]:
    """Whatever may be observed, by name, with the kind of thing it is."""
    form = context.form
    return {
        APPLICATION: "application",
        **dict.fromkeys(form.application, "component"),
        **dict.fromkeys(form.environment.components, "component"),
        **dict.fromkeys(form.platform.processors, "processor"),
        **dict.fromkeys(form.environment.vehicles, "vehicle"),
        **dict.fromkeys(form.chains, "chain"),
    }
