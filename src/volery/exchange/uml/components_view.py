"""The component library: components with files, ports, operations, times and their own flow of control.

S3D divides a component: the library holds its interfaces and files, and a *system component* that inherits
from it has the ports and the times. Both become one component of the model.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import PurePath
from typing import Any

from volery.base.errors import ModelError
from volery.exchange.uml.context import Export, Import
from volery.exchange.uml.interfaces_view import is_many, set_many
from volery.exchange.uml.notations import SOURCES, properties, property_text, tagged, tagged_text
from volery.exchange.uml.xmi import Element, local, tag, tags, uml_type, xmi_id
from volery.model.components import LANGUAGES
from volery.model.text import parse as parse_yaml
from volery.model.writing import flow_text

ACTIVE, PASSIVE = "RtUnit", "PpUnit"
QUEUE_POLICIES = {
    "discard": "discard",
    "removeFirst": "remove-first",
    "removeLast": "remove-last",
    "flush": "flush",
}
"""S3D's ``FullPoolPolicyKind``, and the words of the model."""

_LANGUAGES = {"cpp": "c++", "cxx": "c++", "c++11": "c++", "c++17": "c++", "py": "python", "python3": "python"}
_S3D_LANGUAGES = {"c++": "C++", "c": "C", "python": "Python"}
_TIMES = {"best": "BOET", "time": "MOET", "worst": "WOET"}
_PROVENANCES = {ours: theirs for theirs, ours in SOURCES.items()}
_MANY = "[]"
_UNREAD_TAGS = (
    "isDynamic",
    "srPoolSize",
    "srPoolPolicy",
    "srPoolWaitingTime",
    "operationalMode",
    "msgMaxSize",
)


# -- import


def read_components(imp: Import, rebase: PurePath) -> None:
    """Read the components that instances are of, and those that carry «RtUnit» or «PpUnit».

    Args:
        imp: The import.
        rebase: Path from the folder of the model to that of the file: paths in the file start there.
    """
    used = set(_types_of_instances(imp))
    inherited = {general for each in used for general in generals(imp, each)[1:]}
    units = set(imp.file.with_stereotype(ACTIVE, PASSIVE))
    for element in imp.file.elements("Component", "Class"):
        wanted = element in used or (element in units and element not in inherited)
        if wanted and not imp.annotation(element).get("stands_for"):
            components = imp.section("components")
            name = imp.name(element, components)
            imp.finish(f"component:{name}", element)
            components[name] = _Component(imp, element, name, rebase).read()


def _types_of_instances(imp: Import) -> Iterator[Element]:
    for owner in instance_owners(imp):
        for each in owner:
            if local(each) == "ownedAttribute" and uml_type(each) != "Port":
                found = imp.file.reference(each, "type")
                if (
                    found is not None
                    and uml_type(found) in ("Component", "Class")
                    and not _is_system(imp, found)
                ):
                    yield found


def _is_system(imp: Import, element: Element) -> bool:
    return imp.file.has(element, "System", "TestContext")


def instance_owners(imp: Import) -> list[Element]:
    """Return the components whose attributes are instances: the system and the test contexts."""
    found = []
    for view in imp.file.with_stereotype("ApplicationView", "VerificationView", "FunctionalView"):
        inside = [each for each in view.iter() if uml_type(each) in ("Component", "Class")]
        marked = [each for each in inside if _is_system(imp, each)]
        found += marked or [each for each in inside if _has_parts(imp, each)]
    return found


def _has_parts(imp: Import, component: Element) -> bool:
    for each in component:
        if local(each) == "ownedAttribute" and uml_type(each) == "Property":
            found = imp.file.reference(each, "type")
            if found is not None and uml_type(found) == "Component":
                return True
    return False


def generals(imp: Import, component: Element) -> list[Element]:
    """Return a component and what it inherits from, itself first."""
    found = [component]
    for each in found:
        for below in each:
            if local(below) == "generalization":
                general = imp.file.reference(below, "general")
                if general is not None and general not in found:
                    found.append(general)
    return found


