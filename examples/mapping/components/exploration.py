"""Exploration: goes from frontier to frontier until the hall is known, comes back and lands.

A ROS node: scans and odometry come over topics, velocities go to the drone, the map goes to ``/map``. The
odometry drifts; where the drone is in its map is found by matching scans.
"""

from __future__ import annotations

from math import cos, degrees, radians, sin

import numpy as np
import rospy
from nav_msgs.msg import OccupancyGrid as MapMessage
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

import volery
from volery.autonomy.avoidance import Motion
from volery.autonomy.explorer import Command, Explorer
from volery.autonomy.laser_scan import scan_of
from volery.autonomy.planar_pose import Pose2
from volery.autonomy.slam import Slam
from volery.base.frames import quaternion_to_euler

MATCHING_S = 0.02
"""Matching a scan and marking its beams at ``AT_MHZ``; charged instead of what it takes here."""
AT_MHZ = 1500
SIGHT_M = 12.0


class Exploration:
    """``height_m`` is above the ground, ``speed_m_s`` the largest speed."""

    def __init__(self, drone, height_m, speed_m_s):
        self._drone, self._height_m = drone, height_m
        motion = Motion(radius=0.35, speed=speed_m_s, acceleration=1.0, delay=0.5, sight=SIGHT_M)
        self._explorer = Explorer(motion)
        self._word = ""
        self._slam = Slam()
        self._odometry, self._scan = None, None
        self._seen, self._ground_m = None, 0.0

    def run(self):
        """Explore, come back, land."""
        rospy.init_node("exploration")
        name = self._drone.name
        rospy.Subscriber(f"/{name}/scan", LaserScan, self._take_scan, queue_size=1)
        rospy.Subscriber(f"/{name}/odom", Odometry, self._take_odometry, queue_size=1)
        shown = rospy.Publisher("/map", MapMessage, queue_size=1, latch=True)
        volery.note("map", "hall", "begun")
        self._drone.wait_ready()
        self._ground_m = self._drone.position.altitude.metres
        self._drone.takeoff(self._height_m)
        rate = rospy.Rate(5.0)
        home = None
        while not rospy.is_shutdown() and not (self._explorer.done and self._explorer.navigator.arrived):
            pose = self._find()
            if pose is not None:
                home = home or pose
                if self._explorer.done:
                    self._explorer.navigator.goal = (home.x, home.y)
                self._go(pose)
            rate.sleep()
        self._drone.land()
        self._slam.finish()
        message = MapMessage()
        message.header.stamp, message.header.frame_id = rospy.Time.now(), "map"
        self._explorer.navigator.grid.fill(message)
        shown.publish(message)
        volery.note("map", "hall", "done")

    def _find(self):
        """Where the drone is in its map, by the last scan; None without a new one."""
        scan, self._scan = self._scan, None
        if scan is None:
            return None
        odometry, scan = scan
        volery.add_time(MATCHING_S, at_mhz=AT_MHZ)
        pose = self._slam.add(odometry, scan)
        self._seen = scan
        return pose

    def _go(self, pose):
        """Command what the explorer wants; the axes of its map are turned against the world's."""
        north, east, _ = self._drone.velocity
        turn = radians(90.0 - self._drone.attitude.heading) - pose.yaw
        velocity = np.array((cos(turn) * east + sin(turn) * north, cos(turn) * north - sin(turn) * east))
        navigator, now = self._explorer.navigator, rospy.Time.now().to_nsec()
        if self._explorer.done:  # home
            command = Command(navigator.update(now, pose, self._seen, velocity), 0.0)
        else:
            command = self._explorer.update(now, pose, self._seen, velocity)
        word = navigator.word
        if word != self._word:
            self._word = word
            volery.log(word)
        x, y = command.velocity
        climb = 0.5 * (self._height_m - (self._drone.position.altitude.metres - self._ground_m))
        self._drone.set_velocity(
            sin(turn) * x + cos(turn) * y, cos(turn) * x - sin(turn) * y, climb, -degrees(command.yaw_rate)
        )

    def _take_odometry(self, message):
        at, turn = message.pose.pose.position, message.pose.pose.orientation
        _, _, yaw = quaternion_to_euler((turn.w, turn.x, turn.y, turn.z))
        self._odometry = Pose2(at.x, at.y, yaw)

    def _take_scan(self, message):
        if self._odometry is not None:
            self._scan = self._odometry, scan_of(message)
