"""What a format has no place for: a note for each thing. ``Unmapped`` collects them by kind."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from volery.base.errors import Location
from volery.model.fields import STATED_KEYS


@dataclass(frozen=True)
class Note:
    """What was not imported or exported as it stands, where, and what to do.

    ``lost`` is false where nothing was left out: a name that was changed, a value that was assumed.
    """

    what: str
    where: Location | None = None
    element: str = ""
    lost: bool = True

    def __str__(self) -> str:
        place = f"{self.where}: " if self.where else ""
        return f"{place}{self.element + ': ' if self.element else ''}{self.what}"


class Unmapped:
    """Collects what was not exported: the kind of thing, and how many or which."""

    def __init__(self) -> None:
        self._found: dict[str, dict[str, None]] = {}

    def add(self, what: str, *names: str) -> None:
        """Record that *what* has no place in the format, at *names*."""
        self._found.setdefault(what, {}).update(dict.fromkeys(names))

    def lines(self) -> Iterator[str]:
        """Yield one line for each kind of thing."""
        for what, names in self._found.items():
            yield f"{what}: {', '.join(names)}" if names else what


def without_provenance(tree: Any, unmapped: Unmapped, path: str = "") -> Any:
    """Return a tree in which quantities with a provenance are bare quantities; record where."""
    if isinstance(tree, Mapping):
        if "value" in tree and tree.keys() <= set(STATED_KEYS):
            unmapped.add("provenance of quantities", path)
            return tree["value"]
        return {
            key: without_provenance(below, unmapped, f"{path}.{key}" if path else str(key))
            for key, below in tree.items()
        }
    if isinstance(tree, list):
        return [without_provenance(below, unmapped, path) for below in tree]
    return tree


def instances(tree: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Return the instances of the application, then those of the environment."""
    around = (tree.get("environment") or {}).get("components") or {}
    return {**(tree.get("application") or {}), **around}


def connections(tree: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """Yield each connection: the instance, its required port, and what it is connected to."""
    components = tree.get("components") or {}
    for name, stated in instances(tree).items():
        for port in components.get(stated.get("is"), {}).get("requires") or {}:
            listed = stated.get(port)
            for target in listed if isinstance(listed, list) else [listed]:
                if target is not None:
                    yield name, port, str(target)


def default_allocation(tree: Mapping[str, Any]) -> dict[str, str]:
    """Return the places of the first allocation, with those of what it extends."""
    allocations = tree.get("allocations") or {}
    chain = [next(iter(allocations), "")]
    while (above := (allocations.get(chain[-1]) or {}).get("extends")) and above not in chain:
        chain.append(above)
    places: dict[str, str] = {}
    for one in reversed(chain):
        stated = allocations.get(one) or {}
        places |= {key: str(value) for key, value in stated.items() if key not in ("extends", "set")}
    return places


def note_rest(unmapped: Unmapped, tree: Mapping[str, Any], mapped: Iterable[str]) -> None:
    """Record the sections of a model that the format has no place for, and all but the default allocation."""
    for section, stated in tree.items():
        if stated and section not in mapped:
            unmapped.add(f"section `{section}`", *(stated if isinstance(stated, Mapping) else ()))
    others = list(tree.get("allocations") or {})[1:]
    if others:
        unmapped.add("allocations but the default one", *others)
    for name, component in (tree.get("components") or {}).items():
        for key in ("parameters", "calls", "assume", "files", "build", "queues"):
            if component.get(key):
                unmapped.add(f"`{key}` of components", name)
    for name, stated in ((tree.get("environment") or {}).get("vehicles") or {}).items():
        rest = [key for key in stated if key != "kind"]
        unmapped.add("vehicles but for their kind", *(f"{name}.{key}" for key in rest))
    for key in (tree.get("environment") or {}).keys() - {"vehicles", "components"}:
        unmapped.add("environment", key)
