"""Playing recordings into the embedded graph, and recording it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from volery.base.errors import UsageError
from volery.base.time import MS, S
from volery.ros import messages
from volery.ros.graph.rosbag import PlayOptions, Recorder, play
from volery.ros.messages.bags import Bag, create_bag, open_bag

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
