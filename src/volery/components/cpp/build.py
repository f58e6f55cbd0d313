"""From a component's sources to its library: generated headers and glue, object files, one shared object.

``interfaces.h`` has the model's interfaces as abstract classes; a component's file includes it. The glue
connects the user's class to the framework ABI: it constructs the class from its required ports, in the order
of the model, and calls its operations. Values of the model's types (``bool``, ``int``, ``float``, ``str``,
``bytes``, ``Position`` and ``T[]``) are encoded as ``abi_codec`` says.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from volery.base.errors import Location, ModelError, UsageError, choices
from volery.base.position import AMSL, AboveGround, AboveHome, Ellipsoidal, Position
from volery.components.cpp.compiler import CppToolchain, ReportProgress, cache_folder
from volery.components.cpp.sources import Sources, find_sources
from volery.model.components import Interface, Signature
from volery.ros import client_libraries
from volery.ros.client_libraries.abi_codec import Reader, Writer

HEADER = "volery/interfaces.h"
DRONE = "Drone"
"""The interface of a vehicle that C++ components may require; its C++ class is ``I_RosDron``."""

_ALTITUDES = (AMSL, Ellipsoidal, AboveHome, AboveGround)
"""In the order of ``volery::Reference``."""

_PASSED_BY_VALUE = ("bool", "std::int64_t", "double")


class CppType(NamedTuple):
    """A type: its name in C++, and the functions that encode and decode a value."""

    cpp: str
    write: Callable[[Writer, Any], object]
    read: Callable[[Reader], Any]

    @property
    def as_argument(self) -> str:
        """The parameter type in C++: small types by value, others by reference."""
        return self.cpp if self.cpp in _PASSED_BY_VALUE else f"const {self.cpp}&"


def _write_position(writer: Writer, value: Position) -> None:
    writer.real(value.latitude).real(value.longitude).real(value.altitude.metres)
    writer.integer(_ALTITUDES.index(type(value.altitude)))


def _read_position(reader: Reader) -> Position:
    latitude, longitude, metres = reader.real(), reader.real(), reader.real()
    return Position(latitude, longitude, _ALTITUDES[reader.integer()](metres))


_TYPES: Mapping[str, CppType] = {
    "": CppType("void", lambda writer, value: None, lambda reader: None),
    "bool": CppType("bool", Writer.flag, Reader.flag),
    "int": CppType("std::int64_t", Writer.integer, Reader.integer),
    "float": CppType("double", Writer.real, Reader.real),
    "str": CppType("std::string", Writer.text, Reader.text),
    "bytes": CppType("std::vector<std::uint8_t>", Writer.raw, Reader.raw),
    "Position": CppType("volery::Position", _write_position, _read_position),
}


def cpp_type(written: str, where: str) -> CppType:
    """Return the C++ type for a type as the model writes it.

    Raises:
        ModelError: C++ has no such type; the error names ``where``.
    """
    name = written.strip()
    if name.endswith("[]"):
        return _vector_of(cpp_type(name.removesuffix("[]"), where))
    if name not in _TYPES:
        known = choices([one for one in _TYPES if one])
        raise ModelError(f"C++ components know no {name!r}, but {known}, and lists of them", where)
    return _TYPES[name]


def _vector_of(element: CppType) -> CppType:
    def write(writer: Writer, values: Any) -> None:
        writer.integer(len(values))
        for value in values:
            element.write(writer, value)

    def read(reader: Reader) -> list[Any]:
        return [element.read(reader) for _ in range(reader.integer())]

    return CppType(f"std::vector<{element.cpp}>", write, read)


@dataclass(frozen=True)
class CppOperation:
    """An operation of an interface with the C++ types of its arguments and result."""

    name: str
    arguments: tuple[tuple[str, CppType], ...]
    returns: CppType

    @property
    def declaration(self) -> str:
        """The operation as a member function."""
        parameters = ", ".join(f"{kind.as_argument} {name}" for name, kind in self.arguments)
        return f"{self.returns.cpp} {self.name}({parameters})"


def operation(interface: str, signature: Signature) -> CppOperation:
    """Return an operation with its C++ types.

    Raises:
        ModelError: C++ has no counterpart of a type.
    """
    where = f"interfaces.{interface}.{signature.name}"
    arguments = tuple(
        (argument.name, cpp_type(argument.type, f"{where}.args.{argument.name}"))
        for argument in signature.arguments
    )
    return CppOperation(signature.name, arguments, cpp_type(signature.returns, f"{where}.returns"))


def operations(interface: Interface) -> tuple[CppOperation, ...]:
    """Return all operations of an interface, in the order of the model."""
    return tuple(operation(interface.name, one) for one in interface.operations.values())


@dataclass(frozen=True)
class CppPort:
    """A required port: its name, its interface, and whether it may be connected to several components."""

    port: str
    interface: str
    many: bool = False

    @property
    def cpp_class(self) -> str:
        """Class of the objects at the port."""
        return "I_RosDron" if self.interface == DRONE else self.interface

    @property
    def parameter(self) -> str:
        """Parameter type of the component's constructor."""
        return f"const std::vector<{self.cpp_class}*>&" if self.many else f"{self.cpp_class}&"


