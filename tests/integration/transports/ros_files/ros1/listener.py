#!/usr/bin/env python3
"""Hears what the talker says, and repeats it with its own name."""

import rospy
from std_msgs.msg import String


class Listener:
    def __init__(self):
        self.heard = rospy.Publisher("heard", String, queue_size=10)
        while self.heard.get_num_connections() < rospy.get_param("~listeners"):
            rospy.sleep(0.05)
        rospy.Subscriber("chatter", String, self.hear, callback_args="I heard: ")

    def hear(self, message, before):
        rospy.loginfo(rospy.get_caller_id() + " heard %s", message.data)
        self.heard.publish(before + message.data)


if __name__ == "__main__":
    rospy.init_node("listener")
    listener = Listener()
    rospy.spin()
