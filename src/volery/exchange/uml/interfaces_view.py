"""Data types and interfaces: the packages `Data Types` and `Interfaces` of the component library."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lxml import etree

from volery.exchange.uml.context import Export, Import
from volery.exchange.uml.xmi import XMI, local, uml_type, xmi_id
from volery.exchange.xml_text import Element
from volery.model.components import SPECIAL_INTERFACES

PRIMITIVES = {"bool": "Boolean", "int": "Integer", "float": "Real", "str": "String"}
"""Types of Python, and UML's."""

_OURS = {theirs: ours for ours, theirs in PRIMITIVES.items()} | {"UnlimitedNatural": "int"}
_MANY = "[]"
EXPOSED = ("provided", "required")
"""Features of a port and of a component: interfaces, or references to them."""


# -- import


def read_types(imp: Import) -> None:
    """Read data types with attributes and enumerations; a type that is only a name needs no entry."""
    for element in imp.file.elements("DataType", "PrimitiveType", "Enumeration"):
        name = str(element.get("name", ""))
        imp.finish(f"type:{name}", element)
        literals = [str(each.get("name", "")) for each in element if local(each) == "ownedLiteral"]
        fields = {imp.name(each): type_text(imp, each) for each in element if local(each) == "ownedAttribute"}
        for each in element:
            if local(each) in ("ownedAttribute", "ownedLiteral"):
                imp.finish(f"type:{name}/{each.get('name', '')}", each)
        made: dict[str, Any] = {"fields": fields} if fields else {"values": literals} if literals else {}
        made |= imp.annotation(element)
        if made:
            imp.section("types")[imp.name(element)] = made


def read_interfaces(imp: Import) -> None:
    """Read the interfaces with their operations, inherited ones included.

    Enterprise Architect has interfaces below the port or the component that provides or requires them; those
    of one name are one.
    """
    named: dict[str, str] = {}
    inside = [
        each for each in imp.file.model.iter(etree.Element) if local(each) in EXPOSED and each.get("name")
    ]
    for element in [
        *(element for element in imp.file.elements("Interface") if element not in inside),
        *inside,
    ]:
        if element in inside and str(element.get("name")) in named:
            imp.names[element] = named[str(element.get("name"))]
            continue
        written = str(element.get("name", ""))
        if written in SPECIAL_INTERFACES:
            imp.names[element] = written
            imp.finish(f"interface:{written}", element)
            continue
        interfaces = imp.section("interfaces")
        name = imp.name(element, interfaces)
        named.setdefault(written, name)
        imp.finish(f"interface:{name}", element)
        operations = dict(_operations(imp, element, f"interface:{name}", set()))
        interfaces[name] = operations or None


def _operations(imp: Import, element: Element, key: str, seen: set[Element]) -> dict[str, Any]:
    if element in seen:
        imp.note(element, "an interface that inherits from itself")
        return {}
    seen.add(element)
    found: dict[str, Any] = {}
    for each in element:
        if local(each) == "generalization":
            general = imp.file.reference(each, "general")
            if general is not None:
                found |= _operations(imp, general, key, seen)
    for each in element:
        if local(each) == "ownedOperation":
            name = imp.name(each, found)
            found[name] = _signature(imp, each, f"{key}/{name}")
            imp.finish(f"{key}/{name}", each)
    return found


def _signature(imp: Import, operation: Element, key: str) -> dict[str, Any]:
    arguments: dict[str, str] = {}
    made: dict[str, Any] = {}
    for parameter in operation:
        if local(parameter) != "ownedParameter":
            continue
        if parameter.get("direction") == "return":
            made["returns"] = type_text(imp, parameter)
            imp.finish(f"{key}/return", parameter)
            continue
        if not parameter.get("name"):
            imp.names[parameter] = f"argument_{len(arguments) + 1}"
        name = imp.name(parameter, arguments)
        arguments[name] = type_text(imp, parameter)
        imp.finish(f"{key}/{name}", parameter)
    return {"args": arguments, **made} if arguments else made


def type_text(imp: Import, element: Element) -> str:
    """Return the type of a parameter or an attribute as text: ``Position[]``; ``object`` if it has none."""
    found = imp.file.reference(element, "type")
    name = str(found.get("name", "")) if found is not None else _foreign_type(element)
    name = _OURS.get(name, name) or "object"
    marks = "*" if imp.file.has(element, "Pointer") else "&" if imp.file.has(element, "Reference") else ""
    return f"{name}{marks}{_MANY if is_many(element) else ''}"


