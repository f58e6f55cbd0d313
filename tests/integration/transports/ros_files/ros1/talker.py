#!/usr/bin/env python3
"""Says something ten times a second, as the first of the ROS wiki's tutorials does."""

import contextlib

import rospy
from std_msgs.msg import String


def talk():
    publisher = rospy.Publisher("chatter", String, queue_size=10)
    rospy.init_node("talker", anonymous=True)
    rate = rospy.Rate(10)
    while publisher.get_num_connections() < rospy.get_param("~listeners"):
        rate.sleep()
    number = 0
    while not rospy.is_shutdown():
        text = f"hello, number {number}"
        rospy.loginfo(text)
        publisher.publish(text)
        number += 1
        rate.sleep()


if __name__ == "__main__":
    with contextlib.suppress(rospy.ROSInterruptException):
        talk()
