"""message_filters over the client libraries; the same file is compared with the real one on real ROS."""

from __future__ import annotations

from typing import Any

import pytest

TALK = """
rospy.init_node("talker")
def pose(topic, *stamps):
    publisher = rospy.Publisher(topic, PointStamped, queue_size=10)
    for sec, nsec in stamps:
        message = PointStamped()
        message.header.stamp = rospy.Time(sec, nsec)
        publisher.publish(message)
"""
IMPORTS = """
import message_filters
import rospy
from geometry_msgs.msg import PointStamped
from std_msgs.msg import String
"""


def listened(stage: Any, filters: str, talk: str) -> list[Any]:
    """A node with *filters* receives what another node publishes a second later."""
    stage.script(
        "listener",
        f"{IMPORTS}\nrospy.init_node('listener')\n"
        "def report(*messages):\n    out([one.header.stamp.to_nsec() for one in messages])\n"
        f"{filters}\nrospy.spin()\n",
    )
    stage.script("talker", f"{IMPORTS}\n{TALK}\nrospy.sleep(1)\n{talk}\n")
    stage.run()
    return list(stage.out)


BOTH = "both = [message_filters.Subscriber(name, PointStamped) for name in ('a', 'b')]\n"


def test_messages_of_the_same_stamp_belong_together(stage: Any) -> None:
    filters = f"{BOTH}message_filters.TimeSynchronizer(both, 5).registerCallback(report)"
    talk = "pose('a', (1, 0), (2, 0), (3, 0))\npose('b', (2, 0), (4, 0), (1, 0))"
    assert listened(stage, filters, talk) == [[2_000_000_000] * 2, [1_000_000_000] * 2]


def test_a_full_queue_gives_up_the_oldest_stamp(stage: Any) -> None:
    filters = f"{BOTH}message_filters.TimeSynchronizer(both, 2).registerCallback(report)"
    talk = "pose('a', (3, 0), (1, 0), (2, 0))\npose('b', (1, 0), (2, 0), (3, 0))"
    assert listened(stage, filters, talk) == [[2_000_000_000] * 2, [3_000_000_000] * 2]


def test_the_nearest_within_the_slop_belong_together(stage: Any) -> None:
    filters = f"{BOTH}message_filters.ApproximateTimeSynchronizer(both, 5, 0.1).registerCallback(report)"
    talk = "pose('a', (1, 0), (1, 60_000_000), (2, 0)); pose('b', (1, 50_000_000), (2, 100_000_000))"
    assert listened(stage, filters, talk) == [[1_060_000_000, 1_050_000_000]]  # 0.1 s are too much


def test_without_a_header_it_is_of_when_it_came_if_that_is_allowed(stage: Any) -> None:
    filters = """
words = [message_filters.Subscriber(name, String) for name in ("c", "d")]
near = message_filters.ApproximateTimeSynchronizer(words, 5, 0.1, allow_headerless=True)
near.registerCallback(lambda one, other, more: out(one.data + other.data + more), "!")
cache = message_filters.Cache(words[0], 5)
"""
    talk = """
publishers = [rospy.Publisher(name, String, queue_size=10) for name in ("c", "d")]
rospy.sleep(1)
for publisher in publishers:
    publisher.publish("a word")
rospy.sleep(1)
"""
    assert listened(stage, filters, talk) == ["a worda word!"]
    warned = [event.text for event in stage.events if "without a 'header'" in getattr(event, "text", "")]
    assert len(warned) == 1  # the cache was hidden that it may


def test_with_a_node_first_it_is_rclpys(stage: Any) -> None:
    stage.script(
        "listener",
        """
import rclpy
import message_filters
from geometry_msgs.msg import PointStamped
rclpy.init()
node = rclpy.create_node("listener")
left = message_filters.Subscriber(node, PointStamped, "left", qos_profile=10)
cache = message_filters.Cache(left, 2)
publisher = node.create_publisher(PointStamped, "left", 10)
for sec in (3, 1, 2):
    message = PointStamped()
    message.header.stamp.sec = sec
    publisher.publish(message)
    rclpy.spin_once(node)
out((left.getTopic(), cache.getOldestTime().nanoseconds, cache.getLatestTime().nanoseconds))
after = cache.getElemAfterTime(rclpy.time.Time(seconds=2, nanoseconds=1))
out((after.header.stamp.sec, cache.getElemBeforeTime(rclpy.time.Time(seconds=1)), cache.getLast() is after))
""",
    )
    stage.run()
    assert stage.out == [("left", 2_000_000_000, 3_000_000_000), (3, None, True)]


def test_what_is_not_there_says_so(stage: Any) -> None:
    with pytest.raises(AttributeError, match=r"message_filters\.ChainFilter is not there"):
        stage.load("import message_filters\nmessage_filters.ChainFilter\n")
