"""From a component's sources to its library: generated headers and glue, object files, one shared object."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from volery.base.errors import Location, ModelError
from volery.components.cpp import bindings
from volery.components.cpp.bindings import CppOperation, RequiredPort
from volery.components.cpp.compiler import CppToolchain, ReportProgress, Sources, cache_folder, find_sources
from volery.model.components import Interface
from volery.ros import client_libraries

RUNTIME = Path(__file__).parent / "runtime"
INCLUDE = (RUNTIME / "include", Path(str(client_libraries.__file__)).parent / "include")
"""Folders of headers that every component may include; the second one has the framework ABI."""

CompileSources = Callable[[CppToolchain, Sequence[Path], Sequence[Path], Sequence[str]], Sequence[Path]]
"""Compiles sources with a toolchain, include folders and options; returns object files.

Fidelity ``code`` replaces the plain compiler by one that inserts counters.
"""

GenerateHeaders = Callable[[Sequence[str], Path], Mapping[str, str]]
"""Returns header texts by file name for the given ``#include`` names of the files in a folder."""


def compile_each(
    tools: CppToolchain, sources: Sequence[Path], include: Sequence[Path], flags: Sequence[str]
) -> list[Path]:
    """Compile each source into one object file, as the compiler does by itself."""
    return [tools.object_file(source, include, flags) for source in sources]


@dataclass(frozen=True)
class CppComponent:
    """A type of component in C++.

    ``class_name`` is empty for a program with a ``main``. ``flags`` go to the compiler, ``libraries`` to the
    linker, without the leading ``-l``. ``where`` is the line of the model that names the file.
    """

    name: str
    path: Path
    class_name: str = ""
    provided: tuple[CppOperation, ...] = ()
    requires: tuple[RequiredPort, ...] = ()
    interfaces: Mapping[str, Interface] | None = None
    flags: tuple[str, ...] = ()
    libraries: tuple[str, ...] = ()
    where: Location | None = None


@dataclass(frozen=True)
class ClientLibrary:
    """Headers of a client library.

    ``include`` folders are searched before the system's, ``fallback`` folders after them. ``generate`` makes
    message headers for the names that a component includes.
    """

    include: tuple[Path, ...] = ()
    fallback: tuple[Path, ...] = ()
    generate: GenerateHeaders = lambda includes, folder: {}


@dataclass(frozen=True)
class CompiledComponent:
    """A component that is ready to be loaded: its library, and the ``framework`` library that all share."""

    component: CppComponent
    library: Path
    framework: Path


def compile_component(
    component: CppComponent,
    client_library: ClientLibrary = ClientLibrary(),
    report_progress: ReportProgress | None = None,
    compiled_by: CompileSources = compile_each,
) -> CompiledComponent:
    """Compile and link a component, reusing cached objects.

    Raises:
        ModelError: The sources do not compile; the message is the compiler's.
        UsageError: There is no compiler.
    """
    sources = find_sources(component.path, component.where)
    tools = CppToolchain(component.name, report_progress)
    framework = build_framework()
    headers = _generated_headers(component, client_library, sources)
    include = (sources.folder, headers, *client_library.include, *INCLUDE)
    fallback = (option for path in client_library.fallback for option in ("-idirafter", str(path)))
    units = compiled_by(tools, _translation_units(component, sources), include, (*component.flags, *fallback))
    ours = ["component.cpp", "virtual_time.cpp", *(["main_entry.cpp"] if not component.class_name else [])]
    objects = [*units, *(_runtime_object(name) for name in ours)]
    options = [str(framework), *(f"-l{library}" for library in component.libraries)]
    return CompiledComponent(component, tools.library(objects, options), framework)


def build_framework() -> Path:
    """Build the framework library that all components share."""
    options = ["-Wl,-soname,libvolery_framework.so", "-pthread"]
    return CppToolchain("volery").library([_runtime_object("framework.cpp")], options)


def _runtime_object(name: str) -> Path:
    return CppToolchain("volery").object_file(RUNTIME / name, INCLUDE)


def _generated_headers(component: CppComponent, client_library: ClientLibrary, sources: Sources) -> Path:
    """Return a folder with the interface and message headers of a component, named by their content.

    Only interfaces that the component provides or requires are generated: others may use types that have no
    counterpart in C++.
    """
    provided = {one.name for one in component.provided}
    required = {one.interface for one in component.requires}
    used = [
        one
        for one in (component.interfaces or {}).values()
        if one.name in required or provided & one.operations.keys()
    ]
    texts = {bindings.HEADER: bindings.interfaces_header(used)}
    texts.update(client_library.generate(sources.includes(), component.path))
    return _write_generated(texts)


def _translation_units(component: CppComponent, sources: Sources) -> list[Path]:
    """Return the files to compile; for a class, the glue replaces the source that defines the class."""
    if not component.class_name:
        return list(sources.compiled)
    file = sources.file_of_class(component.class_name)
    if file is None:
        what = f"no class {component.class_name!r} in {', '.join(one.name for one in sources.own)}"
        raise ModelError(what, component.name, component.where)
    text = bindings.glue(
        component.class_name, file, component.requires, component.provided, component.interfaces or {}
    )
    glue = _write_generated({"glue.cpp": text}) / "glue.cpp"
    return [glue, *(one for one in sources.compiled if one != file)]


def _write_generated(texts: Mapping[str, str]) -> Path:
    """Write files into a folder of the cache that is named by their content."""
    digest = sha256(repr(sorted(texts.items())).encode()).hexdigest()[:32]
    folder = cache_folder() / "generated" / digest
    for name, text in texts.items():
        file = folder / name
        if not file.exists():
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
    return folder
