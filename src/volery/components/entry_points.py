"""Entry points of Python packages: which function of a file ROS calls when it starts the package's program.

They are read from ``setup.py``, ``setup.cfg`` or ``pyproject.toml``, without executing anything.
"""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from configparser import ConfigParser
from configparser import Error as ConfigError
from pathlib import Path
from typing import NamedTuple

from volery.components.loader import SourceFile

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
            one.function
            for one in entry_points(folder)
            if one.is_in(source.path) and source.defines(one.function)
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
        tree = ast.parse((folder / "setup.py").read_text(encoding="utf-8", errors="replace"))
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
