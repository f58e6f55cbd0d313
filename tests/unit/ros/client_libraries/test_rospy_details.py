"""rospy beyond topics and services: its log, messages of any type, its smaller modules."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from volery.base.time import S
from volery.ros import messages
from volery.trace.events import Text

LATE = """
from std_msgs.msg import String
rospy.init_node("talker")
rospy.sleep(1)
publisher = rospy.Publisher("chatter", String, latch=True)
publisher.publish("hi")
rospy.spin()
"""
INFO, ERROR = 2, 8


def test_the_log_is_a_topic_for_who_listens(stage: Any) -> None:
    stage.component(
        "station",
        """
from rosgraph_msgs.msg import Log
rospy.init_node("station")
def receive(one):
    out((one.level, one.name, one.msg, one.line, one.header.stamp.to_sec()))
rospy.Subscriber("/rosout", Log, receive)
rospy.spin()
""",
    )
    stage.component(
        "robot",
        """
rospy.init_node("robot")
rospy.sleep(1)
rospy.loginfo("battery at %d %%", 80)
rospy.logdebug("hidden")
rospy.logerr_throttle(10, "hot")
rospy.logerr_throttle(10, "hot")
""",
    )
    lines = stage.run(3 * S)
    assert [(one[0], one[1], one[2], one[4]) for one in lines] == [
        (INFO, "/robot", "battery at 80 %", 1.0),
        (ERROR, "/robot", "hot", 1.0),
    ]
    assert lines[1][3] == lines[0][3] + 2
    assert {"/rosout"} == {one.name for one in stage.graph.topics()}


def test_without_a_listener_there_is_no_rosout(stage: Any) -> None:
    stage.component("robot", "rospy.init_node('robot')\nrospy.loginfo('on')\nrospy.sleep(1)")
    stage.run(S)
    assert stage.graph.topics() == []
    assert [event.text for event in stage.of(Text)] == ["on"]


def test_messages_of_any_type(stage: Any) -> None:
    stage.component(
        "relay",
        """
rospy.init_node("relay")
def receive(message):
    header = message._connection_header
    out((header["type"], header["topic"], message._buff))
rospy.Subscriber("chatter", rospy.AnyMsg, receive)
rospy.spin()
""",
    )
    stage.component("talker", LATE)
    assert stage.run(5 * S) == [("std_msgs/String", "/chatter", b"\2\0\0\0hi")]


def test_rospys_smaller_modules(stage: Any) -> None:
    stage.component(
        "node",
        """
from rospy.numpy_msg import numpy_msg
from rospy.rostime import Time
from std_msgs.msg import Float32MultiArray
rospy.init_node("node")
rospy.Subscriber("data", numpy_msg(Float32MultiArray), lambda one: out(type(one.data).__name__))
rospy.Publisher("data", numpy_msg(Float32MultiArray)).publish(data=[1.0, 2.5])
out(Time(3).to_sec())
rospy.sleep(1)
""",
    )
    assert stage.run(2 * S) == [3.0, "ndarray"]


def test_what_rospy_does_before_init_node(stage: Any) -> None:
    stage.component(
        "early",
        """
from std_msgs.msg import String
rospy.set_param("/speed", 3)
out(rospy.get_param("/speed"))
publisher = rospy.Publisher("chatter", String, queue_size=1)
for misused in (lambda: publisher.publish("too early"), rospy.get_time):
    try:
        misused()
    except rospy.ROSException as error:
        out(type(error).__name__)
rospy.init_node("early")
publisher.publish("in time")
out((rospy.search_param("speed"), rospy.search_param("slowness"), rospy.get_param_cached("speed")))
""",
    )
    assert stage.run(S) == [3, "ROSException", "ROSInitException", ("/speed", None, 3)]


def test_times_are_cut_as_genpy_cuts_them(stage: Any) -> None:
    stage.component(
        "node",
        """
