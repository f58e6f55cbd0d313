"""tf2 with rospy and rclpy, and the older tf."""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import pytest

from volery.base.errors import UsageError
from volery.base.time import S
from volery.ros.client_libraries.tf2 import tf
from volery.ros.client_libraries.tf2.transform_tree import (
    IDENTITY,
    ConnectivityException,
    ExtrapolationException,
    InvalidArgumentException,
    LookupException,
    RigidTransform,
    TransformTree,
)
from volery.ros.graph.unserved import KnownParticipants
from volery.trace.events import Text

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
        "Lookup would require extrapolation 1.000000000s into the future.  Requested time 3.000000000 but "
        "the latest data is at time 2.000000000, when looking up transform from frame [base] to frame [odom]",
    )
    assert (
        "into the past.  Requested time 0.500000000 but the earliest data is at time 1.000000000" in past[1]
    )
    assert (can, took) == (False, 2.0)


def test_a_wait_ends_when_the_transform_comes(stage: Any) -> None:
    stage.script(
        "broadcaster", "import rospy\nrospy.init_node('broadcaster')\nrospy.sleep(1.25)\n" + BROADCASTER
    )
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
    quaternion_from_euler(0, 0, 1, "rzzx")
except Exception as error:
    out("rzzx" in str(error))
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
    assert tree.add("base", "odom", 5 * S, IDENTITY).startswith("TF_OLD_DATA")
    for child, parent, rotation, said in (
        ("a", "a", (1.0, 0.0, 0.0, 0.0), "TF_SELF_TRANSFORM"),
        ("", "a", (1.0, 0.0, 0.0, 0.0), "TF_NO_CHILD_FRAME_ID"),
        ("a", "", (1.0, 0.0, 0.0, 0.0), "TF_NO_FRAME_ID"),
        ("a", "b", (0.0, 0.0, 0.0, 0.0), "TF_DENORMALIZED_QUATERNION"),
        ("a", "b", (2.0, 0.0, 0.0, 0.0), "TF_DENORMALIZED_QUATERNION"),
        ("a", "b", (1.0, float("nan"), 0.0, 0.0), "TF_NAN_INPUT"),
        ("/a", "/b", (1.0005, 0.0, 0.0, 0.0), ""),
    ):
        problem = tree.add(child, parent, S, IDENTITY._replace(rotation=rotation))
        assert problem.partition(":")[0] == said
    assert tree.look_up("b", "a", S)[1].rotation == (1.0005, 0.0, 0.0, 0.0)
    with pytest.raises(InvalidArgumentException, match="cannot start with a '/'"):
        tree.look_up("/b", "a", S)


def moved(x: float) -> RigidTransform:
    return IDENTITY._replace(translation=(x, 0.0, 0.0))


def test_a_change_of_the_parent_leaves_the_past_with_the_old_one() -> None:
    """As Debian's tf2 0.7.6 answers to the same calls."""
    tree = TransformTree(cache=100 * S)
    tree.add("rover", "map", 0, moved(100.0), static=True)
    tree.add("drone", "map", 0, moved(200.0), static=True)
    tree.add("parcel", "rover", 1 * S, IDENTITY)
    tree.add("parcel", "rover", 2 * S, IDENTITY)
    tree.add("parcel", "drone", 4 * S, moved(-1.0))

    def x(source: str, target: str, at: float) -> float:
        return tree.look_up(target, source, int(at * S))[1].translation[0]

    assert [x("parcel", "map", at) for at in (1.5, 3.0, 3.9, 4.0, 0)] == [100.0, 100.0, 100.0, 199.0, 199.0]
    assert x("map", "parcel", 3.0) == -100.0
    assert [x("parcel", "rover", at) for at in (3.0, 0)] == [0.0, 99.0]
    with pytest.raises(ExtrapolationException, match=r"0\.500000000s into the future"):
        x("parcel", "map", 4.5)
    tree.add("parcel", "drone", 5 * S, moved(-1.0))
    assert x("parcel", "map", 4.5) == 199.0


def test_one_stamp_twice_and_what_a_frame_was_first() -> None:
    one, two = TransformTree(), TransformTree(ros2=True)
    for tree in (one, two):
        tree.add("twice", "map", S, moved(1.0))
        tree.add("twice", "map", S, moved(2.0))
    found = [tree.look_up("map", "twice", S)[1].translation[0] for tree in (one, two)]
    assert found == [1.0, 2.0]
    one.add("fixed", "map", S, IDENTITY, static=True)
    one.add("fixed", "odom", 2 * S, moved(7.0))
    assert one.look_up("odom", "fixed", 99 * S)[1].translation[0] == 7.0
    with pytest.raises(ConnectivityException):
        one.look_up("map", "fixed", S)
    one.add("a", "b", S, IDENTITY)
    one.add("b", "a", S, IDENTITY)
    one.add("x", "y", S, IDENTITY)
    with pytest.raises(LookupException, match="contains a loop"):
        one.look_up("y", "a", S)


