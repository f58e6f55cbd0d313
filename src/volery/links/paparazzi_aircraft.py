"""The XML files of a Paparazzi aircraft: numbers of its settings, flight-plan blocks and waypoints.

Messages carry numbers that differ from aircraft to aircraft. Their meaning is in the files that the build of
an aircraft leaves in ``var/aircrafts/NAME``: ``settings.xml``, ``flight_plan.xml``, ``conf_aircraft.xml``.
The reader is hardened: no entities, no network, no document type definitions. Nothing is assumed of an
aircraft whose files are not given. ``stock_aircraft`` describes the simulated aircraft, which proves in ALIVE
that it is the one described.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from hashlib import md5
from importlib.resources import files
from pathlib import Path
from re import split
from typing import Any, TypeVar

from lxml import etree

from volery.base.errors import Location, ModelError, UsageError, choices, did_you_mean

MAX_FILE_SIZE = 8_000_000
"""Bytes of a file; the settings file of a large aircraft has about 100 kB."""

CONFIGURATION = Path("conf", "conf_aircraft.xml")
"""File of an aircraft's folder that lies deeper than the others."""

PREFERRED_MODULE = "autopilot"
"""Module whose setting is meant if several modules have one of the same name."""

GENERATED_AUTOPILOT = "autopilot_generated"
"""Header of the setting that lists the modes of an autopilot generated from a state machine in XML."""

FIRST_WAYPOINT = 1
"""Number of the first waypoint of a plan; in the aircraft an unnamed waypoint precedes it."""


@dataclass(frozen=True)
class AircraftSetting:
    """A variable that can be set in flight. ``name`` is the short name, else the variable.

    ``header`` is the file of the aircraft's code that declares the variable, where the XML states one.
    """

    number: int
    name: str
    variable: str
    low: float
    high: float
    words: tuple[str, ...] = ()
    header: str = ""


@dataclass(frozen=True)
class Block:
    """A block of the flight plan, to which the aircraft can be commanded."""

    number: int
    name: str


@dataclass(frozen=True)
class PlanWaypoint:
    """A waypoint, in metres east and north of the plan's origin; NaN where the plan gives degrees."""

    number: int
    name: str
    east: float
    north: float


@dataclass(frozen=True)
class PaparazziAircraft:
    """Settings, blocks and waypoints of one aircraft.

    Args:
        source: Where the description was read, for messages.
        name: Name of the aircraft.
        system: Id of the aircraft; None if the files do not contain it.
        settings: Settings by number.
        blocks: Flight-plan blocks by number.
        waypoints: Waypoints by number.
        farthest: Distance from home in metres at which the aircraft turns back; None if not given.
        fingerprint: Checksum that the aircraft sends in ALIVE; empty if the files do not contain it.
    """

    source: str
    name: str = ""
    system: int | None = None
    settings: tuple[AircraftSetting, ...] = ()
    blocks: tuple[Block, ...] = ()
    waypoints: tuple[PlanWaypoint, ...] = ()
    farthest: float | None = None
    fingerprint: tuple[int, ...] = ()

    def setting(self, name: str) -> AircraftSetting:
        """Return the setting that a ground station finds under *name*.

        The first of these that fits decides: the short name, the variable, the variable without its
        structure (``autopilot.mode``), and without the prefix of its module (``autopilot_mode``). A
        variable that is listed more than once is set by the first of its numbers, as Paparazzi's own ground
        station does.

        Raises:
            UsageError: There is none, or several variables fit equally well.
        """
        ranks = (
            [one for one in self.settings if one.name == name],
            [one for one in self.settings if one.variable == name],
            [one for one in self.settings if _member(one.variable) == name],
            [one for one in self.settings if one.variable == f"{PREFERRED_MODULE}_{name}"],
        )
        found = next((rank for rank in ranks if rank), [])
        if len(found) > 1:
            found = [one for one in found if one.variable.startswith(PREFERRED_MODULE)] or found
        if len({one.variable for one in found}) == 1:
            return found[0]
        if found:
            listed = choices([f"{one.number} ({one.variable})" for one in found])
            raise UsageError(f"{self.source}: {name!r} may be setting {listed}")
        raise self._lacks("setting", name, [one.name for one in self.settings])

    @property
    def generated_modes(self) -> tuple[str, ...]:
        """Modes of a generated autopilot in the order of their numbers; empty for the static autopilot."""
        return next((one.words for one in self.settings if one.header == GENERATED_AUTOPILOT), ())

    def block(self, name: str) -> Block:
        """Return the block called *name*; raise ``UsageError`` listing the blocks otherwise."""
        for one in self.blocks:
            if one.name == name:
                return one
        raise self._lacks("block", name, [one.name for one in self.blocks])

    def waypoint(self, name: str) -> PlanWaypoint:
        """Return the waypoint called *name*; raise ``UsageError`` listing the waypoints otherwise."""
        for one in self.waypoints:
            if one.name == name:
                return one
        raise self._lacks("waypoint", name, [one.name for one in self.waypoints])

    def _lacks(self, what: str, name: str, names: Sequence[str]) -> UsageError:
        listed = f"it has {choices(names)}" if len(names) <= 40 else f"it has {len(names)}"
        return UsageError(f"{self.source}: no {what} {name!r}{did_you_mean(name, names)}; {listed}")


