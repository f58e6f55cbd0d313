"""A model as SysML v2 text: components as part definitions, interfaces as port definitions.

What SysML v2 has no place for without a library of its own is returned as a list of notes. Quantities that
it has no unit for in its standard library are stated as text.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from volery.exchange.notes import (
    Note,
    Unmapped,
    connections,
    default_allocation,
    instances,
    note_rest,
    without_provenance,
)

_MANY = "[]"
_MAPPED = (
    "volery", "name", "description", "interfaces", "components", "application", "environment", "platform",
    "allocations", "requirements", "types",
)  # fmt: skip
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")
_SCALARS = {"str": "String", "bool": "Boolean", "int": "Integer", "float": "Real"}
_RESERVED_TEXT = """
about abstract accept action actor after alias all allocate allocation analysis and as assert assign assoc
assume at attribute bind binding bool by calc case comment concern connect connection constraint decide
def default defined dependency derived do doc else end entry enum event exhibit exit expose false filter
first flow for fork frame from hastype if implies import in include individual inout interface istype item
join language loop merge message meta metadata nonunique not null objective occurrence of or ordered out
package parallel part perform port private protected public readonly redefines ref references render
rendering rep require requirement return satisfy send snapshot specializes stakeholder standard state
subject subsets succession then timeslice to transition true until use variant variation verification
verify via view viewpoint when while xor
"""
_RESERVED = frozenset(_RESERVED_TEXT.split())


def name_text(text: str) -> str:
    """Return a name as SysML v2 writes it: in quotation marks unless it is a plain word."""
    if _PLAIN.match(text) and text not in _RESERVED:
        return text
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"


def sysml_text(tree: Mapping[str, Any]) -> tuple[str, tuple[Note, ...]]:
    """Return a model as a SysML v2 package, and notes on what is not in it."""
    unmapped = Unmapped()
    tree = without_provenance(tree, unmapped)
    note_rest(unmapped, tree, _MAPPED)
    lines = [
        f"package {name_text(str(tree.get('name', 'model')))} {{",
        *_indented(_head(tree)),
        *_indented(_interfaces(tree)),
        *_indented(_components(tree)),
        *_indented(_platform(tree, unmapped)),
        *_indented(_system(tree, unmapped)),
        *_indented(_requirements(tree)),
        "}",
    ]
    return "\n".join(lines) + "\n", tuple(Note(line) for line in unmapped.lines())


def _indented(lines: Iterator[str]) -> Iterator[str]:
    return (f"  {line}" if line else "" for line in lines)


def _head(tree: Mapping[str, Any]) -> Iterator[str]:
    if tree.get("description"):
        yield f"doc /* {_comment(tree['description'])} */"
    yield "private import ScalarValues::*;"
    for name, stated in (tree.get("types") or {}).items():
        if "values" in stated:
            literals = " ".join(f"enum {name_text(str(one))};" for one in stated["values"])
            yield f"enum def {name_text(name)} {{ {literals} }}"
            continue
        fields = [
            f"attribute {name_text(key)}{_typed(text)};" for key, text in stated.get("fields", {}).items()
        ]
        yield f"attribute def {name_text(name)} {{ {' '.join(fields)} }}"
    declared = {*(tree.get("types") or {}), *_SCALARS}
    for name in sorted(_types(tree) - declared):
        yield f"attribute def {name_text(name)};"


def _types(tree: Mapping[str, Any]) -> set[str]:
    texts = []
    for operations in (tree.get("interfaces") or {}).values():
        for signature in (operations or {}).values():
            stated = signature or {}
            texts += [*stated.get("args", {}).values(), stated.get("returns", "")]
    for component in (tree.get("components") or {}).values():
        for section in ("publishes", "subscribes"):
            texts += [str(one.get("type")) for one in (component.get(section) or {}).values()]
    for stated in (tree.get("types") or {}).values():
        texts += [str(one) for one in stated.get("fields", {}).values()]
    return {text.removesuffix(_MANY) for text in texts if text}


def _typed(text: str) -> str:
    base = text.removesuffix(_MANY)
    return f" : {name_text(_SCALARS.get(base, base))}{'[0..*]' if text.endswith(_MANY) else ''}"


def _interfaces(tree: Mapping[str, Any]) -> Iterator[str]:
    interfaces = dict(tree.get("interfaces") or {})
    for component in (tree.get("components") or {}).values():
        for one in (component.get("requires") or {}).values():
            interfaces.setdefault(str(one).removesuffix(_MANY), None)
    for name, operations in interfaces.items():
        if not operations:
            yield f"port def {name_text(name)};"
            continue
        yield f"port def {name_text(name)} {{"
        for operation, signature in operations.items():
            stated = signature or {}
            parameters = [
                f"in {name_text(one)}{_typed(text)};" for one, text in stated.get("args", {}).items()
            ]
            if stated.get("returns"):
                parameters.append(f"out returned{_typed(stated['returns'])};")
            body = f" {{ {' '.join(parameters)} }}" if parameters else ";"
            yield f"  action {name_text(operation)}{body}"
        yield "}"


def _components(tree: Mapping[str, Any]) -> Iterator[str]:
    for name, stated in (tree.get("components") or {}).items():
        yield f"part def {name_text(name)} {{"
        for key in ("language", "path"):
            if stated.get(key):
                yield f'  attribute {key} : String = "{stated[key]}";'
        for port, interface in (stated.get("provides") or {}).items():
            yield f"  port {name_text(port)} : {name_text(interface)};"
        for port, interface in (stated.get("requires") or {}).items():
            many = "[0..*]" if str(interface).endswith(_MANY) else ""
            yield f"  port {name_text(port)} : ~{name_text(str(interface).removesuffix(_MANY))}{many};"
        for section, way in (("publishes", "out"), ("subscribes", "in")):
            for topic, one in (stated.get(section) or {}).items():
                yield f"  {way} item {name_text(topic)}{_typed(str(one.get('type')))};"
        active = stated.get("active")
        for key, value in active.items() if isinstance(active, Mapping) else ():
            yield f"  attribute {name_text(key)} = {_value(value)};"
        yield from _times(stated)
        yield "}"


def _times(stated: Mapping[str, Any]) -> Iterator[str]:
    times = {"activation": stated.get("activation"), **(stated.get("operations") or {})}
    for name, figures in times.items():
        for number, figure in enumerate(
            figures if isinstance(figures, list) else [figures] if figures else []
        ):
            for key in ("best", "time", "worst", "energy"):
                if key in figure:
                    suffix = f"_{number + 1}" if number else ""
                    yield f"  attribute {name_text(f'{name}_{key}{suffix}')} = {_value(figure[key])};"


def _platform(tree: Mapping[str, Any], unmapped: Unmapped) -> Iterator[str]:
    platform = tree.get("platform") or {}
    processors = platform.get("processors") or {}
    for kind in dict.fromkeys(str(processor.get("is")) for processor in processors.values()):
        yield f"part def {name_text(kind)};"
    for kind in dict.fromkeys(
        str(one.get("kind")) for one in ((tree.get("environment") or {}).get("vehicles") or {}).values()
    ):
        yield f"part def {name_text(kind)} {{ port commands : {'Rover' if kind == 'rover' else 'Drone'}; }}"
    for section in platform.keys() - {"processors", "networks"}:
        unmapped.add(f"section `platform.{section}`")


def _system(tree: Mapping[str, Any], unmapped: Unmapped) -> Iterator[str]:
    platform = tree.get("platform") or {}
    vehicles = (tree.get("environment") or {}).get("vehicles") or {}
    yield "part system {"
    for name, stated in instances(tree).items():
        yield f"  part {name_text(name)} : {name_text(str(stated.get('is')))};"
    for name, stated in vehicles.items():
        yield f"  part {name_text(name)} : {name_text(str(stated.get('kind')))};"
    for name, stated in (platform.get("processors") or {}).items():
        attributes = [
            f"attribute {name_text(key)} = {_value(one)};" for key, one in stated.items() if key != "is"
        ]
        yield f"  part {name_text(name)} : {name_text(str(stated.get('is')))} {{ {' '.join(attributes)} }}"
    for name, stated in (platform.get("networks") or {}).items():
        attributes = [
            f"attribute {name_text(key)} = {_value(one)};" for key, one in stated.items() if key != "between"
        ]
        yield f"  part {name_text(name)} {{ {' '.join(attributes)} }}"
        for processor in stated.get("between", []):
            yield f"  connect {name_text(name)} to {name_text(processor)};"
    for name, port, target in connections(tree):
        other, _, provided = target.partition(".")
        if provided or other in vehicles:
            far = f"{name_text(other)}.{name_text(provided or 'commands')}"
            yield f"  connect {name_text(name)}.{name_text(port)} to {far};"
        else:
            unmapped.add("ports of the environment", f"{name}.{port}")
    known = {*instances(tree), *vehicles}
    for name, place in default_allocation(tree).items():
        if name in known and place in (platform.get("processors") or {}):
            yield f"  allocate {name_text(name)} to {name_text(place)};"
        else:
            unmapped.add("allocations to memory spaces and operating systems", name)
    yield "}"


def _requirements(tree: Mapping[str, Any]) -> Iterator[str]:
    for name, stated in (tree.get("requirements") or {}).items():
        relation, sign = ("max", "<=") if "max" in stated else ("min", ">=")
        text = f"{stated.get('observe')} {sign} {stated.get(relation)}"
        described = f"{stated['description']}: " if stated.get("description") else ""
        yield f"requirement {name_text(name)} {{ doc /* {_comment(described + text)} */ }}"


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return f"{value}"
    return '"' + str(value).replace("\\", "\\\\").replace('"', '\\"') + '"'


def _comment(text: str) -> str:
    return text.replace("*/", "* /")
