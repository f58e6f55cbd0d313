"""A vehicle at the level of velocities, and the thesis's controller of a cube of goals, as ROS nodes.

The vehicle takes ``cmd_vel`` and publishes ``poseupdate`` and ``odom``, as the thesis's Hector quadrotor did
towards its controller. It has no autopilot and no rotors: a velocity follows its command through a lag. Any
node that publishes ``cmd_vel`` can replace ``CubeController``; on real ROS the topics are the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import hypot, isfinite

from volery.base.elementary import atan2, cos, sin
from volery.base.errors import UsageError
from volery.base.time import MS, Ns, to_seconds
from volery.control.laws import PID_START, PidGains, PidState, per_sample, pid
from volery.kernel.api import Kernel
from volery.ros.graph import Node
from volery.ros.messages import new
from volery.trace.events import ControlSample

TWIST, POSE = "geometry_msgs/msg/Twist", "geometry_msgs/msg/PoseWithCovarianceStamped"
ODOMETRY = "nav_msgs/msg/Odometry"
STEP: Ns = 10 * MS
PUBLISH: Ns = 100 * MS
COMMAND_LASTS: Ns = 500 * MS
"""A vehicle whose commander falls silent stops."""
RADIANS = 6.283185307179586

Point = tuple[float, float, float]


@dataclass
class VelocityBody:
    """State of the vehicle: position in m and heading in rad (ENU), velocities in its own frame.

    Attributes:
        lag_s: time constant with which velocities follow commands, s.
        fastest: greatest speed, m/s.
        turns: greatest turn rate, rad/s.
    """

    lag_s: float = 0.25
    fastest: float = 3.0
    turns: float = 2.0
    position: Point = (0.0, 0.0, 0.0)
    yaw: float = 0.0
    velocity: Point = (0.0, 0.0, 0.0)
    yaw_rate: float = 0.0

    def step(self, command: Point, yaw_rate: float, seconds: float) -> None:
        """Advance by *seconds* under a command in m/s (forward, left, up) and rad/s.

        Args:
            command: velocity in the vehicle's own frame; not a number stops it.
            yaw_rate: turn rate, counter-clockwise positive.
            seconds: step, s.
        """
        wanted = tuple(value if isfinite(value) else 0.0 for value in command)
        speed = hypot(*wanted)
        scale = min(1.0, self.fastest / speed) if speed > 0.0 else 1.0
        share = seconds / (self.lag_s + seconds)
        forward, left, up = (
            have + share * (aim * scale - have) for have, aim in zip(self.velocity, wanted, strict=True)
        )
        turn = min(self.turns, max(-self.turns, yaw_rate)) if isfinite(yaw_rate) else 0.0
        self.velocity, self.yaw_rate = (forward, left, up), self.yaw_rate + share * (turn - self.yaw_rate)
        self.yaw += self.yaw_rate * seconds
        c, s = cos(self.yaw), sin(self.yaw)
        x, y, z = self.position
        self.position = (
            x + (forward * c - left * s) * seconds,
            y + (forward * s + left * c) * seconds,
            max(0.0, z + up * seconds),
        )


class VelocityVehicle:
    """The vehicle as a node: subscribes ``cmd_vel``, publishes ``poseupdate`` and ``odom`` at 10 Hz.

    Args:
        kernel: clock.
        node: node on any graph.
        body: the vehicle.
    """

    def __init__(self, kernel: Kernel, node: Node, body: VelocityBody | None = None) -> None:
        self.body = body or VelocityBody()
        self._kernel, self._node = kernel, node
        self._command: tuple[Point, float] = ((0.0, 0.0, 0.0), 0.0)
        self._received: Ns = -COMMAND_LASTS
        self._pose = node.advertise("poseupdate", POSE)
        self._odometry = node.advertise("odom", ODOMETRY)
        node.subscribe("cmd_vel", TWIST, self._on_command)
        self._handles = (kernel.every(STEP, self._step), kernel.every(PUBLISH, self._publish))

    def _on_command(self, message: object) -> None:
        linear, angular = message.linear, message.angular  # type: ignore[attr-defined]  # a Twist
        self._command = (float(linear.x), float(linear.y), float(linear.z)), float(angular.z)
        self._received = self._kernel.now()

    def _step(self) -> None:
        self._node.spin_available()
        stale = self._kernel.now() - self._received > COMMAND_LASTS
        command, turn = ((0.0, 0.0, 0.0), 0.0) if stale else self._command
        self.body.step(command, turn, to_seconds(STEP))

    def _publish(self) -> None:
        body, message, odometry = self.body, new(POSE), new(ODOMETRY)
        for pose in (message.pose.pose, odometry.pose.pose):
            pose.position.x, pose.position.y, pose.position.z = body.position
            pose.orientation.z, pose.orientation.w = sin(body.yaw / 2.0), cos(body.yaw / 2.0)
        twist = odometry.twist.twist
        twist.linear.x, twist.linear.y, twist.linear.z = body.velocity
        twist.angular.z = body.yaw_rate
        message.header.frame_id = odometry.header.frame_id = "map"
        odometry.child_frame_id = "base_link"
        self._pose.publish(message)
        self._odometry.publish(odometry)

    def close(self) -> None:
        """Stop."""
        for handle in self._handles:
            handle.cancel()


THESIS_CUBE: tuple[Point, ...] = (
    (0.0, 0.0, 1.0),
    *(
        (x, y, z)
        for z in (1.0, 3.0)
        for x, y in ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (1.0, 1.0))
    ),
)
"""The thesis's square of goals at two heights, m."""
THESIS_GAINS = (0.5, 0.0002, 0.00005)
"""kp, ki and kd per sample (thesis, equation 2.1)."""
TOLERANCE = 0.05


