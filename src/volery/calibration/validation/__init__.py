"""Validation of estimates: a model's nodes as plain processes of rospy and roscpp on a real ROS master.

A process contains nothing of volery but a meter that records the beginning of ``main``. Its cost is read from
outside, from its own CPU clock.
"""
