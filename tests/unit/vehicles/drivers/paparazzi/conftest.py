"""A scripted Paparazzi rotorcraft: no acknowledgements, slow telemetry, settings by number, blocks of a plan.

It does at once what the public definitions say, and can be set to misbehave.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import cos, pi, radians, sin
from typing import Any

import pytest

from rigs.bench import Bench
from volery.base.frames import geodetic_to_ecef
from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.link import Link
from volery.links.paparazzi_aircraft import stock_aircraft
from volery.links.pprzlink_codec import PPRZLINK
from volery.links.pprzlink_messages import entry_value
from volery.vehicles.drivers.paparazzi import open_driver
from volery.vehicles.drivers.paparazzi.decoder import NUMBERS

ORIGIN = (43.4622222, 1.2733333)  # degrees
AMSL_M, GEOID_M = 185.0, 48.5
AIRCRAFT = 7
NAMES = {number: name for name, number in NUMBERS.items()}
FIRST_STEADY_BLOCK, START, TAKEOFF, STANDBY, LAND_HERE, FLARE, LANDED = 2, 3, 4, 5, 13, 15, 16
OTHER_SETTING = 1.0
FARTHEST_M = 150.0
HOVER_THRUST, FULL_THRUST = 6040.0, 9600.0
THRUST_LOST = 50.0
"""Thrust that it loses in 0.1 s on the ground while it is to sink: it sees after 12 s that it has landed."""


@dataclass
class Craft:
    """What the aircraft believes."""

    mode: str = "NAV"
    armed: bool = False
    flying: bool = False
    block: int = FIRST_STEADY_BLOCK
    north: float = 0.0
    east: float = 0.0
    up: float = 0.0
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    psi: float = 0.0
    fix: str = "3D"
    arming: str = "WAITING"
    auto2: int = 13
    placed: bool = True
    volts: float = 12.25
    thrust: float = 0.0


@dataclass
class FakePaparazzi:
    """``numbers`` are those of its settings. ``locked`` settings are not taken. ``ends`` are seconds from a
    block to what it leads to.
    """

    kernel: VirtualKernel
    link: Link
    kind: int = 2
    craft: Craft = field(default_factory=Craft)
    numbers: dict[int, str] = field(
        default_factory=lambda: {
            0: "telemetry",
            1: "video",
            2: "gps",
            3: "auto2",
            4: "kill_throttle",
            5: "mode",
        }
    )
    locked: set[str] = field(default_factory=set)
    deaf: bool = False
    mute: bool = False
    received: list[Frame] = field(default_factory=list)
    sticks_at: int = -(10**12)
    transmitter: bool = False
    fingerprint: tuple[int, ...] = stock_aircraft().fingerprint
    sticks_by_datalink: bool = True
    throttle: float = 0.0
    climbs_by_stick: bool = True
    swinging: float = 1.0
    lands_late: bool = False
    on_ground: Callable[[], object] = bool
    silenced: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.link.receive(self._receive)
        for period, speak in (
            (250, self._fp),
            (1200, self.status),
            (1600, self._nav),
            (2100, self._alive),
            (5100, self._ref),
            (250, self._gps),
            (2500, self._energy),
        ):
            self.kernel.every(period * MS, speak)
        self.kernel.every(100 * MS, self._move)

    # -- speaking

    def say(self, name: str, **fields: Any) -> None:
        if not self.mute and name not in self.silenced:
            self.link.send(Frame(name, fields, AIRCRAFT, 0))

    def _alive(self) -> None:
        self.say("ALIVE", md5sum=self.fingerprint)

    def _fp(self) -> None:
        craft = self.craft
        north, east, up = craft.velocity
        self.say(
            "ROTORCRAFT_FP",
            east=round(craft.east * 256),
            north=round(craft.north * 256),
            up=round(craft.up * 256),
            veast=round(east * 2**19),
            vnorth=round(north * 2**19),
            vup=round(up * 2**19),
            psi=round(craft.psi * 4096),
            thrust=round(craft.thrust),
        )

    def status(self) -> None:
        craft = self.craft
        self.say(
            "ROTORCRAFT_STATUS",
            rc_status=0 if self._hears_sticks() else 2,
            gps_status=entry_value("ROTORCRAFT_STATUS", "gps_status", craft.fix),
            ap_mode=NUMBERS[craft.mode],
            ap_in_flight=craft.flying,
            ap_motors_on=craft.armed,
            arming_status=entry_value("ROTORCRAFT_STATUS", "arming_status", craft.arming),
            vsupply=craft.volts,
        )

    def _nav(self) -> None:
        self.say("ROTORCRAFT_NAV_STATUS", cur_block=self.craft.block)

    def _ref(self) -> None:
        if not self.craft.placed:
            self.say("INS_REF")
            return
        x, y, z = geodetic_to_ecef(*ORIGIN, AMSL_M + GEOID_M)
        self.say(
            "INS_REF",
            ecef_x0=round(x * 100),
            ecef_y0=round(y * 100),
            ecef_z0=round(z * 100),
            lat0=round(ORIGIN[0] * 1e7),
            lon0=round(ORIGIN[1] * 1e7),
            alt0=round((AMSL_M + GEOID_M) * 1000),
            hmsl0=round(AMSL_M * 1000),
        )

    def _gps(self) -> None:
        self.say("GPS_INT", numsv=11)

    def _energy(self) -> None:
        self.say("ENERGY", voltage=12.5, current=3.5)

    # -- listening

    def _receive(self, frame: Frame) -> None:
        if self.deaf:
            return
        self.received.append(frame)
        fields = frame.fields
        if fields.get("ac_id", AIRCRAFT) != AIRCRAFT:
            return
        handler: Callable[[dict[str, Any]], None] = getattr(self, f"_{frame.name.lower()}", lambda _: None)
        handler(fields)

    def _get_setting(self, fields: dict[str, Any]) -> None:
        name = self.numbers.get(fields["index"], "")
        craft = self.craft
        values = {"auto2": craft.auto2, "mode": NUMBERS[craft.mode], "kill_throttle": float(not craft.armed)}
        self.say("DL_VALUE", index=fields["index"], value=values.get(name, OTHER_SETTING))

    def _setting(self, fields: dict[str, Any]) -> None:
        name, value = self.numbers.get(fields["index"], ""), fields["value"]
        if name in self.locked:
            return
        if name == "auto2":
            self.craft.auto2 = int(value)
            if self._hears_sticks():
                self.enter(NAMES[int(value)])
        elif name == "mode" and not self._refuses(value):
            self.craft.mode = NAMES[int(value)]
        elif name == "kill_throttle":
            self._motors(value == 0.0)
        self._get_setting(fields)

    def _block(self, fields: dict[str, Any]) -> None:
        craft = self.craft
        craft.block = fields["block_id"]
        if craft.block == START and craft.mode == "NAV":
            self._motors(True)
        elif craft.block == LAND_HERE:
            craft.block = FLARE

    def _guided_setpoint_ned(self, fields: dict[str, Any]) -> None:
        craft = self.craft
        if craft.mode != "GUIDED":
            return
        if fields["flags"] == 0:
            craft.north, craft.east, craft.up = fields["x"], fields["y"], -fields["z"]
            craft.psi, craft.velocity = fields["yaw"], (0.0, 0.0, 0.0)
            craft.flying = craft.armed and craft.up > 0.0
        elif fields["flags"] == 0xE0:
            craft.velocity = fields["x"], fields["y"], -fields["z"]
        elif fields["flags"] == 0x40:
            craft.north, craft.east = fields["x"], fields["y"]
            craft.velocity = (0.0, 0.0, -fields["z"] if craft.up > 0.0 else 0.0)

    def _rc_up(self, fields: dict[str, Any]) -> None:
        if self.sticks_by_datalink:
            self.sticks_at = self.kernel.now()
            self.throttle = fields["channels"][3] / 127
        if self.craft.mode == "FAILSAFE":
            return  # only a switch at MANUAL ends it
        if (
            self._hears_sticks()
            and fields["channels"][4] == 127
            and self.craft.mode != NAMES[self.craft.auto2]
        ):
            self.enter(NAMES[self.craft.auto2])

    def _emergency_cmd(self, fields: dict[str, Any]) -> None:
        if fields["cmd"] == 0:
            self._motors(False)
            self.enter("KILL")

    def _refuses(self, mode: float) -> bool:
        """Refuse modes of sticks without a transmitter, and modes of the computer with one."""
        return mode > 2 and (self._hears_sticks() or mode not in (13, 19))

    # -- flying

    def _hears_sticks(self) -> bool:
        return self.transmitter or self.kernel.now() - self.sticks_at < S

    def _motors(self, on: bool) -> None:
        craft = self.craft
        craft.armed = on and craft.mode != "KILL" and craft.arming == "WAITING"
        if craft.armed and craft.mode == "GUIDED" and not craft.flying:
            craft.flying, craft.up = True, 0.5
        craft.flying = craft.flying and craft.armed

    def enter(self, mode: str) -> None:
        """Change the mode, at once and reported at once."""
        self.craft.mode = mode
        self.status()

    def _move(self) -> None:
        craft = self.craft
        north, east, up = craft.velocity if craft.mode == "GUIDED" else (0.0, 0.0, 0.0)
        craft.north, craft.east, craft.up = (
            craft.north + north / 10,
            craft.east + east / 10,
            craft.up + up / 10,
        )
        if craft.mode == "GUIDED" and craft.up < 0.0:
            craft.up, craft.velocity, craft.flying = 0.0, (0.0, 0.0, 0.0), self.lands_late
            self.on_ground()
        carried = HOVER_THRUST * self.swinging if craft.up > 0.0 else max(0.0, craft.thrust - THRUST_LOST)
        craft.thrust = carried if craft.armed else 0.0
        if craft.mode == "NAV" and craft.flying and craft.north**2 + craft.east**2 > FARTHEST_M**2:
            self.enter("HOME")
        if craft.mode == "NAV" and craft.armed:
            if craft.block == TAKEOFF:
                craft.up, craft.flying = craft.up + 0.1, True
                craft.block = STANDBY if craft.up > 2.0 else TAKEOFF
            elif craft.block == FLARE:
                self._sink(LANDED)
        elif craft.mode == "FAILSAFE" and craft.armed:
            self._sink(craft.block)
        elif craft.mode == "ATTITUDE_DIRECT" and craft.flying and self.climbs_by_stick:
            craft.thrust = self.throttle * FULL_THRUST
            push = 9.81 * (craft.thrust / HOVER_THRUST - 1.0)
            rate = craft.velocity[2] + push / 10
            rate = rate if craft.up > 0.0 else max(0.0, rate)
            craft.velocity = (0.0, 0.0, rate)
            craft.up = max(0.0, craft.up + rate / 10)

    def _sink(self, then: int) -> None:
        craft = self.craft
        craft.up = max(0.0, craft.up - 0.2)
        if craft.up == 0.0:
            self._motors(False)
            craft.block = then
            if craft.mode == "FAILSAFE":
                self.enter("KILL")

    def sent(self, name: str) -> list[dict[str, Any]]:
        """The fields of all frames of this name that it received."""
        return [frame.fields for frame in self.received if frame.name == name]

    def written(self, name: str) -> list[float]:
        """What was written to a setting."""
        return [fields["value"] for fields in self.sent("SETTING") if self.numbers[fields["index"]] == name]


def place(north: float, east: float) -> tuple[float, float]:
    """Degrees of so many metres north and east of the origin, good to a millimetre over 100 m."""
    curvature = 6_378_137.0 / (1.0 - 0.00669438 * sin(radians(ORIGIN[0])) ** 2) ** 0.5
    along = curvature * (1.0 - 0.00669438) / (1.0 - 0.00669438 * sin(radians(ORIGIN[0])) ** 2)
    height = AMSL_M + GEOID_M
    latitude = ORIGIN[0] + north / (along + height) * 180.0 / pi
    longitude = ORIGIN[1] + east / ((curvature + height) * cos(radians(ORIGIN[0]))) * 180.0 / pi
    return latitude, longitude


class PaparazziBench(Bench):
    peer = FakePaparazzi
    opener = staticmethod(open_driver)
    codec = PPRZLINK


@pytest.fixture
def bench() -> Callable[..., Bench]:
    return PaparazziBench
