"""Real ROS behind the node interface: ``ros1`` on rospy, ``ros2`` on rclpy.

A transport's graph makes nodes that do what nodes of the embedded graph do; components written against
``volery.ros.graph.Node`` do not notice. What is common to both stands here (``node``, ``topics``, ``services``),
what a ROS client library must offer for it in ``wire``. The client libraries run threads of their own: what
arrives there is handed to the kernel (``Kernel.post``), and what may block there is done aside
(``abroad``). So a transport needs time that does not run ahead of the wall: the clock on the wall, a paced
virtual one, or one that follows ``/clock``.
"""
