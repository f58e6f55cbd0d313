"""tf2 with rospy and rclpy, and the older tf."""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import pytest

from volery.base.time import S
from volery.ros.client_libraries.tf2.transform_tree import (
    IDENTITY,
    ExtrapolationException,
    InvalidArgumentException,
    TransformTree,
)

BROADCASTER = """
import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped


def stamped(child, parent, at, x, w=1.0, z=0.0):
    made = TransformStamped(child_frame_id=child)
    made.header.frame_id = parent
    made.header.stamp = rospy.Time.from_sec(at)
    made.transform.translation.x = x
    made.transform.rotation.w, made.transform.rotation.z = w, z
    return made


rospy.init_node("broadcaster")
static = tf2_ros.StaticTransformBroadcaster()
static.sendTransform(stamped("camera", "base", 0.0, 0.5))
static.sendTransform([stamped("laser", "base", 0.0, 0.25)])
moving = tf2_ros.TransformBroadcaster()
rospy.sleep(0.1)  # until others listen: what moves is not kept
moving.sendTransform(stamped("base", "odom", 1.0, 2.0))
moving.sendTransform(stamped("base", "odom", 2.0, 4.0, 0.5 ** 0.5, 0.5 ** 0.5))
moving.sendTransform(stamped("elsewhere", "island", 2.0, 0.0))
"""
ASKING = """
import rospy
import tf2_ros
rospy.init_node("asker")
buffer = tf2_ros.Buffer()
listener = tf2_ros.TransformListener(buffer)


def place(found):
    t, q = found.transform.translation, found.transform.rotation
    return [round(one, 6) for one in (t.x, t.y, t.z, q.w, q.z)]
"""


def test_transforms_are_joined_inverted_and_interpolated(stage: Any) -> None:
    stage.script("broadcaster", BROADCASTER)
    stage.script(
        "asker",
        ASKING
        + """
out(place(buffer.lookup_transform("odom", "camera", rospy.Time(1), rospy.Duration(1))))
out(place(buffer.lookup_transform("odom", "camera", rospy.Time(2))))
out(place(buffer.lookup_transform("camera", "odom", rospy.Time(1))))
out(place(buffer.lookup_transform("odom", "base", rospy.Time.from_sec(1.5))))
out(place(buffer.lookup_transform("camera", "laser", rospy.Time(77))))
latest = buffer.lookup_transform("odom", "laser", rospy.Time(0))
out((place(latest), latest.header.stamp.to_sec(), latest.header.frame_id, latest.child_frame_id))
out(place(buffer.lookup_transform_full("base", rospy.Time(2), "base", rospy.Time(1), "odom")))
""",
    )
    turned = sqrt(0.5)
    found = stage.run(5 * S)
    assert found[0] == [2.5, 0, 0, 1, 0]
    assert found[1] == [4.0, 0.5, 0, round(turned, 6), round(turned, 6)]
    assert found[2] == [-2.5, 0, 0, 1, 0]
    assert found[3] == [3.0, 0, 0, 0.92388, 0.382683]  # an eighth of a turn: cos and sin of 22.5 degrees
    assert found[4] == [-0.25, 0, 0, 1, 0]
    assert found[5] == ([4.0, 0.25, 0, 0.707107, 0.707107], 2.0, "odom", "laser")
    assert found[6] == [0, 2.0, 0, 0.707107, -0.707107]


def test_what_cannot_be_had_is_said_in_tf2s_words(stage: Any) -> None:
    stage.script("broadcaster", BROADCASTER)
    stage.script(
        "asker",
        ASKING
        + """
rospy.sleep(0.5)
for target, source, at in (
    ("odom", "nowhere", 0), ("odom", "island", 0), ("odom", "base", 3), ("odom", "camera", 0.5)
):
    try:
        buffer.lookup_transform(target, source, rospy.Time.from_sec(float(at)))
    except tf2_ros.TransformException as error:
        out((type(error).__name__, str(error)))
began = rospy.get_time()
out(buffer.can_transform("odom", "base", rospy.Time(3), rospy.Duration(2)))
out(round(rospy.get_time() - began, 6))
""",
    )
    lookup, connectivity, future, past, can, took = stage.run(5 * S)
    assert lookup[0] == "LookupException"
    assert '"nowhere" passed to lookupTransform argument source_frame does not exist' in lookup[1]
    assert connectivity[0] == "ConnectivityException"
    assert "not part of the same tree" in connectivity[1]
    assert future == (
        "ExtrapolationException",
        "Lookup would require extrapolation into the future.  Requested time 3.000000 but the latest data "
        "is at time 2.000000, when looking up transform from frame [base] to frame [odom]",
    )
    assert "into the past.  Requested time 0.500000 but the earliest data is at time 1.000000" in past[1]
    assert (can, took) == (False, 2.0)