class _Component:
    """One component that is being imported."""

    def __init__(self, imp: Import, element: Element, name: str, rebase: PurePath) -> None:
        self.imp, self.element, self.name, self.rebase = imp, element, name, rebase
        self.key = f"component:{name}"
        self.family = generals(imp, element)
        self.rest: dict[str, Any] = {}
        for each in reversed(self.family):
            self.rest |= imp.annotation(each)

    def read(self) -> dict[str, Any]:
        """Return the component as a model states it."""
        made: dict[str, Any] = self._files()
        made |= self._ports()
        parameters = self._parameters()
        if parameters:
            made["parameters"] = parameters
        activity = self._activity()
        if activity is not None:
            made["active"] = activity
        if "at" in self.rest:
            made["at"] = self.rest.pop("at")
        made |= self._times(made)
        self.rest.pop("active", None)
        return {**made, **self.rest}

    def _below(self, feature: str) -> Iterator[Element]:
        seen = set()
        for one in self.family:
            for each in one:
                if local(each) == feature and (name := each.get("name")) not in seen:
                    seen.add(name)
                    yield each

    # files

    def _files(self) -> dict[str, Any]:
        found: dict[str, str] = {}
        for number, (owner, stated) in enumerate(self._stated_files()):
            language = stated.get("language", "").strip().lower()
            language = _LANGUAGES.get(language, language)
            path = stated.get("path", "")
            if path:
                path = PurePath(os.path.normpath(self.rebase / path.replace("\\", "/"))).as_posix()
            if language and language not in LANGUAGES:
                self.imp.note(owner, f"no component can be in {language!r}; {', '.join(LANGUAGES)} can")
            if number == 0 or language not in found:
                found[language] = path
        if not found:
            self.imp.note(self.element, "no $language and no $path; a model needs `language`")
            return {}
        (language, path), *others = found.items()
        made: dict[str, Any] = {"language": language} if language else {}
        if path:
            made["path"] = path
        if others:
            made["files"] = dict(others)
        return made

    def _stated_files(self) -> Iterator[tuple[Element, dict[str, str]]]:
        for number, folder in enumerate(self._folders()):
            self.imp.finish(f"{self.key}/files/{number}", folder)
            packages = [each for each in folder if local(each) == "packagedElement"]
            for owner in [folder, *packages]:
                stated = self._comments(owner)
                application = self.imp.file.stereotype(owner, "FilesFolder")
                for name in ("language", "path"):
                    value = tag(application, name)
                    if value:
                        stated.setdefault(name, value)
                if stated:
                    self.imp.finish(f"{self.key}/language/{stated.get('language', '').lower()}", owner)
                    yield owner, stated
        for each in self.family:
            stated = self._comments(each)
            if stated:
                yield each, stated

    def _comments(self, owner: Element) -> dict[str, str]:
        stated: dict[str, str] = {}
        for each in owner:
            if local(each) == "ownedComment":
                found = properties(body_of(each))
                for name in found:
                    language = found.get("language", stated.get("language", "")).lower()
                    self.imp.finish(f"{self.key}/language/{language}/{name}", each)
                stated |= found
        return {name: value for name, value in stated.items() if name in ("language", "path")}

    def _folders(self) -> list[Element]:
        """Return the folders of files that are linked to the component, or that stand in its package."""
        linked, packages = [], {each.getparent() for each in self.family}
        for link in self.imp.file.elements("Abstraction", "Dependency", "Usage"):
            if set(self.imp.file.references(link, "supplier")) & set(self.family):
                for client in self.imp.file.references(link, "client"):
                    if self._is_folder(client):
                        linked.append(client)
                        self.imp.finish(f"{self.key}/files-link", link)
        if linked:
            return linked
        units = ("Component", "Class")
        alone = [one for one in packages if sum(uml_type(each) in units for each in one) == 1]
        return [each for package in alone for each in package if self._is_folder(each)]

    def _is_folder(self, element: Element) -> bool:
        is_named = str(element.get("name", "")).replace(" ", "") == "FilesFolder"
        return self.imp.file.has(element, "FilesFolder") or is_named

    # ports

    def _ports(self) -> dict[str, Any]:
        provides: dict[str, str] = {}
        requires: dict[str, str] = {}
        queues: dict[str, Any] = {}
        made: dict[str, dict[str, Any]] = {"publishes": {}, "subscribes": {}}
        for port in self._below("ownedAttribute"):
            if uml_type(port) != "Port":
                continue
            flow = self.imp.file.stereotype(port, "FlowPort")
            if flow is not None:
                topic = str(port.get("name", ""))
                section = "subscribes" if tag(flow, "direction") == "in" else "publishes"
                kind = self.imp.file.reference(port, "type")
                stated = {"type": str(kind.get("name"))} if kind is not None else {}
                made[section][topic] = {**stated, **self.imp.annotation(port)}
                self.imp.finish(f"{self.key}/{section}:{topic}", port)
                continue
            name = self.imp.name(port, (*provides, *requires))
            self.imp.finish(f"{self.key}/port:{name}", port)
            self._client_server(port, name, provides, requires)
            queue = self._queue(port)
            if queue:
                queues[name] = queue
        sections = {"provides": provides, "requires": requires, "queues": queues, **made}
        return {key: value for key, value in sections.items() if value}

    def _client_server(
        self, port: Element, name: str, provides: dict[str, str], requires: dict[str, str]
    ) -> None:
        application = self.imp.file.stereotype(port, "ClientServerQueuePort", "ClientServerPort")
        kind = tag(application, "kind")
        provided = self._interfaces(application, "provInterface")
        required = self._interfaces(application, "reqInterface")
        typed = self.imp.file.reference(port, "type")
        if not provided and not required and typed is not None and uml_type(typed) == "Interface":
            conjugated = str(port.get("isConjugated", "")) == "true" or kind == "required"
            (required if conjugated else provided).append(typed)
        if not provided and not required:
            self.imp.note(port, "a port without an interface; it is left out")
            return
        many = _MANY if is_many(port) else ""
        for number, each in enumerate(provided):
            provides[name if not number else f"{name}_{number + 1}"] = self.imp.names[each]
        for number, each in enumerate(required):
            taken = name in provides or number
            requires[f"{name}_required" if taken else name] = f"{self.imp.names[each]}{many}"

    def _interfaces(self, application: Element | None, feature: str) -> list[Element]:
        found = self.imp.file.references(application, feature) if application is not None else []
        return [each for each in found if each in self.imp.names]

    def _queue(self, port: Element) -> dict[str, Any]:
        application = self.imp.file.stereotype(port, "ClientServerQueuePort")
        made: dict[str, Any] = {}
        for name, key in (("queueSize", "size"), ("retry", "retries")):
            value = tag(application, name)
            if value.isdigit():
                made[key] = int(value)
            elif value:
                self.imp.note(port, f"{name} is {value!r}, which is no number")
        policy = tag(application, "fullPoolPolicy")
        if policy in QUEUE_POLICIES:
            made["full"] = QUEUE_POLICIES[policy]
        elif policy:
            self.imp.note(port, f"a model has no policy {policy!r} for full queues")
        timeout = tagged(f"timeout = {tag(application, 'timeout')}").quantity("timeout")
        if timeout is not None:
            made["timeout"] = timeout
        return made

    # parameters, control flow, times

    def _parameters(self) -> dict[str, Any]:
        found = {}
        for each in self._below("ownedAttribute"):
            if uml_type(each) != "Property":
                continue
            name = str(each.get("name", ""))
            self.imp.finish(f"{self.key}/parameter:{name}", each)
            default = next((one for one in each if local(one) == "defaultValue"), None)
            if default is None:
                self.imp.note(each, "an attribute without a default value is no parameter; it is left out")
                continue
            text = str(default.get("value", "")) or next(
                (one.text or "" for one in default if local(one) == "body"), ""
            )
            try:
                found[name] = parse_yaml(text, name).plain()
            except ModelError:
                found[name] = text
        return found

    def _specification(self, operation: Element) -> Element | None:
        for comment in self.imp.file.elements("Comment"):
            application = self.imp.file.stereotype(comment, "RtSpecification")
            if application is not None and operation in self.imp.file.references(comment, "annotatedElement"):
                return application
        return None

    def _main(self) -> Element | None:
        for each in self.family:
            main = (
                self.imp.file.reference(found, "main")
                if (found := self.imp.file.stereotype(each, ACTIVE)) is not None
                else None
            )
            if main is not None:
                return main
        operations = list(self._below("ownedOperation"))
        named = [each for each in operations if str(each.get("name", "")).startswith("main")]
        return next(iter(named), None)

    def _activity(self) -> Any:
        applied = [self.imp.file.stereotype(each, ACTIVE) for each in self.family]
        unit = next((each for each in applied if each is not None), None)
        if unit is None:
            return None
        stays = [name for name in _UNREAD_TAGS if tag(unit, name)]
        if stays:
            self.imp.note(self.element, f"«RtUnit» {', '.join(stays)}: a model has no such key")
        made: dict[str, Any] = {}
        main = self._main()
        specification = self._specification(main) if main is not None else None
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
        stated_rest = self.rest.get("active")
        made |= stated_rest if isinstance(stated_rest, dict) else {}
        return made or True

    def _times(self, made: Mapping[str, Any]) -> dict[str, Any]:
        offered = {
            operation
            for interface in made.get("provides", {}).values()
            for operation in self.imp.tree.get("interfaces", {}).get(interface) or ()
        }
        main, found = self._main(), {}
        operations: dict[str, Any] = {}
        for operation in self._below("ownedOperation"):
            name = str(operation.get("name", ""))
            key = "main" if operation is main else name
            self.imp.finish(f"{self.key}/operation:{key}", operation)
            figures = self._figures(operation)
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

    def _figures(self, operation: Element) -> list[dict[str, Any]]:
        usage = self.imp.file.stereotype(operation, "ResourceUsage", "GaStep", "SaStep", "PaStep")
        texts = tags(usage, "execTime", "hostDemand")
        rest = self.imp.annotation(operation).get("figures", [])
        energies = tags(usage, "energy")
        figures = [self._figure(operation, text) for text in texts]
        if not texts:
            specification = self._specification(operation)
            text = tag(specification, "rdTime")
            figures = [self._figure(operation, text)] if text else []
        for position, made in enumerate(figures):
            energy = self._energy(energies[position]) if position < len(energies) and made else None
            made.update({"energy": energy} if energy else {})
            if position < len(rest) and isinstance(rest[position], dict):
                made.update(rest[position])
        return [one for one in figures if one]

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


