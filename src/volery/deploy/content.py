"""What goes to which computer: names of packages, hosted components, vehicles, files of the model."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from volery.base.errors import UsageError
from volery.components.cpp.sources import find_sources
from volery.components.loader import imported_files, imported_names
from volery.model.instances import Instance
from volery.model.system import ProcessorSpec, System
from volery.ros.messages import Workspace
from volery.run.assembly.cpp import is_cpp
from volery.run.assembly.vehicle_nodes import graph_access
from volery.run.distributed.call_types import call_types, package_name

VERIFICATION = "verification"
"""Last word of the package that has the vehicles and the environment of a simulation."""
MODEL_FOLDER = "model"


@dataclass(frozen=True)
class Hosted:
    """A component that a computer hosts; ``executable`` is the name of its entry point."""

    instance: Instance
    executable: str


@dataclass(frozen=True)
class Bridged:
    """A vehicle whose node a computer executes in reality; ``device`` is what udev calls its autopilot."""

    vehicle: str
    autopilot: str
    namespace: str
    device: str
    executable: str


@dataclass(frozen=True)
class Computer:
    """What one computer gets: a ROS package called ``package``."""

    processor: ProcessorSpec
    package: str
    hosted: tuple[Hosted, ...]
    bridged: tuple[Bridged, ...]
    packages: tuple[str, ...] = ()
    """Packages of the workspace whose programs or modules its components use."""


def computers(system: System) -> tuple[Computer, ...]:
    """Return the computers that execute something, in the order of the model.

    Raises:
        CapabilityError: A component is in a language that cannot be hosted.
        UsageError: Two computers would get the same package, or there is nothing to deploy.
    """
    found = tuple(one for one in (_computer(system, each) for each in system.processors) if _executes(one))
    names: dict[str, str] = {}
    for one in found:
        clash = names.setdefault(one.package, one.processor.name)
        if clash != one.processor.name:
            raise UsageError(
                f"{clash} and {one.processor.name} would both be the package {one.package}: rename one"
            )
    if not found:
        raise UsageError(
            f"{system.name}: no component is allocated to a computer; there is nothing to deploy"
        )
    return found


def _executes(computer: Computer) -> bool:
    return bool(computer.hosted or computer.bridged)


def _computer(system: System, processor: ProcessorSpec) -> Computer:
    hosted = tuple(
        Hosted(instance, package_name(instance.name))
        for instance in system.instances
        if instance.processor == processor.name
    )
    bridged = tuple(
        Bridged(
            vehicle.name,
            vehicle.autopilot,
            graph_access(vehicle.autopilot, vehicle.name).namespace,
            f"autopilot_{package_name(vehicle.name)}",
            f"vehicle_{package_name(vehicle.name)}",
        )
        for vehicle in system.vehicles
        if vehicle.processor == processor.name
    )
    packages = workspace_packages(system, tuple(one.instance for one in hosted))
    return Computer(processor, package_name(system.name, processor.name), hosted, bridged, packages)


_DISTRIBUTIONS = (Path("/opt/ros"), Path("/usr"))
"""Where packages of ROS are installed, not those of a user's workspace."""


def workspace_packages(system: System, instances: tuple[Instance, ...]) -> tuple[str, ...]:
    """Return the packages of the workspace that have programs of *instances* or modules that these import.

    What these packages depend on is in their manifests.
    """
    workspace = Workspace(system.folder)
    found: dict[str, None] = {}
    for component in (instance.component for instance in instances):
        if not component.path or is_cpp(component):
            continue
        start = system.file_of(component)
        named = {component.package: start} if component.package else {}
        used = {name: file for file in imported_files(start) for name in imported_names(file)}
        for name, file in {**used, **named}.items():
            package = workspace.find(name, file)
            if package is None or any(package.folder.is_relative_to(one) for one in _DISTRIBUTIONS):
                continue
            found[package.name] = None
    return tuple(sorted(found))


def model_files(system: System, instances: tuple[Instance, ...]) -> Iterator[tuple[Path, Path]]:
    """Yield the files that hosts of *instances* read: each, and where it goes below the model's folder.

    The text of the model with all files that it includes, the code of each component with what it imports of
    the files beside it, and the dataclasses that calls carry. What is in packages of the workspace is built
    there.

    Raises:
        UsageError: A file is outside the model's folder.
    """
    wanted = {system.folder / source.name: None for source in system.sources}
    wanted |= dict.fromkeys(sorted(system.folder.glob("*.yaml")))  # what other scenarios include
    for one in instances:
        if one.component.path and not one.component.package:
            wanted |= dict.fromkeys(_code(system, one))
    wanted |= {file: None for record in call_types(system).files() for file in imported_files(record)}
    wanted |= dict.fromkeys(system.catalogues)
    root = system.folder.resolve()
    for file in wanted:
        resolved = file.resolve()
        if not resolved.is_relative_to(root):
            raise UsageError(
                f"{file} is outside the folder of the model and cannot be deployed: move it there"
            )
        yield resolved, Path(MODEL_FOLDER) / resolved.relative_to(root)


def _code(system: System, instance: Instance) -> tuple[Path, ...]:
    path = system.file_of(instance.component)
    return find_sources(path).own if is_cpp(instance.component) else imported_files(path)
