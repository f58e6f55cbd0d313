"""Messages with long arrays: shared by their subscribers, in the trace without their content."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from volery.base.time import S
from volery.ros import messages
from volery.ros.graph import LATCHED
from volery.ros.graph.graph_context import Recorded
from volery.ros.messages.message import LONG
from volery.trace.events import Message, Omitted, Published

IMAGE, SCAN, JOY = "sensor_msgs/msg/Image", "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/Joy"


def image(data: Any) -> Any:
    return messages.new(IMAGE, header={"frame_id": "camera"}, encoding="rgb8", data=data)


def published(rig: Any, graph: Any, topic: str, message: Any, listeners: int = 1) -> list[Any]:
    """Return what the subscribers of a topic get of one message."""
    heard: list[Any] = []

    def listener() -> None:
        node = graph.node("listener")
        for _ in range(listeners):
            node.subscribe(topic, message.__msgtype__, heard.append)
        for _ in range(listeners):
            node.spin_once(2 * S)

    def talker() -> None:
        node = graph.node("talker")
        publisher = node.advertise(topic, message.__msgtype__)
        node.sleep(S)
        publisher.publish(message)
        node.sleep(S)

    rig.run(listener, talker)
    return heard


def test_subscribers_share_the_bytes_that_were_published(rig: Any) -> None:
    data = bytes(range(256)) * 100
    heard = published(rig, rig.graph, "image", image(data), listeners=3)
    assert [one.data.base is data for one in heard] == [True] * 3
    assert len({id(one) for one in heard}) == len({id(one.header) for one in heard}) == 3
    with pytest.raises(ValueError, match="read-only"):
        heard[0].data[0] = 1


@pytest.mark.parametrize(
    "given",
    [bytearray(LONG), np.zeros(LONG, np.uint8), memoryview(bytearray(LONG)), np.zeros(2 * LONG, "u1")[::2]],
)
def test_the_publisher_may_change_its_array_afterwards(rig: Any, given: Any) -> None:
    hidden = given
    if isinstance(given, np.ndarray):
        hidden = given.view()
        hidden.setflags(write=False)  # no promise: the array below it can be written
    heard: list[Any] = []

    def both() -> None:
        node = rig.graph.node("both")
        for _ in range(2):
            node.subscribe("image", IMAGE, heard.append)
        node.advertise("image", IMAGE).publish(image(hidden))
        given[0] = 9
        node.spin_once()
        node.spin_once()

    rig.run(both)
    assert [int(one.data[0]) for one in heard] == [0, 0]
    assert heard[0].data is heard[1].data


def test_a_short_array_is_the_subscribers_own(rig: Any) -> None:
    one, two = published(rig, rig.graph, "image", image(bytes(LONG - 1)), listeners=2)
    one.data[0] = 9
    assert two.data[0] == 0


def test_a_late_subscriber_gets_the_same_content(rig: Any) -> None:
    heard: list[Any] = []

    def both() -> None:
        node = rig.graph.node("both")
        message = image(bytearray(b"x" * LONG))
        node.advertise("image", IMAGE, LATCHED).publish(message)
        message.data[0] = 0
        node.sleep(S)
        node.subscribe("image", IMAGE, heard.append, LATCHED)
        node.spin_once()

    rig.run(both)
    assert heard[0].data.tobytes() == b"x" * LONG


def test_of_a_long_message_the_trace_has_topic_type_and_size(rig: Any) -> None:
    message = image(bytes(LONG))
    published(rig, rig.graph, "image", message)
    size = len(messages.to_cdr(message))
    assert rig.of(Omitted) == [Omitted(S, "/image", IMAGE, "/talker", size)]
    assert rig.of(Published) == []
    assert [event.size for event in rig.of(Message)] == [size]
    assert [size for _, _, size, _ in rig.carried] == [size]


def test_the_content_of_chosen_topics_is_recorded(rig: Any) -> None:
    graph = rig.new_graph(records=lambda topic: Recorded.ALL if topic == "/scan" else Recorded.SHORT)
    scan = messages.new(SCAN, ranges=[0.5] * 1080)
    published(rig, graph, "scan", scan)
    assert rig.of(Published) == [Published(S, "/scan", SCAN, "/talker", messages.to_cdr(scan))]
    assert rig.of(Omitted) == []


@pytest.mark.parametrize(("cells", "kind"), [(1_000_000, Published), (1 << 20, Omitted)])
def test_a_map_of_up_to_a_million_cells_is_recorded(rig: Any, cells: int, kind: type[Any]) -> None:
    published(rig, rig.graph, "map", messages.new("nav_msgs/msg/OccupancyGrid", data=np.ones(cells, np.int8)))
    (event,) = rig.of(Published) + rig.of(Omitted)
    assert isinstance(event, kind)
    assert event.topic == "/map"


def test_a_large_message_without_a_long_array_is_recorded(rig: Any) -> None:
    path = messages.new("nav_msgs/msg/Path", poses=[messages.new("geometry_msgs/PoseStamped")] * 200)
    assert messages.cdr_size(path.copy()) > LONG
    published(rig, rig.graph, "path", path)
    assert [event.data for event in rig.of(Published)] == [messages.to_cdr(path)]


def test_what_the_framework_made_for_one_call_is_shared_as_well(rig: Any) -> None:
    heard: list[Any] = []

    def both() -> None:
        node = rig.graph.node("both")
        for _ in range(2):
            node.subscribe("image", IMAGE, heard.append)
        made = image(np.zeros(LONG, np.uint8))
        node.publish_all([(node.advertise("image", IMAGE), made)], lambda index, error: None)
        node.spin_once()
        node.spin_once()

    rig.run(both)
    assert heard[0].data is heard[1].data
    assert not heard[0].data.flags.writeable


def test_a_service_carries_long_arrays(rig: Any) -> None:
    answers: list[Any] = []

    def server() -> None:
        node = rig.graph.node("server")
        kind = messages.service("nav_msgs/srv/GetMap")
        node.serve(
            "map",
            kind.name,
            lambda request: kind.response(
                map=messages.new("nav_msgs/OccupancyGrid", data=np.ones(9000, np.int8))
            ),
        )
        node.spin_once(2 * S)

    def caller() -> None:
        node = rig.graph.node("caller")
        node.sleep(S)
        answers.append(
            node.client("map", "nav_msgs/srv/GetMap").call(messages.request("nav_msgs/srv/GetMap"))
        )

    rig.run(server, caller)
    assert answers[0].map.data.sum() == 9000
    assert rig.carried[-1][2] == len(messages.to_cdr(answers[0]))
