"""Debian's ``rosbag`` and ``volery ros bag`` read each other's files; ``volery ros graph`` on a roscore."""

from __future__ import annotations

import json
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from volery.base.time import MS, S
from volery.ros.graph import QoS
from volery.ros.messages import message_class, new
from volery.ros.messages.bags import create_bag, open_bag
from volery.ros.messages.containers import Offer

from .conftest import HERE, LIMIT_S, Ours, Run, Start

pytestmark = pytest.mark.integration

STRING, POSE = "std_msgs/msg/String", "geometry_msgs/msg/PoseStamped"
TALKER = ("/usr/bin/python3", str(HERE / "ros_files" / "ros1" / "talker.py"))
LISTENER = ("/usr/bin/python3", str(HERE / "ros_files" / "ros1" / "listener.py"))
VOLERY = (sys.executable, "-c", "from volery.cli.main import main; main()")
COUNT = 30
ALL = QoS(depth=COUNT)
"""Of a subscription that loses nothing, however late its callbacks run."""

Volery = Callable[..., Any]


@pytest.fixture
def volery(ros: Run) -> Volery:
    """Run a command of ours on the roscore; gives its JSON."""
    return lambda *arguments: json.loads(ros(*VOLERY, *map(str, arguments), "--json"))


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """Thirty poses in 1.5 s, and as many words, also of a type that Debian has not installed."""
    path = tmp_path / "walk.bag"
    with create_bag(path) as made:
        for number in range(COUNT):
            at = 5 * S + number * 50 * MS
            pose = new(POSE, header={"frame_id": "map", "stamp": {"sec": number}})
            pose.pose.position.x = 0.5 * number
            made.write("/pose", at, pose)
            made.write("/words", at, new(STRING, data=f"word {number}"))
            made.write("/state", at, new("mavros_msgs/msg/State", mode="GUIDED", armed=number % 2 == 0))
    return path


def test_rosbag_looks_at_ours(bag: Path, ros: Run) -> None:
    said = ros("rosbag", "info", "--yaml", str(bag))
    assert "version: 2.0" in said
    assert "duration: 1.450000" in said
    assert f"messages: {3 * COUNT}" in said
    for topic, kind in (
        ("/pose", "geometry_msgs/PoseStamped"),
        ("/words", "std_msgs/String"),
        ("/state", "mavros_msgs/State"),
    ):
        assert f"- topic: {topic}\n      type: {kind}\n      messages: {COUNT}" in said
    ros("rosbag", "check", str(bag), fails=True)  # it knows no mavros_msgs here; it must not break on the bag


def test_rosbag_plays_ours(bag: Path, ours: Ours, ros: Run) -> None:
    node = ours.spinning("listener")
    heard: dict[str, list[Any]] = {"/pose": [], "/words": [], "/state": []}
    for topic, kind in (("/pose", POSE), ("/words", STRING), ("/state", "mavros_msgs/msg/State")):
        node.subscribe(topic, kind, heard[topic].append, ALL)
    ros("rosbag", "play", "--quiet", "--wait-for-subscribers", "--rate", "4", str(bag))
    ours.until(lambda: all(len(one) == COUNT for one in heard.values()), "all is heard")
    written = {topic: [one.message for one in open_bag(bag).messages([topic])] for topic in heard}
    assert heard == written


def test_we_read_and_play_what_rosbag_records(
    ours: Ours, ros: Run, start: Start, volery: Volery, tmp_path: Path
) -> None:
    speaker, path = ours.graph.node("speaker"), tmp_path / "theirs.bag"
    publisher = speaker.advertise("/words", STRING)
    recording = start("/usr/bin/rosbag", "record", "-q", "-O", str(path), "/words", "__name:=recording")
    ours.until(publisher.subscribers, "rosbag listens")
    for number in range(COUNT):
        publisher.publish(new(STRING, data=f"word {number}"))
        ours.graph.kernel.sleep_until(ours.graph.kernel.now() + 20 * MS)
    ros("rosnode", "kill", "/recording")
    recording.communicate(timeout=LIMIT_S)
    told = volery("ros", "bag", "info", path)
    assert (told["format"], told["complete"]) == ("rosbag 1", True)
    assert told["topics"] == [{"name": "/words", "type": STRING, "messages": COUNT}]
    heard: list[str] = []
    speaker.close()
    ours.spinning("listener").subscribe("/words", STRING, lambda one: heard.append(one.data), ALL)
    assert volery("ros", "bag", "play", path, "--rate", "5", "--wait-for-subscribers") == {"played": COUNT}
    ours.until(lambda: len(heard) == COUNT, "all is heard")
    assert heard == [f"word {number}" for number in range(COUNT)]


