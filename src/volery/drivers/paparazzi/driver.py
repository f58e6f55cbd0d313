"""Paparazzi's sequences: what its rotorcraft firmware wants to be told, and how one sees it done.

Facts behind them, from public definitions and sources; see ``modes.ASSUMED``. Nothing is acknowledged. Motors
start and stop by a setting or by a block of the flight plan. One block climbs to some 2 m, another one lands;
in between it goes by set-points in GUIDED, which stand until the next one. Telemetry is 0.25 s (position) to
2 s (block) late, but a change of mode is told at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians

from volery.base.errors import CapabilityError, LinkError, Refused, UsageError
from volery.base.position import AMSL, AboveHome, Position
from volery.base.time import MINUTE, Ns, S
from volery.drivers.arrival import DRONE_KIND, NEAR_UP_M, STANDING_M_S, at, standing
from volery.drivers.mavlink.sequences import at_once, heads, nothing
from volery.drivers.paparazzi.if_silent import if_silent
from volery.drivers.paparazzi.modes import (
    BY_ATTITUDE,
    BY_HEIGHT,
    FAILSAFE,
    GUIDED,
    KILL,
    LAND_BLOCK,
    NAV,
    START_BLOCK,
    TAKEOFF_BLOCK,
)
from volery.drivers.paparazzi.setpoints import VELOCITY_PERIOD, Setpoints
from volery.drivers.paparazzi.uplink import COME_DOWN, STOP, Setpoint, Uplink
from volery.kernel.api import Action, Kernel
from volery.vehicles.driver import Capability, Repeat, Step, Sticks
from volery.vehicles.mission import MissionItem
from volery.vehicles.telemetry import Telemetry, Velocity

CHANGED_WITHIN: Ns = 8 * S
"""Of a mode; and of the motors. ROTORCRAFT_STATUS comes each 1.2 s where nothing changes."""
BLOCK_WITHIN: Ns = 15 * S
STOPPED_WITHIN: Ns = 30 * S
TURNED_WITHIN: Ns = 30 * S
READY_WITHIN: Ns = 2 * MINUTE

LIFTED_M = 1.0
"""So high above home the take-off block has done its part."""
IDLE_THROTTLE = 0.1

CAN = frozenset(
    {
        Capability.TAKEOFF,
        Capability.GOTO,
        Capability.VELOCITY,
        Capability.HEADING,
        Capability.RETURN_HOME,
        Capability.LAND,
        Capability.HOLD,
        Capability.STICKS,
        Capability.STABILIZE,
        Capability.ALTITUDE_HOLD,
    }
)
"""No speed: GUIDED flies at the aircraft's own. No missions: a flight plan is built into the aircraft."""
_NOTHING: frozenset[Capability] = frozenset()

_TRANSMITTER = (
    "if a transmitter is on, put its mode switch into the third position (AUTO2) or switch it off: "
    "it decides about the mode"
)
_ARMING = "look at its arming status; it does not start its motors in KILL or with unaligned attitude"


@dataclass(frozen=True)
class Blocks:
    """Names of the blocks of the flight plan that are flown."""

    start: str = START_BLOCK
    takeoff: str = TAKEOFF_BLOCK
    land: str = LAND_BLOCK


