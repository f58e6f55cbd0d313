"""A Paparazzi aircraft's own XML: which number its settings, blocks and waypoints have.

Messages carry numbers that differ from aircraft to aircraft. What they mean stands in the files that are left
in ``var/aircrafts/NAME`` when it is built: ``settings.xml``, ``flight_plan.xml``, ``conf_aircraft.xml``. They
are read here, hardened: no entities, no network, no document type definitions. ``stock_aircraft`` is what is
assumed of an aircraft whose files are not given.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

from lxml import etree

from volery.base.errors import Location, ModelError, UsageError, choices, did_you_mean

MAX_FILE_SIZE = 8_000_000
"""Bytes of a file; a settings file of a large aircraft has some 100 kB."""

FIRST_WAYPOINT = 1
"""In the aircraft a nameless one stands before those of the plan."""


@dataclass(frozen=True)
class Setting:
    """A variable that can be set in flight, under the name that a ground station shows: ``shortname``."""

    number: int
    name: str
    variable: str
    low: float
    high: float
    words: tuple[str, ...] = ()


@dataclass(frozen=True)
class Block:
    """A part of the flight plan that one can order the aircraft to."""

    number: int
    name: str


@dataclass(frozen=True)
class Waypoint:
    """Where it is: metres east and north of the plan's origin, or NaN where the plan gives degrees."""

    number: int
    name: str
    east: float
    north: float


@dataclass(frozen=True)
class PaparazziAircraft:
    """What is known of one. ``system`` is its id, ``farthest`` the metres from home at which it turns back
    by itself; ``None`` where the files do not say. ``source`` says where it was read, for messages.
    """

    source: str
    name: str = ""
    system: int | None = None
    settings: tuple[Setting, ...] = ()
    blocks: tuple[Block, ...] = ()
    waypoints: tuple[Waypoint, ...] = ()
    farthest: float | None = None

    def setting(self, name: str) -> Setting:
        """The setting called so, by name or variable. Raises ``UsageError`` naming those that are alike."""
        for one in self.settings:
            if name in (one.name, one.variable):
                return one
        raise self._lacks("setting", name, [one.name for one in self.settings])

    def block(self, name: str) -> Block:
        """The block called so; raises ``UsageError`` naming those that there are."""
        for one in self.blocks:
            if one.name == name:
                return one
        raise self._lacks("block", name, [one.name for one in self.blocks])

    def waypoint(self, name: str) -> Waypoint:
        """The waypoint called so; raises ``UsageError`` naming those that there are."""
        for one in self.waypoints:
            if one.name == name:
                return one
        raise self._lacks("waypoint", name, [one.name for one in self.waypoints])

    def _lacks(self, what: str, name: str, names: Sequence[str]) -> UsageError:
        listed = f"it has {choices(names)}" if len(names) <= 40 else f"it has {len(names)}"
        return UsageError(f"{self.source}: no {what} {name!r}{did_you_mean(name, names)}; {listed}")


@cache
def stock_aircraft() -> PaparazziAircraft:
    """The stock rotorcraft: what an aircraft is taken for whose own files are not given."""
    aircraft = PaparazziAircraft("the stock rotorcraft")
    folder = files("volery.links").joinpath("stock_rotorcraft")
    for name in ("settings.xml", "flight_plan.xml"):
        document = folder.joinpath(name).read_bytes()
        aircraft = _with(aircraft, _root(document, name), name)
    return aircraft


def read_aircraft(path: Path) -> PaparazziAircraft:
    """The aircraft whose XML is *path*: its folder, or one file of it.

    Of a folder, every ``.xml`` file is looked at, in the order of names, and told by its root element. What
    no file says is as in the stock rotorcraft, by whole lists.

    Raises ``UsageError`` if there is nothing to read, ``ModelError`` naming file and line of what is wrong.
    """
    aircraft = PaparazziAircraft(str(path))
    for file in _documents(path):
        if file.stat().st_size > MAX_FILE_SIZE:
            raise UsageError(f"{file}: larger than {MAX_FILE_SIZE} bytes: not a file of an aircraft")
        aircraft = _with(aircraft, _root(file.read_bytes(), str(file)), str(file))
    if not (aircraft.settings or aircraft.blocks):
        raise UsageError(f"{path}: neither settings nor a flight plan; give a folder var/aircrafts/NAME")
    stock = stock_aircraft()
    return replace(
        aircraft,
        settings=aircraft.settings or stock.settings,
        blocks=aircraft.blocks or stock.blocks,
        waypoints=aircraft.waypoints or stock.waypoints,
    )


