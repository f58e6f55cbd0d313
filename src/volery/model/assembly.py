"""One tree out of a model's parts: the file, its world file, a scenario, an allocation, options.

In this order, later ones win: world file, model file, scenario, allocation, options.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path as FilePath

from volery.base.errors import Location, ModelError, UsageError
from volery.model import changes
from volery.model.changes import Change
from volery.model.form_environment import WorldForm
from volery.model.problems import Path, Problems, no_such, written
from volery.model.system import Source
from volery.model.text import Node, parse

WORLD: Path = ("environment", "world")
NOT_PLACES = ("extends", "set")


@dataclass
class Assembly:
    """The tree of one allocation and one scenario. ``places`` is the allocation with what it extends."""

    root: Node
    sources: tuple[Source, ...]
    allocation: str = ""
    scenario: str = ""
    places: dict[str, Node] | None = None


@dataclass(frozen=True)
class Wanted:
    """What is asked for: a scenario, an allocation (``None``: the model's choice), and options in order."""

    scenario: str | None = None
    allocation: str | None = None
    options: tuple[Change, ...] = ()


def read_text(path: FilePath, name: str, where: Location | None = None, at: Path = ()) -> str:
    """The text of a file; a ``ModelError`` names it. *where* and *at* are of what asks for it."""
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        what = f"there is no file {name!r}{_near(path)}"
    except IsADirectoryError:
        what = f"{name!r} is a folder"
    except UnicodeDecodeError:
        what = f"{name!r} is not text"
    except OSError as error:
        what = f"{name!r} cannot be read: {error.strerror}"
    raise ModelError(what, written(at), where)


def _near(path: FilePath) -> str:
    models = sorted(found.name for found in path.parent.glob("*.y*ml")) if path.parent.is_dir() else []
    return f"; in that folder there is {', '.join(models[:5])}" if models else ""


def assemble(file: FilePath, wanted: Wanted) -> tuple[Assembly, Problems]:
    """Read *file* and what it names, and apply what is *wanted*. Problems of the paths are in the result."""
    text = read_text(file, str(file))
    root = parse(text, str(file))
    if not isinstance(root.value, dict):
        raise ModelError("a model is a mapping that starts with `volery: 1`", "", root.where)
    made = Assembly(root, (Source(file.name, text),))
    problems = Problems(root.locate)
    early, late = _parted(wanted.options)
    changes.apply(root, early, problems)
    all_changes = [
        *_choose_scenario(made, wanted, problems),
        *_choose_allocation(made, wanted, problems),
        *late,
    ]
    _merge_world(made, file.parent, all_changes, problems)
    changes.apply(root, all_changes, problems)
    return made, problems


def _parted(options: Sequence[Change]) -> tuple[list[Change], list[Change]]:
    """Options that change what a scenario or an allocation says come before these are looked at."""
    early = [change for change in options if change.path[0] in ("scenarios", "allocations")]
    return early, [change for change in options if change not in early]


def _choose_scenario(made: Assembly, wanted: Wanted, problems: Problems) -> list[Change]:
    if wanted.scenario is None:
        return []
    found: list[Change] = []
    for name in _chain(made.root, "scenarios", wanted.scenario, problems):
        at = ("scenarios", name)
        node = made.root.at(at)
        found += changes.from_mapping(made.root.at((*at, "set")), (*at, "set"))
        for key in ("duration", "until"):
            below = node.child(key) if node else None
            if below is not None:
                found.append(Change(("run", key), below, (*at, key)))
    made.scenario = wanted.scenario
    return found


def _choose_allocation(made: Assembly, wanted: Wanted, problems: Problems) -> list[Change]:
    name = (
        wanted.allocation
        or _scenarios_allocation(made, problems)
        or next(iter(_names(made.root, "allocations")), "")
    )
    if not name:
        return []
    found: list[Change] = []
    places: dict[str, Node] = {}
    for step in _chain(made.root, "allocations", name, problems):
        at = ("allocations", step)
        found += changes.from_mapping(made.root.at((*at, "set")), (*at, "set"))
        node = made.root.at(at)
        places |= {key: below for key, below in (node.items if node else {}).items() if key not in NOT_PLACES}
    made.allocation = name
    made.places = places
    return found


def _scenarios_allocation(made: Assembly, problems: Problems) -> str:
    if not made.scenario:
        return ""
    for name in reversed(_chain(made.root, "scenarios", made.scenario, problems)):
        said = made.root.at(("scenarios", name, "allocation"))
        if said is not None and isinstance(said.value, str):
            return said.value
    return ""


def _names(root: Node, section: str) -> list[str]:
    node = root.child(section)
    return list(node.items) if node else []


def _chain(root: Node, section: str, name: str, problems: Problems) -> list[str]:
    """*name* and what it extends, the first ancestor first."""
    names = _names(root, section)
    if name not in names:
        raise UsageError(no_such(name, section[:-1], names))
    chain = [name]
    while True:
        said = root.at((section, chain[-1], "extends"))
        if said is None or not isinstance(said.value, str):
            return chain[::-1]
        if said.value not in names:
            problems.add((section, chain[-1], "extends"), no_such(said.value, section[:-1], names))
            return chain[::-1]
        if said.value in chain:
            around = " -> ".join([*chain, said.value])
            problems.add((section, chain[-1], "extends"), f"a circle: {around}")
            return chain[::-1]
        chain.append(said.value)


def _merge_world(made: Assembly, folder: FilePath, all_changes: list[Change], problems: Problems) -> None:
    said = next(
        (change.value for change in reversed(all_changes) if change.path == WORLD), made.root.at(WORLD)
    )
    if said is None or not isinstance(said.value, str) or not said.value:
        return
    name = said.value
    text = read_text(folder / name, name, said.where, WORLD)
    world = parse(text, str(folder / name))
    if not isinstance(world.value, dict):
        raise ModelError("a world file is a mapping", "", world.where)
    made.sources = (*made.sources, Source(name, text))
    environment = made.root.at(("environment",))
    if environment is None or not isinstance(environment.value, dict):
        return
    known = list(WorldForm.model_fields)
    for key, node in world.items.items():
        if key == "volery":
            continue
        if key not in known:
            problems.add(("environment", key), f"a world file has no such key; {_listed(known)}", node.where)
            continue
        environment.value[key] = _under(environment.value.get(key), node)


def _listed(known: list[str]) -> str:
    return f"it has {', '.join(known)}"


def _under(own: Node | None, world: Node) -> Node:
    """The world's part with the model's own entries on top."""
    if own is None:
        return world
    if isinstance(own.value, dict) and isinstance(world.value, dict):
        return replace(own, value={**world.value, **own.value})
    return own
