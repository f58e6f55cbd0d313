"""How a command is declared, called and ended.

A file in ``volery.cli.commands`` declares its commands with a ``Commands`` object, and one more for each
group such as ``volery bag``. ``volery.cli.main`` finds all of them, so a new command changes one file. They
import the library inside their functions: ``volery --help`` imports all of them and must stay quick. A file
with the name of its command or group, such as ``fly.py``, is the only one that this command imports.

A command is a function of an ``Output`` and of its options, and returns its exit status. The options that
control the output (``--quiet``, ``--json``, ``--debug``) are added here. Options that several commands share
are the fields of a dataclass: a parameter with that type stands for all of them.
"""

from __future__ import annotations

import errno
import inspect
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import is_dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import typer

from volery.base.errors import CapabilityError, EstimateError, ModelError, UsageError, VoleryError
from volery.base.installed import missing_extra
from volery.base.process import interrupted_by_signals
from volery.cli.console import Output
from volery.cli.options import Debug, Json, Quiet

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

OK, FAILED, BAD_INPUT, LEFT_OUT = 0, 1, 2, 3
"""Exit statuses. ``LEFT_OUT``: done, but for what the output names; ``--allow-loss`` makes it ``OK``."""

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)
"""A disk that is full or read-only is no fault of this program."""

BAD_INPUT_ERRORS = (ModelError, UsageError, EstimateError, CapabilityError)
"""Errors that the user corrects in a file or in the call."""

SECTIONS = ("First steps", "Simulate", "Fly", "ROS", "Cost of computing")
"""Headings of ``volery --help``, in order."""

OutputOption = Literal["quiet", "json", "debug"]
_OUTPUT_OPTIONS: dict[OutputOption, Any] = {"quiet": Quiet, "json": Json, "debug": Debug}

Command = TypeVar("Command", bound=Callable[..., int])


class Commands:
    """Commands of one file, at the top level or in a *group* such as ``volery bag``."""

    def __init__(self, section: str, *, group: str = "", summary: str = "") -> None:
        self.section, self.group, self.summary = section, group, summary
        self.members: list[tuple[str, Callable[..., None]]] = []

    def add(self, *options: OutputOption, name: str | None = None) -> Callable[[Command], Command]:
        """Register the decorated function as a command that takes these output options.

        Args:
            options: Which of ``quiet``, ``json`` and ``debug`` the command takes.
            name: Name of the command, by default that of the function.
        """

        def register(function: Command) -> Command:
            self.members.append(
                (name or function.__name__.replace("_", "-"), _command_line_function(function, options))
            )
            return function

        return register

    def has(self, word: str) -> bool:
        """Return whether *word* is the name of the group, or of a command at the top level."""
        return word == self.group or (not self.group and word in dict(self.members))

    def add_to(self, app: typer.Typer) -> None:
        """Add the commands to *app*."""
        target = app
        if self.group:
            known = (one.typer_instance for one in app.registered_groups if one.name == self.group)
            target = next(known, None) or typer.Typer(help=self.summary, no_args_is_help=True)
            if target not in [one.typer_instance for one in app.registered_groups]:
                app.add_typer(target, name=self.group, rich_help_panel=self.section)
            target.info.help = self.summary or target.info.help  # one of the group's files has the summary
        for name, function in self.members:
            target.command(name, rich_help_panel=None if self.group else self.section)(function)


def _command_line_function(
    function: Callable[..., int], options: tuple[OutputOption, ...]
) -> Callable[..., None]:
    """Return *function* as Typer calls it: output options for its ``output``, fields for its dataclasses."""
    signature = inspect.signature(function, eval_str=True)
    keyword = inspect.Parameter.KEYWORD_ONLY
    stated = [one.replace(kind=keyword) for one in signature.parameters.values() if one.name != "output"]
    groups = {
        one.name: one.annotation
        for one in stated
        if isinstance(one.annotation, type) and is_dataclass(one.annotation)
    }
    members = {name: inspect.signature(group, eval_str=True).parameters for name, group in groups.items()}
    own = [one for one in stated if one.name not in groups]
    own += [member.replace(kind=keyword) for shared in members.values() for member in shared.values()]

    def call(**arguments: Any) -> None:
        output = Output(**{option: arguments.pop(option) for option in options})
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
    call.__annotations__ = {one.name: one.annotation for one in parameters}
    call.__doc__ = function.__doc__
    return call


def exit_status(output: Output, command: Callable[[], int]) -> int:
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
