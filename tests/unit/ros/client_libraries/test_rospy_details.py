"""rospy beyond topics and services: its log, messages of any type, its smaller modules."""

from __future__ import annotations

from typing import Any

from volery.base.time import S
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
try:
    rospy.Publisher("data", Float32MultiArray, rospy.Time)
except NotImplementedError as error:
    out("subscriber_listener" in str(error))
rospy.sleep(1)
""",
    )
    assert stage.run(2 * S) == [3.0, True, "ndarray"]


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
