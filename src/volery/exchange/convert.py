"""From a file of another tool to a model's file, and back: the functions behind the command line."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from dataclasses import replace as changed
from functools import partial
from pathlib import Path, PurePath
from typing import Any

from volery.base.errors import Location, ModelError, UsageError, choices
from volery.base.files import read_bytes, write_text
from volery.exchange.aadl import aadl_text
from volery.exchange.launch.launch_model import LaunchComputer, launch_tree, read_launch
from volery.exchange.launch.launch_reading import Packages
from volery.exchange.launch.launch_text import launch_ending, launch_text
from volery.exchange.notes import Note
from volery.exchange.sysml import sysml_text
from volery.exchange.uml.components_view import Rebase
from volery.exchange.uml.uml_model import Imported, export_uml, import_uml, located
from volery.exchange.xml_text import MOST_BYTES
from volery.model.assembly import model_file, read_tree
from volery.model.builder import ModelBuilder
from volery.model.reading import Vocabulary
from volery.model.rules import MISSING_FILE, MISSING_KEY, RULES
from volery.model.system_loader import load
from volery.model.text import CollectedModelError
from volery.model.writing import model_text

FORMATS = {
    ".uml": "UML with MARTE and S3D",
    ".aadl": "AADL",
    ".sysml": "SysML v2",
    ".launch": "ROS 1; also .launch.xml and .launch.py of ROS 2",
}
"""Formats of an export by the ending of the file."""

OF_THE_TEXT = frozenset(code for code in RULES if code < MISSING_FILE.code) - {MISSING_KEY.code}
"""Rules of the form of the text: without it nothing can be exported."""

_BESIDE = (".di", ".notation", ".aird")
_EA = "Enterprise Architect's database: publish XMI 2.1 there"
_OTHER_TOOLS = {
    ".mdzip": "MagicDraw's and Cameo's container: export it there as Eclipse UML2 XMI",
    ".mdxml": "MagicDraw's own format: export it there as Eclipse UML2 XMI",
    ".mdj": "StarUML's own format: export XMI there with its XMI extension",
    **dict.fromkeys((".eap", ".eapx", ".qea", ".qeax"), _EA),
}
"""Files of other modelling tools by their endings, and how they become XMI."""


def read_uml(
    source: Path, folder: Path, catalogue: Iterable[str], processors: Mapping[str, str] | None = None
) -> Imported:
    """Return the model of a .uml file, with its paths relative to *folder*.

    Args:
        source: The .uml file.
        folder: The folder that the model will be in.
        catalogue: Names of the processors of the catalogue.
        processors: The processor of the catalogue that each processor of the file is, by its name there.

    Raises:
        ModelError: the file cannot be read, or is no UML model with MARTE or S3D.
    """
    if source.suffix in _BESIDE:
        what = f"a {source.suffix} file has diagrams and no model in it; give {source.stem}.uml beside it"
        raise ModelError(what, "", Location(str(source), 0))
    if source.suffix.lower() in _OTHER_TOOLS:
        what = f"this is {_OTHER_TOOLS[source.suffix.lower()]}, and give that .uml or .xmi file"
        raise ModelError(what, "", Location(str(source), 0))
    try:
        data = read_bytes(source, MOST_BYTES)
    except OSError as error:
        raise ModelError(f"cannot read it: {error.strerror or error}", "", Location(str(source), 0)) from None
    rebase = _rebase(source.parent, folder)
    imported = import_uml(data, str(source), rebase, catalogue, processors, partial(_part_of, source))
    tree = _moved(imported.tree, rebase)
    outside = _outside(tree)
    if not outside:
        return changed(imported, tree=tree)
    tree["files_from"] = list(dict.fromkeys([*tree.get("files_from", []), *outside]))
    what = f"its files are in {choices(outside).replace(' or ', ' and ')}, which `files_from` allows now"
    note = Note(what, Location(str(source), 0), lost=False)
    return changed(imported, tree=tree, notes=(*imported.notes, note))


def _part_of(source: Path, name: str) -> bytes:
    """Return a submodel that *source* refers to, a file in its folder or below."""
    file = source.parent / name
    try:
        if not file.resolve().is_relative_to(source.parent.resolve()):
            raise OSError("it is outside the folder of the model")
        return read_bytes(file, MOST_BYTES)
    except OSError as error:
        what = f"its submodel {name} cannot be read: {error.strerror or error}"
        raise ModelError(what, "", Location(str(source), 0)) from None


def _moved(tree: Mapping[str, Any], rebase: Rebase) -> dict[str, Any]:
    """Return a model with its paths, except those of components, as another folder needs them."""
    made = dict(tree)
    environment, platform = made.get("environment"), made.get("platform")
    if isinstance(environment, dict) and isinstance(environment.get("world"), str):
        made["environment"] = environment | {"world": rebase(environment["world"])}
    if isinstance(platform, dict) and platform.get("catalogues"):
        stated = platform["catalogues"]
        listed = stated if isinstance(stated, list) else [stated]
        made["platform"] = platform | {"catalogues": [rebase(str(one)) for one in listed]}
    for section in ("scenarios", "allocations"):
        made |= {section: {name: _moved_changes(one, rebase) for name, one in made.get(section, {}).items()}}
        if not made[section]:
            del made[section]
    if made.get("files_from"):
        stated = made["files_from"]
        made["files_from"] = [rebase(str(one)) for one in (stated if isinstance(stated, list) else [stated])]
    return made


def _moved_changes(variant: Any, rebase: Rebase) -> Any:
    """Return a scenario or an allocation whose changes name files as another folder needs them."""
    changes = variant.get("set") if isinstance(variant, dict) else None
    if not isinstance(changes, dict):
        return variant
    moved = {key: _moved_value(key, value, rebase) for key, value in changes.items()}
    return variant | {"set": moved}


def _moved_value(key: str, value: Any, rebase: Rebase) -> Any:
    """Return what a change sets, with the path of a world or of a component's file as another needs it."""
    if isinstance(value, str) and (key == "environment.world" or _PATH.fullmatch(key)):
        return rebase(value)
    if isinstance(value, dict) and _COMPONENT.fullmatch(key) and isinstance(value.get("path"), str):
        return value | {"path": rebase(value["path"])}
    return value


