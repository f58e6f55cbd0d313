"""Calls that a loop without a wait repeats: they are charged once they are all that an activation does."""

from __future__ import annotations

from volery.base.time import MS, S
from volery.kernel.waiting import FREE_POLLS

TALKER = """
import rclpy
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node("talker")
publisher = node.create_publisher(String, "/words", 1)
node.create_timer(0.05, lambda: publisher.publish(String(data="x")))
rclpy.spin(node)
"""


def test_a_loop_of_spin_once_0_receives_its_messages_in_time(stage):
    stage.script("talker", TALKER)
    stage.script(
        "busy",
        """
        import rclpy
        from std_msgs.msg import String
        rclpy.init()
        node = rclpy.create_node("busy")
        node.create_subscription(String, "/words", lambda m: out(node.get_clock().now().nanoseconds), 1)
        turns = 0
        while rclpy.ok():
            rclpy.spin_once(node, timeout_sec=0)
            turns += 1
            if node.get_clock().now().nanoseconds > 120_000_000:
                break
        out(turns)
        """,
    )
    first, second, turns = stage.run(S)
    assert 50 * MS <= first <= 51 * MS
    assert 100 * MS <= second <= 101 * MS
    assert turns < 0.12 * S / 80_000 + 2 * FREE_POLLS


def test_a_loop_of_rospy_s_calls_lets_callbacks_run(stage):
    stage.component(
        "busy",
        """
rospy.init_node("busy")
got = []
rospy.Timer(rospy.Duration(0.02), got.append, oneshot=True)
while not got:
    before = rospy.get_time()
out(rospy.get_time())
""",
    )
    (end,) = stage.run(S)
    assert 0.02 <= end < 0.021
