#!/usr/bin/env python3
"""A body that obeys velocities, a step for each command, so that what it does depends on nobody's clock."""

import math

import rospy
from geometry_msgs.msg import PoseStamped, Twist

STEP_S = 0.1


class Plant:
    def __init__(self):
        self.steps = 0
        self.place = [0.0, 0.0, 0.0, 0.0]
        self.poses = rospy.Publisher("pose", PoseStamped, queue_size=100)
        rospy.Subscriber("cmd_vel", Twist, self.obey)

    def tell(self):
        pose = PoseStamped()
        pose.header.stamp = rospy.Time.from_sec(self.steps * STEP_S)
        pose.header.frame_id = "world"
        position, turned = pose.pose.position, pose.pose.orientation
        position.x, position.y, position.z = self.place[:3]
        turned.z, turned.w = math.sin(self.place[3] / 2), math.cos(self.place[3] / 2)
        self.poses.publish(pose)

    def obey(self, command):
        speeds = (command.linear.x, command.linear.y, command.linear.z, command.angular.z)
        self.place = [at + speed * STEP_S for at, speed in zip(self.place, speeds, strict=True)]
        self.steps += 1
        if self.steps < rospy.get_param("~steps"):
            self.tell()


if __name__ == "__main__":
    rospy.init_node("plant")
    plant = Plant()
    while plant.poses.get_num_connections() < rospy.get_param("~listeners"):
        rospy.sleep(0.05)
    plant.tell()
    rospy.spin()
