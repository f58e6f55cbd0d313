"""``volery model``: check, schema, observables."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path

from rich.table import Table
from rich.text import Text

from volery.base.errors import choices
from volery.cli.console import Output, table
from volery.cli.endings import OK
from volery.model.diagram import diagram
from volery.model.document import schema
from volery.model.reader import check as check_model
from volery.model.reader import gaps, load
from volery.model.system import Instance, System
from volery.requirements.observables import OBSERVABLES
from volery.run.assembly.vocabulary import vocabulary

FIDELITIES = ("times", "code")


def check(output: Output, model: Path, overrides: tuple[str, ...]) -> int:
    """Check *model* in every variant; what is wrong is raised."""
    words = vocabulary()
    system = check_model(model, words, overrides)
    missing = {fidelity: [str(gap) for gap in gaps(system, fidelity, words)] for fidelity in FIDELITIES}
    doubts = [Text(f"⚠ {warning}", style="yellow") for warning in system.warnings]
    output.show(_summary(system), _instances(system), *_readiness(missing), *doubts)
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
    where_to = f"runs on ({system.allocation or 'nowhere'})"
    listed = table("instance", "component", "language", where_to, "connected to")
    for one in system.instances:
        where = one.processor or "environment"
        listed.add_row(one.name, one.component.name, one.component.language, where, ", ".join(_targets(one)))
    for vehicle in system.vehicles:
        node = f"node on {vehicle.processor}" if vehicle.processor else "no node on a computer"
        listed.add_row(vehicle.name, vehicle.kind, vehicle.autopilot, node, vehicle.at.name)
    return listed


def _targets(instance: Instance) -> Iterable[str]:
    for connection in instance.connections.values():
        for target in connection.targets:
            yield str(target)


def _readiness(missing: dict[str, list[str]]) -> Iterable[Text]:
    for fidelity, found in missing.items():
        if not found:
            yield Text(f"✓ ready for fidelity {fidelity}", style="green")
            continue
        yield Text(f"· not ready for fidelity {fidelity}:", style="yellow")
        for gap in found:
            yield Text(f"    {gap}", style="dim")


def show(
    output: Output,
    model: Path,
    allocation: str | None,
    scenario: str | None,
    overrides: tuple[str, ...],
) -> int:
    """Draw one variant of *model*."""
    system = load(model, vocabulary(), scenario, allocation, overrides)
    output.show(Text(diagram(system), end=""))
    return OK


def print_schema(output: Output) -> int:
    """The JSON Schema on standard output."""
    output.give(schema())
    return OK


def print_observables(output: Output) -> int:
    """The published list."""
    listed = table("observe", "unit", "what it is")
    for one in OBSERVABLES:
        subject = "application" if one.subject == "application" else f"<{one.subject}>"
        listed.add_row(f"{subject}.{one.quantity}", one.unit or "-", one.description)
    output.show(listed)
    output.give([asdict(one) for one in OBSERVABLES])
    return OK
