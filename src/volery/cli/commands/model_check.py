"""``volery model check``, ``rules``, ``schema`` and ``observables``: what is right and wrong in a model."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from volery.base.errors import UsageError, choices
from volery.cli.command import BAD_INPUT, OK, Commands
from volery.cli.console import CommandOutput, make_table, number_column
from volery.cli.options import Model, Overrides

if TYPE_CHECKING:
    from pathlib import Path

    from volery.checks.findings import CheckedModel
    from volery.model.builder import ModelBuilder
    from volery.model.rules import BrokenRule
    from volery.model.system import System

commands = Commands("model", "Check, draw, analyse and convert models.")

FORMATS = ("text", "json", "sarif")
Format = Annotated[str, typer.Option("--format", metavar="text|json|sarif", help="Format of the findings.")]


@commands.add("quiet", "debug")
def check(output: CommandOutput, model: Model, overrides: Overrides = None, format_: Format = "text") -> int:
    """Check a model with each allocation and scenario; load its Python components, compile those in C++.

    The model may be a .uml file. The exit status is 2 if a finding keeps the model from running, else 0.
    """
    if format_ not in FORMATS:
        raise UsageError(f"--format {format_}: give {choices(FORMATS)}")
    from volery.checks.findings import check as check_model
    from volery.checks.sarif import sarif
    from volery.exchange.convert import uml_model
    from volery.model.assembly import model_file
    from volery.model.rules import NOT_MAPPED, BrokenRule
    from volery.run.assembly.model_checks import vocabulary

    words = vocabulary()
    notes: tuple[BrokenRule, ...] = ()
    source: Path | ModelBuilder = model
    if model.suffix == ".uml":
        source, unmapped = uml_model(model, words.processors)
        notes = tuple(BrokenRule(NOT_MAPPED, one.what, one.element, one.where) for one in unmapped)
    checked = check_model(source, words, overrides or ())
    checked = replace(checked, findings=(*notes, *checked.findings))
    if format_ == "text":
        _show(output, checked)
    else:
        data = _data(checked) if format_ == "json" else sarif(checked, model_file(model))
        output.results.print(json.dumps(data, indent=2, ensure_ascii=False), highlight=False, soft_wrap=True)
    return BAD_INPUT if checked.errors else OK


@commands.add("json")
def rules(output: CommandOutput) -> int:
    """List the rules that a model is checked against."""
    from volery.model.rules import RULES

    listed = make_table("code", "name", "level", "what it finds", "remedy")
    for one in RULES.values():
        listed.add_row(one.code, one.name, one.level, one.title, one.remedy)
    output.show(listed)
    output.give(
        [
            {"code": one.code, "name": one.name, "level": one.level, "title": one.title, "remedy": one.remedy}
            for one in RULES.values()
        ]
    )
    return OK


def _show(output: CommandOutput, checked: CheckedModel) -> None:
    for one in checked.findings:
        if one.rule.level == "error":
            output.complain(f"volery: {_line(one)}")
    system = checked.system
    if system is not None and not checked.errors:
        output.show(_summary(system), _instances(system), *_hovers(system), *_readiness(checked.missing))
    said = [
        Text(f"⚠ {_line(finding)}", style="yellow")
        for finding in checked.findings
        if finding.rule.level == "warning"
    ]
    said += [
        Text(f"· suppressed: {_line(one)} ({reason})", style="dim") for one, reason in checked.suppressed
    ]
    for line in () if output.quiet else said:
        output.results.print(line, soft_wrap=True)  # editors read the place from its beginning


def _line(one: BrokenRule) -> str:
    where = f"{one.where}: " if one.where is not None else ""
    return f"{where}{one} [{one.rule.code} {one.rule.name}]"


def _data(checked: CheckedModel) -> dict[str, Any]:
    system = checked.system
    described: dict[str, Any] = {}
    if system is not None:
        described = {
            "name": system.name,
            "allocations": list(system.allocations),
            "scenarios": list(system.scenarios),
            "instances": {instance.name: instance.component.name for instance in system.instances},
            "requirements": [requirement.name for requirement in system.requirements],
            "missing": {key: [_line(one) for one in found] for key, found in checked.missing.items()},
        }
    return {
        **described,
        "findings": [_record(finding) for finding in checked.findings],
        "suppressed": [{**_record(one), "reason": reason} for one, reason in checked.suppressed],
    }


def _record(one: BrokenRule) -> dict[str, Any]:
    return {
        "code": one.rule.code,
        "rule": one.rule.name,
        "level": one.rule.level,
        "message": one.what,
        "remedy": one.rule.remedy,
        "path": one.path,
        "file": one.where.file if one.where is not None else "",
        "line": one.where.line if one.where is not None else 0,
    }


def _summary(system: System) -> Text:
    line = Text(system.name, style="bold")
    line.append(" is a valid model", style="green")
    allocations = choices(system.allocations).replace(" or ", " and ")
    scenarios = choices(system.scenarios).replace(" or ", " and ")
    line.append(f"  allocations: {allocations}  scenarios: {scenarios}", style="dim")
    return line


def _instances(system: System) -> Table:
    place = f"runs on ({system.allocation or 'nowhere'})"
    listed = make_table("instance", "component", "language", place, "connected to")
    for instance in system.instances:
        targets = [
            str(target) for connection in instance.connections.values() for target in connection.targets
        ]
        where = instance.processor or "environment"
        listed.add_row(
            instance.name, instance.component.name, instance.component.language, where, ", ".join(targets)
        )
    for vehicle in system.vehicles:
        node = f"node on {vehicle.processor}" if vehicle.processor else "no node on a computer"
        listed.add_row(vehicle.name, vehicle.kind, vehicle.autopilot, node, vehicle.at.name)
    return listed


def _hovers(system: System) -> Iterable[Table]:
    """Yield what the airframes of the model give in hover."""
    from volery.analysis.budgets import hovers

    listed = make_table(
        "in hover",
        "frame",
        number_column("mass"),
        number_column("throttle"),
        number_column("power"),
        number_column("for"),
        "until the charge left is",
    )
    for hover in hovers(system):
        figures = f"{hover.mass_kg:.4g} kg", f"{hover.throttle:.0%}", f"{hover.watts:.0f} W"
        listed.add_row(
            hover.vehicle, hover.frame, *figures, f"{hover.seconds / 60.0:.1f} min", f"{hover.reserve:.0%}"
        )
    if listed.row_count:
        yield listed


def _readiness(missing: dict[str, tuple[BrokenRule, ...]]) -> Iterable[Text]:
    for fidelity, found in missing.items():
        if not found:
            yield Text(f"✓ ready for fidelity {fidelity}", style="green")
            continue
        yield Text(f"· not ready for fidelity {fidelity}:", style="yellow")
        for gap in found:
            yield Text(f"    {gap.where}: {gap}", style="dim")


@commands.add()
def schema(output: CommandOutput) -> int:
    """Print the JSON Schema of models, for an editor that completes and checks YAML."""
    from volery.model.document import schema as model_schema

    replace(output, json=True).give(model_schema())
    return OK


@commands.add("json")
def observables(output: CommandOutput) -> int:
    """List the observables that a requirement may bound."""
    from volery.model.reading import NOTE_PREFIX
    from volery.requirements.observables import NOTED, all_observables

    known = (*all_observables(), *NOTED)
    listed = make_table("observe", "unit", "meaning")
    for one in known:
        subject = one.subject if one.subject in ("application", NOTE_PREFIX) else f"<{one.subject}>"
        listed.add_row(f"{subject}.{one.quantity}", one.unit or "-", one.description)
    output.show(listed)
    output.give([asdict(one) for one in known])
    return OK
