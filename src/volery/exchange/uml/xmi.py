"""An XMI file: read without executing anything in it, indexed by ids and stereotypes, and written.

Plain XML with an index, not pyecore: that library fails on most real MARTE models and on S3D's versioned
namespaces. Namespaces are matched by pattern, because each release of Papyrus, MARTE and S3D has its own.
What volery does not understand stays in the tree, so that it is still there after writing.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from lxml import etree

from volery.base.errors import Location, ModelError
from volery.exchange.xml_text import Element, xml_root

MOST_ELEMENTS = 200_000
"""Most elements of a file that is read: a bound of the time, too."""

XMI = "http://www.omg.org/spec/XMI/20131001"
UML = "http://www.eclipse.org/uml2/5.0.0/UML"
ECORE = "http://www.eclipse.org/emf/2002/Ecore"
XSI = "http://www.w3.org/2001/XMLSchema-instance"

_XMI_URI = re.compile(r"^http://(schema\.omg\.org/spec/XMI|www\.omg\.org/(spec/)?XMI)\b")
_UML_URI = re.compile(
    r"^http://(www\.eclipse\.org/uml2/\d+\.\d+\.\d+/UML|(schema|www)\.omg\.org/spec/UML\b.*)$"
)
_PROFILES = (
    re.compile(r"^http:///schemas/(?P<name>essyn_Profile|PHARAON_Profile)/_[A-Za-z0-9_-]+/\d+$"),
    re.compile(r"^http://(?P<name>essyn_Profile|PHARAON_Profile)\.UTP_Stereotypes/schemas/UTP/"),
    re.compile(r"^http:///(?P<name>essyn_Profile|PHARAON_Profile)(/.*)?\.ecore$"),
    re.compile(r"^http://www\.eclipse\.org/papyrus/(?P<name>\w+)/\d+$"),
    re.compile(r"^http://es\.unizar\.disco\.dice/profiles/(?:\w+/)*(?P<name>\w+)/\d+\.\d+$"),
    re.compile(r"^http:///(?:MARTE/)(?:\w+/)*(?P<name>\w+)\.ecore$"),
    re.compile(r"^http:///schemas/(?P<name>\w+)/_[A-Za-z0-9_-]+/\d+$"),
    re.compile(r"^http://www\.eclipse\.org/uml2/\d+\.\d+\.\d+/UML/Profile/(?P<name>\w+)$"),
)
_OTHER_FILES = {
    "SashWindowsMngr": ".di",
    "Diagram": ".notation",
    "EPackage": ".ecore",
    "Profile": ".profile.uml",
}


def local(element: Element) -> str:
    """Return the name of an element without its namespace."""
    return etree.QName(element).localname if isinstance(element.tag, str) else ""


def _profile_of(uri: str) -> str:
    """Return the profile of a namespace, empty if it is none of MARTE, S3D, DICE or the standard one."""
    for pattern in _PROFILES:
        match = pattern.match(uri)
        if match:
            name = match.group("name")
            return "S3D" if name in ("essyn_Profile", "PHARAON_Profile") else name
    return ""


@dataclass(frozen=True)
class Application:
    """A stereotype that is applied: its name, its profile, and the element that holds its tags."""

    name: str
    profile: str
    element: Element


class XmiFile:
    """The tree of a .uml file with an index of its ids and its stereotypes.

    ``strange`` are applications of stereotypes whose profile is not known. ``dangling`` are pairs of an
    element and an id that it refers to and that does not exist.
    """

    def __init__(self, root: Element, name: str) -> None:
        self.root, self.name = root, name
        self.ids: dict[str, Element] = {}
        self._by_type: dict[str, list[Element]] = {}
        doubled = []
        for element in root.iter(etree.Element):
            found = xmi_id(element)
            if found and self.ids.setdefault(found, element) is not element:
                doubled.append(element)
            self._by_type.setdefault(uml_type(element), []).append(element)
        self.applied: dict[Element, list[Application]] = {}
        self.bases: dict[Element, Element] = {}
        self.strange: list[Element] = []
        self.doubled = doubled  # their id is that of another element
        self.parts: tuple[str, ...] = ()  # other files that it was put together from
        self.asked: set[str] = set()  # names of stereotypes that a reader has looked for
        self.dangling: dict[tuple[Element, str], None] = {}  # an ordered set
        for element in root:
            if isinstance(element.tag, str) and element is not self.model:
                self._index(element)

    @property
    def model(self) -> Element:
        """The ``uml:Model``, or the root package."""
        if _is_uml(self.root):
            return self.root
        return next(each for each in self.root if isinstance(each.tag, str) and _is_uml(each))

    def _index(self, element: Element) -> None:
        uri = etree.QName(element).namespace or ""
        profile = _profile_of(uri)
        bases = [(name, value) for name, value in element.attrib.items() if name.startswith("base_")]
        bases += [(local(each), _idref(each)) for each in element if local(each).startswith("base_")]
        if not bases:
            return
        if not profile:
            self.strange.append(element)
            return
        application = Application(local(element), profile, element)
        for _, target in bases:
            found = self.ids.get(target)
            if found is None:
                self.dangling[element, target] = None
                continue
            self.bases[element] = found
            known = self.applied.setdefault(found, [])
            if application not in known:
                known.append(application)

    def register(self, element: Element, stereotype: str, profile: str, application: Element) -> None:
        """Add an application of a stereotype that has been put into the tree."""
        self.applied.setdefault(element, []).append(Application(stereotype, profile, application))

    def unregister(self, element: Element, stereotype: str = "") -> None:
        """Remove the applications of *stereotype*, or of all stereotypes, to *element* from the tree."""
        applied = self.applied.get(element, [])
        for one in [each for each in applied if stereotype in ("", each.name)]:
            applied.remove(one)
            if one.element.getparent() is not None:
                one.element.getparent().remove(one.element)

    def stereotype(self, element: Element, *names: str) -> Element | None:
        """Return the application of the first of the stereotypes *names* to *element*."""
        self.asked.update(names)
        for name in names:
            for one in self.applied.get(element, ()):
                if one.name == name:
                    return one.element
        return None

    def has(self, element: Element, *names: str) -> bool:
        """Return whether one of the stereotypes *names* is applied to *element*."""
        return self.stereotype(element, *names) is not None

    def with_stereotype(self, *names: str) -> list[Element]:
        """Return the elements with one of the stereotypes, in the order of the file."""
        return [each for each in self.model.iter(etree.Element) if self.has(each, *names)]

    def elements(self, *types: str) -> Iterator[Element]:
        """Yield the UML elements of some types, such as ``Component``, in the order of the file.

        They are those of the file as it was read.
        """
        if len(types) == 1:
            yield from self._by_type.get(types[0], ())
            return
        for element in self.model.iter(etree.Element):
            if uml_type(element) in types:
                yield element

    def references(self, element: Element, feature: str) -> list[Element]:
        """Return what a feature refers to, as an attribute or as child elements.

        An applied stereotype stands for the element that it is applied to. References to other files are
        left out; ids that do not exist are added to ``dangling``.
        """
        found = []
        for target in targets(element, feature):
            if target in self.ids:
                one = self.ids[target]
                found.append(self.bases.get(one, one))
            else:
                self.dangling[element, target] = None
        return found

    def reference(self, element: Element, feature: str) -> Element | None:
        """Return the first of ``references``."""
        return next(iter(self.references(element, feature)), None)

    def where(self, element: Element) -> Location:
        """Return the file and the line of an element."""
        return Location(self.name, min(element.sourceline or 0, 2**31))

    def text(self, namespaces: Mapping[str, str]) -> str:
        """Return the file as Papyrus would store it, with these prefixes of *namespaces* that are in use."""
        etree.indent(self.root, "  ")
        kept = dict(self.root.nsmap)
        added = {key: uri for key, uri in namespaces.items() if key not in kept and uri not in kept.values()}
        etree.cleanup_namespaces(self.root, top_nsmap=added, keep_ns_prefixes=["xmi", "uml", "ecore"])
        body = etree.tostring(self.root, encoding="unicode")
        return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}\n'


def _is_uml(element: Element) -> bool:
    return local(element) in ("Model", "Package") and bool(
        _UML_URI.match(etree.QName(element).namespace or "")
    )


def xmi_id(element: Element) -> str:
    """Return the id of an element, empty if it has none."""
    return _xmi_attribute(element, "id")


def uml_type(element: Element) -> str:
    """Return the UML metaclass of an element without its prefix, empty if it is not stated."""
    stated = _xmi_attribute(element, "type") or str(element.get(f"{{{XSI}}}type", ""))
    return stated.rpartition(":")[2]


def _xmi_attribute(element: Element, name: str) -> str:
    for key, value in element.attrib.items():
        if key.endswith(f"}}{name}") and _XMI_URI.match(key[1:]):
            return str(value)
    return ""


def _idref(element: Element) -> str:
    return _xmi_attribute(element, "idref") or str(element.get("href", ""))


def targets(element: Element, feature: str) -> list[str]:
    """Return the ids that a feature states. References to other files are left out."""
    found = str(element.get(feature, "")).split()
    found += [_idref(each) for each in element if local(each) == feature and _idref(each)]
    return [one.removeprefix("#") for one in found if "#" not in one[1:]]


def tag(application: Element | None, *names: str) -> str:
    """Return the value of the first tag that is stated, as an attribute or as a child element."""
    return next(iter(tags(application, *names)), "")


def tags(application: Element | None, *names: str) -> list[str]:
    """Return all values of the first tag that is stated; empty texts and ``null`` count as none."""
    if application is None:
        return []
    for name in names:
        found = [str(application.get(name, ""))]
        found += [each.text or str(each.get("value", "")) for each in application if local(each) == name]
        stated = [one.strip() for one in found if one and one.strip().lower() not in ("", "null")]
        if stated:
            return stated
    return []


ReadPart = Callable[[str], bytes]
"""Returns the bytes of another file by its path, which starts in the folder of the first one."""


def parse(data: bytes, name: str, read_part: ReadPart | None = None) -> XmiFile:
    """Return the tree of a .uml file, with its submodels in other files in their places.

    Entities, document types, the network and files other than .uml files below its folder are out of reach of
    the text.

    Args:
        data: The bytes of the file.
        name: Its name in messages.
        read_part: Reads a submodel; without it, submodels are left out.

    Raises:
        ModelError: it is too large, no XML, not safe, or no UML model.
    """
    root = xml_root(data, name)
    parts = () if read_part is None else _put_together(root, name, read_part)
    count = sum(1 for _ in root.iter(etree.Element))
    if count > MOST_ELEMENTS:
        raise ModelError(f"{count} elements; {MOST_ELEMENTS} are read at most", "", Location(name, 1))
    file = XmiFile(_model_root(root, name), name)
    file.parts = parts
    return file


MOST_PARTS = 100
"""Most files that a model is put together from."""
_PART = re.compile(r"(?P<file>[^#:]+\.uml)#(?P<id>[^#\s]+)\Z")


def _put_together(root: Element, name: str, read_part: ReadPart) -> tuple[str, ...]:
    """Put the elements of other files in the place of references to them; return those files."""
    parts: dict[str, dict[str, Element]] = {}
    waiting = list(_stubs(root, PurePosixPath()))
    for stub, file, target in waiting:  # grows
        if file not in parts:
            if len(parts) >= MOST_PARTS:
                raise ModelError(f"more than {MOST_PARTS} submodels in other files", "", Location(name, 1))
            parts[file] = _part(root, xml_root(read_part(file), file))
        element = parts[file].get(target)
        if element is not None and element not in stub.iterancestors():  # else it is a reference to nothing
            element.tag = stub.tag
            stub.getparent().replace(stub, element)
            waiting += _stubs(element, PurePosixPath(file).parent)
    own = PurePosixPath(name.replace("\\", "/")).name
    if parts:
        _make_local(root, {own, *(PurePosixPath(part).name for part in parts)})
    return tuple(parts)


def _part(root: Element, other: Element) -> dict[str, Element]:
    """Return the elements of another file by their ids; its applied stereotypes go to *root*."""
    for each in list(other):
        if any(key.startswith("base_") for key in each.attrib):
            root.append(each)
    return {xmi_id(each): each for each in other.iter(etree.Element) if xmi_id(each)}


def _make_local(root: Element, files: set[str]) -> None:
    """Turn references to *files* into references within this file."""
    for element in root.iter(etree.Element):
        for key, value in element.attrib.items():
            if ".uml#" in value:
                element.set(key, " ".join(_local_reference(word, files) for word in value.split(" ")))


def _stubs(root: Element, folder: PurePosixPath) -> Iterator[tuple[Element, str, str]]:
    for each in root.iter(etree.Element):
        match = _PART.match(str(each.get("href", ""))) if local(each) == "packagedElement" else None
        if match:
            path = folder / match["file"]
            if not path.is_absolute() and ".." not in path.parts:
                yield each, str(path), match["id"]


def _local_reference(text: str, files: set[str]) -> str:
    """Return a reference to one of *files* as one within this file."""
    match = _PART.match(text)
    return f"#{match['id']}" if match and PurePosixPath(match["file"]).name in files else text


def _model_root(root: Element, name: str) -> Element:
    candidates = [root, *(each for each in root if isinstance(each.tag, str))]
    if any(map(_is_uml, candidates)):
        return root
    for each in candidates:
        if local(each) in _OTHER_FILES:
            kind = _OTHER_FILES[local(each)]
            uml = f"{Path(name).name.partition('.')[0]}.uml"
            what = f"this is a {kind} file, which has no model in it; give the {uml} beside it"
            raise ModelError(what, "", Location(name, each.sourceline or 1))
    what = f"there is no uml:Model in it; its root is {local(root)!r}"
    raise ModelError(what, "", Location(name, root.sourceline or 1))
