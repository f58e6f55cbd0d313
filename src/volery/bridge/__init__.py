"""A vehicle on the ROS graph, under MAVROS's names."""