def _documents(path: Path) -> list[Path]:
    try:
        found = sorted(path.glob("*.xml")) if path.is_dir() else [path]
        if found and all(file.is_file() for file in found):
            return found
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror or error}") from None
    raise UsageError(f"{path}: no XML of an aircraft there; give a folder var/aircrafts/NAME or a file of it")


def _root(document: bytes, name: str) -> Any:
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, dtd_validation=False, huge_tree=False
    )
    try:
        root = etree.fromstring(document, parser)
    except etree.XMLSyntaxError as error:
        raise ModelError(f"not XML: {error.msg}", where=Location(name, error.lineno or 0)) from None
    subset = root.getroottree().docinfo.internalDTD
    if subset is not None and any(subset.iterentities()):
        raise ModelError("entities are not read", where=Location(name, 1))
    return root


def _with(aircraft: PaparazziAircraft, root: Any, file: str) -> PaparazziAircraft:
    """*aircraft* and what this document says of it; others say nothing."""
    if root.tag == "settings":
        return replace(aircraft, settings=_unique(_settings(root, file), file))
    plan = root if root.tag == "flight_plan" else root.find("flight_plan")
    if plan is not None:
        return replace(
            aircraft,
            blocks=_unique(_blocks(plan, file), file),
            waypoints=_unique(_waypoints(plan, file), file),
            farthest=_number(plan, "max_dist_from_home", file)
            if "max_dist_from_home" in plan.attrib
            else None,
        )
    described = root if root.tag == "aircraft" else root.find("aircraft") if root.tag == "conf" else None
    if described is not None and "ac_id" in described.attrib:
        system = _number(described, "ac_id", file)
        return replace(aircraft, system=int(system), name=described.get("name", ""))
    return aircraft


def _settings(root: Any, file: str) -> Iterable[Setting]:
    for number, element in enumerate(root.iter("dl_setting")):
        given = {name.lower(): value for name, value in element.attrib.items()}
        variable = given.get("var", "")
        words = tuple(word for word in given.get("values", "").split("|") if word)
        low, high = (_float(given.get(name, "0"), name, element, file) for name in ("min", "max"))
        yield Setting(number, given.get("shortname") or variable, variable, low, high, words)


def _blocks(plan: Any, file: str) -> Iterable[Block]:
    for place, element in enumerate(plan.iterfind("blocks/block")):
        number = int(_number(element, "no", file)) if "no" in element.attrib else place
        yield Block(number, _name(element, file))


def _waypoints(plan: Any, file: str) -> Iterable[Waypoint]:
    for number, element in enumerate(plan.iterfind("waypoints/waypoint"), FIRST_WAYPOINT):
        east, north = (
            _number(element, name, file) if name in element.attrib else float("nan") for name in ("x", "y")
        )
        yield Waypoint(number, _name(element, file), east, north)


Named = TypeVar("Named", Setting, Block, Waypoint)


def _unique(found: Iterable[Named], file: str) -> tuple[Named, ...]:
    """All of them; two with one number could not both be meant."""
    listed = tuple(found)
    numbers: dict[int, str] = {}
    for one in listed:
        if not 0 <= one.number <= 255:
            raise ModelError(
                f"{one.name!r} has number {one.number}; a message has room for 0 to 255",
                where=Location(file, 0),
            )
        if one.number in numbers:
            other = numbers[one.number]
            raise ModelError(
                f"{one.name!r} and {other!r} both have number {one.number}", where=Location(file, 0)
            )
        numbers[one.number] = one.name
    return listed


def _name(element: Any, file: str) -> str:
    name = element.get("name")
    if name is None:
        raise ModelError(f"a {element.tag} without a name", where=Location(file, element.sourceline or 0))
    return str(name)


def _number(element: Any, name: str, file: str) -> float:
    return _float(element.get(name), name, element, file)


def _float(text: str, name: str, element: Any, file: str) -> float:
    try:
        return float(text)
    except ValueError:
        where = Location(file, element.sourceline or 0)
        raise ModelError(f"{element.tag}: {name}={text!r} is not a number", where=where) from None
