"""C++ components: compiled before a run, counted or traced, made into programs.

At fidelity ``code`` a component is compiled with one counter for each basic block; counts times the costs of
the blocks on the core of its processor are charged. To profile components, they are compiled to record the
sequence of blocks instead.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from volery.base.errors import ModelError
from volery.components.cpp.build import (
    DRONE,
    CompiledComponent,
    CppComponent,
    CppPort,
    LibraryHeaders,
    compile_component,
    compile_each,
    operations,
)
from volery.components.cpp.compiler import (
    COMPILER_HINT,
    CppToolchain,
    ReportProgress,
    cache_folder,
    has_compiler,
)
from volery.components.cpp.cpp_program import CppProgram
from volery.components.cpp.framework import Counters, LoadedLibrary, StepMeter, ToSteps
from volery.components.cpp.sources import find_sources
from volery.cost import CoreLaw, load_catalogue
from volery.kernel.api import Kernel
from volery.model.components import CPP_LANGUAGES, ENVIRONMENT_INTERFACE, VEHICLE_INTERFACES, Component
from volery.model.instances import Instance
from volery.model.instances import Instance as InstanceModel
from volery.model.system import System
from volery.ros.client_libraries import rclcpp, roscpp
from volery.ros.client_libraries.abi_codec import RequestHandlers
from volery.ros.client_libraries.cpp.message_structs import NOT_OFFERED
from volery.ros.client_libraries.library_base import Launch
from volery.ros.graph import Node, RosGraph
from volery.run.assembly.vehicle_nodes import use_message_versions

if TYPE_CHECKING:
    from volery.cost.native import OptimisedCode


_FRAMEWORK_SYMBOL = re.compile(r'"?_ZNK?(?:6volery|3ros|6rclcpp|13rclcpp_action|16rclcpp_lifecycle|7tf2_ros)')
"""Symbols of the framework and of client libraries, whose calls have prices of their own."""


def core_of(system: System, fidelity: str, instance: Instance) -> CoreLaw | None:
    """Return the core that the code of *instance* is counted for.

    None if the code is not counted: at another fidelity than ``code``, in another language, without a
    processor, or if the catalogue has no model of the core.
    """
    component = instance.component
    counts = fidelity != "times" and component.path and component.language in CPP_LANGUAGES
    if not counts or instance.processor is None:
        return None
    known = load_catalogue(*system.catalogues).processors.get(system.processor(instance.processor).kind)
    return None if known is None or known.core_model is None else known.core_law()


def compiler_options(include: Sequence[Path], flags: Sequence[str]) -> list[str]:
    """Return the compiler options of counted and traced code."""
    return ["-std=c++17", "-fPIC", *(option for path in include for option in ("-I", str(path))), *flags]


class CountingCompiler:
    """Compiler of counted code for a core at a frequency. Objects are cached like those of the compiler."""

    def __init__(self, law: CoreLaw, frequency_mhz: float) -> None:
        self._law, self._mhz = law, frequency_mhz
        self._steps: np.ndarray[Any, np.dtype[np.int64]] | None = None
        self.estimated = ""

    def __call__(
        self, tools: CppToolchain, sources: Sequence[Path], include: Sequence[Path], flags: Sequence[str]
    ) -> list[Path]:
        """Compile sources to one object that counts its blocks. Plain compilation first reports errors."""
        plain = compile_each(tools, sources, include, flags)
        made = cache_folder() / f"{self._digest(plain)}.o"
        costs = made.with_suffix(".npz")
        if not (made.exists() and costs.exists()):
            if tools.report_progress is not None:
                tools.report_progress(f"counting {tools.component} on {self._law.name}")
            self._make(sources, include, flags, made)
        self._price(costs)
        return [made]

    def _price(self, costs: Path) -> None:
        """Use the costs of a profile, or those that were found when the code was compiled."""
        from volery.cost.native import block_steps, load_costs

        with np.load(costs) as found:
            profiled = load_costs(str(found["key"]))
            cycles, memory = (found["cycles"], found["memory"])
            self.estimated = str(found["estimated"])
            if profiled is not None:
                cycles, memory, self.estimated = profiled.cycles, profiled.memory, ""
            self._steps = block_steps(cycles, memory, self._mhz, found["charged"])

    def _digest(self, plain: Sequence[Path]) -> str:
        from volery.cost.native import METHOD

        contents = (sha256(one.read_bytes()).hexdigest() for one in plain)
        text = " ".join(("charged", METHOD, self._law.model_dump_json(), *contents))
        return sha256(text.encode()).hexdigest()[:32]

    def _make(
        self, sources: Sequence[Path], include: Sequence[Path], flags: Sequence[str], made: Path
    ) -> None:
        from volery.cost.native import instrument

        with TemporaryDirectory(dir=made.parent) as scratch:  # another run may make the same
            new, new_costs = Path(scratch, "new.o"), Path(scratch, "new.npz")
            found = instrument(sources, self._law, new, compiler_options(include, flags))
            costs = found.costs
            charged = np.array([not _FRAMEWORK_SYMBOL.match(name) for name in found.functions])
            np.savez(
                new_costs,
                cycles=costs.cycles,
                memory=costs.memory,
                charged=charged,
                key=found.key,
                estimated=found.estimated,
            )
            new_costs.replace(made.with_suffix(".npz"))
            new.replace(made)

    def to_steps(self) -> ToSteps:
        """Return the conversion of counts into steps, once compiled. Whole numbers: nothing is rounded."""
        assert self._steps is not None
        steps = self._steps

        def to_steps(counters: Counters) -> int:
            return int((np.ctypeslib.as_array(counters).view(np.int64) * steps).sum())

        return to_steps


WINDOW, STRIDE = 1024, 4096
"""Blocks that are recorded, of how many: a run may enter billions."""


class TracingCompiler:
    """Compiler of traced code for a core. ``program`` is the result."""

    def __init__(self, law: CoreLaw) -> None:
        self.law = law
        self.program: OptimisedCode | None = None

    def __call__(
        self, tools: CppToolchain, sources: Sequence[Path], include: Sequence[Path], flags: Sequence[str]
    ) -> list[Path]:
        """Compile sources to objects that record their blocks. Plain compilation first reports errors."""
        from volery.cost.native import compile_program, runtime_objects

        compile_each(tools, sources, include, flags)
        self.program = compile_program(sources, self.law, compiler_options(include, flags))
        with TemporaryDirectory(dir=cache_folder()) as scratch:
            code = Path(scratch, "code.o")
            self.program.traced_object(code)
            made = code.replace(cache_folder() / f"{self.program.key}.{code.name}")
        return [made, *runtime_objects(cache_folder())]

    def begin(self, library: LoadedLibrary, file: Path) -> None:
        """Make a library record its blocks to *file* until its ``volery_end`` is called."""
        from volery.cost.native import cache_settings

        library.function("volery_model_caches")(cache_settings(self.law.memory).encode())
        each, of = ctypes.c_uint64(WINDOW), ctypes.c_uint64(STRIDE)
        library.function("volery_trace_into")(str(file).encode(), each, of)


_LIBRARIES = {
    "c++": LibraryHeaders(),
    "roscpp": LibraryHeaders((roscpp.INCLUDE,), roscpp.FALLBACK, roscpp.generate_headers, NOT_OFFERED),
    "rclcpp": LibraryHeaders(
        (rclcpp.INCLUDE,), rclcpp.FALLBACK, rclcpp.generate_headers, NOT_OFFERED, rclcpp.main_of
    ),
}
"""Headers of the client library by language."""


def is_cpp(component: Component) -> bool:
    """Return True if the component has C++ code."""
    return bool(component.path) and component.language in _LIBRARIES


def has_cpp(system: System) -> bool:
    """Return True if a component of *system* has C++ code."""
    return any(is_cpp(instance.component) for instance in system.instances)


class CompiledInstance(NamedTuple):
    """Compiled code of an instance, and how it is counted or traced, if at all."""

    compiled: CompiledComponent
    counting: CountingCompiler | None = None
    tracing: TracingCompiler | None = None


def compile_all(
    system: System,
    instances: Iterable[InstanceModel],
    fidelity: str,
    tell: ReportProgress | None = None,
    *,
    traced: bool = False,
) -> dict[str, CompiledInstance]:
    """Compile the C++ components among *instances*, or take them from the cache.

    Args:
        system: The model.
        instances: Instances of this process.
        fidelity: Fidelity of the run. At ``times`` a missing compiler is no error: nothing is returned.
        tell: Receives the progress.
        traced: Trace the components whose code would be counted.

    Returns:
        The compiled instances by name.

    Raises:
        ModelError: A component does not compile; has the compiler's message.
        UsageError: There is no compiler.
    """
    if fidelity == "times" and not has_compiler():
        return {}
    use_message_versions(system.vehicles)
    return {
        instance.name: _compile(
            system, instance, None if traced else tell, TracingCompiler(core) if traced and core else core
        )
        for instance in instances
        if is_cpp(instance.component)
        for core in (core_of(system, fidelity, instance),)
    }


def _compile(
    system: System,
    instance: InstanceModel,
    tell: ReportProgress | None,
    how: CoreLaw | TracingCompiler | None,
) -> CompiledInstance:
    component = instance.component
    library = _LIBRARIES[component.language]
    description = describe_component(system, component)
    if how is None or instance.processor is None:
        return CompiledInstance(compile_component(description, library, tell))
    if isinstance(how, TracingCompiler):
        return CompiledInstance(compile_component(description, library, tell, how), tracing=how)
    counting = CountingCompiler(how, system.processor(instance.processor).frequency_mhz)
    return CompiledInstance(compile_component(description, library, tell, counting), counting)


def describe_component(system: System, component: Component) -> CppComponent:
    """Return the description of *component* for its compilation."""
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
        tuple(CppPort(port.name, port.interface, port.many) for port in component.requires.values()),
        system.interfaces,
        tuple(_from_model(system, flag) for flag in component.build.flags),
        component.build.libraries,
        component.where,
        component.class_name if component.language == "rclcpp" and component.stated_class else "",
    )


def _from_model(system: System, flag: str) -> str:
    """Return ``-Ifolder`` with a folder that is relative to the model's."""
    folder = system.folder / flag.removeprefix("-I")
    return f"-I{folder.resolve()}" if flag.startswith("-I") and flag != "-I" and folder.is_dir() else flag


