"""Programs of packages: the file that ROS executes, and the function of it that ROS calls.

Entry points of Python packages are read from ``setup.py``, ``setup.cfg`` or ``pyproject.toml``, or where they
are installed, without executing anything.
"""

from __future__ import annotations

import ast
import os
import re
import tomllib
from collections.abc import Iterator
from configparser import ConfigParser
from configparser import Error as ConfigError
from pathlib import Path
from typing import NamedTuple

from volery.base.errors import UsageError, choices, did_you_mean
from volery.components.cpp.sources import executables
from volery.components.loader import SourceFile
from volery.ros.messages.workspace import Package, Workspace

_LEVELS = 3
"""Number of folders above a file's own in which its package may begin."""
_SPECIFICATION = re.compile(r"\s*([\w.*-]+)\s*=\s*([\w.*]+)\s*:\s*(\w+)\s*(?:\[.*\])?\s*$")
_UNKNOWN = "*"
"""Stands for a part of a text of ``setup.py`` that is computed while it runs."""


class EntryPoint(NamedTuple):
    """A program of a package: its name, its module (dotted) and the function that is called."""

    name: str
    module: str
    function: str

    def is_in(self, file: Path) -> bool:
        """Return whether *file* is the module; only the last part of the name must be known."""
        parts = self.module.split(".")
        if parts[-1] != file.stem:
            return False
        above = file.parent
        for part in reversed(parts[:-1]):
            if not (above / "__init__.py").is_file():
                return True  # the file lies elsewhere than where it will be installed
            if part not in (_UNKNOWN, above.name):
                return False
            above = above.parent
        return True


def entry_function(source: SourceFile) -> str:
    """Return the function of a file that an entry point of its package calls, or "".

    Of several, it is ``main`` if that is among them, else the first.
    """
    folders = (source.path.parent, *source.path.resolve().parents[1 : _LEVELS + 1])
    for folder in folders:
        functions = [
            point.function
            for point in entry_points(folder)
            if point.is_in(source.path) and source.defines(point.function)
        ]
        if functions:
            return "main" if "main" in functions else functions[0]
    return ""


def entry_points(folder: Path) -> list[EntryPoint]:
    """Return the programs of the package in *folder*; none if it is no Python package."""
    found = []
    for text in (*_of_setup_py(folder), *_of_setup_cfg(folder), *_of_pyproject(folder)):
        matched = _SPECIFICATION.match(text)
        if matched is not None:
            found.append(EntryPoint(*matched.groups()))
    return found


def _of_setup_py(folder: Path) -> Iterator[str]:
    """Yield all texts of ``setup.py`` in lists or alone, with variables of the file put in."""
    try:
        tree = ast.parse((folder / "setup.py").read_bytes())
    except (OSError, SyntaxError, ValueError, RecursionError):
        return
    known = {
        node.targets[0].id: node.value.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Name)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant | ast.JoinedStr | ast.BinOp | ast.Call):
            yield from _text(node, known).splitlines()


def _text(node: ast.AST, known: dict[str, str]) -> str:
    """Return the text of an expression, with ``_UNKNOWN`` for what is not known."""
    found = _UNKNOWN
    match node:
        case ast.Constant(value=str(text)):
            found = text
        case ast.Name(id=name):
            found = known.get(name, _UNKNOWN)
        case ast.JoinedStr(values=parts):
            found = "".join(_text(part, known) for part in parts)
        case ast.FormattedValue(value=inner):
            found = _text(inner, known)
        case ast.BinOp(op=ast.Add(), left=left, right=right):
            found = _text(left, known) + _text(right, known)
        case ast.BinOp(op=ast.Mod(), left=left):
            found = re.sub(r"%\w", _UNKNOWN, _text(left, known))
        case ast.Call(func=ast.Attribute(attr="format", value=pattern)):
            found = re.sub(r"\{\w*\}", _UNKNOWN, _text(pattern, known))
    return found


