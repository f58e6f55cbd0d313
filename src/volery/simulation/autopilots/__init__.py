"""Simulated autopilots, each behind the wire protocol or the ROS interface of the real one."""
