"""Memory spaces, operating systems and hardware: the platform of the model in MARTE's SRM and HRM."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from volery.exchange.uml.context import Export, Import
from volery.exchange.uml.notations import quantity_text, stated_quantity
from volery.exchange.uml.xmi import local, tag, tags, uml_type, xmi_id
from volery.exchange.xml_text import Element

SCHEDULERS = {
    "fixed-priority": "FixedPriorityPreEmptive",
    "round-robin": "RoundRobin",
    "fifo": "FIFO",
    "edf": "EarliestDeadlineFirst",
}
"""Schedulers of the model, and S3D's ``SchedulingPolicyKind``."""

DEVICES = {"HWSensor": "sensor", "HWActuator": "actuator", "HwDevice": "device"}
_PROCESSORS = (
    "HwProcessor",
    "HwPLD",
    "HwASIC",
    "GaExecHost",
    "SaExecHost",
    "HadoopComputationNode",
    "SparkNode",
)
_QUANTITIES = ("frequency", "bandwidth", "latency", "memory")
_MEDIA = ("HwMedia", "HwBus", "CommunicationMedia", "GaCommHost")


# -- import


def read_platform(imp: Import, kinds: Mapping[str, str]) -> None:
    """Read memory spaces, operating systems, processors, devices and networks.

    Args:
        imp: The import.
        kinds: Processors of the catalogue by the names that the file uses for them, in lower case.
    """
    for element in _things(imp, "MemoryPartition"):
        spaces = imp.section("memory_spaces")
        name = imp.name(element, spaces)
        imp.finish(f"memory:{name}", element)
        size = stated_quantity(tag(_application(imp, element, "MemoryPartition"), "memorySizeFootprint"))
        spaces[name] = _joined({"memory": size} if size else {}, imp.annotation(element)) or None
    for element in _things(imp, "OS"):
        systems = imp.section("platform", "operating_systems")
        name = imp.name(element, systems)
        imp.finish(f"os:{name}", element)
        systems[name] = _operating_system(imp, element) or None
    _read_hardware(imp, kinds)


def _read_hardware(imp: Import, kinds: Mapping[str, str]) -> None:
    for element in _things(imp, *_PROCESSORS):
        processors = imp.section("platform", "processors")
        name = imp.name(element, processors)
        imp.finish(f"processor:{name}", element)
        processors[name] = _processor(imp, element, kinds)
    for element in imp.file.with_stereotype("HwProcessor"):
        if imp.parts_of(element):
            imp.finish(f"kind:{element.get('name', '')}", element)
    for element in _things(imp, *DEVICES):
        devices = imp.section("platform", "devices")
        name = imp.name(element, devices)
        imp.finish(f"device:{name}", element)
        applied = _application(imp, element, *DEVICES)
        devices[name] = {"kind": DEVICES[local(applied)], **imp.annotation(element)}
    for element in _things(imp, *_MEDIA):
        _read_network(imp, element)
    for view in imp.file.with_stereotype("HWResourcesView"):
        for element in view.iter():
            if imp.file.has(element, "System"):
                imp.finish("hardware", element)


def _things(imp: Import, *stereotypes: str) -> list[Element]:
    """Return what is of a kind: attributes that carry the stereotype or whose type does, and other types."""
    found = []
    for element in imp.file.with_stereotype(*stereotypes):
        parts = imp.parts_of(element)
        found += [each for each in parts or [element] if each not in found]
    return found


def _application(imp: Import, element: Element, *stereotypes: str) -> Element:
    """Return the application of a stereotype to an element, or else to its type."""
    own = imp.file.stereotype(element, *stereotypes)
    if own is not None:
        return own
    typed = imp.file.reference(element, "type")
    found = imp.file.stereotype(typed, *stereotypes) if typed is not None else None
    assert found is not None, "the caller has found the stereotype"
    return found


def _operating_system(imp: Import, element: Element) -> dict[str, Any]:
    application = _application(imp, element, "OS")
    made: dict[str, Any] = {}
    if tag(application, "type"):
        made["type"] = tag(application, "type")
    if tag(application, "interProcessCommunication"):
        made["ipc"] = tag(application, "interProcessCommunication")
    drivers = imp.file.references(application, "drivers")
    if drivers:
        made["drivers"] = [str(each.get("name") or xmi_id(each)) for each in drivers]
    return _joined(made, imp.annotation(element))


