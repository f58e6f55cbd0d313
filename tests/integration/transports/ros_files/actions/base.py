"""An action server on actionlib: drives to a goal in steps of 1 m, each reported."""

import actionlib
import rospy
from move_base_msgs.msg import MoveBaseAction, MoveBaseFeedback
from std_msgs.msg import Empty


def drive(goal):
    feedback = MoveBaseFeedback()
    while feedback.base_position.pose.position.x < goal.target_pose.pose.position.x:
        if server.is_preempt_requested():
            server.set_preempted(text="stopped on the way")
            return
        rospy.sleep(0.1)  # actionlib's client drops feedback that comes before its send_goal has returned
        feedback.base_position.pose.position.x += 1.0
        server.publish_feedback(feedback)
    server.set_succeeded(text="arrived")


rospy.init_node("base")
server = actionlib.SimpleActionServer("drive", MoveBaseAction, drive, auto_start=False)
server.start()
rospy.wait_for_message("leave", Empty)
