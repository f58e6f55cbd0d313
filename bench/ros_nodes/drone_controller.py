"""Ten times a second: hear where the drone is, say where it should go."""

import rospy
from std_msgs.msg import Float64MultiArray

GOAL = (40.0, -25.0, 12.0)
position = [0.0, 0.0, 0.0]


def on_position(message):
    position[:] = message.data[:3]


rospy.init_node("drone_controller")
rospy.Subscriber("position", Float64MultiArray, on_position, queue_size=1)
setpoints = rospy.Publisher("setpoint", Float64MultiArray, queue_size=10)
rate = rospy.Rate(10)
setpoint = Float64MultiArray()
while not rospy.is_shutdown():
    setpoint.data = [0.8 * (goal - here) for goal, here in zip(GOAL, position, strict=True)]
    setpoints.publish(setpoint)
    rate.sleep()
