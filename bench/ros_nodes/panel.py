"""Receive the readings of all instruments and ignore them."""

import rospy
from std_msgs.msg import Float64MultiArray


def ignore(message):
    pass


rospy.init_node("panel")
for node, topics in (("one_topic", 1), ("three_topics", 3), ("six_topics", 6)):
    for number in range(topics):
        rospy.Subscriber(f"{node}/reading_{number}", Float64MultiArray, ignore)
rospy.spin()
