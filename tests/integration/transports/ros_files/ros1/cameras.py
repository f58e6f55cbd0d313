#!/usr/bin/env python3
"""Two cameras that see the same things, the right one a little later, now more and now less."""

import contextlib

import rospy
from geometry_msgs.msg import PointStamped

LATER = (0, 10_000_000, 30_000_000, 0, 20_000_000)


def look():
    rospy.init_node("cameras")
    eyes = [rospy.Publisher(name, PointStamped, queue_size=10) for name in ("left", "right")]
    rate = rospy.Rate(40)
    while any(eye.get_num_connections() < rospy.get_param("~pairs") for eye in eyes):
        rate.sleep()
    number = 0
    while not rospy.is_shutdown():
        for eye, later in zip(eyes, (0, LATER[number % len(LATER)]), strict=True):
            seen = PointStamped()
            seen.header.stamp = rospy.Time(100 + number // 10, number % 10 * 100_000_000 + later)
            seen.point.x = number
            eye.publish(seen)
            rate.sleep()
        number += 1


if __name__ == "__main__":
    with contextlib.suppress(rospy.ROSInterruptException):
        look()
