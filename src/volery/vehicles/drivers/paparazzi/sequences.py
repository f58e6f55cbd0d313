"""Pieces that sequences of steps are made of: modes, motors, and places in the aircraft's local frame.

Off the ground and down again: by blocks of the flight plan in NAV, or in GUIDED where NAV would turn back.

In NAV an aircraft goes home by itself if it is further from there than its plan allows. So blocks are flown
only well inside that distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import radians

from volery.base.errors import CapabilityError, Refused
from volery.base.position import AMSL, AboveHome, Position
from volery.base.time import Ns, S
from volery.kernel.api import Action, Kernel
from volery.vehicles.driver import Step
from volery.vehicles.drivers.paparazzi.backend import (
    COME_DOWN,
    STOP,
    VELOCITY_Z,
    PaparazziBackend,
    PaparazziSetpoints,
    Setpoint,
)
from volery.vehicles.drivers.paparazzi.modes import (
    FAILSAFE,
    GUIDED,
    KILL,
    LAND_BLOCK,
    NAV,
    START,
    START_BLOCK,
    TAKEOFF_BLOCK,
)
from volery.vehicles.drivers.steps import (
    climbed_to,
    disarmed_step,
    horizontal_distance,
    immediate_step,
    send_nothing,
)
from volery.vehicles.telemetry import Telemetry

CHANGED_WITHIN: Ns = 8 * S
"""Of a mode; and of the motors. ROTORCRAFT_STATUS comes each 1.2 s where nothing changes."""

SETTLED_WITHIN: Ns = 10 * S

TRANSMITTER = (
    "if a transmitter is on, put its mode switch into the third position (AUTO2) or switch it off: "
    "it decides about the mode"
)
ARMING = "look at its arming status; it does not start its motors in KILL or with unaligned attitude"


class PaparazziSteps:
    """What it takes to say something to one aircraft. ``yaw`` is the heading last asked for, radians."""

    def __init__(self, kernel: Kernel, uplink: PaparazziBackend) -> None:
        self.kernel = kernel
        self.uplink = uplink
        self.telemetry = uplink.telemetry
        self.hearing = uplink.hearing
        self.setpoints = PaparazziSetpoints(kernel, uplink)
        self.yaw: float | None = None

    # -- steps

    def change(self, mode: str, send: Action | None = None) -> Step:
        """Enter *mode*; by *send* where there is another way than settings."""
        self.setpoints.unfollow()
        return Step(
            ask=f"change to {mode}",
            send=send or (lambda: self.uplink.mode(mode)),
            done=lambda seen: seen.mode == mode,
            within=CHANGED_WITHIN,
            skippable=True,
            again=S,
            enters=mode,
            advice=TRANSMITTER,
        )

    def guided(self) -> tuple[Step, Step]:
        """GUIDED first; only then are the sticks let go."""
        return self.change(GUIDED), self.let_go()

    def let_go(self) -> Step:
        """No sticks any more."""
        return immediate_step("let go of the sticks", self.setpoints.release)

    def know_settings(self) -> Step:
        """Nothing is written before."""
        return Step(
            ask="tell its settings",
            send=send_nothing,
            done=lambda seen: self.hearing.settled,
            within=SETTLED_WITHIN,
            skippable=True,
            advice="it must answer GET_SETTING, and number its settings as in its XML: aircraft=PATH",
        )

    def start_motors(self) -> Step:
        """In the mode it is in; from KILL, where motors do not start, by way of GUIDED."""

        def send() -> None:
            if self.telemetry.mode == KILL:
                self.uplink.mode(GUIDED)
            self.uplink.motors(True)

        return Step(
            ask="arm",
            send=send,
            done=lambda seen: seen.armed,
            within=CHANGED_WITHIN,
            skippable=True,
            answer=START,
            again=3 * S,
            advice=ARMING,
        )

    def stop_motors(self, *, force: bool = False) -> Step:
        """*force*: in every way there is."""

        def send() -> None:
            if force:
                self.uplink.emergency(STOP)
            self.uplink.motors(False)

        return Step(
            ask="disarm",
            send=send,
            done=lambda seen: not seen.armed,
            within=CHANGED_WITHIN,
            skippable=True,
            again=S,
        )

    # -- places

    def heading(self) -> float:
        """The one last asked for, else the one it has; radians."""
        return self.yaw if self.yaw is not None else radians(self.telemetry.attitude.heading)

    def spot(self) -> tuple[float, float]:
        """North, east of where it is; the origin as long as it has told no place."""
        here = self.telemetry.position
        return self._ned(here)[:2] if here is not None else (0.0, 0.0)

    def at(self, goal: Position) -> Setpoint:
        """*goal*, with the heading as it is to be."""
        return Setpoint(*self._ned(goal), self.heading())

    def stay(self) -> None:
        """Be told to be where it is."""
        if self.telemetry.position is not None:
            self.uplink.setpoint(self.at(self.telemetry.position))

    def _ned(self, place: Position) -> tuple[float, float, float]:
        """North, east, down in the local frame."""
        name, origin = self.telemetry.name, self.hearing.origin
        if origin is None:
            raise Refused(name, f"go to {place}", "it has not told the origin of its local frame (INS_REF)")
        if isinstance(place.altitude, AboveHome):
            amsl = origin.amsl + place.altitude.metres
        elif isinstance(place.altitude, AMSL):
            amsl = place.altitude.metres
        else:
            raise CapabilityError(f"{name}: {place.altitude}: it flies to AMSL or above home only")
        east, north, up = origin.enu(place.latitude, place.longitude, amsl)
        return north, east, -up


BLOCK_WITHIN: Ns = 15 * S

LIFTED_M = 1.0
"""So far above where it stood the take-off block has done its part."""
SINKING_M_S = 0.8
"""Landing in GUIDED; the stock plan's blocks do the same."""
WELL_INSIDE = 0.9
"""Of the distance at which it turns back, blocks are flown."""


