"""What of a model goes where when its components are processes on a real graph."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, cast

from volery.base.errors import CapabilityError, choices
from volery.components.instance import Allocation
from volery.cost import FREE, Pricing
from volery.model.instances import Instance
from volery.model.system import Bound, System
from volery.ros.graph import names
from volery.run.assembly.computers import Platform

if TYPE_CHECKING:
    from volery.kernel.api import Kernel
    from volery.kernel.virtual import VirtualKernel

NODE = "volery"
"""The node of the run's own process, which tells the time and serves the components of the environment."""

LANGUAGES = ("python", "rospy", "rclpy")

COMPUTING = frozenset(
    (
        "response_time",
        "response_time_mean",
        "response_time_p95",
        "deadline_misses",
        "period_violations",
        "activations",
        "cpu_time",
        "utilisation",
    )
)
"""Quantities of what the model's processors do."""


def worker_instances(system: System) -> tuple[Instance, ...]:
    """The instances that are processes of their own: the application's.

    Raises ``CapabilityError`` for a component in a language that cannot be one.
    """
    found = tuple(one for one in system.instances if not one.is_environment)
    for one in found:
        language = one.component.language
        if language not in LANGUAGES:
            raise CapabilityError(
                f"{one.name}: a component in {language} cannot be a process on a real graph yet; "
                f"there is {choices(LANGUAGES)}"
            )
    return found


def without_computers(system: System) -> tuple[System, tuple[str, ...]]:
    """*system* on this machine, and the names of the requirements that cannot be judged there."""
    left_out = tuple(one.name for one in system.requirements if _is_about_computing(one))
    made = replace(
        system,
        processors=(),
        networks=(),
        environment=replace(
            system.environment,
            vehicles=tuple(replace(one, processor=None) for one in system.environment.vehicles),
        ),
        requirements=tuple(one for one in system.requirements if one.name not in left_out),
    )
    return made, left_out


def unallocated(system: System) -> System:
    """*system* as it is accounted for: no component computes on a processor."""
    return replace(system, instances=tuple(replace(one, processor=None) for one in system.instances))


class HostPlatform(Platform):
    """This machine: computing takes the time that it takes, and costs nothing beside."""

    def __init__(self, system: System, kernel: Kernel, seed: int, fidelity: str) -> None:
        virtual = cast("VirtualKernel", kernel)  # there is no processor that it would serve
        super().__init__(system, virtual, seed, fidelity)

    def foresee(self) -> None:
        """Nothing is priced."""

    def seat(self, instance: Instance) -> Allocation:
        """On no processor of the model's."""
        return super().seat(replace(instance, processor=None))

    def pricing(self, instance: Instance) -> Pricing:
        """Nothing."""
        return FREE

    def travel(self, one: str | None, other: str | None) -> None:
        """In no time."""


def _is_about_computing(bound: Bound) -> bool:
    return bound.observe.rpartition(".")[2] in COMPUTING


def node_label(instance: Instance) -> str:
    """The name of its node, without the namespace."""
    return re.sub(r"\W", "_", instance.name)


def service_name(callee: Instance, operation: str) -> str:
    """The service that *operation* of *callee* is."""
    return f"{names.node_name(node_label(callee), callee.namespace)}/{operation}"


def operations(system: System, instance: Instance) -> tuple[str, ...]:
    """The operations that it provides."""
    interfaces = instance.component.provides.values()
    return tuple(name for interface in interfaces for name in system.interfaces[interface].operations)