def _processor(imp: Import, element: Element, kinds: Mapping[str, str]) -> dict[str, Any]:
    application = _application(imp, element, *_PROCESSORS)
    typed = imp.file.reference(element, "type")
    of_kind = imp.file.stereotype(typed, *_PROCESSORS) if typed is not None else None
    kind = str((typed if typed is not None else element).get("name", ""))
    made: dict[str, Any] = {"is": kinds.get(kind.lower(), kind)}
    if made["is"] not in kinds.values():
        remedy = f"`import --processor {kind}=NAME` says which it is"
        what = f"{kind!r} is not in the catalogue of processors; {remedy}"
        imp.remark(element, what)
    frequency = stated_quantity(tag(application, "frequency")) or stated_quantity(tag(of_kind, "frequency"))
    if frequency:
        made["frequency"] = frequency
    else:
        imp.remark(element, "no frequency; a model needs one")
    cores = _figure_of(application, of_kind, "nbCores", "resMult")
    if cores.isdigit():
        made["cores"] = int(cores)
    policy = tag(application, "schedPolicy")
    theirs = {name.lower(): ours for ours, name in SCHEDULERS.items()}
    if policy.lower() in theirs:
        made["scheduler"] = theirs[policy.lower()]
    elif policy and policy.lower() != "undef":
        imp.note(element, f"a model has no scheduler {policy!r}")
    caches = imp.file.references(application, "caches")
    if caches:
        made["caches"] = {imp.name(each): _cache(imp, each) for each in caches}
        for each in caches:
            imp.finish(f"processor:{imp.names[element]}/cache:{imp.names[each]}", each)
    return _joined(made, imp.annotation(element))


def _figure_of(application: Element, of_kind: Element | None, *names: str) -> str:
    stated = [tag(one, name) for name in names for one in (application, of_kind)]
    return next((one for one in stated if one.isdigit()), "")


def _cache(imp: Import, element: Element) -> dict[str, Any]:
    application = imp.file.stereotype(element, "HwCache")
    made: dict[str, Any] = {}
    if tag(application, "level").isdigit():
        made["level"] = int(tag(application, "level"))
    if tag(application, "type") not in ("", "undef", "other"):
        made["type"] = tag(application, "type")
    size = stated_quantity(tag(application, "memorySize"))
    return {**made, **({"size": size} if size else {})}


def _read_network(imp: Import, element: Element) -> None:
    application = _application(imp, element, *_MEDIA)
    joined = []
    for each in element:
        if local(each) == "end":
            joined += imp.file.references(each, "partWithPort") or imp.file.references(each, "role")
    for link in imp.file.elements("Connector"):  # a bus is an attribute that connectors lead to
        ends = [
            reference
            for each in link
            if local(each) == "end"
            for reference in (imp.file.references(each, "partWithPort") or imp.file.references(each, "role"))
        ]
        if element in ends:
            joined += [end for end in ends if end is not element]
    processors = imp.tree.get("platform", {}).get("processors", {})
    between = [imp.names[each] for each in joined if imp.names.get(each) in processors]
    between = list(dict.fromkeys(between))
    if len(between) < 2:
        imp.note(element, "it does not join two processors; it is left out")
        return
    networks = imp.section("platform", "networks")
    name = imp.name(element, networks)
    imp.finish(f"network:{name}", element)
    made: dict[str, Any] = {"between": between}
    bandwidth = stated_quantity(tag(application, "bandWidth")) or stated_quantity(
        next(iter(tags(application, "capacity")), "")
    )
    if bandwidth:
        made["bandwidth"] = bandwidth
    else:
        imp.remark(element, "no bandwidth; a model needs one")
    latency = stated_quantity(tag(application, "blockT"))
    made |= {"latency": latency} if latency else {}
    networks[name] = _joined(made, imp.annotation(element))


# -- export


def write_platform(exp: Export, model: Element, tree: Mapping[str, Any]) -> dict[str, Any]:
    """Write memory spaces, operating systems and hardware; return what the platform has beside them."""
    platform = dict(tree.get("platform") or {})
    spaces = exp.view("view:memory", model, "MemorySpaces", "MemorySpaceView")
    for name, stated in (tree.get("memory_spaces") or {}).items():
        rest = dict(stated or {})
        made = exp.element(f"memory:{name}", spaces, "packagedElement", "Component", name=name)
        exp.apply(
            f"memory:{name}",
            made,
            "Namespace",
            "MemoryPartition",
            memorySizeFootprint=_take(rest, "memory"),
        )
        exp.annotate(f"memory:{name}", made, rest)
    software = exp.view("view:software", model, "SWPlatform", "SWPlatformView")
    for name, stated in (platform.pop("operating_systems", None) or {}).items():
        rest = dict(stated or {})
        made = exp.element(f"os:{name}", software, "packagedElement", "Component", name=name)
        exp.apply(
            f"os:{name}",
            made,
            "Component",
            "OS",
            type=str(rest.pop("type", "")),
            interProcessCommunication=str(rest.pop("ipc", "")),
        )
        exp.annotate(f"os:{name}", made, rest)
    hardware = exp.view("view:hardware", model, "HWResources", "HWResourcesView")
    kinds = exp.package("package:hardware", hardware, "Processors")
    system = exp.element("hardware", hardware, "packagedElement", "Component", name="HwSystem")
    exp.apply("hardware", system, "Component", "System")
    for name, stated in (platform.pop("processors", None) or {}).items():
        _write_processor(exp, system, kinds, name, dict(stated))
    for name, stated in (platform.pop("devices", None) or {}).items():
        _write_device(exp, system, name, dict(stated or {}))
    for name, stated in (platform.pop("networks", None) or {}).items():
        _write_network(exp, system, name, dict(stated))
    return platform