def interfaces_header(interfaces: Iterable[Interface]) -> str:
    """Return the text of ``interfaces.h``."""
    lines = ["// Generated from the model: its interfaces.", "#pragma once", '#include "volery/types.h"', ""]
    for interface in interfaces:
        lines.append(f"class {interface.name} {{")
        lines.append("public:")
        lines.append(f"    virtual ~{interface.name}() = default;")
        lines += [f"    virtual {found.declaration} = 0;" for found in operations(interface)]
        lines += ["};", ""]
    return "\n".join(lines)


def glue(
    class_name: str,
    file: Path,
    requires: Sequence[CppPort],
    provided: Sequence[CppOperation],
    interfaces: Mapping[str, Interface],
) -> str:
    """Return the text that makes ``class_name``, defined in ``file``, a component."""
    used = dict.fromkeys(require.interface for require in requires if require.interface != DRONE)
    lines = ["// Generated: connects the component's class to the framework ABI.", f'#include "{file}"', ""]
    lines += ['#include "volery/glue.h"', f'#include "{HEADER}"', "", "namespace {"]
    for name in used:
        lines += _port_class(interfaces[name])
    lines += [f"volery::Component<{class_name}> component;", ""]
    lines += ["bool const registered = [] {"]
    lines += [f"    {line}" for line in _construction(class_name, requires)]
    for number, one in enumerate(provided):
        lines += [f"    {line}" for line in _operation_callable(number, one)]
    lines += ["    return true;", "}();", "}  // namespace", ""]
    return "\n".join(lines)


def _port_class(interface: Interface) -> list[str]:
    """Return the class behind a required port: each member function is a request."""
    name = interface.name
    lines = [f"class {name}_port final : public {name}, public volery::Port {{", "public:"]
    lines.append("    using volery::Port::Port;")
    for one in operations(interface):
        names = "".join(f", {name}" for name, _ in one.arguments)
        lines.append(f"    {one.declaration} override {{")
        lines.append(f'        return call<{one.returns.cpp}>("{one.name}"{names});')
        lines.append("    }")
    return [*lines, "};", ""]


def _construction(class_name: str, requires: Sequence[CppPort]) -> list[str]:
    ports = []
    for one in requires:
        implementation = one.cpp_class if one.interface == DRONE else f"{one.interface}_port"
        template = "many" if one.many else "one"
        ports.append(f'volery::{template}<{one.cpp_class}, {implementation}>("{one.port}")')
    parameters = "".join(f", {require.parameter}" for require in requires)
    return [
        "volery::register_callable_as(volery::MAKE, [](volery::Reader, volery::Writer&) {",
        f"    volery::check_constructor<{class_name}{parameters}>();",
        f"    component.make({', '.join(ports)});",
        "});",
        "volery::register_callable_as(volery::RUN, "
        "[](volery::Reader, volery::Writer&) { component.run(); });",
    ]


def _operation_callable(number: int, one: CppOperation) -> list[str]:
    lines = [
        f"volery::register_callable_as(volery::OPERATIONS + {number}, "
        "[]([[maybe_unused]] volery::Reader in, [[maybe_unused]] volery::Writer& out) {"
    ]
    lines += [f"    auto const {name} = volery::get<{kind.cpp}>(in);" for name, kind in one.arguments]
    called = f"component->{one.name}({', '.join(name for name, _ in one.arguments)})"
    lines.append(f"    {called};" if one.returns.cpp == "void" else f"    volery::put(out, {called});")
    return [*lines, "});"]


