"""Differences of two systems in terms of the model: which instance, processor or figure has changed, and how.

The resolved data are compared and not the text: order, comments, includes and anchors make no difference.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from pathlib import PurePath
from typing import Any

from volery.model.components import Component
from volery.model.environment import PlaceSpec, Ways
from volery.model.instances import Instance
from volery.model.system import System

SECTIONS = (
    "name",
    "description",
    "interfaces",
    "components",
    "instances",
    "processors",
    "networks",
    "environment",
    "chains",
    "requirements",
    "limits",
)
"""Fields of a system that are compared, in this order."""
ADDED, REMOVED, CHANGED = "added", "removed", "changed"
_NOUNS = {
    "interfaces": "interface",
    "components": "component",
    "instances": "instance",
    "processors": "processor",
    "networks": "network",
    "chains": "chain",
    "requirements": "requirement",
    "environment": "environment",
    "limits": "run",
    "name": "model",
    "description": "model",
}
_UNITS = {
    "_ns": ("ms", 1e-6),
    "_hz": ("MHz", 1e-6),
    "_bit_s": ("kbit/s", 1e-3),
    "_m_s": ("m/s", 1.0),
    "_m": ("m", 1.0),
    "_deg": ("deg", 1.0),
    "_coulomb": ("Ah", 1 / 3600.0),
    "_v": ("V", 1.0),
    "_j": ("J", 1.0),
    "_b": ("B", 1.0),
}
_SHORT = 60
"""Letters of a value that are shown."""


@dataclass(frozen=True)
class ModelDifference:
    """One difference: what kind of thing, its name, which property, and the values before and after."""

    noun: str
    name: str
    kind: str
    property: str = ""
    before: str = ""
    after: str = ""

    def __str__(self) -> str:
        subject = f"{self.noun} {self.name}".strip()
        if self.kind != CHANGED or not self.property:
            return (
                f"{subject}: {self.kind}" if not self.property else f"{subject}: {self.property} {self.kind}"
            )
        return f"{subject}: {self.property} {self.before} → {self.after}"


def differences(before: System, after: System) -> tuple[ModelDifference, ...]:
    """Return what differs between two systems, section by section.

    What an instance has from its component is a difference of the component alone.
    """
    components = {one.name: one.component.name for one in (*before.instances, *after.instances)}
    found = tuple(_differences(before, after))
    of_components = {
        (one.name, one.property, one.before, one.after) for one in found if one.noun == "component"
    }
    return tuple(
        one
        for one in found
        if one.noun != "instance"
        or (components[one.name], one.property, one.before, one.after) not in of_components
    )


def _differences(before: System, after: System) -> Iterator[ModelDifference]:
    for section in SECTIONS:
        noun = _NOUNS[section]
        old, new = _tree(getattr(before, section)), _tree(getattr(after, section))
        if section in ("environment", "limits"):
            yield from _compare(noun, "", (), old, new)
        elif not isinstance(old, dict) or not isinstance(new, dict):
            if old != new:
                yield ModelDifference(noun, "", CHANGED, section, _shown(section, old), _shown(section, new))
        else:
            yield from _named(noun, old, new)


def _named(noun: str, old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[ModelDifference]:
    for name in dict.fromkeys((*old, *new)):
        if name not in new:
            yield ModelDifference(noun, name, REMOVED)
        elif name not in old:
            yield ModelDifference(noun, name, ADDED)
        else:
            yield from _compare(noun, name, (), old[name], new[name])


def _compare(noun: str, name: str, path: tuple[str, ...], old: Any, new: Any) -> Iterator[ModelDifference]:
    if old == new:
        return
    if isinstance(old, dict) and isinstance(new, dict):
        for key in dict.fromkeys((*old, *new)):
            here = (*path, key)
            if key not in new:
                yield ModelDifference(noun, name, REMOVED, _dotted(here), _shown(key, old[key]))
            elif key not in old:
                yield ModelDifference(noun, name, ADDED, _dotted(here), after=_shown(key, new[key]))
            else:
                yield from _compare(noun, name, here, old[key], new[key])
        return
    key = path[-1] if path else ""
    yield ModelDifference(noun, name, CHANGED, _dotted(path), _shown(key, old), _shown(key, new))


def _tree(thing: Any) -> Any:
    """Return *thing* as mappings by name; a place as its point, ways as the places that they join.

    A file is its name: two models are compared that may stand in two folders.
    """
    made: Any = thing
    if isinstance(thing, PlaceSpec):
        role = f", {thing.role}" if thing.role else ""
        made = f"{thing.east_m:g} m east, {thing.north_m:g} m north{role}"
    elif isinstance(thing, Ways):
        joined = sorted(f"{one} – {other}" for one, other, _ in thing.edges)
        made = {"height_m": thing.height_m, "ways": dict.fromkeys(joined, "joined")}
    elif isinstance(thing, Mapping):
        made = {str(key): _tree(value) for key, value in thing.items()}
    elif isinstance(thing, Enum):
        made = thing.value
    elif isinstance(thing, PurePath):
        made = thing.name
    elif is_dataclass(thing) and not isinstance(thing, type):
        made = {
            field.name: _part(thing, field.name)
            for field in fields(thing)
            if field.compare and field.name != "name"
        }
    elif isinstance(thing, Sequence) and not isinstance(thing, str):
        named = thing and all(is_dataclass(one) and hasattr(one, "name") for one in thing)
        made = {str(one.name): _tree(one) for one in thing} if named else [_tree(one) for one in thing]
    elif hasattr(thing, "__dict__") and not isinstance(thing, type):
        made = {key: _tree(value) for key, value in vars(thing).items() if not key.startswith("_")}
    return made


def _part(thing: Any, field: str) -> Any:
    value = getattr(thing, field)
    if isinstance(thing, Instance) and isinstance(value, Component):
        return value.name
    if isinstance(thing, Instance) and field == "connections":
        return {port: ", ".join(map(str, one.targets)) for port, one in value.items()}
    return _tree(value)


def _dotted(path: tuple[str, ...]) -> str:
    return ".".join(_without_unit(one) for one in path)


def _without_unit(name: str) -> str:
    ending = _ending(name)
    return name.removesuffix(ending) if ending else name


def _ending(name: str) -> str:
    return max((one for one in _UNITS if name.endswith(one) and name != one), key=len, default="")


def _shown(name: str, value: Any) -> str:
    """Return a value for people: in the unit of its name, shortened."""
    ending = _ending(name)
    if ending and isinstance(value, int | float) and not isinstance(value, bool):
        unit, factor = _UNITS[ending]
        return f"{value * factor:g} {unit}"
    if value is None or value == "":
        return "nothing"
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return text if len(text) <= _SHORT else text[: _SHORT - 1] + "…"
