"""Debian's own tools, plain rospy and roscpp see our nodes, and talk to them."""

from __future__ import annotations

import sys
from typing import Any

import pytest

from volery.base.time import S
from volery.ros.graph import LATCHED
from volery.ros.messages import message_class, new, request, service

from .conftest import LIMIT, LIMIT_S, Ours, Run, Start

pytestmark = pytest.mark.integration

STRING, SET_BOOL = "std_msgs/msg/String", "std_srvs/srv/SetBool"


def test_rosnode_sees_our_nodes(ours: Ours, ros: Run) -> None:
    node = ours.spinning("mavros", namespace="/drone_1")
    ours.spinning("planner")
    node.advertise("state", "mavros_msgs/msg/State")
    node.serve("arm", SET_BOOL, lambda asked: None)
    assert {"/drone_1/mavros", "/planner", "/rosout"} <= set(ros("rosnode", "list").split())
    about = ros("rosnode", "info", "/drone_1/mavros")
    assert "/drone_1/state [mavros_msgs/State]" in about
    assert "/drone_1/arm" in about
    assert "xmlrpc reply" in ros("rosnode", "ping", "-c", "1", "/drone_1/mavros")
    node.close()
    assert "/drone_1/mavros" not in ros("rosnode", "list").split()


def test_rostopic_reads_what_we_publish(ours: Ours, ros: Run) -> None:
    node = ours.spinning("speaker")
    stamp = {"sec": 7, "nanosec": 500_000_000}
    fix = new(
        "sensor_msgs/NavSatFix", header={"stamp": stamp, "frame_id": "gps"}, latitude=47.5, altitude=-3.25
    )
    fix.position_covariance[4] = 2.5
    node.advertise("fix", "sensor_msgs/NavSatFix", LATCHED).publish(fix)
    seen = ros("rostopic", "echo", "-n", "1", "/fix")
    for line in (
        "seq: 1",
        "secs: 7",
        "nsecs: 500000000",
        'frame_id: "gps"',
        "latitude: 47.5",
        "altitude: -3.25",
    ):
        assert line in seen
    assert "position_covariance: [0.0, 0.0, 0.0, 0.0, 2.5, 0.0, 0.0, 0.0, 0.0]" in seen
    assert ros("rostopic", "type", "/fix").strip() == "sensor_msgs/NavSatFix"
    assert "* /speaker" in ros("rostopic", "info", "/fix")


def test_rostopic_publishes_to_us(ours: Ours, ros: Run) -> None:
    node = ours.spinning("listener")
    heard: list[Any] = []
    node.subscribe("goal", "geometry_msgs/PoseStamped", heard.append)
    pose = "{header: {frame_id: map}, pose: {position: {x: 1.5}, orientation: {w: 1.0}}}"
    ros("rostopic", "pub", "-1", "/goal", "geometry_msgs/PoseStamped", pose)
    ours.until(lambda: heard, "the goal arrives")
    assert (heard[0].header.frame_id, heard[0].pose.position.x) == ("map", 1.5)


def test_rosservice_calls_us(ours: Ours, ros: Run) -> None:
    node = ours.spinning("switch")
    kind = service(SET_BOOL)
    node.serve("set", SET_BOOL, lambda asked: kind.response(asked.data, "done"))
    assert ros("rosservice", "type", "/set").strip() == "std_srvs/SetBool"
    seen = ros("rosservice", "call", "/set", "data: true")
    assert "success: True" in seen
    assert 'message: "done"' in seen


def test_rosservice_is_told_why_not(ours: Ours, ros: Run) -> None:
    node = ours.graph.node("switch")

    def refuse(asked: Any) -> Any:
        raise ValueError("the key is missing")

    def spin() -> None:
        with pytest.raises(ValueError, match="the key"):
            node.spin()

    node.serve("set", SET_BOOL, refuse)
    ours.graph.kernel.spawn(spin, "spins", node.context)
    assert "the key is missing" in ros("rosservice", "call", "/set", "data: true", fails=True)


def test_rosparam_shares_our_parameters(ours: Ours, ros: Run) -> None:
    node = ours.graph.node("node")
    node.set_parameter("~gains", {"p": 1.5, "names": ["a", "b"]})
    assert ros("rosparam", "get", "/node/gains/p").strip() == "1.5"
    ros("rosparam", "set", "/node/gains/p", "2.5")
    assert node.get_parameter("~gains") == {"p": 2.5, "names": ["a", "b"]}
    node.delete_parameter("~gains")


