"""Design parameters: S3D's «DseProcessorParameter» on processors, with the choices of a frequency."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from volery.exchange.uml.context import Export, Import
from volery.exchange.uml.notations import UNITS, split_figure
from volery.exchange.uml.xmi import tag, tags, xmi_id
from volery.exchange.xml_text import Element

_HEAD, _TAIL = "platform.processors.", ".frequency"
MOST_STEPS = 1000
"""Choices that a range from ``min`` to ``max`` may have."""


def read_design_parameters(imp: Import) -> None:
    """Read the choices of frequencies; other parameters are noted."""
    for comment in imp.file.with_stereotype("DseProcessorParameter"):
        applied = imp.file.stereotype(comment, "DseProcessorParameter")
        annotated = [imp.names.get(each, "") for each in imp.file.references(comment, "annotatedElement")]
        processors = imp.tree.get("platform", {}).get("processors", {})
        paths = [f"{_HEAD}{name}{_TAIL}" for name in annotated if name in processors]
        values = _values(applied)
        if tag(applied, "parameter") != "frequency" or not paths or not values:
            imp.note(
                comment, "a design parameter that is no choice of a processor's frequency; it is left out"
            )
            continue
        parameters = imp.section("design_parameters")
        name = str(
            imp.annotation(comment).get("name") or tag(applied, "name") or f"parameter_{len(parameters) + 1}"
        )
        imp.finish(f"design:{name}", comment)
        parameters[name] = {"paths": paths if len(paths) > 1 else paths[0], "values": values}


def _values(applied: Element) -> list[str]:
    symbol = tag(applied, "unit")
    unit = UNITS.get(symbol, symbol)
    items = tags(applied, "items")
    if not items:
        try:
            least, most, step = (float(tag(applied, name)) for name in ("min", "max", "step"))
        except ValueError:
            return []
        count = (most - least) / step if step > 0 else -1.0
        items = (
            [f"{least + number * step:g}" for number in range(int(count + 1e-9) + 1)]
            if 0 <= count < MOST_STEPS
            else []
        )
    return [f"{item} {unit}" for item in items]


def write_design_parameters(exp: Export, model: Element, tree: Mapping[str, Any]) -> dict[str, Any]:
    """Write the choices of frequencies; return the design parameters that S3D has no place for."""
    rest: dict[str, Any] = {}
    for name, stated in (tree.get("design_parameters") or {}).items():
        listed = stated.get("paths", [])
        paths = listed if isinstance(listed, list) else [listed]
        processors = [str(path).removeprefix(_HEAD).removesuffix(_TAIL) for path in paths]
        targets = [exp.made.get(f"processor:{processor}") for processor in processors]
        try:
            split = [split_figure(str(value)) for value in stated.get("values", [])]
        except ValueError:
            split = []
        units = {unit for _, unit in split}
        known = {"paths", "values"} >= stated.keys()
        if None in targets or len(units) != 1 or not units <= {"THz", "GHz", "MHz", "KHz"} or not known:
            rest[name] = stated
            continue
        key = f"design:{name}"
        before = exp.known.get(key)
        if (
            before is not None
            and _values(exp.file.stereotype(before, "DseProcessorParameter")) == stated["values"]
        ):
            exp.made[key] = before  # a range stays a range
            continue
        comment = exp.comment(key, model, "", " ".join(xmi_id(target) for target in targets))
        items = [number for number, _ in split]
        exp.apply(
            key,
            comment,
            "Comment",
            "DseProcessorParameter",
            name=name,
            parameter="frequency",
            unit=units.pop(),
            items=items,
            min="",
            max="",
            step="",
        )
    return rest
