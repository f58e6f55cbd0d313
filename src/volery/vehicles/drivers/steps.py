"""What drivers share: steps, the conditions that end them, takeover by another, and repeated set-points.

An autopilot that goes to a position reports where it goes: ArduPilot and PX4 in POSITION_TARGET_GLOBAL_INT,
where a new target shows within a second and to a centimetre, as recorded; a Paparazzi in the carrot of its
ROTORCRAFT_FP. So once our target has been reported, a different one was set by another station. The mode does
not show it, because it stays the same.

Velocities and manual control are repeated: an autopilot treats missing manual control as the loss of its
transmitter; a single velocity may be lost on the way, and some autopilots forget the last one while others
follow it without end.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from math import hypot, isnan

from volery.base.errors import Refused, UsageError
from volery.base.position import AMSL, AboveHome, Position
from volery.base.time import MINUTE, MS, Ns, S
from volery.kernel.api import Action, Handle, Kernel
from volery.vehicles.driver import ManualControl, Repeat, Step
from volery.vehicles.telemetry import Telemetry

DRONE_KIND, ROVER_KIND = "drone", "rover"
"""Values of ``Telemetry.kind``."""

ANSWERED_WITHIN: Ns = 5 * S
ARMED_WITHIN: Ns = 10 * S
READY_WITHIN: Ns = 2 * MINUTE
STOPPED_WITHIN: Ns = 30 * S
TURNED_WITHIN: Ns = 30 * S
TURNED_DEG = 3.0
STEADY_FOR: Ns = S
"""Time for which a heading must be reached: half the period of a swing past it."""
IDLE_THROTTLE = 0.1

NEAR_M, NEAR_UP_M = 0.6, 0.3
"""Horizontal and vertical distance from its goal at which a drone has arrived."""
AT_REST_M_S = 0.5
ROVER_NEAR_M = 2.5
"""Rovers stop within their waypoint radius: 2 m in ArduRover (WP_RADIUS) and PX4 (NAV_ACC_RAD)."""
ROVER_AT_REST_M_S = 0.3

SAME_TARGET_M = 0.5
"""Targets nearer to each other than this are the same."""
OTHER_TARGET_FOR: Ns = S
"""Time for which another target must be reported: an unreliable link may deliver an old message late."""
TAKEN_UP_WITHIN: Ns = 8 * S
"""Time for which a vehicle may stand still before a target that it does not report."""
CHECK_PERIOD: Ns = 100 * MS


def send_nothing() -> None:
    """Send nothing: the step only waits."""


def immediate_step(ask: str, action: Action, enters: str = "") -> Step:
    """Return a step that is done as soon as *action* has run."""
    return Step(ask=ask, send=action, done=lambda seen: True, within=ANSWERED_WITHIN, enters=enters)


def mode_step(
    seen: Telemetry, mode: str, answer: str, note: Callable[[str], None], command: Callable[[str], None]
) -> Step:
    """Return a step that enters *mode*.

    Args:
        seen: telemetry of the vehicle.
        mode: the mode.
        answer: key of the acknowledgement.
        note: notes that this program commands the mode, also where the step will be skipped.
        command: sends the command.
    """

    def send() -> None:
        note(mode)
        command(mode)

    if seen.mode == mode:
        note(mode)
    return Step(
        ask=f"change to {mode}",
        send=send,
        done=lambda seen: seen.mode == mode,
        within=ANSWERED_WITHIN,
        skippable=True,
        answer=answer,
        again=S,
        enters=mode,
    )


def ready_step(within: Ns, advice: str | Callable[[], str], keep: Repeat | None = None) -> Step:
    """Return a step that waits until the vehicle could arm and go to a position."""
    return Step(
        ask="be ready to arm and to go by position",
        send=send_nothing,
        done=lambda seen: seen.ready or seen.armed,
        within=within,
        skippable=True,
        keep=keep,
        advice=advice,
    )


def disarmed_step(ask: str, mode: str, within: Ns, leads_to: tuple[str, ...] = ()) -> Step:
    """Return a step that waits for the end of a landing in *mode*, when the motors stop."""
    return Step(
        ask=ask,
        send=send_nothing,
        done=lambda seen: not seen.armed,
        within=within,
        mode=mode,
        leads_to=leads_to,
    )


def check_throttle(telemetry: Telemetry, held: ManualControl | None, least: float = IDLE_THROTTLE) -> None:
    """Raise ``UsageError`` if a drone in the air would fall because the throttle is below *least*."""
    throttle = held.throttle if held is not None else 0.0
    if telemetry.flying and throttle < least:
        raise UsageError(
            f"{telemetry.name}: the throttle is at {throttle:g}: flown stabilized the motors would idle and "
            f"it would fall; manual_control() with a throttle about 0.5 first"
        )


# -- conditions of arrival


def heading_reached(degrees: float) -> Callable[[Telemetry], bool]:
    """Return a condition: the heading has stayed at *degrees* clockwise from north.

    A real multirotor swings up to 16 degrees past it. So the heading must have been within 3 degrees for as
    long as the reports of the position take that carry it, at least ``STEADY_FOR``.
    """
    since: Ns | None = None

    def turned(seen: Telemetry) -> bool:
        nonlocal since
        off = (seen.attitude.heading - degrees + 180.0) % 360.0 - 180.0
        if not abs(off) <= TURNED_DEG:
            since = None
            return False
        since = seen.last_message_ns if since is None else since
        return seen.last_message_ns - since >= STEADY_FOR

    return turned


def climbed_to(height: float) -> Callable[[Telemetry], bool]:
    """Return a condition: in the air at *height* metres above home, and no longer climbing."""

    def climbed(seen: Telemetry) -> bool:
        near = abs(seen.above_home - height) <= NEAR_UP_M
        return seen.flying and not seen.stale and near and abs(seen.velocity.up) <= AT_REST_M_S

    return climbed


def at_rest(seen: Telemetry) -> bool:
    """Return whether the vehicle hardly moves."""
    limit = AT_REST_M_S if seen.kind == DRONE_KIND else ROVER_AT_REST_M_S
    return hypot(seen.velocity.north, seen.velocity.east) <= limit and not abs(seen.velocity.up) > limit


def arrived_at(goal: Position, rover: bool) -> Callable[[Telemetry], bool]:
    """Return a condition: near *goal* and at rest."""
    near = ROVER_NEAR_M if rover else NEAR_M

    def arrived(seen: Telemetry) -> bool:
        here = seen.position
        if here is None or not seen.located or not at_rest(seen):
            return False
        return seen.distance(here, goal) <= near and (
            rover or _vertical_distance(seen, here, goal) <= NEAR_UP_M
        )

    return arrived


def _vertical_distance(seen: Telemetry, here: Position, goal: Position) -> float:
    """Return the vertical distance from the goal, m; 0 for altitudes that telemetry does not report."""
    if isnan(seen.above_home):
        return 0.0
    if isinstance(goal.altitude, AboveHome):
        return abs(seen.above_home - goal.altitude.metres)
    return abs(here.altitude.metres - goal.altitude.metres)


# -- takeover by another station


class Takeover:
    """Whether another station has control although the vehicle is in the offboard mode.

    The mode does not show it. The other station keeps control until it has selected another mode in between,
    or the vehicle is disarmed.

    Args:
        kernel: clock.
        telemetry: telemetry of the vehicle.
        mode: the offboard mode.
    """

    def __init__(self, kernel: Kernel, telemetry: Telemetry, mode: str) -> None:
        self._kernel = kernel
        self._telemetry = telemetry
        self._mode = mode
        self._check: Handle | None = None
        self.offboard_mode = mode
        """What a pilot must select to hand over: the mode, or during a takeover words that are no mode."""

    def begin(self) -> None:
        """Note that another station has control from now on."""
        if self._check is None:
            self.offboard_mode = f"another mode and then to {self._mode}"
            self._check = self._kernel.every(CHECK_PERIOD, self._end_if_over)

    def end(self) -> None:
        """Note that the takeover is over."""
        if self._check is not None:
            self.offboard_mode = self._mode
            self._check.cancel()
            self._check = None

    def _end_if_over(self) -> None:
        if self._telemetry.mode != self._mode or not self._telemetry.armed:
            self.end()


class TargetMonitor:
    """Detects that another station sends the vehicle elsewhere, for one target after it is ``set``.

    Where the autopilot's target is not reported, as over MAVROS, nothing is ever detected.
    """

    def __init__(self, telemetry: Telemetry, takeover: Takeover) -> None:
        self._telemetry = telemetry
        self._takeover = takeover
        self._goal: Position | None = None
        self._compared: tuple[Position, Position, bool] | None = None
        self._confirmed = False
        self._other_since: Ns | None = None

    def set(self, goal: Position) -> None:
        """Begin with a new target; targets reported earlier do not count."""
        self._goal = goal
        self._confirmed = False
        self._other_since = None
        self._telemetry.target = None

    def step(
        self,
        goal: Position,
        send: Action,
        mode: str,
        within: Ns,
        *,
        rover: bool = False,
        kernel: Kernel | None = None,
    ) -> Step:
        """Return a step that goes to *goal* in *mode*; *send* is repeated until the target is reported.

        With a *kernel* the step ends with ``Refused`` when the target is not taken up.
        """
        still_since: Ns | None = None

        def ignored() -> str:
            nonlocal still_since
            seen = self._telemetry
            if kernel is None or self.confirmed or self._goal is None:
                return ""
            now = kernel.now()
            if still_since is None or not at_rest(seen) or not seen.located:
                still_since = now
            if now - still_since < TAKEN_UP_WITHIN or arrived_at(goal, rover)(seen):
                return ""
            return (
                f"the autopilot does not take up the target: it stands still "
                f"{seen.distance(seen.position, goal):.0f} m from it; its own fence may exclude it"
            )

        def send_unless_confirmed() -> None:
            if self._goal is None or not self.confirmed:
                self.set(goal)
                send()

        return Step(
            ask=f"reach {goal}",
            send=send_unless_confirmed,
            done=arrived_at(goal, rover),
            within=within,
            again=S,
            mode=mode,
            armed=True,
            lost=self.lost,
            fails=ignored,
            failure=Refused,
        )

    def lost(self) -> str:
        """Return how another station, which then has control, has changed the target; empty otherwise."""
        target = self._telemetry.target
        if target is None or not self.confirmed or self._goal is None or self._reports(self._goal):
            self._other_since = None
            return ""
        if self._other_since is None:
            self._other_since = self._telemetry.last_message_ns
        if self._telemetry.last_message_ns - self._other_since < OTHER_TARGET_FOR:
            return ""
        self._takeover.begin()
        return f"was sent elsewhere by another, to {target}"

    @property
    def confirmed(self) -> bool:
        """Whether the autopilot has reported our target."""
        if not self._confirmed:
            self._confirmed = self._goal is not None and self._reports(self._goal)
        return self._confirmed

    def _reports(self, goal: Position) -> bool:
        """Return whether the reported target is *goal*; the answer holds until another one is reported."""
        target = self._telemetry.target
        if target is None:
            return False
        if self._compared is None or self._compared[0] is not target or self._compared[1] is not goal:
            self._compared = target, goal, self._same(target, goal)
        return self._compared[2]

    def _same(self, target: Position, goal: Position) -> bool:
        if self._telemetry.distance(target, goal) > SAME_TARGET_M:
            return False
        level = isinstance(goal.altitude, AMSL) and self._telemetry.kind == DRONE_KIND
        return not level or abs(target.altitude.metres - goal.altitude.metres) <= SAME_TARGET_M


class SetpointRepeater(ABC):
    """Repeats one set-point while the vehicle is in *mode*, and manual control while the mode is ours.

    Args:
        kernel: clock.
        telemetry: telemetry of the vehicle.
        mode: mode in which the vehicle follows set-points; in another one another station has control.
        velocity_period: period of set-points, ns.
        control_period: period of manual control, ns.
    """

    def __init__(
        self, kernel: Kernel, telemetry: Telemetry, mode: str, *, velocity_period: Ns, control_period: Ns
    ) -> None:
        self.held: ManualControl | None = None
        self.following = False
        """Whether a set-point is repeated."""
        self._kernel = kernel
        self._telemetry = telemetry
        self._mode = mode
        self._velocity_period, self._control_period = velocity_period, control_period
        self._velocity_handle: Handle | None = None
        self._control_handle: Handle | None = None

    # -- what differs between autopilots

    @abstractmethod
    def send_stop(self) -> None:
        """Send a velocity of zero once."""

    @abstractmethod
    def send_control(self, control: ManualControl) -> None:
        """Send manual control once."""

    def has_stopped(self) -> bool:
        """Return whether the end of a velocity need not be sent again: at once, where nothing is lost."""
        return True

    @abstractmethod
    def is_commanded(self, mode: str) -> bool:
        """Return whether this program commanded *mode*."""

    # -- velocity

    def follow(self, send: Action, lasting: Ns) -> None:
        """Repeat a set-point for *lasting*, then a velocity of zero until the vehicle ``has_stopped``.

        Args:
            send: sends the set-point once.
            lasting: duration, ns, of the vehicle where its clock runs faster or slower.
        """
        self.end_velocity()
        began = self._telemetry.moment()

        def repeat() -> None:
            if self._telemetry.mode != self._mode:
                self.end_velocity()
            elif self._telemetry.elapsed(began) < lasting:
                send()
            else:
                self.send_stop()
                if self.has_stopped():
                    self.end_velocity()

        self.following = True
        self._velocity_handle = self._kernel.every(self._velocity_period, repeat)

    def end_velocity(self) -> None:
        """Stop repeating a set-point."""
        if self._velocity_handle is not None:
            self._velocity_handle.cancel()
            self._velocity_handle = None
            self.following = False

    def braking_step(self) -> Step:
        """Return a step that sends a velocity of zero until the vehicle is at rest."""
        return Step(
            ask="stop",
            send=self.send_stop,
            done=at_rest,
            within=STOPPED_WITHIN,
            keep=Repeat(self._velocity_period, self.send_stop),
            mode=self._mode,
            armed=True,
        )

    # -- manual control

    def set_control(self, control: ManualControl | None) -> None:
        """Repeat *control*; ``None`` ends the repetition."""
        if control is None:
            self.release()
        else:
            self.hold(control)

    def hold(self, control: ManualControl) -> None:
        """Repeat *control*."""
        self.held = control
        if self._control_handle is None:
            self._control_handle = self._kernel.every(self._control_period, self._repeat_control)

    def hold_any(self) -> None:
        """Repeat neutral control if none was ever set: centred in the air, idle throttle on the ground."""
        if self.held is None:
            self.hold(ManualControl() if self._telemetry.flying else ManualControl(throttle=0.0))

    def release(self) -> None:
        """Stop repeating manual control."""
        if self._control_handle is not None:
            self._control_handle.cancel()
            self._control_handle = None
        self.held = None

    def _repeat_control(self) -> None:
        telemetry = self._telemetry
        if telemetry.flying and telemetry.mode != self._mode and not self.is_commanded(telemetry.mode):
            self.release()  # another station or a pilot flies it now
        elif self.held is not None:
            self.send_control(self.held)

    def end(self) -> None:
        """Stop all repetition."""
        self.end_velocity()
        self.release()
