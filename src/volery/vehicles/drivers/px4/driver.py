"""Missions as PX4 wants them: no item for home; what has no place is in MAVLink's mission frame.

As recorded of PX4 1.14, which refuses commands without a place in a global frame, and flies to latitude and
longitude 0 of an item that does not state them.

PX4's sequences, written once: what it wants to be asked, and how one sees it done.

They reach it over ``PX4Backend``. Facts behind them, observed on PX4 1.14: a heartbeat comes once a second, so
a mode is acknowledged in milliseconds and seen up to a second later; on the ground every mode is accepted,
even one that does not come to pass, so the heartbeat is believed. Arming checks are those of the mode it is
in.

By position it goes by DO_REPOSITION, in AUTO.LOITER: one command, after which it needs no commander, as an
ArduPilot's target in GUIDED. Only a velocity and a turn need OFFBOARD and its stream (see ``offboard``).

NAV_TAKEOFF takes an altitude AMSL and ends up to a metre short of it: of "10 m" at 8.97. So when it has
ended, the drone is sent to the stated height above the place where it took off, by DO_REPOSITION, which it
meets as well as any other goal; only then has it taken off.

A pilot hands over by AUTO.LOITER, PX4's Hold. One who takes an OFFBOARD flight into Hold has it, too: until
he has chosen another mode in between, Hold then means his. So has one who sends it elsewhere by
DO_REPOSITION, which is also how a ground station has it pause. To ask for AUTO.LOITER while it flies there
changes nothing: it goes on to its target.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import isfinite, nan

from volery.base.errors import UsageError, VehicleError
from volery.base.position import AMSL, AboveGround, AboveHome, Altitude, Position
from volery.base.time import MINUTE, MS, Ns, S
from volery.kernel.api import Kernel
from volery.links.mavlink_messages import constant
from volery.vehicles.driver import ManualControl, Repeat, Step
from volery.vehicles.drivers.mavlink import backend as key
from volery.vehicles.drivers.mavlink.backend import GROUND_SPEED, OWN_SPEED, UNCHANGED, Item, item
from volery.vehicles.drivers.mavlink.driver import MavlinkDriver
from volery.vehicles.drivers.px4 import modes
from volery.vehicles.drivers.px4.backend import PX4Backend, Setpoint
from volery.vehicles.drivers.px4.link_loss import on_link_loss
from volery.vehicles.drivers.px4.modes import HOLD, OFFBOARD
from volery.vehicles.drivers.px4.setpoints import SETPOINT_PERIOD, STILL, ManualControlStream, OffboardStream
from volery.vehicles.drivers.steps import (
    DRONE_KIND,
    READY_WITHIN,
    ROVER_KIND,
    STOPPED_WITHIN,
    TURNED_WITHIN,
    TargetMonitor,
    arrived_at,
    at_rest,
    check_throttle,
    disarmed_step,
    heading_reached,
    immediate_step,
    send_nothing,
)
from volery.vehicles.mission import ChangeSpeed, Land, MissionItem, ReturnHome, TakeOff, Waypoint
from volery.vehicles.telemetry import Telemetry, Velocity

NO_PLACE = constant("MAV_FRAME_MISSION")
WITHIN_M = 2.0
"""A waypoint counts as reached so near; PX4's own NAV_ACC_RAD is the same."""


def items_of(mission: Sequence[MissionItem], here: Position) -> list[Item]:
    """The items on the wire for a mission that begins at *here*."""
    items: list[Item] = []
    at = here
    for one in mission:
        items.append(_translated(one, at))
        at = getattr(one, "position", None) or at
    return items


def _translated(one: MissionItem, at: Position) -> Item:
    if isinstance(one, TakeOff):
        up = Position(at.latitude, at.longitude, AboveHome(one.height))
        return item("MAV_CMD_NAV_TAKEOFF", 0.0, 0.0, 0.0, nan, at=up)
    if isinstance(one, ChangeSpeed):
        return item("MAV_CMD_DO_CHANGE_SPEED", GROUND_SPEED, one.speed, UNCHANGED, frame=NO_PLACE)
    if isinstance(one, ReturnHome):
        return item("MAV_CMD_NAV_RETURN_TO_LAUNCH", frame=NO_PLACE)
    if isinstance(one, Land):
        down = one.position or Position(at.latitude, at.longitude, AboveHome(0.0))
        return item("MAV_CMD_NAV_LAND", 0.0, 0.0, 0.0, nan, at=down)
    return _waypoint(one)


