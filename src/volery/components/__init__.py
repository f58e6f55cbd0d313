"""A user's file becomes a running task: Python, files written for ROS, C++."""
