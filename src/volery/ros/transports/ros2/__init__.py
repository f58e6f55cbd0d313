"""ROS 2: nodes on real DDS, through the rclpy of the installation that this Python finds.

Messages cross as CDR bytes, which are the same on both sides; rclpy's own classes are used only in services,
where it requires them. rclpy supports the types of installed packages; other types are carried as bytes
(``rclpy_types``).
"""

from volery.ros.transports.ros2.graph import available, ros2_graph
from volery.ros.transports.ros2.rclpy_types import carried

__all__ = ["available", "carried", "ros2_graph"]