def test_a_wait_ends_when_the_transform_comes(stage: Any) -> None:
    stage.script("broadcaster", "import rospy\nrospy.init_node('b')\nrospy.sleep(1.25)\n" + BROADCASTER)
    stage.script(
        "asker",
        ASKING
        + """
out(place(buffer.lookup_transform("odom", "base", rospy.Time(0), rospy.Duration(3))))
out(rospy.get_time())
""",
    )
    assert stage.run(5 * S) == [[4.0, 0, 0, 0.707107, 0.707107], 1.35]


def test_rclpy_nodes_publish_and_look_up(stage: Any) -> None:
    stage.script(
        "broadcaster",
        """
import rclpy
from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from tf2_ros import StaticTransformBroadcaster, TransformBroadcaster


class Station(Node):
    def __init__(self):
        super().__init__("station")
        static, self.moving = StaticTransformBroadcaster(self), TransformBroadcaster(self)
        static.sendTransform(self.made("camera", "base"))
        self.create_timer(0.1, lambda: self.moving.sendTransform(self.made("base", "odom")))

    def made(self, child, parent):
        made = TransformStamped(child_frame_id=child)
        made.header.frame_id = parent
        made.header.stamp = self.get_clock().now().to_msg()
        made.transform.translation.x = 1.0
        return made


rclpy.init()
rclpy.spin(Station())
""",
    )
    stage.script(
        "asker",
        """
import rclpy
from geometry_msgs.msg import PointStamped
from rclpy.duration import Duration
from rclpy.time import Time
from tf2_ros import TransformException
from tf2_ros.buffer import Buffer
from tf2_ros.transform_listener import TransformListener
import tf2_geometry_msgs

rclpy.init()
node = rclpy.create_node("asker")
buffer = Buffer()
listener = TransformListener(buffer, node)


def ask():
    try:
        found = buffer.lookup_transform("odom", "camera", Time())
    except TransformException as error:
        out(type(error).__name__)
        return
    point = PointStamped()
    point.header.frame_id = "camera"
    point.header.stamp = found.header.stamp
    point.point.y = 3.0
    moved = tf2_geometry_msgs.do_transform_point(point, found)
    out((moved.point.x, moved.point.y, moved.header.frame_id))
    out(buffer.transform(point, "odom") == moved)


node.create_timer(0.15, ask)
while node.get_clock().now().nanoseconds < 310_000_000:
    rclpy.spin_once(node, timeout_sec=0.05)
waiting = Buffer()
TransformListener(waiting, rclpy.create_node("aside"), spin_thread=True)
out(waiting.can_transform("odom", "base", Time(), Duration(seconds=1)))
""",
    )
    point = (2.0, 3.0, "odom")
    assert stage.run(2 * S) == [point, True, point, True, True]


def test_the_old_tf(stage: Any) -> None:
    stage.script(
        "old",
        f"""
import rospy
import tf
from tf.transformations import euler_from_quaternion, quaternion_from_euler
rospy.init_node("old")
listener, broadcaster = tf.TransformListener(), tf.TransformBroadcaster()
turned = quaternion_from_euler(0.0, 0.0, {pi} / 2)
broadcaster.sendTransform((1, 2, 3), turned, rospy.Time(5), "/base", "/map")
listener.waitForTransform("map", "/base", rospy.Time(0), rospy.Duration(1))
moved, rotation = listener.lookupTransform("map", "base", rospy.Time(0))
out((moved, [round(one, 6) for one in euler_from_quaternion(rotation)]))
try:
    listener.waitForTransform("map", "moon", rospy.Time(0), rospy.Duration(1))
except tf.Exception as error:
    out("moon" in str(error))
try:
    quaternion_from_euler(0, 0, 1, "rzyx")
except Exception as error:
    out("rzyx" in str(error))
""",
    )
    assert stage.run(5 * S) == [([1, 2, 3], [0, 0, 1.570796]), True, True]


@pytest.mark.parametrize(
    "line",
    [
        "from dynamic_reconfigure.server import Server",
        "import dynamic_reconfigure.client as one; one.Client",
    ],
)
def test_a_library_that_is_not_there_is_named(stage: Any, line: str) -> None:
    with pytest.raises(ImportError, match=r"is not there on the embedded graph; (ask|use) rospy"):
        stage.load(line)


def test_old_transforms_are_forgotten_and_wrong_ones_refused() -> None:
    tree = TransformTree(cache=10 * S)
    for second in range(1, 30):
        tree.add("base", "odom", second * S, IDENTITY)
    tree.add("base", "odom", 5 * S, IDENTITY)  # too late to matter
    assert tree.look_up("odom", "base", 19 * S)[0] == 19 * S
    with pytest.raises(ExtrapolationException, match=r"earliest data is at time 19\.0"):
        tree.look_up("odom", "base", 18 * S)
    for child, parent, rigid in (
        ("a", "a", IDENTITY),
        ("", "a", IDENTITY),
        ("/a", "b", IDENTITY),
        ("a", "b", IDENTITY._replace(rotation=(0.0, 0.0, 0.0, 0.0))),
    ):
        with pytest.raises(InvalidArgumentException):
            tree.add(child, parent, S, rigid)
