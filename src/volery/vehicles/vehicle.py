"""What drones and rovers share: readiness, missions, and how every operation is carried out.

Every call is an interaction point. An operation blocks until telemetry shows that it is done; it has a
time-out, and an error names the vehicle, the operation, the autopilot's own text and the remedy. One
operation runs at a time, only while no other station has control, within the bounds, and it is recorded.

| what ends an operation | the caller gets | the vehicle |
|---|---|---|
| limits or fence are violated | ``OutOfBounds`` | holds where it has stopped |
| an obstacle is nearer than the stated clearance | ``ObstacleNear`` | holds where it has stopped |
| it is far off its commanded path or place for 3 s | ``OffTrack`` | holds where it has stopped |
| set-points show no effect for 3 s | ``OffTrack`` | holds where it has stopped |
| the battery falls below the reserve | ``LowBattery`` | holds where it has stopped |
| what is left suffices for a landing only | ``CriticalBattery`` | is landed where it is |
| the thrust is at its limit and it does not climb | ``ThrustSaturated`` | is landed where it is |
| the position is lost for 10 s in the air | ``PositionLost`` | is commanded to hold |
| it falls or has turned over, as with a motor lost | ``ControlLost`` | is left to its autopilot |
| a pilot or another station changes mode or target | ``Overridden``, ``Failsafe`` | gets no more messages |
| another task of this program holds, returns, lands or kills | ``Overridden`` | does that |
| the link times out | ``LinkLost`` | does what its parameters state: ``on_link_loss`` |

A drone in the air is monitored between two calls as well; the next call then raises the error. A drone that
does not hold is landed: see ``Escalation``. Nothing is commanded if another station has control; on the
ground the vehicle is disarmed instead.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from math import isnan

from volery.base.errors import CapabilityError, PositionLost, Refused, UsageError, choices, did_you_mean
from volery.base.position import AMSL, AboveHome, Position
from volery.base.time import MS, Ns, S, from_seconds
from volery.kernel.api import Handle, Kernel
from volery.kernel.waiting import sleep
from volery.vehicles.driver import LINK_LOSS_ACTIONS, Capability, Driver, LinkLossAction, MissionItem
from volery.vehicles.escalation import Escalation
from volery.vehicles.executor import LINK_TIMEOUT, StepExecutor
from volery.vehicles.external_pose import ExternalPose
from volery.vehicles.limits import Fence, Limits, is_number
from volery.vehicles.onboard_files import OnboardFiles
from volery.vehicles.onboard_logs import OnboardLogs
from volery.vehicles.onboard_plan import OnboardPlan
from volery.vehicles.operations import FLY_MISSION, LAST_RESORT, TO_SAFETY, UNGUARDED, Operations, Truth
from volery.vehicles.parameters import Parameters
from volery.vehicles.payload import Payload
from volery.vehicles.pose_watch import PoseWatch
from volery.vehicles.rtcm import messages_of
from volery.vehicles.services import Services
from volery.vehicles.session import Session
from volery.vehicles.telemetry import Attitude, Battery, StatusText, Telemetry, Velocity, describe_state
from volery.vehicles.telemetry_feed import Quantity, TelemetryHistory, read_quantity, subscribe
from volery.vehicles.vehicle_bounds import VehicleBounds
from volery.vehicles.vehicle_connection import FIRST_MESSAGE_WITHIN_S, VehicleConnection

READY_WITHIN_S = 120.0
MISSION_WITHIN_S = 3600.0
REBOOT_WITHIN_S = 60.0
SILENT_WITHIN: Ns = 5 * S
"""Time for which the old firmware may still send after it has accepted a restart."""
KNOWN_WITHIN: Ns = 15 * S
DOWN_AFTER: Ns = 1500 * MS
"""Silence that shows the restart: heartbeats arrive each second."""


class Vehicle(Session, ABC):
    """A vehicle behind a driver. Use ``Drone`` or ``Rover``.

    Limits and fence are checked before anything is sent and at each position report while the vehicle
    travels. ``hold``, ``return_home``, ``land`` and ``kill`` are allowed outside the bounds and abort the
    operation of another task. A vehicle under the control of another station gets no messages; only ``kill``
    is always sent. ``escalation`` states the reactions to what a monitor has found; it may be replaced.

    Args:
        kernel: clock and tasks.
        name: name of the vehicle in messages and in the trace.
        driver: driver of its autopilot.
        limits: limits about home.
        fence: geofence, if any.
        truth: true position; known in simulation only.
        link_timeout: time without a message after which the link counts as lost, ns.
    """

    kind = ""

    def __init__(
        self,
        kernel: Kernel,
        name: str,
        driver: Driver,
        *,
        limits: Limits | None = None,
        fence: Fence | None = None,
        truth: Truth | None = None,
        link_timeout: Ns = LINK_TIMEOUT,
    ) -> None:
        super().__init__(self.disconnect)
        self.name = name
        self.kernel = kernel
        self._driver = driver
        self._telemetry = driver.telemetry
        self._executor = StepExecutor(kernel, driver, link_timeout)
        self._connection = VehicleConnection(kernel, name, self.kind, driver, self._executor)
        self._bounds = VehicleBounds(self._connection, driver.telemetry, limits or Limits(), fence)
        self._operations = Operations(kernel, name, driver, self._executor, self._bounds, truth)
        self._pose_watch = PoseWatch(driver.telemetry)
        self._mission: Sequence[MissionItem] = ()  # on board, if this program has uploaded it

    def __repr__(self) -> str:
        seen = self._telemetry
        if seen.last_message_ns < 0:
            return f"<{type(self).__name__} {self.name}: no message yet>"
        height = f", {seen.above_home:.1f} m above home" if seen.position is not None else ""
        left = "" if isnan(seen.battery.remaining) else f", battery {seen.battery.remaining:.0%}"
        return f"<{type(self).__name__} {self.name}: {describe_state(seen)}{height}{left}>"

    # -- what it must keep, and how it reacts

    @property
    def limits(self) -> Limits:
        """Limits about home; may be replaced."""
        return self._bounds.limits

    @limits.setter
    def limits(self, limits: Limits) -> None:
        self._bounds.limits = limits

    @property
    def fence(self) -> Fence | None:
        """Geofence; may be replaced."""
        return self._bounds.fence

    @fence.setter
    def fence(self, fence: Fence | None) -> None:
        self._bounds.fence = fence

    @property
    def escalation(self) -> Escalation:
        """Reactions to what a monitor has found; may be replaced."""
        return self._operations.escalation

    @escalation.setter
    def escalation(self, escalation: Escalation) -> None:
        self._operations.escalation = escalation

    # -- state, as last reported by the autopilot

    @property
    def position(self) -> Position:
        """Position (AMSL) estimated by the autopilot. Raises ``VehicleError`` before the first estimate."""
        return self._connection.known("its position", self._connection.poll().position)

    @property
    def home(self) -> Position:
        """Home position (AMSL), where it would return to. ArduPilot sets it anew each time it arms."""
        return self._connection.known("its home", self._connection.poll().home)

    @property
    def altitude(self) -> AboveHome:
        """Altitude above home. Raises ``VehicleError`` before the first estimate."""
        telemetry = self._connection.poll()
        self._connection.known("its altitude", telemetry.position)
        return AboveHome(telemetry.above_home)

    @property
    def velocity(self) -> Velocity:
        """Velocity over ground: north, east, up in m/s; NaN before the first estimate."""
        return self._connection.poll().velocity

    @property
    def attitude(self) -> Attitude:
        """Roll, pitch and heading in degrees; NaN for values that the autopilot does not send.

        Over MAVROS the first call subscribes to ``imu/data`` and waits for it.
        """
        self._connection.poll()
        self._driver.request_attitude()
        return self._connection.poll().attitude

    @property
    def battery(self) -> Battery:
        """Remaining share 0..1, volts, amperes; NaN for values that are not measured."""
        return self._connection.poll().battery

    @property
    def mode(self) -> str:
        """Flight mode by the autopilot's own name."""
        return self._connection.poll().mode

    @property
    def status(self) -> str:
        """System status in MAVLink's terms: standby, active, critical ..."""
        return self._connection.poll().status

    @property
    def armed(self) -> bool:
        """Whether the motors may turn."""
        return self._connection.poll().armed

    @property
    def ready(self) -> bool:
        """Whether the vehicle could arm now and go to a position."""
        return self._connection.poll().ready

    @property
    def stale(self) -> bool:
        """Whether the state below may be old: position, mode and all else are those before a silence.

        It is True from 2 s after the last message until 2 s after messages have returned, because a link that
        stalls delivers late what it has held back.
        """
        return self._connection.poll().stale

    @property
    def texts(self) -> list[StatusText]:
        """Last status texts of the autopilot, oldest first."""
        return list(self._connection.poll().texts)

    @property
    def telemetry(self) -> Telemetry:
        """All telemetry, for code that passes it on."""
        return self._connection.poll()

    @property
    def capabilities(self) -> frozenset[Capability]:
        """Operations that the vehicle supports; empty before the first message."""
        with self.kernel.interact():
            return self._driver.capabilities

    @property
    def on_link_loss(self) -> str:
        """Reaction to a lost link in one line, from the parameters; empty until these are known."""
        self._connection.poll()
        with self.kernel.interact():
            return self._driver.on_link_loss()

    # -- link

    def wait_connected(self, within: float = FIRST_MESSAGE_WITHIN_S) -> None:
        """Wait for the first message of the autopilot, *within* s. See ``VehicleConnection``."""
        self._connection.wait_connected(within)

    def wait_for_version(self) -> None:
        """Wait until the autopilot has stated its version, for 3 s at most: not all do."""
        self._connection.wait_for_version()

    def wait_located(self, within: float, tell: Callable[[str], object] | None = None) -> None:
        """Wait *within* s until the autopilot reports position and home. See ``VehicleConnection``."""
        self._connection.wait_located(within, tell)

    def disconnect(self) -> None:
        """Stop all communication. The vehicle goes on with its present operation."""
        with self.kernel.guard:
            self._operations.end()
            self._connection.close()

    # -- operations common to all vehicles

    def wait_ready(self, within: float = READY_WITHIN_S) -> None:
        """Wait until the vehicle could arm and go to a position; the error states what is missing.

        Args:
            within: longest time to wait, s.
        """
        self._connection.require()
        self._operations.run("wait_ready", "be ready", lambda: self._driver.ready(from_seconds(within)))
        self._bounds.home_bounds()

    def arm(self) -> None:
        """Arm in the present mode. ``Refused`` quotes the arming checks that failed."""
        self._connection.require()
        self._operations.run("arm", "arm", self._driver.arm)

    def disarm(self) -> None:
        """Disarm. In the air the autopilot refuses."""
        self._connection.require()
        self._operations.run("disarm", "disarm", lambda: self._driver.disarm(False), policy=UNGUARDED)

    def kill(self, *, sure: bool) -> None:
        """Stop the motors now; a vehicle in the air falls.

        It is sent even while another station has control. The operation of another task is aborted.

        Args:
            sure: must be True.
        """
        if sure is not True:
            raise UsageError(f"{self.name}: kill() stops the motors in the air; if that is meant: sure=True")
        self._connection.require()
        self._operations.run("kill", "stop the motors", lambda: self._driver.disarm(True), policy=LAST_RESORT)

    def hold(self) -> None:
        """Stop and hold the position, also outside the bounds.

        The operation of another task is aborted. Raises ``Overridden`` if another station has control.
        """
        self._connection.require(Capability.HOLD)
        self._operations.run("hold", "hold", self._driver.hold, policy=TO_SAFETY)

    def resume(self) -> None:
        """Take the vehicle back after a failsafe that an interrupted stream of this program has caused.

        The vehicle then holds its position. Raises ``Failsafe`` or ``Overridden`` for any other failsafe, or
        if another station has control.
        """
        self._connection.require(Capability.HOLD)
        self._operations.run("resume", "take the vehicle back", self._driver.hold, policy=TO_SAFETY)

    def upload_mission(self, mission: Sequence[MissionItem]) -> None:
        """Replace the mission on board. Each leg is checked against limits and fence as a straight path.

        Args:
            mission: its items, in the order in which they are flown.

        Raises:
            UsageError: it is empty.
            OutOfBounds: a leg leaves limits or fence.
        """
        self._connection.require(Capability.MISSION)
        items = list(mission)
        if not items:
            raise UsageError(f"{self.name}: an empty mission; give at least one item")
        self._bounds.check_mission(items)
        asked = f"upload a mission of {len(items)} items"
        self._operations.run("upload_mission", asked, lambda: self._driver.upload(items), policy=UNGUARDED)
        self._mission = tuple(items)

    def start_mission(self, within: float = MISSION_WITHIN_S) -> None:
        """Arm, start the mission on board and return when it has ended.

        A mission uploaded by this program is checked against limits and fence again. The floor of the fence
        is not checked on the way.

        Args:
            within: longest duration of the mission, s.
        """
        self._connection.require(Capability.MISSION)
        if self._mission and self._telemetry.position is not None:
            self._bounds.check_mission(self._mission)
        self._operations.run(
            "start_mission",
            "carry out the mission on board",
            lambda: self._driver.start_mission(from_seconds(within)),
            policy=FLY_MISSION,
        )

    @abstractmethod
    def come_to_rest(self) -> str:
        """Land or stop the vehicle unless another station has control; return what was done."""

    def take_over(self) -> None:
        """Take the present mode as commanded by this program: the station that commanded it is gone."""
        self._executor.set_commanded(self._telemetry.mode)

    def _services(self, what: str) -> Services:
        """Return the services; raise ``CapabilityError`` where there is no *what*."""
        self._connection.require()
        services = self._driver.services
        if services is None:
            raise CapabilityError(
                f"{self.name}: {what}: not with this driver; "
                "an ArduPilot or PX4 offers it, over MAVLink or MAVROS"
            )
        return services

    # -- nouns

    @property
    def parameters(self) -> Parameters:
        """Parameters of the autopilot: ``get``, ``set``, ``all``, ``load``, ``save``, ``compare``."""
        services = self._services("parameters")
        return Parameters(self.name, services, self._telemetry.system)

    @property
    def plan(self) -> OnboardPlan:
        """Mission, geofence and rally points on board: ``upload``, ``download``, ``clear``."""
        return OnboardPlan(self._telemetry, self._services("a plan on board"), self._bounds.check_leg)

    @property
    def logs(self) -> OnboardLogs:
        """Logs on board: ``list``, ``download``."""
        return OnboardLogs(self._telemetry, self._services("logs on board"))

    @property
    def files(self) -> OnboardFiles:
        """Files on board: ``list``, ``download``."""
        files = self._services("files on board").files
        if files is None:
            raise CapabilityError(
                f"{self.name}: files on board: not with this driver; "
                "an ArduPilot or PX4 offers them over MAVLink"
            )
        return OnboardFiles(self.name, files)

    @property
    def payload(self) -> Payload:
        """Gimbal, camera, servos and gripper."""
        return Payload(self.name, self._services("a payload"))

    # -- single requests

    def set_link_loss_action(self, action: LinkLossAction) -> dict[str, tuple[float, float]]:
        """Let the autopilot return, land or hover by itself when it hears nothing of this program any more.

        Its parameters are set, and read back; they stay so until they are set again.

        Args:
            action: ``return``, ``land`` or ``hover``.

        Returns:
            The parameters that were changed, with their values before and now.

        Raises:
            UsageError: there is no such action.
            CapabilityError: this autopilot cannot be asked for it, or does not listen to this program.
            Refused: the autopilot keeps another value.
        """
        if action not in LINK_LOSS_ACTIONS:
            hint = did_you_mean(action, LINK_LOSS_ACTIONS)
            raise UsageError(f"no action {action!r}{hint}; there is {choices(LINK_LOSS_ACTIONS)}")
        self._connection.require()
        self._driver.link_loss_settings(action)  # refuses at once what it cannot
        # what was requested at the connection is known first: names depend on the version, and a late answer
        # would be taken for one to a request of here
        self._executor.wait(lambda: bool(self._driver.on_link_loss()), KNOWN_WITHIN)
        changed: dict[str, tuple[float, float]] = {}
        for name, change in self._driver.link_loss_settings(action).items():
            before = self.parameters.get(name)
            now = change(before)
            if now != before:
                self.parameters.set(name, now)
                changed[name] = (before, now)
        return changed

    def reboot(self, within: float = REBOOT_WITHIN_S) -> None:
        """Restart the autopilot and return when it sends again. ``Refused`` while it is armed.

        Args:
            within: longest time to wait for it, s.
        """
        services = self._services("a restart")
        seen = self._telemetry
        if seen.armed:
            raise Refused(self.name, "restart", "it is armed; land and disarm first")
        services.command("restart", "MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN", 1)
        accepted = self.kernel.now()
        with self.kernel.guard:
            seen.forget()
        with self.kernel.joined():
            while self.kernel.now() - max(seen.last_message_ns, accepted) < DOWN_AFTER:
                if self.kernel.now() - accepted > SILENT_WITHIN:
                    return  # it restarts faster than its heartbeats show
                self._driver.poll()
                sleep(self.kernel, 100 * MS)
            silent = seen.last_message_ns
            back = self._executor.wait(lambda: seen.last_message_ns > silent, from_seconds(within))
        if not back:
            raise Refused(self.name, "restart", f"it has not sent anything for {within:g} s since")

    def send_corrections(self, data: bytes) -> None:
        """Pass RTCM corrections of an RTK base or an NTRIP caster to the GPS receiver. It never waits.

        Args:
            data: one or more whole RTCM 3 messages, as they arrive.

        Raises:
            UsageError: this is no RTCM 3, or a message is longer than a receiver takes.
        """
        services = self._services("RTK corrections")
        for message in messages_of(data):
            services.send_corrections(message)

    def send_landing_target(self, forward: float, right: float, down: float) -> None:
        """Send where the autopilot is to land (MAVLink's LANDING_TARGET), for each picture of a landing.

        An ArduPilot with PLND_ENABLED 1 and PLND_TYPE 1 lands on it in ``land`` and ``return_home``, which
        another task calls meanwhile; from 2 s without a target on it descends where it is. Others take none.
        The first call reads the two parameters and waits for them.

        Args:
            forward: distance of the target along the body's forward axis, m; the axes tilt with the body.
            right: distance along its right axis, m.
            down: distance along its down axis, m, above 0.

        Raises:
            UsageError: a value is not a number, or the target is not below.
            CapabilityError: the autopilot takes no landing target.
            Refused: its parameters have it ignored.
        """
        call = f"send_landing_target({forward!r}, {right!r}, {down!r})"
        self._check_numbers(call, forward, right, down, example="send_landing_target(0.4, -0.2, 5.0)")
        if down <= 0.0:
            raise UsageError(f"{self.name}: {call}: the target is not below; give metres downwards, above 0")
        self._services("a landing target").send_landing_target((forward, right, down))

    # -- flight without satellites

    def send_external_pose(self, pose: ExternalPose) -> None:
        """Tell the autopilot where the vehicle is, as by scan matching or motion capture. It never waits.

        The autopilot fuses it if its parameters say so (ArduPilot: VISO_TYPE, EK3_SRC1_POSXY; PX4:
        EKF2_EV_CTRL), weighs it by its covariance, and says when it misses it. Send it 10 to 30 times a
        second, and nothing while the place is not known.

        Args:
            pose: about the origin of the estimator: ``set_origin`` sets it where there are no satellites.

        Raises:
            UsageError: a value is missing, is not a number or has another unit.
            CapabilityError: this autopilot takes none.
            PositionLost: in flight the poses do not move as the vehicle's own velocity says: they have
                frozen, jumped without ``resets``, or run away. This one is not sent; without poses the
                autopilot does what it does when it has lost its position.
        """
        services = self._services("an external position estimate")
        if not isinstance(pose, ExternalPose):
            raise UsageError(f"{self.name}: send_external_pose({pose!r}): give an ExternalPose(...)")
        pose.check(self.name)
        problem = self._pose_watch.problem(pose, self.kernel.now())
        if problem:
            raise PositionLost(self.name, "external poses", f"{problem}; they are not sent")
        services.send_external_pose(pose)
        self._telemetry.external_pose_ns = self.kernel.now()

    def set_origin(self, place: Position) -> None:
        """Set the origin of the estimator's local frame, and return when the autopilot states it.

        With it a vehicle without satellites has positions in degrees, and home. It need not be the true
        place. An origin that satellites have set stays.

        Args:
            place: the origin, with an altitude AMSL: that of the ground where the autopilot was started.

        Raises:
            NotArrived: the autopilot states no origin, or another one.
        """
        services = self._services("set the origin of its estimator")
        if not isinstance(place, Position) or not isinstance(place.altitude, AMSL):
            raise UsageError(f"{self.name}: set_origin({place}): give a Position with an altitude AMSL(...)")
        services.set_origin(place)

    # -- telemetry in time

    def subscribe(
        self, quantity: Quantity, callback: Callable[[object], object], period: float = 0.1
    ) -> Handle:
        """Call *callback* with a quantity each time it has changed, until the handle is cancelled.

        The callback runs beside the program and must not block: it sets a flag or appends to a list; it does
        not command the vehicle.

        Args:
            quantity: ``position``, ``altitude``, ``velocity``, ``attitude``, ``battery``, ``mode``,
                ``armed``, ``home``, ``satellites``, ``fix`` or ``text``.
            callback: takes the new value.
            period: shortest time between two calls, s.
        """
        self._connection.require()
        if quantity == "attitude":
            self._driver.request_attitude()
        return subscribe(self.kernel, self._telemetry, quantity, callback, _period(period))

    def record_telemetry(
        self, *quantities: Quantity, period: float = 0.1, keep: float = 600.0
    ) -> TelemetryHistory:
        """Keep quantities over time from now on, and return the growing history.

        Args:
            quantities: as in ``subscribe``; ``text`` is not recorded.
            period: time between two samples, s.
            keep: age up to which samples are kept, s.
        """
        self._connection.require()
        telemetry = self._telemetry
        if not quantities:
            raise UsageError(f"{self.name}: record_telemetry(): state a quantity, such as 'position'")
        for quantity in quantities:
            read_quantity(telemetry, quantity)
            if quantity == "attitude":
                self._driver.request_attitude()
        return TelemetryHistory(self.kernel, telemetry, quantities, _period(period), _period(keep))

    # -- arguments: programs and consoles have no type checker

    def _check_numbers(self, call: str, *numbers: object, example: str) -> None:
        """Raise ``UsageError`` unless all are finite numbers.

        Args:
            call: the call as it was written.
            numbers: the arguments that are numbers.
            example: a valid call.
        """
        for number in numbers:
            if not is_number(number):
                raise UsageError(
                    f"{self.name}: {call}: {number!r} is not a finite number; write it as in {example}"
                )

    def _check_speed(self, asked: str, speed: float) -> None:
        self._connection.require(Capability.SPEED)
        self._check_numbers(f"{asked}: speed={speed!r}", speed, example="speed=5.0, in m/s")
        if speed <= 0:
            raise UsageError(f"{self.name}: {asked}: a speed of {speed:g} m/s; give one above 0")


def _period(seconds: float) -> Ns:
    if not seconds > 0:
        raise UsageError(f"{seconds!r} s; give seconds above 0")
    return from_seconds(seconds)
