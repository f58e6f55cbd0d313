"""Defaults of options from a file: ``volery.toml``, or ``[tool.volery]`` of ``pyproject.toml``.

The nearest file counts, from the current folder upwards; files are not merged. It has a table for each
command, with the names of its options without dashes in front: ``[simulate]`` with ``seed = 3``, and
``[calibrate.ros]`` for a command of a group. What stands on the command line wins. Unknown names are refused,
since a misspelt default would have no effect without a word.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup, TyperOption

from volery.base.errors import UsageError, did_you_mean
from volery.base.files import read_text

OWN_FILE, SHARED_FILE = "volery.toml", "pyproject.toml"


def read_defaults(application: Callable[[], typer.Typer], folder: Path) -> dict[str, Any]:
    """Return the defaults for click's ``default_map``; empty where no file states any.

    Args:
        application: Returns the application, against which the names in a file are checked.
        folder: Where to look first.

    Raises:
        UsageError: The file cannot be read, or names a command or an option that does not exist.
    """
    for place in (folder, *folder.parents):
        for name in (OWN_FILE, SHARED_FILE):
            file = place / name
            if file.is_file():
                stated = _tables(file)
                if stated is not None:
                    return _of_group(typer.main.get_group(application()), stated, f"{file}: ")
    return {}


def _tables(file: Path) -> dict[str, Any] | None:
    """Return what a file states, None if it is a ``pyproject.toml`` without a word on volery."""
    try:
        content = tomllib.loads(read_text(file))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        if file.name == SHARED_FILE:
            return None  # of other tools, which complain themselves
        raise UsageError(f"{file}: cannot be read: {error}") from error
    if file.name == OWN_FILE:
        return content
    tool = content.get("tool")
    stated = tool.get("volery") if isinstance(tool, dict) else None
    return stated if isinstance(stated, dict) else None


def _of_group(group: TyperGroup, stated: dict[str, Any], where: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, table in stated.items():
        command = group.commands.get(name)
        if command is None:
            raise UsageError(f"{where}there is no command {name!r}{did_you_mean(name, group.commands)}")
        if not isinstance(table, dict):
            raise UsageError(f"{where}{name} is a command: state its options in a table [{name}]")
        below = f"{where}[{name}] "
        if isinstance(command, TyperGroup):
            found[name] = _of_group(command, table, below)
        else:
            found[name] = _of_command(command, table, below)
    return found


def _of_command(command: Any, table: dict[str, Any], where: str) -> dict[str, Any]:
    options = {
        text.lstrip("-"): one
        for one in command.params
        if isinstance(one, TyperOption)
        for text in (*one.opts, *one.secondary_opts)
        if text.startswith("--")
    }
    found: dict[str, Any] = {}
    for name, value in table.items():
        option = options.get(name)
        if option is None or option.name is None:
            raise UsageError(f"{where}there is no option --{name}{did_you_mean(name, options)}")
        if option.multiple != isinstance(value, list) or isinstance(value, dict):
            expected = "a list" if option.multiple else "one value"
            raise UsageError(f"{where}{name} = {value!r}: {expected} is expected")
        if option.is_flag and not isinstance(value, bool):
            raise UsageError(f"{where}{name} = {value!r}: true or false is expected")
        found[option.name] = value if isinstance(value, bool | list) else str(value)
    return found