@dataclass(frozen=True)
class Blocks:
    """Names of the blocks of the flight plan that are flown."""

    start: str = START_BLOCK
    takeoff: str = TAKEOFF_BLOCK
    land: str = LAND_BLOCK


class TakeoffAndLanding:
    """The sequences. Raises ``UsageError`` if the aircraft's flight plan has not those *blocks*."""

    def __init__(self, pieces: PaparazziSteps, blocks: Blocks) -> None:
        self._pieces = pieces
        self._uplink = pieces.uplink
        self._telemetry = pieces.telemetry
        self._blocks = blocks
        for block in (blocks.start, blocks.takeoff, blocks.land):
            self._uplink.aircraft.block(block)

    def _by_plan(self) -> bool:
        """So near home that it goes on with its plan in NAV. It is taken to be there until it tells."""
        seen, farthest = self._telemetry, self._uplink.aircraft.farthest
        if farthest is None or seen.home is None or seen.position is None:
            return True
        return horizontal_distance(seen.position, seen.home) <= WELL_INSIDE * farthest

    # -- up

    def climb(self, height: float, within: Ns) -> Sequence[Step]:
        """From the ground to *height* metres above home, in GUIDED at the end."""
        pieces = self._pieces
        pieces.yaw = None
        spot: list[tuple[float, float]] = []

        def send() -> None:
            if not spot:
                spot.append(pieces.spot())
            self._uplink.setpoint(Setpoint(*spot[0], -height, pieces.heading()))

        straight_up = Step(
            ask=f"climb to {height:g} m",
            send=send,
            done=climbed_to(height),
            within=within,
            again=S,
            mode=GUIDED,
            armed=True,
        )
        if self._by_plan():
            lifted = (pieces.change(NAV), self._start(), self._lift(within), *pieces.guided())
            return (*lifted, straight_up)
        return (*pieces.guided(), replace(pieces.start_motors(), mode=GUIDED), straight_up)

    def _start(self) -> Step:
        return Step(
            ask="start the motors",
            send=lambda: self._uplink.block(self._blocks.start),
            done=lambda seen: seen.armed,
            within=BLOCK_WITHIN,
            skippable=True,
            again=2 * S,
            mode=NAV,
            advice=ARMING,
        )

    def _lift(self, within: Ns) -> Step:
        ground: list[float] = []

        def send() -> None:
            ground.append(self._telemetry.above_home)
            self._uplink.block(self._blocks.takeoff)

        return Step(
            ask="lift off",
            send=send,
            done=lambda seen: seen.above_home >= ground[0] + LIFTED_M,
            within=within,
            again=5 * S,
            mode=NAV,
            armed=True,
            advice=f"look at what block {self._blocks.takeoff!r} of its flight plan does",
        )

    # -- down

    def land(self, within: Ns) -> Sequence[Step]:
        """Here, until the motors are off; without a fix in FAILSAFE, which needs none."""
        pieces = self._pieces
        pieces.yaw = None
        if not pieces.hearing.good_fix:
            failing = pieces.change(FAILSAFE, self._fail_safely)
            return (failing, pieces.let_go(), self._down(FAILSAFE, within))
        return self.land_by_plan(within) if self._by_plan() else self._sink(within)

    def land_by_plan(self, within: Ns) -> Sequence[Step]:
        """By the landing block."""
        pieces = self._pieces
        return (self._enter_landing(), pieces.change(NAV), pieces.let_go(), self._down(NAV, within))

    def _enter_landing(self) -> Step:
        """Into the block before NAV: the block that it was left in would be flown meanwhile."""
        pieces = self._pieces
        number = self._uplink.aircraft.block(self._blocks.land).number
        asked_at: list[Ns] = []

        def send() -> None:
            asked_at.append(pieces.kernel.now())
            self._uplink.block(self._blocks.land)

        def landing(seen: Telemetry) -> bool:
            heard_at, block = pieces.hearing.block
            return not seen.armed or (heard_at > asked_at[0] and block >= number)

        return Step(
            ask=f"go to block {self._blocks.land!r}",
            send=send,
            done=landing,
            within=BLOCK_WITHIN,
            again=4 * S,
            mode=self._telemetry.mode,
        )

    def _sink(self, within: Ns) -> Sequence[Step]:
        """Straight down in GUIDED until it judges itself to be on the ground; then the motors are stopped."""
        pieces = self._pieces
        spot: list[tuple[float, float]] = []

        def send() -> None:
            if not spot:
                spot.append(pieces.spot())
            self._uplink.setpoint(Setpoint(*spot[0], SINKING_M_S, pieces.heading(), VELOCITY_Z))

        descend = Step(
            ask="descend",
            send=send,
            done=lambda seen: not seen.flying,
            within=within,
            again=S,
            mode=GUIDED,
            leads_to=(KILL,),
        )
        return (*pieces.guided(), descend, pieces.stop_motors())

    def _fail_safely(self) -> None:
        self._uplink.mode(FAILSAFE)
        self._uplink.emergency(COME_DOWN)

    def _down(self, mode: str, within: Ns) -> Step:
        return disarmed_step("land", mode, within, (KILL,))