PEER = """
import rospy
from genpy.dynamic import generate_dynamic
State = generate_dynamic("mavros_msgs/State", '''{text}''')["mavros_msgs/State"]
rospy.init_node("peer")
pub = rospy.Publisher("/echo", State, queue_size=10, latch=True)
def hear(message):
    assert message._md5sum == "{sum}"
    message.mode = message.mode + " heard"
    pub.publish(message)
rospy.Subscriber("/state", State, hear)
rospy.spin()
"""


def test_plain_rospy_shares_a_type_that_is_not_installed(ours: Ours, start: Start) -> None:
    from volery.ros.messages import ros1_type

    kind = ros1_type("mavros_msgs/State")
    node = ours.spinning("vehicle")
    heard: list[Any] = []
    node.subscribe("echo", "mavros_msgs/State", heard.append)
    publisher = node.advertise("state", "mavros_msgs/State", LATCHED)
    start("/usr/bin/python3", "-c", PEER.format(text=kind.text, sum=kind.md5))
    publisher.publish(new("mavros_msgs/State", armed=True, mode="GUIDED"))
    ours.until(lambda: heard, "the peer's answer arrives")
    assert (heard[0].armed, heard[0].mode) == (True, "GUIDED heard")


def test_roscpp(ours: Ours, start: Start, roscpp_peer: str) -> None:
    node = ours.spinning("node")
    heard: list[str] = []
    node.subscribe("from_roscpp", STRING, lambda one: heard.append(one.data))
    kind = service(SET_BOOL)
    node.serve("ours", SET_BOOL, lambda asked: kind.response(True, "by volery"))
    speaker = node.advertise("to_roscpp", STRING)
    order = node.advertise("let_roscpp_call", STRING)
    start(roscpp_peer)
    ours.until(lambda: speaker.subscribers() and order.subscribers(), "roscpp subscribes")
    ours.until(lambda: "/roscpp_peer" in ours.graph.node_names(), "roscpp is seen")
    speaker.publish(new(STRING, data="us"))
    order.publish(new(STRING, data="/ours"))
    ours.until(lambda: len(heard) == 2, "roscpp answers")
    assert set(heard) == {"roscpp heard us", "roscpp was told by volery"}
    client = node.client("roscpp_set", SET_BOOL)
    assert client.wait(LIMIT)
    answer = client.call(request(SET_BOOL, data=True), 30 * S)
    assert (answer.success, answer.message) == (True, "roscpp")


def test_our_programs_start_a_master_if_none_answers(ours: Ours, tmp_path: Any) -> None:
    """In a process of its own, since this one has its master."""
    import socket
    import subprocess

    with socket.socket() as asked:
        asked.bind(("127.0.0.1", 0))
        port = asked.getsockname()[1]
    program = f"""
from volery.kernel.wall import WallKernel
from volery.ros.transports.ros1 import master_answers, ros1_graph
uri = "http://127.0.0.1:{port}"
kernel = WallKernel()
with kernel.adopt("script"):
    graph = ros1_graph(kernel, master=uri)
    graph.node("alone")
    assert graph.node_names() == ["/alone", "/rosout"], graph.node_names()
    graph.close()
assert not master_answers(uri)
try:
    ros1_graph(kernel, master=uri, start_master=False)
except Exception as error:
    print(type(error).__name__, error)
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=LIMIT_S, check=False
    )
    assert "LinkSilent no ROS master answers" in done.stdout, done.stdout + done.stderr
    assert "start roscore or set ROS_MASTER_URI" in done.stdout


def test_messages_are_those_of_the_packages(ours: Ours) -> None:
    """Ours and Debian's classes read each other's bytes."""
    from sensor_msgs.msg import Imu

    from volery.ros.messages import from_ros1, ros1_type, to_ros1

    theirs = Imu()
    theirs.linear_acceleration.z = 9.75
    theirs.header.frame_id = "imu"
    buffer = __import__("io").BytesIO()
    theirs.serialize(buffer)
    mine = from_ros1("sensor_msgs/Imu", buffer.getvalue())
    assert isinstance(mine, message_class("sensor_msgs/Imu"))
    assert mine.linear_acceleration.z == 9.75
    assert to_ros1(mine) == buffer.getvalue()
    assert ros1_type("sensor_msgs/Imu").md5 == Imu._md5sum