def _foreign_type(element: Element) -> str:
    """Return the name of a type in a library, such as ``UMLPrimitiveTypes.library.uml#String``."""
    for each in element:
        if local(each) == "type" and "#" in str(each.get("href", "")):
            return str(each.get("href")).rpartition("#")[2]
    return ""


def is_many(element: Element) -> bool:
    """Return whether the upper multiplicity of an element is more than one."""
    for each in element:
        if local(each) == "upperValue":
            return str(each.get("value", "1")) not in ("", "0", "1", "null")
    return False


# -- export


def write_types(exp: Export, package: Element, tree: Mapping[str, Any]) -> None:
    """Write the data types that the model declares."""
    for name, stated in (tree.get("types") or {}).items():
        kind = "Enumeration" if "values" in stated else "DataType"
        element = exp.element(f"type:{name}", package, "packagedElement", kind, name=name)
        for literal in stated.get("values", ()):
            exp.element(
                f"type:{name}/{literal}", element, "ownedLiteral", "EnumerationLiteral", name=str(literal)
            )
        for field, text in stated.get("fields", {}).items():
            made = exp.element(f"type:{name}/{field}", element, "ownedAttribute", "Property", name=field)
            set_type(exp, package, made, f"type:{name}/{field}", text)
        rest = {key: value for key, value in stated.items() if key not in ("values", "fields")}
        exp.annotate(f"type:{name}", element, rest)


def write_interfaces(exp: Export, package: Element, types: Element, tree: Mapping[str, Any]) -> None:
    """Write the interfaces of the model, and those that exist in every model."""
    for name, operations in (tree.get("interfaces") or {}).items():
        element = exp.element(f"interface:{name}", package, "packagedElement", "Interface", name=name)
        for operation, signature in (operations or {}).items():
            key = f"interface:{name}/{operation}"
            made = exp.element(key, element, "ownedOperation", "Operation", name=operation)
            stated = signature or {}
            for argument, text in stated.get("args", {}).items():
                one = exp.element(f"{key}/{argument}", made, "ownedParameter", "Parameter", name=argument)
                set_type(exp, types, one, f"{key}/{argument}", text)
            if stated.get("returns"):
                one = exp.element(
                    f"{key}/return", made, "ownedParameter", "Parameter", direction="return", name="return"
                )
                set_type(exp, types, one, f"{key}/return", stated["returns"])
    components = (tree.get("components") or {}).values()
    required = {
        str(one).removesuffix(_MANY) for each in components for one in (each.get("requires") or {}).values()
    }
    for name in SPECIAL_INTERFACES:
        if name in required:
            exp.element(f"interface:{name}", package, "packagedElement", "Interface", name=name)


def set_type(exp: Export, package: Element, element: Element, key: str, text: str) -> None:
    """Give a parameter or an attribute the type of a text; a missing type is made in *package*."""
    base = text.removesuffix(_MANY).rstrip("*&").strip()
    name = PRIMITIVES.get(base, base)
    if f"type:{base}" in exp.made:
        found = exp.made[f"type:{base}"]
    else:
        kind = "PrimitiveType" if base in PRIMITIVES else "DataType"
        found = exp.element(f"type:{name}", package, "packagedElement", kind, name=name)
        if found.get("name") != name and uml_type(found) in ("DataType", "PrimitiveType"):
            found.set("name", name)
    for each in [one for one in element if local(one) == "type"]:
        element.remove(each)
    element.set("type", xmi_id(found))
    for mark, stereotype in (("*", "Pointer"), ("&", "Reference")):
        if text.removesuffix(_MANY).endswith(mark):
            exp.apply(key, element, "Parameter", stereotype)
        else:
            exp.remove_stereotype(element, stereotype)
    set_many(exp, element, key, text.endswith(_MANY))


def set_many(exp: Export, element: Element, key: str, many: bool) -> None:
    """Give an element the multiplicity ``0..*``, or one."""
    for each in [one for one in element if local(one) in ("lowerValue", "upperValue")]:
        if many == is_many(element):
            return
        element.remove(each)
    if not many:
        return
    lower = etree.SubElement(element, "lowerValue")
    lower.set(f"{{{XMI}}}type", "uml:LiteralInteger")
    exp.identify(lower, f"{key}/lower")
    upper = etree.SubElement(element, "upperValue")
    upper.set(f"{{{XMI}}}type", "uml:LiteralUnlimitedNatural")
    exp.identify(upper, f"{key}/upper")
    upper.set("value", "*")
