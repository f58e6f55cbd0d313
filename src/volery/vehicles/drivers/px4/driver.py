"""Driver of PX4: the steps of each operation.

Facts observed on PX4 1.14: a heartbeat arrives once a second, so a mode is acknowledged in milliseconds and
seen up to a second later. On the ground every mode is accepted, even one that is not entered, so only the
heartbeat counts. Arming checks are those of the present mode.

To go to a position the driver sends DO_REPOSITION, which is flown in AUTO.LOITER: one command, after which
PX4 needs no commander, like ArduPilot's target in GUIDED. Only velocities and turns need OFFBOARD and its
stream (see ``OffboardStream``).

NAV_TAKEOFF takes an altitude AMSL and ends up to a metre below it: a take-off to 10 m ended at 8.97 m. The
driver then sends the drone by DO_REPOSITION to the stated height above the place of take-off.

A pilot hands over by AUTO.LOITER, PX4's Hold. A pilot who ends an OFFBOARD flight by Hold has control until
another mode has been selected in between, because Hold is then the pilot's. The same holds for a station that
sends the drone elsewhere by DO_REPOSITION, which is also how ground stations pause a vehicle. Commanding
AUTO.LOITER while it flies in it changes nothing: it continues to its target.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from math import isfinite, nan

from volery.base.errors import Refused, UsageError, VehicleError
from volery.base.position import AMSL, AboveGround, AboveHome, Altitude, Position
from volery.base.time import MINUTE, MS, Ns, S, from_seconds
from volery.kernel.api import Kernel
from volery.links.mavlink_messages import constant
from volery.vehicles.driver import (
    Acceleration,
    AttitudeTarget,
    ChangeSpeed,
    Land,
    LinkLossAction,
    ManualControl,
    MissionItem,
    Repeat,
    ReturnHome,
    Settings,
    Step,
    TakeOff,
    Waypoint,
)
from volery.vehicles.drivers.mavlink.backend import (
    GROUND_SPEED,
    OWN_SPEED,
    UNCHANGED,
    Ack,
    mission_item,
)
from volery.vehicles.drivers.mavlink.driver import MavlinkDriver
from volery.vehicles.drivers.px4 import modes
from volery.vehicles.drivers.px4.backend import OffboardSetpoint, PX4Backend
from volery.vehicles.drivers.px4.modes import HOLD, OFFBOARD, link_loss_settings, on_link_loss
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
    mode_step,
    send_nothing,
)
from volery.vehicles.services import PlanItem
from volery.vehicles.telemetry import Telemetry, Velocity

TAKEOFF_SHORT_M = 1.5
"""NAV_TAKEOFF ended up to 1.03 m below its altitude."""
LEVELLED_WITHIN: Ns = MINUTE
HOME_TAKEN_UP_AFTER: Ns = 2500 * MS
"""Age of a home position from which a return leads to it."""
REPEATED_FOR: Ns = 1500 * MS
"""MISSION_ITEM_REACHED was repeated eleven times, for a second."""

EXAMINED_IN = 300 * MS
"""Time in which PX4 examines a mission that was just uploaded: before, it refuses AUTO.MISSION in flight
(recorded 8 ms after the upload; its checks run at 10 Hz).
"""

OUTSIDE = "outside geofence"
"""Words of the text with which PX4 refuses a target beyond its own geofence, although it acknowledges it."""

NO_PLACE = constant("MAV_FRAME_MISSION")
WAYPOINT_RADIUS_M = 2.0
"""A waypoint counts as reached at this distance, like PX4's own NAV_ACC_RAD."""


