"""``volery model draw``, ``show`` and ``diff``: a model for the eye, and two of them side by side."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from volery.base.errors import UsageError, choices
from volery.cli.command import OK, Commands
from volery.cli.console import CommandOutput, make_table
from volery.cli.options import Allocation, Model, Overrides, Scenario

if TYPE_CHECKING:
    from volery.model.system import System

commands = Commands("model")

VIEWS = ("functional", "deployment", "verification", "topics")
FORMATS = ("svg", "mermaid")
_SUFFIX = {"svg": "svg", "mermaid": "mmd"}


@commands.add("quiet", "debug")
def draw(
    output: CommandOutput,
    model: Model,
    view: Annotated[str, typer.Option(metavar="|".join((*VIEWS, "all")), help="What is drawn.")] = "all",
    to: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder of the pictures, <model>-<view>.svg or .mmd.")
    ] = Path(),
    picture: Annotated[
        str, typer.Option("--format", metavar="svg|mermaid", help="SVG, or Mermaid text.")
    ] = "svg",
    page: Annotated[
        bool, typer.Option(help="Also write <model>.md: the pictures with tables of the model.")
    ] = False,
    allocation: Allocation = None,
    scenario: Scenario = None,
    overrides: Overrides = None,
) -> int:
    """Draw a model: its components and ports, its deployment, its verification environment, its topics."""
    from volery.model.system_loader import load
    from volery.run.assembly.model_checks import vocabulary

    if view not in (*VIEWS, "all"):
        raise UsageError(f"--view {view}: there is {choices((*VIEWS, 'all'))}")
    if picture not in FORMATS:
        raise UsageError(f"--format {picture}: there is {choices(FORMATS)}")
    system = load(model, vocabulary(), scenario, allocation, overrides or ())
    name = re.sub(r"[^A-Za-z0-9._-]+", "-", system.name).strip("-.") or "model"
    drawers = _svg_drawers() if picture == "svg" else _mermaid_drawers()
    wanted = [one for one in VIEWS if one in drawers] if view == "all" else [view]
    drawn: dict[str, str] = {}
    for one in wanted:
        if one not in drawers:
            raise UsageError(f"--view {one}: as Mermaid text there is {choices(drawers)}")
        try:
            text = drawers[one](system)
        except UsageError:
            if view != "all":  # a model without topics has no such view
                raise
            continue
        drawn[one] = f"{name}-{one}.{_SUFFIX[picture]}"
        _write(output, to / drawn[one], text)
    if page:
        from volery.drawing.page import page as page_of

        _write(output, to / f"{name}.md", page_of(system, drawn if picture == "svg" else {}))
    return OK


def _write(output: CommandOutput, file: Path, text: str) -> None:
    from volery.base.files import write_text

    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_text(file, text)
    except OSError as error:
        raise UsageError(f"cannot write {file}: {error.strerror or error}") from error
    output.note(f"written: {file}")


def _svg_drawers() -> dict[str, Callable[[System], str]]:
    from volery.drawing.deployment import deployment_svg
    from volery.drawing.shapes import functional_svg, verification_svg
    from volery.report.graph_picture import graph_of_model, graph_svg

    return {
        "functional": functional_svg,
        "deployment": deployment_svg,
        "verification": verification_svg,
        "topics": lambda system: graph_svg(graph_of_model(system)),
    }


def _mermaid_drawers() -> dict[str, Callable[[System], str]]:
    from volery.drawing.mermaid import deployment_mermaid, functional_mermaid, verification_mermaid

    return {
        "functional": functional_mermaid,
        "deployment": deployment_mermaid,
        "verification": verification_mermaid,
    }


@commands.add("quiet", "json", "debug")
def diff(
    output: CommandOutput,
    before: Annotated[Path, typer.Argument(help="Model file or folder.")],
    after: Annotated[Path, typer.Argument(help="Another one, or the same with other options.")],
    allocation: Allocation = None,
    scenario: Scenario = None,
    allocation_after: Annotated[
        str | None, typer.Option(help="Allocation of the second model; by default that of the first.")
    ] = None,
    scenario_after: Annotated[
        str | None, typer.Option(help="Scenario of the second model; by default that of the first.")
    ] = None,
) -> int:
    """Show what differs between two models, or two variants of one, in terms of the model and not of lines.

    The exit status is 0 also if they differ.
    """
    from volery.model.differences import differences
    from volery.model.system_loader import load
    from volery.run.assembly.model_checks import vocabulary

    words = vocabulary()
    one = load(before, words, scenario, allocation)
    other = load(after, words, scenario_after or scenario, allocation_after or allocation)
    found = differences(one, other)
    table = make_table("what", "property", "before", "after")
    for each in found:
        style = {"added": "green", "removed": "red"}.get(each.kind, "")
        subject = Text(f"{each.noun} {each.name}".strip(), style=style)
        if each.property:
            table.add_row(subject, each.property, each.before, each.after)
        else:
            table.add_row(subject, each.kind)
    output.show(table if found else Text("no difference"))
    output.give([asdict(each) for each in found])
    return OK


@commands.add("debug")
def show(
    output: CommandOutput,
    model: Model,
    allocation: Allocation = None,
    scenario: Scenario = None,
    overrides: Overrides = None,
) -> int:
    """Draw one variant of a model in text: allocation and connections."""
    from volery.model.diagram import diagram
    from volery.model.system_loader import load
    from volery.run.assembly.model_checks import vocabulary

    system = load(model, vocabulary(), scenario, allocation, overrides or ())
    output.show(Text(diagram(system), end=""))
    return OK
