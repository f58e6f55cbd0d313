"""A screen on the ground: it takes the drone's pose and pictures, and says how old the pictures are."""

from __future__ import annotations

import rospy
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import Image
from std_msgs.msg import Float32


class Viewer:
    """Publishes the age of each picture [s] on ``/picture_age``."""

    def __init__(self, drone):
        self._drone = drone
        self._ages = None
        self.pose = None

    def run(self):
        """Take poses and pictures until the end."""
        rospy.init_node("viewer")
        self._ages = rospy.Publisher("/picture_age", Float32, queue_size=10)
        rospy.Subscriber(f"/{self._drone.name}/camera/image_raw", Image, self._take, queue_size=1)
        rospy.Subscriber("/slam_out_pose", PoseStamped, self._take_pose, queue_size=1)
        rospy.spin()

    def _take(self, picture):
        self._ages.publish((rospy.Time.now() - picture.header.stamp).to_sec())

    def _take_pose(self, pose):
        self.pose = pose
