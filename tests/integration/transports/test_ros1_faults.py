"""What goes wrong on real ROS 1: clear words, bounded memory, nothing hung."""

from __future__ import annotations

import resource
import signal
import socket
import struct
from typing import Any
from xmlrpc.client import ServerProxy

import pytest

from volery.base.errors import LinkError, UsageError
from volery.base.time import S
from volery.ros.graph import LATCHED, QoS
from volery.ros.messages import new
from volery.ros.transports.ros1 import Roscore
from volery.ros.transports.ros1.rospy_copy import raw_message_class, rospy_copy

from .conftest import LIMIT, Ours, Run, Start

pytestmark = pytest.mark.integration

STRING = "std_msgs/msg/String"


def foreign(roscore: Roscore, name: str) -> Any:
    """A rospy node that obeys nobody's rules."""
    rospy = rospy_copy()
    rospy.init_node(name, argv=[], disable_signals=True, disable_rosout=True, disable_rostime=True)
    return rospy


def test_roscore_dies_and_returns(ours: Ours, roscore: Roscore, ros: Run) -> None:
    speaker, listener = ours.spinning("speaker"), ours.spinning("listener")
    heard: list[str] = []
    listener.subscribe("chat", STRING, lambda one: heard.append(one.data))
    listener.serve("ping", "std_srvs/Empty", lambda asked: asked)
    publisher = speaker.advertise("chat", STRING)
    ours.until(publisher.subscribers, "they connect")
    roscore.stop(signal.SIGKILL)
    publisher.publish(new(STRING, data="without a master"))
    ours.until(lambda: heard, "who is connected goes on")
    for asked in (
        ours.graph.node_names,
        lambda: ours.graph.node("late"),
        lambda: speaker.advertise("late", STRING),
        lambda: speaker.get_parameter("~x", None),
    ):
        with pytest.raises(LinkError, match="no ROS master answers at"):
            asked()
    ours.until(lambda: any("does not answer any more" in text for text in ours.texts), "the loss is told")
    roscore.start()
    ours.until(lambda: {"/speaker", "/listener"} <= set(ours.graph.node_names()), "both are registered again")
    ours.until(lambda: "/ping" in ros("rosservice", "list").split(), "so is the service")
    assert "* /speaker" in ros("rostopic", "info", "/chat")
    ros("rostopic", "pub", "-1", "/chat", "std_msgs/String", "data: newcomer")
    ours.until(lambda: "newcomer" in heard, "a newcomer is heard")
    assert any("registered again" in text for text in ours.texts)


class Deaf:
    """A subscriber that shakes hands and never reads."""

    def __init__(self, roscore: Roscore, topic: str, kind: Any) -> None:
        master: Any = ServerProxy(roscore.uri)
        _, _, (publishers, _, _) = master.getSystemState("/deaf")
        [node] = next(nodes for name, nodes in publishers if name == topic)
        node_uri = master.lookupNode("/deaf", node)[2]
        _, _, (_, host, port) = ServerProxy(node_uri).requestTopic("/deaf", topic, [["TCPROS"]])
        self.socket = socket.create_connection((host, port), timeout=5)
        fields = {"callerid": "/deaf", "topic": topic, "type": kind._type, "md5sum": kind._md5sum}
        packed = [f"{key}={value}".encode() for key, value in fields.items()]
        body = b"".join(struct.pack("<I", len(one)) + one for one in packed)
        self.socket.sendall(struct.pack("<I", len(body)) + body)


def test_a_subscriber_that_never_reads(ours: Ours, roscore: Roscore) -> None:
    speaker, listener = ours.graph.node("speaker"), ours.spinning("listener")
    heard: list[str] = []
    publisher = speaker.advertise("chat", STRING, QoS(depth=10))
    deaf = Deaf(roscore, "/chat", raw_message_class(STRING))
    listener.subscribe("chat", STRING, lambda one: heard.append(one.data[:3]))
    ours.until(lambda: publisher.subscribers() == 2, "both connect")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    block = "x" * 100_000
    for number in range(1000):  # 100 MB, of which the sockets take a few
        publisher.publish(new(STRING, data=f"{number:03d}{block}"))
    publisher.publish(new(STRING, data="end"))
    ours.until(lambda: "end" in heard, "who reads hears the last")
    grown_mb = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    assert grown_mb < 50, f"memory has grown by {grown_mb:.0f} MB"
    deaf.socket.close()
    speaker.close()


def test_a_publisher_that_floods(ours: Ours, roscore: Roscore) -> None:
    rospy = foreign(roscore, "flood")
    kind = raw_message_class(STRING)
    flood = rospy.Publisher("/chat", kind, queue_size=0)
    listener = ours.graph.node("listener")
    heard: list[str] = []
    subscription = listener.subscribe("chat", STRING, lambda one: heard.append(one.data), QoS(depth=10))
    ours.until(lambda: flood.get_num_connections() == 1, "they connect")
    message = kind(struct.pack("<I", 1000) + b"x" * 1000)
    for _ in range(10_000):  # as fast as it goes: more than 10 kHz
        flood.publish(message)
    flood.publish(kind(struct.pack("<I", 3) + b"end"))
    ours.until(lambda: subscription.dropped >= 9_000, "what nobody takes is dropped")
    ours.until(lambda: subscription._queue[-1].data[4:] == b"end", "all has come")
    assert len(subscription._queue) == 10
    assert subscription.dropped == 9_991
    while listener.spin_once(0):
        pass
    assert len(heard) == 10
    assert heard[-1] == "end"
    rospy.signal_shutdown("test")


