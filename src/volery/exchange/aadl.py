"""A model as AADL text (SAE AS5506): components as processes with threads, ports as subprogram accesses.

The default allocation becomes processor bindings. What AADL's core language has no place for is returned as
a list of notes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from volery.base import units
from volery.base.files import one_line
from volery.base.time import Ns
from volery.base.units import QuantityError
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
_MAPPED = ("volery", "name", "description", "interfaces", "components", "application", "environment")
_ALSO = ("platform", "allocations")
_PROTOCOLS = {
    "fixed-priority": "POSIX_1003_HIGHEST_PRIORITY_FIRST_PROTOCOL",
    "round-robin": "ROUND_ROBIN_PROTOCOL",
    "edf": "EDF",
}
_RESERVED_TEXT = """
abstract access all and annex applies binding bus calls classifier compute connections constant data delta
device end enumeration event extends false feature features flow flows group implementation in inherit
initial inverse is list memory mode modes none not of or out package parameter path port private process
processor properties property prototypes provides public range record reference refined renames requires
self set sink source subcomponents subprogram system thread to true type units value virtual with
"""
_RESERVED = frozenset(_RESERVED_TEXT.split())


def identifier(text: str) -> str:
    """Return *text* as an identifier of AADL: letters and digits, joined by single underscores."""
    made = re.sub(r"_+", "_", re.sub(r"[^A-Za-z0-9]", "_", text)).strip("_") or "unnamed"
    return f"x_{made}" if made[0].isdigit() or made.lower() in _RESERVED else made


def time_text(time: Ns) -> str:
    """Return a time in the largest unit of AADL that it is a whole number of."""
    for unit, size in (("sec", 10**9), ("ms", 10**6), ("us", 10**3)):
        if time % size == 0:
            return f"{time // size} {unit}"
    return f"{time} ns"


def aadl_text(tree: Mapping[str, Any]) -> tuple[str, tuple[Note, ...]]:
    """Return a model as an AADL package, and notes on what is not in it."""
    unmapped = Unmapped()
    tree = without_provenance(tree, unmapped)
    note_rest(unmapped, tree, (*_MAPPED, *_ALSO))
    name = identifier(str(tree.get("name", "model")))
    lines = [
        f"-- {one_line(str(tree.get('description') or tree.get('name', '')))}",
        f"package {name}",
        "public",
        *_indented(_interfaces(tree)),
        *_indented(_components(tree, unmapped)),
        *_indented(_hardware(tree, unmapped)),
        *_indented(_system(tree, unmapped)),
        f"end {name};",
    ]
    return "\n".join(lines) + "\n", tuple(Note(line) for line in unmapped.lines())


def _indented(lines: Iterator[str]) -> Iterator[str]:
    return (f"  {line}" if line else "" for line in lines)


def _types(tree: Mapping[str, Any]) -> dict[str, None]:
    found: dict[str, None] = {}
    for operations in (tree.get("interfaces") or {}).values():
        for signature in (operations or {}).values():
            stated = signature or {}
            texts = [*stated.get("args", {}).values(), stated.get("returns", "")]
            found |= {identifier(text.removesuffix(_MANY)): None for text in texts if text}
    for component in (tree.get("components") or {}).values():
        for section in ("publishes", "subscribes"):
            found |= {
                identifier(str(one.get("type"))): None for one in (component.get(section) or {}).values()
            }
    return found


def _interfaces(tree: Mapping[str, Any]) -> Iterator[str]:
    for name in _types(tree):
        yield from (f"data {name}", f"end {name};", "")
    interfaces = dict(tree.get("interfaces") or {})
    for component in (tree.get("components") or {}).values():
        for one in (component.get("requires") or {}).values():
            interfaces.setdefault(str(one).removesuffix(_MANY), None)
    for interface, operations in interfaces.items():
        name = identifier(interface)
        for operation, signature in (operations or {}).items():
            stated = signature or {}
            parameters = [
                f"  {identifier(one)}: in parameter {identifier(text.removesuffix(_MANY))};"
                for one, text in stated.get("args", {}).items()
            ]
            if stated.get("returns"):
                returned = identifier(stated["returns"].removesuffix(_MANY))
                parameters.append(f"  returned: out parameter {returned};")
            made = f"{name}_{identifier(operation)}"
            yield from (f"subprogram {made}", *(["features", *parameters] if parameters else []))
            yield from (f"end {made};", "")
        features = [
            f"  {identifier(operation)}: provides subprogram access {name}_{identifier(operation)};"
            for operation in operations or {}
        ]
        yield from (f"subprogram group {name}", *(["features", *features] if features else []))
        yield from (f"end {name};", "")


def _components(tree: Mapping[str, Any], unmapped: Unmapped) -> Iterator[str]:
    for component, stated in (tree.get("components") or {}).items():
        name = identifier(component)
        features = []
        for section in ("provides", "requires"):
            for port, interface in (stated.get(section) or {}).items():
                group = identifier(str(interface).removesuffix(_MANY))
                features.append(f"  {identifier(port)}: {section} subprogram group access {group};")
        for section, way in (("publishes", "out"), ("subscribes", "in")):
            for topic, one in (stated.get(section) or {}).items():
                kind = identifier(str(one.get("type")))
                features.append(f"  {identifier(topic)}: {way} event data port {kind};")
        yield from (f"process {name}", *(["features", *features] if features else []))
        language = f'  Source_Text => ("{stated["path"]}");' if stated.get("path") else ""
        yield from (["properties", language] if language else [])
        yield from (f"end {name};", "")
        active = stated.get("active")
        if active:
            yield from _thread(f"{name}_main", active if isinstance(active, Mapping) else {}, stated)
        yield f"process implementation {name}.impl"
        yield from (["subcomponents", f"  main: thread {name}_main;"] if active else [])
        yield from (f"end {name}.impl;", "")
        if stated.get("operations"):
            unmapped.add("times of operations", component)


def _thread(name: str, active: Mapping[str, Any], stated: Mapping[str, Any]) -> Iterator[str]:
    period = active.get("period")
    properties = [f"  Dispatch_Protocol => {'Periodic' if period else 'Background'};"]
    try:
        if period:
            properties.append(f"  Period => {time_text(units.read_ns(period))};")
        if active.get("deadline"):
            properties.append(f"  Deadline => {time_text(units.read_ns(active['deadline']))};")
        figures = stated.get("activation") or []
        figure = figures[0] if isinstance(figures, list) and figures else figures
        if figure:
            best, worst = (figure.get(key, figure["time"]) for key in ("best", "worst"))
            both = f"{time_text(units.read_ns(best))} .. {time_text(units.read_ns(worst))}"
            properties.append(f"  Compute_Execution_Time => {both};")
    except QuantityError as error:
        properties.append(f"  -- {one_line(str(error))}")
    if "priority" in active:
        properties.append(f"  Priority => {active['priority']};")
    yield from (f"thread {name}", "properties", *properties, f"end {name};", "")


def _hardware(tree: Mapping[str, Any], unmapped: Unmapped) -> Iterator[str]:
    platform = tree.get("platform") or {}
    networks = platform.get("networks") or {}
    for name, stated in networks.items():
        yield f"bus {identifier(name)}"
        if stated.get("latency"):
            time = time_text(units.read_ns(stated["latency"]))
            yield from ("properties", f"  Latency => {time} .. {time};")
        yield from (f"end {identifier(name)};", "")
        unmapped.add(
            "properties of networks",
            *(f"{name}.{key}" for key in stated if key not in ("between", "latency")),
        )
    for name, stated in (platform.get("processors") or {}).items():
        kind = f"{identifier(name)}_processor"
        buses = [one for one, network in networks.items() if name in network.get("between", [])]
        features = [f"  {identifier(bus)}: requires bus access {identifier(bus)};" for bus in buses]
        protocol = _PROTOCOLS.get(stated.get("scheduler", ""), _PROTOCOLS["fixed-priority"])
        properties = [f"  Scheduling_Protocol => ({protocol});"]
        if stated.get("frequency"):
            period = round(1e12 / units.read(stated["frequency"], units.FREQUENCY))
            properties.append(f"  Clock_Period => {period} ps;")
        yield from (f"processor {kind}", *(["features", *features] if features else []))
        yield from ("properties", *properties, f"end {kind};", "")
        rest = [key for key in stated if key not in ("is", "frequency", "scheduler", "carried_by")]
        unmapped.add("properties of processors", *(f"{name}.{key}" for key in rest))
    for section in platform.keys() - {"processors", "networks"}:
        unmapped.add(f"section `platform.{section}`")
    for kind in dict.fromkeys(
        str(one.get("kind")) for one in ((tree.get("environment") or {}).get("vehicles") or {}).values()
    ):
        interface = "Rover" if kind == "rover" else "Drone"
        yield from (f"device {identifier(kind)}", "features")
        yield from (
            f"  commands: provides subprogram group access {interface};",
            f"end {identifier(kind)};",
            "",
        )


def _system(tree: Mapping[str, Any], unmapped: Unmapped) -> Iterator[str]:
    yield from ("system Whole", "end Whole;", "", "system implementation Whole.impl", "subcomponents")
    platform = tree.get("platform") or {}
    vehicles = (tree.get("environment") or {}).get("vehicles") or {}
    for name, stated in instances(tree).items():
        yield f"  {identifier(name)}: process {identifier(str(stated.get('is')))}.impl;"
    for name, stated in vehicles.items():
        yield f"  {identifier(name)}: device {identifier(str(stated.get('kind')))};"
    for name in platform.get("processors") or {}:
        yield f"  {identifier(name)}: processor {identifier(name)}_processor;"
    for name in platform.get("networks") or {}:
        yield f"  {identifier(name)}: bus {identifier(name)};"
    links = list(_links(tree, vehicles, unmapped))
    yield from (
        ["connections", *(f"  c{number}: {link};" for number, link in enumerate(links, 1))] if links else []
    )
    bindings = [
        f"  Actual_Processor_Binding => (reference ({identifier(place)})) applies to {identifier(name)};"
        for name, place in default_allocation(tree).items()
        if name in instances(tree) and place in (platform.get("processors") or {})
    ]
    yield from ["properties", *bindings] if bindings else []
    yield "end Whole.impl;"


def _links(tree: Mapping[str, Any], vehicles: Mapping[str, Any], unmapped: Unmapped) -> Iterator[str]:
    for name, port, target in connections(tree):
        other, _, provided = target.partition(".")
        if provided or other in vehicles:
            far = f"{identifier(other)}.{identifier(provided or 'commands')}"
            yield f"subprogram group access {identifier(name)}.{identifier(port)} <-> {far}"
        else:
            unmapped.add("ports of the environment", f"{name}.{port}")
    for network, stated in ((tree.get("platform") or {}).get("networks") or {}).items():
        for processor in stated.get("between", []):
            yield f"bus access {identifier(network)} <-> {identifier(processor)}.{identifier(network)}"
