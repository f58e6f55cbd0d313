"""Publish the attitude at 20 Hz and the battery at 2 Hz; subscribe to nothing."""

import math

import rospy
from std_msgs.msg import Float64, Float64MultiArray

rospy.init_node("telemetry")
attitudes = rospy.Publisher("attitude", Float64MultiArray, queue_size=10)
batteries = rospy.Publisher("battery", Float64, queue_size=10)
attitude = Float64MultiArray()
battery = Float64(16.8)
cycle = 0
while not rospy.is_shutdown():
    attitude.data = [0.1 * math.sin(0.05 * cycle), 0.1 * math.cos(0.05 * cycle), 0.0]
    attitudes.publish(attitude)
    if cycle % 10 == 0:
        battery.data -= 0.001
        batteries.publish(battery)
    rospy.sleep(0.05)
    cycle += 1
