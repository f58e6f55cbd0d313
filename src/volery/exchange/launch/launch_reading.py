"""What all readers of launch files share: the nodes that are started, notes, and files by packages.

Nothing in a launch file is executed. What cannot be known without executing it, or has no place in a model,
becomes a note with file and line.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from volery.base.errors import Location, ModelError
from volery.base.files import read_text
from volery.exchange.notes import Note
from volery.model.text import parse as parse_yaml

MOST_INCLUDES = 500
"""Most files that one launch file may include, directly or not: a bound of the time, too."""
DEEPEST = 30
"""Most levels of includes, as a file may include itself under a condition."""


class UnresolvedError(Exception):
    """A value of a launch file is not known without executing something, or does not exist."""


class ProgramSource(NamedTuple):
    """The source of a program: its file, its language, and the function that an entry point calls or ""."""

    file: Path
    language: str
    function: str = ""


class Packages(Protocol):
    """The packages that launch files name."""

    def folder(self, package: str, near: Path) -> Path | None:
        """Return the folder of a package as the file *near* sees it, or None."""

    def program(self, package: str, executable: str, near: Path, ros: int) -> ProgramSource | None:
        """Return the source of a program of a package for a version of ROS, or None."""

    def package_of(self, file: Path) -> tuple[str, Path] | None:
        """Return name and folder of the package that *file* belongs to, or None."""

    def executable_of(self, file: Path, ros: int) -> tuple[str, str] | None:
        """Return the package of a program's source and the name that ROS starts it by, or None."""


@dataclass(frozen=True)
class LaunchedNode:
    """A node that a launch file starts.

    Attributes:
        package: Its package.
        executable: Its program; of a composable node, its plugin.
        name: Its name; empty where its program states it.
        namespace: Its absolute namespace.
        where: The line that starts it.
        ros: Version of ROS, 1 or 2.
        remaps: Names and their replacements.
        parameters: Its own parameters; nested ones as ``a/b`` in ROS 1 and ``a.b`` in ROS 2.
        arguments: Its command line, without what launch adds.
        container: The container that a composable node is loaded into; empty for a process.
        required: Whether all ends when it ends.
        respawn: Whether it is started again when it ends.
        respawn_delay: Time until then, s.
        files: Names of the launch files and parameter files that it was made of.
    """

    package: str
    executable: str
    name: str
    namespace: str
    where: Location
    ros: int
    remaps: Mapping[str, str] = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)
    arguments: Sequence[str] = ()
    container: str = ""
    required: bool = False
    respawn: bool = False
    respawn_delay: float = 0.0
    files: Sequence[str] = ()


@dataclass
class LaunchReading:
    """A launch file that is being read, with all that it includes.

    Attributes:
        packages: The packages that it can name.
        given: Arguments of the command line, by name.
        nodes: The nodes so far.
        shared: Parameters of no node, by their absolute names (ROS 1).
        declared: Arguments of the first file, and their defaults (None without one).
    """

    packages: Packages
    given: Mapping[str, str]
    nodes: list[LaunchedNode] = field(default_factory=list)
    shared: dict[str, Any] = field(default_factory=dict)
    declared: dict[str, str | None] = field(default_factory=dict)
    _notes: dict[tuple[str, bool], dict[Location, None]] = field(default_factory=dict)
    _open: list[tuple[Path, dict[str, str]]] = field(default_factory=list)
    _included: int = 0

    def note(self, what: str, where: Location, *, lost: bool = True) -> None:
        """Record *what* has no place in a model, or (not *lost*) was changed or assumed."""
        self._notes.setdefault((what, lost), {})[where] = None

    @property
    def notes(self) -> tuple[Note, ...]:
        """The notes; the same words for several lines are one note."""
        listed = []
        for (what, lost), (first, *others) in ((key, list(places)) for key, places in self._notes.items()):
            also = ", ".join(_short(other, first) for other in others[:3])
            more = f" and {len(others) - 3} more" if len(others) > 3 else ""
            listed.append(Note(f"{what} (also {also}{more})" if others else what, first, "", lost))
        return tuple(listed)

    @property
    def open_files(self) -> tuple[str, ...]:
        """Names of the files that are being read, the innermost last."""
        return tuple(one.name for one, _ in self._open)

    def enter(self, file: Path, where: Location, given: Mapping[str, str]) -> bool:
        """Begin to read *file*, which *where* includes; return False, with a note, if it must not be.

        Args:
            file: The file.
            where: The place that includes it.
            given: All on which its conditions depend: its arguments and the environment. A file that includes
                itself with the same ones does so for ever.
        """
        self._included += 1
        key = (file.resolve(), dict(given))
        if key in self._open:
            by = [one.name for one, _ in self._open[self._open.index(key) :]]
            self.note(
                f"{' includes '.join((*by, file.name))}, with the same arguments: it is left out", where
            )
            return False
        if self._included > MOST_INCLUDES or len(self._open) >= DEEPEST:
            self.note("too many files are included: is there a circle? The rest is left out", where)
            return False
        self._open.append(key)
        return True

    def leave(self) -> None:
        """End the file that was entered last."""
        self._open.pop()

    def folder_of(self, package: str, near: Path) -> Path:
        """Return the folder of a package. Raises ``UnresolvedError`` if there is none of that name."""
        found = self.packages.folder(package, near)
        if found is None:
            raise UnresolvedError(f"there is no package {package!r}: name its folder with --search")
        return found


