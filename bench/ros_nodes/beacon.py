"""Five times a second: here I am, to everybody who listens."""

import rospy
from std_msgs.msg import String

rospy.init_node("beacon")
heartbeats = rospy.Publisher("heartbeat", String, queue_size=10)
rate = rospy.Rate(5)
heartbeat = String("drone_1: flying")
while not rospy.is_shutdown():
    heartbeats.publish(heartbeat)
    rate.sleep()
