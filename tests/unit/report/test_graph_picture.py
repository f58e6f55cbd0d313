"""A graph's picture, of a graph that is there and of a run."""

from __future__ import annotations

from pathlib import Path

import pytest
from lxml import etree

from volery.base.errors import UsageError
from volery.report.graph_picture import graph_of_run, graph_svg
from volery.ros.graph.interface import ServiceState
from volery.ros.graph.snapshot import GraphSnapshot, TopicSnapshot
from volery.testing.sample_run import sample_events, sample_setup
from volery.trace.mcap_writer import McapWriter

SVG = "{http://www.w3.org/2000/svg}"


def words(svg: str) -> list[str]:
    return [text.text for text in etree.fromstring(svg.encode()).iter(f"{SVG}text")]


def test_every_node_topic_and_rate_is_in_the_picture() -> None:
    seen = GraphSnapshot(
        ("/camera", "/lonely", "/viewer"),
        (
            TopicSnapshot("/image", "sensor_msgs/msg/Image", ("/camera",), ("/viewer",), 29.97),
            TopicSnapshot("/odd<&>", "std_msgs/msg/Empty", ("/camera", "/viewer"), (), None),
        ),
        (ServiceState("/start", "std_srvs/srv/Empty", "/camera"),),
    )
    svg = graph_svg(seen)
    found = words(svg)
    assert {"/camera", "/viewer", "/lonely", "/image", "/odd<&>", "30 Hz"} <= set(found)
    assert found.count("/viewer") == 2  # it publishes and subscribes
    assert svg.count('class="wire"') == 4


def test_an_empty_graph() -> None:
    assert words(graph_svg(GraphSnapshot((), (), ()))) == ["publishes", "topic", "subscribes"]


def test_the_graph_of_a_run(tmp_path: Path) -> None:
    writer = McapWriter(tmp_path / "trace.mcap", sample_setup(), [], lambda name: "string data\n")
    for event in sample_events(seconds=10.0):
        writer(event)
    writer.close()
    seen = graph_of_run(tmp_path)
    assert seen.topics
    for line in seen.topics:
        assert set(line.publishers) | set(line.subscribers) <= set(seen.nodes)


def test_a_folder_without_a_run(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot read"):
        graph_of_run(tmp_path)


def test_control_characters_of_names_are_not_written_into_the_picture() -> None:
    svg = graph_svg(GraphSnapshot(("/\x1b[2J\x07\x00node",), (), ()))
    assert "/\ufffd[2J\ufffd\ufffdnode" in words(svg)
