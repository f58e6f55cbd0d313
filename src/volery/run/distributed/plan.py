"""Which process runs which part of a model on a real graph, and what the model means there."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import replace
from typing import TYPE_CHECKING, cast

from volery.components.instance import Allocation
from volery.cost import FREE, Pricing
from volery.model.instances import Instance
from volery.model.system import RequiredBound, System
from volery.ros.graph.interface import full_node_name
from volery.run.assembly.computers import ComputingPlatform, commanded_by
from volery.run.assembly.vehicle_nodes import names_of
from volery.vehicles.driver import drivers

if TYPE_CHECKING:
    from volery.kernel.api import Kernel
    from volery.kernel.virtual import VirtualKernel

NODE = "volery"
"""Node of the run's own process, which publishes the clock and serves the components of the environment."""

COMPUTING = frozenset(
    (
        "response_time",
        "response_time_mean",
        "response_time_p95",
        "call_time",
        "call_time_mean",
        "call_time_p95",
        "deadline_misses",
        "period_violations",
        "activations",
        "cpu_time",
        "utilisation",
        "computing_energy",
        "delay",
        "delay_mean",
        "delay_p95",
        "lost",
    )
)
"""Observables of the model's processors and networks, which are not used here."""

BY_TRUTH = frozenset(("landing_offset",))
"""Observables of operations by the true state."""


def worker_instances(system: System) -> tuple[Instance, ...]:
    """Return the instances of the application, which get their own processes."""
    return tuple(instance for instance in system.instances if not instance.is_environment)


def without_computers(system: System) -> tuple[System, tuple[str, ...]]:
    """Return *system* without processors, and the names of the requirements that need them."""
    vehicles = {vehicle.name for vehicle in system.vehicles}
    left_out = tuple(
        requirement.name for requirement in system.requirements if _is_about_computing(requirement, vehicles)
    )
    made = replace(
        system,
        processors=(),
        networks=(),
        requirements=tuple(
            requirement for requirement in system.requirements if requirement.name not in left_out
        ),
    )
    return made, left_out


def without_truth(system: System) -> tuple[System, tuple[str, ...]]:
    """Return *system* without the requirements that compare operations with the true state.

    Processes that others started have no access to it. The names of those requirements are returned, too.
    """
    left_out = tuple(
        requirement.name
        for requirement in system.requirements
        if requirement.observe.rpartition(".")[2] in BY_TRUTH
    )
    kept = tuple(requirement for requirement in system.requirements if requirement.name not in left_out)
    return replace(system, requirements=kept), left_out


def vehicles_on_graph(system: System) -> tuple[dict[str, str], list[str]]:
    """Return whose names the nodes of vehicles have on a real graph, by vehicle; and those without a node."""
    commanded = {name for model in system.instances for name in commanded_by(model)}
    found = {}
    for vehicle in system.vehicles:
        by_port = vehicle.name in commanded
        if by_port or vehicle.processor is not None:
            factory = drivers.load(vehicle.autopilot)
            found[vehicle.name] = names_of(vehicle, factory.codec if factory.on_link else None, by_port)
    return found, [vehicle.name for vehicle in system.vehicles if vehicle.name not in found]


def unallocated(system: System) -> System:
    """Return *system* with no component or vehicle on a processor, as it is accounted for."""
    vehicles = tuple(replace(vehicle, processor=None) for vehicle in system.environment.vehicles)
    return replace(
        system,
        instances=tuple(replace(instance, processor=None) for instance in system.instances),
        environment=replace(system.environment, vehicles=vehicles),
    )


class HostPlatform(ComputingPlatform):
    """Platform of this machine: computing takes real time and is not priced."""

    def __init__(self, system: System, kernel: Kernel, seed: int, fidelity: str) -> None:
        virtual = cast("VirtualKernel", kernel)  # without processors only its clock is used
        super().__init__(system, virtual, seed, fidelity)

    def look_up_prices(self) -> None:
        """Do nothing: nothing is priced."""

    def allocation(self, instance: Instance) -> Allocation:
        """On no processor of the model's."""
        return super().allocation(replace(instance, processor=None))

    def pricing(self, instance: Instance) -> Pricing:
        """Nothing."""
        return FREE

    def travel(self, one: str | None, other: str | None) -> None:
        """In no time."""


def _is_about_computing(bound: RequiredBound, vehicles: Collection[str]) -> bool:
    subject, _, quantity = bound.observe.rpartition(".")
    return quantity in COMPUTING or (quantity == "energy" and subject not in vehicles)


def node_label(instance: Instance) -> str:
    """Return the name of an instance's node, without the namespace."""
    return re.sub(r"\W", "_", instance.name)


def service_name(callee: Instance, operation: str) -> str:
    """Return the name of the service for *operation* of *callee*."""
    return f"{full_node_name(node_label(callee), callee.namespace)}/{operation}"


def operations(system: System, instance: Instance) -> tuple[str, ...]:
    """Return the operations that an instance provides."""
    interfaces = instance.component.provides.values()
    return tuple(name for interface in interfaces for name in system.interfaces[interface].operations)
