"""What the views share while a file is imported or exported: keys of elements, names, notes, annotations.

A *key* names an element by what it stands for in the model (``component:Planner/port:paths``). An import
records the element of each key. An export into an existing file reuses those elements: their ids, their
places in the packages and whatever else stands on them are kept, and diagrams of other tools stay valid.
"""

from __future__ import annotations

import hashlib
from base64 import urlsafe_b64encode
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from lxml import etree

from volery.base.errors import ModelError
from volery.exchange.identifiers import identifier
from volery.exchange.notes import Note
from volery.exchange.uml.stereotypes import NAMESPACES, PROFILES, prefix_of
from volery.exchange.uml.xmi import ECORE, UML, XMI, XmiFile, local, uml_type, xmi_id
from volery.exchange.uml.xmi import tags as tags_of
from volery.exchange.xml_text import Element
from volery.model.text import parse as parse_yaml
from volery.model.writing import flow_text

SOURCE = "volery"
"""Source of the EMF annotations that hold what neither UML nor MARTE nor S3D has a place for."""


def annotation(element: Element) -> dict[str, Any]:
    """Return what volery's annotation on an element states.

    Raises:
        ModelError: a value of it is not YAML.
    """
    found: dict[str, Any] = {}
    for each in element:
        if local(each) == "eAnnotations" and each.get("source") == SOURCE:
            for detail in each:
                if local(detail) == "details" and detail.get("key"):
                    key = str(detail.get("key"))
                    found[key] = parse_yaml(str(detail.get("value", "null")) or "null", key).plain()
    return found


@dataclass
class Import:
    """An import in progress. ``tree`` is the model so far, ``keys`` the elements that were understood."""

    file: XmiFile
    tree: dict[str, Any] = field(default_factory=dict)
    keys: dict[str, Element] = field(default_factory=dict)
    notes: dict[Note, None] = field(default_factory=dict)  # an ordered set
    names: dict[Element, str] = field(default_factory=dict)
    _numbers: dict[str, int] = field(default_factory=dict)
    _parts: dict[Element, list[Element]] = field(default_factory=dict)
    _links: dict[Element, list[Element]] | None = None
    _clients: dict[Element, list[Element]] | None = None
    _units: dict[Element, int] = field(default_factory=dict)
    _specifications: dict[Element, Element] | None = None

    def remark(self, element: Element, what: str) -> None:
        """Record what was imported from *element* in another form than it has there."""
        self.note(element, what, lost=False)

    def note(self, element: Element, what: str, *, lost: bool = True) -> None:
        """Record what could not be imported from *element*."""
        name = element.get("name") or local(element)
        place = f"{name} ({xmi_id(element)})" if xmi_id(element) else name
        self.notes[Note(what, self.file.where(element), place, lost)] = None

    def section(self, *path: str) -> dict[str, Any]:
        """Return the mapping at *path* in the tree; it is made if it is missing."""
        place = self.tree
        for step in path:
            place = place.setdefault(step, {})
        return place

    def name(self, element: Element, taken: Iterable[str] = ()) -> str:
        """Return the name of an element as a model can have it; a changed name is noted."""
        if element not in self.names:
            written = str(element.get("name", ""))
            made = identifier(written) or identifier(uml_type(element)) or "unnamed"
            base, number = made, self._numbers.get(made, 2)
            while made in taken:
                made, number = f"{base}_{number}", number + 1
                self._numbers[base] = number
            if identifier(written) != written:
                self.remark(element, f"{written!r} is no name in a model; it is {made!r} there")
            elif made != written:
                self.remark(element, f"something else is {written!r}, too; this is {made!r} in the model")
            self.names[element] = made
        return self.names[element]

    def annotation(self, element: Element) -> dict[str, Any]:
        """Return what volery's annotation states; a damaged one is noted."""
        try:
            return annotation(element)
        except ModelError as error:
            self.note(element, f"its annotation is damaged: {error.what}")
            return {}

    def parts_of(self, kind: Element) -> list[Element]:
        """Return the attributes of which *kind* is the type."""
        if not self._parts:
            self._parts[kind] = []
            for each in self.file.elements("Property"):
                typed = self.file.reference(each, "type") if local(each) == "ownedAttribute" else None
                if typed is not None:
                    self._parts.setdefault(typed, []).append(each)
        return self._parts.get(kind, [])

    def links_to(self, supplier: Element) -> list[Element]:
        """Return the dependencies whose supplier is *supplier*."""
        if self._links is None:
            self._links = {}
            for link in self.file.elements("Abstraction", "Dependency", "Usage"):
                for each in self.file.references(link, "supplier"):
                    self._links.setdefault(each, []).append(link)
        return self._links.get(supplier, [])

    def links_of(self, client: Element) -> list[Element]:
        """Return the usages and realizations whose client is *client*."""
        if self._clients is None:
            self._clients = {}
            for link in self.file.elements("Usage", "InterfaceRealization", "Realization"):
                for each in self.file.references(link, "client"):
                    self._clients.setdefault(each, []).append(link)
        return self._clients.get(client, [])

    def units_in(self, package: Element) -> int:
        """Return the number of components and classes in a package."""
        if package not in self._units:
            self._units[package] = sum(uml_type(each) in ("Component", "Class") for each in package)
        return self._units[package]

    def specification(self, operation: Element) -> Element | None:
        """Return the application of «RtSpecification» to a comment on *operation*."""
        if self._specifications is None:
            self._specifications = {}
            for comment in self.file.with_stereotype("RtSpecification"):
                for each in self.file.references(comment, "annotatedElement"):
                    application = self.file.stereotype(comment, "RtSpecification")
                    self._specifications.setdefault(each, application)
        return self._specifications.get(operation)

    def finish(self, key: str, element: Element) -> None:
        """Record that *element* stands for *key* and was understood."""
        self.keys.setdefault(key, element)