class Paparazzi:
    """The driver. See ``vehicles.driver.Driver`` for what the methods mean.

    Raises ``UsageError`` if the aircraft's flight plan has not those *blocks*. *go_round* is one round of the
    loop of the node that carries it, *take_in* what that node does without waiting.
    """

    handover = GUIDED
    comes_down = frozenset({FAILSAFE})

    def __init__(
        self,
        kernel: Kernel,
        uplink: Uplink,
        blocks: Blocks,
        *,
        go_round: Action | None = None,
        take_in: Action | None = None,
    ) -> None:
        self.name = uplink.telemetry.name
        self.telemetry = uplink.telemetry
        self.cycle = go_round
        self._take_in = take_in
        self._kernel = kernel
        self._uplink = uplink
        self._hearing = uplink.hearing
        self._setpoints = Setpoints(kernel, uplink)
        self._blocks = blocks
        self._yaw: float | None = None  # the heading last asked for, radians
        for block in (blocks.start, blocks.takeoff, blocks.land):
            uplink.aircraft.block(block)

    @property
    def capabilities(self) -> frozenset[Capability]:
        """Those of a rotorcraft; none until it has been heard."""
        return CAN if self.telemetry.kind == DRONE_KIND else _NOTHING

    def look(self) -> None:
        """Take in what has arrived."""
        if self._take_in is not None:
            self._take_in()

    def if_silent(self) -> str:
        """From its flight plan, as far as that says it."""
        return if_silent(self._uplink.aircraft) if self.telemetry.kind == DRONE_KIND else ""

    def problem(self) -> LinkError | CapabilityError | None:
        """What is wrong with the way to the aircraft, or with what is there."""
        return self._uplink.problem()

    def close(self) -> None:
        """Stop talking and let go of the link."""
        self.stop()
        self._uplink.close()

    # -- on the ground

    def ready(self, within: Ns) -> Sequence[Step]:
        """Until it has a fix, an origin and an aligned attitude, and its settings are the ones meant."""
        step = Step(
            ask="be ready to arm and to go by position",
            send=nothing,
            done=lambda seen: seen.ready or seen.armed,
            within=within,
            skippable=True,
            advice="it needs a 3D fix, an origin (blocks 'Wait GPS' and 'Geo init' done, INS_REF sent), an "
            "aligned attitude, and to answer GET_SETTING",
        )
        return (step,)

    def arm(self) -> Sequence[Step]:
        """In the mode it is in; from KILL, where motors do not start, by way of GUIDED."""

        def send() -> None:
            if self.telemetry.mode == KILL:
                self._uplink.mode(GUIDED)
            self._uplink.motors(True)

        step = Step(
            ask="arm",
            send=send,
            done=lambda seen: seen.armed,
            within=CHANGED_WITHIN,
            skippable=True,
            again=S,
            advice=_ARMING,
        )
        return (step,)

    def disarm(self, force: bool) -> Sequence[Step]:
        """Paparazzi itself would stop the motors in the air, too: without *force* it is not asked to."""
        if self.telemetry.flying and not force:
            said = "it flies, and would fall: a Paparazzi stops its motors in the air, too; land() first"
            raise Refused(self.name, "disarm", said)

        def send() -> None:
            if force:
                self._uplink.emergency(STOP)
            self._uplink.motors(False)

        step = Step(
            ask="disarm",
            send=send,
            done=lambda seen: not seen.armed,
            within=CHANGED_WITHIN,
            skippable=True,
            again=S,
        )
        return (step,)

    def takeoff(self, height: float, within: Ns) -> Sequence[Step]:
        """In NAV start the motors and lift off by blocks of the plan; then in GUIDED straight up."""
        self._forget_heading()
        spot: list[tuple[float, float]] = []

        def lift() -> None:
            spot[:] = [self._local()[:2]]
            self._uplink.block(self._blocks.takeoff)

        def climb() -> None:
            north, east = spot[0]
            self._uplink.setpoint(Setpoint(north, east, -height, self._heading()))

        def up(seen: Telemetry) -> bool:
            near = abs(seen.above_home - height) <= NEAR_UP_M
            return seen.flying and near and abs(seen.velocity.up) <= STANDING_M_S

        lifted = min(LIFTED_M, height / 2.0)
        return (
            *self.ready(READY_WITHIN),
            *self._change(NAV),
            self._start_motors(),
            Step(
                ask="lift off",
                send=lift,
                done=lambda seen: seen.above_home >= lifted,
                within=within,
                again=5 * S,
                mode=NAV,
                armed=True,
                advice=f"look at what block {self._blocks.takeoff!r} of its flight plan does",
            ),
            *self._guided(),
            Step(
                ask=f"climb to {height:g} m",
                send=climb,
                done=up,
                within=within,
                again=S,
                mode=GUIDED,
                armed=True,
            ),
        )

    def _start_motors(self) -> Step:
        return Step(
            ask="start the motors",
            send=lambda: self._uplink.block(self._blocks.start),
            done=lambda seen: seen.armed,
            within=BLOCK_WITHIN,
            skippable=True,
            again=2 * S,
            mode=NAV,
            advice=_ARMING,
        )

    # -- by position

    def goto(self, goal: Position, speed: float | None, within: Ns) -> Sequence[Step]:
        """GUIDED, then a set-point, with the heading as it is."""
        del speed  # there is no such capability
        return (*self._guided(), self._reach(goal, f"reach {goal}", within))

    def _reach(self, goal: Position, ask: str, within: Ns) -> Step:
        return Step(
            ask=ask,
            send=lambda: self._uplink.setpoint(self._at(goal)),
            done=at(goal, False),
            within=within,
            again=S,
            mode=GUIDED,
            armed=True,
        )

    def hold(self) -> Sequence[Step]:
        """In GUIDED, first without velocity, then where it has stopped."""
        brake = Step(
            ask="stop",
            send=self._setpoints.stand_still,
            done=standing,
            within=STOPPED_WITHIN,
            keep=Repeat(VELOCITY_PERIOD, self._setpoints.stand_still),
            mode=GUIDED,
            armed=True,
        )
        return (*self._guided(), brake, at_once("stay", self._stay))

    def velocity(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> Sequence[Step]:
        """GUIDED, then repeated until it has lasted long enough; then it stops."""
        self._forget_heading()
        return (
            *self._guided(),
            at_once("fly on", lambda: self._setpoints.follow(velocity, yaw_rate, lasting)),
        )

    def heading(self, degrees: float) -> Sequence[Step]:
        """In GUIDED, where it is."""

        def turn() -> None:
            self._yaw = radians(degrees)
            self._stay()

        step = Step(
            ask=f"turn to {degrees:g} degrees",
            send=turn,
            done=heads(degrees),
            within=TURNED_WITHIN,
            again=4 * S,
            mode=GUIDED,
            armed=True,
        )
        return (*self._guided(), step)

    def return_home(self, within: Ns) -> Sequence[Step]:
        """In GUIDED over home at the height it has, then down: mode HOME goes there, but does not land."""
        if not self.telemetry.armed:
            return ()
        home = self.telemetry.home
        if home is None:
            raise Refused(self.name, "return home", "it has not told where its home is")
        above = AboveHome(max(self.telemetry.above_home, LIFTED_M))
        over = Position(home.latitude, home.longitude, above)
        return (*self._guided(), self._reach(over, "be over home", within), *self.land(within))

    def land(self, within: Ns) -> Sequence[Step]:
        """By the plan's block, until the motors are off; without a fix in FAILSAFE, which needs none."""
        if not self.telemetry.armed:
            return ()
        self._forget_heading()
        if not self._hearing.good_fix:
            return (*self._change(FAILSAFE, self._fail_safely), self._let_go(), self._down(FAILSAFE, within))
        return (self._enter_landing(), *self._change(NAV), self._let_go(), self._down(NAV, within))

    def _enter_landing(self) -> Step:
        """Into the block before NAV: the block that it was left in would be flown meanwhile."""
        number = self._uplink.aircraft.block(self._blocks.land).number
        asked_at: list[Ns] = []

        def enter() -> None:
            asked_at.append(self._kernel.now())
            self._uplink.block(self._blocks.land)

        def landing(seen: Telemetry) -> bool:
            heard_at, block = self._hearing.block
            return not seen.armed or (heard_at > asked_at[0] and block >= number)

        return Step(
            ask=f"go to block {self._blocks.land!r}",
            send=enter,
            done=landing,
            within=BLOCK_WITHIN,
            again=4 * S,
            mode=self.telemetry.mode,
        )

    def _fail_safely(self) -> None:
        self._uplink.mode(FAILSAFE)
        self._uplink.emergency(COME_DOWN)

    def _down(self, mode: str, within: Ns) -> Step:
        return Step(
            ask="land",
            send=nothing,
            done=lambda seen: not seen.armed,
            within=within,
            mode=mode,
            leads_to=(KILL,),
        )

    # -- by sticks

    def stabilize(self) -> Sequence[Step]:
        """ATTITUDE_DIRECT, with the sticks held. In the air not with an idle throttle: it would fall."""
        self._setpoints.hold_any()
        held = self._setpoints.held
        throttle = held.throttle if held is not None else 0.0
        if self.telemetry.flying and throttle < IDLE_THROTTLE:
            raise UsageError(
                f"{self.name}: the throttle is at {throttle:g}: in {BY_ATTITUDE} the motors would idle and "
                f"it would fall; manual_control() with a throttle about 0.5 first"
            )
        return self._change(BY_ATTITUDE)

    def altitude_hold(self) -> Sequence[Step]:
        """ATTITUDE_Z_HOLD, with the sticks held."""
        self._setpoints.hold_any()
        return self._change(BY_HEIGHT)

    def manual(self) -> Sequence[Step]:
        """Rovers only."""
        raise CapabilityError(f"{self.name}: a rotorcraft has no wheels to steer by hand")

    def sticks(self, sticks: Sticks | None) -> None:
        """Keep sending them, as long as the mode is ours."""
        if sticks is None:
            self._setpoints.release()
        else:
            self._setpoints.hold(sticks)

    def stop(self) -> None:
        """No set-point and no stick is repeated any more."""
        self._setpoints.unfollow()
        self._setpoints.release()

    # -- missions

    def upload(self, mission: Sequence[MissionItem]) -> Sequence[Step]:
        """A flight plan is built into the aircraft."""
        raise CapabilityError(
            f"{self.name}: {len(mission)} items: a Paparazzi's flight plan is built into it"
        )

    def start_mission(self, within: Ns) -> Sequence[Step]:
        """A flight plan is built into the aircraft."""
        raise CapabilityError(
            f"{self.name}: a Paparazzi's flight plan is built into it; fly its blocks from there"
        )

    # -- pieces of sequences

    def _change(self, mode: str, send: Action | None = None) -> Sequence[Step]:
        self._setpoints.unfollow()
        step = Step(
            ask=f"change to {mode}",
            send=send or (lambda: self._uplink.mode(mode)),
            done=lambda seen: seen.mode == mode,
            within=CHANGED_WITHIN,
            skippable=True,
            again=S,
            enters=mode,
            advice=_TRANSMITTER,
        )
        return (step,)

    def _guided(self) -> Sequence[Step]:
        """GUIDED first; only then are the sticks let go."""
        return (*self._change(GUIDED), self._let_go())

    def _let_go(self) -> Step:
        return at_once("let go of the sticks", self._setpoints.release)

    def _forget_heading(self) -> None:
        self._yaw = None

    def _heading(self) -> float:
        """The one last asked for, else the one it has; radians."""
        return self._yaw if self._yaw is not None else radians(self.telemetry.attitude.heading)

    def _local(self) -> tuple[float, float, float]:
        """North, east, down in its local frame; the origin as long as it has told no place."""
        here = self.telemetry.position
        return self._ned(here) if here is not None else (0.0, 0.0, 0.0)

    def _ned(self, place: Position) -> tuple[float, float, float]:
        origin = self._hearing.origin
        if origin is None:
            raise Refused(
                self.name, f"go to {place}", "it has not told the origin of its local frame (INS_REF)"
            )
        if isinstance(place.altitude, AboveHome):
            amsl = origin.amsl + place.altitude.metres
        elif isinstance(place.altitude, AMSL):
            amsl = place.altitude.metres
        else:
            raise CapabilityError(f"{self.name}: {place.altitude}: it flies to AMSL or above home only")
        east, north, up = origin.enu(place.latitude, place.longitude, amsl)
        return north, east, -up

    def _at(self, goal: Position) -> Setpoint:
        return Setpoint(*self._ned(goal), self._heading())

    def _stay(self) -> None:
        if self.telemetry.position is not None:
            self._uplink.setpoint(self._at(self.telemetry.position))
