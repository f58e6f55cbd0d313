"""Driver of ArduPilot's Copter and Rover: the steps of each operation, and the set-points that are repeated.

Facts observed on ArduCopter and ArduRover 4.5: a change of mode is accepted on the ground without a position,
arming in GUIDED is not; so the driver waits until the vehicle is ready. An accepted command is acknowledged
before the heartbeat shows its effect. A target in GUIDED is not acknowledged and never expires; a velocity
lasts 3 s. Manual control falls back on the transmitter after 3 s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import hypot, isfinite, isnan, nan

from volery.base.errors import Refused
from volery.base.position import AboveGround, AboveHome, Position
from volery.base.time import MS, Ns, S
from volery.kernel.api import Action, Kernel
from volery.vehicles.driver import (
    Acceleration,
    AttitudeTarget,
    ChangeSpeed,
    Land,
    LinkLossAction,
    ManualControl,
    MissionItem,
    ReturnHome,
    Settings,
    Step,
    TakeOff,
    Waypoint,
)
from volery.vehicles.drivers.ardupilot.backend import RELEASED, ArduPilotBackend
from volery.vehicles.drivers.ardupilot.modes import (
    GUIDED,
    RESTING,
    beyond_own_fence,
    link_loss_settings,
    on_link_loss,
)
from volery.vehicles.drivers.mavlink.backend import GROUND_SPEED, UNCHANGED, Ack, mission_item
from volery.vehicles.drivers.mavlink.driver import MavlinkDriver
from volery.vehicles.drivers.steps import (
    ANSWERED_WITHIN,
    DRONE_KIND,
    READY_WITHIN,
    STOPPED_WITHIN,
    TURNED_WITHIN,
    SetpointRepeater,
    TargetMonitor,
    at_rest,
    check_throttle,
    climbed_to,
    disarmed_step,
    heading_reached,
    immediate_step,
    mode_step,
    send_nothing,
)
from volery.vehicles.services import PlanItem
from volery.vehicles.telemetry import Velocity

CONTROL_PERIOD: Ns = 200 * MS
VELOCITY_PERIOD: Ns = 200 * MS

RELEASED_TIMES = 3
"""How often the release of the channels is sent: it is not acknowledged."""

STILL = Velocity(0.0, 0.0, 0.0)


class ArduPilotSetpoints(SetpointRepeater):
    """Repeats set-points in GUIDED, and manual control in GUIDED and in the mode commanded last.

    With a backend that has a cycle nothing is repeated here: the node's own loop does that.
    """

    def __init__(self, kernel: Kernel, backend: ArduPilotBackend) -> None:
        super().__init__(
            kernel,
            backend.telemetry,
            GUIDED,
            velocity_period=VELOCITY_PERIOD,
            control_period=CONTROL_PERIOD,
        )
        self.commanded_mode = ""
        self._backend = backend

    # -- velocity

    def send_stop(self) -> None:
        """Send a velocity of zero once."""
        self._backend.send_velocity(STILL, 0.0)

    def follow(self, send: Action, lasting: Ns) -> None:
        """Repeat a set-point for *lasting*, then stop."""
        if self._backend.cycle is not None:
            send()
        else:
            super().follow(send, lasting)

    # -- manual control

    def hold(self, control: ManualControl) -> None:
        """Send *control* at once and repeat it."""
        self.held = control
        self._repeat_control()
        if self._backend.cycle is None and self.held is not None:
            super().hold(control)

    def release(self) -> None:
        """Give the channels back to the transmitter, and again, as messages may be lost; stop repeating."""
        if self.held is not None:
            self._send_release()
            for number in range(1, RELEASED_TIMES):
                self._kernel.call_at(self._kernel.now() + number * CONTROL_PERIOD, self._release_again)
        super().release()

    def _release_again(self) -> None:
        if self.held is None:
            self._send_release()

    def _send_release(self) -> None:
        rover = self._telemetry.kind != DRONE_KIND
        self._backend.override_channels([RELEASED, None, RELEASED, None] if rover else [RELEASED] * 4)

    def is_commanded(self, mode: str) -> bool:
        """Return whether *mode* is the one commanded last."""
        return mode == self.commanded_mode

    def send_control(self, control: ManualControl) -> None:
        """Send manual control as pulse widths of RC channels."""
        self._backend.override_channels(rc_channels(control, self._telemetry.kind))


def rc_channels(control: ManualControl, kind: str) -> list[int | None]:
    """Return pulse widths in µs of channels 1 to 4: roll, pitch, throttle, yaw; forward is a low pitch."""
    if kind == DRONE_KIND:
        return [
            round(1500 + 500 * control.roll),
            round(1500 - 500 * control.pitch),
            round(1000 + 1000 * control.throttle),
            round(1500 + 500 * control.yaw),
        ]
    return [round(1500 + 500 * control.roll), None, round(1500 + 500 * control.throttle), None]


CONFIRMED_WITHIN: Ns = 600 * MS
TIMES_UNCONFIRMED = 3
"""How often a target is sent that an autopilot does not report."""


class ArduPilot(MavlinkDriver):
    """Driver of an ArduPilot. See ``vehicles.driver.Driver`` for the operations."""

    obeys = GUIDED
    landing_modes = frozenset({"LAND", "RTL", "SMART_RTL", "AUTO_RTL"})
    _backend: ArduPilotBackend

    def __init__(self, kernel: Kernel, name: str, backend: ArduPilotBackend) -> None:
        super().__init__(kernel, name, backend)
        self._setpoints = ArduPilotSetpoints(kernel, backend)

    @property
    def offboard_mode(self) -> str:
        """GUIDED; words that are no mode while another station has control in it."""
        return self._takeover.offboard_mode

    def on_link_loss(self) -> str:
        """Return the reaction to a lost link, from the failsafe for ground stations."""
        parameters = self._backend.parameters
        return on_link_loss(self.telemetry.kind, parameters) if parameters is not None else ""

    def _link_loss_settings(self, action: LinkLossAction) -> Settings:
        return link_loss_settings(self.name, self.telemetry.kind, action, self._backend.parameters or {})

    def _check_own_fence(self, goal: Position) -> None:
        """Refuse a goal outside the aircraft's own fence: ArduPilot ignores such a target without a word."""
        parameters, frame = self._backend.parameters, self.telemetry.home_frame
        if parameters is None or frame is None:
            return
        east, north, height = frame.local(goal)
        if isinstance(goal.altitude, AboveGround):
            height = nan
        beyond = beyond_own_fence(parameters, hypot(east, north), height)
        if beyond:
            raise Refused(self.name, f"go to {goal}", f"{beyond}; choose a goal inside or change the fence")

    # -- from the ground

    def takeoff(self, height: float, within: Ns) -> Sequence[Step]:
        """Wait until ready, enter GUIDED, arm and climb; ArduPilot disarms itself 10 s after arming."""
        climb = Step(
            ask=f"climb to {height:g} m",
            send=lambda: self._backend.takeoff(height),
            done=climbed_to(height),
            within=within,
            answer=Ack.TAKEOFF,
            again=2 * S,
            mode=GUIDED,
            armed=True,
        )
        return (*self._armed_in_guided(), climb)

    def _armed_in_guided(self) -> Sequence[Step]:
        """Return steps that arm in GUIDED; a pilot who changes the mode meanwhile has control."""
        arm = (replace(step, mode=GUIDED) for step in self.arm())
        return (*self.ready(READY_WITHIN), *self._guided(), *arm)

    # -- operations with a position

    def goto(self, goal: Position, speed: float | None, within: Ns) -> Sequence[Step]:
        """Enter GUIDED and send a target until it is reported; a rover is armed first.

        The speed follows the target: the first target after a take-off or a velocity restores WPNAV_SPEED.
        """
        rover = self.telemetry.kind != DRONE_KIND
        self._check_own_fence(goal)
        start = self._armed_in_guided() if rover else self._guided()
        sent = 0

        def send() -> None:
            nonlocal sent
            self._backend.send_target(goal)
            self._backend.request_target()
            sent += 1

        monitor = TargetMonitor(self.telemetry, self._takeover)
        reach = monitor.step(goal, send, GUIDED, within, rover=rover, kernel=self._kernel)
        if speed is None:
            return (*start, reach)
        begin = replace(
            reach,
            done=lambda _: monitor.confirmed or sent >= TIMES_UNCONFIRMED,
            again=CONFIRMED_WITHIN,
        )
        return (*start, begin, self._set_speed(speed, GUIDED), reach)

    def hold(self) -> Sequence[Step]:
        """Stop a rover in HOLD; stop a drone in GUIDED by a velocity of zero, then hold that position."""
        if self.telemetry.kind != DRONE_KIND:
            stand = Step(ask="stand", send=send_nothing, done=at_rest, within=STOPPED_WITHIN, mode=RESTING)
            return (self._change_mode(RESTING), stand)
        return (*self._guided(), self._setpoints.braking_step(), self._stay_step())

    def _stay_step(self) -> Step:
        """Return a step that sends the present position as the target until it is reported, or thrice."""
        seen = self.telemetry
        monitor = TargetMonitor(seen, self._takeover)
        sent = 0

        def send() -> None:
            nonlocal sent
            here = seen.position
            if here is not None and seen.located and isfinite(seen.above_home) and not monitor.confirmed:
                goal = Position(here.latitude, here.longitude, AboveHome(seen.above_home))
                monitor.set(goal)
                self._backend.send_target(goal)
            sent += 1

        return Step(
            ask="stay",
            send=send,
            done=lambda _: monitor.confirmed or sent >= TIMES_UNCONFIRMED or not seen.located,
            within=STOPPED_WITHIN,
            again=CONFIRMED_WITHIN,
            mode=GUIDED,
            armed=True,
        )

    def velocity(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> Sequence[Step]:
        """Enter GUIDED and repeat a velocity for *lasting*, then stop."""
        return self._follow(lambda: self._backend.send_velocity(velocity, yaw_rate), lasting)

    def acceleration(self, acceleration: Acceleration, yaw_rate: float, lasting: Ns) -> Sequence[Step]:
        """Enter GUIDED and repeat an acceleration for *lasting*, then stop."""
        return self._follow(lambda: self._backend.send_acceleration(acceleration, yaw_rate), lasting)

    def attitude(self, target: AttitudeTarget, lasting: Ns) -> Sequence[Step]:
        """Enter GUIDED and repeat an attitude for *lasting*, then stop; thrust commands the climb rate."""
        return self._follow(lambda: self._backend.send_attitude(target), lasting)

    def _follow(self, send: Action, lasting: Ns) -> Sequence[Step]:
        follow = immediate_step("fly on", lambda: self._setpoints.follow(send, lasting))
        return (*self._guided(), follow)

    def heading(self, degrees: float) -> Sequence[Step]:
        """Turn in place in GUIDED."""
        turn = Step(
            ask=f"turn to {degrees:g} degrees",
            send=lambda: self._backend.turn(degrees),
            done=heading_reached(degrees),
            within=TURNED_WITHIN,
            answer=Ack.HEADING,
            again=2 * S,
            mode=GUIDED,
            armed=True,
        )
        return (*self._guided(), turn)

    def return_home(self, within: Ns) -> Sequence[Step]:
        """Enter RTL. A drone lands and disarms itself; a rover stops near home."""
        if self.telemetry.kind == DRONE_KIND:
            return self._until_disarmed("RTL", "return home and land", within)
        return (self._change_mode("RTL"), self._release_step(), self._reach_home("RTL", RESTING, within))

    def land(self, within: Ns) -> Sequence[Step]:
        """Enter LAND; done when the autopilot has disarmed itself."""
        return self._until_disarmed("LAND", "land", within)

    # -- manual flight

    def stabilize(self) -> Sequence[Step]:
        """Enter STABILIZE with manual control repeated; in the air not with an idle throttle."""
        self._setpoints.hold_any()
        check_throttle(self.telemetry, self._setpoints.held)
        return (self._change_mode("STABILIZE"),)

    def altitude_hold(self) -> Sequence[Step]:
        """Enter ALT_HOLD with manual control repeated."""
        self._setpoints.hold_any()
        return (self._change_mode("ALT_HOLD"),)

    def hand_over(self) -> Sequence[Step]:
        """Release the channels; leave GUIDED for ALT_HOLD (a rover: MANUAL), which obeys the transmitter."""
        release = immediate_step("give the channels back to the transmitter", self.stop)
        if self.telemetry.mode != GUIDED:
            return (release,)
        return (release, self._change_mode("ALT_HOLD" if self.telemetry.kind == DRONE_KIND else "MANUAL"))

    def manual(self) -> Sequence[Step]:
        """Enter MANUAL with manual control repeated."""
        if self._setpoints.held is None:
            self._setpoints.hold(ManualControl(throttle=0.0))
        return (self._change_mode("MANUAL"),)

    def manual_control(self, control: ManualControl | None) -> None:
        """Repeat *control* while the mode is ours; ``None`` ends the repetition."""
        self._setpoints.set_control(control)

    def stop(self) -> None:
        """Stop repeating set-points and manual control."""
        self._setpoints.end()

    # -- missions

    def _items(self, mission: Sequence[MissionItem]) -> list[PlanItem]:
        return mission_items(mission)

    def _end_in_air(self, mission: Sequence[MissionItem]) -> int | None:
        """Return the last item; item 0 is home, and a waypoint with a heading is two items."""
        return len(mission_items(mission)) - 1 if isinstance(mission[-1], Waypoint) else None

    def start_mission(self, within: Ns) -> Sequence[Step]:
        """Wait until ready, arm in GUIDED, enter AUTO and start; done when the mission has ended."""
        begin = Step(
            ask="start the mission",
            send=self._backend.start_mission,
            done=lambda seen: Ack.START in seen.answers and seen.answers[Ack.START].accepted,
            within=ANSWERED_WITHIN,
            answer=Ack.START,
            again=2 * S,
            mode="AUTO",
            armed=True,
        )
        return (
            *self.ready(READY_WITHIN),
            *self._guided(),
            *self.arm(),
            immediate_step("prepare the mission", self._forget_progress),
            self._change_mode("AUTO"),
            begin,
            self._finish_mission("AUTO", (RESTING, "RTL"), within),
        )

    # -- common steps

    def _note_commanded(self, mode: str) -> None:
        self._setpoints.commanded_mode = mode

    def _change_mode(self, mode: str) -> Step:
        if self._setpoints.following:
            self._setpoints.end_velocity()
        return mode_step(self.telemetry, mode, Ack.MODE, self._note_commanded, self._backend.set_mode)

    def _guided(self) -> Sequence[Step]:
        """Enter GUIDED and only then release manual control."""
        return (self._change_mode(GUIDED), self._release_step())

    def _release_step(self) -> Step:
        return Step(
            ask="let go of the sticks",
            send=self._setpoints.release,
            done=lambda _: self._setpoints.held is None,
            within=ANSWERED_WITHIN,
            skippable=True,
        )

    def _until_disarmed(self, mode: str, ask: str, within: Ns) -> Sequence[Step]:
        if not self.telemetry.armed:
            return ()
        return (self._change_mode(mode), self._release_step(), disarmed_step(ask, mode, within))


def mission_items(mission: Sequence[MissionItem]) -> list[PlanItem]:
    """Return the mission as ArduPilot's items. Item 0 is home, which ArduPilot fills in itself."""
    items = [mission_item("MAV_CMD_NAV_WAYPOINT")]
    for one in mission:
        if isinstance(one, TakeOff):
            items.append(mission_item("MAV_CMD_NAV_TAKEOFF", z=one.height))
        elif isinstance(one, ChangeSpeed):
            items.append(mission_item("MAV_CMD_DO_CHANGE_SPEED", GROUND_SPEED, one.speed, UNCHANGED))
        elif isinstance(one, ReturnHome):
            items.append(mission_item("MAV_CMD_NAV_RETURN_TO_LAUNCH"))
        elif isinstance(one, Land):
            items.append(mission_item("MAV_CMD_NAV_LAND", at=one.position))
        else:
            if not isnan(one.heading):
                items.append(mission_item("MAV_CMD_CONDITION_YAW", one.heading))
            items.append(mission_item("MAV_CMD_NAV_WAYPOINT", one.stay_s, at=one.position))
    return items