def _states_nothing(application: Element, name: str) -> bool:
    """Return whether a tag is absent, empty or ``null``, as real files have it."""
    return not tags_of(application, name)


@dataclass
class Export:
    """An export in progress, into a new file or into an existing one with the elements of ``known``."""

    file: XmiFile
    known: Mapping[str, Element] = field(default_factory=dict)
    notes: list[Note] = field(default_factory=list)
    made: dict[str, Element] = field(default_factory=dict)

    @cached_property
    def before(self) -> Import:
        """Reads what the existing file states, to leave alone what has not changed."""
        return Import(self.file)

    def element(self, key: str, parent: Element, feature: str, kind: str, **attributes: str) -> Element:
        """Return the element of *key* with these attributes; it is made below *parent* if it is new.

        Args:
            key: What the element stands for.
            parent: Where a new element is put.
            feature: The feature of the parent that owns a new element, such as ``packagedElement``.
            kind: The UML metaclass.
            attributes: The attributes; an empty value removes the attribute.
        """
        element = self.made.get(key, self.known.get(key))
        if element is None:
            element = etree.SubElement(parent, feature)
            element.set(f"{{{XMI}}}type", f"uml:{kind}")
            self._identify(element, key)
        for name, value in attributes.items():
            kept = name == "name" and identifier(str(element.get("name", ""))) == value
            if value and not kept:
                element.set(name, value)
            elif not value:
                element.attrib.pop(name, None)
        self.made[key] = element
        return element

    def _identify(self, element: Element, key: str) -> None:
        digest = hashlib.sha256(key.encode()).digest()
        made = f"_{urlsafe_b64encode(digest)[:22].decode().replace('-', '_')}"
        while made in self.file.ids:
            made += "v"
        element.set(f"{{{XMI}}}id", made)
        self.file.ids[made] = element

    def apply(self, key: str, element: Element, base: str, stereotype: str, **tags: str | list[str]) -> None:
        """Apply a stereotype to *element*, or change its tags. A list becomes child elements.

        An empty value removes the tag. Tags that are not named are left as they are.
        """
        application = self.file.stereotype(element, stereotype)
        if application is None:
            uri = PROFILES[prefix_of(stereotype)].uri
            application = etree.SubElement(self.file.root, f"{{{uri}}}{stereotype}")
            self._identify(application, f"{key}«{stereotype}»")
            application.set(f"base_{base}", xmi_id(element))
            self.file.register(element, stereotype, prefix_of(stereotype), application)
        for name, value in tags.items():
            if not value and _states_nothing(application, name):
                continue
            application.attrib.pop(name, None)
            for each in [each for each in application if local(each) == name]:
                application.remove(each)
            if isinstance(value, list):
                for one in value:
                    etree.SubElement(application, name).text = one
            elif value:
                application.set(name, value)

    def note(self, what: str, element: str = "") -> None:
        """Record what has no place in the file."""
        self.notes.append(Note(what, None, element))

    def view(self, key: str, model: Element, name: str, stereotype: str) -> Element:
        """Return the package of a view: the one that carries the stereotype, or a new one."""
        marked = self.file.with_stereotype(stereotype)
        if marked:
            self.made[key] = marked[0]
            return marked[0]
        made = self.element(key, model, "packagedElement", "Package", name=name)
        self.apply(key, made, "Package", stereotype)
        return made

    def package(self, key: str, owner: Element, name: str, stereotype: str = "") -> Element:
        """Return the package that volery puts things of one kind into; an annotation marks it."""
        known = self.known.get(key)
        written = name if known is None else str(known.get("name", ""))
        made = self.element(key, owner, "packagedElement", "Package", name=written)
        if stereotype:
            self.apply(key, made, "Package", stereotype)
        self.annotate(key, made, {"holds": key})
        return made

    def remove_stereotype(self, element: Element, *names: str) -> None:
        """Take stereotypes away from *element*."""
        for name in names:
            self.file.unregister(element, name)

    def annotate(self, key: str, element: Element, values: Mapping[str, Any]) -> None:
        """Put *values* into volery's annotation on *element*; without values there is no annotation."""
        for each in [one for one in element if local(one) == "eAnnotations" and one.get("source") == SOURCE]:
            element.remove(each)
        if not values:
            return
        made = etree.Element("eAnnotations", {f"{{{XMI}}}type": "ecore:EAnnotation", "source": SOURCE})
        element.insert(0, made)
        self.identify(made, f"{key}@")
        for name, value in values.items():
            detail = etree.SubElement(made, "details")
            detail.set(f"{{{XMI}}}type", "ecore:EStringToStringMapEntry")
            self.identify(detail, f"{key}@{name}")
            detail.set("key", name)
            detail.set("value", flow_text(value))

    def identify(self, element: Element, key: str) -> None:
        """Give a part of an element, which no other element refers to, the id that follows from its key."""
        digest = hashlib.sha256(key.encode()).digest()
        element.set(f"{{{XMI}}}id", f"_{urlsafe_b64encode(digest)[:22].decode().replace('-', '_')}")

    def child(self, owner: Element, key: str, feature: str, kind: str, **attributes: str) -> Element:
        """Return the only element of a *feature* of *owner*, with these attributes."""
        made = next((each for each in owner if local(each) == feature), None)
        if made is None:
            made = etree.SubElement(owner, feature)
            made.set(f"{{{XMI}}}type", f"uml:{kind}")
            self.identify(made, f"{key}/{feature}")
        for each in list(made):
            made.remove(each)
        for name, value in attributes.items():
            made.set(name, value)
        return made

    def comment(self, key: str, owner: Element, body: str, annotated: str = "") -> Element:
        """Return the comment of *key* below *owner* with this text."""
        made = self.element(key, owner, "ownedComment", "Comment", annotatedElement=annotated)
        text = next((each for each in made if local(each) == "body"), None)
        if text is None and body:
            made.attrib.pop("body", None)
            text = etree.SubElement(made, "body")
        if text is not None:
            text.text = body
        return made

    def refer(self, element: Element, feature: str, ids: Iterable[str]) -> None:
        """Make *feature* refer to the elements *ids*."""
        for each in [one for one in element if local(one) == feature]:
            element.remove(each)
        element.set(feature, " ".join(ids))

    def remove_rest(self) -> None:
        """Remove the elements of keys that are no longer in the model, with their stereotypes."""
        kept = set(self.made.values())
        for key, element in self.known.items():
            if key not in self.made and element not in kept and element.getparent() is not None:
                if any(each in kept for each in element.iter(etree.Element)):
                    continue  # a package that holds other parts of the model
                for below in element.iter(etree.Element):
                    self.file.unregister(below)
                element.getparent().remove(element)
        before = set(self.known.values())
        for element in [each for each in self.made.values() if each not in before]:
            self._remove_if_empty(element)

    def _remove_if_empty(self, package: Element) -> None:
        """Remove a new package that nothing was put into."""
        parent = package.getparent()
        if uml_type(package) != "Package" or parent is None:
            return
        for each in list(package):
            self._remove_if_empty(each)
        if all(local(each) == "eAnnotations" for each in package):
            if any(each.get("key") != "holds" for one in package for each in one):
                return
            self.file.unregister(package)
            parent.remove(package)


