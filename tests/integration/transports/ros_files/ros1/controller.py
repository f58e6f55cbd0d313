#!/usr/bin/env python3
"""Steers to way points: a PID controller on each axis and on yaw, from poses to velocities.

The angle of a quaternion and the shortest way round are taken as they come; gains may change while it runs.
"""

import math

import rospy
from geometry_msgs.msg import PoseStamped, Twist
from std_msgs.msg import Int32

TOLERANCE = 0.05
SQUARE = [(1.0, 0.0, 1.0, 0.0), (1.0, 1.0, 1.0, 90.0), (0.0, 1.0, 1.0, 180.0), (0.0, 0.0, 1.0, -90.0)]


def yaw_of(q):
    return math.degrees(math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z)))


def wrapped(angle):
    return angle - 360.0 * math.ceil((angle - 180.0) / 360.0)


class Pid:
    def __init__(self):
        self.total = 0.0
        self.last = None

    def next(self, error, elapsed, gains):
        self.total += error * elapsed
        slope = (error - self.last) / elapsed if self.last is not None and elapsed > 0 else 0.0
        self.last = error
        return gains["p"] * error + gains["i"] * self.total + gains["d"] * slope


class Controller:
    def __init__(self):
        self.pids = [Pid() for _ in range(4)]
        self.stamp = None
        self.goal = 0
        self.commands = rospy.Publisher("cmd_vel", Twist, queue_size=100)
        self.reached = rospy.Publisher("reached", Int32, queue_size=10)
        while self.reached.get_num_connections() < rospy.get_param("~listeners"):
            rospy.sleep(0.05)
        while self.commands.get_num_connections() < 1 + rospy.get_param("~listeners"):
            rospy.sleep(0.05)
        rospy.Subscriber("pose", PoseStamped, self.steer, queue_size=1)

    def steer(self, pose):
        gains = rospy.get_param("~gains")
        elapsed = (pose.header.stamp - self.stamp).to_sec() if self.stamp else 0.0
        self.stamp = pose.header.stamp
        goal = SQUARE[self.goal % len(SQUARE)]
        at = pose.pose.position
        errors = [goal[0] - at.x, goal[1] - at.y, goal[2] - at.z]
        errors.append(wrapped(goal[3] - yaw_of(pose.pose.orientation)) / 90.0)
        x, y, z, turn = [
            pid.next(error, elapsed, gains) for pid, error in zip(self.pids, errors, strict=True)
        ]
        command = Twist()
        command.linear.x, command.linear.y, command.linear.z = x, y, z
        command.angular.z = turn
        self.commands.publish(command)
        if max(abs(error) for error in errors) < TOLERANCE:
            self.goal += 1
            rospy.loginfo("way point %d is reached", self.goal)
            self.reached.publish(Int32(self.goal))


if __name__ == "__main__":
    rospy.init_node("controller")
    controller = Controller()
    rospy.spin()
