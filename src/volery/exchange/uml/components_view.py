"""The component library: components with files, ports, operations, times and their own flow of control.

S3D divides a component: the library holds its interfaces and files, and a *system component* that inherits
from it has the ports and the times. Both become one component of the model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from volery.base.errors import ModelError
from volery.exchange.uml.analysis_view import LANGUAGE
from volery.exchange.uml.context import Export, Import
from volery.exchange.uml.interfaces_view import EXPOSED, is_many, set_many
from volery.exchange.uml.notations import properties, property_text, tagged
from volery.exchange.uml.times_view import ACTIVE, Times, below, generals, write_activity, write_times
from volery.exchange.uml.xmi import local, tag, uml_type, xmi_id
from volery.exchange.xml_text import Element
from volery.model.components import LANGUAGES
from volery.model.text import parse as parse_yaml
from volery.model.writing import flow_text

Rebase = Callable[[str], str]
"""Returns a path that starts in one folder as one that starts in another."""

PASSIVE = "PpUnit"
QUEUE_POLICIES = {
    "discard": "discard",
    "removeFirst": "remove-first",
    "removeLast": "remove-last",
    "flush": "flush",
}
"""S3D's ``FullPoolPolicyKind``, and the words of the model."""

_LANGUAGES = {"cpp": "c++", "cxx": "c++", "c++11": "c++", "c++17": "c++", "py": "python", "python3": "python"}
_S3D_LANGUAGES = {"c++": "C++", "c": "C", "python": "Python"}
_MANY = "[]"


# -- import


def read_components(imp: Import, rebase: Rebase) -> None:
    """Read the components that instances are of, those with «RtUnit» or «PpUnit», and plain ones.

    Args:
        imp: The import.
        rebase: Makes a path of the file relative to the folder of the model.
    """
    used = set(_types_of_instances(imp))
    inherited = {general for each in used for general in generals(imp, each)[1:]}
    units = set(imp.file.with_stereotype(ACTIVE, PASSIVE))
    plain = set(_plain(imp)) - inherited
    for element in imp.file.elements("Component", "Class"):
        wanted = element in used or element in plain or (element in units and element not in inherited)
        if wanted and not imp.annotation(element).get("stands_for"):
            components = imp.section("components")
            name = imp.name(element, components)
            imp.finish(f"component:{name}", element)
            components[name] = _ImportedComponent(imp, element, name, rebase).read()


def _plain(imp: Import) -> Iterator[Element]:
    """Yield the components without any stereotype that have a port, an interface or an operation.

    One that has instances of others, or that volery has written for another purpose, is none.
    """
    for element in imp.file.elements("Component"):
        features = {local(each) for each in element}
        if (
            not imp.file.applied.get(element)
            and not imp.annotation(element)
            and not _has_parts(imp, element)
            and local(element) == "packagedElement"
            and element.get("isAbstract") != "true"
            and features & {"ownedAttribute", "ownedOperation", "interfaceRealization", "ownedPort", *EXPOSED}
        ):
            yield element


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
    if not found:  # no view of S3D: plain UML has composite components
        found = [each for each in imp.file.elements("Component", "Class") if _has_parts(imp, each)]
    return found


def _has_parts(imp: Import, component: Element) -> bool:
    for each in component:
        if local(each) == "ownedAttribute" and uml_type(each) == "Property":
            found = imp.file.reference(each, "type")
            if found is not None and uml_type(found) == "Component":
                return True
    return False


