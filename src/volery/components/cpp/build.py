"""From a component's sources to its library: generated headers and glue, objects, one shared object."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from volery.base.errors import Location, ModelError
from volery.components.cpp import bindings as generated
from volery.components.cpp.bindings import CppOperation, RequiredPort
from volery.components.cpp.compiler import CppToolchain, ReportProgress, Sources, cache_folder, find_sources
from volery.model.system import Interface

RUNTIME = Path(__file__).parent / "runtime"
INCLUDE = RUNTIME / "include"

CompileSources = Callable[[CppToolchain, Sequence[Path], Sequence[Path], Sequence[str]], Sequence[Path]]
"""Compiles the user's sources, given include folders and options; returns object files. Whoever counts what
code computes gives another one than the compiler's own."""

GenerateHeaders = Callable[[Sequence[str], Path], Mapping[str, str]]
"""Texts of headers by their names, for what the files in a folder include."""


def compile_each(
    tools: CppToolchain, sources: Sequence[Path], include: Sequence[Path], flags: Sequence[str]
) -> list[Path]:
    """The compiler's own way: an object for each source."""
    return [tools.object_file(source, include, flags) for source in sources]


@dataclass(frozen=True)
class CppComponent:
    """A kind of component in C++. *class_name* is empty for a program of its own, with a ``main``.

    *flags* go to the compiler, *libraries* to the linker, by the names that follow ``-l``.
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
    """What a client library adds: folders of headers, and headers that are generated for what is included.

    *fallback* folders are searched after the system's.
    """

    include: tuple[Path, ...] = ()
    fallback: tuple[Path, ...] = ()
    generate: GenerateHeaders = lambda includes, folder: {}


@dataclass(frozen=True)
class CompiledComponent:
    """A component that is ready to be loaded: its library, and the runtime that all of them share."""

    component: CppComponent
    library: Path
    house: Path


def compile_component(
    component: CppComponent,
    face: ClientLibrary = ClientLibrary(),
    tell: ReportProgress | None = None,
    compiled_by: CompileSources = compile_each,
) -> CompiledComponent:
    """Compile and link, as far as that was not done before.

    ``ModelError`` with the compiler's words if it does not compile, ``UsageError`` if there is no compiler.
    """
    sources = find_sources(component.path, component.where)
    tools = CppToolchain(component.name, tell)
    house = build_framework()
    include = (sources.folder, _headers(component, face, sources), *face.include, INCLUDE)
    flags = (*component.flags, *(option for path in face.fallback for option in ("-idirafter", str(path))))
    units = compiled_by(tools, _units(component, sources), include, flags)
    ours = ["component.cpp", "stand_ins.cpp", *(["main.cpp"] if not component.class_name else [])]
    objects = [*units, *(_own(name) for name in ours)]
    options = [str(house), *(f"-l{library}" for library in component.libraries)]
    return CompiledComponent(component, tools.library(objects, options), house)


def build_framework() -> Path:
    """The runtime that all components share."""
    return CppToolchain("volery").library([_own("house.cpp")], ["-Wl,-soname,libvolery_house.so", "-pthread"])


def _own(name: str) -> Path:
    return CppToolchain("volery").object_file(RUNTIME / name, [INCLUDE])


def _headers(component: CppComponent, face: ClientLibrary, sources: Sources) -> Path:
    """A folder with all headers that are generated for a component, named by their content."""
    known = (component.interfaces or {}).values()
    texts = {generated.HEADER: generated.interfaces_header(_usable(component, known))}
    texts.update(face.generate(sources.includes(), component.path))
    return _written(texts)


def _usable(component: CppComponent, known: Iterable[Interface]) -> list[Interface]:
    """The interfaces that it provides or requires: others may speak of types that C++ has not."""
    offered = {one.name for one in component.provided}
    required = {one.interface for one in component.requires}
    return [one for one in known if one.name in required or offered & one.operations.keys()]


def _units(component: CppComponent, sources: Sources) -> list[Path]:
    """What is compiled: for a class, the glue takes the place of the source that defines it."""
    if not component.class_name:
        return list(sources.compiled)
    file = sources.file_of_class(component.class_name)
    if file is None:
        what = f"no class {component.class_name!r} in {', '.join(one.name for one in sources.own)}"
        raise ModelError(what, component.name, component.where)
    text = generated.glue(
        component.class_name, file, component.requires, component.provided, component.interfaces or {}
    )
    glue = _written({"glue.cpp": text}) / "glue.cpp"
    return [glue, *(one for one in sources.compiled if one != file)]


def _written(texts: Mapping[str, str]) -> Path:
    """A folder of the cache with these files."""
    digest = sha256(repr(sorted(texts.items())).encode()).hexdigest()[:32]
    folder = cache_folder() / "generated" / digest
    for name, text in texts.items():
        file = folder / name
        if not file.exists():
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
    return folder