def _of_setup_cfg(folder: Path) -> list[str]:
    read = ConfigParser(interpolation=None)
    try:
        read.read(folder / "setup.cfg", encoding="utf-8")
    except (ConfigError, UnicodeDecodeError):
        return []
    return read.get("options.entry_points", "console_scripts", fallback="").splitlines()


def _of_pyproject(folder: Path) -> list[str]:
    try:
        read = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return []
    scripts = read.get("project", {}).get("scripts", {})
    return [f"{name} = {target}" for name, target in scripts.items()]


class Executable(NamedTuple):
    """A program of a package: its file, and the function of an entry point or ""."""

    file: Path
    function: str


def find_executable(
    workspace: Workspace, package: str, name: str, near: Path, *, cpp: bool = False
) -> Executable:
    """Return the program *name* of a package, as ``rosrun`` and ``ros2 run`` find it.

    Args:
        workspace: The packages that there are.
        package: Name of the package.
        name: Name of the program: an entry point, an installed file, or a file in the package's folder.
        near: File that names it, from which the package is searched.
        cpp: Search for the source of a program in C++ in place of one in Python.

    Raises:
        UsageError: There is no such package or no such program.
    """
    found = workspace.find(package, near)
    if found is None:
        hint = did_you_mean(package, workspace.names(near))
        raise UsageError(
            f"no package {package!r}{hint} beside the model or in ROS_PACKAGE_PATH or AMENT_PREFIX_PATH; "
            "source its workspace"
        )
    if cpp:
        built = executables(found)
        if name in built:
            return Executable(built[name], "")
        hint = f"{did_you_mean(name, built)}; there is {choices(built)}"
        raise UsageError(f"the sources in {found.folder} have no C++ executable {name!r}{hint}")
    points = [*entry_points(found.folder), *_installed_entry_points(found)]
    for point in points:
        if point.name == name:
            file = _module_of(point, found)
            if file is not None:
                return Executable(file, point.function)
    files = _files(found)
    for candidate in (name, f"{name}.py"):
        if candidate in files:
            return Executable(files[candidate], "")
    known = sorted({*(point.name for point in points), *files})
    raise UsageError(f"package {package} has no executable {name!r}; there is {choices(known)}")


def _installed_entry_points(package: Package) -> list[EntryPoint]:
    if package.prefix is None:
        return []
    found = []
    for root in package.python_roots():
        for folder in sorted(root.glob(f"{package.name}-*info")):
            read = ConfigParser(interpolation=None, delimiters=("=",))
            read.optionxform = str  # type: ignore[assignment,method-assign]  # names keep their case
            read.read(folder / "entry_points.txt", encoding="utf-8")
            if read.has_section("console_scripts"):
                texts = [f"{name} = {target}" for name, target in read.items("console_scripts")]
                found += [EntryPoint(*one.groups()) for one in map(_SPECIFICATION.match, texts) if one]
    return found


def _module_of(point: EntryPoint, package: Package) -> Path | None:
    """Return the file of an entry point's module, also where parts of its name are unknown."""
    pattern = point.module.replace(".", "/")
    found = (file for root in package.python_roots() for file in sorted(root.glob(f"{pattern}.py")))
    return next(found, None)


def _files(package: Package) -> dict[str, Path]:
    """Return the Python programs in a package by file name: what can be executed, or ends in ``.py``."""
    folder = package.folder if package.prefix is None else package.prefix / "lib" / package.name
    found: dict[str, Path] = {}
    for path in sorted(folder.rglob("*"), key=lambda one: (len(one.parts), one)):
        if path.name in ("setup.py", "__init__.py") or not path.is_file():
            continue
        if path.suffix == ".py" or (not path.suffix and os.access(path, os.X_OK) and _is_python(path)):
            found.setdefault(path.name, path)
    return found


def _is_python(path: Path) -> bool:
    with path.open("rb") as file:
        first = file.readline(200)
    return first.startswith(b"#!") and b"python" in first
