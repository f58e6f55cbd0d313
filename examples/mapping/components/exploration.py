"""Exploration: goes from frontier to frontier until the hall is known, comes back and lands.

A ROS node: scans and odometry come over topics, velocities go to the drone. The odometry drifts; the
component ``Mapping`` says by the transform from ``map`` to ``odom`` how it stands in the map. Commands do not
wait for it: while a scan is matched, the last transform and the odometry say where the drone is.
"""

from __future__ import annotations

from math import cos, degrees, radians, sin

import numpy as np
import rospy
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

import volery
from volery.autonomy.avoidance import Motion
from volery.autonomy.explorer import ExplorationCommand, Explorer
from volery.autonomy.laser_scan import scan_of
from volery.autonomy.planar_pose import Pose2
from volery.base.frames import quaternion_to_euler

SIGHT_M = 12.0
OLD_S = 0.1
"""Age of the odometry from which on it does not say where a scan was taken."""
PATIENCE_S = 15.0
"""Time without a usable scan after which it lands where it is."""


class Exploration:
    """``height_m`` is above the ground, ``speed_m_s`` the largest speed."""

    def __init__(self, drone, height_m, speed_m_s):
        self._drone, self._height_m = drone, height_m
        motion = Motion(
            radius=0.43, margin=0.08, speed=speed_m_s, acceleration=1.0, delay=0.5, period=0.2, sight=SIGHT_M
        )
        self._explorer = Explorer(motion)
        self._word = ""
        self._origin = None  # the pose of the odometry's frame in the map
        self._odometry, self._scan = None, None
        self._measured = None  # time of the odometry
        self._seen, self._ground_m = None, 0.0
        self._well = None  # when scan and pose were last in order

    def run(self):
        """Explore, come back, land."""
        rospy.init_node("exploration")
        name = self._drone.name
        rospy.Subscriber(f"/{name}/scan", LaserScan, self._take_scan, queue_size=1)
        rospy.Subscriber(f"/{name}/odom", Odometry, self._take_odometry, queue_size=1)
        rospy.Subscriber("/tf", TFMessage, self._take_frames, queue_size=10)
        volery.note("map", "hall", "begun")
        self._drone.wait_ready()
        self._ground_m = self._drone.position.altitude.metres
        self._drone.takeoff(self._height_m)
        rate = rospy.Rate(5.0)
        home = None
        while not rospy.is_shutdown() and not (self._explorer.done and self._explorer.navigator.arrived):
            if self._is_blind():
                volery.log(f"gives up and lands: {self._explorer.navigator.fault}")
                break
            pose = self._find()
            if pose is not None:
                home = home or pose
                if self._explorer.done:
                    self._explorer.navigator.goal = (home.x, home.y)
                self._go(pose)
            rate.sleep()
        self._drone.land()
        volery.note("map", "hall", "done")

    def _is_blind(self):
        """Whether nothing usable has been seen for too long."""
        if not self._explorer.navigator.fault or self._well is None:
            self._well = rospy.Time.now()
        return (rospy.Time.now() - self._well).to_sec() > PATIENCE_S

    def _find(self):
        """Where the drone was in its map at a scan that is new, else where it is; None while not known."""
        if self._origin is None or (self._scan is None and self._seen is None):
            return None
        if self._scan is None:
            return self._origin.after(self._odometry)
        (odometry, self._seen), self._scan = self._scan, None
        return self._origin.after(odometry)

    def _go(self, pose):
        """Command what the explorer wants; the axes of its map are turned against the world's."""
        north, east, _ = self._drone.velocity
        turn = radians(90.0 - self._drone.attitude.heading) - pose.yaw
        velocity = np.array((cos(turn) * east + sin(turn) * north, cos(turn) * north - sin(turn) * east))
        navigator, now = self._explorer.navigator, rospy.Time.now().to_nsec()
        if self._explorer.done:  # home
            command = ExplorationCommand(navigator.update(now, pose, self._seen, velocity), 0.0)
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
        self._odometry, self._measured = Pose2(at.x, at.y, yaw), message.header.stamp

    def _take_scan(self, message):
        if self._odometry is not None and (rospy.Time.now() - self._measured).to_sec() < OLD_S:
            self._scan = self._odometry, scan_of(message)

    def _take_frames(self, message):
        for one in message.transforms:
            if one.header.frame_id == "map":
                at, turn = one.transform.translation, one.transform.rotation
                _, _, yaw = quaternion_to_euler((turn.w, turn.x, turn.y, turn.z))
                self._origin = Pose2(at.x, at.y, yaw)
