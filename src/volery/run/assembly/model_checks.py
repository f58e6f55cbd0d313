"""Checks of a model against this installation, before a run: the names it may use, and its components.

Every Python file is loaded as a run loads it: its imports and its top level are executed, its classes are
compared with the ports, parameters and operations of the model. Nothing is constructed and no time passes.
C++ components are compiled, unless there is no compiler; the objects are kept for the run. The firmware of
each vehicle has to be there in its version and with its features, and its FMU must fit.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from volery.base.errors import ModelError, UsageError, VoleryError
from volery.components.cpp.sources import find_sources
from volery.components.loader import Loader
from volery.components.programs import ScriptProgram
from volery.components.virtual_stdlib import virtual_modules
from volery.cost import load_catalogue
from volery.kernel.virtual import VirtualKernel
from volery.model import rules
from volery.model.instances import Instance
from volery.model.reading import ProcessorKind, Vocabulary
from volery.model.system import System
from volery.model.text import CollectedModelError
from volery.requirements.observables import all_observables
from volery.ros.client_libraries.importable_modules import importable_modules
from volery.ros.graph import EmbeddedGraph
from volery.ros.messages import define_imported
from volery.run.assembly.component_builder import (
    PYTHON_ROS,
    provided_operations,
    python_program,
    with_executables,
)
from volery.run.assembly.cpp import compile_all, describe_component, is_cpp
from volery.run.assembly.firmware_programs import check_autopilot
from volery.run.assembly.moved_bodies import check_body
from volery.run.ending import Ending
from volery.simulation.autopilots.fleet_autopilot import firmwares
from volery.simulation.world.sensors import sensors


def vocabulary() -> Vocabulary:
    """Return the names that a model is checked against."""
    autopilots = frozenset(firmwares.names())
    return Vocabulary(
        _kinds(),
        autopilots,
        all_observables(),
        _kinds,
        frozenset(sensors.names()),
        frozenset(name for name in autopilots if firmwares.load(name).airframes),
    )


def _kinds(*more: Path) -> dict[str, ProcessorKind]:
    return {
        name: ProcessorKind(
            entry.cores,
            entry.least_mhz * 1e6,
            entry.greatest_mhz * 1e6,
            tuple(one * 1e6 for one in entry.set_to()),
        )
        for name, entry in load_catalogue(*more).processors.items()
    }


def check_components(system: System) -> None:
    """Load the components of *system* and compare them with the model; find the firmware of each vehicle.

    Raises:
        ModelError: A file cannot be loaded or does not fit; all of them at once (``CollectedModelError``).
    """
    found = {str(error): error for error in _faults(system)}
    if len(found) == 1:
        raise next(iter(found.values()))
    if found:
        raise CollectedModelError(found.values())


def _faults(system: System) -> Iterator[ModelError]:
    yield from _vehicle_faults(system)
    try:
        system = with_executables(system)
    except ModelError as error:
        yield error
    kernel = VirtualKernel()
    farewell = Ending(kernel).farewell
    modules = importable_modules(EmbeddedGraph(kernel), {}, {}, farewell)
    loader = Loader({**virtual_modules(kernel, seed=0), **modules})
    for instance in system.instances:
        component = instance.component
        if not component.path:
            continue
        if not system.file_of(component).exists():  # it is a warning of the model
            continue
        try:
            if is_cpp(component):
                _check_cpp(system, instance)
            else:
                _check_instance(system, instance, loader)
        except ModelError as error:
            yield error
        except VoleryError as error:
            yield ModelError(str(error), f"components.{component.name}", component.where)


def _vehicle_faults(system: System) -> Iterator[ModelError]:
    for vehicle in system.environment.vehicles:
        code = rules.NO_FIRMWARE.code if vehicle.firmware else ""
        for check, at, rule in ((check_autopilot, "", code), (check_body, ".body", rules.UNFIT_FMU.code)):
            try:
                check(vehicle)
            except UsageError as error:
                yield ModelError(str(error), f"environment.vehicles.{vehicle.name}{at}", vehicle.where, rule)


def _check_instance(system: System, instance: Instance, loader: Loader) -> None:
    if instance.component.language in PYTHON_ROS:
        define_imported(system.file_of(instance.component), loader.workspace)
    program = python_program(system, instance, loader)
    given = {connection.port for connection in instance.connections.values() if connection.targets}
    if not isinstance(program, ScriptProgram):  # a script reads its parameters from ROS
        given |= set(instance.parameters)
    operations = provided_operations(system, instance)
    program.check(sorted(given), operations, instance.activity is not None)


def _check_cpp(system: System, instance: Instance) -> None:
    """Compile a component; that an active class has a ``run`` is seen in its text, as it may have none."""
    compile_all(system, [instance], "times")
    description = describe_component(system, instance.component)
    sources = find_sources(description.path)
    if description.class_name and instance.activity is not None and not sources.mentions("run"):
        what = "has no member function 'run', which an active component needs"
        raise ModelError(what, description.name, sources.place_of_class(description.class_name))