def _short(where: Location, other: Location) -> str:
    """Return a place as it is written behind another one."""
    return f"line {where.line}" if where.file == other.file else str(where)


def environment_variable(name: str, default: str | None = None) -> str:
    """Return an environment variable or *default*; raise ``UnresolvedError`` if there is neither."""
    value = os.environ.get(name, default)
    if value is None:
        raise UnresolvedError(f"the environment variable {name} is not set")
    return value


def truth(text: str) -> bool:
    """Return the value of a condition's text. Raises ``UnresolvedError``."""
    if text.strip().lower() in ("true", "1"):
        return True
    if text.strip().lower() in ("false", "0"):
        return False
    raise UnresolvedError(f"{text!r} is neither true nor false")


def file_text(file: Path) -> str:
    """Return the text of a file that a launch file names. Raises ``UnresolvedError``."""
    try:
        return read_text(file)
    except OSError as error:
        raise UnresolvedError(f"{file} cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise UnresolvedError(f"{file} is no text in UTF-8") from None


def yaml_value(text: str, name: str, *, merges: bool = False) -> Any:
    """Return the values of a YAML text, as ROS reads them (YAML 1.1). Raises ``UnresolvedError``.

    A key that is there twice is an error, unless it *merges*.
    """
    try:
        return _as_ros(parse_yaml(text, name, merges=merges).plain()) if text.strip() else None
    except ModelError as error:
        raise UnresolvedError(f"{error.where}: {error.what}") from None


_WORDS = {"yes": True, "on": True, "no": False, "off": False}


def _as_ros(value: Any) -> Any:
    """Return values with the words that are truth values in YAML 1.1 only, and plain texts."""
    if isinstance(value, dict):
        return {key: _as_ros(below) for key, below in value.items()}
    if isinstance(value, list):
        return [_as_ros(below) for below in value]
    if type(value) is str:  # one in quotation marks is a text
        return _WORDS.get(value.lower(), value) if value.islower() or value.istitle() else value
    return str(value) if isinstance(value, str) else value


def joined(namespace: str, name: str) -> str:
    """Return the absolute name of *name* in *namespace*."""
    full = name if name.startswith("/") else f"{namespace}/{name}"
    return "/" + "/".join(part for part in full.split("/") if part)


def flat(values: Mapping[str, Any], separator: str, prefix: str = "") -> dict[str, Any]:
    """Return nested parameters with *separator* between the parts of their names."""
    made: dict[str, Any] = {}
    for key, value in values.items():
        name = f"{prefix}{separator}{key}" if prefix else str(key)
        if isinstance(value, Mapping) and value:
            made |= flat(value, separator, name)
        else:
            made[name] = value
    return made
