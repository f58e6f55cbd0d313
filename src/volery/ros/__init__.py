"""ROS without vehicles: messages, the embedded graph, client libraries and transports to real ROS 1 and 2."""
