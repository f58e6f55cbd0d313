"""What a model says about itself: parameters that a design may vary, and rules that it suppresses."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any

from volery.base.errors import Location
from volery.model import rules
from volery.model.fields import AS_WRITTEN, TEXT, ListOf, MapOf, Record, Schema, Syntax, WrongValueError
from volery.model.reading import ModelReading
from volery.model.text import Path, TextNode


@dataclass(frozen=True, slots=True)
class DesignParameter:
    """A value of the model that a design may vary, and its choices (S3D's DseProcessorParameter)."""

    name: str
    paths: Annotated[
        tuple[str, ...],
        ListOf(TEXT, least=1, bare=True),
        "What it sets: paths such as `platform.processors.onboard.frequency`.",
    ]
    values: Annotated[tuple[Any, ...], ListOf(AS_WRITTEN, least=1), "Its choices."]
    description: Annotated[str, TEXT, "What it is for."] = ""
    where: Location | None = field(default=None, compare=False)


class _DesignParameter(Record):
    """A design parameter that sets values which the model has."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> DesignParameter:
        """See ``Syntax``."""
        made: DesignParameter = super().read(node, path, reading)
        for text in made.paths:
            steps: Path = tuple(text.split("."))
            if reading.stated.at(steps) is None and reading.root.at(steps) is None:
                what = f"there is no {text!r} in the model"
                reading.problems.add((*path, "paths"), what, rule=rules.BAD_CHANGE)
        return made


@dataclass(frozen=True, slots=True)
class Suppression:
    """A rule that is not reported, everywhere or below one path, and the reason."""

    rule: Annotated[str, TEXT, "Code or name of the rule, such as `V405` or `overload`."]
    reason: Annotated[str, TEXT, "Why the model breaks it."]
    at: Annotated[str, TEXT, "Path below which it is suppressed; everywhere if it is not given."] = ""
    where: Location | None = field(default=None, compare=False)

    def covers(self, finding: rules.BrokenRule) -> bool:
        """Return whether *finding* is suppressed by this."""
        rule = rules.find(self.rule)
        below = not self.at or finding.path == self.at or finding.path.startswith(f"{self.at}.")
        return finding.rule is rule and below


class _Suppression(Syntax):
    """A suppression of a rule that can be suppressed."""

    record = Record(Suppression)

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Suppression:
        """See ``Syntax``."""
        made: Suppression = self.record.read(node, path, reading)
        rule = rules.find(made.rule)
        if rule is None:
            names = [one.name for one in rules.RULES.values() if one.suppressible]
            reading.known((*path, "rule"), made.rule, "rule", names, rules.BAD_SUPPRESSION)
        elif not rule.suppressible:
            what = f"{rule.code} {rule.name} is an error: the model does not run with it"
            reading.problems.add((*path, "rule"), what, rule=rules.BAD_SUPPRESSION)
        if not made.reason.strip():
            raise WrongValueError("a reason is needed", rules.BAD_SUPPRESSION)
        return made

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return self.record.schema(definitions)


DESIGN_PARAMETERS = MapOf(_DesignParameter(DesignParameter), values_only=True)
SUPPRESSIONS = ListOf(_Suppression())