def _member(variable: str) -> str:
    """Return the last member of a C expression: ``mode`` of ``autopilot.mode`` and of ``pilot->mode``."""
    return split(r"\.|->", variable)[-1]


@cache
def stock_aircraft() -> PaparazziAircraft:
    """Return the simulated rotorcraft; its fingerprint is the checksum of the two files that describe it."""
    aircraft = PaparazziAircraft("the simulated rotorcraft")
    folder = files("volery.links").joinpath("stock_rotorcraft")
    checksum = md5(usedforsecurity=False)
    for name in ("settings.xml", "flight_plan.xml"):
        document = folder.joinpath(name).read_bytes()
        checksum.update(document)
        aircraft = _with(aircraft, _root(document, name), name)
    return replace(aircraft, fingerprint=tuple(checksum.digest()))


def read_aircraft(path: Path) -> PaparazziAircraft:
    """Return the aircraft described by the XML at *path*.

    Args:
        path: The folder of the aircraft, or one file that contains all of it. In a folder every ``.xml`` file
            is read in the order of names, then ``conf/conf_aircraft.xml``; the root element determines the
            kind.

    Raises:
        UsageError: There is nothing to read, or no settings, or no flight plan: these differ from aircraft to
            aircraft and are never assumed.
        ModelError: A file is wrong; the error names file and line.
    """
    aircraft = PaparazziAircraft(str(path))
    for file in _documents(path):
        if file.stat().st_size > MAX_FILE_SIZE:
            raise UsageError(f"{file}: larger than {MAX_FILE_SIZE} bytes: not a file of an aircraft")
        root = _root(file.read_bytes(), str(file), recover=file.name == CONFIGURATION.name)
        aircraft = _with(aircraft, root, str(file))
    lacks = " and ".join(
        what
        for what, found in (("settings", aircraft.settings), ("flight plan", aircraft.blocks))
        if not found
    )
    if lacks:
        raise UsageError(f"{path}: no {lacks} there; give a folder var/aircrafts/NAME")
    return aircraft


def _documents(path: Path) -> list[Path]:
    try:
        found = sorted(path.glob("*.xml")) if path.is_dir() else [path]
        if found and (deeper := path / CONFIGURATION).is_file():
            found.append(deeper)
        if found and all(file.is_file() for file in found):
            return found
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror or error}") from None
    raise UsageError(f"{path}: no XML of an aircraft there; give a folder var/aircrafts/NAME or a file of it")


def _root(document: bytes, name: str, *, recover: bool = False) -> Any:
    """Return the root element; with *recover* an unescaped ``&`` of C code is skipped."""
    parser = etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        dtd_validation=False,
        huge_tree=False,
        recover=recover,
    )
    try:
        root = etree.fromstring(document, parser)
    except etree.XMLSyntaxError as error:
        raise ModelError(f"not XML: {error.msg}", where=Location(name, error.lineno or 0)) from None
    if root is None:
        raise ModelError("not XML", where=Location(name, 0))
    subset = root.getroottree().docinfo.internalDTD
    if subset is not None and any(subset.iterentities()):
        raise ModelError("entities are not read", where=Location(name, 1))
    return root


def _with(aircraft: PaparazziAircraft, root: Any, file: str) -> PaparazziAircraft:
    """Return *aircraft* with the content of one document; documents of other kinds change nothing."""
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


def _settings(root: Any, file: str) -> Iterable[AircraftSetting]:
    for number, element in enumerate(root.iter("dl_setting")):
        given = {name.lower(): value for name, value in element.attrib.items()}
        variable = given.get("var", "")
        words = tuple(word for word in given.get("values", "").split("|") if word)
        low, high = (_float(given.get(name, "0"), name, element, file) for name in ("min", "max"))
        name, header = given.get("shortname") or variable, given.get("header", "")
        yield AircraftSetting(number, name, variable, low, high, words, header)


def _blocks(plan: Any, file: str) -> Iterable[Block]:
    for place, element in enumerate(plan.iterfind("blocks/block")):
        number = int(_number(element, "no", file)) if "no" in element.attrib else place
        yield Block(number, _name(element, file))


def _waypoints(plan: Any, file: str) -> Iterable[PlanWaypoint]:
    for number, element in enumerate(plan.iterfind("waypoints/waypoint"), FIRST_WAYPOINT):
        east, north = (
            _number(element, name, file) if name in element.attrib else float("nan") for name in ("x", "y")
        )
        yield PlanWaypoint(number, _name(element, file), east, north)


Named = TypeVar("Named", AircraftSetting, Block, PlanWaypoint)


def _unique(found: Iterable[Named], file: str) -> tuple[Named, ...]:
    """Return *found* as a tuple; raise ``ModelError`` if a number is out of range or used twice."""
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
