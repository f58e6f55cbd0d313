"""Missions as ArduPilot wants them: item 0 is home, which it fills in itself.

ArduPilot's sequences, written once: what its Copter and Rover want to be asked, and how one sees it done.

They reach it over ``ArduPilotBackend``. Facts behind them, observed on ArduCopter and ArduRover 4.5: a change of mode
is accepted on the ground without a position, arming in GUIDED is not; so it waits until the vehicle is ready.
An accepted command is acknowledged before the heartbeat shows it. A target in GUIDED has no acknowledgement
and never expires; a velocity stands for 3 s. Sticks fall back on the transmitter after 3 s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import isfinite, isnan

from volery.base.position import AboveHome, Position
from volery.base.time import Ns, S
from volery.kernel.api import Kernel
from volery.vehicles.driver import ManualControl, Step
from volery.vehicles.drivers.ardupilot.backend import ArduPilotBackend
from volery.vehicles.drivers.ardupilot.link_loss import on_link_loss
from volery.vehicles.drivers.ardupilot.modes import GUIDED
from volery.vehicles.drivers.ardupilot.setpoints import ArduPilotSetpoints
from volery.vehicles.drivers.mavlink import backend as key
from volery.vehicles.drivers.mavlink.backend import GROUND_SPEED, UNCHANGED, Item, item
from volery.vehicles.drivers.mavlink.driver import MavlinkDriver
from volery.vehicles.drivers.steps import (
    ANSWERED_WITHIN,
    DRONE_KIND,
    READY_WITHIN,
    STOPPED_WITHIN,
    TURNED_WITHIN,
    TargetMonitor,
    at_rest,
    check_throttle,
    climbed_to,
    disarmed_step,
    heading_reached,
    immediate_step,
    send_nothing,
)
from volery.vehicles.mission import ChangeSpeed, Land, MissionItem, ReturnHome, TakeOff, Waypoint
from volery.vehicles.telemetry import Velocity


def items_of(mission: Sequence[MissionItem]) -> list[Item]:
    """The items on the wire, home first."""
    items = [item("MAV_CMD_NAV_WAYPOINT")]
    for one in mission:
        items += _translated(one)
    return items


def _translated(one: MissionItem) -> list[Item]:
    if isinstance(one, TakeOff):
        return [item("MAV_CMD_NAV_TAKEOFF", z=one.height)]
    if isinstance(one, ChangeSpeed):
        return [item("MAV_CMD_DO_CHANGE_SPEED", GROUND_SPEED, one.speed, UNCHANGED)]
    if isinstance(one, ReturnHome):
        return [item("MAV_CMD_NAV_RETURN_TO_LAUNCH")]
    if isinstance(one, Land):
        return [item("MAV_CMD_NAV_LAND", at=one.position)]
    return _waypoint(one)


def _waypoint(one: Waypoint) -> list[Item]:
    point = item("MAV_CMD_NAV_WAYPOINT", one.stay_s, at=one.position)
    if isnan(one.heading):
        return [point]
    return [item("MAV_CMD_CONDITION_YAW", one.heading), point]


class ArduPilot(MavlinkDriver):
    """The driver. See ``vehicles.driver.Driver`` for what the methods mean."""

    obeys = GUIDED
    landing_modes = frozenset({"LAND", "RTL", "SMART_RTL", "AUTO_RTL"})

    def __init__(self, kernel: Kernel, name: str, commands: ArduPilotBackend) -> None:
        super().__init__(kernel, name, commands)
        self._commands = commands
        self._setpoints = ArduPilotSetpoints(kernel, commands)

    def on_link_loss(self) -> str:
        """From its failsafe for ground stations."""
        parameters = self._commands.parameters
        return on_link_loss(self.telemetry.kind, parameters) if parameters is not None else ""

    # -- from the ground

    def takeoff(self, height: float, within: Ns) -> Sequence[Step]:
        """Ready, GUIDED, armed, up: within 10 s of each other, or it disarms itself."""
        climb = Step(
            ask=f"climb to {height:g} m",
            send=lambda: self._commands.takeoff(height),
            done=climbed_to(height),
            within=within,
            answer=key.TAKEOFF,
            again=2 * S,
            mode=GUIDED,
            armed=True,
        )
        return (*self._armed_in_guided(), climb)

    def _armed_in_guided(self) -> Sequence[Step]:
        """Whoever changes the mode meanwhile has it: to arm in another one is not what was asked."""
        armed = (replace(step, mode=GUIDED) for step in self.arm())
        return (*self.ready(READY_WITHIN), *self._guided(), *armed)

    # -- by position

    def goto(self, goal: Position, speed: float | None, within: Ns) -> Sequence[Step]:
        """GUIDED, then a target, until it shows that it goes there; a rover is armed on the way."""
        rover = self.telemetry.kind != DRONE_KIND
        start = self._armed_in_guided() if rover else self._guided()

        def send() -> None:
            self._commands.target(goal)
            self._commands.watch_target()

        target = TargetMonitor(self.telemetry, self._eviction).reach(goal, send, GUIDED, within, rover=rover)
        return (*start, *(self._at_speed(speed, GUIDED) if speed is not None else ()), target)

    def hold(self) -> Sequence[Step]:
        """A rover in HOLD; a drone in GUIDED, first without velocity, then where it has stopped."""
        if self.telemetry.kind != DRONE_KIND:
            stand = Step(ask="stand", send=send_nothing, done=at_rest, within=STOPPED_WITHIN, mode="HOLD")
            return (*self._change("HOLD"), stand)
        return (*self._guided(), self._setpoints.braking(), immediate_step("stay", self._stay))

    def velocity(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> Sequence[Step]:
        """GUIDED, then repeated until it has lasted long enough; then it stops."""
        return (
            *self._guided(),
            immediate_step("fly on", lambda: self._setpoints.follow(velocity, yaw_rate, lasting)),
        )

    def heading(self, degrees: float) -> Sequence[Step]:
        """In GUIDED, on the spot."""

        turn = Step(
            ask=f"turn to {degrees:g} degrees",
            send=lambda: self._commands.turn(degrees),
            done=heading_reached(degrees),
            within=TURNED_WITHIN,
            answer=key.HEADING,
            again=2 * S,
            mode=GUIDED,
            armed=True,
        )
        return (*self._guided(), turn)

    def return_home(self, within: Ns) -> Sequence[Step]:
        """RTL. A drone lands and disarms itself; a rover stops near home."""
        if self.telemetry.kind == DRONE_KIND:
            return self._until_disarmed("RTL", "return home and land", within)

        come = self._comes_home("RTL", "HOLD", within)
        return (*self._change("RTL"), immediate_step("let go of the sticks", self._setpoints.release), come)

    def land(self, within: Ns) -> Sequence[Step]:
        """LAND, until it has disarmed itself."""
        return self._until_disarmed("LAND", "land", within)

    # -- by sticks

    def stabilize(self) -> Sequence[Step]:
        """STABILIZE, with the sticks held. In the air not with an idle throttle: it would fall."""
        self._setpoints.hold_any()
        check_throttle(self.telemetry, self._setpoints.held)
        return self._change("STABILIZE")

    def altitude_hold(self) -> Sequence[Step]:
        """ALT_HOLD, with the sticks held."""
        self._setpoints.hold_any()
        return self._change("ALT_HOLD")

    def manual(self) -> Sequence[Step]:
        """MANUAL, with the sticks held."""
        if self._setpoints.held is None:
            self._setpoints.hold(ManualControl(throttle=0.0))
        return self._change("MANUAL")

    def manual_control(self, sticks: ManualControl | None) -> None:
        """Keep sending them, as long as the mode is ours."""
        self._setpoints.take(sticks)

    def stop(self) -> None:
        """No set-point and no stick is repeated any more."""
        self._setpoints.end()

    # -- missions

    def _items(self, mission: Sequence[MissionItem]) -> list[Item]:
        return items_of(mission)

    def _ends_at(self, mission: Sequence[MissionItem]) -> int | None:
        """Item 0 is home; of one waypoint with a heading the waypoint is the last."""
        return len(items_of(mission)) - 1 if isinstance(mission[-1], Waypoint) else None

    def start_mission(self, within: Ns) -> Sequence[Step]:
        """Ready, GUIDED, armed, AUTO, start; to its end: disarmed, at the last point, or said to be over."""
        begin = Step(
            ask="start the mission",
            send=self._commands.start_mission,
            done=lambda seen: key.START in seen.answers and seen.answers[key.START].accepted,
            within=ANSWERED_WITHIN,
            answer=key.START,
            again=2 * S,
            mode="AUTO",
            armed=True,
        )
        go_on = self._finish_mission("AUTO", ("HOLD", "RTL"), within)
        prepare = immediate_step("prepare the mission", self._forget_progress)
        armed = (*self.ready(READY_WITHIN), *self._guided(), *self.arm())
        return (*armed, prepare, *self._change("AUTO"), begin, go_on)

    # -- pieces of sequences

    def _asks_for(self, mode: str) -> None:
        self._setpoints.asked_mode = mode

    def _change(self, mode: str) -> Sequence[Step]:
        self._setpoints.unfollow()
        return super()._change(mode)

    def _guided(self) -> Sequence[Step]:
        """GUIDED first; only then are the sticks let go."""
        return (*self._change(GUIDED), immediate_step("let go of the sticks", self._setpoints.release))

    def _until_disarmed(self, mode: str, ask: str, within: Ns) -> Sequence[Step]:
        if not self.telemetry.armed:
            return ()
        return (
            *self._change(mode),
            immediate_step("let go of the sticks", self._setpoints.release),
            disarmed_step(ask, mode, within),
        )

    def _stay(self) -> None:
        here = self.telemetry.position
        if here is not None and isfinite(self.telemetry.above_home):
            above = AboveHome(self.telemetry.above_home)
            self._commands.target(Position(here.latitude, here.longitude, above))
