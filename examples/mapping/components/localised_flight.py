"""Localised_Flight: finds the drone in a known map, tells its autopilot, and flies on ways of that map.

A ROS node: scans and odometry come over topics. Between two scans the odometry carries the pose on; the poses
go to the autopilot, which has no other position.
"""

from __future__ import annotations

from math import pi, sqrt
from pathlib import Path

import rospy
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

import volery
from volery import AMSL, Position, PositionLost
from volery.autonomy.grid_path import WaysFrom, clearance_of
from volery.autonomy.laser_scan import scan_of
from volery.autonomy.localisation import Localiser
from volery.autonomy.occupancy_grid import OccupancyGrid
from volery.autonomy.planar_pose import Pose2
from volery.base.frames import quaternion_to_euler
from volery.vehicles.external_pose import ExternalPose

MATCHING_S = 0.004
"""Matching a scan at ``AT_MHZ``; charged instead of what it takes here."""
AT_MHZ = 1500
CLEARANCE_M = 0.7
POSE_PERIOD_S = 0.05
ODOMETRY_KEPT_S = 0.1
LARGEST_SIGMA_M = 0.5
"""A place that is less sure than this is not sent to the autopilot."""


class LocalisedFlight:
    """``map`` is a map_server file beside this folder; ``goals`` are places of the model.

    Odometry is missing for ``gaps_s`` every 10 s.
    """

    def __init__(self, drone, hall, map, goals, height_m, speed_m_s, gaps_s):  # noqa: A002, PLR0917  # by name
        self._drone, self._origin = drone, hall.origin
        self._goals = [hall.places[name] for name in goals]
        self._height_m, self._speed_m_s, self._gaps_s = height_m, speed_m_s, gaps_s
        self._grid = OccupancyGrid.load(Path(__file__).parents[1] / map)
        self._localiser = Localiser(self._grid, Pose2(0.0, 0.0, 0.5 * pi), (0.5, 0.5, 0.3))
        self._odometry, self._height, self._word = None, 0.0, ""
        self._sent_at = self._moved_at = 0.0

    def run(self):
        """Fly to the goals, and land at the last one."""
        rospy.init_node("localised_flight")
        drone, origin = self._drone, self._origin
        rospy.Subscriber(f"/{drone.name}/scan", LaserScan, self._take_scan, queue_size=1)
        rospy.Subscriber(f"/{drone.name}/odom", Odometry, self._take_odometry, queue_size=1)
        drone.set_origin(Position(origin.latitude, origin.longitude, AMSL(origin.amsl)))
        drone.wait_ready()
        drone.takeoff(self._height_m)
        for goal in self._goals:
            for x, y in self._way(goal):
                latitude, longitude, amsl = origin.from_enu((x, y, self._height_m))
                drone.goto(Position(latitude, longitude, AMSL(amsl)), speed=self._speed_m_s)
        drone.land()

    def _way(self, goal):
        """Corners of a way to a place, as far from walls as the map allows."""
        here = self._localiser.predict(self._odometry).pose
        clearance = clearance_of(self._grid.occupied, self._grid.resolution)
        ways = WaysFrom(clearance, self._grid.resolution, self._grid.cell(here.x, here.y), CLEARANCE_M)
        cells = ways.straightened(ways.to(self._grid.cell(goal.east_m, goal.north_m)))
        return self._grid.centres(cells)[1:]

    def _take_odometry(self, message):
        now = rospy.get_time()
        if now % 10.0 < self._gaps_s:
            return
        at, turn = message.pose.pose.position, message.pose.pose.orientation
        _, _, yaw = quaternion_to_euler((turn.w, turn.x, turn.y, turn.z))
        self._odometry, self._height, self._moved_at = Pose2(at.x, at.y, yaw), at.z, now
        if now - self._sent_at >= POSE_PERIOD_S:
            self._sent_at = now
            self._tell(message.header.stamp.to_nsec())

    def _tell(self, time):
        """Tell the autopilot where it is, if that is known well enough."""
        here = self._localiser.predict(self._odometry)
        sigma = sqrt(max(here.covariance[0, 0], here.covariance[1, 1]))
        if here.word or sigma > LARGEST_SIGMA_M:
            self._say(here.word or f"its place is known to {sigma:.2f} m only")
            return
        pose = ExternalPose.on_map(
            time, here.pose, here.covariance.tolist(), up=self._height, resets=here.resets
        )
        try:
            self._drone.send_external_pose(pose)
            self._say("")
        except PositionLost as error:
            self._say(str(error))

    def _take_scan(self, message):
        if self._odometry is None:
            return
        volery.add_time(MATCHING_S, at_mhz=AT_MHZ)
        fresh = rospy.get_time() - self._moved_at < ODOMETRY_KEPT_S
        self._localiser.add(self._odometry if fresh else None, scan_of(message))

    def _say(self, word):
        if word != self._word:
            self._word = word
            volery.log(word or "its place is known again", "warning" if word else "info")
