"""Vehicles that ``sim:`` addresses describe."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from volery.base.errors import UsageError, choices
from volery.base.frames import LocalFrame
from volery.base.position import AMSL, Position
from volery.base.seeds import stream
from volery.base.time import MS, Ns
from volery.kernel.api import Kernel
from volery.links.link import Link
from volery.links.wire_faults import FAULT_OPTIONS, WireFaults, faulty_pair, parse_wire_faults
from volery.model.environment import SENSOR_SETS, STARTS, VEHICLE_KINDS, Place, Vehicle, Wind
from volery.vehicles.address import Address

if TYPE_CHECKING:
    from volery.run.assembly.simulated_fleet import SimulatedFleet

HOME = Position(46.0825, -103.8995, AMSL(900))
"""Where simulated vehicles stand unless an address or a mission says otherwise."""

OPTIONS = (
    "heading",
    "home",
    "kind",
    "names",
    "parameters",
    "sensors",
    "start",
    "system",
    "wind",
    "wire",
    *FAULT_OPTIONS,
)
"""What may follow ``sim:AUTOPILOT?``."""

CARRIERS = ("values", "bytes")

LINK_DELAY: Ns = 2 * MS
"""One way between an autopilot and the computer beside it, over a serial line."""


@dataclass(frozen=True)
class SimulatedVehicle:
    """What a ``sim:`` address describes: a vehicle in a world of its own, and the wire to it.

    ``faults`` is ``None`` where frames travel as values. ``names`` are those of its node, where its autopilot
    is reached over a graph and has more than one set of them.
    """

    vehicle: Vehicle
    frame: LocalFrame
    wind: Wind
    faults: WireFaults | None = None
    system: int | None = None
    names: str = ""

    @property
    def home(self) -> Position:
        """Where it stands."""
        at = self.vehicle.at
        return Position(at.latitude, at.longitude, AMSL(at.amsl_m))


def parse_simulated(
    address: Address, name: str, kind: str = "multirotor", home: Position = HOME
) -> SimulatedVehicle:
    """Read a ``sim:`` address; *kind* and *home* hold unless it says otherwise.

    Options: ``home=LAT,LON,AMSL``, ``heading=DEG``, ``kind=multirotor|rover``, ``sensors=consumer|rtk``,
    ``start=warm|cold``, ``system=ID``, ``wind=SPEED,FROM_DEG,GUSTS``, ``parameters=NAME:VALUE,...`` of the
    autopilot, ``names`` of its node on a graph, ``wire=values|bytes`` and, through bytes, the faults of
    ``volery.links.wire_faults``. Raises ``UsageError``.
    """
    address.only(*OPTIONS)
    stated = address.numbers("home", 3)
    if stated is not None:
        home = Position(stated[0], stated[1], AMSL(stated[2]))
    latitude, longitude, amsl = home.latitude, home.longitude, home.altitude.metres
    vehicle = Vehicle(
        name=name,
        kind=_one_of(address, "kind", VEHICLE_KINDS, kind),
        autopilot=address.driver,
        at=Place("home", latitude, longitude, amsl, 0.0, 0.0, "home"),
        heading_deg=address.number("heading", 0.0),
        sensors=_one_of(address, "sensors", SENSOR_SETS, "consumer"),
        started=_one_of(address, "start", STARTS, "cold"),
        parameters=_parameters(address),
    )
    wind = Wind(*(address.numbers("wind", 3) or ()))
    frame = LocalFrame(latitude, longitude, amsl)
    names = address.options.get("names", "")
    return SimulatedVehicle(vehicle, frame, wind, _faults(address), _system(address), names)


def _parameters(address: Address) -> dict[str, float]:
    found: dict[str, float] = {}
    for part in filter(None, address.options.get("parameters", "").split(",")):
        name, colon, value = part.partition(":")
        try:
            found[name] = float(value)
        except ValueError:
            colon = ""
        if not colon or not name:
            raise UsageError(f"{address}: parameters={part!r} should be NAME:VALUE, joined by commas")
    return found


def _system(address: Address) -> int | None:
    given = address.options.get("system")
    if given is None:
        return None
    if not given.isdecimal() or not 1 <= int(given) <= 250:
        raise UsageError(f"{address}: system={given!r} is no system id from 1 to 250")
    return int(given)


def _one_of(address: Address, option: str, valid: tuple[str, ...], default: str) -> str:
    given = address.options.get(option, default)
    if given not in valid:
        raise UsageError(f"{address}: {option}={given!r}; there is {choices(valid)}")
    return given


def _faults(address: Address) -> WireFaults | None:
    carrier = _one_of(address, "wire", CARRIERS, "values")
    wanted = {name: value for name, value in address.options.items() if name in FAULT_OPTIONS}
    if carrier == "values":
        if wanted:
            raise UsageError(f"{address}: {choices(wanted)} happens to bytes; add wire=bytes")
        return None
    return parse_wire_faults(wanted)


def link_to(kernel: Kernel, airfield: SimulatedFleet, wanted: SimulatedVehicle, seed: int) -> Link:
    """A link to its autopilot, as the address wants it."""
    name = wanted.vehicle.name
    if wanted.faults is None:
        return airfield.link(name)
    random = stream(seed, f"wire/{name}")
    ours, theirs = faulty_pair(
        kernel, name, wanted.faults, random, delay=LINK_DELAY, codec=airfield.codec(name)
    )
    airfield.autopilots[name].connect(theirs)
    return ours
