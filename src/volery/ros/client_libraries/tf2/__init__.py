"""``tf2_ros``, ``tf2_geometry_msgs`` and ``tf`` over the faces: transforms on ``/tf`` and ``/tf_static``.

Made of what the faces offer, as the real ones are of rospy and rclpy: without a node they are rospy's, with
one rclpy's. Differences on purpose: a wait for a transform ends at the instant at which it can be had, not at
the next look; frames travel as topics do here, so a broadcast costs what a publish does.
"""

from volery.ros.client_libraries.tf2.module import modules

__all__ = ["modules"]
