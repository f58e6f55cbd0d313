"""Estimate against measurement: a model's nodes as plain processes of rospy and roscpp on a real ROS master.

Nothing of volery's runs in them but a meter that notes where ``main`` begins. What they take is read from
outside, from each process's own CPU clock.
"""
