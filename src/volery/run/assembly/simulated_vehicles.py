"""Vehicles of the simulated world as ``sim:`` and ``firmware:`` addresses describe them.

This module describes them only and imports nothing that simulates; see ``simulated_fleet`` for that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from volery.base.errors import UsageError, choices
from volery.base.frames import LocalFrame
from volery.base.position import AMSL, Position
from volery.base.time import MS, Ns, from_seconds
from volery.links.wire_faults import FAULT_OPTIONS, WireFaults, parse_wire_faults
from volery.model.environment import (
    SENSOR_SETS,
    STARTS,
    VEHICLE_KINDS,
    FirmwareProgram,
    PlaceSpec,
    VehicleSpec,
    WindSpec,
)
from volery.model.fmu_bodies import Fmu
from volery.simulation.real_firmware.program_search import PROGRAMS
from volery.vehicles.address import Address

HOME = Position(46.0825, -103.8995, AMSL(900))
"""Home of simulated vehicles unless an address or a mission states another."""

RATE_OPTIONS = ("attitude", "rate", "rc")
"""Rates that the driver of a simulated MAVLink autopilot requests, Hz."""

OPTIONS = (
    "body",
    "features",
    "heading",
    "home",
    "kind",
    "names",
    "parameters",
    "sensors",
    "start",
    "system",
    "transmitter",
    "version",
    "wind",
    "wire",
    *RATE_OPTIONS,
    *FAULT_OPTIONS,
)
"""Options of ``sim:AUTOPILOT?``."""
_OF_PROGRAM = ("file", "program", "repeatable")
_NOT_OF_PROGRAM = ("features", "names", "version")
FIRMWARE_OPTIONS = tuple(
    sorted((*_OF_PROGRAM, *(option for option in OPTIONS if option not in _NOT_OF_PROGRAM)))
)
"""Options of ``firmware:AUTOPILOT?``."""

WIRE_MODES = ("values", "bytes")

LINK_DELAY: Ns = 2 * MS
"""One-way delay between an autopilot and a computer on board, over a serial line."""


@dataclass(frozen=True)
class SimulatedVehicle:
    """Description of one simulated vehicle, its surroundings and its link.

    Attributes:
        vehicle: The vehicle as a model describes it.
        frame: Local frame with its origin at home.
        wind: Wind of the world.
        faults: Faults of the link, or None if frames travel as values and not as bytes.
        system: System id, or None for the next free one.
        names: Namespace of its ROS node, if the autopilot has one and offers several.
        rates: Options of the driver: rates that it requests.
        transmitter: Movements of the pilot's transmitter: time ns, channel from 1, pulse width µs.
    """

    vehicle: VehicleSpec
    frame: LocalFrame
    wind: WindSpec
    faults: WireFaults | None = None
    system: int | None = None
    names: str = ""
    rates: Mapping[str, str] = field(default_factory=dict)
    transmitter: tuple[tuple[Ns, int, int], ...] = ()

    @property
    def home(self) -> Position:
        """Home position."""
        at = self.vehicle.at
        return Position(at.latitude, at.longitude, AMSL(at.amsl_m))


def parse_simulated(
    address: Address, name: str, kind: str = "multirotor", home: Position = HOME
) -> SimulatedVehicle:
    """Parse a ``sim:`` or a ``firmware:`` address.

    Options: ``body=FILE`` of an FMU with the usual names, ``home=LAT,LON,AMSL``,
    ``heading=DEG``, ``kind=multirotor|rover``, ``sensors=consumer|rtk``,
    ``start=warm|cold``, ``system=ID``, ``version`` of the firmware, its ``features=all|NAME,...``,
    ``wind=SPEED,FROM_DEG,GUSTS``, ``parameters=NAME:VALUE,...`` of the autopilot, ``names`` of its ROS node,
    ``transmitter=CHANNEL:PULSE@SECONDS,...``, ``rate``, ``attitude`` and ``rc`` in Hz, ``wire=values|bytes``
    and, with bytes, the faults of ``volery.links.wire_faults``.

    A ``firmware:`` address has no version, features and names, but ``program`` (a path or a name, by default
    the usual one of the project), ``file=PARAMETERS,...`` and ``repeatable=0|1``. Raises ``UsageError``.
    """
    real = address.transport == "firmware"
    address.only(*(FIRMWARE_OPTIONS if real else OPTIONS))
    stated = address.numbers("home", 3)
    if stated is not None:
        home = Position(stated[0], stated[1], AMSL(stated[2]))
    latitude, longitude, amsl = home.latitude, home.longitude, home.altitude.metres
    kind = _one_of(address, "kind", VEHICLE_KINDS, kind)
    vehicle = VehicleSpec(
        name=name,
        kind=kind,
        autopilot=address.driver,
        at=PlaceSpec("home", latitude, longitude, amsl, 0.0, 0.0, "home"),
        heading_deg=address.number("heading", 0.0),
        sensors=_one_of(address, "sensors", SENSOR_SETS, "consumer"),
        started=_one_of(address, "start", STARTS, "cold"),
        parameters=_parameters(address),
        version=address.options.get("version", ""),
        features=address.options.get("features", ""),
        firmware=_firmware(address, kind) if real else None,
        body=_body(address, kind),
    )
    wind = WindSpec(*(address.numbers("wind", 3) or ()))
    frame = LocalFrame(latitude, longitude, amsl)
    names = address.options.get("names", "")
    return SimulatedVehicle(
        vehicle,
        frame,
        wind,
        _faults(address),
        _system(address),
        names,
        {name: value for name, value in address.options.items() if name in RATE_OPTIONS},
        _transmitter(address),
    )


def _body(address: Address, kind: str) -> Fmu | None:
    file = address.options.get("body")
    if file is None:
        return None
    if kind != "multirotor":
        raise UsageError(f"{address}: a {kind} has no body of its own; only a multirotor has one")
    return Fmu(Path(file).absolute())


def _firmware(address: Address, kind: str) -> FirmwareProgram:
    usual = PROGRAMS[address.driver].programs if address.driver in PROGRAMS else {}
    program = address.options.get("program") or usual.get(kind, address.driver)
    files = tuple(Path(word) for word in address.options.get("file", "").split(",") if word)
    return FirmwareProgram(program, files, _one_of(address, "repeatable", ("0", "1"), "0") == "1")


def _transmitter(address: Address) -> tuple[tuple[Ns, int, int], ...]:
    """Return the movements that ``transmitter=6:1500,6:1800@30`` states; without a time at the start."""
    found = []
    for part in filter(None, address.options.get("transmitter", "").split(",")):
        move, _, at = part.partition("@")
        channel, _, pulse = move.partition(":")
        try:
            moved = from_seconds(float(at or "0")), int(channel), int(pulse)
        except (ValueError, OverflowError):
            moved = -1, 0, 0
        if moved[0] < 0 or not 1 <= moved[1] <= 16 or not 0 <= moved[2] <= 3000:
            raise UsageError(
                f"{address}: transmitter={part!r} should be CHANNEL:PULSE or CHANNEL:PULSE@SECONDS, "
                "separated by commas, with channels 1 to 16 and pulses in microseconds"
            )
        found.append(moved)
    return tuple(found)


def _parameters(address: Address) -> dict[str, float]:
    found: dict[str, float] = {}
    for part in filter(None, address.options.get("parameters", "").split(",")):
        name, colon, value = part.partition(":")
        try:
            found[name] = float(value)
        except ValueError:
            colon = ""
        if not colon or not name:
            raise UsageError(f"{address}: parameters={part!r} should be NAME:VALUE, separated by commas")
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
    carrier = _one_of(address, "wire", WIRE_MODES, "values")
    wanted = {name: value for name, value in address.options.items() if name in FAULT_OPTIONS}
    if carrier == "values":
        if wanted:
            raise UsageError(f"{address}: {choices(wanted)} needs a link through bytes; add wire=bytes")
        return None
    return parse_wire_faults(wanted)
