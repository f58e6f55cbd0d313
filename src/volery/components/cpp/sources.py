"""Sources of a C++ component: what is compiled, and the headers that belong to it.

The targets of the package's ``CMakeLists.txt`` say which other sources belong to a file. Headers are searched
as a workspace's build does: beside the file, in the ``include`` of its package and of other packages.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from volery.base.errors import Location, ModelError
from volery.ros.messages.workspace import Package, Workspace

_SOURCE_SUFFIXES = (".cpp", ".cc", ".cxx", ".c++")
_HEADER_SUFFIXES = (".h", ".hpp", ".hh", ".hxx")
_INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*[<"]([^>"\n]+)[>"]', re.MULTILINE)
_COMMENT = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', re.DOTALL)
_MAIN = re.compile(r"^\s*(?:extern\s+\"C\"\s+)?(?:auto|int)\s+main\s*\(", re.MULTILINE)
_TARGET = re.compile(
    r"^[ \t]*\w*?(add_executable|add_library|target_link_libraries)\s*\(([^)]*)\)", re.M | re.I
)
_VARIABLE = re.compile(r"^[ \t]*set\s*\(\s*(\w+)\s+([^)]*?)\s*\)", re.MULTILINE | re.IGNORECASE)
_PROJECT = re.compile(r"^[ \t]*project\s*\(\s*([\w-]+)", re.MULTILINE | re.IGNORECASE)


@dataclass(frozen=True)
class Sources:
    """Files of a component: ``compiled`` are translation units, ``own`` those and the headers beside them.

    ``included`` are the names in all ``#include`` lines, each once; ``found`` are those that are files of the
    sources of the workspace, and ``folders`` where these and those of installed packages are.
    """

    folder: Path
    compiled: tuple[Path, ...]
    own: tuple[Path, ...]
    included: tuple[str, ...] = ()
    found: frozenset[str] = frozenset()
    folders: tuple[Path, ...] = ()

    def defines_main(self) -> bool:
        """Return whether the component is a program with a ``main``."""
        return any(_MAIN.search(_code(file)) for file in self.compiled)

    def file_of_class(self, name: str) -> Path | None:
        """Return the file that defines a class, headers first, or None."""
        definition = _definition(name)
        in_order = sorted(self.own, key=lambda file: file.suffix not in _HEADER_SUFFIXES)
        return next((file for file in in_order if definition.search(_code(file))), None)

    def mentions(self, function: str) -> bool:
        """Return whether a file declares, defines or calls a function of this name."""
        return any(re.search(rf"\b{re.escape(function)}\s*\(", _code(file)) for file in self.own)

    def place_of_class(self, name: str) -> Location | None:
        """Return file and line of the definition of a class, or None."""
        file = self.file_of_class(name)
        match = _definition(name).search(_text(file)) if file is not None else None
        return Location(str(file), _text(file).count("\n", 0, match.start()) + 1) if file and match else None


def _definition(name: str) -> re.Pattern[str]:
    return re.compile(rf"\b(?:class|struct)\s+{re.escape(name)}\b(?:\s+final)?\s*(?::[^:;{{][^;{{]*)?\{{")


def find_sources(path: Path, where: Location | None = None, include: tuple[Path, ...] = ()) -> Sources:
    """Find the sources of the component at ``path``, a file or a folder.

    All sources in a folder and its subfolders are compiled. Of a file that file is compiled, and what its
    package builds into the same executable; headers beside it and in subfolders belong to it.

    Args:
        path: File or folder.
        where: Line of the model that names it.
        include: Further folders that are searched for headers.

    Raises:
        ModelError: There is nothing to compile; the error names ``where``.
    """
    folder = path if path.is_dir() else path.parent
    if not path.exists():
        raise ModelError(f"no file or folder {path}", where=where)
    workspace = Workspace()
    package = workspace.package_of(path)
    around = [file for file in sorted(folder.rglob("*")) if file.is_file()]
    if path.is_dir():
        compiled = [file for file in around if file.suffix in _SOURCE_SUFFIXES]
    else:
        compiled = [path, *(_built_with(path, package) if package else ())]
    if not compiled:
        suffixes = ", ".join(_SOURCE_SUFFIXES)
        raise ModelError(f"no source file in {path}: one that ends in {suffixes}", where=where)
    headers = [file for file in around if file.suffix in _HEADER_SUFFIXES]
    own = tuple(file.resolve() for file in (*compiled, *headers))
    first = [folder.resolve(), *include, *((package.include,) if package else ())]
    search = _HeaderSearch(workspace, path, first)
    search.scan(own)
    return Sources(
        folder.resolve(),
        own[: len(compiled)],
        own,
        tuple(search.names),
        frozenset(search.found),
        tuple(search.folders),
    )


class _HeaderSearch:
    """Follows ``#include`` lines through the workspace."""

    def __init__(self, workspace: Workspace, path: Path, first: list[Path]) -> None:
        self._workspace, self._path, self._first = workspace, path, first
        self._seen: set[Path] = set()
        self.names: dict[str, None] = {}
        self.found: set[str] = set()
        self.folders: dict[Path, None] = dict.fromkeys(first[1:])

    def scan(self, files: tuple[Path, ...]) -> None:
        """Read *files* and the headers that they include."""
        waiting = list(files)
        while waiting:
            file = waiting.pop(0)
            if file in self._seen:
                continue
            self._seen.add(file)
            for name in _INCLUDE.findall(_text(file)):
                self.names[name] = None
                found = self._find(name, file)
                if found is not None:
                    waiting.append(found.resolve())

    def _find(self, name: str, file: Path) -> Path | None:
        for folder in (file.parent, *self._first):
            if (folder / name).is_file():
                self.found.add(name)
                return folder / name
        package = self._workspace.package_with(name, self._path)
        if package is None:
            return None
        self.folders[package.include] = None
        if package.prefix is None:
            self.found.add(name)
        return package.include / name


