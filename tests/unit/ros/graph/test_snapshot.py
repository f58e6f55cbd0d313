"""A snapshot waits for the first node of a graph, and counts messages for the time that is asked for."""

from __future__ import annotations

import pytest

from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.ros.graph import EmbeddedGraph
from volery.ros.graph.snapshot import GraphSnapshot, snapshot
from volery.ros.messages import new

TEXT = "std_msgs/String"


def taken(late: int | None, within: int = 0) -> tuple[GraphSnapshot, int]:
    """Return the snapshot of a graph whose node comes after *late* ns, and when it was taken."""
    kernel = VirtualKernel()
    graph = EmbeddedGraph(kernel)
    with kernel.adopt("reader"):
        if late is not None:
            kernel.call_at(late, lambda: graph.node("talker").advertise("/words", TEXT))
        found = snapshot(graph, within)
        at = kernel.now()
    graph.close()
    return found, at


def test_a_node_that_is_discovered_late_is_in_it():
    found, at = taken(2 * S + 50 * MS)
    assert found.nodes == ("/talker",)
    assert found.topics[0].publishers == ("/talker",)
    assert at == 2 * S + 100 * MS


def test_a_graph_that_stays_empty_is_watched_for_4_s():
    found, at = taken(None)
    assert found == GraphSnapshot((), (), ())
    assert at == 4 * S


@pytest.mark.parametrize("within", [0, 500 * MS])
def test_a_node_that_is_there_is_not_waited_for(within: int):
    found, at = taken(0, within)
    assert found.nodes == ("/talker",)
    assert found.topics[0].rate == (0.0 if within else None)
    assert at <= 100 * MS + within


def test_the_rate_of_a_topic_is_its_messages_in_a_second():
    kernel = VirtualKernel()
    graph = EmbeddedGraph(kernel)
    with kernel.adopt("reader"):
        publisher = graph.node("talker").advertise("/words", TEXT)
        for number in range(100):
            kernel.call_at(number * 100 * MS, lambda: publisher.publish(new(TEXT, data="word")))
        (topic,) = snapshot(graph, 2 * S).topics
    graph.close()
    assert topic.rate == pytest.approx(10.0, abs=0.5)  # one more or less in 2 s
