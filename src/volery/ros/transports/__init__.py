"""Real ROS behind the node interface: ``ros1`` on rospy, ``ros2`` on rclpy.

A transport's graph makes nodes that behave as those of the embedded graph, so components written against
``volery.ros.graph.Node`` run on all three. Both transports share ``transport_node`` and ``transport_graph``;
``client_library`` states what they need of a ROS client library. The libraries have threads of their own:
messages that arrive there are posted to the kernel (``Kernel.post``), and calls that may block are executed
in threads (``run_in_thread``).
"""