rospy.init_node("node")
out([rospy.Time.from_sec(one).to_nsec() for one in (0.3, 1.1, 2.3)])
out((rospy.Duration(2.3).to_sec(), rospy.Time(1, 100_000_000).to_time(), rospy.Rate(60).sleep_dur.to_nsec()))
""",
    )
    nanoseconds, seconds = stage.run(S)
    assert nanoseconds == [300_000_000, 1_100_000_000, 2_299_999_999]  # as genpy 0.6.16 has them
    assert seconds == (2.299999999, 1.1, 16_666_666)


def test_a_publisher_is_told_of_its_subscribers(stage: Any) -> None:
    stage.component(
        "talker",
        """
from std_msgs.msg import String
class Listener(rospy.SubscribeListener):
    def peer_subscribe(self, topic_name, topic_publish, peer_publish):
        out((topic_name, round(rospy.get_time(), 3)))
        peer_publish(String("welcome"))
    def peer_unsubscribe(self, topic_name, num_peers):
        out((topic_name, num_peers))
rospy.init_node("talker")
rospy.Publisher("chatter", String, subscriber_listener=Listener(), queue_size=1)
rospy.spin()
""",
    )
    for name, late in (("one", 1), ("two", 2)):
        stage.component(
            name,
            f"""
from std_msgs.msg import String
rospy.init_node("{name}")
rospy.sleep({late})
kept = rospy.Subscriber("chatter", String, lambda one: out(("{name}", one.data)))
rospy.sleep(2)
kept.unregister()
""",
        )
    assert stage.run(5 * S) == [
        *(("/chatter", 1.0), ("one", "welcome"), ("/chatter", 2.0), ("two", "welcome")),
        *(("/chatter", 1), ("/chatter", 0)),
    ]


def test_the_master_and_names(stage: Any) -> None:
    stage.component(
        "node",
        """
import rosgraph
import rosgraph.names
from rospy.core import is_initialized
from rospy.names import canonicalize_name
from std_msgs.msg import String
out(is_initialized())
rospy.init_node("node")
rospy.Publisher("chatter", String, queue_size=1)
master = rospy.get_master()
master["/height"] = 3
out((master["/height"], "/nothing" in master, rosgraph.Master("/node").getParam("/height")))
out(master.getPublishedTopics("/"))
out(rosgraph.Master("/node").getSystemState()[0])
out([rosgraph.names.ns_join("/a", "b"), rosgraph.names.namespace("/a/b"), canonicalize_name("/a//b/")])
for wrong in (lambda: master.lookupNode("/node"), lambda: rosgraph.Master("/node").getParam("/none")):
    try:
        wrong()
    except (AttributeError, rosgraph.MasterError) as error:
        out((type(error).__name__, str(error)[:60]))
timer = rospy.Timer(rospy.Duration(0.5), lambda event: out("tick"), oneshot=True)
out(timer.is_alive())
timer.join()
out((timer.is_alive(), rospy.get_time()))
out(issubclass(rospy.TransportTerminated, rospy.ROSInternalException))
""",
    )
    found = stage.run(5 * S)
    assert found[:2] == [False, (3, False, 3)]
    assert found[2] == (1, "getPublishedTopics", [["/chatter", "std_msgs/String"]])
    assert found[3:5] == [[["/chatter", ["/node"]]], ["/a/b", "/a/", "/a/b"]]
    assert found[5][1].startswith("rosgraph.Master.lookupNode is not there")
    assert found[6][0] == "MasterError"
    assert found[7:] == [True, "tick", (False, 0.5), True]


def test_clouds_and_tests(stage: Any) -> None:
    stage.component(
        "node",
        """
import unittest
import rostest
from sensor_msgs.point_cloud2 import create_cloud, create_cloud_xyz32, read_points, read_points_list
from sensor_msgs.msg import PointField
from std_msgs.msg import Header
rospy.init_node("node")
cloud = create_cloud_xyz32(Header(frame_id="map"), [(1.0, 2.0, 3.0), (4.0, float("nan"), 6.0)])
out((cloud.width, cloud.height, cloud.point_step, cloud.row_step, [one.name for one in cloud.fields]))
out(list(read_points(cloud, ("z", "x"), skip_nans=True)))
out([(one.x, one.z) for one in read_points_list(cloud)])
fields = [PointField("a", 0, PointField.UINT8, 1), PointField("b", 4, PointField.INT16, 2)]
cloud = create_cloud(Header(), fields, [(200, -3, 4)])
out(list(read_points(cloud, uvs=[(0, 0)])))
class Case(unittest.TestCase):
    def test_good(self):
        self.assertTrue(rostest.is_publisher("chatter", "node") is False)
    def test_wrong(self):
        self.assertEqual(1, 2)
