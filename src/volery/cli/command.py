"""How a command is declared, called and ended.

The first word of a command line is a noun or one of a few verbs, and the words below a noun are its verbs:
``volery vehicle params get``. A file in ``volery.cli.commands`` declares its commands with a ``Commands``
object for each noun. ``volery.cli.main`` finds all of them, so a new command changes one file. They import
the library inside their functions: ``volery --help`` imports all of them and must stay quick. A command
imports the files that begin with its first word, such as ``cost.py`` and ``cost_calibrate.py``, and no other.

A command is a function of a ``CommandOutput`` and of its options, and returns its exit status. The options
that control the output (``--quiet``, ``--json``, ``--debug``) are added here. Options that several commands
share are the fields of a dataclass: a parameter with that type stands for all of them.
"""

from __future__ import annotations

import errno
import inspect
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import typer
from typer.core import TyperGroup

from volery.base.errors import (
    CapabilityError,
    EstimateError,
    ModelError,
    UsageError,
    VoleryError,
    did_you_mean,
)
from volery.base.installed import missing_extra
from volery.base.process import interrupted_by_signals
from volery.cli.console import CommandOutput
from volery.cli.options import Debug, Json, Quiet

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

OK, FAILED, BAD_INPUT, LEFT_OUT = 0, 1, 2, 3
"""Exit statuses. ``LEFT_OUT``: done, but for what the output names; ``--allow-loss`` makes it ``OK``."""

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)
"""A disk that is full or read-only is no fault of this program."""

BAD_INPUT_ERRORS = (ModelError, UsageError, EstimateError, CapabilityError)
"""Errors that the user corrects in a file or in the call."""

FIRST_HOUR = ("demo", "simulate", "fly")
"""What ``volery --help`` shows first, under a heading of its own."""
HEADINGS = "The first hour", "More"

HELP = ("-h", "--help")

OutputOption = Literal["quiet", "json", "debug"]
_OUTPUT_OPTIONS: dict[OutputOption, Any] = {"quiet": Quiet, "json": Json, "debug": Debug}

Command = TypeVar("Command", bound=Callable[..., int])


class Noun(TyperGroup):
    """Commands below a noun. One with the noun's own name is what the noun does without a verb.

    ``volery cost FILE`` is the command ``cost`` of the noun ``cost``, and ``volery cost profile`` another.
    """

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.own = self.commands.pop(self.name or "", None)

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """Parse *args* as those of the noun's own command, unless a verb or the wish for help begins them."""
        completing = bool(extra.get("resilient_parsing"))
        if self.own is not None and self._are_of(self.own, args, completing=completing):
            return self.own.make_context(info_name, args, parent, **extra)
        return super().make_context(info_name, args, parent, **extra)

    def _are_of(self, own: Any, args: list[str], *, completing: bool) -> bool:
        if not args:
            return not completing and not any(param.required for param in own.params)
        word = args[0]
        misspelt = word.isalpha() and did_you_mean(word, self.commands) and not Path(word).exists()
        return not misspelt and word not in {*self.commands, *HELP}

    def described(self) -> Noun:
        """Return the noun as help shows it: with the arguments and options of its own command."""
        if self.own is None:
            return self
        shown = copy(self)
        shown.params, shown.help = [*self.own.params, *self.params], self.own.help
        shown.subcommand_metavar = "| COMMAND [ARGS]..."
        return shown

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Show the noun's own command above the others."""
        TyperGroup.format_help(self.described(), ctx, formatter)

    def shell_complete(self, ctx: Any, incomplete: str) -> Any:
        """Offer the verbs, and the options of the noun's own command."""
        return TyperGroup.shell_complete(self.described(), ctx, incomplete)


class Commands:
    """Commands of one file, at the top level or below a noun.

    Args:
        noun: Words before the command, such as ``ros bag``; empty at the top level.
        summary: What the commands of the noun do. One of its files states it.
    """

    def __init__(self, noun: str = "", summary: str = "") -> None:
        self.noun, self.summary = noun, summary
        self.members: list[tuple[str, Callable[..., None]]] = []

    def add(self, *options: OutputOption, name: str | None = None) -> Callable[[Command], Command]:
        """Register the decorated function as a command that takes these output options.

        Args:
            options: Which of ``quiet``, ``json`` and ``debug`` the command takes.
            name: Name of the command, by default that of the function. That of the noun stands for what
                the noun does without a verb.
        """

        def register(function: Command) -> Command:
            self.members.append(
                (name or function.__name__.replace("_", "-"), _command_line_function(function, options))
            )
            return function

        return register

    def has(self, word: str) -> bool:
        """Return whether *word* is the first word of the commands."""
        return word in (self.noun.split()[:1] or dict(self.members))

    def add_to(self, app: typer.Typer) -> None:
        """Add the commands to *app*."""
        for noun in self.noun.split():
            app = _below(app, noun)
        if self.summary:
            app.info.help = self.summary
        for name, function in self.members:
            heading = None if self.noun else HEADINGS[name not in FIRST_HOUR]
            app.command(name, rich_help_panel=heading)(function)


