"""ArduPilot's sequences, written once: what its Copter and Rover want to be asked, and how one sees it done.

They reach it over ``Commands``. Facts behind them, observed on ArduCopter and ArduRover 4.5: a change of mode
is accepted on the ground without a position, arming in GUIDED is not; so it waits until the vehicle is ready.
An accepted command is acknowledged before the heartbeat shows it. A target in GUIDED has no acknowledgement
and never expires; a velocity stands for 3 s. Sticks fall back on the transmitter after 3 s.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import isfinite

from volery.base.errors import LinkError, UsageError
from volery.base.position import AboveHome, Position
from volery.base.time import MINUTE, Ns, S
from volery.drivers.ardupilot import commands as key
from volery.drivers.ardupilot.arrival import NEAR_UP_M, ROVER_NEAR_M, STANDING_M_S, at, distance, standing
from volery.drivers.ardupilot.commands import Commands
from volery.drivers.ardupilot.items import items_of
from volery.drivers.ardupilot.modes import DRONE_KIND, GUIDED
from volery.drivers.ardupilot.setpoints import VELOCITY_PERIOD, Setpoints
from volery.kernel.api import Action, Kernel
from volery.vehicles.driver import Capability, Repeat, Step, Sticks
from volery.vehicles.mission import MissionItem, Waypoint
from volery.vehicles.telemetry import Telemetry, Velocity

CHECKS_PERIOD: Ns = 10 * S
ANSWERED_WITHIN: Ns = 5 * S
ARMED_WITHIN: Ns = 10 * S
READY_WITHIN: Ns = 2 * MINUTE
STOPPED_WITHIN: Ns = 30 * S
TURNED_WITHIN: Ns = 30 * S

TURNED_DEG = 3.0
IDLE_THROTTLE = 0.1

_SHARED = frozenset(
    {
        Capability.GOTO,
        Capability.SPEED,
        Capability.RETURN_HOME,
        Capability.HOLD,
        Capability.STICKS,
        Capability.MISSION,
    }
)
_DRONE = _SHARED | {
    Capability.TAKEOFF,
    Capability.VELOCITY,
    Capability.HEADING,
    Capability.LAND,
    Capability.STABILIZE,
    Capability.ALTITUDE_HOLD,
}
_NOTHING: frozenset[Capability] = frozenset()


class ArduPilot:
    """The driver. See ``vehicles.driver.Driver`` for what the methods mean."""

    handover = GUIDED
    comes_down = frozenset({"LAND", "RTL", "SMART_RTL", "AUTO_RTL"})

    def __init__(self, kernel: Kernel, name: str, commands: Commands) -> None:
        self.name = name
        self._commands = commands
        self.telemetry = commands.telemetry
        self._setpoints = Setpoints(kernel, commands)
        self._last_item: int | None = None  # where the mission on board ends in the air

    @property
    def capabilities(self) -> frozenset[Capability]:
        """By the kind of vehicle; none until it has been heard."""
        return {"drone": _DRONE, "rover": _SHARED}.get(self.telemetry.kind, _NOTHING)

    @property
    def cycle(self) -> Action | None:
        """The carrier's."""
        return self._commands.cycle

    def look(self) -> None:
        """Take in what has arrived."""
        self._commands.look()

    def if_silent(self) -> str:
        """Not known yet."""
        return ""

    def problem(self) -> LinkError | None:
        """What is wrong with the way to the autopilot."""
        return self._commands.problem()

    def close(self) -> None:
        """Stop talking and let go of the link."""
        self.stop()
        self._commands.close()

    # -- on the ground

    def ready(self, within: Ns) -> Sequence[Step]:
        """Until the arming checks pass and there is a position."""
        step = Step(
            ask="be ready to arm and to go by position",
            send=_nothing,
            done=lambda seen: seen.ready or seen.armed,
            within=within,
            skippable=True,
            keep=Repeat(CHECKS_PERIOD, self._commands.check),
            advice="give it a view of the sky, stand it still and level, and look at its arming checks",
        )
        return (step,)

    def arm(self) -> Sequence[Step]:
        """In the mode it is in."""
        step = Step(
            ask="arm",
            send=lambda: self._commands.arm(True),
            done=lambda seen: seen.armed,
            within=ARMED_WITHIN,
            skippable=True,
            answer=key.ARM,
            again=2 * S,
        )
        return (step,)

    def disarm(self, force: bool) -> Sequence[Step]:
        """In the air it is refused without *force*."""
        step = Step(
            ask="disarm",
            send=lambda: self._commands.arm(False, force=force),
            done=lambda seen: not seen.armed,
            within=ARMED_WITHIN,
            skippable=True,
            answer=key.ARM,
            again=2 * S,
        )
        return (step,)

    def takeoff(self, height: float, within: Ns) -> Sequence[Step]:
        """Ready, GUIDED, armed, up: within 10 s of each other, or it disarms itself."""

        def up(seen: Telemetry) -> bool:
            near = abs(seen.above_home - height) <= NEAR_UP_M
            return seen.flying and near and abs(seen.velocity.up) <= STANDING_M_S

        climb = Step(
            ask=f"climb to {height:g} m",
            send=lambda: self._commands.takeoff(height),
            done=up,
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
        """GUIDED, then a target; a rover is armed on the way."""
        rover = self.telemetry.kind != DRONE_KIND
        start = self._armed_in_guided() if rover else self._guided()
        target = Step(
            ask=f"reach {goal}",
            send=lambda: self._commands.target(goal),
            done=at(goal, rover),
            within=within,
            again=S,
            mode=GUIDED,
            armed=True,
        )
        return (*start, *(self._at_speed(speed) if speed is not None else ()), target)

    def hold(self) -> Sequence[Step]:
        """A rover in HOLD; a drone in GUIDED, first without velocity, then where it has stopped."""
        if self.telemetry.kind != DRONE_KIND:
            stand = Step(ask="stand", send=_nothing, done=standing, within=STOPPED_WITHIN, mode="HOLD")
            return (*self._change("HOLD"), stand)
        brake = Step(
            ask="stop",
            send=self._setpoints.stand_still,
            done=standing,
            within=STOPPED_WITHIN,
            keep=Repeat(VELOCITY_PERIOD, self._setpoints.stand_still),
            mode=GUIDED,
            armed=True,
        )
        return (*self._guided(), brake, self._now("stay", self._stay))

    def velocity(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> Sequence[Step]:
        """GUIDED, then repeated until it has lasted long enough; then it stops."""
        return (
            *self._guided(),
            self._now("fly on", lambda: self._setpoints.follow(velocity, yaw_rate, lasting)),
        )

    def heading(self, degrees: float) -> Sequence[Step]:
        """In GUIDED, on the spot."""

        def turned(seen: Telemetry) -> bool:
            off = (seen.attitude.heading - degrees + 180.0) % 360.0 - 180.0
            return abs(off) <= TURNED_DEG

        turn = Step(
            ask=f"turn to {degrees:g} degrees",
            send=lambda: self._commands.turn(degrees),
            done=turned,
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

        def home(seen: Telemetry) -> bool:
            return seen.home is not None and distance(seen.position, seen.home) <= ROVER_NEAR_M + 1.0

        come = Step(
            ask="return home",
            send=_nothing,
            done=lambda seen: home(seen) and standing(seen),
            within=within,
            mode="RTL",
            leads_to=("HOLD",),
            armed=True,
        )
        return (*self._change("RTL"), self._now("let go of the sticks", self._setpoints.release), come)

    def land(self, within: Ns) -> Sequence[Step]:
        """LAND, until it has disarmed itself."""
        return self._until_disarmed("LAND", "land", within)

    # -- by sticks

    def stabilize(self) -> Sequence[Step]:
        """STABILIZE, with the sticks held. In the air not with an idle throttle: it would fall."""
        self._setpoints.hold_any()
        held = self._setpoints.held
        throttle = held.throttle if held is not None else 0.0
        if self.telemetry.flying and throttle < IDLE_THROTTLE:
            raise UsageError(
                f"{self.name}: the throttle is at {throttle:g}: in STABILIZE the motors would idle and it "
                f"would fall; manual_control() with a throttle about 0.5 first"
            )
        return self._change("STABILIZE")

    def altitude_hold(self) -> Sequence[Step]:
        """ALT_HOLD, with the sticks held."""
        self._setpoints.hold_any()
        return self._change("ALT_HOLD")

    def manual(self) -> Sequence[Step]:
        """MANUAL, with the sticks held."""
        if self._setpoints.held is None:
            self._setpoints.hold(Sticks(throttle=0.0))
        return self._change("MANUAL")

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
        """By MAVLink's mission protocol."""
        items = items_of(mission)
        step = Step(
            ask=f"take a mission of {len(items)} items",
            send=lambda: self._commands.upload(items),
            done=lambda seen: key.MISSION in seen.answers and seen.answers[key.MISSION].accepted,
            within=30 * S + len(items) * S,
            answer=key.MISSION,
            again=2 * S,
        )
        self._last_item = len(items) - 1 if isinstance(mission[-1], Waypoint) else None
        return (step,)

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
        go_on = Step(
            ask="finish the mission",
            send=self._commands.watch_mission,
            done=self._mission_over,
            within=within,
            mode="AUTO",
            leads_to=("HOLD", "RTL"),
        )
        prepare = self._now("prepare the mission", self._forget_progress)
        armed = (*self.ready(READY_WITHIN), *self._guided(), *self.arm())
        return (*armed, prepare, *self._change("AUTO"), begin, go_on)

    def _forget_progress(self) -> None:
        self.telemetry.mission_reached = -1
        self.telemetry.mission_ended = False

    def _mission_over(self, seen: Telemetry) -> bool:
        last = self._last_item
        return not seen.armed or seen.mission_ended or (last is not None and seen.mission_reached >= last)

    # -- pieces of sequences

    def _now(self, ask: str, action: Callable[[], None]) -> Step:
        """Something that is done as soon as it is sent."""
        return Step(ask=ask, send=action, done=lambda seen: True, within=ANSWERED_WITHIN)

    def _change(self, mode: str) -> Sequence[Step]:
        def send() -> None:
            self._setpoints.asked_mode = mode
            self._commands.set_mode(mode)

        self._setpoints.unfollow()
        step = Step(
            ask=f"change to {mode}",
            send=send,
            done=lambda seen: seen.mode == mode,
            within=ANSWERED_WITHIN,
            skippable=True,
            answer=key.MODE,
            again=S,
            enters=mode,
        )
        return (step,)

    def _guided(self) -> Sequence[Step]:
        """GUIDED first; only then are the sticks let go."""
        return (*self._change(GUIDED), self._now("let go of the sticks", self._setpoints.release))

    def _at_speed(self, speed: float) -> Sequence[Step]:
        step = Step(
            ask=f"go at {speed:g} m/s",
            send=lambda: self._commands.speed(speed),
            done=lambda seen: key.SPEED in seen.answers and seen.answers[key.SPEED].accepted,
            within=ANSWERED_WITHIN,
            answer=key.SPEED,
            again=S,
            mode=GUIDED,
        )
        return (step,)

    def _until_disarmed(self, mode: str, ask: str, within: Ns) -> Sequence[Step]:
        if not self.telemetry.armed:
            return ()
        down = Step(ask=ask, send=_nothing, done=lambda seen: not seen.armed, within=within, mode=mode)
        return (*self._change(mode), self._now("let go of the sticks", self._setpoints.release), down)

    def _stay(self) -> None:
        here = self.telemetry.position
        if here is not None and isfinite(self.telemetry.above_home):
            above = AboveHome(self.telemetry.above_home)
            self._commands.target(Position(here.latitude, here.longitude, above))


def _nothing() -> None:
    """Some steps only wait."""
