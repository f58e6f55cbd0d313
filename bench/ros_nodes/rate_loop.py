"""Fifty times a second: follow the latest set-point, publish motor commands."""

import rospy
from std_msgs.msg import Float64MultiArray

wanted = [0.0]


def on_setpoint(message):
    wanted[0] = message.data[0]


rospy.init_node("rate_loop")
rospy.Subscriber("setpoint", Float64MultiArray, on_setpoint, queue_size=1)
motors = rospy.Publisher("motors", Float64MultiArray, queue_size=10)
rate = rospy.Rate(50)
turning = Float64MultiArray()
actual = 0.0
while not rospy.is_shutdown():
    actual += 0.02 * (wanted[0] - actual)
    turning.data = [actual] * 4
    motors.publish(turning)
    rate.sleep()
