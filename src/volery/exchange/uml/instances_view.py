"""The application and the verification environment: component instances, vehicles and their connectors.

An instance is an attribute of the component «System» or of a «TestContext»; a connector joins a required port
of an instance and a provided port of another one, a vehicle, or the environment.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from volery.exchange.uml.components_view import instance_owners
from volery.exchange.uml.context import Export, Import
from volery.exchange.uml.times_view import generals
from volery.exchange.uml.xmi import local, uml_type, xmi_id
from volery.exchange.xml_text import Element

_MANY = "[]"
_ENVIRONMENT = "environment"


# -- import


def read_instances(imp: Import) -> None:
    """Read the instances of the application and of the verification environment, and their connections."""
    owners = instance_owners(imp)
    for owner in owners:
        around = _is_around(imp, owner)
        imp.finish("world" if around else "system", owner)
        for each in owner:
            if local(each) == "ownedAttribute" and uml_type(each) != "Port":
                _read_instance(imp, each, around)
        if around:
            rest = imp.annotation(owner)
            if rest:
                imp.section("environment").update(rest)
    for owner in owners:
        for each in owner:
            if local(each) == "ownedConnector":
                _read_connector(imp, each)


def _is_around(imp: Import, owner: Element) -> bool:
    """Return whether an owner of instances is the verification environment."""
    if imp.file.has(owner, "TestContext"):
        return True
    above = owner.getparent()
    while above is not None:
        if imp.file.has(above, "VerificationView"):
            return True
        above = above.getparent()
    return False


def _read_instance(imp: Import, element: Element, around: bool) -> None:
    kind = imp.file.reference(element, "type")
    if kind is None:
        imp.note(element, "an instance without a type; it is left out")
        return
    stands_for = imp.annotation(kind).get("stands_for")
    if stands_for:
        imp.finish(f"{stands_for}:{kind.get('name', '')}", kind)
    if stands_for == "environment":
        imp.names[element] = _ENVIRONMENT
        imp.finish("world/environment", element)
        return
    if imp.file.has(kind, "System"):
        imp.finish("world/system", element)  # the system under test
        return
    application, environment = imp.section("application"), imp.section("environment")
    taken = [*application, *environment.get("components", {}), *environment.get("vehicles", {})]
    name = imp.name(element, taken)
    imp.finish(f"instance:{name}", element)
    if stands_for == "vehicle":
        imp.section("environment", "vehicles")[name] = {
            "kind": str(kind.get("name")),
            **imp.annotation(element),
        }
        return
    if kind not in imp.names:
        imp.note(element, f"its type {kind.get('name', '')!r} is no component of the library; it is left out")
        return
    made = {"is": imp.names[kind], **imp.annotation(element)}
    place = imp.section("environment", "components") if around else application
    place[name] = made


def _read_connector(imp: Import, connector: Element) -> None:
    ends = [each for each in connector if local(each) == "end"]
    if len(ends) != 2:
        imp.note(connector, f"a connector with {len(ends)} ends; two are expected")
        return
    for one, other in (ends, ends[::-1]):
        port, part = _end(imp, one)
        if port is None or part is None or not _is_required(imp, part, port):
            continue
        target = _target(imp, other, part, port)
        if target:
            _connect(imp, connector, imp.names[part], port, target)
            return
    imp.note(connector, "it joins no required port with a provided one; it is left out")


def _end(imp: Import, end: Element) -> tuple[str | None, Element | None]:
    """Return the name of the port and the instance of an end; None for what it does not have."""
    role, part = imp.file.reference(end, "role"), imp.file.reference(end, "partWithPort")
    if role is None:
        return None, None
    if uml_type(role) == "Port":
        return imp.names.get(role), part if part in imp.names else None
    return None, role if role in imp.names else None


def _stated(imp: Import, part: Element) -> dict[str, Any]:
    """Return the component of an instance."""
    kind = imp.file.reference(part, "type")
    components = imp.tree.get("components", {})
    component: dict[str, Any] = components.get(imp.names.get(kind, ""), {}) if kind is not None else {}
    return component


def _is_required(imp: Import, part: Element, port: str) -> bool:
    return port in _stated(imp, part).get("requires", {})


def _target(imp: Import, end: Element, part: Element, required: str) -> str:
    """Return what an end refers to, as a model writes it; empty if that provides nothing."""
    port, target = _end(imp, end)
    if target is None:
        return ""
    if port is None:  # a vehicle or the environment, or a part whose only fitting port is meant
        if "is" not in _instance(imp, imp.names[target]):
            return imp.names[target]
        interface = _stated(imp, part)["requires"][required].removesuffix(_MANY)
        provided = _stated(imp, target).get("provides", {})
        fitting = [name for name, offered in provided.items() if offered == interface]
        return f"{imp.names[target]}.{fitting[0]}" if len(fitting) == 1 else ""
    if port in _stated(imp, target).get("provides", {}):
        return f"{imp.names[target]}.{port}"
    return ""


def _instance(imp: Import, name: str) -> dict[str, Any]:
    environment = imp.tree.get("environment", {})
    found: dict[str, Any] = (
        imp.tree.get("application", {}).get(name) or environment.get("components", {}).get(name) or {}
    )
    return found


def _connect(imp: Import, connector: Element, name: str, port: str, target: str) -> None:
    stated = _instance(imp, name)
    component = imp.tree["components"][stated["is"]]
    many = component["requires"][port].endswith(_MANY)
    imp.finish(f"connector:{name}.{port}>{target}", connector)
    known = stated.get(port)
    if many:
        stated[port] = [*(known or []), target]
    elif known in (None, target):
        stated[port] = target
    else:
        stated[port] = [*(known if isinstance(known, list) else [known]), target]
        imp.note(connector, f"{name}.{port} is connected twice, and one connection is expected")


# -- export


def write_instances(exp: Export, model: Element, tree: Mapping[str, Any]) -> None:
    """Write the application view and the verification view."""
    application = exp.view("view:application", model, "Application", "ApplicationView")
    system = exp.element("system", application, "packagedElement", "Component", name="System")
    exp.apply("system", system, "Component", "System")
    environment = dict(tree.get("environment") or {})
    around = dict(environment.pop("components", None) or {})
    for name, stated in (tree.get("application") or {}).items():
        _write_instance(exp, system, tree, name, stated)
    if environment or around:
        _write_world(exp, model, tree, environment, around)
    for name, stated in {**(tree.get("application") or {}), **around}.items():
        _write_connectors(exp, "world" if name in around else "system", tree, name, stated)


def _write_world(
    exp: Export,
    model: Element,
    tree: Mapping[str, Any],
    environment: dict[str, Any],
    around: Mapping[str, Any],
) -> None:
    """Write the test context: the system under test, vehicles, and what surrounds them."""
    verification = exp.view("view:verification", model, "Verification", "VerificationView")
    kinds = exp.package("package:env", verification, "EnvComponents")
    world = exp.element("world", verification, "packagedElement", "Component", name="World")
    exp.apply("world", world, "StructuredClassifier", "TestContext")
    under_test = exp.element("world/system", world, "ownedAttribute", "Property", name="system_under_test")
    under_test.set("type", xmi_id(exp.made["system"]))
    for name, stated in around.items():
        _write_instance(exp, world, tree, name, stated)
    for name, stated in (environment.pop("vehicles", None) or {}).items():
        rest = dict(stated)
        kind = str(rest.pop("kind", "vehicle"))
        made = exp.element(f"instance:{name}", world, "ownedAttribute", "Property", name=name)
        made.set("type", xmi_id(_stand_in(exp, kinds, kind, "vehicle")))
        exp.annotate(f"instance:{name}", made, rest)
    air = exp.element("world/environment", world, "ownedAttribute", "Property", name=_ENVIRONMENT)
    air.set("type", xmi_id(_stand_in(exp, kinds, "Environment", "environment")))
    exp.annotate("world", world, environment)


def _stand_in(exp: Export, package: Element, name: str, what: str) -> Element:
    """Return the component that instances of something outside the library are typed by."""
    key = f"{what}:{name}"
    made = exp.element(key, package, "packagedElement", "Component", name=name)
    exp.apply(key, made, "StructuredClassifier", "TestComponent")
    exp.annotate(key, made, {"stands_for": what})
    return made


def _write_instance(
    exp: Export, owner: Element, tree: Mapping[str, Any], name: str, stated: Mapping[str, Any]
) -> None:
    key = f"instance:{name}"
    made = exp.element(key, owner, "ownedAttribute", "Property", name=name)
    component = exp.made.get(f"component:{stated.get('is')}")
    ports = _required_ports(exp, tree, str(stated.get("is")))
    rest = {one: value for one, value in stated.items() if one != "is" and one not in ports}
    if component is not None:
        known = exp.file.reference(made, "type")
        if known is None or component not in _family(exp, known):
            made.set("type", xmi_id(component))
    else:
        rest["is"] = stated.get("is")
    exp.annotate(key, made, rest)


def _family(exp: Export, component: Element) -> list[Element]:
    return generals(Import(exp.file), component)


def _required_ports(exp: Export, tree: Mapping[str, Any], component: str) -> dict[str, Element]:
    stated = (tree.get("components") or {}).get(component) or {}
    keys = {port: f"component:{component}/port:{port}" for port in stated.get("requires") or {}}
    return {port: exp.made[key] for port, key in keys.items() if key in exp.made}


def _write_connectors(
    exp: Export, owner: str, tree: Mapping[str, Any], name: str, stated: Mapping[str, Any]
) -> None:
    application = tree.get("application") or {}
    for port, element in _required_ports(exp, tree, str(stated.get("is"))).items():
        listed = stated.get(port)
        texts = [str(one) for one in (listed if isinstance(listed, list) else [listed]) if one is not None]
        inside = all(text.partition(".")[0] in application for text in texts)
        for text in texts:
            key = f"connector:{name}.{port}>{text}"
            target, _, provided = text.partition(".")
            part = exp.made.get("world/environment" if text == _ENVIRONMENT else f"instance:{target}")
            kind = _component_of(tree, target)
            role = exp.made.get(f"component:{kind}/port:{provided}") if provided else part
            if part is None or role is None:
                exp.note(f"{name}.{port}: {text!r} is nothing that can be connected to")
                continue
            place = exp.made[owner] if inside else exp.made.get("world", exp.made[owner])
            made = exp.element(key, place, "ownedConnector", "Connector", name=f"{name}.{port}")
            this = exp.made[f"instance:{name}"]
            _write_end(exp, made, f"{key}/from", 0, element, this)
            _write_end(exp, made, f"{key}/to", 1, role, part if provided else None)


def _component_of(tree: Mapping[str, Any], instance: str) -> str:
    around = (tree.get("environment") or {}).get("components") or {}
    stated = (tree.get("application") or {}).get(instance) or around.get(instance) or {}
    return str(stated.get("is", ""))


def _write_end(
    exp: Export, connector: Element, key: str, position: int, role: Element, part: Element | None
) -> None:
    ends = [each for each in connector if local(each) == "end"]
    if len(ends) > position and exp.known.get(key.rpartition("/")[0]) is not None:
        return  # the connector was there before: its key names both ends
    end = exp.element(key, connector, "end", "ConnectorEnd", role=xmi_id(role))
    if part is not None:
        end.set("partWithPort", xmi_id(part))
