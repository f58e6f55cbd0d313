"""ROS 2: nodes on real DDS, by the real rclpy of whatever installation this Python sees.

Messages cross as CDR bytes, which are the same on both sides; rclpy's own classes are used where it leaves no
choice, in services. rclpy knows the types that are installed as packages with it, and no others.
"""

from volery.ros.transports.ros2.graph import available, ros2_graph
from volery.ros.transports.ros2.rclpy_types import carried

__all__ = ["available", "carried", "ros2_graph"]
