"""The text of a model: YAML as a tree with source lines, and the problems found in it.

A ``TextNode`` is a scalar, a mapping or a list. Nodes that are merged into a tree later (a world file, a
scenario, an option) keep their own locations. YAML 1.2, so ``on`` and ``yes`` are text. Keys are text, and
unique. Problems are collected, so that all of them are reported at once.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from os.path import realpath
from pathlib import Path as FilePath
from typing import Any

from volery.base.errors import Location, ModelError, choices, did_you_mean
from volery.base.installed import require_extra
from volery.model import rules
from volery.model.rules import BrokenRule, ModelRule

try:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError, ReusedAnchorWarning, YAMLError
    from ruamel.yaml.nodes import MappingNode, ScalarNode, SequenceNode
except ModuleNotFoundError:
    require_extra("model", "models")
    raise

Path = tuple[str | int, ...]
"""A path in the model: keys and list positions from the top."""

Locate = Callable[[Path], Location | None]
"""Returns the location of a path, or of its nearest ancestor in the tree."""


def written(path: Path) -> str:
    """Return *path* as messages and ``--set`` write it: ``platform.processors.onboard``."""
    return ".".join(str(step) for step in path)


class CollectedModelError(ModelError):
    """Several problems of a model. ``errors`` has them one by one, in the order of the file."""

    def __init__(self, errors: Iterable[ModelError]) -> None:
        self.errors = tuple(errors)
        listed = "\n".join(str(error) for error in self.errors)
        count = "1 thing is" if len(self.errors) == 1 else f"{len(self.errors)} things are"
        super().__init__(f"{count} wrong with this model:\n{listed}")

    def __reduce__(self) -> tuple[type[CollectedModelError], tuple[tuple[ModelError, ...]]]:
        """Return how to pickle it, to send it from process to process."""
        return type(self), (self.errors,)


class Problems:
    """The problems of a model that were found so far."""

    def __init__(self, locate: Locate) -> None:
        self._locate = locate
        self._found: dict[str, ModelError] = {}
        self._warnings: dict[BrokenRule, None] = {}  # an ordered set
        self._origins: dict[Path, Path] = {}

    def __bool__(self) -> bool:
        return bool(self._found)

    def add(
        self, path: Path, what: str, where: Location | None = None, rule: ModelRule = rules.WRONG_VALUE
    ) -> None:
        """Report that *what* is wrong at *path*, which stands at *where*; the same problem counts once."""
        path = self._origin(path)
        error = ModelError(what, written(path), where or self._locate(path), rule.code)
        self._found.setdefault(str(error), error)

    def _origin(self, path: Path) -> Path:
        """Return where the value at *path* was copied from, *path* itself if it is stated there."""
        for length in range(len(path), 0, -1):
            origin = self._origins.get(path[:length])
            if origin is not None:
                return self._origin(origin + path[length:])
        return path

    def copied(self, path: Path, origin: Path | None) -> None:
        """Report problems at *path* as problems at *origin*, from which its value was copied.

        None ends that: the value at *path* has been replaced.
        """
        self._origins.pop(path, None)
        if origin is not None:
            self._origins[path] = origin

    def unknown(self, path: Path, name: object, noun: str, valid: Iterable[str]) -> None:
        """Report an unknown *name* at *path*; *valid* are the known names."""
        self.add(path, no_such(name, noun, valid), rule=rules.UNKNOWN_NAME)

    def warn(self, path: Path, what: str, rule: ModelRule) -> None:
        """Report that *what* is doubtful at *path*; the model is valid nevertheless."""
        path = self._origin(path)
        self._warnings[BrokenRule(rule, what, written(path), self._locate(path))] = None

    @property
    def warnings(self) -> tuple[BrokenRule, ...]:
        """The warnings, once each."""
        return tuple(self._warnings)

    def where(self, path: Path) -> Location | None:
        """Return the location of *path*."""
        return self._locate(self._origin(path))

    def raise_if_any(self) -> None:
        """Raise the problems, if any: a ``ModelError``, or one ``CollectedModelError`` for several."""
        if len(self._found) == 1:
            raise next(iter(self._found.values()))
        if self._found:
            raise CollectedModelError(sorted(self._found.values(), key=_order))


def no_such(name: object, noun: str, valid: Iterable[str]) -> str:
    """Return ``no processor named 'x' (did you mean 'y'?); there is y or z``."""
    names = list(valid)
    return f"no {noun} named {name!r}{did_you_mean(str(name), names)}; there is {choices(names)}"


def _order(error: ModelError) -> tuple[str, int]:
    return (error.where.file, error.where.line) if error.where else ("", 0)


_NO_MODEL = rules.NOT_A_MODEL.code

MOST_NODES = 100_000
_LONGEST_NUMBER = 100
"""Characters; Python converts longer ones in quadratic time, or refuses."""
"""More than any model needs. Without a limit, a file of nested aliases would fill the memory."""

Scalar = str | int | float | bool | None


@dataclass
class TextNode:
    """A value of a model with its location: for an entry of a mapping, the line of its key.

    ``quoted`` is true for a text in quotation marks: it is meant as text even if it looks like a quantity.
    """

    value: Scalar | dict[str, TextNode] | list[TextNode]
    where: Location
    quoted: bool = False

    @property
    def items(self) -> dict[str, TextNode]:
        """The entries of a mapping; empty for anything else."""
        return self.value if isinstance(self.value, dict) else {}

    def child(self, step: str | int) -> TextNode | None:
        """Return the entry or the list item *step*, None if there is none."""
        if isinstance(self.value, list) and str(step).isdigit() and int(step) < len(self.value):
            return self.value[int(step)]
        return self.items.get(str(step))

    def at(self, path: Path) -> TextNode | None:
        """Return the node at *path*, None if there is none."""
        node: TextNode | None = self
        for step in path:
            node = node.child(step) if node else None
        return node

    def locate(self, path: Path) -> Location | None:
        """Return the location of *path*, or of its deepest part that exists."""
        node: TextNode = self
        for step in path:
            below = node.child(step)
            if below is None:
                break
            node = below
        return node.where

    def plain(self) -> Any:
        """Return the tree as plain values; a text in quotation marks as a ``Quoted``."""
        if isinstance(self.value, dict):
            return {key: node.plain() for key, node in self.value.items()}
        if isinstance(self.value, list):
            return [node.plain() for node in self.value]
        return Quoted(self.value) if self.quoted else self.value

    def copy(self) -> TextNode:
        """Return a deep copy."""
        if isinstance(self.value, dict):
            return TextNode({key: node.copy() for key, node in self.value.items()}, self.where)
        if isinstance(self.value, list):
            return TextNode([node.copy() for node in self.value], self.where)
        return TextNode(self.value, self.where, self.quoted)

    def moved(self, where: Location) -> TextNode:
        """Return a copy in which every node stands at *where*."""
        if isinstance(self.value, dict):
            return TextNode({key: node.moved(where) for key, node in self.value.items()}, where)
        if isinstance(self.value, list):
            return TextNode([node.moved(where) for node in self.value], where)
        return TextNode(self.value, where, self.quoted)


def stated_texts(root: TextNode, key: str) -> list[str]:
    """Return the texts of a key of the model: one text, or a list of them."""
    node = root.child(key)
    listed = node.value if node is not None and isinstance(node.value, list) else [node] if node else []
    return [one.value for one in listed if isinstance(one, TextNode) and isinstance(one.value, str)]


def is_inside(file: FilePath, folders: Iterable[FilePath]) -> bool:
    """Return whether *file*, with its symbolic links followed, is in one of the *folders*."""
    real = FilePath(realpath(file))  # ``resolve`` raises for a link to itself; reading it says so
    return any(real.is_relative_to(folder.resolve()) for folder in folders)


def outside(name: str) -> str:
    """Return what is wrong with a file that is in none of the folders that a model may use."""
    return f"{name!r} is outside the folder of the model; list its folder under `files_from` to allow it"


class Quoted(str):
    """A text that was written in quotation marks."""

    __slots__ = ()


def parse(text: str, name: str, *, merges: bool = False) -> TextNode:
    """Return the tree of a YAML text. *name* is the name of the file in messages.

    A key that is there twice is an error, unless it *merges*: then both mappings hold, as in files of ROS.

    Raises:
        ModelError: it is not the YAML of a model.
    """
    yaml = YAML(typ="safe", pure=True)
    try:
        with warnings.catch_warnings(action="ignore", category=ReusedAnchorWarning):
            root = yaml.compose(text)
    except MarkedYAMLError as error:
        raise ModelError(_complaint(error, text), "", _mark(error, name), _NO_MODEL) from None
    except RecursionError:
        raise ModelError("nested too deeply to be a model", "", Location(name, 1), _NO_MODEL) from None
    except (YAMLError, ValueError) as error:
        what = f"this is not YAML: {_first_line(error)}"
        raise ModelError(what, "", Location(name, 1), _NO_MODEL) from None
    if root is None:
        raise ModelError(
            "the file is empty; `volery new DIR` writes a model to start from",
            "",
            Location(name, 1),
            _NO_MODEL,
        )
    return _Reading(name, yaml, merges).node(root, ())


def parse_value(text: str, where: Location) -> TextNode:
    """Return the tree of an option's value, every node of which stands at *where*."""
    if not text.strip():
        return TextNode(None, where)
    try:
        return parse(text, where.file).moved(where)
    except ModelError as error:
        raise ModelError(f"{text!r}: {error.what}", error.path, where, error.code) from None


