"""Real ROS 1 and ROS 2 behind the node interface. Not there yet."""
