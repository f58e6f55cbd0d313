"""Deployment: for each computer of an allocation a ROS package that hosts the unmodified components.

What is generated is source, launch files and service units. The hosts import volery at run time.
"""