def test_transformations_are_those_of_tf() -> None:
    """Values of Debian's tf 1.13.2."""
    found = tf.quaternion_from_euler(1.0, 2.0, 3.0, "ryxz")
    assert found == pytest.approx((0.310622, -0.718287, 0.444435, 0.435953), abs=1e-6)
    for axes in ("sxyz", "szxy", "rxyz", "ryxz", "sxyx", "szyz", "rxzx", "ryzy"):
        angles = tf.euler_from_matrix(tf.euler_matrix(0.4, -0.5, 0.6, axes), axes)
        assert tf.is_same_transform(tf.euler_matrix(*angles, axes), tf.euler_matrix(0.4, -0.5, 0.6, axes))
    turned = tf.quaternion_from_matrix(tf.rotation_matrix(2.5, (0.0, 3.0, 4.0)))
    assert turned == pytest.approx(tf.quaternion_about_axis(2.5, (0.0, 3.0, 4.0)))
    half = tf.quaternion_slerp((0.0, 0.0, 0.0, 1.0), turned, 0.5)
    assert half == pytest.approx(tf.quaternion_about_axis(1.25, (0.0, 3.0, 4.0)))
    with pytest.raises(UsageError, match="s \\(static\\) or r"):
        tf.euler_matrix(0.0, 0.0, 0.0, "sxxy")


def test_a_buffer_tells_of_its_frames_and_logs_what_it_ignores(stage: Any) -> None:
    stage.script(
        "asker",
        """
import rospy
import tf
import tf2_geometry_msgs
import tf2_ros
from geometry_msgs.msg import PointStamped, PoseWithCovarianceStamped, QuaternionStamped, TransformStamped
from tf.msg import tfMessage
rospy.init_node("asker")
old = tf.TransformListener()
made = TransformStamped(child_frame_id="base")
made.header.frame_id, made.header.stamp = "/odom", rospy.Time(1)
made.transform.translation.x = 2.0
made.transform.rotation.w, made.transform.rotation.z = 0.5 ** 0.5, 0.5 ** 0.5
for _ in range(3):
    old.setTransform(made)
out(old.allFramesAsString())
point = PointStamped()
point.header.frame_id, point.header.stamp, point.point.x = "base", rospy.Time(1), 1.0
moved = old.transformPoint("odom", point).point
out([round(one, 6) for one in (moved.x, moved.y, moved.z)])
turned = QuaternionStamped(header=point.header)
turned.quaternion.w = 1.0
out(round(old.transformQuaternion("odom", turned).quaternion.z, 6))
out(old.asMatrix("odom", point.header).round(6).tolist()[:2])
out(old.getLatestCommonTime("odom", "base").to_sec())
estimate = PoseWithCovarianceStamped(header=point.header)
estimate.pose.covariance[0] = 4.0
estimate.pose.pose.orientation.w = 1.0
found = tf2_geometry_msgs.do_transform_pose_with_covariance_stamped(estimate, made)
out([round(found.pose.covariance[at], 6) for at in (0, 7)])
try:
    tf2_ros.TransformRegistration().get(TransformStamped)
except tf2_ros.TypeException as error:
    out("register a function" in str(error))
out(tfMessage(transforms=[made]).transforms[0].child_frame_id)
""",
    )
    assert stage.run(5 * S) == [
        "Frame base exists with parent odom.\n",
        [2.0, 1.0, 0.0],
        0.707107,
        [[0.0, -1.0, 0.0, 2.0], [1.0, 0.0, 0.0, 0.0]],
        1.0,
        [0.0, 4.0],
        True,
        "base",
    ]
    logged = [one.text for one in stage.of(Text)]
    assert logged == [
        "TF_REPEATED_DATA ignoring data with redundant timestamp for frame base at time 1.000000"
    ]


def test_a_transform_that_is_never_there_is_named_at_the_end(stage):
    stage.script(
        "seeker",
        """
        import rospy, tf2_ros
        rospy.init_node("seeker")
        buffer = tf2_ros.Buffer()
        for _ in range(3):
            buffer.can_transform("map", "base", rospy.Time(0), rospy.Duration(0.1))
        """,
    )
    stage.run()
    (one,) = stage.graph.unserved(KnownParticipants(["seeker"]))
    assert (one.kind, one.name, one.times) == ("transform", "transform from base to map", 3)
    assert one.hint == "no node publishes /tf"
