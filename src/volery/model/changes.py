"""Changes to a model: what scenarios, allocations and options ``set``.

A path is keys and list positions joined by dots. It must lead somewhere: the entry that is set may be new,
what leads there must exist or be a part of every model (``environment.wind``). Setting nothing takes an entry
away.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from volery.base.errors import Location, UsageError
from volery.model.problems import Path, Problems, no_such, written
from volery.model.schema import keys_at, names_are_free, short_key
from volery.model.text import Node, parse_value


@dataclass(frozen=True)
class Change:
    """Put *value* at *path*. ``said_at`` is the path in the model that says so, empty for an option."""

    path: Path
    value: Node
    said_at: Path = ()

    @property
    def where(self) -> Location:
        """The line or the option that says so."""
        return self.value.where


def split(path: str) -> Path:
    """The path that a text such as ``platform.processors.onboard`` means."""
    return tuple(path.split("."))


def from_option(text: str) -> Change:
    """What ``--set path=value`` means; the value is YAML."""
    path, equals, value = text.partition("=")
    if not equals or not path.strip() or "" in path.strip().split("."):
        raise UsageError(
            f"--set {text}: a path and a value are expected, "
            "such as platform.processors.onboard.frequency='600 MHz'"
        )
    return Change(split(path.strip()), parse_value(value, Location(f"--set {text}", 0)))


def from_mapping(node: Node | None, said_at: Path) -> list[Change]:
    """What a ``set:`` mapping means, in its order."""
    if node is None:
        return []
    return [Change(split(key), value, (*said_at, key)) for key, value in node.items.items()]


def apply(root: Node, changes: Iterable[Change], problems: Problems) -> None:
    """Change *root* in place; a path that leads nowhere is a problem."""
    for change in changes:
        complaint = _apply(root, change)
        if complaint:
            problems.add(change.said_at or change.path, complaint, change.where)


def _apply(root: Node, change: Change) -> str:
    node = root
    for depth, step in enumerate(change.path[:-1]):
        below = node.child(step)
        if below is None:
            complaint = _cannot_make(node, change.path[: depth + 1])
            if complaint:
                return complaint
            below = Node({}, change.where)
            node.items[str(step)] = below
        _lengthen(below, change.path[: depth + 1])
        node = below
    return _put(node, change)


def _lengthen(node: Node, path: Path) -> None:
    """A single value becomes the mapping that is meant: ``battery: 5 Ah`` has a ``capacity``."""
    if node.value is None:
        node.value = {}
    key = short_key(path)
    if key is not None and not isinstance(node.value, dict | list):
        node.value = {key: Node(node.value, node.where, node.quoted)}


def _cannot_make(node: Node, path: Path) -> str:
    """Why a mapping cannot be made at *path* on the way; empty if it can."""
    known = keys_at(path[:-1]) or []
    if path[-1] in known:
        return ""
    if isinstance(node.value, dict) and names_are_free(path[:-1]):
        return no_such(path[-1], f"entry of {written(path[:-1])}", [*node.items, *known])
    if isinstance(node.value, dict):
        return no_such(path[-1], f"key of {written(path[:-1]) or 'a model'}", known)
    return f"{written(path[:-1])} is {_shown(node)}: nothing below it can be set"


def _put(node: Node, change: Change) -> str:
    last = change.path[-1]
    value = change.value.copy()
    if isinstance(node.value, list):
        if not str(last).isdigit() or int(last) >= len(node.value):
            return f"{written(change.path[:-1])} has positions 0 to {len(node.value) - 1}"
        node.value[int(last)] = value
        return ""
    if not isinstance(node.value, dict):
        return f"{written(change.path[:-1])} is {_shown(node)}: set all of it, as {{key: value}}"
    if value.value is None:
        node.value.pop(str(last), None)
        return ""
    known = keys_at(change.path[:-1])
    if known and last not in known and not names_are_free(change.path[:-1]):
        return no_such(last, f"key of {written(change.path[:-1]) or 'a model'}", known)
    node.value[str(last)] = value
    return ""


def _shown(node: Node) -> str:
    return "a list" if isinstance(node.value, list) else repr(node.value)
