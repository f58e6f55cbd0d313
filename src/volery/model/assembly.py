"""Assembly of one tree from a model's parts: world file, model file, scenario, allocation, options.

In this order, later parts win. Scenarios, allocations and options ``set`` paths: keys and list positions
joined by dots. The entry that is set may be new; what leads to it must exist or be a part of every model
(``environment.wind``). Setting nothing removes an entry.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath

from volery.base import files
from volery.base.errors import Location, ModelError, UsageError
from volery.model import rules
from volery.model.builder import TEXT_NAME, ModelBuilder
from volery.model.document import GEOGRAPHY, keys_at, names_are_free, short_key
from volery.model.replication import is_counted, leads_to_copy, replicate
from volery.model.system import ModelFile
from volery.model.text import (
    Path,
    Problems,
    TextNode,
    is_inside,
    no_such,
    outside,
    parse,
    parse_value,
    stated_texts,
    written,
)


@dataclass(frozen=True)
class Change:
    """A change: put *value* at *path*. ``stated_at`` is the path in the model that states it, if any."""

    path: Path
    value: TextNode
    stated_at: Path = ()

    @property
    def where(self) -> Location:
        """The line or the option that states the change."""
        return self.value.where


def split_path(path: str) -> Path:
    """Return the path of a text such as ``platform.processors.onboard``."""
    return tuple(path.split("."))


def change_from_option(text: str) -> Change:
    """Return the change of an option ``--set path=value``; the value is YAML.

    Raises:
        UsageError: *text* has no path or no value.
    """
    path, equals, value = text.partition("=")
    if not equals or not path.strip() or "" in path.strip().split("."):
        raise UsageError(
            f"--set {text}: a path and a value are expected, "
            "such as platform.processors.onboard.frequency='600 MHz'"
        )
    return Change(split_path(path.strip()), parse_value(value, Location(f"--set {text}", 0)))


def changes_from_mapping(node: TextNode | None, stated_at: Path) -> list[Change]:
    """Return the changes of a ``set:`` mapping, in its order."""
    if node is None:
        return []
    return [Change(split_path(key), value, (*stated_at, key)) for key, value in node.items.items()]


def apply_changes(root: TextNode, changes: Iterable[Change], problems: Problems) -> None:
    """Change *root* in place; report paths that do not exist."""
    for change in changes:
        complaint = _apply(root, change)
        if change.path[0] == "run":  # a scenario's own `duration` and `until` are copied there
            problems.copied(change.path, change.stated_at or None)
        if complaint:
            problems.add(change.stated_at or change.path, complaint, change.where, rules.BAD_CHANGE)


def _apply(root: TextNode, change: Change) -> str:
    node = root
    for depth, step in enumerate(change.path[:-1]):
        below = node.child(step)
        if below is None:
            complaint = _cannot_make(node, change.path[: depth + 1])
            if complaint:
                return complaint
            below = TextNode({}, change.where)
            node.items[str(step)] = below
        _lengthen(below, change.path[: depth + 1])
        node = below
    return _put(node, change)


def _lengthen(node: TextNode, path: Path) -> None:
    """Expand a value in its short form to the mapping: ``battery: 5 Ah`` has a ``capacity``."""
    if node.value is None:
        node.value = {}
    key = short_key(path)
    if key is not None and not isinstance(node.value, dict | list):
        node.value = {key: TextNode(node.value, node.where, node.quoted)}


def _cannot_make(node: TextNode, path: Path) -> str:
    """Return why a mapping cannot be made at *path*; empty if it can."""
    known = keys_at(path[:-1]) or []
    if path[-1] in known:
        return ""
    if isinstance(node.value, dict) and names_are_free(path[:-1]):
        return no_such(path[-1], f"entry of {written(path[:-1])}", [*node.items, *known])
    if isinstance(node.value, dict):
        return no_such(path[-1], f"key of {written(path[:-1]) or 'a model'}", known)
    return f"{written(path[:-1])} is {_shown(node)}: nothing below it can be set"


def _put(node: TextNode, change: Change) -> str:
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


def _shown(node: TextNode) -> str:
    return "a list" if isinstance(node.value, list) else repr(node.value)


WORLD: Path = ("environment", "world")
NOT_PLACES = ("extends", "set")


@dataclass
class Assembly:
    """The tree of one allocation and one scenario. ``places`` is the allocation with what it extends.

    ``stated`` is the tree before a number of vehicles is replaced by the copies.
    """

    root: TextNode
    sources: tuple[ModelFile, ...]
    stated: TextNode = field(init=False)
    allocation: str = ""
    scenario: str = ""
    places: dict[str, TextNode] | None = None

    def __post_init__(self) -> None:
        """See ``stated``."""
        self.stated = self.root


@dataclass(frozen=True)
class Selection:
    """The selected scenario and allocation (None: the model's default), and options in order."""

    scenario: str | None = None
    allocation: str | None = None
    options: tuple[Change, ...] = ()


def read_text(path: FilePath, name: str, where: Location | None = None, at: Path = ()) -> str:
    """Return the text of a file that is named at *at* in the model, which stands at *where*.

    Raises:
        ModelError: the file cannot be read.
    """
    try:
        return files.read_text(path)
    except FileNotFoundError:
        what = f"there is no file {name!r}{_near(path)}"
    except IsADirectoryError:
        what = f"{name!r} is a folder"
    except UnicodeDecodeError:
        what = f"{name!r} is not text"
    except OSError as error:
        what = f"{name!r} cannot be read: {error.strerror}"
    raise ModelError(what, written(at), where, rules.MISSING_FILE.code)


def _near(path: FilePath) -> str:
    models = sorted(found.name for found in path.parent.glob("*.y*ml")) if path.parent.is_dir() else []
    return f"; in that folder there is {', '.join(models[:5])}" if models else ""


DEFAULT_FILE = "model.yaml"
"""The file that a folder stands for."""


def model_file(path: str | FilePath) -> FilePath:
    """Return the file of a model: *path*, or the ``model.yaml`` of that folder."""
    path = FilePath(path)
    return path / DEFAULT_FILE if path.is_dir() else path


def read_tree(file: FilePath) -> TextNode:
    """Return the tree of a model as its files state it, without an allocation or a scenario.

    A number of vehicles is replaced by the copies; the geography is part of the tree then.

    Raises:
        ModelError: a file cannot be read, or is no YAML of a model.
    """
    made, problems = _read_files(file)
    environment = made.root.child("environment")
    if environment is not None and is_counted(made.root):
        _merge_world(made, file.parent, [], problems)
        environment.items.pop("world", None)
        made.root = replicate(made.root, None, problems)
    problems.raise_if_any()
    return made.root


def _read_files(file: FilePath) -> tuple[Assembly, Problems]:
    """Read *file* and the files that it includes, as one tree."""
    if file.suffix == ".uml":
        what = f"this is UML: `volery model import {file} --out model.yaml` makes the model of it that runs"
        raise ModelError(what, "", Location(str(file), 1), rules.NOT_A_MODEL.code)
    root, text = _read_mapping(file, str(file), "a model is a mapping that starts with `volery: 1`")
    assembly = Assembly(root, (ModelFile(file.name, text),))
    problems = Problems(root.locate)
    _include(assembly, root, file.parent, problems, (file.resolve(),))
    return assembly, problems


def _built(model: ModelBuilder) -> tuple[Assembly, Problems]:
    """Return the tree of a model that was built in Python, with the files that it includes."""
    root = model.root.copy()
    assembly = Assembly(root, (ModelFile(TEXT_NAME, model.text()),))
    problems = Problems(root.locate)
    _include(assembly, root, model.folder, problems, ())
    return assembly, problems


def _read_mapping(
    file: FilePath, name: str, expected: str, where: Location | None = None, at: Path = ()
) -> tuple[TextNode, str]:
    text = read_text(file, name, where, at)
    root = parse(text, str(file))
    if not isinstance(root.value, dict):
        raise ModelError(expected, "", root.where, rules.NOT_A_MODEL.code)
    return root, text


def _include(
    made: Assembly, part: TextNode, folder: FilePath, problems: Problems, open_: tuple[FilePath, ...]
) -> None:
    """Add the files that *part* includes to the tree; *open_* are the files that are being read."""
    node = part.items.pop("include", None)
    listed = node.value if node is not None and isinstance(node.value, list) else [node] if node else []
    for one in listed:
        if not isinstance(one, TextNode) or not isinstance(one.value, str):
            problems.add(("include",), "a file name is expected", node.where if node else None)
            continue
        file = folder / one.value
        if not _allowed(made.root, folder, file):
            problems.add(("include",), outside(one.value), one.where, rules.OUTSIDE)
            continue
        if file.resolve() in open_:
            problems.add(("include",), f"{one.value!r} includes itself", one.where, rules.CIRCULAR)
            continue
        included, text = _read_mapping(
            file, one.value, "an included file is a mapping", one.where, ("include",)
        )
        made.sources = (*made.sources, ModelFile(one.value, text))
        _include(made, included, folder, problems, (*open_, file.resolve()))
        _add_entries(made.root, included, (), problems)


def _add_entries(root: TextNode, included: TextNode, path: Path, problems: Problems) -> None:
    """Add the entries of *included* to *root*; what both state must be mappings of different entries."""
    for key, below in included.items.items():
        own = root.items.get(key)
        if own is None or own.value is None:
            root.items[key] = below
        elif (*path, key) == ("volery",):
            continue
        elif not names_are_free(path) and isinstance(own.value, dict) and isinstance(below.value, dict):
            _add_entries(own, below, (*path, key), problems)
        else:
            what = f"{below.where} states it, too"
            problems.add((*path, key), what, own.where, rules.DUPLICATE_KEY)


def _allowed(root: TextNode, folder: FilePath, file: FilePath) -> bool:
    return is_inside(file, [folder, *(folder / text for text in stated_texts(root, "files_from"))])


def assemble(model: FilePath | ModelBuilder, selection: Selection) -> tuple[Assembly, Problems]:
    """Read *model* and the files that it names, and apply the selection. Return the tree and its problems."""
    made, problems = _built(model) if isinstance(model, ModelBuilder) else _read_files(model)
    folder = model.folder if isinstance(model, ModelBuilder) else model.parent
    root = made.root
    early, others = _parted(selection.options)
    apply_changes(root, early, problems)
    all_changes = [
        *_choose_scenario(made, selection, problems),
        *_choose_allocation(made, selection, problems),
        *others,
    ]
    _merge_world(made, folder, all_changes, problems)
    late = []
    for change in all_changes:
        if leads_to_copy(root, change.path):
            late.append(change)
        else:
            apply_changes(root, [change], problems)
    made.root = replicate(root, made.places, problems)
    apply_changes(made.root, late, problems)
    _merge_airframes(made, folder, problems)
    return made, problems


def _parted(options: Sequence[Change]) -> tuple[list[Change], list[Change]]:
    """Return the options that change scenarios and allocations, which are applied first, and the rest."""
    early = [change for change in options if change.path[0] in ("scenarios", "allocations")]
    return early, [change for change in options if change not in early]


def _choose_scenario(made: Assembly, selection: Selection, problems: Problems) -> list[Change]:
    if selection.scenario is None:
        return []
    found: list[Change] = []
    for name in _chain(made.root, "scenarios", selection.scenario, problems):
        at = ("scenarios", name)
        node = made.root.at(at)
        found += changes_from_mapping(made.root.at((*at, "set")), (*at, "set"))
        for key in ("duration", "until"):
            below = node.child(key) if node else None
            if below is not None:
                found.append(Change(("run", key), below, (*at, key)))
    made.scenario = selection.scenario
    return found


def _choose_allocation(made: Assembly, selection: Selection, problems: Problems) -> list[Change]:
    name = (
        selection.allocation
        or _scenarios_allocation(made, problems)
        or next(iter(_names(made.root, "allocations")), "")
    )
    if not name:
        return []
    found: list[Change] = []
    places: dict[str, TextNode] = {}
    for step in _chain(made.root, "allocations", name, problems):
        at = ("allocations", step)
        found += changes_from_mapping(made.root.at((*at, "set")), (*at, "set"))
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


def _names(root: TextNode, section: str) -> list[str]:
    node = root.child(section)
    return list(node.items) if node else []


def _chain(root: TextNode, section: str, name: str, problems: Problems) -> list[str]:
    """Return *name* and what it extends, the first ancestor first."""
    names = _names(root, section)
    if name not in names:
        raise UsageError(no_such(name, section[:-1], names))
    chain = [name]
    while True:
        said = root.at((section, chain[-1], "extends"))
        if said is None or not isinstance(said.value, str):
            return chain[::-1]
        if said.value not in names:
            problems.unknown((section, chain[-1], "extends"), said.value, section[:-1], names)
            return chain[::-1]
        if said.value in chain:
            around = " -> ".join([*chain, said.value])
            problems.add((section, chain[-1], "extends"), f"a circle: {around}", rule=rules.CIRCULAR)
            return chain[::-1]
        chain.append(said.value)


def _merge_world(made: Assembly, folder: FilePath, all_changes: list[Change], problems: Problems) -> None:
    said = next(
        (change.value for change in reversed(all_changes) if change.path == WORLD), made.root.at(WORLD)
    )
    if said is None or not isinstance(said.value, str) or not said.value:
        return
    name = said.value
    if not _allowed(made.root, folder, folder / name):
        problems.add(WORLD, outside(name), said.where, rules.OUTSIDE)
        return
    world, text = _read_mapping(folder / name, name, "a world file is a mapping", said.where, WORLD)
    made.sources = (*made.sources, ModelFile(name, text))
    environment = made.root.at(("environment",))
    if environment is None or not isinstance(environment.value, dict):
        return
    known = list(GEOGRAPHY)
    for key, node in world.items.items():
        if key == "volery":
            continue
        if key not in known:
            what = f"a world file has no such key; {_listed(known)}"
            problems.add(("environment", key), what, node.where, rules.UNKNOWN_KEY)
            continue
        environment.value[key] = _under(environment.value.get(key), node)


def _merge_airframes(made: Assembly, folder: FilePath, problems: Problems) -> None:
    """Replace the name of an airframe's file by what the file states, with the model's own entries on top."""
    files_read: dict[str, TextNode] = {}
    vehicles = made.root.at(("environment", "vehicles"))
    for name, vehicle in vehicles.items.items() if vehicles else ():
        stated = vehicle.child("airframe")
        said = stated if stated is None or isinstance(stated.value, str) else stated.child("file")
        if stated is None or said is None or not isinstance(said.value, str):
            continue
        file, path = said.value, ("environment", "vehicles", name, "airframe")
        if not _allowed(made.root, folder, folder / file):
            problems.add(path, outside(file), said.where, rules.OUTSIDE)
            vehicle.items.pop("airframe")
            continue
        if file not in files_read:
            what = "an airframe is a mapping that states its frame, mass, arm, propellers, motors and battery"
            files_read[file], text = _read_mapping(folder / file, file, what, said.where, path)
            made.sources = (*made.sources, ModelFile(file, text))
        vehicle.items["airframe"] = _on_top(
            stated if isinstance(stated.value, dict) else TextNode({"file": said}, stated.where),
            files_read[file],
        )


def _on_top(own: TextNode, below: TextNode) -> TextNode:
    """Return a tree with the entries of another one on top, mapping by mapping."""
    if not isinstance(own.value, dict) or not isinstance(below.value, dict):
        return own
    both = {
        key: _on_top(node, below.items[key]) if key in below.items else node
        for key, node in own.items.items()
    }
    return TextNode({**below.items, **both}, below.where)


def _listed(known: list[str]) -> str:
    return f"it has {', '.join(known)}"


def _under(own: TextNode | None, world: TextNode) -> TextNode:
    """Return the world's part with the model's own entries on top."""
    if own is None:
        return world
    if isinstance(own.value, dict) and isinstance(world.value, dict):
        return replace(own, value={**world.value, **own.value})
    return own
