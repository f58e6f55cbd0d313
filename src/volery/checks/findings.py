"""``check``: everything that is wrong with a model, as findings; what the model suppresses is kept apart."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from volery.base.errors import ModelError
from volery.checks.ros_rules import ROS_RULES
from volery.checks.system_rules import SYSTEM_RULES
from volery.model import rules
from volery.model.builder import ModelBuilder
from volery.model.design import Suppression
from volery.model.reading import Vocabulary
from volery.model.rules import BrokenRule
from volery.model.system import System
from volery.model.system_loader import gaps, load
from volery.model.text import CollectedModelError
from volery.run.assembly.model_checks import check_components

FIDELITIES = ("times", "code")


@dataclass(frozen=True)
class CheckedModel:
    """The outcome of a check.

    ``system`` is the model as it stands, None if it cannot be read. ``suppressed`` are findings with the
    reason. ``missing`` states, for each fidelity, what the model lacks to run at it: that is no fault.
    """

    system: System | None
    findings: tuple[BrokenRule, ...]
    suppressed: tuple[tuple[BrokenRule, str], ...]
    missing: dict[str, tuple[BrokenRule, ...]]

    @property
    def errors(self) -> tuple[BrokenRule, ...]:
        """The findings that keep the model from running."""
        return tuple(finding for finding in self.findings if finding.rule.level == "error")


def check(path: Path | ModelBuilder, vocabulary: Vocabulary, overrides: Iterable[str] = ()) -> CheckedModel:
    """Check a model with each allocation and scenario; load its Python components, compile those in C++.

    Args:
        path: The model's file or its folder, or a model that was built in Python.
        vocabulary: Names that are defined outside the model.
        overrides: Changes ``path=value``.

    Raises:
        UsageError: an override is none.
    """
    options = tuple(overrides)
    found: dict[BrokenRule, None] = {}
    system = _loaded(path, vocabulary, None, None, options, found)
    if system is None:
        return CheckedModel(None, tuple(found), (), {})
    variants: list[tuple[str | None, str | None]] = [(None, name) for name in system.allocations[1:]]
    variants += [(name, None) for name in system.scenarios]
    systems = [_loaded(path, vocabulary, *variant, options, found) for variant in variants]
    for one in (system, *(system for system in systems if system is not None)):
        for rule in (*SYSTEM_RULES, *ROS_RULES):
            found.update(dict.fromkeys(rule(one)))
    found.update(dict.fromkeys(_code(system)))
    missing = {fidelity: tuple(_finding(gap) for gap in gaps(system, fidelity)) for fidelity in FIDELITIES}
    found.update(
        dict.fromkeys(one for listed in missing.values() for one in listed if _is_fault(one, system))
    )
    kept, suppressed = _suppress(tuple(found), system.suppressions)
    return CheckedModel(system, kept, suppressed, missing)


def _is_fault(gap: BrokenRule, system: System) -> bool:
    """Return whether a gap is a fault: an error, or a missing time of a component that states others."""
    name = gap.path.split(".")[1]
    component = next(instance.component for instance in system.instances if instance.component.name == name)
    has_times = bool(component.operations or component.activation)
    return gap.rule.level == "error" or (gap.rule is rules.MISSING_TIMES and has_times)


def _loaded(
    path: Path | ModelBuilder,
    vocabulary: Vocabulary,
    scenario: str | None,
    allocation: str | None,
    options: tuple[str, ...],
    found: dict[BrokenRule, None],
) -> System | None:
    """Return a variant of the model; None, with findings, if it is wrong."""
    try:
        system = load(path, vocabulary, scenario, allocation, options)
    except ModelError as error:
        found.update(dict.fromkeys(_findings(error)))
        return None
    found.update(dict.fromkeys(system.warnings))
    return system


def _findings(error: ModelError) -> Iterator[BrokenRule]:
    for one in error.errors if isinstance(error, CollectedModelError) else (error,):
        yield _finding(one)


def _finding(error: ModelError) -> BrokenRule:
    rule = rules.RULES.get(error.code, rules.WRONG_VALUE)
    return BrokenRule(rule, error.what, error.path, error.where)


def _code(system: System) -> Iterator[BrokenRule]:
    try:
        check_components(system)
    except ModelError as error:
        for one in error.errors if isinstance(error, CollectedModelError) else (error,):
            rule = rules.RULES.get(one.code, rules.CODE_MISMATCH)
            yield BrokenRule(rule, one.what, one.path, one.where)


def _suppress(
    found: tuple[BrokenRule, ...], suppressions: tuple[Suppression, ...]
) -> tuple[tuple[BrokenRule, ...], tuple[tuple[BrokenRule, str], ...]]:
    """Divide findings into those that are reported and those that the model suppresses, with the reason."""
    kept, suppressed, used = [], [], set()
    for finding in found:
        covering = [
            suppression
            for suppression in suppressions
            if finding.rule.suppressible and suppression.covers(finding)
        ]
        if covering:
            used.add(covering[0])
            suppressed.append((finding, covering[0].reason))
        else:
            kept.append(finding)
    for number, one in enumerate(suppressions):
        if one not in used:
            what = f"nothing is reported of {one.rule}{f' at {one.at}' if one.at else ''}"
            kept.append(BrokenRule(rules.IDLE_SUPPRESSION, what, f"suppress.{number}", one.where))
    return tuple(kept), tuple(suppressed)