class _ImportedComponent:
    """One component that is being imported."""

    def __init__(self, imp: Import, element: Element, name: str, rebase: Rebase) -> None:
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
        times = Times(self.imp, self.key, self.family, self.rest.pop("active", None))
        activity = times.activity()
        if activity is not None:
            made["active"] = activity
        if "at" in self.rest:
            made["at"] = self.rest.pop("at")
        made |= times.read(made.get("provides", {}))
        return {**made, **self.rest}

    # files

    def _files(self) -> dict[str, Any]:
        found: dict[str, str] = {}
        for number, (owner, stated) in enumerate(self._stated_files()):
            language = stated.get("language", "").strip().lower()
            language = _LANGUAGES.get(language, language)
            path = stated.get("path", "")
            if path:
                path = self.rebase(path.replace("\\", "/"))
            if language and language not in LANGUAGES:
                self.imp.note(owner, f"no component can be in {language!r}; {', '.join(LANGUAGES)} can")
            if number == 0 or language not in found:
                found[language] = path
        if not found and not any(self.imp.file.applied.get(each) for each in self.family):
            self.imp.remark(self.element, f"a component without a file; {LANGUAGE} is taken for its language")
            return {"language": LANGUAGE}
        if not found:
            self.imp.remark(self.element, "no $language and no $path; a model needs `language`")
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
        for each in self.family:
            for link in self.imp.links_to(each):
                for client in self.imp.file.references(link, "client"):
                    if self._is_folder(client):
                        linked.append(client)
                        self.imp.finish(f"{self.key}/files-link", link)
        if linked:
            return linked
        alone = [package for package in packages if self.imp.units_in(package) == 1]
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
        for port in below(self.family, "ownedAttribute"):
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
            self._client_server(port, name, provides, requires)
            if name in provides or name in requires:
                self.imp.finish(f"{self.key}/port:{name}", port)
            queue = self._queue(port)
            if queue:
                queues[name] = queue
        if not provides and not requires and not self.imp.file.applied.get(self.element):
            realized, used = self._of_type(self.element)
            provides |= {self.imp.names[one].lower(): self.imp.names[one] for one in realized}
            requires |= {self.imp.names[one].lower(): self.imp.names[one] for one in used}
        sections = {"provides": provides, "requires": requires, "queues": queues, **made}
        return {key: value for key, value in sections.items() if value}

    def _client_server(
        self, port: Element, name: str, provides: dict[str, str], requires: dict[str, str]
    ) -> None:
        application = self.imp.file.stereotype(port, "ClientServerQueuePort", "ClientServerPort")
        kind = tag(application, "kind")
        provided = self._interfaces(application, "provInterface")
        required = self._interfaces(application, "reqInterface")
        if not provided and not required:
            provided, required = (self._exposed(port, feature) for feature in EXPOSED)
        typed = self.imp.file.reference(port, "type")
        if not provided and not required and typed is not None and uml_type(typed) == "Interface":
            conjugated = str(port.get("isConjugated", "")) == "true" or kind == "required"
            (required if conjugated else provided).append(typed)
        if not provided and not required and typed is not None:
            provided, required = self._of_type(typed)
            if str(port.get("isConjugated", "")) == "true":
                provided, required = required, provided
        if not provided and not required:
            self.imp.note(port, "a port without an interface; it is left out")
            return
        many = _MANY if is_many(port) else ""
        for number, each in enumerate(provided):
            provides[name if not number else f"{name}_{number + 1}"] = self.imp.names[each]
        for number, each in enumerate(required):
            taken = name in provides or number
            requires[f"{name}_required" if taken else name] = f"{self.imp.names[each]}{many}"

    def _exposed(self, element: Element, feature: str) -> list[Element]:
        """Return what ``<provided>`` or ``<required>`` of a port or a component states."""
        inside = [each for each in element if local(each) == feature and each in self.imp.names]
        return [*self._interfaces(element, feature), *inside]

    def _of_type(self, typed: Element) -> tuple[list[Element], list[Element]]:
        """Return the interfaces that a type realizes, and those that it uses."""
        realized, used = (self._exposed(typed, feature) for feature in EXPOSED)
        for each in typed:
            if local(each) == "interfaceRealization":
                realized += self.imp.file.references(each, "contract")
        for link in self.imp.links_of(typed):
            targets = self.imp.file.references(link, "supplier")
            if uml_type(link) == "Usage":
                used += targets
            else:
                realized += targets
        return (
            [fromkey for fromkey in dict.fromkeys(realized) if fromkey in self.imp.names],
            [fromkey for fromkey in dict.fromkeys(used) if fromkey in self.imp.names],
        )

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
        for each in below(self.family, "ownedAttribute"):
            if uml_type(each) != "Property":
                continue
            name = str(each.get("name", ""))
            default = next((one for one in each if local(one) == "defaultValue"), None)
            if default is None:
                self.imp.note(each, "an attribute without a default value is no parameter; it is left out")
                continue
            self.imp.finish(f"{self.key}/parameter:{name}", each)
            text = str(default.get("value", "")) or next(
                (one.text or "" for one in default if local(one) == "body"), ""
            )
            try:
                found[name] = parse_yaml(text, name).plain()
            except ModelError:
                found[name] = text
        return found


