"""Header and attachments of the trace of a simulation: the setup, the map, the text of the model."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from volery.cost import NOT_COUNTED, Basis, ProcessorPrices
from volery.model.components import CPP_LANGUAGES
from volery.model.environment import Environment, Prism, VehicleSpec, Ways
from volery.model.instances import Instance
from volery.model.system import ProcessorSpec, System
from volery.run.assembly.computers import ComputingPlatform
from volery.run.assembly.cpp import core_of
from volery.run.assembly.vehicle_nodes import node_name
from volery.trace.attachments import (
    MODEL_ATTACHMENT,
    WORLD_ATTACHMENT,
    Area,
    ChainSetup,
    ComponentSetup,
    LawSetup,
    Line,
    NetworkSetup,
    Origin,
    Place,
    ProcessorSetup,
    RequirementSetup,
    RunSetup,
    Scenery,
    VehicleSetup,
    to_json,
)
from volery.trace.events import NONE
from volery.trace.mcap_writer import Attachment

ALWAYS_LEFT_OUT = (
    "the operating system and everything else that runs on a computer",
    "caches and memory traffic that components share",
)
"""Costs that no figure of a run includes."""


def setup_of(system: System, platform: ComputingPlatform, seed: int, fidelity: str) -> RunSetup:
    """Return the setup of a simulation of *system*."""
    return RunSetup(
        system=system.name,
        fidelity=fidelity,
        allocation=system.allocation,
        scenario=system.scenario,
        seed=seed,
        components=(
            *(_component(instance) for instance in system.instances),
            *_vehicle_nodes(system),
        ),
        processors=tuple(_processor(model, platform.prices[model.name]) for model in system.processors),
        networks=tuple(NetworkSetup(network.name) for network in system.networks),
        vehicles=tuple(_vehicle(vehicle) for vehicle in system.vehicles),
        chains=tuple(ChainSetup(chain.name, chain.topics) for chain in system.chains),
        requirements=tuple(
            RequirementSetup(
                requirement.name,
                requirement.observe,
                requirement.relation,
                requirement.bound,
                requirement.unit,
            )
            for requirement in system.requirements
        ),
        laws=tuple(_laws(system, platform, fidelity)),
        not_counted=(*NOT_COUNTED, *ALWAYS_LEFT_OUT, *_missing_networks(system)),
        warnings=tuple(platform.warnings),
    )


def _component(instance: Instance) -> ComponentSetup:
    activity = instance.activity
    return ComponentSetup(
        name=instance.name,
        type=instance.component.name,
        language=instance.component.language,
        processor=instance.processor or "",
        active=activity is not None,
        period=_or_none(activity.period_ns if activity else None),
        deadline=_or_none(activity.deadline_ns if activity else None),
        priority=activity.priority if activity else 0,
    )


def _vehicle(vehicle: VehicleSpec) -> VehicleSetup:
    firmware = Path(vehicle.firmware.program).name if vehicle.firmware else ""
    return VehicleSetup(vehicle.name, vehicle.autopilot, vehicle.kind, firmware)


def _or_none(value: int | None) -> int:
    return NONE if value is None else value


def _vehicle_nodes(system: System) -> Iterable[ComponentSetup]:
    for vehicle in system.vehicles:
        if vehicle.processor is not None:
            yield ComponentSetup(node_name(vehicle.name), "MAVROS", "roscpp", vehicle.processor, active=True)


def _processor(model: ProcessorSpec, prices: ProcessorPrices) -> ProcessorSetup:
    power = prices.entry.power
    return ProcessorSetup(
        name=model.name,
        kind=model.kind,
        frequency_mhz=model.frequency_mhz,
        scheduler=model.scheduler,
        cores=model.cores,
        idle_w=prices.watts(0.0) if power else None,
        busy_w=prices.watts(model.cores) if power else None,
        power_error=power.band() or None if power else None,
    )


def _laws(system: System, platform: ComputingPlatform, fidelity: str) -> Iterable[LawSetup]:
    """Yield one entry for each kind of processor and law, whatever the number of computers of that kind."""
    first: dict[str, ProcessorSpec] = {}
    for processor in system.processors:
        first.setdefault(processor.kind, processor)
    for kind, model in first.items():
        prices = platform.prices[model.name]
        code = _code_bases(system, prices, kind) if fidelity != "times" else ()
        for basis in (*prices.ros_basis(), *code, *prices.power_basis()):
            yield LawSetup(basis.law, basis.source, basis.provenance, basis.validity, basis.warning)


def _code_bases(system: System, prices: ProcessorPrices, kind: str) -> Iterable[Basis]:
    """Yield the laws of counted code that apply to at least one component."""
    kinds = {processor.name: processor.kind for processor in system.processors}
    there = [
        instance
        for instance in system.instances
        if kinds.get(instance.processor or "") == kind and instance.component.path
    ]
    if any(one.component.language not in CPP_LANGUAGES for one in there):
        yield from prices.code_basis()
    if any(core_of(system, "code", one) for one in there):
        yield prices.compiled_code_basis()


def _missing_networks(system: System) -> Iterable[str]:
    """Yield the connections between two processors that no network joins."""
    where = {instance.name: instance.processor for instance in system.instances}
    for instance in system.instances:
        for connection in instance.connections.values():
            for target in connection.targets:
                here, there = instance.processor, where.get(target.name)
                if here and there and here != there and system.network_between(here, there) is None:
                    yield f"{instance.name} calls {target} in no time: no network joins {here} and {there}"


# -- attachments


def attachments_of(system: System) -> list[Attachment]:
    """Return the map and the text of every file of the model."""
    scenery = to_json(scenery_of(system.environment))
    found = [Attachment(WORLD_ATTACHMENT, "application/json", scenery)]
    for number, source in enumerate(system.sources):
        name = MODEL_ATTACHMENT if number == 0 else source.name
        found.append(Attachment(name, "application/yaml", source.text.encode()))
    return found


def scenery_of(environment: Environment) -> Scenery:
    """Return the map of an environment, for reports."""
    origin = environment.origin
    return Scenery(
        origin=Origin(origin.latitude, origin.longitude, origin.amsl),
        places=tuple(
            Place(one.name, one.east_m, one.north_m, one.role) for one in environment.places.values()
        ),
        roads=tuple(_lines(environment.roads)),
        corridors=tuple(_lines(environment.corridors)),
        areas=(
            *(_area(zone, "no-fly") for zone in environment.no_fly_zones),
            *(_area(building, "building") for building in environment.solids),
        ),
    )


def _lines(ways: Ways) -> Iterable[Line]:
    for one, other, _ in ways.edges:
        a, b = ways.nodes[one], ways.nodes[other]
        yield (a.east_m, a.north_m), (b.east_m, b.north_m)


def _area(prism: Prism, kind: str) -> Area:
    return Area(prism.name, tuple(prism.corners), kind)
