"""A client of Debian's actionlib: one goal that is reached and one that is cancelled on the way."""

import json
import sys

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal
from std_msgs.msg import Empty

rospy.init_node("driver")
client = actionlib.SimpleActionClient("drive", MoveBaseAction)
leave = rospy.Publisher("leave", Empty, queue_size=1, latch=True)
assert client.wait_for_server(rospy.Duration(40))
reported = []


def went(metres, cancelled):
    reported.clear()
    goal = MoveBaseGoal()
    goal.target_pose.pose.position.x = metres

    def report(feedback):
        reported.append(feedback.base_position.pose.position.x)
        if cancelled and len(reported) == 3:
            client.cancel_goal()

    client.send_goal(goal, feedback_cb=report)
    assert client.wait_for_result(rospy.Duration(40))
    return GoalStatus.to_string(client.get_state()), client.get_goal_status_text(), reported[:3]


sys.stdout.write(json.dumps([went(3.0, False), went(1000.0, True)]))
leave.publish()
rospy.sleep(1.0)
