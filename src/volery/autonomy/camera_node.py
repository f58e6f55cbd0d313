"""Poses and scans of one moving camera as a node of a ROS graph, embedded or real, for ``SlamNode`` to take.

It subscribes to pictures, the calibration beside them, odometry and the static transforms, and publishes the
scans and the corrected odometry of ``MotionStereo``.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from math import ceil, isfinite, pi
from typing import Any

import numpy as np

from volery.autonomy.depth_scan import AHEAD
from volery.autonomy.laser_logs import around
from volery.autonomy.map_server import fill_header
from volery.autonomy.markers import camera_of, picture_of
from volery.autonomy.motion_stereo import BEAM, MotionStereo, Sighting
from volery.base.elementary import sine_cosine
from volery.base.errors import UsageError
from volery.base.time import Ns, S
from volery.ros.client_libraries.tf2.transform_tree import (
    LATEST,
    RigidTransform,
    TransformException,
    TransformTree,
    from_transform,
    interpolate,
)
from volery.ros.graph import Node, QoS
from volery.ros.messages import new
from volery.ros.messages.message import nanoseconds

FRAME = "visual_odom"
"""Frame of the corrected odometry."""
_QUEUE = 20
"""Pictures that wait for the odometry that comes after them."""
_KEPT: Ns = 10 * S
"""Time for which odometry is kept."""
_SIDE = ceil(pi / BEAM)
"""Beams on each side of ahead."""


class CameraNode:
    """Poses and scans of a camera on a graph, in the callbacks of a node that its owner spins.

    Args:
        node: The node.
        pictures: Topic of ``sensor_msgs/Image``; ``camera_info`` is beside it.
        odometry: Topic of ``nav_msgs/Odometry``.
        scan: Topic of the scans (``sensor_msgs/LaserScan``), around the vehicle.
        corrected: Topic of the odometry that the pictures have corrected, in the frame ``FRAME``.
        say: Called with what the user must know.

    Example::

        node = volery.node()
        CameraNode(node, "camera/image_raw")
        SlamNode(node, SlamNames(odometry="visual_odom"), settings=OF_VIEWS)
        node.spin()
    """

    def __init__(
        self,
        node: Node,
        pictures: str = "camera/image_raw",
        odometry: str = "odom",
        scan: str = "scan",
        corrected: str = "visual_odom",
        say: Callable[[str], object] = lambda text: None,
    ) -> None:
        self._say = say
        self._said: set[str] = set()
        self._tree = TransformTree()
        self._info: Any = None
        self._base_frame = "base_link"
        self._odometry: deque[tuple[Ns, RigidTransform]] = deque()
        self._waiting: deque[tuple[Ns, Any]] = deque()
        self._last: Ns | None = None
        self._stereo: MotionStereo | None = None
        self._scans = node.advertise(scan, "sensor_msgs/msg/LaserScan")
        self._moves = node.advertise(corrected, "nav_msgs/msg/Odometry")
        folder, slash, _ = pictures.rpartition("/")
        node.subscribe("/tf_static", "tf2_msgs/msg/TFMessage", self._take_transforms)
        node.subscribe(f"{folder}{slash}camera_info", "sensor_msgs/msg/CameraInfo", self._take_calibration)
        node.subscribe(odometry, "nav_msgs/msg/Odometry", self._take_odometry, QoS(1000))
        node.subscribe(pictures, "sensor_msgs/msg/Image", self._take_picture, QoS(_QUEUE))

    def _take_transforms(self, message: Any) -> None:
        for transform in message.transforms:
            child, parent = (
                transform.child_frame_id.removeprefix("/"),
                transform.header.frame_id.removeprefix("/"),
            )
            at = nanoseconds(transform.header.stamp)
            wrong = self._tree.add(child, parent, at, from_transform(transform.transform), static=True)
            if wrong:
                self._say_once(wrong)

    def _take_calibration(self, message: Any) -> None:
        self._info = message

    def _take_odometry(self, message: Any) -> None:
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        rigid = RigidTransform((turn.w, turn.x, turn.y, turn.z), (place.x, place.y, place.z))
        at = nanoseconds(message.header.stamp)
        self._base_frame = message.child_frame_id.removeprefix("/") or self._base_frame
        if not all(map(isfinite, (*rigid.rotation, *rigid.translation))):
            self._say_once("odometry that is not a number is left out")
            return
        if self._odometry and at <= self._odometry[-1][0]:
            if at > self._odometry[-1][0] - S:
                return
            self._say("time has jumped back: the camera begins anew")
            self._odometry.clear()
            self._waiting.clear()
            self._stereo = self._last = None
        self._odometry.append((at, rigid))
        while self._odometry[0][0] < at - _KEPT:
            self._odometry.popleft()
        while self._waiting and self._waiting[0][0] <= at:
            self._see(*self._waiting.popleft())

    def _take_picture(self, message: Any) -> None:
        at = nanoseconds(message.header.stamp)
        if self._odometry and at <= self._odometry[-1][0]:
            self._see(at, message)
            return
        self._waiting.append((at, message))
        if len(self._waiting) > _QUEUE:
            self._waiting.popleft()
            self._say_once("no odometry of the time of the pictures: without it they have no scale")

    def _see(self, at: Ns, message: Any) -> None:
        if self._last is not None and at <= self._last:
            self._say_once("a picture that is not newer than the one before is left out")
            return
        try:
            if self._stereo is None:
                self._stereo = self._begun(message.header.frame_id.removeprefix("/"))
            before, after, part = around(self._odometry, at)
            seen = self._stereo.add(at, picture_of(message), interpolate(before, after, part))
        except UsageError as error:
            self._say_once(str(error))
            return
        self._last = at
        if seen is not None:
            self._publish(at, seen)

    def _begun(self, frame: str) -> MotionStereo:
        if self._info is None:
            raise UsageError("no calibration (camera_info) of the pictures yet: they are left out")
        if not frame:
            return MotionStereo(camera_of(self._info), AHEAD)
        try:
            _, mounting = self._tree.look_up(self._base_frame, frame, LATEST)
        except TransformException:
            raise UsageError(
                f"no transform from {self._base_frame} to {frame}: pictures are left out"
            ) from None
        return MotionStereo(camera_of(self._info), mounting)

    def _publish(self, at: Ns, seen: Sighting) -> None:
        moved = new("nav_msgs/msg/Odometry", child_frame_id=self._base_frame)
        fill_header(moved.header, at, FRAME)
        place, turn = moved.pose.pose.position, moved.pose.pose.orientation
        place.x, place.y = seen.pose.x, seen.pose.y
        turn.z, turn.w = sine_cosine(0.5 * seen.pose.yaw)
        self._moves.publish(moved)
        points = seen.scan.points
        scan = new("sensor_msgs/msg/LaserScan")
        fill_header(scan.header, at, self._base_frame)
        scan.angle_min, scan.angle_increment = (0.5 - _SIDE) * BEAM, BEAM
        scan.angle_max, scan.range_max = (_SIDE - 0.5) * BEAM, 100.0
        ranges = np.full(2 * _SIDE, np.nan, dtype=np.float32)  # where no point was seen nothing is known
        beams = np.floor(np.arctan2(points[:, 1], points[:, 0]) / BEAM).astype(np.int64) + _SIDE
        ranges[beams] = np.sqrt((points * points).sum(axis=1))
        scan.ranges = ranges
        self._scans.publish(scan)

    def _say_once(self, text: str) -> None:
        if text not in self._said:
            self._said.add(text)
            self._say(text)
