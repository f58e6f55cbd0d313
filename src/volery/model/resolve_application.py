"""Instances and what they are connected to, in the application and around it."""

from __future__ import annotations

from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from typing import Any

from volery.model.context import Context
from volery.model.form_component import ActivityForm, InstanceForm
from volery.model.problems import Path
from volery.model.resolve_library import activity
from volery.model.system import (
    ENVIRONMENT_INTERFACE,
    VEHICLE_INTERFACES,
    Activity,
    Component,
    Connection,
    Instance,
    Interface,
    RequiredPort,
    Target,
    TargetKind,
)

APPLICATION: Path = ("application",)
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
    sections = ((APPLICATION, form.application), (AROUND, form.environment.components))
    found = [
        _instance(
            surroundings, (*section, name), entry, processors.get(name) if section == APPLICATION else None
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
        return _vehicle(surroundings, path, port.interface, text)
    if port.interface == ENVIRONMENT_INTERFACE:
        known = surroundings.context.known(path, text, "provider of Environment", ["environment"])
        return Target(TargetKind.ENVIRONMENT, text) if known else None
    return _provided(surroundings, path, port.interface, text)


def _vehicle(surroundings: Surroundings, path: Path, interface: str, text: str) -> Target | None:
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
        section = APPLICATION if around[0] in context.form.application else AROUND
        context.problems.add(
            (*section, around[0]),
            f"a cycle of required ports: {' -> '.join(around)}; a call would wait for itself. "
            "Let one of them tell the other by a topic (an interface without operations)",
        )
