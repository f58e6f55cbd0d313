"""Defaults of options from a file: ``volery.toml``, or ``[tool.volery]`` of ``pyproject.toml``.

The nearest file counts, from the current folder upwards; files are not merged. It has a table for each
command, with the names of its options without dashes in front: ``[simulate]`` with ``seed = 3``, and
``[cost.calibrate.ros]`` for a command below nouns. What stands on the command line wins. Unknown names are
refused, since a misspelt default would have no effect without a word.

A folder may come from another person. So the values that a command takes from a file are printed, options of
``NEVER`` are refused, and a file that another user owns or can replace is ignored.
"""

from __future__ import annotations

import os
import stat
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup, TyperOption

from volery.base.errors import UsageError, did_you_mean
from volery.base.files import read_text
from volery.cli.command import Noun
from volery.cli.old_names import current_tables

OWN_FILE, SHARED_FILE = "volery.toml", "pyproject.toml"


NAMES_A_PROGRAM = "it chooses what is executed"
PROTECTS = "it protects people or a vehicle"
NEVER = {
    **dict.fromkeys(("python", "mission", "entry", "before", "arg", "flag", "link"), NAMES_A_PROGRAM),
    **dict.fromkeys(
        ("ceiling", "fence", "reserve", "if-killed", "max-speed", "max-turn", "height"), PROTECTS
    ),
    **dict.fromkeys(("switch", "on-rc-loss", "on-telemetry-loss", "emergency"), PROTECTS),
    **dict.fromkeys(("enable-control", "signing", "fly"), PROTECTS),
    **dict.fromkeys(("replace",), "it overwrites files"),
}
"""Options that no file states, with the reason: who writes the folder would decide for who types there."""


@dataclass(frozen=True)
class Configuration:
    """Defaults of a file for click's ``default_map``, and ``notes`` on files that were ignored."""

    file: Path | None = None
    defaults: dict[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    _tables: dict[str, Any] = field(default_factory=dict)
    _group: TyperGroup | None = None

    def said(self, words: Sequence[str]) -> list[str]:
        """Return what is printed before the command *words* executes: its values from the file, and notes."""
        table, name = self._tables, ""
        command: object = self._group
        for word in words:
            if not isinstance(command, TyperGroup) or word not in command.commands:
                break
            command, table = command.commands[word], table.get(word, {})
            name = f"{name}.{word}" if name else word
        values = [f"{key} = {value}" for key, value in table.items() if not isinstance(value, dict)]
        taken = [f"{self.file} [{name}]: {', '.join(values)}"] if name and values else []
        return [*self.notes, *taken]


def read_configuration(application: Callable[[], typer.Typer], folder: Path) -> Configuration:
    """Return the defaults that the nearest file states; none where no file does.

    A file that another user could have written does not count.

    Args:
        application: Returns the application, against which the names in a file are checked.
        folder: Where to look first.

    Raises:
        UsageError: The file cannot be read, or names a command or an option that does not exist.
    """
    notes: list[str] = []
    for place in (folder, *folder.parents):
        for name in (OWN_FILE, SHARED_FILE):
            file = place / name
            if not file.is_file():
                continue
            foreign = _foreign(file)
            if foreign and name == OWN_FILE:
                notes.append(f"{file} is ignored: {foreign}")
                continue
            stated = _tables(file)
            if stated is None:
                continue
            if foreign:
                notes.append(f"{file} is ignored: {foreign}")
                continue
            where, group = f"{file}: ", typer.main.get_group(application())
            tables = current_tables(stated, where)
            return Configuration(file, _of_group(group, tables, where), tuple(notes), tables, group)
    return Configuration(notes=tuple(notes))


ROOT = 0
"""User who can write every file."""


def _foreign(file: Path) -> str:
    """Return why another user could have written *file*; empty if only this one and root can."""
    for place, what in ((file, "it"), (file.parent, "its folder")):
        state = place.stat()
        if state.st_uid not in (os.getuid(), ROOT):
            return f"{what} belongs to another user"
        own_group = state.st_gid == os.getgid()
        if state.st_mode & stat.S_IWOTH or (state.st_mode & stat.S_IWGRP and not own_group):
            return f"other users can write {'to ' * (what != 'it')}{what}"
    return ""


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
    own: dict[str, Any] = {}
    for name, table in stated.items():
        command = group.commands.get(name)
        if command is None and isinstance(group, Noun) and group.own is not None:
            own[name] = table
            continue
        if command is None:
            raise UsageError(f"{where}there is no command {name!r}{did_you_mean(name, group.commands)}")
        if not isinstance(table, dict):
            raise UsageError(f"{where}{name} is a command: state its options in a table [{name}]")
        below = f"{where}[{name}] "
        if isinstance(command, TyperGroup):
            found[name] = _of_group(command, table, below)
        else:
            found[name] = _of_command(command, table, below)
    return found | (_of_command(group.own, own, where) if isinstance(group, Noun) and own else {})


def _of_command(command: Any, table: dict[str, Any], where: str) -> dict[str, Any]:
    options = {
        text.lstrip("-"): param
        for param in command.params
        if isinstance(param, TyperOption)
        for text in (*param.opts, *param.secondary_opts)
        if text.startswith("--")
    }
    found: dict[str, Any] = {}
    for name, value in table.items():
        if name in options and name in NEVER:
            raise UsageError(f"{where}{name}: give --{name} on the command line only: {NEVER[name]}")
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