@dataclass
class _Reading:
    """One pass over the composed nodes of a file."""

    name: str
    yaml: YAML
    merges: bool = False
    count: int = 0
    open: list[int] = field(default_factory=list)

    def node(self, raw: Any, path: Path) -> TextNode:
        """Return the tree below *raw*."""
        where = Location(self.name, raw.start_mark.line + 1)
        self.count += 1
        if self.count > MOST_NODES:
            what = f"more than {MOST_NODES} values; is it a model?"
            raise ModelError(what, _dotted(path), where, rules.TOO_LARGE.code)
        if isinstance(raw, ScalarNode):
            return TextNode(self._scalar(raw, path, where), where, quoted=raw.style in ("'", '"'))
        if id(raw) in self.open:
            raise ModelError("an alias that contains itself", _dotted(path), where, rules.TOO_LARGE.code)
        self.open.append(id(raw))
        value: dict[str, TextNode] | list[TextNode]
        if isinstance(raw, SequenceNode):
            value = [self.node(item, (*path, position)) for position, item in enumerate(raw.value)]
        else:
            value = {}
            for name, below in self._entries(raw, path):
                value[name] = _merged(value[name], below) if name in value else below
        self.open.pop()
        return TextNode(value, where)

    def _entries(self, raw: MappingNode, path: Path) -> Iterator[tuple[str, TextNode]]:
        lines: dict[str, int] = {}
        for key, value in raw.value:
            where = Location(self.name, key.start_mark.line + 1)
            if not isinstance(key, ScalarNode):
                raise ModelError("a key must be a word", _dotted(path), where, _NO_MODEL)
            name = str(key.value)
            if name == "<<":
                what = "merge keys (<<) are not read; repeat the entries"
                raise ModelError(what, _dotted(path), where, _NO_MODEL)
            if name in lines and not self.merges:
                here = _dotted((*path, name))
                what = f"this key is here twice; first in line {lines[name]}"
                raise ModelError(what, here, where, rules.DUPLICATE_KEY.code)
            lines[name] = where.line
            node = self.node(value, (*path, name))
            yield name, TextNode(node.value, where, node.quoted)

    def _scalar(self, raw: ScalarNode, path: Path, where: Location) -> Scalar:
        kind = str(raw.tag or "").rpartition(":")[2]
        if kind not in ("int", "float", "bool", "null"):
            return str(raw.value)
        if len(raw.value) > _LONGEST_NUMBER:
            what = f"a number of {len(raw.value)} characters; at most {_LONGEST_NUMBER} are read"
            raise ModelError(what, _dotted(path), where, _NO_MODEL)
        try:
            value: Scalar = getattr(self.yaml.constructor, f"construct_yaml_{kind}")(raw)
        except ValueError:
            what = f"{raw.value!r} is no number"
            raise ModelError(what, _dotted(path), where, _NO_MODEL) from None
        return value


def _merged(one: TextNode, other: TextNode) -> TextNode:
    """Return two mappings in one, where the *other* wins; of anything else the other."""
    if not isinstance(one.value, dict) or not isinstance(other.value, dict):
        return other
    value = dict(one.value)
    for name, below in other.value.items():
        value[name] = _merged(value[name], below) if name in value else below
    return TextNode(value, one.where)


def _dotted(path: Path) -> str:
    return ".".join(str(step) for step in path)


def _mark(error: MarkedYAMLError, name: str) -> Location:
    mark = error.problem_mark or error.context_mark
    return Location(name, mark.line + 1 if mark else 1)


def _complaint(error: MarkedYAMLError, text: str) -> str:
    parts = [part for part in (error.context, error.problem) if part]
    lines = text.splitlines()
    marks = [mark for mark in (error.problem_mark, error.context_mark) if mark and mark.line < len(lines)]
    hint = (
        '; within braces, put quotes around "Type[]"'
        if any("[]" in lines[mark.line] for mark in marks)
        else ""
    )
    return f"this is not YAML: {', '.join(parts)}{hint}"


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