@dataclass
class CubeController:
    """The thesis's controller as a node: ``poseupdate`` in, ``cmd_vel`` out, one PID law for each axis.

    The node's private parameters ``kp``, ``ki``, ``kd`` and ``tolerance`` may be changed at any time.

    Args:
        kernel: clock and record.
        node: node on any graph.
        goals: goals in m.
        rounds: how often the goals are flown; 0 without end.
        level: whether a goal counts as reached without its height, as in the thesis.
    """

    kernel: Kernel
    node: Node
    goals: Sequence[Point] = THESIS_CUBE
    rounds: int = 1
    level: bool = False
    reached: list[tuple[float, float]] = field(default_factory=list)
    """Time in s and distance in m at which each goal was reached."""
    done: bool = False

    def __post_init__(self) -> None:
        if not self.goals or self.rounds < 0:
            raise UsageError(f"{len(self.goals)} goals in {self.rounds} rounds: give at least one goal")
        for name, value in zip(("kp", "ki", "kd", "tolerance"), (*THESIS_GAINS, TOLERANCE), strict=True):
            self.node.set_parameter(f"~{name}", self.node.get_parameter(f"~{name}", value))
        self._states: list[PidState] = [PID_START] * 4
        self._index = 0
        self._last: Ns | None = None
        self._twist = self.node.advertise("cmd_vel", TWIST)
        self.node.subscribe("poseupdate", POSE, self._on_pose)
        self._handle = self.kernel.every(STEP, self.node.spin_available)

    def _gains(self) -> tuple[PidGains, float]:
        kp, ki, kd, tolerance = (
            float(self.node.get_parameter(f"~{one}")) for one in ("kp", "ki", "kd", "tolerance")
        )
        _, integral, derivative = per_sample(kp, ki, kd, to_seconds(PUBLISH))
        return PidGains(kp=kp, ki=integral, kd=derivative, on_measurement=False), tolerance

    def _on_pose(self, message: object) -> None:
        pose = message.pose.pose  # type: ignore[attr-defined]  # a PoseWithCovarianceStamped
        here = pose.position.x, pose.position.y, pose.position.z
        rotation = pose.orientation
        yaw = 2.0 * atan2(rotation.z, rotation.w)
        now = self.kernel.now()
        sample_s = to_seconds(now - self._last) if self._last is not None else to_seconds(PUBLISH)
        self._last = now
        try:
            gains, tolerance = self._gains()
        except (UsageError, TypeError, ValueError):
            return  # parameters that are no gains change nothing: the vehicle stops soon
        goal = (*self.goals[min(self._index, len(self.goals) - 1)], 0.0)
        outputs = []
        for number, (loop, aim, value) in enumerate(zip("xyzw", goal, (*here, yaw), strict=True)):
            law = gains if loop != "w" else PidGains(kp=10.0 * float(gains.kp), period=RADIANS)
            terms, self._states[number] = pid(law, self._states[number], aim, value, max(sample_s, 1e-3))
            outputs.append(float(terms.output))
            figures = map(float, (terms.error, *terms[1:4], terms.output))
            unit, period = ("rad", RADIANS) if loop == "w" else ("m", 0.0)
            name = "yaw" if loop == "w" else loop
            self.kernel.record(
                ControlSample(now, "velocity", name, "thesis", unit, period, aim, value, *figures)
            )
        self._send(*outputs)
        self._advance(here, tolerance)

    def _send(self, x: float, y: float, z: float, turn: float) -> None:
        twist = new(TWIST)
        twist.linear.x, twist.linear.y, twist.linear.z, twist.angular.z = x, y, z, turn
        self._twist.publish(twist)

    def _advance(self, here: Point, tolerance: float) -> None:
        goal = self.goals[min(self._index, len(self.goals) - 1)]
        errors = [abs(a - b) for a, b in zip(here, goal, strict=True)]
        if self.done or max(errors[:2] if self.level else errors) >= tolerance:
            return
        self.reached.append((to_seconds(self.kernel.now()), hypot(*errors)))
        self._index += 1
        if self._index == len(self.goals):
            finished = len(self.reached) // len(self.goals)
            if self.rounds and finished >= self.rounds:
                self.done = True
                self._send(0.0, 0.0, 0.0, 0.0)
                self.close()
            else:
                self._index = 0

    def close(self) -> None:
        """Stop."""
        self._handle.cancel()
