"""Stands for a ground station, a recorder or a screen: hears what is said of the drone and ignores it."""

import rospy
from std_msgs.msg import Bool, Float64, Float64MultiArray, String


def ignore(message):
    pass


rospy.init_node("station")
rospy.Subscriber("heartbeat", String, ignore)
if rospy.get_param("~screen", False):
    rospy.Subscriber("attitude", Float64MultiArray, ignore)
    rospy.Subscriber("battery", Float64, ignore)
    rospy.Subscriber("safe", Bool, ignore)
rospy.spin()
