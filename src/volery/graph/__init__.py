"""The ROS graph: nodes, topics, services, parameters, and its embedded implementation."""
