"""``tf2_ros``, ``tf2_geometry_msgs`` and ``tf``: transforms on ``/tf`` and ``/tf_static``.

Built on the client libraries, as the real ones are: without a node on rospy, with a node on rclpy. Intended
differences: a wait for a transform ends at the instant at which the transform is available, not at the next
poll; transforms are ordinary messages of the graph, so a broadcast costs the same as a publish.
"""

from volery.ros.client_libraries.tf2.module import modules

__all__ = ["modules"]
