#!/usr/bin/env python3
"""Two cameras that see the same things, the right one a little later, now more and now less.

Each image waits until the one before has been seen: what arrives on two topics has no order by itself.
"""

import contextlib

import rospy
from geometry_msgs.msg import PointStamped
from std_msgs.msg import String

LATER = (0, 10_000_000, 30_000_000, 0, 20_000_000)


def look():
    rospy.init_node("cameras")
    eyes = [rospy.Publisher(name, PointStamped, queue_size=10) for name in ("left", "right")]
    seen = []
    rospy.Subscriber("seen", String, seen.append)
    rate = rospy.Rate(40)
    while any(eye.get_num_connections() < rospy.get_param("~pairs") for eye in eyes):
        rate.sleep()
    number = sent = 0
    while not rospy.is_shutdown():
        for eye, later in zip(eyes, (0, LATER[number % len(LATER)]), strict=True):
            image = PointStamped()
            image.header.stamp = rospy.Time(100 + number // 10, number % 10 * 100_000_000 + later)
            image.point.x = number
            eye.publish(image)
            sent += 1
            while len(seen) < sent:
                rate.sleep()
        number += 1


if __name__ == "__main__":
    with contextlib.suppress(rospy.ROSInterruptException):
        look()