def body_of(comment: Element) -> str:
    """Return the text of a comment."""
    return str(comment.get("body", "")) or next(
        (each.text or "" for each in comment if local(each) == "body"), ""
    )


# -- export


def write_components(exp: Export, library: Element, tree: Mapping[str, Any], rebase: PurePath) -> None:
    """Write the components, each into a package of its own.

    Args:
        exp: The export.
        library: The package of the component library.
        tree: The model.
        rebase: Path from the folder of the file to that of the model.
    """
    for name, stated in (tree.get("components") or {}).items():
        _write_component(exp, library, name, dict(stated), rebase)


def _write_component(
    exp: Export, library: Element, name: str, rest: dict[str, Any], rebase: PurePath
) -> None:
    key = f"component:{name}"
    known = exp.known.get(key)
    package = (
        known.getparent()
        if known is not None
        else exp.element(f"{key}/package", library, "packagedElement", "Package", name=name)
    )
    active = rest.pop("active", None)
    component = exp.element(
        key, package, "packagedElement", "Component", name=name, isActive="true" if active else ""
    )
    _write_files(exp, package, component, key, rest, rebase)
    for parameter, value in (rest.pop("parameters", None) or {}).items():
        _write_parameter(exp, component, f"{key}/parameter:{parameter}", parameter, value)
    _write_ports(exp, component, key, rest)
    main = _write_times(exp, component, key, name, rest, bool(active))
    exp.remove_stereotype(component, PASSIVE if active else ACTIVE)
    if active:
        entry = xmi_id(main) if main is not None else ""
        exp.apply(key, component, "BehavioredClassifier", ACTIVE, **({"main": entry} if entry else {}))
        kept = _write_activity(exp, component, key, main, active if isinstance(active, dict) else {})
        if kept:
            rest["active"] = kept
    else:
        exp.apply(key, component, "BehavioredClassifier", PASSIVE)
    exp.annotate(key, component, rest)


