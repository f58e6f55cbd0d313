"""Component instances and their connections, in the application and in the environment."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from graphlib import CycleError, TopologicalSorter
from typing import Annotated, Any

from volery.base.errors import Location, choices
from volery.model import rules
from volery.model.components import (
    ACTIVITY,
    ENVIRONMENT_INTERFACE,
    LIBRARY,
    VEHICLE_INTERFACES,
    Activity,
    Component,
    RequiredPort,
    Value,
    library,
)
from volery.model.fields import (
    ANYTHING,
    TEXT,
    VEHICLE,
    Key,
    ListOf,
    MapOf,
    Others,
    Record,
    Schema,
    Syntax,
    WrongValueError,
    expected,
)
from volery.model.reading import ModelReading
from volery.model.text import Path, TextNode

APPLICATION: Path = ("application",)
AROUND: Path = ("environment", "components")
_VEHICLES: Path = ("environment", "vehicles")


class TargetKind(Enum):
    """The kind of thing at the far end of a connection."""

    INSTANCE = "instance"
    VEHICLE = "vehicle"
    ENVIRONMENT = "environment"


@dataclass(frozen=True, slots=True)
class ConnectionTarget:
    """The far end of a connection: a provided ``port`` of an instance, a vehicle, or the environment."""

    kind: TargetKind
    name: str
    port: str = ""

    def __str__(self) -> str:
        return f"{self.name}.{self.port}" if self.port else self.name


@dataclass(frozen=True, slots=True)
class PortConnection:
    """A required port and what it is connected to: exactly one target, or any number if ``many``."""

    port: str
    interface: str
    targets: tuple[ConnectionTarget, ...]
    many: bool = False


# -- connections


def component_of(reading: ModelReading, instance: str) -> Component | None:
    """Return the component of an instance, None if that is unknown."""
    node = reading.root.at((*APPLICATION, instance, "is")) or reading.root.at((*AROUND, instance, "is"))
    return reading.once(library).get(str(node.value)) if node is not None else None


def _is_topic(reading: ModelReading, interface: str) -> bool:
    return interface in reading.names(("interfaces",)) and not reading.names(("interfaces", interface))


def _kind_of_vehicle(reading: ModelReading, vehicle: str) -> str:
    node = reading.root.at((*_VEHICLES, vehicle, "kind"))
    return str(node.value) if node is not None else ""


def _candidates(reading: ModelReading, interface: str) -> str:
    """Return what a port of *interface* could be connected to, for a message."""
    if interface == ENVIRONMENT_INTERFACE:
        return f"{interface} is provided by environment"
    if interface in VEHICLE_INTERFACES:
        kind = VEHICLE_INTERFACES[interface]
        names = [name for name in reading.names(_VEHICLES) if _kind_of_vehicle(reading, name) == kind]
    else:
        names = [
            f"{name}.{port}"
            for name in reading.names(AROUND, APPLICATION)
            if (component := component_of(reading, name)) is not None
            for port, provided in component.provides.items()
            if provided == interface
        ]
    return f"{interface} is provided by {' and '.join(names) or 'nothing in this model'}"


TARGETS = ListOf(TEXT, bare=True)


class _Connections(Syntax):
    """The required ports of an instance by name, and what each is connected to."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> dict[str, PortConnection]:
        """See ``Syntax``. *path* is that of the instance."""
        component = component_of(reading, str(path[-1]))
        if component is None:  # reported where the instance names it
            return {}
        found = {}
        for name, below in node.items.items():
            at = (*path, name)
            if not reading.known(at, name, f"required port of {component.name}", component.requires):
                continue
            try:
                texts = TARGETS.read(below, at, reading)
            except WrongValueError as error:
                if str(error):
                    reading.problems.add(at, str(error), below.where, error.rule)
                continue
            connection = _connection(reading, at, component.requires[name], texts)
            if connection is not None:
                found[name] = connection
        for port in component.requires.values():
            if port.name not in node.items and not _is_topic(reading, port.interface):
                candidates = _candidates(reading, port.interface)
                what = f"the required port {port.name!r} is not connected; {candidates}"
                reading.problems.add(path, what, rule=rules.UNCONNECTED)
        return found

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"additionalProperties": TARGETS.schema(definitions)}


