"""SLAM as a node of a ROS graph, embedded or real, by the names of gmapping, hector_mapping and slam_toolbox.

It subscribes to ``scan`` and ``odom`` (or takes the transform from ``odom``), and publishes ``map``,
``path``, ``slam_out_pose`` and the transform from ``map`` to ``odom``. ``save_map`` writes map_server's
files, ``dynamic_map`` answers with the map.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from volery.autonomy.laser_logs import between, planar
from volery.autonomy.laser_scan import LaserScan2, scan_of
from volery.autonomy.map_server import fill_header, map_path, path_message, pose_message
from volery.autonomy.occupancy_grid import OccupancyGrid
from volery.autonomy.planar_pose import Pose2
from volery.autonomy.slam import Slam, SlamSettings
from volery.base.elementary import sine_cosine
from volery.base.errors import UsageError
from volery.base.time import MS, Ns, S, to_seconds
from volery.ros.client_libraries.tf2.transform_tree import (
    LATEST,
    RigidTransform,
    TransformException,
    TransformTree,
    from_transform,
    write_transform,
)
from volery.ros.graph import LATCHED, Node, QoS
from volery.ros.messages import new
from volery.ros.messages.message import nanoseconds

_TF_MESSAGE = "tf2_msgs/msg/TFMessage"
_QUEUE = 20
"""Scans that wait for the odometry that comes after them."""
_PATIENCE: Ns = 500 * MS
"""Time of the scans by which odometry may be late; then the scans alone say how the vehicle moves."""
_PLACED: Ns = 2 * S
"""Time of the scans for which the transform to the scanner may be late; then it is in the centre."""
_EMPTY = 10
"""Scans in a row that meet nothing, after which this is said."""
_KEPT: Ns = 10 * S
"""Time for which odometry is kept."""
_ODOMETRY = QoS(1000)
"""Closing a loop can take seconds, in which no odometry may be lost: the scans meanwhile need it."""
_TILT = 0.17
"""Tilt of a scanner [rad] from which on its scans are no longer taken for planar ones."""


@dataclass(frozen=True)
class SlamNames:
    """Names on the graph.

    Args:
        scan: Topic of ``sensor_msgs/LaserScan``.
        odometry: Topic of ``nav_msgs/Odometry``; empty: the transform from ``odom_frame`` to ``base_frame``.
        map: Topic of the map, which is latched.
        path: Topic of the way that the vehicle has come.
        pose: Topic of where the vehicle was at each scan, with the time of the scan.
        map_frame: Frame of the map.
        odom_frame: Frame of the odometry, where no message names it.
        base_frame: Frame of the vehicle, where no message names it.
    """

    scan: str = "scan"
    odometry: str = "odom"
    map: str = "map"
    path: str = "path"
    pose: str = "slam_out_pose"
    map_frame: str = "map"
    odom_frame: str = "odom"
    base_frame: str = "base_link"


class SlamNode:
    """SLAM on a graph, in the callbacks of a node that its owner spins.

    Args:
        node: The node.
        names: Its names on the graph.
        settings: How scans become a map.
        resolution: Side of a cell of the map [m].
        period: Time between two maps that are published [ns].
        say: Called with what the user must know: a lost place, odometry that has slipped or is silent.
        match: Called to match a scan. A component gives a function of its own that calls ``Slam.add``: what
            is called from a component's file is charged to it.

    ``pose`` is where the vehicle was when the last scan was matched, ``slam`` and ``grid`` are the map;
    ``waiting`` are scans that wait for odometry.

    Example::

        node = volery.node()
        SlamNode(node, say=volery.log)
        node.spin()
    """

    def __init__(
        self,
        node: Node,
        names: SlamNames = SlamNames(),
        *,
        settings: SlamSettings = SlamSettings(),  # noqa: B008  # it is immutable
        resolution: float = 0.05,
        period: Ns = 5 * S,
        say: Callable[[str], object] = lambda text: None,
        match: Callable[[Slam, Pose2 | None, LaserScan2], Pose2] = Slam.add,
    ) -> None:
        self._node, self.names, self._say, self._match_scan = node, names, say, match
        self.slam = Slam(settings)
        self.grid = OccupancyGrid(resolution)
        self.pose: Pose2 | None = None
        self._marked = self._loops = 0  # scans that are in the grid, loops that it knows
        self._tree = TransformTree()
        self._odometry: deque[tuple[Ns, Pose2]] = deque()
        self._odom_frame, self._base_frame = names.odom_frame, names.base_frame
        self.waiting: deque[tuple[Ns, Any]] = deque()
        self._first: Ns | None = None
        self._matched: Ns | None = None
        self._said: set[str] = set()
        self._empty = 0  # scans in a row that have met nothing
        self._words = 0  # of the map that were said
        self._maps = node.advertise(names.map, "nav_msgs/msg/OccupancyGrid", LATCHED)
        self._paths = node.advertise(names.path, "nav_msgs/msg/Path", LATCHED)
        self._poses = node.advertise(names.pose, "geometry_msgs/msg/PoseStamped", QoS(1))
        self._transforms = node.advertise("/tf", _TF_MESSAGE, QoS(100))
        node.subscribe("/tf_static", _TF_MESSAGE, lambda message: self._take_transforms(message, True))
        if names.odometry:
            node.subscribe(names.odometry, "nav_msgs/msg/Odometry", self._take_odometry, _ODOMETRY)
        else:
            node.subscribe(
                "/tf", _TF_MESSAGE, lambda message: self._take_transforms(message, False), _ODOMETRY
            )
        node.subscribe(names.scan, "sensor_msgs/msg/LaserScan", self._take_scan, QoS(_QUEUE))
        node.timer(period, self.publish)
        node.serve("save_map", "nav2_msgs/srv/SaveMap", self._save)
        node.serve("dynamic_map", "nav_msgs/srv/GetMap", self._give)

    # -- what arrives

    def _take_transforms(self, message: Any, static: bool) -> None:
        for transform in message.transforms:
            child, parent = (
                transform.child_frame_id.removeprefix("/"),
                transform.header.frame_id.removeprefix("/"),
            )
            at, rigid = nanoseconds(transform.header.stamp), from_transform(transform.transform)
            wrong = self._tree.add(child, parent, at, rigid, static=static)
            if wrong:
                self._say_once(wrong)
            elif not static and (parent, child) == (self._odom_frame, self._base_frame):
                self._add_odometry(at, planar(rigid))

    def _take_odometry(self, message: Any) -> None:
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        rigid = RigidTransform((turn.w, turn.x, turn.y, turn.z), (place.x, place.y, place.z))
        self._odom_frame = message.header.frame_id.removeprefix("/") or self._odom_frame
        self._base_frame = message.child_frame_id.removeprefix("/") or self._base_frame
        if all(map(isfinite, (*rigid.rotation, *rigid.translation))):
            self._add_odometry(nanoseconds(message.header.stamp), planar(rigid))
        else:
            self._say_once("odometry that is not a number is left out")

    def _add_odometry(self, at: Ns, pose: Pose2) -> None:
        if self._odometry and at <= self._odometry[-1][0]:
            if at > self._odometry[-1][0] - S:
                return
            self._say(f"time has jumped back by {to_seconds(self._odometry[-1][0] - at):.1f} s in odometry")
            self._odometry.clear()
        self._odometry.append((at, pose))
        while self._odometry[0][0] < at - _KEPT:
            self._odometry.popleft()
        self._match_waiting()

    def _take_scan(self, message: Any) -> None:
        at = nanoseconds(message.header.stamp)
        last = self.waiting[-1][0] if self.waiting else self._matched
        if last is not None and at <= last:
            if at > last - S:
                self._say_once("a scan that is not newer than the one before is left out")
                return
            self._say(f"time has jumped back by {to_seconds(last - at):.1f} s in scans")
            self.waiting.clear()
        self._first = at if self._first is None or at < self._first else self._first
        self.waiting.append((at, message))
        if len(self.waiting) > _QUEUE:
            self.waiting.popleft()
        self._match_waiting()

    # -- matching

    def _match_waiting(self) -> None:
        while self.waiting:
            at, message = self.waiting[0]
            newest = self.waiting[-1][0]
            known = bool(self._odometry) and self._odometry[-1][0] >= at
            if not known and newest - at < _PATIENCE:
                return
            mounting = self._mounting(message.header.frame_id.removeprefix("/"), newest)
            if mounting is None:
                return
            self.waiting.popleft()
            self._match(at, message, mounting, between(self._odometry, at) if known else None)

    def _match(self, at: Ns, message: Any, mounting: Pose2, odometry: Pose2 | None) -> None:
        try:
            scan = scan_of(message, mounting)
        except UsageError as error:
            self._say_once(str(error))
            return
        if odometry is None:
            source = self.names.odometry or f"the transform from {self._odom_frame}"
            self._say_once(f"no odometry on {source}: the scans alone say how the vehicle moves")
        else:
            self._said.discard(next((text for text in self._said if text.startswith("no odometry")), ""))
        self._empty = 0 if len(scan.points) else self._empty + 1
        if self._empty == _EMPTY:
            self._say(f"{_EMPTY} scans have met nothing: is the scanner where it can see walls?")
        self._matched = at
        self.pose = self._match_scan(self.slam, odometry, scan)
        for _, words in self.slam.lost[self._words :]:
            self._say(words)
        self._words = len(self.slam.lost)
        self._poses.publish(pose_message(at, self.pose, self.names.map_frame))
        if odometry is not None:
            self._publish_transform(at, self.pose.after(odometry.to(Pose2())))

    def _mounting(self, frame: str, newest: Ns) -> Pose2 | None:
        """Return where the scanner is on the vehicle; None while that may become known."""
        if not frame or frame == self._base_frame:
            return Pose2()
        try:
            _, rigid = self._tree.look_up(self._base_frame, frame, LATEST)
        except TransformException:
            assert self._first is not None, "there is a scan"
            if newest - self._first < _PLACED:
                return None
            self._say_once(f"no transform from {self._base_frame} to {frame}: taken for the vehicle's centre")
            return Pose2()
        _, x, y, _ = rigid.rotation
        if x * x + y * y > 0.25 * _TILT * _TILT:
            self._say_once(
                f"the scanner {frame} is tilted or upside down: its scans are taken for level ones"
            )
        return planar(rigid)

    def _say_once(self, text: str) -> None:
        if text not in self._said:
            self._said.add(text)
            self._say(text)

    # -- what is published

    def _publish_transform(self, at: Ns, moved: Pose2) -> None:
        one = new("geometry_msgs/msg/TransformStamped", child_frame_id=self._odom_frame)
        fill_header(one.header, at, self.names.map_frame)
        write_transform(one.transform, _rigid(moved))
        self._transforms.publish(new(_TF_MESSAGE, transforms=[one]))

    def finish(self) -> None:
        """Match all scans once more, fit the graph, and publish the map. No scan is matched afterwards."""
        self.waiting.clear()
        self.slam.finish()
        self._loops = -1
        self.publish()

    def publish(self) -> None:
        """Publish the map and the way, if scans were kept since the last time."""
        if not self._mark():
            return
        now = self._node.now()
        self._maps.publish(self._message(now))
        times = [kept.scan.time for kept in self.slam.scans]
        self._paths.publish(path_message(now, np.array(self.slam.poses), self.names.map_frame, times))

    def _mark(self) -> bool:
        """Bring the grid up to date; return whether it has changed."""
        slam = self.slam
        if self._loops != slam.loops:  # poses have moved
            self.grid = OccupancyGrid(self.grid.resolution)
            self._marked, self._loops = 0, slam.loops
        fresh = range(self._marked, len(slam.scans))
        for number in fresh:
            self.grid.insert(slam.poses[number], slam.scans[number].scan)
        self._marked = len(slam.scans)
        return bool(fresh)

    def _message(self, now: Ns) -> Any:
        message = new("nav_msgs/msg/OccupancyGrid")
        fill_header(message.header, now, self.names.map_frame)
        self.grid.fill(message)
        return message

    # -- services

    def _give(self, request: Any) -> Any:
        self._mark()
        return new("nav_msgs/srv/GetMap_Response", map=self._message(self._node.now()))

    def _save(self, request: Any) -> Any:
        self._mark()
        answer = new("nav2_msgs/srv/SaveMap_Response")
        try:
            if not self.grid.log_odds.size:
                raise UsageError("there is no map yet")
            if request.image_format not in ("", "pgm") or request.map_mode not in ("", "trinary"):
                raise UsageError("maps are saved as pgm in the mode trinary")
            self.grid.save(map_path(request.map_url))
            answer.result = True
        except (OSError, UsageError) as error:
            self._say(f"save_map {request.map_url!r}: {error}")
        return answer


def _rigid(pose: Pose2) -> RigidTransform:
    sine, cosine = sine_cosine(0.5 * pose.yaw)
    return RigidTransform((cosine, 0.0, 0.0, sine), (pose.x, pose.y, 0.0))