def _waypoint(one: Waypoint) -> Item:
    return item("MAV_CMD_NAV_WAYPOINT", one.stay_s, WITHIN_M, 0.0, one.heading, at=one.position)


TAKEOFF_SHORT_M = 1.5
"""NAV_TAKEOFF ended up to 1.03 m below its altitude."""
LEVELLED_WITHIN: Ns = MINUTE
REPEATED_FOR: Ns = 1500 * MS
"""MISSION_ITEM_REACHED was repeated eleven times, for a second."""


class PX4(MavlinkDriver):
    """The driver. See ``vehicles.driver.Driver`` for what the methods mean."""

    obeys = HOLD
    landing_modes = frozenset({modes.LAND, modes.RTL, "AUTO.PRECLAND"})

    def __init__(self, kernel: Kernel, name: str, commands: PX4Backend) -> None:
        super().__init__(kernel, name, commands)
        self._kernel = kernel
        self._commands = commands
        self._offboard = OffboardStream(kernel, commands, self._eviction)
        self._sticks = ManualControlStream(kernel, commands)
        self._at_own_speed = True
        self._lifted_at: Position | None = None
        self._stream = Repeat(SETPOINT_PERIOD, self._offboard.repeat)

    @property
    def offboard_mode(self) -> str:
        """AUTO.LOITER; words that are no mode while AUTO.LOITER is a pilot's."""
        self._offboard.look()
        return self._eviction.offboard_mode

    def on_link_loss(self) -> str:
        """From its failsafes for the ground station, for OFFBOARD and for sticks."""
        parameters = self._commands.parameters
        return on_link_loss(parameters) if parameters is not None else ""

    # -- from the ground

    def ready(self, within: Ns) -> Sequence[Step]:
        """In a mode that could take off, as its checks are those of the mode: on the ground in Hold."""
        seen = self.telemetry
        waits = super().ready(within)
        if seen.armed or seen.ready or seen.mode.startswith("AUTO."):
            return waits
        return (*self._change(HOLD), *waits)

    def takeoff(self, height: float, within: Ns) -> Sequence[Step]:
        """Hold, ready, armed, up, and then to the stated height; at once, or it disarms itself after 10 s."""

        def risen(seen: Telemetry) -> bool:
            enough = max(height - TAKEOFF_SHORT_M, height / 2.0)
            return seen.flying and seen.mode == HOLD and seen.above_home >= enough

        climb = Step(
            ask=f"climb to {height:g} m",
            send=lambda: self._take_off(height),
            done=risen,
            within=within,
            answer=key.TAKEOFF,
            again=2 * S,
            enters=modes.TAKEOFF,
            leads_to=(HOLD,),
            armed=True,
        )
        return (*self._armed_in_hold(), climb, self._levelled(height))

    def _take_off(self, height: float) -> None:
        self._lifted_at = self._here("take off")
        self._asks_for(modes.TAKEOFF)
        self._commands.takeoff(self._amsl(AboveHome(height)))

    def _levelled(self, height: float) -> Step:
        """At the stated height above the place where it took off."""

        def goal() -> Position:
            over = self._lifted_at or self._here("take off")
            return Position(over.latitude, over.longitude, AboveHome(height))

        level = self._target(goal, LEVELLED_WITHIN)
        return replace(level, ask=f"rise to {height:g} m")

    def _armed_in_hold(self) -> Sequence[Step]:
        """Whoever changes the mode meanwhile has it: to arm in another one is not what was asked."""
        armed = (replace(step, mode=HOLD) for step in self.arm())
        return (*self._let_go(), *self._change(HOLD), *self.ready(READY_WITHIN), *armed)

    # -- by position

    def goto(self, goal: Position, speed: float | None, within: Ns) -> Sequence[Step]:
        """DO_REPOSITION; a rover is armed on the way."""
        if isinstance(goal.altitude, AboveGround):
            raise UsageError(f"{self.name}: {goal}: PX4 takes AMSL and AboveHome")
        start = self._armed_in_hold() if self.telemetry.kind == ROVER_KIND else self._let_go()
        reach = replace(self._target(lambda: goal, within), ask=f"reach {goal}")
        return (*start, *self._paced(speed), reach)

    def _paced(self, speed: float | None) -> Sequence[Step]:
        """A speed that was stated stands until another is; PX4 may forget it when the mode changes."""
        if speed is None and self._at_own_speed:
            return ()
        self._at_own_speed = speed is None
        return (*self._change(HOLD), *self._at_speed(OWN_SPEED if speed is None else speed, HOLD))

    def _target(self, goal: Callable[[], Position], within: Ns) -> Step:
        """DO_REPOSITION to *goal*, until it is there."""
        rover = self.telemetry.kind == ROVER_KIND
        aim = TargetMonitor(self.telemetry, self._eviction)

        def send() -> None:
            aim.set(self._reposition(goal()))
            self._commands.watch_target()

        return Step(
            ask="reach it",
            send=send,
            done=lambda seen: seen.mode == HOLD and arrived_at(goal(), rover)(seen),
            within=within,
            answer=key.TARGET,
            again=2 * S,
            enters=HOLD,
            armed=True,
            lost=aim.lost,
        )

    def _reposition(self, goal: Position) -> Position:
        """The place as it was sent."""
        self._asks_for(HOLD)
        target = Position(goal.latitude, goal.longitude, AMSL(self._amsl(goal.altitude)))
        self._commands.reposition(target)
        return target

    def _here(self, asked: str) -> Position:
        here = self.telemetry.position
        if here is None or not isfinite(self.telemetry.above_home):
            raise VehicleError(
                self.name, asked, "the autopilot does not know where it is; wait_ready() first"
            )
        return here

    def _amsl(self, altitude: Altitude) -> float:
        """Metres. Home is where its own two altitudes say; a rover goes at the altitude it has."""
        here = self._here("go by position").altitude.metres
        if self.telemetry.kind != DRONE_KIND:
            return here
        if isinstance(altitude, AboveHome):
            return here - self.telemetry.above_home + altitude.metres
        return altitude.metres

    def hold(self) -> Sequence[Step]:
        """It is sent to where it is: that stops it in AUTO.LOITER as well as in any other mode.

        Once more when it stands, for by then it has gone a bit further.
        """
        stop = self._stopped("stop")
        stay = self._stopped("stay")
        return (*self._let_go(), stop, stay)

    def _stopped(self, ask: str) -> Step:
        return Step(
            ask=ask,
            send=self._stay,
            done=lambda seen: seen.mode == HOLD and at_rest(seen),
            within=STOPPED_WITHIN,
            answer=key.TARGET,
            again=2 * S,
            enters=HOLD,
            armed=self.telemetry.kind == DRONE_KIND,
        )

    def _stay(self) -> None:
        self._reposition(self._here("hold"))

    def velocity(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> Sequence[Step]:
        """OFFBOARD, streamed until it has lasted long enough; then AUTO.LOITER."""
        return self._streamed(Setpoint(velocity, yaw_rate), lasting)

    def heading(self, degrees: float) -> Sequence[Step]:
        """In OFFBOARD, on the spot; then AUTO.LOITER, which keeps the heading."""
        turn = Step(
            ask=f"turn to {degrees:g} degrees",
            send=send_nothing,
            done=heading_reached(degrees),
            within=TURNED_WITHIN,
            mode=OFFBOARD,
            armed=True,
            keep=self._stream,
        )
        return (*self._streamed(STILL._replace(heading=degrees), None), turn, *self._change(HOLD))

    def _streamed(self, setpoint: Setpoint, lasting: Ns | None) -> Sequence[Step]:
        """The stream first: without it PX4 does not enter. Over a failsafe one must first get to Hold."""
        seen = self.telemetry
        first = self._change(HOLD) if seen.failsafe and seen.mode not in {HOLD, OFFBOARD} else ()
        begin = immediate_step("stream set-points", lambda: self._offboard.begin(setpoint, lasting))
        if self._offboard.holds:
            return (begin,)
        enter = replace(
            self._change(OFFBOARD)[0],
            done=lambda _: self._offboard.entered(),
            skippable=False,
            leads_to=(HOLD,),
            keep=self._stream,
        )
        return (*first, *self._let_go(), begin, enter)

    def return_home(self, within: Ns) -> Sequence[Step]:
        """AUTO.RTL. A drone lands and disarms itself; a rover stops near home."""
        if self.telemetry.kind == DRONE_KIND:
            return self._until_disarmed(modes.RTL, "return home and land", within)

        come = self._comes_home(modes.RTL, HOLD, within)
        return (*self._let_go(), *self._change(modes.RTL), come)

    def land(self, within: Ns) -> Sequence[Step]:
        """AUTO.LAND, until it has disarmed itself. Without a position it descends where the wind takes it."""
        return self._until_disarmed(modes.LAND, "land", within)

    # -- by sticks

    def stabilize(self) -> Sequence[Step]:
        """STABILIZED, with the sticks held. In the air not with an idle throttle: it would fall."""
        self._sticks.hold_any()
        check_throttle(self.telemetry, self._sticks.held)
        return self._change(modes.STABILIZED)

    def altitude_hold(self) -> Sequence[Step]:
        """ALTCTL, with the sticks held."""
        self._sticks.hold_any()
        return self._change(modes.ALTCTL)

    def manual(self) -> Sequence[Step]:
        """MANUAL, with the sticks held."""
        self._sticks.hold_any()
        return self._change(modes.MANUAL)

    def manual_control(self, sticks: ManualControl | None) -> None:
        """Keep sending them, as long as the mode is ours."""
        if sticks is None:
            self._sticks.centre()
        else:
            self._sticks.hold(sticks)

    def _let_go(self) -> Sequence[Step]:
        """Sticks still count as moving for a moment after they were centred."""
        if self._sticks.held is None:
            return ()
        centre = Step(
            ask="centre the sticks",
            send=self._sticks.centre,
            done=lambda _: self._sticks.settled(),
            within=5 * S,
            keep=Repeat(SETPOINT_PERIOD, self._centring),
        )
        return (centre,)

    def _centring(self) -> None:
        self._sticks.repeat()
        self.telemetry.changed.notify()

    def stop(self) -> None:
        """No set-point and no stick is repeated any more."""
        self._offboard.stop()
        self._sticks.stop()

    # -- missions

    def _items(self, mission: Sequence[MissionItem]) -> list[Item]:
        return items_of(mission, self._here("upload a mission"))

    def _ends_at(self, mission: Sequence[MissionItem]) -> int | None:
        """PX4 1.14 does not say that a mission is over: it is when its last place is reached."""
        if isinstance(mission[-1], Land | ReturnHome):
            return None
        places = [number for number, one in enumerate(mission) if isinstance(one, TakeOff | Waypoint)]
        return places[-1] if places else None

    def start_mission(self, within: Ns) -> Sequence[Step]:
        """Ready, AUTO.MISSION, armed; to its end."""
        began = self._kernel.now()
        repeats = self.telemetry.mission_reached >= 0
        ready = () if self.telemetry.armed else (*self._change(HOLD), *self.ready(READY_WITHIN))
        quiet = Step(
            ask="prepare the mission",
            send=self._commands.rewind,
            done=lambda _: not repeats or self._kernel.now() - began >= REPEATED_FOR,
            within=5 * S,
        )
        forget = immediate_step("begin anew", self._forget_progress)
        armed = (replace(step, mode=modes.MISSION) for step in self.arm())
        go_on = self._finish_mission(modes.MISSION, (modes.RTL,), within)
        return (*self._let_go(), *ready, quiet, forget, *self._change(modes.MISSION), *armed, go_on)

    # -- pieces of sequences

    def _asks_for(self, mode: str) -> None:
        self._sticks.asks_for(mode)
        if mode == OFFBOARD:
            self._offboard.asks()
        else:
            self._offboard.leave()

    def _until_disarmed(self, mode: str, ask: str, within: Ns) -> Sequence[Step]:
        if not self.telemetry.armed:
            return ()
        return (*self._let_go(), *self._change(mode), disarmed_step(ask, mode, within))