def _write_processor(exp: Export, system: Element, kinds: Element, name: str, rest: dict[str, Any]) -> None:
    key = f"processor:{name}"
    kind = str(rest.pop("is", ""))
    known = exp.known.get(key)
    if known is not None and uml_type(known) != "Property":
        made, base = exp.element(key, system, "packagedElement", "Component", name=name), "Classifier"
        if kind:
            rest = {"is": kind, **rest} if kind.lower() != name.lower() else rest
    else:
        made, base = exp.element(key, system, "ownedAttribute", "Property", name=name), "Property"
        typed = exp.file.reference(made, "type") if known is not None else None
        if typed is not None and exp.file.has(typed, "HwProcessor"):
            written = str(typed.get("name", ""))
            exp.made[f"kind:{written}"] = typed
            rest = rest if written == kind else {"is": kind, **rest}
        else:
            of_kind = exp.element(f"kind:{kind}", kinds, "packagedElement", "Component", name=kind)
            exp.apply(f"kind:{kind}", of_kind, "Classifier", "HwProcessor")
            made.set("type", xmi_id(of_kind))
    caches = rest.pop("caches", None) or {}
    ids = []
    for cache, stated in caches.items():
        below = f"{key}/cache:{cache}"
        one = exp.element(below, system, "ownedAttribute", "Property", name=cache)
        exp.apply(
            below,
            one,
            "Property",
            "HwCache",
            level=str(stated.get("level", "")),
            type=str(stated.get("type", "")),
            memorySize=quantity_text(stated.get("size", ""))[0],
        )
        ids.append(xmi_id(exp.file.stereotype(one, "HwCache")))
    exp.apply(
        key,
        made,
        base,
        "HwProcessor",
        frequency=_take(rest, "frequency"),
        nbCores=str(rest.pop("cores", "")),
        caches=" ".join(ids),
    )
    exp.annotate(key, made, rest)


def _write_device(exp: Export, system: Element, name: str, rest: dict[str, Any]) -> None:
    key = f"device:{name}"
    made = exp.element(key, system, "ownedAttribute", "Property", name=name)
    kind = str(rest.pop("kind", "device"))
    stereotype = next((one for one, ours in DEVICES.items() if ours == kind), "HwDevice")
    base = "Property" if uml_type(made) == "Property" else "Classifier"
    exp.apply(key, made, base, stereotype)
    exp.annotate(key, made, rest)


def _write_network(exp: Export, system: Element, name: str, rest: dict[str, Any]) -> None:
    key = f"network:{name}"
    is_new = key not in exp.known
    between = rest.pop("between", [])
    made = exp.element(key, system, "ownedConnector", "Connector", name=name)
    for processor in between if is_new else ():
        target = exp.made.get(f"processor:{processor}")
        if target is not None:
            exp.element(f"{key}/end:{processor}", made, "end", "ConnectorEnd", role=xmi_id(target))
    if not is_new and uml_type(made) == "Connector":
        _change_ends(exp, key, made, between)
    exp.apply(
        key,
        made,
        "Connector" if uml_type(made) == "Connector" else "Property",
        next((one for one in _MEDIA if exp.file.has(made, one)), "HwMedia"),
        bandWidth=_take(rest, "bandwidth"),
        blockT=_take(rest, "latency"),
    )
    exp.annotate(key, made, rest)


def _change_ends(exp: Export, key: str, connector: Element, between: list[str]) -> None:
    """Make the ends of a connector that was there before those of *between*."""
    wanted = {xmi_id(exp.made[f"processor:{one}"]): one for one in between if f"processor:{one}" in exp.made}
    for end in [each for each in connector if local(each) == "end"]:
        ids = [
            xmi_id(reference)
            for reference in exp.file.references(end, "partWithPort") or exp.file.references(end, "role")
        ]
        if ids and ids[0] in wanted:
            del wanted[ids[0]]
        else:
            connector.remove(end)
    for target, processor in wanted.items():
        exp.element(f"{key}/end:{processor}", connector, "end", "ConnectorEnd", role=target)


def _take(rest: dict[str, Any], key: str) -> str:
    """Return the quantity of *key* for a tag; what the tag has no place for stays in *rest*."""
    text, left = quantity_text(rest.pop(key, ""))
    if left:
        rest[key] = left
    return text


def _joined(made: dict[str, Any], annotation: dict[str, Any]) -> dict[str, Any]:
    """Return what tags and the annotation state, together: the annotation adds to quantities."""
    for key, value in annotation.items():
        own = made.get(key)
        if isinstance(value, dict) and isinstance(own, str | dict) and key in _QUANTITIES:
            made[key] = {**(own if isinstance(own, dict) else {"value": own}), **value}
        else:
            made[key] = value
    return made
