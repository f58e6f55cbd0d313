"""What a PX4 takes by its uXRCE-DDS client: topics below ``fmu/in`` and the service ``fmu/vehicle_command``.

The firmware's rules of OFFBOARD: the stream of ``offboard_control_mode`` keeps the mode alive and says which
set-points count: ``trajectory_setpoint`` for position, velocity and acceleration, topics of their own for
attitude and body rates. A set-point is in force until the next one; before the first the vehicle keeps its
place.

Over MAVLink a set-point is both: it is sent when an ``offboard_control_mode`` arrives, and when it arrives
itself while the last of these is not older than ``KEPT_ALIVE``. So the mode is lost COM_OF_LOSS_T after the
last ``offboard_control_mode``, or up to ``KEPT_ALIVE`` later where set-points go on without it.

Differences from the firmware: limits of speed in ``goto_setpoint`` are not applied. Thrusts, torques, motors,
servos and motion capture are refused by name, because no message of MAVLink carries them to the firmware
or nothing is simulated that takes them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from math import isfinite, nan
from typing import Any

from volery.base.errors import UsageError
from volery.base.time import MS, US, Ns, S
from volery.bridge.commands import CommandServices
from volery.bridge.node_interface import Fields, InterfaceContext, OutgoingMessage, Service, SubscribedTopic
from volery.bridge.px4_telemetry import ControlMode, PX4Telemetry, make
from volery.links.mavlink_messages import constant
from volery.ros.messages import service
from volery.ros.messages.px4_constants import MODES, NavState, topic_name, type_name

KEPT_ALIVE: Ns = 500 * MS
"""The firmware wants ``offboard_control_mode`` at 2 Hz at least."""

_LOCAL_NED, _GLOBAL_INT = constant("MAV_FRAME_LOCAL_NED"), constant("MAV_FRAME_GLOBAL_INT")
_NO_YAW, _NO_YAW_RATE = 1 << 10, 1 << 11
_RATES_IGNORED, _ROLL_AND_PITCH_RATE_IGNORED, _ATTITUDE_IGNORED = 0b111, 0b011, 1 << 7
"""Bits of the ``type_mask`` of set-points: a bit that is set means ignore that field."""
_STAY: Fields = {"position": (nan, nan, nan), "velocity": (0.0, 0.0, 0.0)}

_WITH_PLACE = frozenset({16, 17, 18, 19, 21, 22, 34, 84, 85, 179, 192, 195, 201})
"""Commands (MAV_CMD) with latitude and longitude as parameters 5 and 6: a COMMAND_INT keeps their digits."""
_DO_SET_MODE, _CUSTOM_MODE_ENABLED = 176, 1
_SET_NAV_STATE = 100_001
_LARGEST_COMMAND = 65_535
_UNSUPPORTED, _FAILED = 3, 4

_ODOMETRY_FRAMES = {1: _LOCAL_NED, 2: constant("MAV_FRAME_LOCAL_FRD"), 3: constant("MAV_FRAME_BODY_FRD")}
"""MAV_FRAME of ``pose_frame`` and ``velocity_frame``."""
_POSE_FRAMES = (_LOCAL_NED, constant("MAV_FRAME_LOCAL_FRD"))

_TRAJECTORY = ("position", "velocity", "acceleration")
_DIRECT = ("thrust_and_torque", "direct_actuator", "actuator")
REFUSED: Mapping[str, tuple[str, str]] = {
    "vehicle_thrust_setpoint": ("VehicleThrustSetpoint", "thrusts are"),
    "vehicle_torque_setpoint": ("VehicleTorqueSetpoint", "torques are"),
    "actuator_motors": ("ActuatorMotors", "outputs of motors are"),
    "actuator_servos": ("ActuatorServos", "outputs of servos are"),
    "vehicle_mocap_odometry": ("VehicleOdometry", "positions of motion capture are"),
}
"""Topics whose messages have no effect: their types, and what a warning says of them."""


FIRST_HEARTBEAT: Ns = 5 * S
"""Longest time that a request of the service waits for an autopilot."""


class PX4Commands:
    """Translates the topics below ``fmu/in``.

    Args:
        context: What the parts of an interface work with.
        offboard: What is commanded in OFFBOARD, which this writes.
        telemetry: Publishes the acknowledgements of commands.
        services: Sends commands that are answered.
    """

    def __init__(
        self,
        context: InterfaceContext,
        offboard: ControlMode,
        telemetry: PX4Telemetry,
        services: CommandServices,
    ) -> None:
        self._link, self._warn, self._epoch = context.link, context.warn, context.epoch
        self._offboard, self._telemetry, self._services = offboard, telemetry, services
        self._setpoints: dict[str, OutgoingMessage] = {}
        """Last set-point by its kind: trajectory, attitude, body_rate."""
        self._warned: set[str] = set()

    def subscriptions(self) -> tuple[SubscribedTopic, ...]:
        """Return the topics."""
        taken: dict[str, tuple[str, Callable[[Any, Ns], Any]]] = {
            "offboard_control_mode": ("OffboardControlMode", self._control_mode),
            "trajectory_setpoint": ("TrajectorySetpoint", self._trajectory),
            "goto_setpoint": ("GotoSetpoint", self._goto),
            "vehicle_attitude_setpoint": ("VehicleAttitudeSetpoint", self._attitude),
            "vehicle_rates_setpoint": ("VehicleRatesSetpoint", self._rates),
            "vehicle_command": ("VehicleCommand", self._command),
            "vehicle_visual_odometry": ("VehicleOdometry", self._odometry),
            "manual_control_input": ("ManualControlSetpoint", self._manual_control),
        }
        for topic, (kind, words) in REFUSED.items():
            taken[topic] = (kind, self._refusal(topic, words))
        return tuple(
            SubscribedTopic(topic_name("in", topic, kind), type_name(kind), translate)
            for topic, (kind, translate) in taken.items()
        )

    def handlers(self) -> Mapping[str, Service]:
        """Return type and handler of the service."""
        return {"fmu/vehicle_command": ("px4_msgs/srv/VehicleCommand", self._serve_command)}

    def _warn_once(self, text: str) -> None:
        if text not in self._warned:
            self._warned.add(text)
            self._warn(text)

    def _refusal(self, topic: str, words: str) -> Callable[[Any, Ns], list[OutgoingMessage]]:
        def refuse(message: Any, now: Ns) -> list[OutgoingMessage]:
            self._warn_once(f"fmu/in/{topic}: {words} not taken by this node; the messages have no effect")
            return []

        return refuse

    # -- set-points

    def _control_mode(self, message: Any, now: Ns) -> list[OutgoingMessage]:
        """Keep OFFBOARD alive with the set-point that is in force."""
        flags = {name: bool(getattr(message, name)) for name in message.__match_args__ if name != "timestamp"}
        direct = next((name for name in _DIRECT if flags.get(name)), None)
        if direct is not None and not any(flags[name] for name in (*_TRAJECTORY, "attitude", "body_rate")):
            self._warn_once(
                f"fmu/in/offboard_control_mode: {direct} is not taken by this node; no set-point is"
            )
            return []
        self._offboard.flags, self._offboard.last_received = flags, now
        kind = self._kind()
        if kind is None:
            return []
        setpoint = self._setpoints.get(kind)
        if setpoint is None:
            setpoint = trajectory_setpoint(**_STAY)
        return [setpoint]

    def _kind(self) -> str | None:
        """Return which set-points count; the first kind that is set, as in the firmware."""
        flags = self._offboard.flags
        if any(flags.get(name) for name in _TRAJECTORY):
            return "trajectory"
        return next((name for name in ("attitude", "body_rate") if flags.get(name)), None)

    def _keep(self, kind: str, setpoint: OutgoingMessage, now: Ns) -> list[OutgoingMessage]:
        """Keep a set-point, and send it if it is of the kind that counts."""
        self._setpoints[kind] = setpoint
        counts = self._offboard.lasts(now, KEPT_ALIVE) and self._kind() == kind
        return [setpoint] if counts else []

    def _trajectory(self, message: Any, now: Ns) -> list[OutgoingMessage]:
        setpoint = trajectory_setpoint(
            message.position, message.velocity, message.acceleration, message.yaw, message.yawspeed
        )
        return self._keep("trajectory", setpoint, now)

    def _goto(self, message: Any, now: Ns) -> list[OutgoingMessage]:
        for name in ("max_horizontal_speed", "max_vertical_speed", "max_heading_rate"):
            if getattr(message, f"flag_set_{name}"):
                self._warn_once(f"fmu/in/goto_setpoint: {name} is not applied")
        heading = message.heading if message.flag_control_heading else nan
        return self._keep("trajectory", trajectory_setpoint(message.position, yaw=heading), now)

    def _attitude(self, message: Any, now: Ns) -> list[OutgoingMessage]:
        turns = isfinite(message.yaw_sp_move_rate) and message.yaw_sp_move_rate != 0.0
        fields = {
            "type_mask": _ROLL_AND_PITCH_RATE_IGNORED if turns else _RATES_IGNORED,
            "q": [float(one) for one in message.q_d],
            "body_yaw_rate": message.yaw_sp_move_rate if turns else 0.0,
            "thrust": _collective(message.thrust_body),
        }
        return self._keep("attitude", ("SET_ATTITUDE_TARGET", fields), now)

    def _rates(self, message: Any, now: Ns) -> list[OutgoingMessage]:
        fields = {
            "type_mask": _ATTITUDE_IGNORED,
            "q": [1.0, 0.0, 0.0, 0.0],
            "body_roll_rate": message.roll,
            "body_pitch_rate": message.pitch,
            "body_yaw_rate": message.yaw,
            "thrust": _collective(message.thrust_body),
        }
        return self._keep("body_rate", ("SET_ATTITUDE_TARGET", fields), now)

    def _odometry(self, message: Any, now: Ns) -> list[OutgoingMessage]:
        """Translate an external estimate: its frames and variances are those of ODOMETRY."""
        pose_frame = _ODOMETRY_FRAMES.get(message.pose_frame)
        velocity_frame = _ODOMETRY_FRAMES.get(message.velocity_frame)
        if pose_frame not in _POSE_FRAMES or velocity_frame is None:
            self._warn_once(
                f"fmu/in/vehicle_visual_odometry: pose_frame {message.pose_frame} with velocity_frame "
                f"{message.velocity_frame} is not taken; there is 1 (NED) or 2 (FRD), and for the velocity 3"
            )
            return []
        x, y, z = map(float, message.position)
        vx, vy, vz = map(float, message.velocity)
        roll_rate, pitch_rate, yaw_rate = map(float, message.angular_velocity)
        fields = {
            "time_usec": message.timestamp_sample or message.timestamp or (self._epoch + now) // US,
            "frame_id": pose_frame,
            "child_frame_id": velocity_frame,
            "x": x,
            "y": y,
            "z": z,
            "q": [float(one) for one in message.q],
            "vx": vx,
            "vy": vy,
            "vz": vz,
            "rollspeed": roll_rate,
            "pitchspeed": pitch_rate,
            "yawspeed": yaw_rate,
            "pose_covariance": _diagonal(message.position_variance, message.orientation_variance),
            "velocity_covariance": _diagonal(message.velocity_variance, (0.0, 0.0, 0.0)),
            "reset_counter": message.reset_counter,
            "estimator_type": constant("MAV_ESTIMATOR_TYPE_VISION"),
            "quality": message.quality,
        }
        return [("ODOMETRY", fields)]

    def _manual_control(self, message: Any, now: Ns) -> list[OutgoingMessage]:
        """Translate sticks of -1..1; samples that are marked as not valid count for nothing."""
        if not message.valid:
            return []
        self._telemetry.sticks(message, self._epoch + now)
        fields = {
            "x": _thousandths(message.pitch),
            "y": _thousandths(message.roll),
            "z": round(500.0 * (_within(message.throttle) + 1.0)),
            "r": _thousandths(message.yaw),
            "buttons": getattr(message, "buttons", 0),
        }
        return [("MANUAL_CONTROL", fields)]

    # -- commands

    def _command(self, message: Any, now: Ns) -> list[OutgoingMessage]:
        """Send a command once; its acknowledgement is published."""
        if not self._is_addressed(message):
            return []
        try:
            outgoing = command_message(message)
        except UsageError as error:
            self._warn(str(error))
            self._telemetry.answer(message.command, _UNSUPPORTED, self._epoch + now)
            return []
        self._telemetry.await_answer(outgoing[1]["command"], message.command)
        return [outgoing]

    def _is_addressed(self, message: Any) -> bool:
        """Return whether a command is for this vehicle; the firmware ignores others without a word."""
        if not self._link.known:
            self._warn_once(
                "fmu/in/vehicle_command: no heartbeat of an autopilot yet; the command is dropped"
            )
            return False
        for label, own in zip(("system", "component"), self._link.target, strict=True):
            given = getattr(message, f"target_{label}")
            if given not in (0, own):
                self._warn_once(
                    f"fmu/in/vehicle_command: target_{label} {given} is not this vehicle's, which is {own}; "
                    "such commands are ignored"
                )
                return False
        return True

    def _await_autopilot(self) -> None:
        """Wait for the first heartbeat, as the firmware's own service is not there before the firmware."""
        if not self._link.known:
            with self._link.subscribe("HEARTBEAT") as heartbeats:
                heartbeats.next(FIRST_HEARTBEAT)

    def _serve_command(self, request: Any) -> Any:
        """Handle ``fmu/vehicle_command``: the answer is the firmware's acknowledgement."""
        message, result = request.request, _FAILED
        try:
            name, fields = command_message(message)
        except UsageError as error:
            self._warn(str(error))
            result = _UNSUPPORTED
        else:
            self._await_autopilot()
            answer = self._services.request(name, fields) if self._is_addressed(message) else None
            result = _FAILED if answer is None else answer
        now = self._epoch + self._link.kernel.now()
        acknowledgement = make("VehicleCommandAck", now, command=message.command, result=result)
        return service("px4_msgs/srv/VehicleCommand").response(acknowledgement)


