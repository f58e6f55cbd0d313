"""Fifty times a second: publish the readings of several instruments, each on a topic of its own."""

import rospy
from std_msgs.msg import Float64MultiArray

rospy.init_node("instruments")
readings = [
    rospy.Publisher(f"~reading_{number}", Float64MultiArray, queue_size=10)
    for number in range(rospy.get_param("~topics"))
]
rate = rospy.Rate(50)
reading = Float64MultiArray()
taken = 0.0
while not rospy.is_shutdown():
    taken += 1.0
    reading.data = [taken] * 4
    for publisher in readings:
        publisher.publish(reading)
    rate.sleep()