def _class_of(component: Component, system: System) -> str:
    """Return the class of a component, empty for a program with its own ``main``."""
    if component.language == "rclcpp":
        return ""  # its main() is generated where there is none
    if component.stated_class:
        return component.class_name
    sources = find_sources(system.file_of(component), component.where)
    return "" if sources.defines_main() else component.class_name


def _check_port(component: Component, port: str, interface: str) -> None:
    if interface == ENVIRONMENT_INTERFACE or (interface in VEHICLE_INTERFACES and interface != DRONE):
        what = f"a C++ component cannot require {interface}; use the interfaces of the model or {DRONE}"
        raise ModelError(what, f"components.{component.name}.requires.{port}", component.where)


class CppPrograms:
    """Programs of the C++ components of one run."""

    def __init__(
        self,
        kernel: Kernel,
        graph: RosGraph,
        ready: Mapping[str, CompiledInstance],
        launches: Mapping[str, Launch],
        nodes: Mapping[str, Node],
        traces: Path | None = None,
    ) -> None:
        self._kernel = kernel
        self._traces = traces
        self._traced: list[LoadedLibrary] = []
        self._graph = graph
        self._ready = ready
        self._launches = launches
        self._nodes = nodes
        self.meters = {name: StepMeter() for name, one in ready.items() if one.counting is not None}

    def warnings(self, instances: Iterable[InstanceModel]) -> list[str]:
        """Return doubts about the counted costs, and which of *instances* could not be compiled."""
        said = {one.counting.estimated: None for one in self._ready.values() if one.counting is not None}
        missing = [
            instance.name
            for instance in instances
            if is_cpp(instance.component) and instance.name not in self
        ]
        if missing:
            said[
                f"{', '.join(missing)}: stated times alone, for there is no C++ compiler: {COMPILER_HINT}"
            ] = None
        return [warning for warning in said if warning]

    def __contains__(self, name: str) -> bool:
        """Return True if the instance *name* has a program."""
        return name in self._ready

    def program(self, model: InstanceModel) -> CppProgram:
        """Return the program of an instance."""
        compiled, counting, tracing = self._ready[model.name]
        library = None if model.component.language == "c++" else partial(self._join, model)
        made = CppProgram(self._kernel, model.name, compiled, library, model.arguments)
        if counting is not None:
            made.count(self.meters[model.name], counting.to_steps())
        if tracing is not None and self._traces is not None:
            made.when_loaded(partial(self._trace, tracing, self._traces / model.name))
        return made

    def _join(self, model: InstanceModel) -> tuple[RequestHandlers, Callable[[], None]]:
        launch = self._launches.get(model.name, Launch())
        if model.component.language == "rclcpp":
            ros2 = rclcpp.Session(self._graph, model.name, launch, self._nodes)
            return rclcpp.request_handlers(ros2), ros2.end
        session = roscpp.Session(self._graph, model.name, launch, self._nodes)
        return roscpp.request_handlers(session), session.end

    def _trace(self, tracing: TracingCompiler, file: Path, library: LoadedLibrary) -> None:
        tracing.begin(library, file)
        self._traced.append(library)

    def finish(self) -> None:
        """End the traces of all libraries."""
        for library in self._traced:
            library.function("volery_end")()