_COMPONENT = re.compile(r"components\.[^.]+")
_PATH = re.compile(r"components\.[^.]+\.path")


def _outside(tree: Mapping[str, Any]) -> list[str]:
    """Return the folders of files outside the model's folder that ``files_from`` does not name."""
    components = (tree.get("components") or {}).values()
    named = [str(component.get("path") or "") for component in components if isinstance(component, dict)]
    world = (tree.get("environment") or {}).get("world")
    named += [world] if isinstance(world, str) else []
    allowed = [PurePath(one) for one in tree.get("files_from", [])]
    folders = {PurePath(one).parent: None for one in named if PurePath(one).parts[:1] == ("..",)}
    return [
        folder.as_posix() for folder in folders if not any(folder.is_relative_to(other) for other in allowed)
    ]


def uml_model(
    source: Path, catalogue: Iterable[str], processors: Mapping[str, str] | None = None
) -> tuple[ModelBuilder, tuple[Note, ...]]:
    """Return the model of a .uml file, each entry of which stands at the line of its element, and notes.

    Args:
        source: The .uml file. Paths of the model start in its folder.
        catalogue: Names of the processors of the catalogue.
        processors: The processor of the catalogue that each processor of the file is, by its name there.

    Raises:
        ModelError: the file cannot be read, or is no UML model with MARTE or S3D.
    """
    imported = read_uml(source, source.parent, catalogue, processors)
    built = ModelBuilder("", folder=source.parent)
    built.root = located(imported)
    return built, imported.notes


def import_model(
    source: Path,
    out: Path,
    catalogue: Iterable[str],
    processors: Mapping[str, str] | None = None,
    *,
    replace: bool = False,
) -> Imported:
    """Write the model of a .uml file to *out*, as YAML; see ``read_uml``.

    Raises:
        ModelError: *source* is no UML model.
        UsageError: *out* exists and is not to be replaced, or cannot be written.
    """
    if out.exists() and not replace:
        raise UsageError(f"{out} exists; --replace writes over it")
    imported = read_uml(source, out.parent, catalogue, processors)
    _write(out, model_text(imported.tree))
    return imported


