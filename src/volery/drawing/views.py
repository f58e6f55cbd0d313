"""The views of a model as boxes and links: its functional architecture and its verification environment."""

from __future__ import annotations

from collections.abc import Iterator

from volery.base.time import to_seconds
from volery.drawing.boxes import Box, BoxLink, BoxPort, Diagram
from volery.model.components import ENVIRONMENT_INTERFACE, VEHICLE_INTERFACES
from volery.model.environment import VehicleSpec
from volery.model.instances import Instance, TargetKind
from volery.model.system import System

COMMANDS = "commands"
"""The provided port of a vehicle."""
SYSTEM = "system"
_INTERFACE_OF = {kind: interface for interface, kind in VEHICLE_INTERFACES.items()}


def functional(system: System) -> Diagram:
    """Return the functional architecture: components with their ports, and who is connected to whom."""
    boxes = [_component(instance) for instance in system.instances]
    boxes += [_vehicle(vehicle) for vehicle in system.vehicles]
    links = tuple(_links(system))
    called = {link.target for link in links}
    framed = frozenset(instance.name for instance in system.instances if not instance.is_environment)
    before = (
        frozenset(
            instance.name
            for instance in system.instances
            if instance.is_environment and instance.name not in called
        )
        - framed
    )
    return Diagram(system.name, tuple(boxes), links, system.name, framed, before)


def verification(system: System) -> Diagram:
    """Return the verification environment: the system as one box, and what surrounds it in a run."""
    inside = {instance.name for instance in system.instances if not instance.is_environment}
    around = [instance for instance in system.instances if instance.is_environment]
    links = list(_links(system))
    incoming = dict.fromkeys(
        (link.target, link.target_port)
        for link in links
        if link.source not in inside and link.target in inside
    )
    outgoing = dict.fromkeys(
        (link.target, link.target_port)
        for link in links
        if link.source in inside and link.target not in inside
    )
    provided = _provided_interfaces(system)
    ports = [BoxPort(f"{name}.{port}", provided[name, port], provided=True) for name, port in incoming]
    ports += [BoxPort(name, provided[name, port], provided=False) for name, port in outgoing]
    chosen = [f"allocation {system.allocation}"] if system.allocation else []
    chosen += [f"scenario {system.scenario}"] if system.scenario else []
    whole = Box(SYSTEM, system.name, "System", " · ".join(chosen), "system", tuple(ports))
    boxes = [whole, *(_component(one) for one in around), *(_vehicle(vehicle) for vehicle in system.vehicles)]
    kept = [link for link in links if link.source not in inside and link.target not in inside]
    kept += [
        BoxLink(link.source, link.source_port, SYSTEM, f"{link.target}.{link.target_port}")
        for link in links
        if (link.target, link.target_port) in incoming and link.source not in inside
    ]
    kept += [BoxLink(SYSTEM, name, name, port) for name, port in outgoing]
    called = {one.target for one in kept}
    before = frozenset(one.name for one in around if one.name not in called)
    return Diagram(
        f"{system.name}: verification environment",
        tuple(boxes),
        tuple(kept),
        "",
        frozenset((SYSTEM,)),
        before,
    )


def _component(one: Instance) -> Box:
    component, activity = one.component, one.activity
    words = [component.language]
    if activity is not None and activity.period_ns is not None:
        words.append(f"each {to_seconds(activity.period_ns) * 1000:g} ms")
    if activity is not None and not one.is_environment:
        words.append(f"priority {activity.priority}")
    words += [f"uses {ENVIRONMENT_INTERFACE}"] * any(
        port.interface == ENVIRONMENT_INTERFACE for port in component.requires.values()
    )
    ports = [BoxPort(name, interface, provided=True) for name, interface in component.provides.items()]
    ports += [
        BoxPort(port.name, port.interface, provided=False)
        for port in component.requires.values()
        if port.interface != ENVIRONMENT_INTERFACE
    ]
    stereotype = "TestComponent" if one.is_environment else "RtUnit" if activity else "PpUnit"
    kind = "environment" if one.is_environment else "active" if activity else "passive"
    return Box(one.name, f"{one.name}: {component.name}", stereotype, " · ".join(words), kind, tuple(ports),
               activity is not None)  # fmt: skip


def _vehicle(one: VehicleSpec) -> Box:
    port = BoxPort(COMMANDS, _INTERFACE_OF[one.kind], provided=True)
    return Box(one.name, one.name, one.kind, f"{one.autopilot} · at {one.at.name}", "vehicle", (port,))


def _links(system: System) -> Iterator[BoxLink]:
    for instance in system.instances:
        for connection in instance.connections.values():
            for target in connection.targets:
                if target.kind is TargetKind.INSTANCE:
                    yield BoxLink(instance.name, connection.port, target.name, target.port)
                elif target.kind is TargetKind.VEHICLE:
                    yield BoxLink(instance.name, connection.port, target.name, COMMANDS)


def _provided_interfaces(system: System) -> dict[tuple[str, str], str]:
    found = {
        (instance.name, port): interface
        for instance in system.instances
        for port, interface in instance.component.provides.items()
    }
    return found | {(vehicle.name, COMMANDS): _INTERFACE_OF[vehicle.kind] for vehicle in system.vehicles}
