"""Driver of DJI aircraft: the steps of each operation.

Tasks (take-off, landing, going home) need no control authority, everything else does. A take-off climbs to a
fixed height of its own, the rest is climbed by set-points. A position is a stream of remaining offsets. The
pilot can take the authority at any time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite, radians

from volery.base.errors import CapabilityError, Refused
from volery.base.frames import LocalFrame, heading_to_yaw
from volery.base.position import Position
from volery.base.time import Ns, to_seconds
from volery.kernel.api import Action, Kernel
from volery.ros.messages.dji_constants import GUIDES, HEADERS, HEALTHY_GPS, DisplayMode, DocumentedBehaviour
from volery.vehicles.driver import (
    AttitudeTarget,
    Capability,
    LinkLossAction,
    ManualControl,
    SetpointDriver,
    Settings,
    Step,
)
from volery.vehicles.drivers.dji.backend import QUIET, DjiBackend
from volery.vehicles.drivers.dji.decoder import MOST_VOLTS, SETTLED, STALE, TAKEN_OVER_FOR
from volery.vehicles.drivers.dji.missions import MissionRunner, above_home, check_amsl
from volery.vehicles.drivers.dji.sequences import LANDING_MODES, SDK, STARTS, WAITS, DjiSteps, DjiTasks
from volery.vehicles.drivers.dji.services import DjiServices
from volery.vehicles.drivers.dji.setpoints import (
    BRAKES_M_S2,
    DOWN_M_S,
    OBEYED_WITHIN,
    STILL,
    UP_M_S,
    Moving,
    SdkManual,
    SdkPoint,
    Tilted,
    yaw_of,
)
from volery.vehicles.drivers.steps import (
    ANSWERED_WITHIN,
    STOPPED_WITHIN,
    TURNED_WITHIN,
    arrived_at,
    at_rest,
    check_throttle,
    heading_reached,
    immediate_step,
)
from volery.vehicles.telemetry import Telemetry, Velocity

LOW_THROTTLE = 0.3
"""Throttle below which an aircraft flown by thrust would fall."""

CAPABILITIES = frozenset(Capability) - {Capability.TERRAIN, Capability.ACCELERATION}
_NONE: frozenset[Capability] = frozenset()


class Dji(SetpointDriver):
    """Driver of a DJI aircraft. See ``vehicles.driver.Driver`` for the operations."""

    landing_modes = LANDING_MODES
    cycle: Action | None = None

    def __init__(self, kernel: Kernel, name: str, backend: DjiBackend) -> None:
        self.name = name
        self.telemetry = backend.telemetry
        self._kernel = kernel
        self._backend = backend
        self._stream = backend.stream
        self.services = DjiServices(kernel, backend)
        self._steps = steps = DjiSteps(name, backend)
        self.problem, self.close, self.stop = backend.problem, backend.close, backend.stream.stop
        tasks = DjiTasks(steps)
        self.ready, self.arm, self.disarm = steps.ready, tasks.arm, tasks.disarm
        self.takeoff, self.return_home, self.land = tasks.takeoff, tasks.return_home, tasks.land
        mission = MissionRunner(steps, tasks)
        self.upload, self.start_mission = mission.upload, mission.start

    @property
    def offboard_mode(self) -> str:
        """Mode in which it hovers and accepts commands: P_GPS, or ATTITUDE without a position.

        In ``NAVI_SDK_CTRL``, which no pilot can select, it already obeys another node of ours.
        """
        seen = self.telemetry
        if seen.mode == SDK:
            return SDK
        return DisplayMode.ATTITUDE.name if seen.mode == DisplayMode.ATTITUDE.name else WAITS

    @property
    def capabilities(self) -> frozenset[Capability]:
        """All capabilities but terrain and acceleration; none before the first message."""
        return CAPABILITIES if self.telemetry.kind else _NONE

    def poll(self) -> None:
        """Do nothing: messages are processed as they arrive."""

    def request_attitude(self) -> None:
        """Do nothing: the attitude arrives without a request."""

    def request_obstacles(self) -> None:
        """Do nothing: the SDK nodes publish no distances of obstacles."""

    def on_link_loss(self) -> str:
        """Return the assumed reaction: neither public definitions nor parameters state it."""
        return (
            "it brakes and hovers where it is (assumed: within 0.5 s), until its battery is low, the pilot "
            "takes it or its transmitter is lost; landing, going home and missions go on"
        )

    def link_loss_settings(self, action: LinkLossAction) -> Settings:
        """Return nothing for ``hover``, which it does by itself; raise for the others."""
        if action != "hover":
            raise CapabilityError(
                f"{self.name}: the nodes of DJI's SDK cannot make it {action} when this program is killed: "
                "it brakes and hovers; what follows a lost transmitter is set in DJI's own application"
            )
        return {}

    # -- operations by set-points

    def goto(self, goal: Position, speed: float | None, within: Ns) -> Sequence[Step]:
        """Stream remaining offsets; the height counts from the place of take-off."""
        home = self.telemetry.home
        if home is None:
            raise Refused(self.name, f"go to {goal}", "the place of take-off is unknown")
        check_amsl(goal, f"go to {goal}", self.telemetry)
        height = above_home(goal, home)
        self._steps.check_height(height, f"go to {goal}")

        frame = LocalFrame(goal.latitude, goal.longitude)

        def there() -> SdkPoint:
            return SdkPoint(frame, height, yaw_of(self.telemetry), speed)

        return self._steps.to_point(f"reach {goal}", there, arrived_at(goal, False), within)

    def hold(self) -> Sequence[Step]:
        """Stream zero velocity until at rest; then it hovers by itself. It needs a position."""
        flew = self.telemetry.flying
        leave = self._steps.leave_descent("hold")
        if flew and not self.telemetry.ready:
            self._stream.stop()
            raise Refused(self.name, "hold", f"it has no position ({self.telemetry.fix}) and drifts; land()")

        def stands(seen: Telemetry) -> bool:
            holds = seen.flying == flew and seen.mode not in LANDING_MODES
            return holds and at_rest(seen) and not self._stream.fresh

        brake = Step(
            ask="stop",
            send=lambda: self._stream_velocity(STILL, 0.0, STOPPED_WITHIN),
            done=stands,
            within=STOPPED_WITHIN,
            enters=SDK,
            leads_to=(WAITS,),
            armed=True,
        )
        return (*leave, self._steps.authority(), brake, self._steps.hover())

    def velocity(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> Sequence[Step]:
        """Stream a velocity for *lasting*, then stop."""
        follow = immediate_step(
            "fly on", lambda: self._stream_velocity(velocity, yaw_rate, lasting), enters=SDK
        )
        return (*self._steps.leave_descent("fly at a velocity"), self._steps.authority(), follow)

    def _stream_velocity(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> None:
        self._steps.follow(Moving(velocity, -radians(yaw_rate), self._kernel.now() + lasting))

    def attitude(self, target: AttitudeTarget, lasting: Ns) -> Sequence[Step]:
        """Stream tilt, climb rate and turn rate for *lasting*, then stop."""
        until = self._kernel.now() + lasting
        follow = immediate_step("fly on", lambda: self._steps.follow(Tilted(target, until)), enters=SDK)
        return (*self._steps.leave_descent("follow an attitude"), self._steps.authority(), follow)

    def heading(self, degrees: float) -> Sequence[Step]:
        """Turn in place."""
        if self.telemetry.flying and not isfinite(self.telemetry.above_home):
            raise Refused(self.name, f"turn to {degrees:g} degrees", "its height above home is unknown")

        def turn() -> SdkPoint | None:
            here = self._steps.over_here(self.telemetry.above_home)
            return here._replace(yaw=heading_to_yaw(radians(degrees))) if here is not None else None

        return self._steps.to_point(
            f"turn to {degrees:g} degrees", turn, heading_reached(degrees), TURNED_WITHIN
        )

    # -- manual flight

    def stabilize(self) -> Sequence[Step]:
        """Enter manual flight by tilt, yaw rate and thrust."""
        check_throttle(self.telemetry, self._stream.held or ManualControl(), LOW_THROTTLE)
        return self._enter_manual("fly stabilized", SdkManual(keeps_height=False))

    def hand_over(self) -> Sequence[Step]:
        """Stop sending; the switch of the transmitter chooses the mode."""
        return (immediate_step("stop sending", self.stop),)

    def altitude_hold(self) -> Sequence[Step]:
        """Enter manual flight by tilt, yaw rate and climb rate."""
        return self._enter_manual("hold the altitude", SdkManual(keeps_height=True))

    def _enter_manual(self, ask: str, target: SdkManual) -> Sequence[Step]:
        def send() -> None:
            if self._stream.held is None:
                self._stream.held = ManualControl() if self.telemetry.flying else ManualControl(throttle=0.0)
            self._steps.follow(target)

        step = Step(
            ask=ask,
            send=send,
            done=lambda seen: not seen.armed or seen.mode == SDK,
            within=ANSWERED_WITHIN,
            enters=SDK,
            leads_to=STARTS,
        )
        return (self._steps.activated(), *self._steps.leave_descent(ask), self._steps.authority(), step)

    def manual_control(self, control: ManualControl | None) -> None:
        """Send *control* while it is flown manually; ``None`` ends that."""
        if control is None:
            if self._stream.is_manual:
                self._stream.stop()
            self._stream.held = None
            return
        self._stream.held = control
        if self._stream.is_manual:
            self._stream.fresh = True
            self._backend.wake()


ASSUMED: Mapping[str, str] = {
    "home": "is where the motors started",
    "`battery_state`": f"a voltage above {MOST_VOLTS:g} is in millivolts; the current is negative when drawn",
    "the mode switch": "its return to where the authority was given hands the aircraft back",
    "set-points": f"without effect for {to_seconds(OBEYED_WITHIN):g} s mean that another program has the "
    f"authority, for {to_seconds(TAKEN_OVER_FOR):g} s at least",
    "a position": f"older than {to_seconds(STALE):g} s counts for nothing: no offset is sent",
    "a set-point on its way": f"has come after {to_seconds(QUIET):g} s",
    "a stated speed": f"is flown as a velocity until it has to brake with {BRAKES_M_S2:g} m/s² for its goal, "
    f"with at most {UP_M_S:g} m/s up and {DOWN_M_S:g} m/s down",
    "a mode after a way down": f"counts once it has shown for {to_seconds(SETTLED):g} s: the news that the "
    "motors stand may come later",
    "silence of the program": "makes it brake and hover; landing, going home and missions go on",
}
"""What the driver assumes, by subject."""

DOCUMENTED: Mapping[str, DocumentedBehaviour] = {
    "altitudes": DocumentedBehaviour(
        "those of `gps_position` are by pressure: only their difference to where the motors started counts; "
        "AMSL takes the option `home_altitude`",
        f"{HEADERS}; support and users (Onboard-SDK #160, #258; ROS #127)",
    ),
    "`height_above_takeoff`": DocumentedBehaviour(
        "is another quantity on most aircraft, and not used", f"{HEADERS}; users (Onboard-SDK #160, #218)"
    ),
    "`gps_health`": DocumentedBehaviour(
        f"from {HEALTHY_GPS} on the place counts; below, it freezes while messages go on",
        f"{HEADERS}; nodes 3.8 and 4.1",
    ),
    "`rc`": DocumentedBehaviour("any move of the mode switch takes the authority", GUIDES),
    "set-points in flight": DocumentedBehaviour(
        "horizontal offsets that remain, absolute heights above take-off, 50 Hz; zero velocity brakes and "
        "holds",
        f"{GUIDES}; support (ROS #34; Onboard-SDK #760)",
    ),
    "task 4": DocumentedBehaviour(
        "works only while the motors stand: `takeoff()` stops them first", "support (ROS #15)"
    ),
    "task 6 (land) and task 1 (go home)": DocumentedBehaviour(
        "stop the motors at the end by themselves; near home going home lands on the spot, up to 20 m away",
        f"{GUIDES}; support (ROS #199, #469)",
    ),
    "leaving a landing or a way home": DocumentedBehaviour(
        "impossible with `dji_sdk` 3.8; with `dji_osdk_ros` 4.1 except a landing that was asked for",
        "support (ROS #44); nodes 3.8 and 4.1",
    ),
    "motors in the air": DocumentedBehaviour(
        "stop by the kill switch of 4.1 only", f"{GUIDES}; nodes 3.8 and 4.1"
    ),
    "a failed call": DocumentedBehaviour("is a refusal by the node of 4.1", "node 4.1"),
    "`ack_data`": DocumentedBehaviour("the codes of an answer are named in the error", HEADERS),
    "`rc_connection_status`": DocumentedBehaviour(
        "after 3 s without a transmitter it goes home, or hovers if set so in Assistant 2", GUIDES
    ),
}
"""What the driver relies on that has a source, by subject."""
