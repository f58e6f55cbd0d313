"""Times of components: resource usage of operations, and the real-time specification of active components."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from volery.exchange.uml.context import Export, Import
from volery.exchange.uml.notations import SOURCES, tagged, tagged_text
from volery.exchange.uml.xmi import local, tag, tags, xmi_id
from volery.exchange.xml_text import Element

ACTIVE = "RtUnit"
_TIMES = {"best": "BOET", "time": "MOET", "worst": "WOET"}
_PROVENANCES = {ours: theirs for theirs, ours in SOURCES.items()}
_UNREAD_TAGS = (
    "isDynamic",
    "srPoolSize",
    "srPoolPolicy",
    "srPoolWaitingTime",
    "operationalMode",
    "msgMaxSize",
)


# -- import


def below(family: list[Element], feature: str) -> Iterator[Element]:
    """Yield the elements of a feature of a component and of what it inherits from, each name once."""
    seen = set()
    for one in family:
        for each in one:
            if local(each) == feature and (name := each.get("name")) not in seen:
                seen.add(name)
                yield each


def generals(imp: Import, component: Element) -> list[Element]:
    """Return a component and what it inherits from, itself first; no more than ``MOST_GENERALS``."""
    found = [component]
    for each in found:
        for one in each:
            if local(one) == "generalization":
                general = imp.file.reference(one, "general")
                if general is None or general in found:
                    continue
                if len(found) == MOST_GENERALS:
                    imp.note(component, f"it inherits from {MOST_GENERALS} or more: the others are left out")
                    return found
                found.append(general)
    return found


MOST_GENERALS = 32
"""A bound of the time that a hostile file takes."""


class Times:
    """The times of one component that is being imported.

    Args:
        imp: The import.
        key: Key of the component.
        family: The component, and what it inherits from.
        stated_rest: What volery's annotation states of its flow of control.
    """

    def __init__(self, imp: Import, key: str, family: list[Element], stated_rest: Any) -> None:
        self.imp, self.key, self.family, self.stated_rest = imp, key, family, stated_rest

    def _main(self) -> Element | None:
        for each in self.family:
            main = (
                self.imp.file.reference(found, "main")
                if (found := self.imp.file.stereotype(each, ACTIVE)) is not None
                else None
            )
            if main is not None:
                return main
        operations = list(below(self.family, "ownedOperation"))
        named = [each for each in operations if str(each.get("name", "")).startswith("main")]
        return next(iter(named), None)

    def activity(self) -> Any:
        """Return the flow of control as a model states it; None for a passive component."""
        applied = [self.imp.file.stereotype(each, ACTIVE) for each in self.family]
        unit = next((each for each in applied if each is not None), None)
        if unit is None:
            return None
        stays = [name for name in _UNREAD_TAGS if tag(unit, name)]
        if stays:
            self.imp.note(self.family[0], f"«RtUnit» {', '.join(stays)}: a model has no such key")
        made: dict[str, Any] = {}
        main = self._main()
        specification = self.imp.specification(main) if main is not None else None
        if specification is not None:
            self.imp.finish(f"{self.key}/specification", self.imp.file.bases[specification])
            occurs = tagged(tag(specification, "occKind"))
            stated = {
                "period": occurs.quantity("period", "minarrival", "mininterarrivaltime"),
                "deadline": tagged(tag(specification, "relDl", "boundDl")).quantity("deadline", "value")
                or tagged(f"deadline = {tag(specification, 'relDl')}").quantity("deadline"),
                "jitter": occurs.quantity("jitter"),
            }
            made |= {key: value for key, value in stated.items() if value}
            priority = tag(specification, "priority")
            if priority.lstrip("-").isdigit():
                made["priority"] = int(priority)
        made |= self.stated_rest if isinstance(self.stated_rest, dict) else {}
        return made or True

    def read(self, provides: Mapping[str, str]) -> dict[str, Any]:
        """Return the times of the activation and of the operations of the interfaces of *provides*."""
        offered = {
            operation
            for interface in provides.values()
            for operation in self.imp.tree.get("interfaces", {}).get(interface) or ()
        }
        main, found = self._main(), {}
        operations: dict[str, Any] = {}
        for operation in below(self.family, "ownedOperation"):
            name = str(operation.get("name", ""))
            figures = self.figures(operation)
            if operation is main or (figures and name in offered):
                key = "main" if operation is main else name
                self.imp.finish(f"{self.key}/operation:{key}", operation)
            if not figures:
                continue
            stated = figures[0] if len(figures) == 1 else figures
            if operation is main:
                found["activation"] = stated
            elif name in offered:
                operations[name] = stated
            else:
                self.imp.note(operation, "it is in no provided interface; its times are left out")
        return {**found, **({"operations": operations} if operations else {})}

    def figures(self, operation: Element) -> list[dict[str, Any]]:
        """Return the figures of an operation as a model states them."""
        usage = self.imp.file.stereotype(operation, "ResourceUsage", "GaStep", "SaStep", "PaStep")
        texts = tags(usage, "execTime", "hostDemand")
        rest = self.imp.annotation(operation).get("figures", [])
        energies = tags(usage, "energy")
        figures = [self._figure(operation, text) for text in texts]
        if not texts:
            specification = self.imp.specification(operation)
            text = tag(specification, "rdTime")
            figures = [self._figure(operation, text)] if text else []
        for position, made in enumerate(figures):
            energy = self._energy(energies[position]) if position < len(energies) and made else None
            made.update({"energy": energy} if energy else {})
            if position < len(rest) and isinstance(rest[position], dict):
                made.update(rest[position])
        return [figure for figure in figures if figure]

    def _energy(self, text: str) -> str | None:
        stated = tagged(text)
        return tagged(f"v = {text}").quantity("v") or stated.quantity("energy", "value", "mean", "moe")

    def _figure(self, operation: Element, text: str) -> dict[str, Any]:
        stated = tagged(text)
        best = stated.quantity("boet", "bcet", "best", "min")
        worst = stated.quantity("woet", "wcet", "worst", "max")
        mean = stated.quantity("moet", "acet", "mean", "value", "expr") or tagged(f"v = {text}").quantity("v")
        time = mean or worst or best
        if time is None:
            self.imp.note(operation, f"no execution time can be read from {text!r}")
            return {}
        made = {"time": time}
        made |= {"best": best} if best and best != time else {}
        made |= {"worst": worst} if worst and worst != time else {}
        provenance = SOURCES.get(stated.source, "")
        return {**made, **({"provenance": provenance} if provenance else {})}


# -- export


def write_activity(
    exp: Export, component: Element, key: str, main: Element | None, active: Mapping[str, Any]
) -> dict[str, Any]:
    """Write the real-time specification; return what it has no place for."""
    if key in exp.known:
        stated = exp.before.annotation(component).get("active")
        if Times(exp.before, key, generals(exp.before, component), stated).activity() == (
            dict(active) or True
        ):
            comment = exp.known.get(f"{key}/specification")
            exp.made |= {f"{key}/specification": comment} if comment is not None else {}
            return stated if isinstance(stated, dict) else {}
    rest = dict(active)
    tags_: dict[str, str] = {}
    try:
        if "deadline" in rest:
            tags_["relDl"] = tagged_text({"Deadline": str(rest.pop("deadline"))})
        if "period" in rest:
            tags_["occKind"] = f"Periodic ({tagged_text({'Period': str(rest.pop('period'))})})"
    except ValueError:  # the text is no quantity; `volery model check` reports it
        return dict(active)
    if "priority" in rest:
        tags_["priority"] = str(rest.pop("priority"))
    if main is not None and tags_:
        comment = exp.comment(f"{key}/specification", component, "", xmi_id(main))
        exp.apply(
            f"{key}/specification",
            comment,
            "Comment",
            "RtSpecification",
            **{"relDl": "", "occKind": "", "priority": "", **tags_},
        )
    return rest


def write_times(
    exp: Export, component: Element, key: str, name: str, rest: dict[str, Any], active: bool
) -> Element | None:
    """Write the operations with their resource usage; return the main one of an active component."""
    main = None
    stated: list[tuple[str, str, Any]] = []
    if active or "activation" in rest:
        stated.append(("main", f"main_{name}", rest.pop("activation", None)))
    stated += [(one, one, figures) for one, figures in (rest.pop("operations", None) or {}).items()]
    for one, written, figures in stated:
        below = f"{key}/operation:{one}"
        known = exp.known.get(below)
        named = written if known is None else str(known.get("name"))
        operation = exp.element(below, component, "ownedOperation", "Operation", name=named)
        main = operation if one == "main" else main
        listed = figures if isinstance(figures, list) else [figures] if figures else []
        if known is not None and Times(exp.before, key, [component], None).figures(known) == listed:
            continue
        texts, energies, others = [], [], []
        for figure in listed:
            text, energy, other = _figure_text(dict(figure))
            texts.append(text)
            energies.append(energy)
            others.append(other)
        if texts:
            shown = [energy for energy in energies if energy] if all(energies) else []
            others = [
                {**other, "energy": energy} if energy and not shown else other
                for other, energy in zip(others, energies, strict=True)
            ]
            exp.apply(below, operation, "NamedElement", "ResourceUsage", execTime=texts, energy=shown)
        else:
            exp.remove_stereotype(operation, "ResourceUsage")
        exp.annotate(below, operation, {"figures": others} if any(others) else {})
    return main


def _figure_text(figure: dict[str, Any]) -> tuple[str, str, dict[str, Any]]:
    """Return the time and the energy of a figure as texts, and what they have no place for."""
    times = {tag_: str(figure[key]) for key, tag_ in _TIMES.items() if key in figure}
    energy = "" if isinstance(figure.get("energy"), Mapping) else str(figure.pop("energy", ""))
    try:
        text = tagged_text(times)
    except ValueError:  # several units, or no number: the mean stays readable, the rest is annotated
        time = figure.get("time", "")
        if isinstance(time, Mapping):
            return str(time.get("value", "")), energy, figure
        return str(time), energy, {key: value for key, value in figure.items() if key != "time"}
    rest = {key: value for key, value in figure.items() if key not in _TIMES}
    source = _PROVENANCES.get(str(rest.get("provenance", "")))
    if source:
        rest.pop("provenance")
        text += f"; source = {source}"
    return text, energy, rest
