"""C++ components of a model: compiled before a run, made into programs for it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

from volery.base.errors import ModelError
from volery.components.cpp.build import Compiled, CppComponent, Face, compile_component
from volery.components.cpp.interfaces import DRONE, Required, operations
from volery.components.cpp.library import Library
from volery.components.cpp.meter import Meter
from volery.components.cpp.program import CppProgram
from volery.components.cpp.sources import find_sources
from volery.components.cpp.toolchain import GET_ONE, Tell, has_compiler
from volery.cost.core import CoreLaw
from volery.kernel.api import Kernel
from volery.model.system import ENVIRONMENT_INTERFACE, VEHICLE_INTERFACES, Component, System
from volery.model.system import Instance as InstanceModel
from volery.ros.client_libraries import roscpp
from volery.ros.client_libraries.launch import Launch
from volery.ros.graph import Node, RosGraph
from volery.run.counted import Counting, core_of
from volery.run.traced import Tracing

LANGUAGES = ("c++", "roscpp")
_ROSCPP = Face((roscpp.INCLUDE,), (roscpp.FALLBACK,), roscpp.generate)


def is_cpp(component: Component) -> bool:
    """Whether there is C++ to be compiled for it."""
    return bool(component.path) and component.language in LANGUAGES


def has_cpp(system: System) -> bool:
    """Whether a component of *system* is written in C++."""
    return any(is_cpp(instance.component) for instance in system.instances)


class Ready(NamedTuple):
    """What an instance is to run; how its code counts itself, or tells what it executes, if it does."""

    compiled: Compiled
    counting: Counting | None = None
    tracing: Tracing | None = None


def compile_all(
    system: System,
    instances: Iterable[InstanceModel],
    fidelity: str,
    tell: Tell | None = None,
    *,
    traced: bool = False,
) -> dict[str, Ready]:
    """What the C++ components among *instances* are to run, by their names, compiled if it is not yet. Those
    whose code would be counted tell what they execute where it is to be *traced*.

    ``ModelError`` with the compiler's words for one that does not compile; ``UsageError`` if there is no
    compiler, but nothing at fidelity ``times``, where components without code take their stated times.
    """
    if fidelity == "times" and not has_compiler():
        return {}
    return {
        one.name: _ready(system, one, None if traced else tell, Tracing(core) if traced and core else core)
        for one in instances
        if is_cpp(one.component)
        for core in (core_of(system, fidelity, one),)
    }


def _ready(
    system: System, instance: InstanceModel, tell: Tell | None, how: CoreLaw | Tracing | None
) -> Ready:
    component = instance.component
    face = _ROSCPP if component.language == "roscpp" else Face()
    wanted = described(system, component)
    if how is None or instance.processor is None:
        return Ready(compile_component(wanted, face, tell))
    if isinstance(how, Tracing):
        return Ready(compile_component(wanted, face, tell, how), tracing=how)
    counting = Counting(how, system.processor(instance.processor).frequency_mhz)
    return Ready(compile_component(wanted, face, tell, counting), counting)


def described(system: System, component: Component) -> CppComponent:
    """*component* as the compiler needs to know it."""
    path = system.file_of(component)
    for port in component.requires.values():
        _check_port(component, port.name, port.interface)
    return CppComponent(
        component.name,
        path,
        _class_of(component, system),
        tuple(
            operation
            for interface in component.provides.values()
            for operation in operations(system.interfaces[interface])
        ),
        tuple(Required(port.name, port.interface, port.many) for port in component.requires.values()),
        system.interfaces,
        component.build.flags,
        component.build.libraries,
        component.where,
    )


def _class_of(component: Component, system: System) -> str:
    """Its class, empty for a program of its own."""
    if component.class_stated:
        return component.class_name
    sources = find_sources(system.file_of(component), component.where)
    return "" if sources.defines_main() else component.class_name


def _check_port(component: Component, port: str, interface: str) -> None:
    if interface == ENVIRONMENT_INTERFACE or (interface in VEHICLE_INTERFACES and interface != DRONE):
        what = f"a C++ component cannot require {interface}, but the model's interfaces and {DRONE}"
        raise ModelError(what, f"components.{component.name}.requires.{port}", component.where)


class CppPrograms:
    """Makes the programs of the C++ components of one run."""

    def __init__(
        self,
        kernel: Kernel,
        graph: RosGraph,
        ready: Mapping[str, Ready],
        launches: Mapping[str, Launch],
        nodes: Mapping[str, Node],
        traces: Path | None = None,
    ) -> None:
        self._kernel = kernel
        self._traces = traces
        self._told: list[Library] = []
        self._graph = graph
        self._ready = ready
        self._launches = launches
        self._nodes = nodes
        self.meters = {name: Meter() for name, one in ready.items() if one.counting is not None}

    def warnings(self, instances: Iterable[InstanceModel]) -> list[str]:
        """What is doubtful about what they count, and who of *instances* could not be compiled."""
        said = {one.counting.estimated: None for one in self._ready.values() if one.counting is not None}
        missing = [one.name for one in instances if is_cpp(one.component) and one.name not in self]
        if missing:
            said[f"{', '.join(missing)}: stated times alone, for there is no C++ compiler: {GET_ONE}"] = None
        return [warning for warning in said if warning]

    def __contains__(self, name: str) -> bool:
        """Whether the instance called *name* has a program here."""
        return name in self._ready

    def program(self, model: InstanceModel) -> CppProgram:
        """What the instance is to run."""
        compiled, counting, tracing = self._ready[model.name]
        if model.component.language == "roscpp":
            launch = self._launches.get(model.name, Launch())
            session = roscpp.Session(self._graph, model.name, launch, self._nodes)
            made = CppProgram(self._kernel, model.name, compiled, roscpp.answers(session), session.end)
        else:
            made = CppProgram(self._kernel, model.name, compiled)
        if counting is not None:
            made.count(self.meters[model.name], counting.worth())
        if tracing is not None and self._traces is not None:
            made.when_loaded(partial(self._trace, tracing, self._traces / model.name))
        return made

    def _trace(self, tracing: Tracing, file: Path, library: Library) -> None:
        tracing.begin(library, file)
        self._told.append(library)

    def finish(self) -> None:
        """What they have to tell of themselves is told."""
        for library in self._told:
            library.function("volery_end")()