def test_a_recording_that_was_cut_short_is_played_as_far_as_it_is_whole(
    bag: Path, ours: Ours, volery: Volery, tmp_path: Path
) -> None:
    cut = tmp_path / "cut.bag"
    cut.write_bytes(bag.read_bytes()[:9000])
    told = volery("ros", "bag", "info", cut)
    whole = {topic["name"]: topic["messages"] for topic in told["topics"]}
    assert not told["complete"]
    assert 0 < whole["/words"] < COUNT
    heard: list[str] = []
    ours.spinning("listener").subscribe("/words", STRING, lambda one: heard.append(one.data), ALL)
    played = volery("ros", "bag", "play", cut, "--rate", "10", "--topic", "/words", "--wait-for-subscribers")
    assert played == {"played": whole["/words"]}
    ours.until(lambda: len(heard) == whole["/words"], "what is whole is heard")
    assert heard == [f"word {number}" for number in range(whole["/words"])]


def test_our_record_of_rospys_talker(
    ours: Ours, ros: Run, start: Start, volery: Volery, tmp_path: Path
) -> None:
    path = tmp_path / "ours.bag"
    recording = start(*VOLERY, "ros", "bag", "record", str(path), "--topic", "/chatter", "--quiet")
    start(*TALKER, "_listeners:=2")
    node, heard = ours.spinning("listener"), []
    node.subscribe("/chatter", STRING, heard.append)
    ours.until(lambda: len(heard) > 20, "the talker talks")  # the recorder hears the same, later
    recording.send_signal(signal.SIGINT)
    recording.communicate(timeout=LIMIT_S)
    assert recording.returncode == 0
    said = [one.message.data for one in open_bag(path).messages()]
    assert said == [f"hello, number {number}" for number in range(len(said))]
    assert len(said) > 5
    assert f"messages: {len(said)}" in ros("rosbag", "info", "--yaml", str(path))


def test_the_graph_of_a_roscore(roscore: Any, start: Start, volery: Volery, tmp_path: Path) -> None:
    start(*LISTENER, "_listeners:=0")
    start(*TALKER, "__name:=talker", "_listeners:=1")
    end = time.monotonic() + LIMIT_S
    picture: dict[str, Any] = {"topics": []}
    while not any(one["name"] == "/heard" and one["rate"] for one in picture["topics"]):
        assert time.monotonic() < end, picture
        picture = volery("ros", "graph", "ros1", "--within", "2", "--svg", tmp_path / "graph.svg")
    topics = {one["name"]: one for one in picture["topics"]}
    assert {"/listener", "/rosout", "/talker"} <= set(picture["nodes"])
    assert not any("volery" in one for one in picture["nodes"])
    chatter, repeated = topics["/chatter"], topics["/heard"]
    assert "/talker" in chatter["publishers"], "one of another test may be ending"
    assert chatter["subscribers"] == ["/listener"]
    assert (repeated["type"], repeated["publishers"]) == (STRING, ["/listener"])
    assert chatter["rate"] > 0  # how many: tests/unit/ros/graph/test_snapshot.py
    assert topics["/rosout"]["type"] == message_class("rosgraph_msgs/msg/Log").__msgtype__
    served = {one["name"]: one["server"] for one in picture["services"]}
    assert served["/talker/get_loggers"] == "/talker"
    drawn = (tmp_path / "graph.svg").read_text()
    assert "/chatter" in drawn
    assert "/talker" in drawn


def test_what_is_latched_is_played_and_recorded_as_such(
    ros: Run, start: Start, volery: Volery, tmp_path: Path
) -> None:
    """A subscriber that comes late hears what was latched; recorded again it still is, by the same node."""
    path, again = tmp_path / "latched.bag", tmp_path / "again.bag"
    with create_bag(path) as made:
        made.write("/plan", 0, new(STRING, data="once"), Offer(True, "/planner"))
        made.write("/tick", 300 * S, new(STRING, data="on"), Offer(False, "/planner"))
    start(*VOLERY, "ros", "bag", "play", str(path), "--quiet")
    assert 'data: "once"' in ros("rostopic", "echo", "-n1", "/plan")
    told = volery("ros", "bag", "record", again, "--topic", "/plan", "--seconds", "5")
    assert told == {"recorded": {"/plan": 1}, "problems": {}}
    (connection,) = open_bag(again).connections
    assert connection.source.offer.latched
    assert connection.source.offer.sender.startswith("/volery_play")
    assert "std_msgs/String" in ros("rosbag", "info", "--yaml", str(again))
