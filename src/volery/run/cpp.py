"""C++ components of a model: compiled before a run, made into programs for it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from volery.base.errors import ModelError
from volery.components.cpp.build import Compiled, CppComponent, Face, compile_component
from volery.components.cpp.interfaces import DRONE, Required, operations
from volery.components.cpp.program import CppProgram
from volery.components.cpp.sources import find_sources
from volery.components.cpp.toolchain import Tell
from volery.faces import roscpp
from volery.faces.launch import Launch
from volery.graph import Node, RosGraph
from volery.kernel.api import Kernel
from volery.model.system import ENVIRONMENT_INTERFACE, VEHICLE_INTERFACES, Component, System
from volery.model.system import Instance as InstanceModel

LANGUAGES = ("c++", "roscpp")
_ROSCPP = Face((roscpp.INCLUDE,), (roscpp.FALLBACK,), roscpp.generate)


def is_cpp(component: Component) -> bool:
    """Whether there is C++ to be compiled for it."""
    return bool(component.path) and component.language in LANGUAGES


def has_cpp(system: System) -> bool:
    """Whether a component of *system* is written in C++."""
    return any(is_cpp(instance.component) for instance in system.instances)


def compile_all(
    instances: Iterable[InstanceModel], system: System, tell: Tell | None = None
) -> dict[str, Compiled]:
    """The C++ components of *instances* by their names, compiled as far as they are not yet.

    ``ModelError`` with the compiler's words for one that does not compile; ``UsageError`` if there is no
    compiler.
    """
    wanted = {one.component.name: one.component for one in instances if is_cpp(one.component)}
    return {name: _compiled(system, component, tell) for name, component in wanted.items()}


def _compiled(system: System, component: Component, tell: Tell | None) -> Compiled:
    face = _ROSCPP if component.language == "roscpp" else Face()
    return compile_component(described(system, component), face, tell)


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
        compiled: Mapping[str, Compiled],
        launches: Mapping[str, Launch],
        nodes: Mapping[str, Node],
    ) -> None:
        self._kernel = kernel
        self._graph = graph
        self._compiled = compiled
        self._launches = launches
        self._nodes = nodes

    def program(self, model: InstanceModel) -> CppProgram:
        """What the instance is to run."""
        compiled = self._compiled[model.component.name]
        if model.component.language != "roscpp":
            return CppProgram(self._kernel, model.name, compiled)
        launch = self._launches.get(model.name, Launch())
        session = roscpp.Session(self._graph, model.name, launch, self._nodes)
        return CppProgram(self._kernel, model.name, compiled, roscpp.answers(session), session.end)
