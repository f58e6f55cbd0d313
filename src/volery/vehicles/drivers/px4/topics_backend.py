"""PX4 over its own ROS 2 topics: what a uXRCE-DDS agent, or a vehicle node with those names, puts on a graph.

Commands are acknowledged on ``vehicle_command_ack``, which 1.14 does not publish, so that the driver needs
1.15 or newer. Where the firmware publishes no home (1.15), it is where the vehicle is when it is armed, as in
the firmware. Neither parameters, missions and logs nor texts and events pass these topics.

The stream of OFFBOARD is repeated by the node's loop while a call waits, and by the caller after the call.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import degrees, isfinite, nan, radians
from typing import Any

from volery.base.errors import CapabilityError, UsageError
from volery.base.frames import quaternion_to_euler
from volery.base.position import AMSL, Position
from volery.base.time import US, Ns
from volery.kernel.api import Kernel
from volery.links.mavlink_messages import constant, entry_name
from volery.ros.graph import Node, Publisher
from volery.ros.messages import new
from volery.ros.messages.package_versions import NEWEST, use_version
from volery.ros.messages.px4_constants import topic_name, type_name
from volery.vehicles.address import check_options
from volery.vehicles.driver import AttitudeTarget, ManualControl
from volery.vehicles.drivers.mavlink.backend import (
    ATTITUDE_AND_YAW_RATE,
    FORCE,
    GROUND_SPEED,
    MEASURED_HEADING,
    UNCHANGED,
    Ack,
    AttitudeStream,
)
from volery.vehicles.drivers.mavlink.graph_backend import PERIOD, GraphBackend
from volery.vehicles.drivers.px4.backend import OffboardSetpoint
from volery.vehicles.drivers.px4.driver import PX4
from volery.vehicles.drivers.px4.modes import HOLD, MODES
from volery.vehicles.drivers.steps import ROVER_KIND
from volery.vehicles.services import PlanItem
from volery.vehicles.telemetry import Answer, Attitude, Battery, Velocity

UNACKNOWLEDGED = "1.14"
"""Version that does not publish acknowledgements."""
HOME_SINCE = (1, 16)

_ARMED = 2
_ACCEPTED, _IN_PROGRESS = 0, 5
_NO_SPEED, _CHANGE_MODE, _NO_PITCH = -1.0, 1.0, -1.0
_ABSENT = (nan, nan, nan)
_KEYS: Mapping[str, str] = {
    "MAV_CMD_COMPONENT_ARM_DISARM": Ack.ARM,
    "MAV_CMD_NAV_TAKEOFF": Ack.TAKEOFF,
    "MAV_CMD_DO_CHANGE_SPEED": Ack.SPEED,
    "MAV_CMD_DO_REPOSITION": Ack.TARGET,
    "MAV_CMD_DO_SET_MODE": Ack.MODE,
}
_KEY_OF = {constant(command): key for command, key in _KEYS.items()}
_NAME_OF_STATE = {mode.state: name for name, mode in MODES.items() if name != "AUTO.READY"}
"""Names of modes by ``nav_state``."""
_STICKS_OF_A_LINK = 2
"""``data_source`` of manual control."""


class PX4Topics(GraphBackend):
    """See ``PX4Backend``. The constructor joins the graph, which takes execution time of the calling task.

    Args:
        kernel: clock and tasks.
        node: the node that commands the vehicle.
        name: name of the vehicle.
        namespace: namespace of the names, such as ``/px4_1``; empty for the root.
        version: version of the firmware, which decides fields and names of topics.
    """

    def __init__(self, kernel: Kernel, node: Node, name: str, namespace: str, version: str) -> None:
        super().__init__(kernel, node, name, namespace)
        self._reports_home = tuple(map(int, version.split("."))) >= HOME_SINCE
        self._last_status: Ns = -1
        self._took_off = self._landed = False
        self._checks_passed = self._located = False
        self._attitudes = AttitudeStream(kernel, ATTITUDE_AND_YAW_RATE, MEASURED_HEADING)
        self.services = None
        received: dict[str, tuple[str, Callable[[Any], None]]] = {
            "vehicle_status": ("VehicleStatus", self._on_status),
            "vehicle_local_position": ("VehicleLocalPosition", self._on_local_position),
            "vehicle_global_position": ("VehicleGlobalPosition", self._on_global_position),
            "vehicle_attitude": ("VehicleAttitude", self._on_attitude),
            "vehicle_command_ack": ("VehicleCommandAck", self._on_acknowledgement),
            "battery_status": ("BatteryStatus", self._on_battery),
        }
        if self._reports_home:
            received["home_position"] = ("HomePosition", self._on_home)
            received["vehicle_land_detected"] = ("VehicleLandDetected", self._on_land_detected)
        for topic, (kind, handler) in received.items():
            self._subscribe(topic_name("out", topic, kind), type_name(kind), handler)
        self._commands = self._advertise("vehicle_command", "VehicleCommand")
        self._modes = self._advertise("offboard_control_mode", "OffboardControlMode")
        self._trajectories = self._advertise("trajectory_setpoint", "TrajectorySetpoint")
        self._attitude_setpoints = self._advertise("vehicle_attitude_setpoint", "VehicleAttitudeSetpoint")
        self._sticks = self._advertise("manual_control_input", "ManualControlSetpoint")
        self._rate = node.rate(PERIOD)

    def _advertise(self, topic: str, kind: str) -> Publisher:
        return self._node.advertise(self._name(topic_name("in", topic, kind)), type_name(kind))

    def _publish(self, publisher: Publisher, **fields: Any) -> None:
        publisher.publish(new(publisher.type, timestamp=self._node.now() // US, **fields))

    # -- what is received

    def _on_status(self, message: Any) -> None:
        seen = self.telemetry
        self._last_status = self._kernel.now()
        armed = message.arming_state == _ARMED
        if not self._reports_home and seen.position is not None and (armed > seen.armed or seen.home is None):
            seen.home = seen.position
        seen.autopilot = "PX4"
        seen.mode = _NAME_OF_STATE.get(message.nav_state, f"MODE {message.nav_state}")
        seen.armed = armed
        seen.status = "critical" if message.failsafe else ("active" if armed else "standby")
        seen.failsafe = bool(message.failsafe)
        seen.system = message.system_id
        self._took_off = message.takeoff_time > 0
        self._checks_passed = bool(message.pre_flight_checks_pass)
        self._note_message()

    def _on_land_detected(self, message: Any) -> None:
        self._landed = bool(message.landed)
        self._note_message()

    def _on_local_position(self, message: Any) -> None:
        self._located = bool(message.xy_valid and message.z_valid)
        self.telemetry.velocity = Velocity(message.vx, message.vy, -message.vz)
        self._note_message()

    def _on_global_position(self, message: Any) -> None:
        seen = self.telemetry
        seen.update_position(Position(message.lat, message.lon, AMSL(message.alt)))
        home = seen.home
        if home is not None:
            seen.above_home = message.alt - home.altitude.metres
        self._note_message()

    def _on_attitude(self, message: Any) -> None:
        w, x, y, z = map(float, message.q)
        roll, pitch, yaw = quaternion_to_euler((w, x, y, z))
        self.telemetry.attitude = Attitude(degrees(roll), degrees(pitch), degrees(yaw) % 360.0)

    def _on_home(self, message: Any) -> None:
        if message.valid_hpos and message.valid_alt:
            self.telemetry.home = Position(message.lat, message.lon, AMSL(message.alt))

    def _on_battery(self, message: Any) -> None:
        remaining = message.remaining if message.remaining >= 0.0 else nan
        amperes = message.current_a if message.current_a >= 0.0 else nan
        self.telemetry.battery = Battery(remaining, message.voltage_v, amperes)

    def _on_acknowledgement(self, message: Any) -> None:
        key = _KEY_OF.get(message.command)
        if key is not None and message.result != _IN_PROGRESS:
            result = entry_name("MAV_RESULT", message.result)
            accepted = message.result == _ACCEPTED
            self.telemetry.answers[key] = Answer(self._kernel.now(), accepted, result)
            self.telemetry.changed.notify()

    def _update(self) -> None:
        seen = self.telemetry
        if seen.kind == ROVER_KIND:
            seen.flying = seen.armed and seen.mode != HOLD
        else:
            seen.flying = seen.armed and (not self._landed if self._reports_home else self._took_off)
        seen.armable = self._checks_passed
        known = seen.position is not None and seen.home is not None and isfinite(seen.above_home)
        seen.ready = self._checks_passed and self._located and known

    def _silence(self) -> str:
        topic = self._name(topic_name("out", "vehicle_status", "VehicleStatus"))
        return f"nothing publishes {topic}: is the agent running, and is the firmware of the stated version?"

    @property
    def last_heartbeat_ns(self) -> Ns:
        """Time of the last state."""
        return self._last_status

    def request_attitude(self) -> None:
        """Wait for an attitude, which is received anyway."""
        self._wait_for_attitude()

    def request_arming_checks(self) -> None:
        """Do nothing: whether they pass is part of the state, why they fail is in events."""

    def lasting_reasons(self, since: Ns) -> Sequence[str]:
        """Return nothing: see ``request_arming_checks``."""
        return ()

    # -- what is sent

    def _command(self, command: str, *parameters: float) -> None:
        numbered = {f"param{number}": float(value) for number, value in enumerate(parameters, start=1)}
        system = self.telemetry.system
        addressed = {"target_system": system, "source_system": system, "from_external": True}
        self._publish(self._commands, command=constant(command), **numbered, **addressed)

    def set_mode(self, mode: str) -> None:
        """Send DO_SET_MODE."""
        number = MODES.get(mode)
        if number is None:
            raise UsageError(f"{self.telemetry.name} has no mode {mode!r}")
        custom = constant("MAV_MODE_FLAG_CUSTOM_MODE_ENABLED")
        self._command("MAV_CMD_DO_SET_MODE", custom, number.main, number.sub)

    def arm(self, arm: bool, *, force: bool = False) -> None:
        """Send COMPONENT_ARM_DISARM."""
        self._command("MAV_CMD_COMPONENT_ARM_DISARM", float(arm), FORCE if force else 0.0)

    def takeoff(self, amsl: float) -> None:
        """Send NAV_TAKEOFF."""
        self._command("MAV_CMD_NAV_TAKEOFF", _NO_PITCH, 0.0, 0.0, nan, nan, nan, amsl)

    def reposition(self, goal: Position, heading: float | None) -> None:
        """Send DO_REPOSITION."""
        turned = nan if heading is None else radians(heading)
        place = goal.latitude, goal.longitude, goal.altitude.metres
        self._command("MAV_CMD_DO_REPOSITION", _NO_SPEED, _CHANGE_MODE, 0.0, turned, *place)

    def set_speed(self, speed: float) -> None:
        """Send DO_CHANGE_SPEED."""
        self._command("MAV_CMD_DO_CHANGE_SPEED", GROUND_SPEED, speed, UNCHANGED)

    def send_setpoint(self, setpoint: OffboardSetpoint | AttitudeTarget) -> None:
        """Publish the mode of OFFBOARD and a set-point of it."""
        if isinstance(setpoint, AttitudeTarget):
            self.send_attitude(setpoint)
            return
        kind = "velocity" if setpoint.acceleration is None else "acceleration"
        self._publish(self._modes, **{kind: True})
        north, east, up = setpoint.velocity if setpoint.acceleration is None else setpoint.acceleration
        wanted = {"position": _ABSENT, "velocity": _ABSENT, "acceleration": _ABSENT, kind: (north, east, -up)}
        lists = {name: list(values) for name, values in wanted.items()}
        self._publish(self._trajectories, **lists, yaw=nan, yawspeed=radians(setpoint.yaw_rate))

    def send_attitude(self, target: AttitudeTarget) -> None:
        """Publish the mode of OFFBOARD and an attitude with its thrust."""
        fields = self._attitudes.fields(target, self.telemetry)
        self._publish(self._modes, attitude=True)
        self._publish(
            self._attitude_setpoints,
            q_d=list(fields["q"]),
            yaw_sp_move_rate=fields["body_yaw_rate"],
            thrust_body=[0.0, 0.0, -target.thrust],
        )

    def send_manual_control(self, control: ManualControl) -> None:
        """Publish the sticks."""
        axes = {name: getattr(control, name) for name in ("pitch", "roll", "yaw")}
        throttle = control.throttle if self.telemetry.kind == ROVER_KIND else 2.0 * control.throttle - 1.0
        self._publish(self._sticks, valid=True, data_source=_STICKS_OF_A_LINK, throttle=throttle, **axes)

    def upload(self, items: Sequence[PlanItem]) -> None:
        """Refuse: missions do not pass these topics."""
        raise CapabilityError(f"{self.telemetry.name}: missions do not pass PX4's topics; connect by MAVLink")

    def rewind_mission(self) -> None:
        """Refuse: see ``upload``."""
        self.upload(())


def open_topics(kernel: Kernel, node: Node, name: str, options: Mapping[str, str]) -> PX4:
    """Open a PX4 behind its own topics.

    Args:
        kernel: clock and tasks.
        node: the node that commands the vehicle.
        name: name of the vehicle.
        options: ``namespace`` of the topics, by default the root; ``version`` of the firmware, by default the
            newest.
    """
    check_options("px4", options, "namespace", "version")
    version = options.get("version", NEWEST["px4_msgs"])
    if version == UNACKNOWLEDGED:
        raise CapabilityError(
            f"{name}: PX4 {version} does not acknowledge commands on its topics; connect to it by MAVLink"
        )
    use_version("px4_msgs", version)
    return PX4(kernel, name, PX4Topics(kernel, node, name, options.get("namespace", ""), version))
