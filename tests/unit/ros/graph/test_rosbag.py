"""Playing recordings into the embedded graph, and recording it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from volery.base.errors import UsageError
from volery.base.time import MS, S
from volery.ros import messages
from volery.ros.graph.interface import BEST_EFFORT, LATCHED, RELIABLE, TRANSIENT_LOCAL, VOLATILE, QoS
from volery.ros.graph.rosbag import PlayOptions, Recorder, play
from volery.ros.messages.bags import Bag, create_bag, open_bag, qos_profile
from volery.ros.messages.containers import Offer

from .conftest import Rig


@pytest.fixture
def bag(tmp_path: Path) -> Bag:
    with create_bag(tmp_path / "walk") as made:
        for number in range(5):
            at = 1000 * S + number * 500 * MS
            made.write("/steps", at, messages.new("std_msgs/Int32", data=number))
            made.write("/words", at + 1 * MS, messages.new("std_msgs/String", data=f"step {number}"))
    return open_bag(tmp_path / "walk")


def listen(rig: Rig, topic: str, kind: str, heard: list[Any]) -> None:
    rig.kernel.call_at(101 * S, lambda: None)  # who only listens is no deadlock yet

    def listener() -> None:
        node = rig.graph.node("listener")
        node.subscribe(topic, kind, lambda message: heard.append((rig.kernel.now(), message.data)))
        node.spin()

    rig.task(listener)


@pytest.mark.parametrize("rate", [1.0, 4.0])
def test_a_recording_is_played_in_time(rig: Rig, bag: Bag, rate: float) -> None:
    heard: list[Any] = []
    played: list[int] = []
    listen(rig, "/steps", "std_msgs/Int32", heard)

    def player() -> None:
        played.append(play(rig.graph.node("player"), bag, PlayOptions(rate)))

    rig.run(player)
    assert heard == [(round(number * 500 * MS / rate), number) for number in range(5)]
    assert played == [10]


def test_a_recording_waits_for_subscribers(rig: Rig, bag: Bag) -> None:
    heard: list[Any] = []
    how = PlayOptions(topics=["/words"], wait_for_subscribers=True)

    def player() -> None:
        play(rig.graph.node("player"), bag, how)

    def late() -> None:
        node = rig.graph.node("late")
        node.sleep(60 * S)
        node.subscribe("/words", "std_msgs/String", lambda words: heard.append(words.data))
        node.sleep(10 * S)
        node.spin_once(0)
        while node.spin_once(0):
            pass

    rig.run(player, late)
    assert heard == [f"step {number}" for number in range(5)]


def test_only_some_topics_from_a_moment_on(rig: Rig, bag: Bag) -> None:
    heard: list[Any] = []
    told: list[Any] = []
    listen(rig, "/words", "std_msgs/String", heard)
    how = PlayOptions(topics=["/words"], after=1.0, on_message=lambda played, at: told.append(played))

    def player() -> None:
        play(rig.graph.node("player"), bag, how)

    rig.run(player)
    assert [words for _, words in heard] == ["step 2", "step 3", "step 4"]
    assert heard[0][0] == 1 * MS
    assert told == [1, 2, 3]


def test_the_recorded_time_on_the_clock(rig: Rig, bag: Bag) -> None:
    heard: list[Any] = []

    def listener() -> None:
        node = rig.graph.node("listener")
        node.subscribe("/seconds", "rosgraph_msgs/msg/Clock", lambda one: heard.append(one.clock.to_nsec()))
        node.spin()

    def player() -> None:
        node = rig.graph.node("player", remaps={"/clock": "/seconds"})
        play(node, bag, PlayOptions(topics=["/steps"], clock=True))

    rig.kernel.call_at(101 * S, lambda: None)
    rig.task(listener)
    rig.run(player)
    assert heard == [1000 * S + number * 10 * MS for number in range(201)]


@pytest.mark.parametrize("rate", [0.0, -1.0, float("inf"), float("nan")])
def test_a_rate_that_is_none(rate: float) -> None:
    with pytest.raises(UsageError, match="above 0"):
        PlayOptions(rate)


def test_a_topic_that_was_not_recorded(rig: Rig, bag: Bag) -> None:
    said: list[str] = []

    def player() -> None:
        with pytest.raises(UsageError) as error:
            play(rig.graph.node("player"), bag, PlayOptions(topics=["/step"]))
        said.append(str(error.value))

    rig.run(player)
    assert "no topic '/step' (did you mean '/steps'?)" in said[0]


def test_a_graph_is_recorded(rig: Rig, bag: Bag, tmp_path: Path) -> None:
    writer = create_bag(tmp_path / "again.bag")
    made: list[Recorder] = []

    def recorder() -> None:
        node = rig.graph.node("recorder")
        made.append(Recorder(rig.graph, node, writer))
        made[0].run()

    def player() -> None:
        node = rig.graph.node("player")
        node.sleep(2 * S)
        play(node, bag)

    rig.task(recorder)
    rig.task(player)
    rig.kernel.run(10 * S)
    made[0].stop()
    rig.kernel.run(11 * S)
    writer.close()
    assert made[0].counts == {"/steps": 4, "/words": 5}  # the first came before the topic was seen
    again = open_bag(tmp_path / "again.bag")
    assert [one.message.data for one in again.messages(["/words"])] == [
        f"step {number}" for number in range(5)
    ]


def test_what_was_latched_is_served_to_a_subscriber_that_comes_late(rig: Rig, tmp_path: Path) -> None:
    with create_bag(tmp_path / "a.bag") as made:
        made.write("/plan", 0, messages.new("std_msgs/String", data="once"), Offer(True, "/planner"))
        made.write("/tick", 9 * S, messages.new("std_msgs/String", data="on"), Offer(False, "/planner"))
    heard: list[str] = []

    def late() -> None:
        node = rig.graph.node("late")
        node.sleep(3 * S)
        node.subscribe("/plan", "std_msgs/String", lambda message: heard.append(message.data))
        node.spin()

    rig.task(late)
    rig.kernel.call_at(101 * S, lambda: None)
    rig.run(lambda: play(rig.graph.node("player"), open_bag(tmp_path / "a.bag")))
    assert heard == ["once"]


def test_topics_are_offered_as_they_were_recorded(rig: Rig, tmp_path: Path) -> None:
    offers = {
        "/map": Offer(False, "", (qos_profile(reliable=True, latched=False),)),  # stated, so not by its name
        "/plans": Offer(True, "", (qos_profile(reliable=True, latched=True, depth=5),)),
        "/scan": Offer(False, "", (qos_profile(reliable=False, latched=False, depth=5),)),
        "/tf_static": Offer(),
    }
    with create_bag(tmp_path / "a") as made:
        for topic, offer in offers.items():
            made.write(topic, 0, messages.new("std_msgs/String"), offer)
    offered = {}

    def player() -> None:
        node = rig.graph.node("player")
        play(node, open_bag(tmp_path / "a"))
        offered.update({topic: rig.graph.offered(topic) for topic in offers})

    rig.run(player)
    assert offered == {
        "/map": (QoS(100, RELIABLE, VOLATILE),),
        "/plans": (QoS(5, RELIABLE, TRANSIENT_LOCAL),),
        "/scan": (QoS(100, BEST_EFFORT, VOLATILE),),
        "/tf_static": (QoS(1, RELIABLE, TRANSIENT_LOCAL),),
    }


def test_the_commoner_of_two_types_of_a_topic_is_played_and_the_other_named(rig: Rig, tmp_path: Path) -> None:
    types = {1: "std_msgs/Int32", 2: "std_msgs/Float32"}
    for count, kind in types.items():
        with create_bag(tmp_path / f"{count}.bag") as made:
            for number in range(count):
                made.write("/n", number, messages.new(kind, data=number))
    with create_bag(tmp_path / "both.bag") as made:
        for count in types:
            for connection, raw in open_bag(tmp_path / f"{count}.bag").raw():
                made.copy(connection, raw.at, raw.data)
    bag = open_bag(tmp_path / "both.bag")
    played: list[int] = []
    rig.run(lambda: played.append(play(rig.graph.node("player"), bag)))
    assert played == [2]
    assert bag.damage == ["/n has several types; std_msgs/msg/Float32 is played, std_msgs/msg/Int32 is not"]


def test_what_is_offered_is_recorded(rig: Rig, tmp_path: Path) -> None:
    writer = create_bag(tmp_path / "again")
    made: list[Recorder] = []

    def recorder() -> None:
        made.append(Recorder(rig.graph, rig.graph.node("recorder"), writer))
        made[0].run()

    def talker() -> None:
        node = rig.graph.node("talker")
        plan = node.advertise("/plan", "std_msgs/String", LATCHED)
        scan = node.advertise("/scan", "std_msgs/String", QoS(5, BEST_EFFORT))
        node.sleep(2 * S)
        for publisher in (plan, scan):
            publisher.publish(messages.new("std_msgs/String"))
        node.sleep(1 * S)

    rig.task(recorder)
    rig.task(talker)
    rig.kernel.run(5 * S)
    made[0].stop()
    rig.kernel.run(6 * S)
    writer.close()
    plan, scan = open_bag(tmp_path / "again").connections
    assert plan.source.offer == Offer(True, "", (qos_profile(reliable=True, latched=True, depth=1),))
    assert scan.source.offer == Offer(False, "", (qos_profile(reliable=False, latched=False, depth=5),))
