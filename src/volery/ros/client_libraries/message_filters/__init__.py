"""``message_filters`` over the faces: messages of several topics that belong together, by their stamps.

Made of what the faces offer, as the real one is of rospy and rclpy: without a node it is rospy's, with one
rclpy's. There are ``Subscriber``, ``Cache``, ``TimeSynchronizer`` and ``ApproximateTimeSynchronizer``.
"""

from volery.ros.client_libraries.message_filters.module import modules

__all__ = ["modules"]