@dataclass(frozen=True)
class ImportedLaunch:
    """The model of a launch file, and notes on what has no place in it."""

    tree: dict[str, Any]
    notes: tuple[Note, ...]


def is_launch_file(source: Path) -> bool:
    """Return whether a file is a launch file of ROS, by its ending, or for XML by its root element."""
    if source.suffix == ".xml":
        try:
            return b"<launch" in read_bytes(source, MOST_BYTES)[:_HEAD]
        except OSError:
            return False
    return source.suffix in (".launch", ".py", ".yaml", ".yml")


_HEAD = 1 << 14
"""Bytes of a file that its root element begins in."""


def import_launch(
    source: Path,
    out: Path,
    given: Mapping[str, str],
    packages: Packages,
    computer: LaunchComputer,
    *,
    replace: bool = False,
) -> ImportedLaunch:
    """Write the model of a launch file to *out*, as YAML; see ``read_launch`` and ``launch_tree``.

    Raises:
        ModelError: *source* is no launch file, or starts nothing.
        UsageError: *out* exists and is not to be replaced, or cannot be written.
    """
    if out.exists() and not replace:
        raise UsageError(f"{out} exists; --replace writes over it")
    reading = read_launch(source, given, packages)
    tree = launch_tree(reading, source, out.parent, computer)
    _write(out, model_text(tree))
    return ImportedLaunch(tree, reading.notes)


def export_model(
    model: Path, target: Path, vocabulary: Vocabulary, packages: Packages | None = None
) -> tuple[Note, ...]:
    """Write a model to *target* in the format of its ending; return what has no place in it.

    A .uml file that exists is updated: ids, diagrams and what volery does not know stay valid.

    Args:
        model: The model's file, or its folder.
        target: The new file.
        vocabulary: Names that are defined outside the model.
        packages: Finds the packages of programs, for a launch file.

    Raises:
        ModelError: the text of the model is wrong, or the existing .uml file cannot be read.
        UsageError: the ending of *target* is of no known format, or it cannot be written.
    """
    ending = launch_ending(target) if packages is not None else ""
    if not ending and target.suffix not in FORMATS:
        listed = choices([f"{ending} ({what})" for ending, what in FORMATS.items()])
        raise UsageError(f"{target}: its ending chooses the format: {listed}")
    file = model_file(model)
    _check_form(file, vocabulary)
    tree = read_tree(file).plain()
    if ending and packages is not None:
        text, notes = launch_text(tree, file.parent, ending, packages)
    elif target.suffix == ".uml":
        base = read_uml(target, file.parent, vocabulary.processors) if target.exists() else None
        if base is not None and base.file.parts:
            files = ", ".join(base.file.parts)
            raise UsageError(f"{target} has parts in other files ({files}): export to a new file")
        rebase = _rebase(file.parent, target.parent)
        text, notes = export_uml(_moved(tree, rebase), str(target), rebase, base)
    else:
        text, notes = (aadl_text if target.suffix == ".aadl" else sysml_text)(tree)
    _write(target, text)
    return notes


def _check_form(file: Path, vocabulary: Vocabulary) -> None:
    """Raise what is wrong with the text of a model; it need not be complete to be exported."""
    try:
        load(file, vocabulary)
    except CollectedModelError as several:
        wrong = [error for error in several.errors if error.code in OF_THE_TEXT]
        if wrong:
            raise CollectedModelError(wrong) from None
    except ModelError as error:
        if error.code in OF_THE_TEXT:
            raise


def _rebase(of: Path, start: Path) -> Rebase:
    """Return what makes paths that start in the folder *of* start in the folder *start*."""
    one, other = of.resolve(), start.resolve()
    return lambda path: PurePath(os.path.relpath(one / path, other)).as_posix()


def _write(path: Path, text: str) -> None:
    try:
        write_text(path, text)
    except OSError as error:
        raise UsageError(f"cannot write {path}: {error.strerror or error}") from None