def trajectory_setpoint(
    position: Iterable[float] = (nan, nan, nan),
    velocity: Iterable[float] = (nan, nan, nan),
    acceleration: Iterable[float] = (nan, nan, nan),
    yaw: float = nan,
    yaw_rate: float = nan,
) -> OutgoingMessage:
    """Return a SET_POSITION_TARGET_LOCAL_NED; what is NaN is not controlled.

    Args:
        position: North, east, down of the estimator's origin, m.
        velocity: North, east, down, m/s.
        acceleration: North, east, down, m/s^2.
        yaw: Heading, rad.
        yaw_rate: Turn to the right, rad/s.
    """
    mask, fields = 0, {}
    values = (*position, *velocity, *acceleration)
    for bit, (name, value) in enumerate(zip(_AXES, values, strict=True)):
        fields[name] = float(value) if isfinite(value) else 0.0
        mask |= 0 if isfinite(value) else 1 << bit
    for name, bits, value in (("yaw", _NO_YAW, yaw), ("yaw_rate", _NO_YAW_RATE, yaw_rate)):
        fields[name] = float(value) if isfinite(value) else 0.0
        mask |= 0 if isfinite(value) else bits
    return "SET_POSITION_TARGET_LOCAL_NED", {"coordinate_frame": _LOCAL_NED, "type_mask": mask, **fields}


