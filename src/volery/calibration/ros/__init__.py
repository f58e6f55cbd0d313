"""What calls into ROS cost on the machine at hand: the paper's method, for roscpp, rospy and rclpy.

A *probe* is one fresh process of the client library that goes through everything once and prints what its CPU
clocks said; a *round* is what one probe said. A campaign is as many rounds as it takes. What a call costs is
the difference between cycles with it and idle cycles, so that the library's threads are in it.
"""
