"""``volery model``: a model without a run."""

from __future__ import annotations

from volery.cli.console import Output
from volery.cli.endings import run_command
from volery.cli.options import Allocation, Debug, Json, Model, Overrides, Quiet, Scenario


def check(
    model: Model,
    overrides: Overrides = None,
    as_json: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Check a model with each of its allocations and scenarios."""
    from volery.cli import model as command

    output = Output(quiet, as_json, debug)
    run_command(output, lambda: command.check(output, model, tuple(overrides or ())))


def show(
    model: Model,
    allocation: Allocation = None,
    scenario: Scenario = None,
    overrides: Overrides = None,
    debug: Debug = False,
) -> None:
    """Draw a model in text: what runs on what, what is connected to what."""
    from volery.cli import model as command

    output = Output(False, False, debug)
    run_command(output, lambda: command.show(output, model, allocation, scenario, tuple(overrides or ())))


def schema() -> None:
    """Print the JSON Schema of models: give it to your editor."""
    from volery.cli import model as command

    output = Output(False, True, False)
    run_command(output, lambda: command.print_schema(output))


def observables(as_json: Json = False) -> None:
    """List what requirements may bound."""
    from volery.cli import model as command

    output = Output(False, as_json, False)
    run_command(output, lambda: command.print_observables(output))
