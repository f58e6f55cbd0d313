"""``volery``: the application, made from the files in ``volery.cli.commands``."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from pkgutil import iter_modules
from typing import Annotated

import typer

from volery.base.errors import UsageError
from volery.base.garbage import seldom_collected
from volery.base.process import outlive_output
from volery.cli import commands
from volery.cli.command import BAD_INPUT, FAILED, FIRST_HOUR, HELP, Commands
from volery.cli.configuration import Configuration, read_configuration
from volery.cli.console import CommandOutput
from volery.cli.old_names import QUIET, current_words

ROS_ARGUMENTS = "--ros-args"
INFORMATION = frozenset({*HELP, "--version"})
"""Options that a wrong configuration file does not stop: its error is printed beside what they print."""


def _version(wanted: bool) -> None:
    if wanted:
        try:
            typer.echo(f"volery {version('volery')}")
        except PackageNotFoundError:  # run from a checkout
            typer.echo("volery 0")
        raise typer.Exit


def _root(
    show_version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Model a drone-and-rover service once, simulate it, fly it, and know what it costs the computers."""


@cache
def application(word: str = "") -> typer.Typer:
    """Return the application.

    Args:
        word: First word of the command line. If the files whose names begin with it declare its commands,
            the other files are not imported.
    """
    app = typer.Typer(
        callback=_root,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode="markdown",
        context_settings={"help_option_names": list(HELP)},
    )
    files = [module.name for module in iter_modules(commands.__path__)]
    own = [file for file in files if file.split("_")[0] == word]
    found = [one for file in own for one in _declared(file)]
    if not any(one.has(word) for one in found):
        found = [one for file in files for one in _declared(file)]
    for one in found:
        one.add_to(app)
    app.registered_commands.sort(key=lambda one: [*FIRST_HOUR, one.name].index(one.name))
    return app


def _declared(file: str) -> list[Commands]:
    """Return what a file of commands declares."""
    module = import_module(f"{commands.__name__}.{file}")
    return [one for one in vars(module).values() if isinstance(one, Commands)]


@seldom_collected()
def main() -> None:
    """Run the command line of this process, with the defaults of the nearest configuration file.

    numpy computes with one thread, unless OPENBLAS_NUM_THREADS is set: results do not depend on the number of
    cores, and no thread waits for work, which takes as much processor time as numpy's import. A result that
    could not be printed, as on a full disk, is a failure; one that has no reader any more is none.
    """
    printed = outlive_output()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    atexit.register(gc.freeze)  # at its end Python looks for garbage in all that exists; nothing needs it
    words, remark = current_words(sys.argv[1:])
    if ROS_ARGUMENTS in words and "--" not in words:  # ros2 launch adds them, and they are no options
        words.insert(words.index(ROS_ARGUMENTS), "--")
    if remark:
        CommandOutput(quiet=not QUIET.isdisjoint(words)).note(remark)
    informs = not INFORMATION.isdisjoint(words)
    command = typer.main.get_command(application(next(iter(words), "")))
    configuration = Configuration()
    try:
        configuration = read_configuration(application, Path.cwd())
    except (UsageError, OSError) as error:
        CommandOutput().complain(f"volery: {error}")
        if words and not informs:
            raise SystemExit(BAD_INPUT) from None
    if not informs:
        for line in configuration.said(words):
            CommandOutput().note(line)
    try:
        command(words, prog_name="volery", default_map=configuration.defaults)
    finally:
        sys.stdout.flush()
        if printed is not None and printed.problem:
            CommandOutput().complain(f"volery: standard output cannot be written: {printed.problem}")
            raise SystemExit(FAILED)
