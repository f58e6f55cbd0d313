"""``volery model import`` and ``export``: models of other tools to YAML, and back."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from volery.base.errors import UsageError, choices, did_you_mean
from volery.cli.command import LEFT_OUT, OK, Commands
from volery.cli.console import Output
from volery.cli.options import AllowLoss, Model

if TYPE_CHECKING:
    from volery.exchange.uml.context import Note

commands = Commands("model")

Processors = Annotated[
    list[str] | None,
    typer.Option(
        "--processor",
        metavar="NAME=KIND",
        help="Processor of the catalogue that a processor of the file is; may be repeated.",
    ),
]


@commands.add("quiet", "json", "debug", name="import")
def import_(
    output: Output,
    source: Annotated[Path, typer.Argument(metavar="FILE.uml", help="UML model with MARTE or S3D.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="Model to write.")] = Path("model.yaml"),
    processors: Processors = None,
    replace: Annotated[bool, typer.Option("--replace", help="Write over a model that exists.")] = False,
    allow_loss: AllowLoss = False,
) -> int:
    """Write the YAML of a UML model with MARTE and S3D, as Papyrus stores it.

    The exit status is 3 if something of the file was left out.
    """
    from volery.exchange.convert import import_model
    from volery.run.assembly.model_checks import vocabulary

    known = vocabulary().processors
    imported = import_model(source, out, known, _pairs(processors or (), known), replace=replace)
    counts = [
        f"{len(imported.tree.get(key) or {})} {key}" for key in ("interfaces", "components", "application")
    ]
    output.show(f"{out}: {', '.join(counts)}")
    _notes(output, imported.notes)
    output.give({"model": str(out), "notes": [str(one) for one in imported.notes]})
    return _status(imported.notes, allow_loss)


@commands.add("quiet", "json", "debug")
def export(
    output: Output,
    model: Model,
    to: Annotated[Path, typer.Option("--to", metavar="FILE", help="FILE.uml, FILE.aadl or FILE.sysml.")],
    allow_loss: AllowLoss = False,
) -> int:
    """Write a model as UML with MARTE and S3D, AADL or SysML v2; list what has no place there.

    A .uml file that exists is updated: its ids, its diagrams and what volery does not know stay valid. The
    exit status is 3 if something of the model was left out.
    """
    from volery.exchange.convert import export_model
    from volery.run.assembly.model_checks import vocabulary

    notes = export_model(model, to, vocabulary())
    output.show(f"{to} is written")
    _notes(output, notes)
    output.give({"file": str(to), "notes": [str(one) for one in notes]})
    return _status(notes, allow_loss)


def _status(notes: tuple[Note, ...], allow_loss: bool) -> int:
    return LEFT_OUT if any(one.lost for one in notes) and not allow_loss else OK


def _notes(output: Output, notes: tuple[Note, ...]) -> None:
    for lost, what in ((True, "did not map"), (False, "changed or assumed")):
        listed = [one for one in notes if one.lost is lost]
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
