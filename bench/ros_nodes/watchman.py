"""Answers each attitude that it hears with whether it is safe; has no loop of its own."""

import rospy
from std_msgs.msg import Bool, Float64MultiArray

rospy.init_node("watchman")
verdicts = rospy.Publisher("safe", Bool, queue_size=10)


def on_attitude(message):
    verdicts.publish(Bool(abs(message.data[0]) < 0.5 and abs(message.data[1]) < 0.5))


rospy.Subscriber("attitude", Float64MultiArray, on_attitude, queue_size=10)
rospy.spin()