def _connection(
    reading: ModelReading, path: Path, port: RequiredPort, texts: tuple[str, ...]
) -> PortConnection | None:
    if _is_topic(reading, port.interface):
        what = f"{port.interface} has no operations: it is publish and subscribe, nothing is connected"
        reading.problems.add(path, what, rule=rules.TOPIC_CONNECTED)
        return None
    if not port.many and len(texts) != 1:
        what = f"one {port.interface} is required here; for a list, require {port.interface}[]"
        reading.problems.add(path, what, rule=rules.DOUBLY_CONNECTED)
        return None
    targets = [_target(reading, path, port.interface, text) for text in texts]
    if any(target is None for target in targets):
        return None
    return PortConnection(port.name, port.interface, tuple(filter(None, targets)), port.many)


def _target(reading: ModelReading, path: Path, interface: str, text: str) -> ConnectionTarget | None:
    if interface in VEHICLE_INTERFACES:
        return _vehicle_target(reading, path, interface, text)
    if interface == ENVIRONMENT_INTERFACE:
        known = reading.known(path, text, "provider of Environment", ["environment"])
        return ConnectionTarget(TargetKind.ENVIRONMENT, text) if known else None
    return _instance_target(reading, path, interface, text)


def _vehicle_target(reading: ModelReading, path: Path, interface: str, text: str) -> ConnectionTarget | None:
    if not reading.known(path, text, "vehicle", reading.names(_VEHICLES)):
        return None
    kind = _kind_of_vehicle(reading, text)
    if kind != VEHICLE_INTERFACES[interface]:
        what = f"{text} is a {kind}; {_candidates(reading, interface)}"
        reading.problems.add(path, what, rule=rules.INTERFACE_MISMATCH)
        return None
    return ConnectionTarget(TargetKind.VEHICLE, text)


def _instance_target(reading: ModelReading, path: Path, interface: str, text: str) -> ConnectionTarget | None:
    name, dot, port = text.partition(".")
    if not reading.known(path, name, "component instance", reading.names(AROUND, APPLICATION)):
        return None
    component = component_of(reading, name)
    if component is None:  # what is wrong with it has been reported
        return None
    if dot and component.provides.get(port) == interface:
        return ConnectionTarget(TargetKind.INSTANCE, name, port)
    if port in component.provides:
        provided, candidates = component.provides[port], _candidates(reading, interface)
        differs = _difference(reading, interface, provided)
        what = f"{text} provides {provided}, not {interface}{differs}; {candidates}"
        reading.problems.add(path, what, rule=rules.INTERFACE_MISMATCH)
    else:
        has = ", ".join(f"{name}.{provided}" for provided in component.provides) or "no provided port"
        what = f"{text!r} is no provided port; {name} has {has}"
        reading.problems.add(path, what, rule=rules.UNKNOWN_NAME)
    return None


def _difference(reading: ModelReading, required: str, provided: str) -> str:
    """Return how the operations of two interfaces differ: methods that are missing, and other types."""
    wanted, offered = (
        {} if interface is None else interface.items for interface in _interfaces(reading, required, provided)
    )
    missing = [name for name in wanted if name not in offered]
    other = [
        name for name, node in wanted.items() if name in offered and node.plain() != offered[name].plain()
    ]
    parts = [f"it has no {choices(missing)}"] if missing else []
    parts += [f"other types in {choices(other)}"] if other else []
    return f" ({'; '.join(parts)})" if parts else " (of the same operations)"


def _interfaces(reading: ModelReading, *names: str) -> Iterator[TextNode | None]:
    return (reading.root.at(("interfaces", name)) for name in names)


# -- instances


