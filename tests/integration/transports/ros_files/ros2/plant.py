"""A body that obeys velocities, a step for each command, so that what it does depends on nobody's clock."""

import math

import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.time import Time

STEP = Duration(seconds=0.1)


class Plant(Node):
    def __init__(self):
        super().__init__("plant")
        self.steps = self.declare_parameter("steps", 10).value
        self.listeners = self.declare_parameter("listeners", 1).value
        self.place = [0.0, 0.0, 0.0, 0.0]
        self.stamp = Time()
        self.poses = self.create_publisher(PoseStamped, "pose", 10)
        self.create_subscription(Twist, "cmd_vel", self.obey, 10)
        self.timer = self.create_timer(0.05, self.begin)

    def begin(self):
        if self.poses.get_subscription_count() >= self.listeners and self.count_publishers("cmd_vel"):
            self.timer.cancel()
            self.tell()

    def tell(self):
        pose = PoseStamped()
        pose.header.stamp = self.stamp.to_msg()
        pose.header.frame_id = "world"
        position, turned = pose.pose.position, pose.pose.orientation
        position.x, position.y, position.z = self.place[:3]
        turned.z, turned.w = math.sin(self.place[3] / 2), math.cos(self.place[3] / 2)
        self.poses.publish(pose)

    def obey(self, command):
        speeds = (command.linear.x, command.linear.y, command.linear.z, command.angular.z)
        elapsed = STEP.nanoseconds / 1e9
        self.place = [at + speed * elapsed for at, speed in zip(self.place, speeds, strict=True)]
        self.stamp += STEP
        self.steps -= 1
        if self.steps > 0:
            self.tell()


def main():
    rclpy.init()
    rclpy.spin(Plant())


if __name__ == "__main__":
    main()
