"""Findings as SARIF 2.1.0 (OASIS), the format in which editors and code hosts show results of checks."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from volery.checks.findings import CheckedModel
from volery.model.rules import RULES, BrokenRule

SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"


def sarif(checked: CheckedModel, model: Path) -> dict[str, Any]:
    """Return the log of one check.

    Args:
        checked: The findings.
        model: The model's file, the place of findings without a line.
    """
    results = [_result(finding, model) for finding in checked.findings]
    results += [
        {**_result(one, model), "suppressions": [{"kind": "inSource", "justification": reason}]}
        for one, reason in checked.suppressed
    ]
    driver: dict[str, Any] = {"name": "volery", "rules": _rules(one.rule.code for one in _all(checked))}
    with suppress(PackageNotFoundError):  # run from a checkout
        driver["version"] = version("volery")
    return {"$schema": SCHEMA, "version": "2.1.0", "runs": [{"tool": {"driver": driver}, "results": results}]}


def _all(checked: CheckedModel) -> list[BrokenRule]:
    return [*checked.findings, *(one for one, _ in checked.suppressed)]


def _rules(codes: Iterable[str]) -> list[dict[str, Any]]:
    return [
        {
            "id": code,
            "name": RULES[code].name,
            "shortDescription": {"text": RULES[code].title},
            "help": {"text": RULES[code].remedy},
            "defaultConfiguration": {"level": RULES[code].level},
        }
        for code in sorted(set(codes))
    ]


def _result(finding: BrokenRule, model: Path) -> dict[str, Any]:
    file = finding.where.file if finding.where is not None and finding.where.line else str(model)
    line = finding.where.line if finding.where is not None else 0
    place: dict[str, Any] = {"artifactLocation": {"uri": Path(file).as_posix()}}
    if line:
        place["region"] = {"startLine": line}
    location: dict[str, Any] = {"physicalLocation": place}
    if finding.path:
        location["logicalLocations"] = [{"fullyQualifiedName": finding.path}]
    return {
        "ruleId": finding.rule.code,
        "level": finding.rule.level,
        "message": {"text": f"{finding}. {finding.rule.remedy}"},
        "locations": [location],
    }
