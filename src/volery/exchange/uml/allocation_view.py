"""Allocations: links «Allocate» from instances to memory spaces, operating systems and processors.

S3D has one architectural view that is active. A model has several allocations: each is a package, and the
default one carries the stereotype.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from volery.exchange.uml.context import Export, Import
from volery.exchange.uml.xmi import tag, xmi_id
from volery.exchange.xml_text import Element

DEFAULT = "default"
"""Name of the allocation that an import makes of links outside all architectural views."""

_NOT_PLACES = ("extends", "set")


# -- import


def read_allocations(imp: Import) -> None:
    """Read the links, each into the allocation of its package."""
    for package in imp.file.elements("Package"):
        stated = imp.annotation(package)
        if "allocation" in stated or imp.file.has(package, "ArchitecturalView"):
            allocations = imp.section("allocations")
            name = imp.name(package, allocations)
            imp.finish(f"allocation:{name}", package)
            rest = stated.get("allocation")
            allocations[name] = dict(rest) if isinstance(rest, dict) else {}
    for link in imp.file.elements("Abstraction", "Dependency"):
        if imp.file.has(link, "Allocate"):
            suppliers = imp.file.references(link, "supplier")
            _allocate(imp, link, imp.file.references(link, "client"), suppliers)
    for comment in imp.file.with_stereotype("Assign"):
        assign = imp.file.stereotype(comment, "Assign")
        assert assign is not None
        _allocate(imp, comment, imp.file.references(assign, "from"), imp.file.references(assign, "to"))


def _allocate(imp: Import, link: Element, clients: list[Element], suppliers: list[Element]) -> None:
    if len(suppliers) != 1:
        imp.note(link, f"an allocation to {len(suppliers)} things; one is expected")
        return
    place = _name(imp, suppliers[0])
    if not place:
        imp.note(link, f"{suppliers[0].get('name', '')!r} is no place in a model; the allocation is left out")
        return
    allocation = _allocation_of(imp, link)
    places = imp.tree.get("allocations", {}).get(allocation, {})
    for client in clients:
        name = _name(imp, client)
        if not name:
            imp.note(link, f"{client.get('name', '')!r} is nothing that a model allocates; it is left out")
        elif places.get(name, place) != place:
            imp.note(link, f"{name} is allocated to {places[name]} already")
        else:
            places = imp.section("allocations", allocation)
            places[name] = place
            imp.finish(f"allocation:{allocation}/{name}", link)


def _name(imp: Import, element: Element) -> str:
    """Return the name of an element, or that of the only attribute that is of its type."""
    parts = imp.parts_of(element)
    if element not in imp.names and len(parts) == 1:
        element = parts[0]
    allocatable = {
        **imp.tree.get("application", {}),
        **imp.tree.get("environment", {}).get("vehicles", {}),
        **imp.tree.get("memory_spaces", {}),
        **imp.tree.get("platform", {}).get("operating_systems", {}),
        **imp.tree.get("platform", {}).get("processors", {}),
    }
    name = imp.names.get(element, "")
    return name if name in allocatable else ""


def _allocation_of(imp: Import, link: Element) -> str:
    above = link.getparent()
    while above is not None:
        name = imp.names.get(above)
        if name and imp.keys.get(f"allocation:{name}") is above:
            return name
        above = above.getparent()
    allocations = imp.tree.get("allocations", {})
    return next(iter(allocations)) if len(allocations) == 1 else DEFAULT


# -- export


def write_allocations(exp: Export, model: Element, tree: Mapping[str, Any]) -> None:
    """Write each allocation into a package; the first one is S3D's architectural view."""
    for number, (name, stated) in enumerate((tree.get("allocations") or {}).items()):
        key = f"allocation:{name}"
        package = exp.element(key, model, "packagedElement", "Package", name=name)
        if number == 0 and not exp.file.with_stereotype("ArchitecturalView"):
            exp.apply(key, package, "Package", "ArchitecturalView")
        rest = {one: value for one, value in (stated or {}).items() if one in _NOT_PLACES}
        exp.annotate(key, package, {"allocation": rest})
        for client, supplier in (stated or {}).items():
            if client not in _NOT_PLACES:
                _write_link(exp, package, f"{key}/{client}", client, str(supplier))


def _write_link(exp: Export, package: Element, key: str, client: str, supplier: str) -> None:
    one, other = _allocatable(exp, client), _allocatable(exp, supplier)
    if one is None or other is None:
        exp.note(f"{client if one is None else supplier!r} is nothing that can be allocated", key)
        return
    known = exp.known.get(key)
    if known is not None and tag(exp.file.stereotype(known, "Assign"), "to"):
        exp.made[key] = known
        return
    link = exp.element(key, package, "packagedElement", "Abstraction")
    suppliers = exp.file.references(link, "supplier")
    fits = any(each in (other, exp.file.reference(other, "type")) for each in suppliers)
    if fits and len(exp.file.references(link, "client")) > 1:
        return  # one link of the file allocates several instances
    if known is None or exp.file.references(link, "client") != [one]:
        exp.refer(link, "client", [xmi_id(one)])
    if known is None or not fits:
        exp.refer(link, "supplier", [xmi_id(other)])
    exp.apply(key, link, "Abstraction", "Allocate")


def _allocatable(exp: Export, name: str) -> Element | None:
    for kind in ("instance", "memory", "os", "processor"):
        found = exp.made.get(f"{kind}:{name}")
        if found is not None:
            return found
    return None
