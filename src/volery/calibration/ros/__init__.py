"""Cost of calls into ROS on the machine at hand: the paper's method, for roscpp, rospy and rclpy.

A probe is a new process of the client library that makes all calls once and prints the readings of its CPU
clocks; a round is the output of one probe. A campaign has as many rounds as the figures require. The cost of
a call is the difference between cycles with it and idle cycles, so it contains the library's threads.
"""
