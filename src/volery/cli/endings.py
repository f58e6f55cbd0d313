"""How a command ends: exit status 0, 1 or 2, and one clear message instead of a traceback."""

from __future__ import annotations

from collections.abc import Callable

import typer

from volery.base.errors import CapabilityError, EstimateError, ModelError, UsageError, VoleryError
from volery.cli.console import Output
from volery.cli.interrupts import insisted_on

OK, FAILED, BAD_INPUT = 0, 1, 2

BAD_INPUTS = (ModelError, UsageError, EstimateError, CapabilityError)
"""What was asked for makes no sense or is not there: the file or the call must change."""


def run_command(output: Output, command: Callable[[], int]) -> None:
    """Do it and leave with its exit status."""
    raise typer.Exit(status_of(output, command))


def status_of(output: Output, command: Callable[[], int]) -> int:
    """The exit status of *command*; what it raises is told."""
    try:
        with insisted_on():
            return command()
    except VoleryError as error:
        if output.debug:
            output.notes.print_exception()
        output.complain(f"volery: {error}")
        return BAD_INPUT if isinstance(error, BAD_INPUTS) else FAILED
    except KeyboardInterrupt:
        output.complain("volery: interrupted")
        return FAILED
    except Exception as error:
        if output.debug:
            output.notes.print_exception()
        output.complain(
            f"volery: a fault of volery itself: {type(error).__name__}: {error}\n"
            "  --debug shows where; please report it with the command that you gave"
        )
        return FAILED
