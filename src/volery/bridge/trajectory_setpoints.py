"""MAVROS's ``setpoint_trajectory``: a trajectory whose points become set-points at their times.

Each point is sent once, ``time_from_start`` after the trajectory has arrived, to within a cycle of the node;
a new trajectory takes the place of the one before. Of a point only what it has is controlled: the first of
its transforms, velocities and accelerations, ENU on the ROS side.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from volery.base import frames
from volery.base.time import MS, Ns, S
from volery.bridge.node_interface import (
    InterfaceContext,
    OutgoingMessage,
    PublishedByNode,
    Service,
    SubscribedTopic,
    stamped,
)
from volery.links.mavlink_messages import constant
from volery.ros.messages import new, service

TRAJECTORY_TOPICS = (PublishedByNode("setpoint_trajectory/desired", "nav_msgs/msg/Path"),)
_TYPE = "trajectory_msgs/msg/MultiDOFJointTrajectory"
_LOCAL_NED = constant("MAV_FRAME_LOCAL_NED")
_NO_POSITION, _NO_VELOCITY, _NO_ACCELERATION, _NO_YAW, _NO_YAW_RATE = 7, 7 << 3, 7 << 6, 1 << 10, 1 << 11


class TrajectorySetpoints:
    """The points of a trajectory that are still to be sent."""

    def __init__(self, context: InterfaceContext) -> None:
        self._link, self._publish = context.link, context.publish
        self._waiting: list[tuple[Ns, Any]] = []

    def subscriptions(self) -> tuple[SubscribedTopic, ...]:
        """Return the topic of trajectories."""
        return (SubscribedTopic("setpoint_trajectory/local", _TYPE, self._begin),)

    def services(self) -> Mapping[str, Service]:
        """Return the service that drops the trajectory."""
        return {"setpoint_trajectory/reset": ("std_srvs/srv/Trigger", self._reset)}

    def due(self, now: Ns) -> Callable[[], None] | None:
        """Return what sends the points that are due, or None."""
        if not self._waiting or self._waiting[0][0] > now:
            return None
        return partial(self._send, self._take(now))

    def _begin(self, message: Any, now: Ns) -> list[OutgoingMessage]:
        self._waiting = [(now + _after(point), point) for point in message.points]
        poses = [_pose(point, message.header) for point in message.points if point.transforms]
        header = message.header if message.header.frame_id else stamped(now, "map")
        self._publish("setpoint_trajectory/desired", new("nav_msgs/msg/Path", header=header, poses=poses))
        return self._take(now)

    def _take(self, now: Ns) -> list[OutgoingMessage]:
        taken = [point for at, point in self._waiting if at <= now]
        self._waiting = [(at, point) for at, point in self._waiting if at > now]
        return [setpoint(point, now) for point in taken]

    def _send(self, setpoints: list[OutgoingMessage]) -> None:
        for name, fields in setpoints:
            self._link.send_to_autopilot(name, fields)

    def _reset(self, request: Any) -> Any:
        had, self._waiting = bool(self._waiting), []
        return service("std_srvs/srv/Trigger").response(had, "" if had else "no trajectory is flown")


def _after(point: Any) -> Ns:
    return int(point.time_from_start.sec) * S + int(point.time_from_start.nanosec)


def _pose(point: Any, header: Any) -> Any:
    made = new("geometry_msgs/msg/PoseStamped", header=header)
    transform = point.transforms[0]
    at = transform.translation
    made.pose.position = new("geometry_msgs/msg/Point", x=at.x, y=at.y, z=at.z)
    made.pose.orientation = transform.rotation
    return made


def setpoint(point: Any, now: Ns) -> OutgoingMessage:
    """Return the set-point of a ``MultiDOFJointTrajectoryPoint``: NED, headings from north."""
    fields: dict[str, Any] = {}
    mask = 0
    if point.transforms:
        at, turned = point.transforms[0].translation, point.transforms[0].rotation
        fields |= zip("xyz", frames.enu_to_ned((at.x, at.y, at.z)), strict=True)
        yaw = frames.quaternion_to_euler((turned.w, turned.x, turned.y, turned.z))[2]
        fields["yaw"] = frames.yaw_to_heading(yaw)
    else:
        mask |= _NO_POSITION | _NO_YAW
    if point.velocities:
        moved = point.velocities[0]
        speed = frames.enu_to_ned((moved.linear.x, moved.linear.y, moved.linear.z))
        fields |= zip(("vx", "vy", "vz"), speed, strict=True)
        fields["yaw_rate"] = -moved.angular.z
    else:
        mask |= _NO_VELOCITY | _NO_YAW_RATE
    if point.accelerations:
        pushed = point.accelerations[0].linear
        fields |= zip(("afx", "afy", "afz"), frames.enu_to_ned((pushed.x, pushed.y, pushed.z)), strict=True)
    else:
        mask |= _NO_ACCELERATION
    frame = {"time_boot_ms": now // MS, "coordinate_frame": _LOCAL_NED, "type_mask": mask}
    return "SET_POSITION_TARGET_LOCAL_NED", frame | fields