def _write_files(
    exp: Export, package: Element, component: Element, key: str, rest: dict[str, Any], rebase: PurePath
) -> None:
    language, path = rest.pop("language", ""), rest.pop("path", "")
    files = {language: path, **(rest.pop("files", None) or {})}
    folder = exp.element(f"{key}/files/0", package, "packagedElement", "Package", name="FilesFolder")
    exp.apply(f"{key}/files/0", folder, "Package", "FilesFolder")
    for one, file in files.items():
        below = f"{key}/language/{one}"
        written = _S3D_LANGUAGES.get(one, one)
        owner = exp.element(below, folder, "packagedElement", "Package", name=written)
        exp.comment(f"{below}/language", owner, property_text("language", written))
        if file:
            written = PurePath(os.path.normpath(rebase / str(file))).as_posix()
            exp.comment(f"{below}/path", owner, property_text("path", written))
    link = exp.element(f"{key}/files-link", package, "packagedElement", "Abstraction")
    exp.refer(link, "client", [xmi_id(folder)])
    exp.refer(link, "supplier", [xmi_id(component)])


def _write_parameter(exp: Export, owner: Element, key: str, name: str, value: Any) -> None:
    made = exp.element(key, owner, "ownedAttribute", "Property", name=name)
    exp.child(made, key, "defaultValue", "LiteralString", value=flow_text(value))


