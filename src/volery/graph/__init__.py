"""The ROS graph: the node interface that every transport implements, and its embedded implementation.

Knows the kernel (waiting) and messages. It must not know what a call costs nor how a message travels: both
are asked of two functions that are given from above.
"""
