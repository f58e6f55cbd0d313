#!/usr/bin/env python3
"""Puts together what two cameras see: at the same time, and at nearly the same time."""

import message_filters
import rospy
from geometry_msgs.msg import PointStamped
from std_msgs.msg import String


class Pairs:
    def __init__(self):
        self.found = rospy.Publisher("pairs", String, queue_size=100)
        self.seen = rospy.Publisher("seen", String, queue_size=100)
        while self.found.get_num_connections() < rospy.get_param("~listeners"):
            rospy.sleep(0.05)
        while self.seen.get_num_connections() < 1:
            rospy.sleep(0.05)
        self.left = message_filters.Subscriber("left", PointStamped, queue_size=10)
        self.right = message_filters.Subscriber("right", PointStamped, queue_size=10)
        self.cache = message_filters.Cache(self.left, 3)
        exact = message_filters.TimeSynchronizer([self.left, self.right], 5)
        exact.registerCallback(self.tell, "same")
        near = message_filters.ApproximateTimeSynchronizer([self.left, self.right], 5, 0.025)
        near.registerCallback(self.tell, "near")
        for camera in (self.left, self.right):  # after the filters: they are through with it
            camera.registerCallback(lambda image: self.seen.publish(f"{image.point.x:g}"))

    def tell(self, left, right, how):
        oldest, last = self.cache.getOldestTime(), self.cache.getLastestTime()
        kept = self.cache.getInterval(oldest, last)
        before = self.cache.getElemBeforeTime(left.header.stamp - rospy.Duration(0, 1))
        known = "nothing" if before is None else f"{before.point.x:g}"
        apart = (right.header.stamp - left.header.stamp).to_nsec()
        pair = f"{left.point.x:g} {right.point.x:g}, {apart} ns apart"
        self.found.publish(f"{how}: {pair}; {len(kept)} kept, after {known}")


if __name__ == "__main__":
    rospy.init_node("pairs")
    pairs = Pairs()
    rospy.spin()