try:
    rostest.rosrun("package", "name", Case)
except SystemExit as end:
    out(end.code)
""",
    )
    assert stage.run(5 * S) == [
        (2, 1, 12, 24, ["x", "y", "z"]),
        [(1.0, 3.0), (4.0, 6.0)],  # Debian's answer: in the order of the offsets
        [(1.0, 3.0), (4.0, 6.0)],
        [(200, -3, 4)],
        1,
    ]
    logged = [one.text for one in stage.of(Text)]
    assert logged[0] == "[test_good] ... ok"
    assert logged[-1] == "name: RESULT: FAIL, TESTS: 2, ERRORS: 0, FAILURES: 1"


def test_the_package_mavros(stage: Any) -> None:
    stage.component(
        "autopilot",
        """
from mavros_msgs.msg import ParamValue, State
from mavros_msgs.srv import CommandBool, ParamGet
rospy.init_node("autopilot")
rospy.Service("/uav/cmd/arming", CommandBool, lambda asked: (asked.value, 0))
known = {"SPEED": ParamValue(real=2.5)}
rospy.Service("/uav/param/get", ParamGet, lambda asked: (
    asked.param_id in known, known.get(asked.param_id, ParamValue())
))
state = rospy.Publisher("/uav/state", State, queue_size=1, latch=True)
rospy.sleep(1)
state.publish(connected=True)
rospy.spin()
""",
    )
    stage.component(
        "node",
        """
import mavros
from mavros import command, setpoint as SP
from mavros.param import param_get
from mavros.utils import wait_fcu_connection
rospy.init_node("node")
mavros.set_namespace("/uav")
out((mavros.get_topic("cmd", "arming"), wait_fcu_connection(0.5), wait_fcu_connection()))
out((command.arming(value=True).success, SP.get_pub_position_local(queue_size=10).name))
out(param_get("SPEED"))
try:
    param_get("HEIGHT")
except IOError as error:
    out("HEIGHT" in str(error))
""",
    )
    assert stage.run(5 * S) == [
        ("/uav/cmd/arming", False, True),
        (True, "/uav/setpoint_position/local"),
        2.5,
        True,
    ]


@pytest.mark.parametrize("version_1", [False, True])
def test_mavlink_of_the_package_mavros(stage: Any, version_1: bool) -> None:
    stage.modules["packed"] = packed = common.MAVLink_statustext_message(6, b"all is well")
    data = bytes(packed.pack(common.MAVLink("", 255, 1), force_mavlink1=version_1))
    stage.component(
        "node",
        """
import packed
from mavros import mavlink
rospy.init_node("node")
message = mavlink.convert_to_rosmsg(packed)
out((message.magic, message.sysid, message.msgid, bytes(mavlink.convert_to_bytes(message))))
""",
    )
    assert stage.run() == [(data[0], 255, 253, data)]


def test_headers_of_connections(stage: Any) -> None:
    stage.modules |= messages.modules(library="rospy")
    stage.component(
        "talker",
        """
from std_msgs.msg import String
from std_srvs.srv import Trigger
rospy.init_node("talker")
publisher = rospy.Publisher("chatter", String, queue_size=1, headers={"cookies": "oreo"})
rospy.sleep(1)
publisher.publish("hi")
answer = rospy.ServiceProxy("tell", Trigger, headers={"tea": "green"})()
out(answer._connection_header["callerid"])
out(String()._connection_header)
""",
    )
    stage.component(
        "listener",
        """