def _write_ports(exp: Export, component: Element, key: str, rest: dict[str, Any]) -> None:
    queues = rest.pop("queues", None) or {}
    policies = {ours: theirs for theirs, ours in QUEUE_POLICIES.items()}
    for section, kind in (("provides", "provided"), ("requires", "required")):
        for name, stated in (rest.pop(section, None) or {}).items():
            interface = str(stated).removesuffix(_MANY).strip()
            port = exp.element(f"{key}/port:{name}", component, "ownedAttribute", "Port", name=name)
            set_many(exp, port, f"{key}/port:{name}", str(stated).endswith(_MANY))
            target = exp.made.get(f"interface:{interface}")
            ids = xmi_id(target) if target is not None else ""
            queue = queues.get(name, {})
            exp.apply(
                f"{key}/port:{name}",
                port,
                "Port",
                "ClientServerQueuePort",
                kind=kind,
                provInterface=ids if kind == "provided" else "",
                reqInterface=ids if kind == "required" else "",
                queueSize=str(queue.get("size", "")),
                fullPoolPolicy=policies.get(queue.get("full", ""), ""),
                retry=str(queue.get("retries", "")),
                timeout=str(queue.get("timeout", "")),
            )
    for section, direction in (("publishes", "out"), ("subscribes", "in")):
        for topic, stated in (rest.pop(section, None) or {}).items():
            below = f"{key}/{section}:{topic}"
            port = exp.element(below, component, "ownedAttribute", "Port", name=topic)
            other = dict(stated)
            kind_name = str(other.pop("type", ""))
            if kind_name:
                types = exp.made["package:types"]
                kind_element = exp.element(
                    f"type:{kind_name}", types, "packagedElement", "DataType", name=kind_name
                )
                port.set("type", xmi_id(kind_element))
            exp.apply(below, port, "Port", "FlowPort", direction=direction)
            exp.annotate(below, port, other)


def _write_activity(
    exp: Export, component: Element, key: str, main: Element | None, active: Mapping[str, Any]
) -> dict[str, Any]:
    """Write the real-time specification; return what it has no place for."""
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


def _write_times(
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
        texts, energies, others = [], [], []
        for figure in listed:
            text, energy, other = _figure_text(dict(figure))
            texts.append(text)
            energies.append(energy)
            others.append(other)
        if texts:
            shown = [one for one in energies if one] if all(energies) else []
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
    energy = str(figure.pop("energy", ""))
    try:
        text = tagged_text(times)
    except ValueError:  # several units, or no number: the mean stays readable, the rest is annotated
        text = str(figure.get("time", ""))
        return text, energy, {key: value for key, value in figure.items() if key != "time"}
    rest = {key: value for key, value in figure.items() if key not in _TIMES}
    source = _PROVENANCES.get(str(rest.get("provenance", "")))
    if source:
        rest.pop("provenance")
        text += f"; source = {source}"
    return text, energy, rest
