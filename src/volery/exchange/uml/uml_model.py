"""A whole UML model to a model of volery, and back: the views in the order in which they need each other."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

from volery.base.errors import Location, ModelError
from volery.exchange.notes import Note
from volery.exchange.uml import (
    allocation_view,
    analysis_view,
    components_view,
    design_view,
    instances_view,
    interfaces_view,
    platform_view,
)
from volery.exchange.uml.context import Export, Import, empty_file
from volery.exchange.uml.notations import properties
from volery.exchange.uml.stereotypes import NAMESPACES, PROFILES
from volery.exchange.uml.xmi import ReadPart, XmiFile, local, parse
from volery.exchange.xml_text import Element
from volery.model.builder import plain_node
from volery.model.document import Document, EnvironmentText
from volery.model.fields import entries
from volery.model.text import Path, TextNode
from volery.model.text import parse as parse_yaml

_BOUND = re.compile(r"\{?\s*(\S+)\s*(<=|>=|≤|≥)\s*(.+?)\s*\}?\s*\Z")
_RELATIONS = {"max": "<=", "min": ">="}
_ELSEWHERE = ("interfaces", "types", "components", "application", "platform", "memory_spaces", "allocations")


@dataclass(frozen=True)
class Imported:
    """What an import has made: the tree of the model, notes, and the elements that were understood."""

    tree: dict[str, Any]
    notes: tuple[Note, ...]
    file: XmiFile
    keys: Mapping[str, Element] = field(repr=False, default_factory=dict)


def import_uml(
    data: bytes,
    name: str,
    rebase: components_view.Rebase = str,
    catalogue: Iterable[str] = (),
    processors: Mapping[str, str] | None = None,
    read_part: ReadPart | None = None,
) -> Imported:
    """Return the model of a .uml file.

    Args:
        data: The bytes of the file.
        name: Its name in messages.
        rebase: Makes a path of the file relative to the folder of the model.
        catalogue: Names of the processors of the catalogue.
        processors: The processor of the catalogue that each processor of the file is, by its name there.
        read_part: Reads the submodels that are in other files.

    Raises:
        ModelError: it is no UML model, or nothing in it is a component.
    """
    imp = Import(parse(data, name, read_part))
    model = imp.file.model
    imp.tree = {"volery": 1, "name": str(model.get("name") or PurePath(name).stem)}
    imp.tree |= imp.annotation(model)
    description = _description(imp, model)
    if description:
        imp.tree["description"] = description
    interfaces_view.read_types(imp)
    interfaces_view.read_interfaces(imp)
    components_view.read_components(imp, rebase)
    kinds = {one.lower(): one for one in catalogue}
    kinds |= {one.lower(): kind for one, kind in (processors or {}).items()}
    platform_view.read_platform(imp, kinds)
    instances_view.read_instances(imp)
    analysis_view.read_analysis(imp)
    _add_instances(imp)
    allocation_view.read_allocations(imp)
    design_view.read_design_parameters(imp)
    _read_packages(imp)
    _read_statements(imp)
    _add_references(imp)
    _note_what_is_left(imp)
    if not imp.tree.get("components"):
        raise ModelError(_nothing(imp), "", Location(name, 1))
    return Imported(_ordered(imp.tree), tuple(imp.notes), imp.file, imp.keys)


def _ordered(tree: dict[str, Any]) -> dict[str, Any]:
    """Return the tree in the order of the reference, instances with their ports first."""
    instances = [tree.get("application", {})]
    if "environment" in tree:
        world = {key: value for key, value in tree["environment"].items() if key == "world"}
        tree["environment"] = world | _in_order(tree["environment"], EnvironmentText)
        instances.append(tree["environment"].get("components", {}))
    for section in instances:
        for name, stated in section.items():
            ports = tree.get("components", {}).get(stated["is"], {}).get("requires", {})
            order = ["is", *(port for port in ports if port in stated)]
            section[name] = {key: stated[key] for key in order} | stated
    return {key: value for key, value in _in_order(tree, Document).items() if value != {}}


def _in_order(section: Mapping[str, Any], cls: type[Any]) -> dict[str, Any]:
    known = [entry.key for entry in entries(cls)]
    return {key: section[key] for key in known if key in section} | dict(section)


def _description(imp: Import, model: Element) -> str:
    for each in model:
        if local(each) == "ownedComment" and not each.get("annotatedElement"):
            body = components_view.body_of(each)
            if not properties(body) and not imp.file.applied.get(each):
                imp.finish("description", each)
                return body
    return ""


def _read_packages(imp: Import) -> None:
    """Record the packages that an export puts things into, so that it finds them again."""
    for element in imp.file.elements("Package", "Component"):
        stated = imp.annotation(element)
        if "holds" in stated:
            imp.finish(str(stated["holds"]), element)
        if "scenario" in stated:
            name = imp.name(element)
            imp.section("scenarios")[name] = stated["scenario"]
            imp.finish(f"scenario:{name}", element)


def _read_statements(imp: Import) -> None:
    """Read requirements from constraints and chains from end-to-end flows."""
    for element in imp.file.with_stereotype("NfpConstraint", "NfpConstraint_Contrex"):
        specification = next((each for each in element if local(each) == "specification"), None)
        text = str(specification.get("value", "")) if specification is not None else ""
        if specification is not None and not text:
            text = next((each.text or "" for each in specification if local(each) == "body"), "")
        bound = _BOUND.match(text)
        if bound is None:
            imp.note(
                element, f"{text!r} is no bound such as `drone_1.landing_offset <= 0.5 m`; it is left out"
            )
            continue
        requirements = imp.section("requirements")
        name = imp.name(element, requirements)
        relation = "max" if bound.group(2) in ("<=", "≤") else "min"
        value = imp.annotation(element)
        limit = parse_yaml(bound.group(3), name).plain()
        requirements[name] = {"observe": bound.group(1), relation: limit, **value}
        imp.finish(f"requirement:{name}", element)
    for element in imp.file.with_stereotype("SaEndtoEndFlow"):
        topics = imp.annotation(element).get("topics")
        if isinstance(topics, list):
            name = imp.name(element)
            imp.section("chains")[name] = topics
            imp.finish(f"chain:{name}", element)
        else:
            imp.note(element, "an end-to-end flow; a model needs the topics of a chain")


def _add_references(imp: Import) -> None:
    """State where the times of a component were taken, where the file does not: at its first instance."""
    allocations = imp.tree.get("allocations") or {}
    places: dict[str, str] = next(iter(allocations.values()), {})
    processors = imp.tree.get("platform", {}).get("processors", {})
    for name, component in (imp.tree.get("components") or {}).items():
        figures = [*_listed(component.get("activation"))]
        figures += [one for each in component.get("operations", {}).values() for one in _listed(each)]
        if "at" in component or all("at" in figure for figure in figures):
            continue
        instances = [one for one, stated in imp.tree.get("application", {}).items() if stated["is"] == name]
        place = _processor_of(next(iter(instances), ""), places, processors)
        kind = processors.get(place, {})
        if "frequency" in kind:
            component["at"] = {"processor": kind["is"], "frequency": kind["frequency"]}
        else:
            element = imp.keys.get(f"component:{name}", imp.file.model)
            imp.remark(
                element,
                f"{name}: no processor is known that its times were taken at; add `at` to the component",
            )


def _listed(stated: Any) -> list[dict[str, Any]]:
    return stated if isinstance(stated, list) else [stated] if stated else []


def _processor_of(name: str, places: Mapping[str, str], processors: Mapping[str, Any]) -> str:
    for _ in range(len(places) + 1):
        if name in processors:
            return name
        name = places.get(name, "")
    return ""


def _add_instances(imp: Import) -> None:
    """Add an instance of each component where the file has no instances at all, as plain UML may."""
    if imp.tree.get("application") or (imp.tree.get("environment") or {}).get("components"):
        return
    components = imp.tree.get("components") or {}
    for name in components:
        instance = name.lower() if name.lower() not in components else f"{name}_1"
        imp.section("application")[instance] = {"is": name}


def _stereotypes(imp: Import) -> Counter[str]:
    applied = (one for listed in imp.file.applied.values() for one in listed)
    unknown = (local(one) for one in imp.file.strange)
    return Counter([*(one.name for one in applied), *unknown])


def _nothing(imp: Import) -> str:
    """Return why an import makes no model: what there is in the file, and what would be needed."""
    counts = _stereotypes(imp)
    there = ", ".join(f"{name} {count}" for name, count in counts.most_common()) or "none"
    return (
        f"nothing in it is a component. Its stereotypes: {there}. A model needs UML components with ports or "
        "interfaces, «RtUnit» or «PpUnit», or steps with times («GaStep», «PaStep») in activities or "
        "interactions; was it saved with its profiles?"
    )


def _note_what_is_left(imp: Import) -> None:
    known = imp.file.asked.union(*(one.stereotypes for one in PROFILES.values()))
    for name, count in _stereotypes(imp).most_common():
        if name not in known and not any(local(one) == name for one in imp.file.strange):
            first = next(one for one in imp.file.applied if imp.file.has(one, name))
            times = "once" if count == 1 else f"{count} times"
            imp.note(first, f"«{name}», applied {times}, has no counterpart in a model and is left out")
    for element, target in imp.file.dangling:
        imp.note(element, f"it refers to {target!r}, which does not exist in this file")
    for element in imp.file.doubled:
        imp.note(element, "another element has its id; references mean the first one")
    for element in imp.file.strange:
        imp.note(element, "a stereotype of a profile that is not read; it stays in the file")


_SECTIONS: Mapping[str, tuple[Path, ...]] = {
    "interface": (("interfaces",),),
    "type": (("types",),),
    "component": (("components",),),
    "instance": (("application",), ("environment", "components"), ("environment", "vehicles")),
    "memory": (("memory_spaces",),),
    "os": (("platform", "operating_systems"),),
    "processor": (("platform", "processors"),),
    "device": (("platform", "devices"),),
    "network": (("platform", "networks"),),
    "allocation": (("allocations",),),
    "scenario": (("scenarios",),),
    "requirement": (("requirements",),),
    "chain": (("chains",),),
    "design": (("design_parameters",),),
}
"""Sections of a model with the things that keys name."""


def located(imported: Imported) -> TextNode:
    """Return an imported model as a tree in which each entry of a section has the line of its element."""
    root = plain_node(imported.tree, Location(imported.file.name, 0))
    for key, element in imported.keys.items():
        kind, _, name = key.partition(":")
        for section in _SECTIONS.get(kind, ()):
            entries = root.at(section)
            if entries is not None and name in entries.items:
                entries.items[name] = entries.items[name].moved(imported.file.where(element))
    return root


def export_uml(
    tree: Mapping[str, Any], name: str, rebase: components_view.Rebase = str, base: Imported | None = None
) -> tuple[str, tuple[Note, ...]]:
    """Return the text of a .uml file, and notes on what has no place in it.

    Args:
        tree: The model, as its file states it.
        name: Name of the file in messages.
        rebase: Makes a path of the model relative to the folder of the file.
        base: The file as it is now. Its ids and everything that volery does not know are kept.
    """
    exp = Export(base.file, base.keys) if base is not None else Export(empty_file(name))
    model = exp.file.model
    model.set("name", str(tree.get("name", "")))
    if tree.get("description"):
        exp.comment("description", model, str(tree["description"]))
    library = exp.package("package:library", model, "ComponentLibrary", "ModelLibrary")
    types = exp.package("package:types", library, "Data Types")
    interfaces = exp.package("package:interfaces", library, "Interfaces")
    interfaces_view.write_types(exp, types, tree)
    interfaces_view.write_interfaces(exp, interfaces, types, tree)
    components_view.write_components(exp, library, tree, rebase)
    platform_rest = platform_view.write_platform(exp, model, tree)
    instances_view.write_instances(exp, model, tree)
    allocation_view.write_allocations(exp, model, tree)
    _write_scenarios(exp, model, tree)
    _write_statements(exp, model, tree)
    designs = design_view.write_design_parameters(exp, model, tree)
    own = (
        *_ELSEWHERE,
        "design_parameters",
        "name",
        "description",
        "volery",
        "environment",
        "scenarios",
        "requirements",
        "chains",
    )
    rest = {key: value for key, value in tree.items() if key not in own}
    rest |= {"platform": platform_rest} if platform_rest else {}
    rest |= {"design_parameters": designs} if designs else {}
    exp.annotate("model", model, rest)
    exp.remove_rest()
    return exp.file.text(NAMESPACES), tuple(exp.notes)


def _write_scenarios(exp: Export, model: Element, tree: Mapping[str, Any]) -> None:
    scenarios = tree.get("scenarios") or {}
    if not scenarios:
        return
    verification = exp.view("view:verification", model, "Verification", "VerificationView")
    package = exp.package("package:scenarios", verification, "Scenarios")
    for name, stated in scenarios.items():
        made = exp.element(f"scenario:{name}", package, "packagedElement", "Component", name=name)
        exp.annotate(f"scenario:{name}", made, {"scenario": stated or {}})


def _write_statements(exp: Export, model: Element, tree: Mapping[str, Any]) -> None:
    for name, stated in (tree.get("requirements") or {}).items():
        rest = dict(stated)
        relation = next((one for one in _RELATIONS if one in rest), "")
        key = f"requirement:{name}"
        made = exp.element(key, model, "ownedRule", "Constraint", name=name)
        text = f"{rest.pop('observe', '')} {_RELATIONS.get(relation, '')} {rest.pop(relation, '')}"
        exp.child(made, key, "specification", "LiteralString", value=text)
        exp.apply(key, made, "Constraint", "NfpConstraint", kind="required")
        exp.annotate(key, made, rest)
    for name, topics in (tree.get("chains") or {}).items():
        made = exp.element(f"chain:{name}", model, "packagedElement", "Activity", name=name)
        exp.apply(f"chain:{name}", made, "NamedElement", "SaEndtoEndFlow")
        exp.annotate(f"chain:{name}", made, {"topics": topics})
