"""Stands for the aircraft: says where it is ten times a second, hears how its motors should turn."""

import rospy
from std_msgs.msg import Float64MultiArray


def ignore(message):
    pass


rospy.init_node("aircraft")
rospy.Subscriber("motors", Float64MultiArray, ignore)
rospy.Subscriber("setpoint", Float64MultiArray, ignore)
positions = rospy.Publisher("position", Float64MultiArray, queue_size=10)
rate = rospy.Rate(10)
while not rospy.is_shutdown():
    positions.publish(Float64MultiArray(data=[1.0, 2.0, 3.0]))
    rate.sleep()