RUNTIME = Path(__file__).parent / "runtime"
INCLUDE = (RUNTIME / "include", Path(str(client_libraries.__file__)).parent / "include")
"""Folders of headers that every component may include; the second one has the framework ABI."""

CompileSources = Callable[[CppToolchain, Sequence[Path], Sequence[Path], Sequence[str]], Sequence[Path]]
"""Compiles sources with a toolchain, include folders and options; returns object files.

Fidelity ``code`` replaces the plain compiler by one that inserts counters.
"""

GenerateHeaders = Callable[[Sequence[str], Path, Collection[str]], Mapping[str, str]]
"""Returns header texts by file name for the given ``#include`` names of the files in a folder.

The last argument has the names that are files of the workspace.
"""


def compile_each(
    tools: CppToolchain, sources: Sequence[Path], include: Sequence[Path], flags: Sequence[str]
) -> list[Path]:
    """Compile each source into one object file, as the compiler does by itself."""
    return [tools.object_file(source, include, flags) for source in sources]


@dataclass(frozen=True)
class CppComponent:
    """A type of component in C++.

    ``class_name`` is empty for a program with a ``main``. ``node_class`` is the class of a client library's
    node, if the model states it. ``flags`` go to the compiler, ``libraries`` to the linker, without the
    leading ``-l``. ``where`` is the line of the model that names the file.
    """

    name: str
    path: Path
    class_name: str = ""
    provided: tuple[CppOperation, ...] = ()
    requires: tuple[CppPort, ...] = ()
    interfaces: Mapping[str, Interface] | None = None
    flags: tuple[str, ...] = ()
    libraries: tuple[str, ...] = ()
    where: Location | None = None
    node_class: str = ""


@dataclass(frozen=True)
class LibraryHeaders:
    """Headers of a client library.

    ``include`` folders are searched before the system's, ``fallback`` folders after them. ``generate`` makes
    message headers for the names that a component includes; the text of one that is not offered begins with
    ``not_offered``, and says why. ``main_of`` returns the text of a file with the ``main`` that a component's
    sources lack, or ``""``.
    """

    include: tuple[Path, ...] = ()
    fallback: tuple[Path, ...] = ()
    generate: GenerateHeaders = lambda includes, folder, found: {}
    not_offered: str = "//"
    main_of: Callable[[Sources, str], str] = lambda sources, node_class: ""


@dataclass(frozen=True)
class CompiledComponent:
    """A component that is ready to be loaded: its library, and the ``framework`` library that all share."""

    component: CppComponent
    library: Path
    framework: Path


def compile_component(
    component: CppComponent,
    client_library: LibraryHeaders = LibraryHeaders(),
    report_progress: ReportProgress | None = None,
    compiled_by: CompileSources = compile_each,
) -> CompiledComponent:
    """Compile and link a component, reusing cached objects.

    Raises:
        ModelError: The sources do not compile; the message is the compiler's.
        UsageError: There is no compiler.
    """
    sources = find_sources(component.path, component.where, _include_flags(component.flags))
    tools = CppToolchain(component.name, report_progress)
    framework = build_framework()
    headers = _generated_headers(component, client_library, sources)
    include = (sources.folder, headers, *client_library.include, *INCLUDE, *sources.folders)
    fallback = (option for path in client_library.fallback for option in ("-idirafter", str(path)))
    files = [*_translation_units(component, sources), *_main(component, client_library, sources)]
    try:
        units = compiled_by(tools, files, include, (*component.flags, *fallback))
    except ModelError as error:
        error = _of_the_class(component, sources, error)
        raise _with_missing_headers(sources, headers, client_library.not_offered, error) from None
    ours = [
        "component.cpp",
        "virtual_time.cpp",
        "virtual_threads.cpp",
        *(["main_entry.cpp"] if not component.class_name else []),
    ]
    objects = [*units, *(_runtime_object(name) for name in ours)]
    options = [str(framework), *(f"-l{library}" for library in component.libraries)]
    return CompiledComponent(component, tools.library(objects, options), framework)