class _Targets(NamedTuple):
    """Targets of a package's ``CMakeLists.txt`` by name: their files, and what is linked with them."""

    executables: dict[str, list[str]]
    libraries: dict[str, list[str]]
    links: dict[str, list[str]]


def _targets(package: Package) -> _Targets:
    targets = _Targets({}, {}, {})
    lists = package.folder / "CMakeLists.txt"
    if not lists.is_file():
        return targets
    text = re.sub(r"#[^\n]*", "", _text(lists))
    project = _PROJECT.search(text)
    name = project.group(1) if project else ""
    known = {"PROJECT_NAME": name, "CMAKE_PROJECT_NAME": name, **dict(_VARIABLE.findall(text))}
    text = re.sub(r"\$\{(?:PROJECT|CMAKE_CURRENT|CMAKE)_SOURCE_DIR\}/?", "", text)
    for _ in range(2):  # a variable may be of another one
        text = re.sub(r"\$\{(\w+)\}", lambda one: known.get(one[1], one[0]), text)
    for command, words in _TARGET.findall(text):
        kinds = {"add_executable": targets.executables, "add_library": targets.libraries}
        target, *rest = words.replace('"', " ").split() or [""]
        kinds.get(command.lower(), targets.links).setdefault(target, []).extend(rest)
    return targets


def executables(package: Package) -> dict[str, Path]:
    """Return the programs that a package builds of C++: the file with their ``main`` by name.

    A file with a ``main`` that no target has makes a program of its own name.
    """
    found: dict[str, Path] = {}
    listed = set[Path]()
    for name, files in _targets(package).executables.items():
        paths = [path for file in files if (path := package.folder / file).is_file()]
        listed.update(paths)
        programs = [path for path in paths if _MAIN.search(_code(path))]
        if programs:
            found[name] = programs[0]
    for path in sorted(package.folder.rglob("*")):
        if path.suffix in _SOURCE_SUFFIXES and path not in listed and _MAIN.search(_code(path)):
            found.setdefault(path.stem, path)
    return found


def _built_with(path: Path, package: Package) -> Iterator[Path]:
    """Yield the other sources of the executable that *path* is built into, by the package's CMake file."""
    built = _targets(package)
    own = path.resolve()
    for name, files in built.executables.items():
        if own in [(package.folder / file).resolve() for file in files]:
            waiting, seen = [name], set[str]()
            while waiting:
                target = waiting.pop(0)
                if target in seen:
                    continue
                seen.add(target)
                for file in (*built.executables.get(target, ()), *built.libraries.get(target, ())):
                    found = (package.folder / file).resolve()
                    if found.suffix in _SOURCE_SUFFIXES and found.is_file() and found != own:
                        yield found
                waiting += [one for one in built.links.get(target, ()) if one in built.libraries]
            return


def _text(file: Path) -> str:
    return file.read_text(encoding="utf-8", errors="replace")


def _code(file: Path) -> str:
    """Return a file's text without comments and strings."""
    return _COMMENT.sub(" ", _text(file))