class PX4(MavlinkDriver):
    """Driver of a PX4. See ``vehicles.driver.Driver`` for the operations."""

    obeys = HOLD
    landing_modes = frozenset({modes.LAND, modes.RTL, "AUTO.PRECLAND"})
    _backend: PX4Backend

    def __init__(self, kernel: Kernel, name: str, backend: PX4Backend) -> None:
        super().__init__(kernel, name, backend)
        self._offboard = OffboardStream(kernel, backend, self._takeover)
        self._manual = ManualControlStream(kernel, backend)
        self._at_own_speed = True
        self._lifted_at: Position | None = None
        self._stream = Repeat(SETPOINT_PERIOD, self._offboard.repeat)

    @property
    def offboard_mode(self) -> str:
        """AUTO.LOITER; words that are no mode while AUTO.LOITER is a pilot's."""
        self._offboard.check()
        return self._takeover.offboard_mode

    def on_link_loss(self) -> str:
        """Return the reaction to a lost link, from the failsafes for ground station, OFFBOARD and RC."""
        parameters = self._backend.parameters
        return on_link_loss(parameters) if parameters is not None else ""

    def _link_loss_settings(self, action: LinkLossAction) -> Settings:
        return link_loss_settings(self.name, self.telemetry.kind, action)

    # -- from the ground

    def ready(self, within: Ns) -> Sequence[Step]:
        """Wait until ready; on the ground in Hold, because the arming checks are those of the mode."""
        seen = self.telemetry
        wait = super().ready(within)
        arms = seen.mode.startswith("AUTO.") and seen.mode not in modes.NEVER_ARMED_IN
        if seen.armed or seen.ready or arms:
            return wait
        return (self._change_mode(HOLD), *wait)

    def takeoff(self, height: float, within: Ns) -> Sequence[Step]:
        """Enter Hold, wait until ready, arm, climb and level; PX4 disarms itself 10 s after arming."""
        top = nan  # m AMSL, since home may move meanwhile

        def risen(seen: Telemetry) -> bool:
            enough = top - min(TAKEOFF_SHORT_M, height / 2.0)
            return seen.flying and seen.mode == HOLD and self._here("rise").altitude.metres >= enough

        def send() -> None:
            nonlocal top
            self._lifted_at = self._here("take off")
            self._note_commanded(modes.TAKEOFF)
            top = self._amsl(AboveHome(height))
            self._backend.takeoff(top)

        def level() -> Position:
            over = self._lifted_at or self._here("take off")
            return Position(over.latitude, over.longitude, AboveHome(height))

        climb = Step(
            ask=f"climb to {height:g} m",
            send=send,
            done=risen,
            within=within,
            answer=Ack.TAKEOFF,
            again=2 * S,
            enters=modes.TAKEOFF,
            leads_to=(HOLD,),
            armed=True,
        )
        return (
            *self._armed_in_hold(),
            climb,
            self._reposition_step(f"rise to {height:g} m", level, LEVELLED_WITHIN),
        )

    def arm(self) -> Sequence[Step]:
        """Arm when PX4 has forgotten sticks that ended: counted at arming, their loss is one in flight."""
        parameters = self._backend.parameters or {}
        lost_after = from_seconds(parameters.get("COM_RC_LOSS_T", 0.5))
        wait = Step(
            ask="have the last sticks forgotten",
            send=send_nothing,
            done=lambda _: self._manual.forgotten(lost_after),
            within=lost_after + 5 * S,
            skippable=True,
        )
        return (wait, *super().arm())

    def _armed_in_hold(self) -> Sequence[Step]:
        """Return steps that arm in Hold; a pilot who changes the mode meanwhile has control."""
        arm = (replace(step, mode=HOLD) for step in self.arm())
        return (*self._end_manual_control(), self._change_mode(HOLD), *self.ready(READY_WITHIN), *arm)

    # -- operations with a position

    def goto(self, goal: Position, speed: float | None, within: Ns) -> Sequence[Step]:
        """Send DO_REPOSITION; a rover is armed first."""
        if isinstance(goal.altitude, AboveGround):
            raise UsageError(f"{self.name}: {goal}: PX4 takes AMSL and AboveHome")
        rover = self.telemetry.kind == ROVER_KIND
        start = self._armed_in_hold() if rover else self._end_manual_control()
        reach = self._reposition_step(f"reach {goal}", lambda: goal, within)
        # a stated speed is kept until another one is set; PX4 may forget it when the mode changes
        if speed is None and self._at_own_speed:
            return (*start, reach)
        self._at_own_speed = speed is None
        set_speed = self._set_speed(OWN_SPEED if speed is None else speed, HOLD)
        return (*start, self._change_mode(HOLD), set_speed, reach)

    def _reposition_step(
        self, ask: str, goal: Callable[[], Position], within: Ns, heading: float | None = None
    ) -> Step:
        """Return a step that sends DO_REPOSITION to *goal* and ends on arrival, or at a stated heading."""
        rover = self.telemetry.kind == ROVER_KIND
        monitor = TargetMonitor(self.telemetry, self._takeover)
        turned = None if heading is None else heading_reached(heading)

        began = self._kernel.now()

        sent: Position | None = None

        def send() -> None:
            nonlocal sent
            sent = self._reposition(goal(), heading)
            monitor.set(sent)
            self._backend.request_target()

        def refused() -> str:
            said = [text for text in self.telemetry.texts_since(began) if OUTSIDE in text.lower()]
            return f"the autopilot refused to {ask}: {said[-1]}" if said else ""

        arrived = cache(partial(arrived_at, rover=rover))

        def done(seen: Telemetry) -> bool:
            # where it was sent: a height above home is sent AMSL, and home may be corrected on the way
            if sent is None or seen.mode != HOLD:
                return False
            return turned(seen) if turned is not None else arrived(sent)(seen)

        return Step(
            ask=ask,
            send=send,
            done=done,
            within=within,
            answer=Ack.TARGET,
            again=2 * S,
            enters=HOLD,
            armed=True,
            lost=monitor.lost,
            fails=refused,
            failure=Refused,
        )

    def _reposition(self, goal: Position, heading: float | None = None) -> Position:
        """Send DO_REPOSITION and return the target as it was sent."""
        self._note_commanded(HOLD)
        target = Position(goal.latitude, goal.longitude, AMSL(self._amsl(goal.altitude)))
        self._backend.reposition(target, heading)
        return target

    def _here(self, asked: str) -> Position:
        here = self.telemetry.position
        if here is None or not isfinite(self.telemetry.above_home):
            raise VehicleError(
                self.name, asked, "the autopilot does not know where it is; wait_ready() first"
            )
        return here

    def _amsl(self, altitude: Altitude) -> float:
        """Return metres AMSL, with home taken from PX4's own two altitudes; a rover keeps its altitude."""
        here = self._here("go by position").altitude.metres
        if self.telemetry.kind != DRONE_KIND:
            return here
        if isinstance(altitude, AboveHome):
            return here - self.telemetry.above_home + altitude.metres
        return altitude.metres

    def hold(self) -> Sequence[Step]:
        """Send the vehicle to its present position, which stops it in any mode, AUTO.LOITER included.

        The command is repeated when it is at rest, because it has moved on meanwhile.
        """
        start = self._end_manual_control()
        return (*start, self._stop_step("stop"), self._stop_step("stay"))

    def _stop_step(self, ask: str) -> Step:
        def send() -> None:
            self._reposition(self._here("hold"))

        return Step(
            ask=ask,
            send=send,
            done=lambda seen: seen.mode == HOLD and at_rest(seen),
            within=STOPPED_WITHIN,
            answer=Ack.TARGET,
            again=2 * S,
            enters=HOLD,
            armed=self.telemetry.kind == DRONE_KIND,
        )

    def velocity(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> Sequence[Step]:
        """Stream a velocity in OFFBOARD for *lasting*, then enter AUTO.LOITER."""
        return self._streamed(OffboardSetpoint(velocity, yaw_rate), lasting)

    def acceleration(self, acceleration: Acceleration, yaw_rate: float, lasting: Ns) -> Sequence[Step]:
        """Stream an acceleration in OFFBOARD for *lasting*, then enter AUTO.LOITER."""
        return self._streamed(STILL._replace(acceleration=acceleration, yaw_rate=yaw_rate), lasting)

    def attitude(self, target: AttitudeTarget, lasting: Ns) -> Sequence[Step]:
        """Stream an attitude and thrust in OFFBOARD for *lasting*, then enter AUTO.LOITER."""
        return self._streamed(target, lasting)

    def heading(self, degrees: float) -> Sequence[Step]:
        """Send DO_REPOSITION to the present position with a heading; Hold keeps both.

        In OFFBOARD a turn at zero velocity drifts: 4 m in three turns were measured on PX4 1.14.
        """
        start = self._end_manual_control()
        here = self._here("turn")
        return (
            *start,
            self._reposition_step(f"turn to {degrees:g} degrees", lambda: here, TURNED_WITHIN, degrees),
        )

    def _streamed(self, setpoint: OffboardSetpoint | AttitudeTarget, lasting: Ns | None) -> Sequence[Step]:
        """Start the stream, without which PX4 does not enter OFFBOARD; leave a failsafe by way of Hold."""
        seen = self.telemetry
        in_failsafe = seen.failsafe and seen.mode not in {HOLD, OFFBOARD}
        first = (self._change_mode(HOLD),) if in_failsafe else ()
        begin = immediate_step("stream set-points", lambda: self._offboard.begin(setpoint, lasting))
        if self._offboard.holds:
            return (begin,)
        enter = replace(
            self._change_mode(OFFBOARD),
            done=lambda _: self._offboard.entered(),
            skippable=False,
            leads_to=(HOLD,),
            keep=self._stream,
        )
        return (*first, *self._end_manual_control(), begin, enter)

    def return_home(self, within: Ns) -> Sequence[Step]:
        """Enter AUTO.RTL. A drone lands and disarms itself; a rover stops near home.

        PX4 takes the destination of a return from its home position every 2 s: a return that begins right
        after home was moved ends at the old one. So a home that has just been moved is waited for. PX4 1.17
        corrects home's altitude up to four times a second after a take-off; that is no other home.
        """
        if self.telemetry.kind == DRONE_KIND:
            return (*self._home_taken_up(), *self._until_disarmed(modes.RTL, "return home and land", within))
        reach = self._reach_home(modes.RTL, HOLD, within)
        return (*self._home_taken_up(), *self._end_manual_control(), self._change_mode(modes.RTL), reach)

    def _home_taken_up(self) -> Sequence[Step]:
        began = self._kernel.now()

        def old_enough(seen: Telemetry) -> bool:
            now = self._kernel.now()
            # a home that moves on must not keep it from returning
            return now - seen.home_ns >= HOME_TAKEN_UP_AFTER or now - began >= HOME_TAKEN_UP_AFTER + S

        if not self.telemetry.armed or old_enough(self.telemetry):
            return ()
        wait = Step(ask="take up its new home", send=send_nothing, done=old_enough, within=10 * S)
        return (wait,)

    def land(self, within: Ns) -> Sequence[Step]:
        """Enter AUTO.LAND; done when disarmed. Without a position it drifts with the wind."""
        return self._until_disarmed(modes.LAND, "land", within)

    # -- manual flight

    def stabilize(self) -> Sequence[Step]:
        """Enter STABILIZED with manual control repeated; in the air not with an idle throttle."""
        self._manual.hold_any()
        check_throttle(self.telemetry, self._manual.held)
        return (*self._taken_in(), self._change_mode(modes.STABILIZED))

    def altitude_hold(self) -> Sequence[Step]:
        """Enter ALTCTL with manual control repeated."""
        self._manual.hold_any()
        return (*self._taken_in(), self._change_mode(modes.ALTCTL))

    def hand_over(self) -> Sequence[Step]:
        """Enter POSCTL, which the transmitter commands, and only then stop: OFFBOARD needs its stream."""
        release = immediate_step("stop the stream", self.stop)
        if self.telemetry.mode in modes.MANUAL_MODES:
            return (release,)
        return (self._change_mode(modes.POSCTL), release)

    def manual(self) -> Sequence[Step]:
        """Enter MANUAL with manual control repeated."""
        self._manual.hold_any()
        return (*self._taken_in(), self._change_mode(modes.MANUAL))

    def manual_control(self, control: ManualControl | None) -> None:
        """Repeat *control* while the mode is ours; ``None`` centres it."""
        if control is None:
            self._manual.centre()
        else:
            self._manual.hold(control)

    def _taken_in(self) -> Sequence[Step]:
        """Wait until PX4 counts manual control: it refuses a mode of sticks before."""
        if self._manual.taken_in():
            return ()
        wait = Step(
            ask="have the sticks taken in",
            send=send_nothing,
            done=lambda _: self._manual.taken_in(),
            within=5 * S,
            keep=self._repeated_sticks(),
        )
        return (wait,)

    def _repeated_sticks(self) -> Repeat:
        def keep() -> None:
            self._manual.repeat()
            self.telemetry.changed.notify()

        return Repeat(SETPOINT_PERIOD, keep)

    def _end_manual_control(self) -> Sequence[Step]:
        """Centre manual control and wait, because it counts as moving for a moment after it was centred."""
        if self._manual.held is None:
            return ()

        centre = Step(
            ask="centre the sticks",
            send=self._manual.centre,
            done=lambda _: self._manual.settled(),
            within=5 * S,
            keep=self._repeated_sticks(),
        )
        return (centre,)

    def stop(self) -> None:
        """Stop repeating set-points and manual control."""
        self._offboard.stop()
        self._manual.stop()

    # -- missions

    def _items(self, mission: Sequence[MissionItem]) -> list[PlanItem]:
        return mission_items(mission, self._here("upload a mission"))

    def _end_in_air(self, mission: Sequence[MissionItem]) -> int | None:
        """Return the last place: PX4 1.14 does not report the end of a mission."""
        if isinstance(mission[-1], Land | ReturnHome):
            return None
        places = [number for number, one in enumerate(mission) if isinstance(one, TakeOff | Waypoint)]
        return places[-1] if places else None

    def start_mission(self, within: Ns) -> Sequence[Step]:
        """Wait until ready, enter AUTO.MISSION and arm; done when the mission has ended."""
        began = self._kernel.now()
        repeats = self.telemetry.mission_reached >= 0
        ready = () if self.telemetry.armed else (self._change_mode(HOLD), *self.ready(READY_WITHIN))
        rewind = Step(
            ask="prepare the mission",
            send=self._backend.rewind_mission,
            done=lambda _: self._kernel.now() - began >= (REPEATED_FOR if repeats else EXAMINED_IN),
            within=5 * S,
        )
        return (
            *self._end_manual_control(),
            *ready,
            rewind,
            immediate_step("begin anew", self._forget_progress),
            self._change_mode(modes.MISSION),
            *(replace(step, mode=modes.MISSION) for step in self.arm()),
            self._finish_mission(modes.MISSION, (modes.RTL,), within, HOLD),
        )

    # -- common steps

    def _change_mode(self, mode: str) -> Step:
        step = mode_step(self.telemetry, mode, Ack.MODE, self._note_commanded, self._backend.set_mode)
        # a stream that ends enters AUTO.LOITER; on a bad link this shows only after the next command
        return replace(step, leads_to=(HOLD,)) if self._offboard.leaving else step

    def _note_commanded(self, mode: str) -> None:
        self._manual.note_commanded(mode)
        if mode == OFFBOARD:
            self._offboard.note_commanded()
        else:
            self._offboard.leave()

    def _until_disarmed(self, mode: str, ask: str, within: Ns) -> Sequence[Step]:
        if not self.telemetry.armed:
            return ()
        centre = self._end_manual_control()
        enter = self._change_mode(mode)
        # a drone that disarms meanwhile is down already, and PX4 leaves the mode at once
        entered = replace(enter, done=lambda seen: not seen.armed or enter.done(seen))
        return (*centre, entered, disarmed_step(ask, mode, within))


def mission_items(mission: Sequence[MissionItem], here: Position) -> list[PlanItem]:
    """Return the mission as PX4's items, without one for home; items without a place use the mission frame.

    As recorded, PX4 1.14 refuses commands without a place in a global frame, and flies to latitude and
    longitude 0 for an item that states none.

    Args:
        mission: items of the mission.
        here: position at its start.
    """
    items: list[PlanItem] = []
    at = here
    for one in mission:
        items.append(_wire_item(one, at))
        at = getattr(one, "position", None) or at
    return items


def _wire_item(one: MissionItem, at: Position) -> PlanItem:
    if isinstance(one, TakeOff):
        up = Position(at.latitude, at.longitude, AboveHome(one.height))
        return mission_item("MAV_CMD_NAV_TAKEOFF", 0.0, 0.0, 0.0, nan, at=up)
    if isinstance(one, ChangeSpeed):
        return mission_item("MAV_CMD_DO_CHANGE_SPEED", GROUND_SPEED, one.speed, UNCHANGED, frame=NO_PLACE)
    if isinstance(one, ReturnHome):
        return mission_item("MAV_CMD_NAV_RETURN_TO_LAUNCH", frame=NO_PLACE)
    if isinstance(one, Land):
        down = one.position or Position(at.latitude, at.longitude, AboveHome(0.0))
        return mission_item("MAV_CMD_NAV_LAND", 0.0, 0.0, 0.0, nan, at=down)
    return mission_item(
        "MAV_CMD_NAV_WAYPOINT", one.stay_s, WAYPOINT_RADIUS_M, 0.0, one.heading, at=one.position
    )