def empty_file(name: str) -> XmiFile:
    """Return a .uml file with an empty model, as Papyrus creates it."""
    namespaces = {"xmi": XMI, "uml": UML, "ecore": ECORE}
    root = etree.Element(f"{{{XMI}}}XMI", nsmap=namespaces | NAMESPACES)
    root.set(f"{{{XMI}}}version", "20131001")
    model = etree.SubElement(root, f"{{{UML}}}Model")
    model.set(f"{{{XMI}}}id", "_model")
    for prefix, profile in PROFILES.items():
        application = etree.SubElement(model, "profileApplication")
        application.set(f"{{{XMI}}}id", f"_apply_{prefix}")
        note = etree.SubElement(application, "eAnnotations")
        note.set(f"{{{XMI}}}type", "ecore:EAnnotation")
        note.set(f"{{{XMI}}}id", f"_apply_{prefix}_package")
        note.set("source", "http://www.eclipse.org/uml2/2.0.0/UML")
        package = etree.SubElement(note, "references")
        package.set(f"{{{XMI}}}type", "ecore:EPackage")
        package.set("href", profile.package)
        applied = etree.SubElement(application, "appliedProfile")
        applied.set(f"{{{XMI}}}type", "uml:Profile")
        applied.set("href", profile.location)
    return XmiFile(root, name)