class _ComponentName(Syntax):
    """The name of a component of the library."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Component:
        """See ``Syntax``."""
        if not isinstance(node.value, str):
            raise expected("text", node)
        reading.known(path, node.value, "component", reading.names(LIBRARY))
        component = reading.once(library).get(node.value)
        if component is None:  # unknown, or what is wrong with it has been reported
            raise WrongValueError("")
        return component

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"type": "string"}


@dataclass(frozen=True, slots=True)
class Instance:
    """A component that exists, in the application or in the environment.

    ``parameters`` and ``activity`` are the component's with the instance's own on top. ``processor`` is None
    for the environment's components: their computing costs nothing. ``memory_space`` is the process that
    it is allocated to; None for one of its own.
    """

    name: str
    component: Annotated[Component, Key("is"), _ComponentName(), "The component of the library that it is."]
    connections: Annotated[
        Mapping[str, PortConnection],
        Others(),
        _Connections(),
        "Every other key is a required port: `routes: planner.paths`.",
    ] = field(default_factory=dict)
    parameters: Annotated[
        Mapping[str, Value], MapOf(ANYTHING, free=True), "Parameters; they win over the component's."
    ] = field(default_factory=dict)
    activity: Annotated[
        Activity | None, Key("active"), ACTIVITY, "Its flow of control, on top of the component's."
    ] = None
    arguments: Annotated[
        tuple[str, ...],
        ListOf(TEXT, bare=True),
        "Command-line arguments of a script, in place of the component's.",
    ] = ()
    processor: str | None = None
    memory_space: str | None = None
    namespace: Annotated[str, TEXT, "Its ROS namespace."] = "/"
    node_name: Annotated[
        str,
        TEXT,
        "Name of its ROS node, as `name` of a launch file. By default the file's own, or the instance's "
        "where several instances run one file in one namespace.",
    ] = ""
    remap: Annotated[
        Mapping[str, str], MapOf(TEXT, free=True), "Names of ROS topics and services, and their replacements."
    ] = field(default_factory=dict)
    per: Annotated[str | None, VEHICLE, "The vehicle that it belongs to: with a `count`, one for each."] = (
        None
    )
    where: Location | None = field(default=None, compare=False)

    @property
    def is_environment(self) -> bool:
        """True for instances that surround the system (requesters, provider): allocated to no processor."""
        return self.processor is None


def _with_component(node: TextNode, path: Path, reading: ModelReading) -> TextNode:
    """Add the entries of the component under the instance's own parameters and activity."""
    component = reading.root.at((*LIBRARY, str(node.items["is"].value))) if "is" in node.items else None
    if component is None or component_of(reading, str(path[-1])) is None:
        return node
    merged = dict(node.items)
    for key in ("parameters", "active", "arguments"):
        own, default = merged.get(key), component.items.get(key)
        if default is None or default.value in (None, False):
            continue
        if own is None or own.value is True:
            merged[key] = default
        elif isinstance(own.value, dict):
            below = dict(default.items)
            if key == "active" and "period" in own.items:
                below.pop("deadline", None)  # the period is the deadline where none is stated
            merged[key] = replace(own, value={**below, **own.items})
    return replace(node, value=merged)


class _Instance(Record):
    """An instance whose parameters are not called like its ports."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Instance:
        """See ``Syntax``."""
        made: Instance = super().read(node, path, reading)
        for name in made.parameters:
            if name in made.component.requires:
                what = f"{name!r} is a required port of {made.component.name}; a parameter needs another name"
                reading.problems.add((*path, "parameters", name), what, rule=rules.DUPLICATE_NAME)
        return made


INSTANCES = MapOf(_Instance(Instance, prepare=_with_component), values_only=True)


def check_cycles(reading: ModelReading, instances: tuple[Instance, ...]) -> None:
    """Report calls that lead back to their caller: a call waits for its callee, so they would never end."""
    calls: dict[str, list[Any]] = {
        instance.name: [
            target.name
            for connection in instance.connections.values()
            for target in connection.targets
            if target.kind is TargetKind.INSTANCE
        ]
        for instance in instances
    }
    try:
        TopologicalSorter(calls).prepare()
    except CycleError as error:
        around = list(reversed(error.args[1]))
        section = APPLICATION if around[0] in reading.names(APPLICATION) else AROUND
        reading.problems.add(
            (*section, around[0]),
            f"a cycle of required ports: {' -> '.join(around)}; a call would wait for itself. "
            "Replace one of the calls by a topic (an interface without operations)",
            rule=rules.SYNCHRONOUS_CYCLE,
        )
