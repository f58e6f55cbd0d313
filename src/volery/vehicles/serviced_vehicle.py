"""What a vehicle offers beside flying: parameters, plan, logs, payload, corrections, telemetry in time.

``Vehicle`` extends it by the operations that move. None of this needs control of the vehicle, and it may
go on beside an operation of another task.
"""

from __future__ import annotations

from collections.abc import Callable

from volery.base.errors import (
    CapabilityError,
    PositionLost,
    Refused,
    UsageError,
    choices,
    did_you_mean,
)
from volery.base.position import AMSL, Position
from volery.base.time import MS, Ns, S, from_seconds
from volery.kernel.api import Handle
from volery.kernel.waiting import sleep
from volery.vehicles.bounded_vehicle import BoundedVehicle
from volery.vehicles.driver import LINK_LOSS_ACTIONS, LinkLossAction
from volery.vehicles.external_pose import ExternalPose
from volery.vehicles.onboard_files import OnboardFiles
from volery.vehicles.onboard_logs import OnboardLogs
from volery.vehicles.onboard_plan import OnboardPlan
from volery.vehicles.parameters import Parameters
from volery.vehicles.payload import Payload
from volery.vehicles.pose_watch import PoseWatch
from volery.vehicles.rtcm import messages_of
from volery.vehicles.services import Services
from volery.vehicles.telemetry_feed import Quantity, TelemetryHistory, read_quantity, subscribe

REBOOT_WITHIN_S = 60.0
SILENT_WITHIN: Ns = 5 * S
"""Time for which the old firmware may still send after it has accepted a restart."""
KNOWN_WITHIN: Ns = 15 * S
DOWN_AFTER: Ns = 1500 * MS
"""Silence that shows the restart: heartbeats arrive each second."""


class ServicedVehicle(BoundedVehicle):
    """State over time and services of a vehicle; see ``Vehicle``."""

    _pose_watch: PoseWatch | None = None

    def _services(self, what: str) -> Services:
        """Return the services; raise ``CapabilityError`` where there is no *what*."""
        self._connect()
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
        return Parameters(self.name, services, self._driver.telemetry.system)

    @property
    def plan(self) -> OnboardPlan:
        """Mission, geofence and rally points on board: ``upload``, ``download``, ``clear``."""
        return OnboardPlan(self._driver.telemetry, self._services("a plan on board"), self._check_leg)

    @property
    def logs(self) -> OnboardLogs:
        """Logs on board: ``list``, ``download``."""
        return OnboardLogs(self._driver.telemetry, self._services("logs on board"))

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
        self._connect()
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
        seen = self._driver.telemetry
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
        if self._pose_watch is None:
            self._pose_watch = PoseWatch(self._driver.telemetry)
        problem = self._pose_watch.problem(pose, self.kernel.now())
        if problem:
            raise PositionLost(self.name, "external poses", f"{problem}; they are not sent")
        services.send_external_pose(pose)
        self._driver.telemetry.external_pose_ns = self.kernel.now()

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
        self._connect()
        if quantity == "attitude":
            self._driver.request_attitude()
        return subscribe(self.kernel, self._driver.telemetry, quantity, callback, _period(period))

    def record_telemetry(
        self, *quantities: Quantity, period: float = 0.1, keep: float = 600.0
    ) -> TelemetryHistory:
        """Keep quantities over time from now on, and return the growing history.

        Args:
            quantities: as in ``subscribe``; ``text`` is not recorded.
            period: time between two samples, s.
            keep: age up to which samples are kept, s.
        """
        self._connect()
        telemetry = self._driver.telemetry
        if not quantities:
            raise UsageError(f"{self.name}: record_telemetry(): state a quantity, such as 'position'")
        for quantity in quantities:
            read_quantity(telemetry, quantity)
            if quantity == "attitude":
                self._driver.request_attitude()
        return TelemetryHistory(self.kernel, telemetry, quantities, _period(period), _period(keep))


def _period(seconds: float) -> Ns:
    if not seconds > 0:
        raise UsageError(f"{seconds!r} s; give seconds above 0")
    return from_seconds(seconds)
