"""Off the ground and down again: by blocks of the flight plan in NAV, or in GUIDED where NAV would turn back.

In NAV an aircraft goes home by itself if it is further from there than its plan allows. So blocks are flown
only well inside that distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from volery.base.time import Ns, S
from volery.vehicles.driver import Step
from volery.vehicles.drivers.arrival import distance, risen
from volery.vehicles.drivers.paparazzi.modes import (
    FAILSAFE,
    GUIDED,
    KILL,
    LAND_BLOCK,
    NAV,
    START_BLOCK,
    TAKEOFF_BLOCK,
)
from volery.vehicles.drivers.paparazzi.pieces import ARMING, Pieces
from volery.vehicles.drivers.paparazzi.uplink import COME_DOWN, VELOCITY_Z, Setpoint
from volery.vehicles.drivers.steps import until_disarmed
from volery.vehicles.telemetry import Telemetry

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


class Ground:
    """The sequences. Raises ``UsageError`` if the aircraft's flight plan has not those *blocks*."""

    def __init__(self, pieces: Pieces, blocks: Blocks) -> None:
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
        return distance(seen.position, seen.home) <= WELL_INSIDE * farthest

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
            done=risen(height),
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
        return until_disarmed("land", mode, within, (KILL,))
