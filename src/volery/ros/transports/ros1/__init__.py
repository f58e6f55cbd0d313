"""ROS 1: nodes on a real master, by the real rospy.

rospy knows one node in a process; here each node has a copy of it (``rospy_copy``), so that a process may
hold as many as on the embedded graph. Messages are built from our own definitions: no message package need
be installed, only rospy itself.
"""

from volery.ros.transports.ros1.graph import ros1_graph
from volery.ros.transports.ros1.master import Roscore, master_answers
from volery.ros.transports.ros1.rospy_copy import available

__all__ = ["Roscore", "available", "master_answers", "ros1_graph"]
