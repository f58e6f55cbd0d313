"""MARTE's analysis models (GQAM, PAM, SAM): steps with their times, the hosts that execute them, workloads.

DICE's profiles of technologies (Storm, Hadoop, Spark) specialize GaStep, GaExecHost, GaScenario and
GaWorkloadEvent, and are read as those.

Such a model has no components: it has activities or interactions whose steps carry times, swimlanes or
lifelines that execute them, and hosts. What executes steps becomes a component without a file, with one
operation for each step; an arrival with a period or a rate makes the component of the first step active. It
is read only: an export writes the components beside the analysis, which stays as it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from volery.exchange.identifiers import identifier
from volery.exchange.uml.context import Import
from volery.exchange.uml.notations import SOURCES, figure, tagged
from volery.exchange.uml.xmi import tag, uml_type
from volery.exchange.xml_text import Element

STEPS = (
    *("GaStep", "PaStep", "SaStep", "PaCommStep", "GaCommStep"),
    *("StormSpout", "StormBolt", "StormStreamStep", "HadoopOperation"),
    *("SparkTransformation", "SparkAction", "SparkMap", "SparkReduce"),
)
_WORKLOADS = ("GaWorkloadEvent", "GaWorkloadBehavior", "HadoopWorkloadEvent", "SparkWorkloadEvent")
_SCENARIOS = ("GaScenario", "StormScenarioTopology", "HadoopScenario", "SparkScenario")
_RUNNING = ("PaRunTInstance", "PaLogicalResource", *_SCENARIOS)
_CLASSIFIERS = ("Artifact", "Class", "Component", "Device", "Node")
"""What DICE marks with the stereotype of a step although it only holds the code of one."""
_EDGES = ("ControlFlow", "ObjectFlow")
_BEHAVIOURS = ("Activity", "Interaction")
LANGUAGE = "python"
"""Language of a component that has no file yet."""


def read_analysis(imp: Import) -> None:
    """Add a component and an instance for whatever executes steps.

    One of that name is there already where an export has written it.
    """
    executed: dict[Element, list[Element]] = {}
    for step in imp.file.with_stereotype(*STEPS):
        if uml_type(step) in _EDGES:
            imp.note(step, "a step on an edge: a model has no probabilities of branches; it is left out")
            continue
        if uml_type(step) not in _CLASSIFIERS:
            executed.setdefault(_executes(imp, step), []).append(step)
    written = set(imp.tree.get("components", {}))
    made: dict[Element, str] = {}
    for owner, steps in executed.items():
        name = identifier(_title(imp, owner)) or "Steps"
        if name in written:
            continue
        number, base = 2, name
        while name in made.values():
            name, number = f"{base}_{number}", number + 1
        made[owner] = name
        _component(imp, owner, name, steps)
    for event in imp.file.with_stereotype(*_WORKLOADS):
        behaviour = _behaviour(event)
        first = next((one for one, steps in executed.items() if _behaviour(steps[0]) is behaviour), None)
        if first is not None and first in made:
            _arrivals(imp, event, imp.section("components", made[first]))


def _behaviour(element: Element) -> Element | None:
    above = element
    while above is not None and uml_type(above) not in _BEHAVIOURS:
        above = above.getparent()
    return above


def _executes(imp: Import, step: Element) -> Element:
    """Return the swimlane or the lifeline of a step, else its behaviour, else the step itself."""
    lane = imp.file.reference(step, "inPartition")
    if lane is None:
        event = imp.file.reference(step, "receiveEvent")
        lane = imp.file.reference(event, "covered") if event is not None else None
    if lane is None:
        lane = imp.file.reference(step, "covered")
    if lane is not None:
        return lane
    behaviour = _behaviour(step)
    return step if behaviour is None else behaviour


def _title(imp: Import, owner: Element) -> str:
    """Return the name of what an owner of steps represents, else its own."""
    represented = imp.file.reference(owner, "represents")
    typed = imp.file.reference(represented, "type") if represented is not None else None
    for one in (typed, represented, owner):
        if one is not None and one.get("name"):
            return str(one.get("name"))
    return ""


def _component(imp: Import, owner: Element, name: str, steps: list[Element]) -> None:
    operations: dict[str, Any] = {}
    times: dict[str, Any] = {}
    for step in steps:
        operation = imp.name(step, operations)
        operations[operation] = {}
        time = _time(imp, step)
        if time is not None:
            times[operation] = time
    interface = f"{name}_steps"
    imp.section("interfaces")[interface] = operations
    made: dict[str, Any] = {"language": LANGUAGE, "provides": {"steps": interface}}
    imp.section("components")[name] = made | ({"operations": times} if times else {})
    instance = name.lower() if name.lower() != name else f"{name}_1"
    imp.section("application")[instance] = {"is": name}
    host = _host(imp, owner, steps)
    if host:
        imp.section("allocations", "default")[instance] = host
    else:
        imp.remark(owner, "no host of it is known: allocate it in the model")


def _time(imp: Import, step: Element) -> dict[str, str] | None:
    application = imp.file.stereotype(step, *STEPS)
    text = tag(application, "hostDemand", "execTime")
    found = figure(text)
    if found is None:
        if text:
            imp.note(step, f"its time {text!r} is no figure; state it in the model")
        return None
    provenance = SOURCES.get(tagged(text).source)
    return {"time": found} | ({"provenance": provenance} if provenance else {})


def _host(imp: Import, owner: Element, steps: list[Element]) -> str:
    """Return the processor that executes an owner of steps, empty if that cannot be seen."""
    processors = imp.tree.get("platform", {}).get("processors", {})
    hosts = list(_hosts(imp, owner, steps))
    named = [imp.names[host] for host in hosts if imp.names.get(host) in processors]
    alone = list(processors) if len(processors) == 1 else []
    return next(iter([*named, *alone]), "")


def _hosts(imp: Import, owner: Element, steps: list[Element]) -> Iterator[Element]:
    represented = imp.file.reference(owner, "represents")
    above = represented
    while above is not None:  # an artifact within its node
        yield above
        above = above.getparent()
    for one in (owner, represented, *steps, _behaviour(steps[0])):
        for name in (*_RUNNING, *STEPS):
            application = imp.file.stereotype(one, name) if one is not None else None
            if application is not None:
                yield from imp.file.references(application, "host")
                yield from imp.file.references(application, "usedResources")


def _arrivals(imp: Import, event: Element, component: dict[str, Any]) -> None:
    text = tag(imp.file.stereotype(event, *_WORKLOADS), "pattern", "demand")
    stated = tagged(text)
    period = stated.quantity("period")
    if period is None and "arrivalrate" in text.lower():
        rate = figure(text.partition("=")[2]) or stated.quantity("arrivalrate", "expr", "value")
        period = _period_of(rate)
        if period is not None:
            imp.remark(event, f"arrivals at random, {rate} on average: taken for a period of {period}")
    if period is None:
        imp.note(event, f"the arrivals {text!r} have no period and no rate; state `active` in the model")
        return
    component["active"] = {"period": period}


_PER_SECOND = {"Hz": 1.0, "kHz": 1e3, "": 1.0}


def _period_of(rate: str | None) -> str | None:
    """Return the period of a rate such as ``5 Hz``; None without a figure above 0."""
    number, _, unit = (rate or "").partition(" ")
    per_second = _PER_SECOND.get(unit, 0.0) * float(number or 0.0)
    return f"{1.0 / per_second:g} s" if per_second > 0.0 else None
