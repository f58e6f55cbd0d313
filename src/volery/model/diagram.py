"""A system as text: allocation and connections, one line for each thing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from volery.base.time import Ns, to_seconds
from volery.model.components import Activity
from volery.model.environment import VehicleSpec
from volery.model.instances import Instance
from volery.model.system import NetworkSpec, ProcessorSpec, System


def diagram(system: System) -> str:
    """Return each computer with its instances, the environment's components, networks and vehicles."""
    return "\n".join(_lines(system)) + "\n"


def _lines(system: System) -> Iterator[str]:
    chosen = [f"allocation {system.allocation}"] if system.allocation else []
    chosen += [f"scenario {system.scenario}"] if system.scenario else []
    yield " · ".join([system.name, *chosen])
    for processor in system.processors:
        yield ""
        yield _processor(processor)
        yield from _instances(
            instance for instance in system.instances if instance.processor == processor.name
        )
        for vehicle in system.vehicles:
            if vehicle.processor == processor.name:
                yield f"  └ node of {vehicle.name}"
    around = [instance for instance in system.instances if instance.is_environment]
    if around:
        yield ""
        yield "environment"
        yield from _instances(around)
    yield from _section("networks", (_network(network) for network in system.networks))
    yield from _section("vehicles", (_vehicle(vehicle) for vehicle in system.vehicles))


def _section(title: str, lines: Iterable[str]) -> Iterator[str]:
    listed = list(lines)
    if listed:
        yield ""
        yield title
        yield from (f"  ├ {line}" for line in listed)


def _processor(processor: ProcessorSpec) -> str:
    speed = f"{processor.kind} at {processor.frequency_mhz:g} MHz × {processor.cores}, {processor.scheduler}"
    carried = f", carried by {processor.carried_by}" if processor.carried_by else ""
    return f"{processor.name}: {speed}{carried}"


def _instances(instances: Iterable[Instance]) -> Iterator[str]:
    for instance in instances:
        component = instance.component
        activity = f", {_activity(instance.activity)}" if instance.activity else ""
        yield f"  ├ {instance.name}: {component.name} ({component.language}{activity})"
        for connection in instance.connections.values():
            targets = ", ".join(str(target) for target in connection.targets)
            yield f"  │    {connection.port} → {targets or 'nothing'}  [{connection.interface}]"


def _activity(activity: Activity) -> str:
    period = f"each {_milliseconds(activity.period_ns)}" if activity.period_ns else "active"
    return f"{period}, priority {activity.priority}"


def _milliseconds(time: Ns) -> str:
    return f"{to_seconds(time) * 1000:g} ms"


def _network(network: NetworkSpec) -> str:
    ends = " — ".join(network.between)
    latency = _milliseconds(network.latency_ns)
    return f"{network.name}: {ends}, {network.bandwidth_bit_s:g} bit/s, {latency}, {network.loss:.2%} lost"


def _vehicle(vehicle: VehicleSpec) -> str:
    at = vehicle.at
    place = f"{at.name} ({at.east_m:g} m east, {at.north_m:g} m north)"
    return f"{vehicle.name}: {vehicle.kind}, {vehicle.autopilot}, {vehicle.sensors}, at {place}"