from std_msgs.msg import String
from std_srvs.srv import Trigger
rospy.init_node("listener")
def receive(one):
    header = one._connection_header
    out([header[key] for key in ("callerid", "cookies", "topic", "type", "md5sum")])
rospy.Subscriber("chatter", String, receive)
def answer(asked):
    header = asked._connection_header
    out([header[key] for key in ("callerid", "tea", "service", "type", "md5sum")])
    return True, ""
rospy.Service("tell", Trigger, answer)
rospy.spin()
""",
    )
    assert stage.run(5 * S) == [
        ["/talker", "oreo", "/chatter", "std_msgs/String", "992ce8a1687cec8c8bd883ec73ca41d1"],
        ["/talker", "green", "/tell", "std_srvs/Trigger", "937c9679a518e3a18d831e57125ea522"],
        "/listener",
        None,
    ]


def test_a_bag_is_written_and_read(stage: Any, tmp_path: Path) -> None:
    stage.component(
        "node",
        f"""
import rosbag
from geometry_msgs.msg import Point
from std_msgs.msg import String
rospy.init_node("node")
with rosbag.Bag("{tmp_path}/a.bag", "w") as bag:
    bag.write("/chatter", String("one"), rospy.Time(1, 500000000))
    bag.write("/point", Point(1.0, 2.0, 3.0), rospy.Time(2))
    rospy.sleep(3)
    bag.write("/chatter", String("two"))
bag = rosbag.Bag("{tmp_path}/a.bag")
for topic, message, at in bag.read_messages(topics=["/chatter"], start_time=rospy.Time(1)):
    out((topic, message.data, at.to_sec()))
out((bag.get_message_count(), bag.get_start_time(), bag.get_end_time()))
info = bag.get_type_and_topic_info()
out((info.msg_types["std_msgs/String"], info.topics["/point"].message_count))
try:
    rosbag.Bag("{tmp_path}/none.bag")
except rosbag.ROSBagException as error:
    out("none.bag" in str(error))
""",
    )
    assert stage.run(5 * S) == [
        ("/chatter", "one", 1.5),
        ("/chatter", "two", 3.0),
        (3, 1.5, 3.0),
        ("992ce8a1687cec8c8bd883ec73ca41d1", 1),
        True,
    ]


def test_the_command_line_tools_as_modules(stage: Any) -> None:
    stage.component(
        "other",
        """
from std_msgs.msg import String
from std_srvs.srv import Trigger
rospy.init_node("other")
rospy.on_shutdown(lambda: out("other ends"))
rospy.Publisher("chatter", String, queue_size=1, latch=True).publish("hi")
rospy.Service("tell", Trigger, lambda request: (True, ""))
rospy.spin()
""",
    )
    stage.component(
        "node",
        """
import rosnode
import rosparam
import rosservice
import rostopic
from roslib.message import get_message_class
rospy.init_node("node")
rospy.sleep(0.1)
out(rosnode.get_node_names())
out((rosservice.get_service_type("tell"), rosservice.get_service_list(), rosservice.get_service_type("no")))
out((rostopic.get_topic_type("chatter"), rostopic.get_topic_class("chatter")[0]._type))
out((rostopic.find_by_type("std_msgs/String"), rostopic.get_topic_type("no")))
out(get_message_class("std_msgs/String") is rostopic.get_topic_class("chatter")[0])
rosparam.upload_params("/a", {"b": 1, "c": {"d": 2}})
rosparam.set_param("/a/e", "[1, 2]")
out((rosparam.list_params("/a"), rosparam.get_param("/a/e")))
out((rosnode.kill_nodes(["other", "nobody"]), rosnode.rosnode_ping("other")))
""",
    )
    assert stage.run(2 * S) == [
        ["/node", "/other"],
        ("std_srvs/Trigger", ["/tell"], None),
        (("std_msgs/String", "/chatter", None), "std_msgs/String"),
        (["/chatter"], (None, None, None)),
        True,
        (["/a/b", "/a/c/d", "/a/e"], [1, 2]),
        "other ends",
        ((["other"], ["nobody"]), False),
    ]