_AXES = ("x", "y", "z", "vx", "vy", "vz", "afx", "afy", "afz")


def command_message(message: Any) -> OutgoingMessage:
    """Return a VehicleCommand as COMMAND_LONG, or as COMMAND_INT where it states a place.

    Raises:
        UsageError: It is one of the firmware's own, which no message of MAVLink carries.
    """
    command = message.command
    parameters = [float(getattr(message, f"param{number}")) for number in range(1, 8)]
    if command == _SET_NAV_STATE:
        command, parameters = _DO_SET_MODE, _mode_parameters(parameters[0])
    if command > _LARGEST_COMMAND:
        raise UsageError(
            f"fmu/in/vehicle_command: {command} is a command within PX4, which this node cannot pass on"
        )
    latitude, longitude = parameters[4:6]
    placed = abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and (latitude, longitude) != (0.0, 0.0)
    if command not in _WITH_PLACE or not placed:
        numbered = {f"param{number}": value for number, value in enumerate(parameters, start=1)}
        return "COMMAND_LONG", {"command": command, "confirmation": message.confirmation, **numbered}
    numbered = {f"param{number}": value for number, value in enumerate(parameters[:4], start=1)}
    place = {"x": round(latitude * 1e7), "y": round(longitude * 1e7), "z": parameters[6]}
    return "COMMAND_INT", {"command": command, "frame": _GLOBAL_INT, **numbered, **place}


def _mode_parameters(state: float) -> list[float]:
    known = {int(one): mode for one, mode in MODES.items()}
    if state not in known:
        raise UsageError(
            f"fmu/in/vehicle_command: {state:g} is no navigation state that can be set; "
            f"there is {', '.join(f'{int(one)} ({NavState(one).name})' for one in MODES)}"
        )
    main, sub = known[int(state)]
    return [float(_CUSTOM_MODE_ENABLED), float(main), float(sub), 0.0, 0.0, 0.0, 0.0]


def _diagonal(first: Iterable[float], second: Iterable[float]) -> list[float]:
    """Return the upper triangle of a 6x6 matrix, row by row, with these variances on its diagonal."""
    triangle: list[float] = []
    for row, variance in enumerate((*first, *second)):
        triangle += [float(variance), *([0.0] * (5 - row))]
    return triangle


def _collective(thrust: Iterable[float]) -> float:
    """Return the thrust 0..1 of a thrust along the body's axes, of which a multirotor has the one upwards."""
    _, _, down = thrust
    return -float(down)


def _within(value: float) -> float:
    return max(-1.0, min(1.0, value))


def _thousandths(value: float) -> int:
    return round(1000.0 * _within(value))