def test_a_message_that_is_none(ours: Ours, roscore: Roscore) -> None:
    rospy = foreign(roscore, "liar")
    kind = raw_message_class("sensor_msgs/msg/Imu")
    liar = rospy.Publisher("/imu", kind, queue_size=10)
    listener = ours.spinning("listener")
    heard: list[Any] = []
    subscription = listener.subscribe("imu", "sensor_msgs/msg/Imu", heard.append)
    ours.until(lambda: liar.get_num_connections() == 1, "they connect")
    from volery.ros.messages import to_ros1

    good = to_ros1(new("sensor_msgs/Imu", header={"frame_id": "imu"}))
    for data in (b"", good[:-1], good + b"\0", b"\xff" * 400, good):
        liar.publish(kind(data))
    ours.until(lambda: heard, "the good one arrives")
    assert len(heard) == 1
    assert subscription.garbled == 4
    told = [text for text in ours.texts if "/imu: a message of /liar dropped" in text]
    assert len(told) == 4
    assert all("are no sensor_msgs/msg/Imu" in text for text in told)
    rospy.signal_shutdown("test")


def test_another_type_on_our_topic(ours: Ours, roscore: Roscore, start: Start) -> None:
    listener = ours.spinning("listener")
    heard: list[Any] = []
    listener.subscribe("chat", STRING, heard.append)
    start("/usr/bin/rostopic", "pub", "-r", "5", "/chat", "std_msgs/Int32", "data: 1")
    ours.until(lambda: any("/chat" in text and "Int32" in text for text in ours.texts), "it is told")
    assert heard == []


def test_our_type_on_anothers_topic(ours: Ours, start: Start) -> None:
    start("/usr/bin/rostopic", "pub", "-r", "5", "/taken", "std_msgs/Int32", "data: 1")
    node = ours.graph.node("node")
    ours.until(lambda: any(one.name == "/taken" for one in ours.graph.topics()), "it is there")
    with pytest.raises(
        UsageError, match=r"/taken carries std_msgs/Int32 \(of /rostopic_.*not std_msgs/String"
    ):
        node.subscribe("taken", STRING, print)


def test_another_definition_of_our_type(ours: Ours, roscore: Roscore) -> None:
    rospy = foreign(roscore, "old")
    ours_is = raw_message_class(STRING)
    old = type("old", (ours_is,), {"__slots__": [], "_md5sum": "0" * 32})
    rospy.Publisher("/chat", old, latch=True, queue_size=1).publish(old(b"\0\0\0\0"))
    listener = ours.spinning("listener")
    heard: list[Any] = []
    listener.subscribe("chat", STRING, heard.append)
    ours.until(lambda: any("md5" in text.lower() for text in ours.texts), "the sum is told")
    assert heard == []
    rospy.signal_shutdown("test")


def test_a_stranger_takes_our_name(ours: Ours, start: Start) -> None:
    node = ours.graph.node("ours")
    publisher = node.advertise("chat", STRING, LATCHED)
    script = "import rospy, std_msgs.msg; rospy.init_node('ours')\n"
    script += "p = rospy.Publisher('/other', std_msgs.msg.String, queue_size=1); rospy.spin()"
    start("/usr/bin/python3", "-c", script)
    ours.until(lambda: node.closed, "we are told")
    for asked in (lambda: publisher.publish(new(STRING)), lambda: node.advertise("x", STRING)):
        with pytest.raises(UsageError, match="another node has taken its name"):
            asked()
    with pytest.raises(UsageError, match=r"/ours is there already \(at http"):
        ours.graph.node("ours")


def test_a_thousand_topics(ours: Ours) -> None:
    speaker, listener = ours.graph.node("speaker"), ours.graph.node("listener")
    heard: list[str] = []
    publishers = [speaker.advertise(f"t{number}", STRING) for number in range(1000)]
    for number in range(1000):
        listener.subscribe(f"t{number}", STRING, lambda one: heard.append(one.data))
    ours.until(lambda: all(one.subscribers() for one in publishers), "all connect", within=300 * S)
    for number, publisher in enumerate(publishers):
        publisher.publish(new(STRING, data=str(number)))
    while len(heard) < 1000:
        assert listener.spin_once(LIMIT)
    assert sorted(heard, key=int) == [str(number) for number in range(1000)]


def test_a_master_that_is_none(ours: Ours, tmp_path: Any) -> None:
    """What listens there and says nothing is told apart in time; what speaks something else at once."""
    import threading
    from http.server import BaseHTTPRequestHandler, HTTPServer

    from volery.ros.transports.ros1.master import Master

    class Page(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            self.send_response(200)
            self.end_headers()
            self.wfile.write(b"<html>hello</html>")

        def log_message(self, *what: object) -> None:
            pass

    server = HTTPServer(("127.0.0.1", 0), Page)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with pytest.raises(LinkError, match="is no ROS master"):
        Master(f"http://127.0.0.1:{server.server_port}", "/test").value("getPid")
    server.shutdown()
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        with pytest.raises(LinkError, match="no ROS master answers"):
            Master(f"http://127.0.0.1:{silent.getsockname()[1]}", "/test", patience_s=0.2).value("getPid")