def _below(app: typer.Typer, noun: str) -> typer.Typer:
    """Return the part of *app* for what stands below *noun*, a new one if there is none."""
    for group in app.registered_groups:
        if group.name == noun and group.typer_instance is not None:
            return group.typer_instance
    made = typer.Typer(cls=Noun, no_args_is_help=True)
    app.add_typer(made, name=noun, rich_help_panel=HEADINGS[1] if app.info.callback else None)
    return made


def _command_line_function(
    function: Callable[..., int], options: tuple[OutputOption, ...]
) -> Callable[..., None]:
    """Return *function* as Typer calls it: output options for its ``output``, fields for its dataclasses."""
    signature = inspect.signature(function, eval_str=True)
    keyword = inspect.Parameter.KEYWORD_ONLY
    stated = [
        parameter.replace(kind=keyword)
        for parameter in signature.parameters.values()
        if parameter.name != "output"
    ]
    groups = {
        one.name: one.annotation
        for one in stated
        if isinstance(one.annotation, type) and is_dataclass(one.annotation)
    }
    members = {name: inspect.signature(group, eval_str=True).parameters for name, group in groups.items()}
    own = [one for one in stated if one.name not in groups]
    own += [member.replace(kind=keyword) for shared in members.values() for member in shared.values()]

    def call(**arguments: Any) -> None:
        output = CommandOutput(**{option: arguments.pop(option) for option in options})
        for name, group in groups.items():
            arguments[name] = group(**{member: arguments.pop(member) for member in members[name]})
        raise typer.Exit(exit_status(output, lambda: function(output, **arguments)))

    added = [
        inspect.Parameter(
            option, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=_OUTPUT_OPTIONS[option]
        )
        for option in options
    ]
    parameters = own + added
    call.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]  # read by inspect.signature
    call.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    call.__doc__ = function.__doc__
    return call


def exit_status(output: CommandOutput, command: Callable[[], int]) -> int:
    """Call *command* and return its exit status; an exception becomes a message and a status.

    SIGTERM and SIGHUP end every command as Ctrl-C does, unless it takes them itself.
    """
    try:
        with interrupted_by_signals(), resend_lost_interrupts():
            return command()
    except VoleryError as error:
        if output.debug:
            output.notes.print_exception()
        output.complain(f"volery: {error}")
        return BAD_INPUT if isinstance(error, BAD_INPUT_ERRORS) else FAILED
    except KeyboardInterrupt:
        output.complain("volery: interrupted")
        return FAILED
    except Exception as error:
        if output.debug:
            output.notes.print_exception()
        missing = missing_extra(error) if isinstance(error, ModuleNotFoundError) else None
        if missing is not None:
            output.complain(f"volery: {missing}")
            return BAD_INPUT
        if isinstance(error, OSError) and error.errno in NO_ROOM:
            output.complain(f"volery: {error.filename or 'a file'} cannot be written: {error.strerror}")
            return FAILED
        output.complain(
            f"volery: internal error: {type(error).__name__}: {error}\n"
            "  --debug shows where. Please report it together with the command."
        )
        return FAILED


RESEND_AFTER_S = 0.05
"""Seconds after which a lost Ctrl-C is sent again: the callback that lost it has returned by then."""


@contextmanager
def resend_lost_interrupts() -> Iterator[None]:
    """Send SIGINT again when a Ctrl-C is lost in a callback that cannot raise.

    numba's compiler calls back into Python from C code. A ``KeyboardInterrupt`` that is raised there is
    reported as unraisable and dropped.
    """
    before = sys.unraisablehook

    def hook(lost: UnraisableHookArgs) -> None:
        if lost.exc_type is KeyboardInterrupt:
            main = threading.main_thread().ident or 0
            threading.Timer(RESEND_AFTER_S, signal.pthread_kill, (main, signal.SIGINT)).start()
        else:
            before(lost)

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before
