"""The commands that the README and the pages show are commands that there are."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
import typer

from volery.cli.main import application
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary

ROOT = Path(__file__).parents[3]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def written() -> Iterator[tuple[str, list[str]]]:
    """Each command with the page that shows it, without what a shell would do with it."""
    for page in PAGES:
        for language, block in _BLOCK.findall(page.read_text(encoding="utf-8")):
            if language not in ("", "sh", "console"):
                continue
            for line in re.sub(r"\\\n", " ", block).splitlines():
                command = re.split(r"\s+#|\s&|\s\||;|>", line.strip().removeprefix("$ "))[0]
                if command.startswith("volery "):
                    yield page.name, shlex.split(command)[1:]


COMMANDS = list(written())


def parsed(words: list[str]) -> click.Context:
    """As the command line takes it; what it does not know raises."""
    command, context = typer.main.get_command(application()), None
    while isinstance(command, click.Group):
        context = click.Context(command, parent=context)
        name, command, words = command.resolve_command(context, words)
        assert command is not None, name
    return command.make_context(command.name, words, parent=context)


def test_there_are_some() -> None:
    assert len(COMMANDS) > 30


@pytest.mark.parametrize(
    ("page", "words"), COMMANDS, ids=lambda one: one if isinstance(one, str) else " ".join(one)
)
def test_it_is_understood(page: str, words: list[str]) -> None:
    given = parsed(words).params
    model = given.get("model")
    if model is not None and Path(ROOT, model).exists():
        load(Path(ROOT, model), vocabulary(), given.get("scenario"), given.get("allocation"))
    elif model is not None:
        assert not str(model).startswith("examples/"), f"{page}: there is no {model}"