def _include_flags(flags: Sequence[str]) -> tuple[Path, ...]:
    """Return the folders of the options ``-Ifolder`` and ``-I folder``."""
    separate = [after for option, after in pairwise(flags) if option == "-I"]
    joined = [option[2:] for option in flags if option.startswith("-I") and option != "-I"]
    return tuple(Path(one) for one in (*joined, *separate))


_REFUSALS = 3
_ABSENT = re.compile(r"(?:fatal error: |')(\w+)/[\w./]+(?:: No such file|' file not found)")
_NO_MEMBER = re.compile(r"has no member named '(\w+)'|no member named '(\w+)' in")


def _of_the_class(component: CppComponent, sources: Sources, error: ModelError) -> ModelError:
    """Return an error of the compiler in generated code as one of the class that the code calls."""
    if error.where is None or Path(error.where.file).resolve() in sources.own or not component.class_name:
        return error
    where = sources.place_of_class(component.class_name) or component.where
    missing = _NO_MEMBER.search(error.what)
    name = next((group for group in missing.groups() if group), "") if missing else ""
    if name in [one.name for one in component.provided]:
        what = f"has no member function {name!r}, an operation that it provides"
    else:
        what = f"does not fit the ports and operations of the model: {error.what}"
    return ModelError(what, component.name, where)


def _with_missing_headers(sources: Sources, headers: Path, not_offered: str, error: ModelError) -> ModelError:
    """Return an error of the compiler with what is said of the headers that are missing, or not offered."""
    refused = {}
    for name in sources.included:
        file = headers / name
        text = file.read_text(encoding="utf-8") if file.is_file() else ""
        if text.startswith(not_offered) and "\n" not in text.rstrip():
            refused[name] = text.removeprefix(not_offered).strip()
    absent = _ABSENT.search(error.what)
    if absent:
        package = absent.group(1)
        remedy = f"source the workspace of package {package} (ROS_PACKAGE_PATH) if <{package}/...> is of one"
        refused = {package: f"{remedy}, or name the folder in the component's build: {{flags: -I...}}"}
    named = [why for name, why in refused.items() if name.partition("/")[0] in error.what]
    shown = (named or list(refused.values()))[:_REFUSALS]
    return ModelError("\n".join((error.what, *shown)), error.path, error.where) if shown else error


def build_framework() -> Path:
    """Build the framework library that all components share."""
    options = ["-Wl,-soname,libvolery_framework.so", "-pthread"]
    return CppToolchain("volery").library([_runtime_object("framework.cpp")], options)


def _runtime_object(name: str) -> Path:
    return CppToolchain("volery").object_file(RUNTIME / name, INCLUDE)


def _generated_headers(component: CppComponent, client_library: LibraryHeaders, sources: Sources) -> Path:
    """Return a folder with the interface and message headers of a component, named by their content.

    Only interfaces that the component provides or requires are generated: others may use types that have no
    counterpart in C++.
    """
    provided = {one.name for one in component.provided}
    required = {require.interface for require in component.requires}
    used = [
        interface
        for interface in (component.interfaces or {}).values()
        if interface.name in required or provided & interface.operations.keys()
    ]
    texts = {HEADER: interfaces_header(used)}
    texts.update(client_library.generate(sources.included, component.path, sources.found))
    return _write_generated(texts)


def _translation_units(component: CppComponent, sources: Sources) -> list[Path]:
    """Return the files to compile; for a class, the glue replaces the source that defines the class."""
    if not component.class_name:
        return list(sources.compiled)
    file = sources.file_of_class(component.class_name)
    if file is None:
        what = f"no class {component.class_name!r} in {', '.join(one.name for one in sources.own)}"
        raise ModelError(what, component.name, component.where)
    text = glue(
        component.class_name, file, component.requires, component.provided, component.interfaces or {}
    )
    name = file.with_suffix(".cpp").name  # what is said of this unit is said of the user's file
    return [_write_generated({name: text}) / name, *(one for one in sources.compiled if one != file)]


def _main(component: CppComponent, client_library: LibraryHeaders, sources: Sources) -> Iterator[Path]:
    """Yield the file with the ``main`` that the client library provides, if any."""
    try:
        text = client_library.main_of(sources, component.node_class)
    except UsageError as error:
        raise ModelError(str(error), component.name, component.where) from None
    if text:
        yield _write_generated({"main_of_node.cpp": text}) / "main_of_node.cpp"


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
