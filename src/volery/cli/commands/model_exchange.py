"""``volery model import`` and ``export``: models of other tools and launch files to YAML, and back."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from volery.base.errors import UsageError, choices, did_you_mean
from volery.cli.command import LEFT_OUT, OK, Commands
from volery.cli.console import CommandOutput
from volery.cli.options import AllowLoss, Model

if TYPE_CHECKING:
    from volery.exchange.convert import ImportedLaunch
    from volery.exchange.launch.launch_model import LaunchComputer
    from volery.exchange.notes import Note
    from volery.exchange.uml.uml_model import Imported
    from volery.model.reading import ProcessorKind

commands = Commands("model")

Processors = Annotated[
    list[str] | None,
    typer.Option(
        "--processor",
        metavar="NAME=KIND",
        help="Processor of the catalogue that a processor of the file is; may be repeated.",
    ),
]

Search = Annotated[
    list[Path] | None,
    typer.Option(
        "--search", metavar="DIR", help="Folder in which packages of a launch file are; may be repeated."
    ),
]


@commands.add("quiet", "json", "debug", name="import")
def import_(
    output: CommandOutput,
    source: Annotated[
        Path, typer.Argument(metavar="FILE", help="UML model with MARTE or S3D, or a launch file of ROS.")
    ],
    arguments: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME:=VALUE]...", help="Arguments of a launch file.")
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="Model to write.")] = Path("model.yaml"),
    processors: Processors = None,
    search: Search = None,
    replace: Annotated[bool, typer.Option("--replace", help="Write over a model that exists.")] = False,
    allow_loss: AllowLoss = False,
) -> int:
    """Write the YAML of a UML model with MARTE and S3D, or of a launch file of ROS 1 or ROS 2.

    A launch file (XML, YAML or Python) is read and never executed. The exit status is 3 if something of the
    file was left out.
    """
    from volery.components.package_search import PackageSearch
    from volery.exchange.convert import import_launch, import_model, is_launch_file
    from volery.run.assembly.model_checks import vocabulary

    imported: ImportedLaunch | Imported
    words = vocabulary().processors
    if is_launch_file(source):
        given = _launch_arguments(arguments or ())
        packages = PackageSearch(_folders(search or ()))
        computer = _computer(processors or (), words)
        imported = import_launch(source, out, given, packages, computer, replace=replace)
    else:
        if arguments or search:
            raise UsageError(f"{source} is no launch file: NAME:=VALUE and --search are for one")
        imported = import_model(source, out, words, _pairs(processors or (), words), replace=replace)
    counts = [
        f"{len(imported.tree.get(key) or {})} {key}" for key in ("interfaces", "components", "application")
    ]
    output.show(f"{out}: {', '.join(counts)}")
    _notes(output, imported.notes)
    output.give({"model": str(out), "notes": [str(note) for note in imported.notes]})
    return _status(imported.notes, allow_loss)


def _launch_arguments(texts: Iterable[str]) -> dict[str, str]:
    given = {}
    for text in texts:
        name, mark, value = text.partition(":=")
        if not mark or not name:
            raise UsageError(f"{text}: an argument of a launch file is NAME:=VALUE")
        given[name] = value
    return given


def _computer(processors: Iterable[str], words: Mapping[str, ProcessorKind]) -> LaunchComputer:
    """Return the computer of the nodes of a launch file, at its greatest frequency."""
    from volery.exchange.launch.launch_model import COMPUTER, LaunchComputer

    stated = _pairs(processors, words)
    if stated.keys() - {COMPUTER}:
        listed = ", ".join(sorted(stated.keys() - {COMPUTER}))
        raise UsageError(f"--processor {listed}: the computer of a launch file's nodes is {COMPUTER}=KIND")
    kind = stated.get(COMPUTER, _USUAL)
    return LaunchComputer(kind, words[kind].greatest_hz, assumed=not stated)


_USUAL = "rpi4-cortex-a72"
"""The computer of a launch file's nodes if none is stated."""


def _folders(search: Iterable[Path]) -> list[Path]:
    folders = list(search)
    for folder in folders:
        if not folder.is_dir():
            raise UsageError(f"--search {folder}: there is no such folder")
    return folders


@commands.add("quiet", "json", "debug")
def export(
    output: CommandOutput,
    model: Model,
    to: Annotated[
        Path,
        typer.Option(
            "--to", metavar="FILE", help="FILE.uml, .aadl, .sysml, .launch, .launch.xml or .launch.py."
        ),
    ],
    allow_loss: AllowLoss = False,
) -> int:
    """Write a model as UML with MARTE and S3D, AADL, SysML v2 or a launch file; list what has no place there.

    A .uml file that exists is updated: its ids, its diagrams and what volery does not know stay valid. The
    exit status is 3 if something of the model was left out.
    """
    from volery.components.package_search import PackageSearch
    from volery.exchange.convert import export_model
    from volery.run.assembly.model_checks import vocabulary

    notes = export_model(model, to, vocabulary(), PackageSearch())
    output.show(f"{to} is written")
    _notes(output, notes)
    output.give({"file": str(to), "notes": [str(note) for note in notes]})
    return _status(notes, allow_loss)


def _status(notes: tuple[Note, ...], allow_loss: bool) -> int:
    return LEFT_OUT if any(note.lost for note in notes) and not allow_loss else OK


def _notes(output: CommandOutput, notes: tuple[Note, ...]) -> None:
    for lost, what in ((True, "did not map"), (False, "changed or assumed")):
        listed = [note for note in notes if note.lost is lost]
        if listed:
            output.note(f"{len(listed)} thing{'s' * (len(listed) > 1)} {what}:")
        for one in listed:
            output.note(f"  {one}")


def _pairs(texts: Iterable[str], known: Iterable[str]) -> dict[str, str]:
    found = {}
    for text in texts:
        name, equals, kind = text.partition("=")
        if not equals or kind not in known:
            kinds = f"{choices(known)}{did_you_mean(kind, known)}"
            raise UsageError(f"--processor {text}: NAME=KIND is expected; the kinds are {kinds}")
        found[name.strip()] = kind
    return found
