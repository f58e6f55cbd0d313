"""ROS 1: nodes on a real master, through the installed rospy.

rospy supports one node per process. Each node has its own copy of rospy here (``rospy_copy``), so that a
process may have as many nodes as on the embedded graph. Message classes are built from volery's definitions:
only rospy itself must be installed, no message packages.
"""

from volery.ros.transports.ros1.master import Roscore, master_answers
from volery.ros.transports.ros1.rospy_copy import available
from volery.ros.transports.ros1.rospy_node import ros1_graph

__all__ = ["Roscore", "available", "master_answers", "ros1_graph"]
