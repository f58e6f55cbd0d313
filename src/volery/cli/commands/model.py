"""``volery model``: a model without a run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from volery.base.errors import choices
from volery.cli.command import OK, Commands
from volery.cli.console import Output, make_table
from volery.cli.options import Allocation, Model, Overrides, Scenario

if TYPE_CHECKING:
    from volery.model.system import System

commands = Commands("Simulate", group="model", summary="Check and draw a model without running it.")

FIDELITIES = ("times", "code")


@commands.add("quiet", "json", "debug")
def check(output: Output, model: Model, overrides: Overrides = None) -> int:
    """Check a model with each of its allocations and scenarios, and load its Python components."""
    from volery.model.system_loader import check as check_model
    from volery.model.system_loader import gaps
    from volery.run.assembly.component_checks import check_components
    from volery.run.assembly.vocabulary import vocabulary

    words = vocabulary()
    system = check_model(model, words, overrides or ())
    check_components(system, words.languages)
    missing = {fidelity: [str(gap) for gap in gaps(system, fidelity, words)] for fidelity in FIDELITIES}
    warnings = [Text(f"⚠ {warning}", style="yellow") for warning in system.warnings]
    output.show(_summary(system), _instances(system), *_readiness(missing), *warnings)
    output.give(
        {
            "name": system.name,
            "allocations": list(system.allocations),
            "scenarios": list(system.scenarios),
            "instances": {one.name: one.component.name for one in system.instances},
            "requirements": [one.name for one in system.requirements],
            "missing": missing,
            "warnings": list(system.warnings),
        }
    )
    return OK


def _summary(system: System) -> Text:
    line = Text(system.name, style="bold")
    line.append("  is a valid model", style="green")
    allocations = choices(system.allocations).replace(" or ", " and ")
    scenarios = choices(system.scenarios).replace(" or ", " and ")
    line.append(f"  allocations: {allocations}  scenarios: {scenarios}", style="dim")
    return line


def _instances(system: System) -> Table:
    place = f"runs on ({system.allocation or 'nowhere'})"
    listed = make_table("instance", "component", "language", place, "connected to")
    for one in system.instances:
        targets = [str(target) for connection in one.connections.values() for target in connection.targets]
        where = one.processor or "environment"
        listed.add_row(one.name, one.component.name, one.component.language, where, ", ".join(targets))
    for vehicle in system.vehicles:
        node = f"node on {vehicle.processor}" if vehicle.processor else "no node on a computer"
        listed.add_row(vehicle.name, vehicle.kind, vehicle.autopilot, node, vehicle.at.name)
    return listed


def _readiness(missing: dict[str, list[str]]) -> Iterable[Text]:
    for fidelity, found in missing.items():
        if not found:
            yield Text(f"✓ ready for fidelity {fidelity}", style="green")
            continue
        yield Text(f"· not ready for fidelity {fidelity}:", style="yellow")
        for gap in found:
            yield Text(f"    {gap}", style="dim")


@commands.add("debug")
def show(
    output: Output,
    model: Model,
    allocation: Allocation = None,
    scenario: Scenario = None,
    overrides: Overrides = None,
) -> int:
    """Draw one variant of a model in text: allocation and connections."""
    from volery.model.diagram import diagram
    from volery.model.system_loader import load
    from volery.run.assembly.vocabulary import vocabulary

    system = load(model, vocabulary(), scenario, allocation, overrides or ())
    output.show(Text(diagram(system), end=""))
    return OK


@commands.add()
def schema(output: Output) -> int:
    """Print the JSON Schema of models, for an editor that completes and checks YAML."""
    from volery.model.document import schema as model_schema

    replace(output, json=True).give(model_schema())
    return OK


@commands.add("json")
def observables(output: Output) -> int:
    """List the observables that a requirement may bound."""
    from volery.requirements.observables import NOTED, OBSERVABLES

    listed = make_table("observe", "unit", "meaning")
    for one in (*OBSERVABLES, NOTED):
        subject = one.subject if one.subject in ("application", NOTED.subject) else f"<{one.subject}>"
        listed.add_row(f"{subject}.{one.quantity}", one.unit or "-", one.description)
    output.show(listed)
    output.give([asdict(one) for one in (*OBSERVABLES, NOTED)])
    return OK