def body_of(comment: Element) -> str:
    """Return the text of a comment."""
    return str(comment.get("body", "")) or next(
        (each.text or "" for each in comment if local(each) == "body"), ""
    )


# -- export


def write_components(exp: Export, library: Element, tree: Mapping[str, Any], rebase: Rebase) -> None:
    """Write the components, each into a package of its own.

    Args:
        exp: The export.
        library: The package of the component library.
        tree: The model.
        rebase: Makes a path of the model relative to the folder of the file.
    """
    for name, stated in (tree.get("components") or {}).items():
        _write_component(exp, library, name, dict(stated), rebase)


def _write_component(exp: Export, library: Element, name: str, rest: dict[str, Any], rebase: Rebase) -> None:
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
    main = write_times(exp, component, key, name, rest, bool(active))
    exp.remove_stereotype(component, PASSIVE if active else ACTIVE)
    if active:
        entry = xmi_id(main) if main is not None else ""
        exp.apply(key, component, "BehavioredClassifier", ACTIVE, **({"main": entry} if entry else {}))
        kept = write_activity(exp, component, key, main, active if isinstance(active, dict) else {})
        if kept:
            rest["active"] = kept
    else:
        exp.apply(key, component, "BehavioredClassifier", PASSIVE)
    exp.annotate(key, component, rest)


def _write_files(
    exp: Export, package: Element, component: Element, key: str, rest: dict[str, Any], rebase: Rebase
) -> None:
    language, path = rest.pop("language", ""), rest.pop("path", "")
    files = {language: path, **(rest.pop("files", None) or {})}
    folder = exp.element(f"{key}/files/0", package, "packagedElement", "Package", name="FilesFolder")
    exp.apply(f"{key}/files/0", folder, "Package", "FilesFolder")
    for one, file in files.items():
        entry = f"{key}/language/{one}"
        written = _S3D_LANGUAGES.get(one, one)
        owner = exp.element(entry, folder, "packagedElement", "Package", name=written)
        stated = {"language": written}
        if file:
            stated["path"] = rebase(str(file))
        known = [exp.known.get(f"{entry}/{name}") for name in stated]
        if None not in known and len(set(known)) == 1 and len(known) > 1:  # one comment states both
            both = " ".join(property_text(name, value) for name, value in stated.items())
            exp.made[f"{entry}/path"] = exp.comment(f"{entry}/language", owner, both)
            continue
        for name, value in stated.items():
            exp.comment(f"{entry}/{name}", owner, property_text(name, value))
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
            entry = f"{key}/{section}:{topic}"
            port = exp.element(entry, component, "ownedAttribute", "Port", name=topic)
            other = dict(stated)
            kind_name = str(other.pop("type", ""))
            if kind_name:
                types = exp.made["package:types"]
                kind_element = exp.element(
                    f"type:{kind_name}", types, "packagedElement", "DataType", name=kind_name
                )
                port.set("type", xmi_id(kind_element))
            exp.apply(entry, port, "Port", "FlowPort", direction=direction)
            exp.annotate(entry, port, other)
