"""ROS message types: definitions, values and their ROS 1 and ROS 2 bytes."""
