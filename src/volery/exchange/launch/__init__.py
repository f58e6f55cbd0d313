"""Launch files of ROS 1 and ROS 2: read into a model without executing anything in them, and written."""
