"""Client libraries over the graph (rospy, rclpy, roscpp, tf2, message_filters) for unmodified user files.

The package knows the graph, messages and the kernel's waiting. It must not know models, costs or vehicles,
and it loads no files: it returns module objects, which the loader of a file installs in place of the real
ones.
"""
