"""What components say to each other through ports, as text: JSON, with the types that JSON does not have.

Numbers, text, lists, tuples, mappings, enumerations, and dataclasses of ``volery`` or of a module beside the
component's file. Nothing else is made from what arrives.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from types import ModuleType
from typing import Any

from volery.base.errors import UsageError
from volery.components.loading import SHARED, USER

_KIND = "!"
_TUPLE, _MAPPING = "tuple", "mapping"
_OURS = "volery."

Find = Callable[[str], ModuleType | None]
"""The module of that name beside the components of this process, loaded if need be."""


class Values:
    """Both ways, for one process."""

    def __init__(self, find: Find) -> None:
        self._find = find

    def to_text(self, value: object, what: str) -> str:
        """*value* as JSON. ``UsageError``, naming *what* it is, if it cannot leave its process."""
        return json.dumps(_coded(value, what))

    def from_text(self, text: str) -> Any:
        """What was written. ``UsageError`` if it is not what ``to_text`` writes."""
        try:
            return json.loads(text, object_hook=self._made)
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise UsageError(f"not the value of a port: {error}") from error

    def _made(self, found: dict[str, Any]) -> Any:
        kind = found.get(_KIND)
        if kind is None:
            return found
        content = found["value"]
        if kind == _TUPLE:
            return tuple(content)
        if kind == _MAPPING:
            return dict(content)
        cls = self._class(kind)
        if issubclass(cls, Enum):
            return cls[content]
        if not is_dataclass(cls):
            raise ValueError(f"{kind} is no dataclass")
        made = cls(**{one.name: content.pop(one.name) for one in fields(cls) if one.init})
        for name, value in content.items():
            object.__setattr__(made, name, value)
        return made

    def _class(self, kind: str) -> type[Any]:
        module, _, name = kind.partition(":")
        if module.startswith(SHARED):
            found = self._find(module.removeprefix(SHARED))
        else:
            ours = module.startswith(_OURS) and not module.startswith(USER)
            found = sys.modules.get(module) if ours else None
        cls = getattr(found, name, None)
        if not isinstance(cls, type):
            raise ValueError(f"no class {name} in {module} here")
        return cls


def _coded(value: object, what: str) -> Any:
    if value is None or isinstance(value, (bool, str)):
        return value
    for kind, code in _CODES.items():
        if isinstance(value, kind):
            return code(value, what)
    if is_dataclass(value) and not isinstance(value, type):
        content = {one.name: _coded(getattr(value, one.name), what) for one in fields(value)}
        return {_KIND: _name(value, what), "value": content}
    raise _unfit(value, what)


def _tuple(value: tuple[Any, ...], what: str) -> Any:
    if type(value) is not tuple:
        raise _unfit(value, what)  # its name and its own fields would be lost
    return {_KIND: _TUPLE, "value": [_coded(one, what) for one in value]}


def _mapping(value: dict[Any, Any], what: str) -> Any:
    if all(isinstance(key, str) for key in value) and _KIND not in value:
        return {key: _coded(one, what) for key, one in value.items()}
    pairs = [[_coded(key, what), _coded(one, what)] for key, one in value.items()]
    return {_KIND: _MAPPING, "value": pairs}


def _name(value: object, what: str) -> str:
    cls = type(value)
    module = cls.__module__
    known = module.startswith(SHARED) if module.startswith(USER) else module.startswith(_OURS)
    if not known:
        raise _unfit(value, what)
    return f"{module}:{cls.__qualname__}"


_CODES: Mapping[type, Callable[[Any, str], Any]] = {
    Enum: lambda value, what: {_KIND: _name(value, what), "value": value.name},
    int: lambda value, what: int(value),
    float: lambda value, what: float(value),
    list: lambda value, what: [_coded(one, what) for one in value],
    tuple: _tuple,
    dict: _mapping,
}


def _unfit(value: object, what: str) -> UsageError:
    return UsageError(
        f"{what}: a {type(value).__qualname__} cannot be sent to another process; use numbers, text, lists, "
        "mappings, or dataclasses of a module beside the components"
    )
