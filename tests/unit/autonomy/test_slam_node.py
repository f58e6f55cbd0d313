from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigs.floor_plans import odometry, tour
from rigs.scanning_robot import MOUNTING, odometry_message, scan_message, transform
from volery.autonomy.map_server import MapServer
from volery.autonomy.occupancy_grid import OccupancyGrid
from volery.autonomy.planar_pose import Pose2
from volery.autonomy.slam_node import SlamNames, SlamNode
from volery.base.frames import quaternion_to_euler
from volery.base.time import MS
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.ros.graph import LATCHED, EmbeddedGraph, Node
from volery.ros.messages import new

NAMES = SlamNames()
STEP = 200 * MS
TRUTH = tour([(2.0, 2.0), (10.5, 2.5), (10.5, 12.0)], 0.25)
WHEELS = odometry(TRUTH, 3)

Change = Callable[[str, int, Any], Any]
"""``change(topic, number, message)``: the message to send instead, or None for none."""


class Graph:
    """An embedded graph with a robot on its way through the office, and what its nodes say."""

    def __init__(self) -> None:
        self.kernel = VirtualKernel(lambda event: None)
        self.graph = EmbeddedGraph(self.kernel)
        self.said: list[str] = []
        self.taken: dict[str, list[Any]] = {}

    def spin(self, name: str, make: Callable[[Node], object]) -> None:
        def body() -> None:
            node = self.graph.node(name)
            make(node)
            node.spin()

        self.spawn(name, body)

    def spawn(self, name: str, body: Callable[[], None]) -> None:
        self.kernel.spawn(body, name, ExecutionContext(name))

    def take(self, *topics: tuple[str, str]) -> None:
        def subscribe(node: Node) -> None:
            for topic, kind in topics:
                node.subscribe(topic, kind, self.taken.setdefault(topic, []).append)

        self.spin("observer", subscribe)

    def drive(self, source: str = "odom", change: Change = lambda topic, number, message: message) -> None:
        """Publish what a robot sees and reckons; *source* is the topic of its odometry."""

        def body() -> None:
            node = self.graph.node("robot")
            moved = {
                "odom": ("odom", "nav_msgs/msg/Odometry", odometry_message),
                "/tf": (
                    "/tf",
                    "tf2_msgs/msg/TFMessage",
                    lambda time, pose: transform(time, "odom", "base_link", pose),
                ),
            }[source]
            static = node.advertise("/tf_static", "tf2_msgs/msg/TFMessage", LATCHED)
            scans = node.advertise("scan", "sensor_msgs/msg/LaserScan")
            poses = node.advertise(*moved[:2])
            message = change("/tf_static", 0, transform(0, "base_link", "lidar", MOUNTING))
            if message is not None:
                static.publish(message)
            for number, (wheels, true) in enumerate(zip(WHEELS, TRUTH, strict=True)):
                node.sleep(STEP)
                time = node.now()
                for publisher, made in (
                    (scans, scan_message(time, true.after(MOUNTING), 0.01)),
                    (poses, moved[2](time, wheels)),
                ):
                    message = change(publisher.topic, number, made)
                    if message is not None:
                        publisher.publish(message)

        self.spawn("robot", body)

    def run(self) -> None:
        self.kernel.run((len(TRUTH) + 20) * STEP)


@pytest.fixture
def graph() -> Graph:
    return Graph()


def slam_on(graph: Graph, names: SlamNames = NAMES) -> list[SlamNode]:
    made: list[SlamNode] = []
    graph.spin("slam", lambda node: made.append(SlamNode(node, names, say=graph.said.append)))
    return made


def error_of(slam: SlamNode, number: int = -1) -> float:
    assert slam.pose is not None
    found, true = slam.slam.poses[0].to(slam.pose), TRUTH[0].to(TRUTH[number])
    return float(np.hypot(found.x - true.x, found.y - true.y))


@pytest.mark.parametrize("source", ["odom", "/tf"])
def test_a_map_a_path_and_a_transform_are_published(graph: Graph, source: str) -> None:
    made = slam_on(graph, SlamNames(odometry="" if source == "/tf" else source))
    graph.take(
        ("map", "nav_msgs/msg/OccupancyGrid"),
        ("path", "nav_msgs/msg/Path"),
        ("/tf", "tf2_msgs/msg/TFMessage"),
    )
    graph.drive(source)
    graph.run()
    (slam,) = made
    assert error_of(slam) < 0.06
    assert not graph.said
    last = graph.taken["map"][-1]
    assert (last.header.frame_id, len(last.data)) == ("map", last.info.width * last.info.height)
    assert min(last.data) == -1
    assert max(last.data) > 90
    path = graph.taken["path"][-1]
    assert [path.poses[-1].pose.position.x, path.poses[-1].pose.position.y] == pytest.approx(
        slam.slam.poses[-1][:2]
    )
    moved = [
        one for message in graph.taken["/tf"] for one in message.transforms if one.header.frame_id == "map"
    ]
    assert len(moved) == len(TRUTH), "with every scan"
    assert moved[-1].child_frame_id == "odom"
    turn = moved[-1].transform.rotation
    correction = Pose2(
        moved[-1].transform.translation.x,
        moved[-1].transform.translation.y,
        quaternion_to_euler((turn.w, turn.x, turn.y, turn.z))[2],
    )
    assert correction.after(WHEELS[-1]) == pytest.approx(slam.pose, abs=1e-6)


def test_a_map_is_saved_by_one_node_and_served_by_another(graph: Graph, tmp_path: Path) -> None:
    made = slam_on(graph)
    graph.drive()
    answers: list[Any] = []

    def ask() -> None:
        node = graph.graph.node("client")
        save = node.client("save_map", "nav2_msgs/srv/SaveMap")
        request = partial(new, "nav2_msgs/srv/SaveMap_Request")
        answers.append(save.call(request(map_url=str(tmp_path / "early"))).result)
        node.sleep((len(TRUTH) + 5) * STEP)
        answers.append(save.call(request(map_url=str(tmp_path / "none" / "office"))).result)
        answers.append(save.call(request(map_url=str(tmp_path / "office"), image_format="png")).result)
        answers.append(save.call(request(map_url=f"file://{tmp_path}/office.yaml")).result)
        graph.spin(
            "map_server", lambda server: MapServer(server, tmp_path / "office.yaml", say=graph.said.append)
        )
        load = node.client("load_map", "nav2_msgs/srv/LoadMap")
        load.wait()
        for name in ("nothing", "office", "office.pgm"):
            answers.append(load.call(new("nav2_msgs/srv/LoadMap_Request", map_url=str(tmp_path / name))))
        answers.append(
            node.client("static_map", "nav_msgs/srv/GetMap").call(new("nav_msgs/srv/GetMap_Request"))
        )
        answers.append(
            node.client("dynamic_map", "nav_msgs/srv/GetMap").call(new("nav_msgs/srv/GetMap_Request"))
        )

    graph.spawn("client", ask)
    graph.run()
    assert answers[:4] == [False, False, False, True]
    assert [one.result for one in answers[4:7]] == [1, 0, 0]
    saved = OccupancyGrid.load(tmp_path / "office.yaml")
    static, dynamic = answers[7].map, answers[8].map
    assert np.array_equal(np.asarray(static.data).reshape(saved.occupied.shape) > 90, saved.occupied)
    assert (dynamic.info.width, dynamic.info.height) == (static.info.width, static.info.height)
    assert made[0].grid.occupied.sum() == saved.occupied.sum()
    words = "\n".join(graph.said)
    for said in ("there is no map yet", "No such file", "saved as pgm", "nothing.yaml: it cannot be read"):
        assert said in words


def jumped(message: Any, by: int) -> Any:
    message.header.stamp.sec += by
    return message


def without(kind: str, first: int, last: int) -> Change:
    return lambda topic, number, message: None if topic.endswith(kind) and first <= number < last else message


def not_a_number(topic: str, number: int, message: Any) -> Any:
    if topic.endswith("odom") and number == 5:
        message.pose.pose.position.x = float("nan")
    return message


def late_clock(topic: str, number: int, message: Any) -> Any:
    return jumped(message, -5) if number >= 20 and "tf" not in topic else message


@pytest.mark.parametrize(
    ("change", "words", "limit"),
    [
        (without("odom", 10, 25), "no odometry on odom: the scans alone say how the vehicle moves", 0.1),
        (without("odom", 0, 10**6), "no odometry on odom", 0.1),
        (
            without("static", 0, 1),
            "no transform from base_link to lidar: taken for the vehicle's centre",
            9.0,
        ),
        (not_a_number, "odometry that is not a number is left out", 0.1),
        (late_clock, "time has jumped back by", 0.1),
    ],
    ids=["a gap", "no odometry", "no transform", "nan", "clock"],
)
def test_what_is_missing_or_wrong_is_said_once_and_mapping_goes_on(
    graph: Graph, change: Change, words: str, limit: float
) -> None:
    made = slam_on(graph)
    graph.drive(change=change)
    graph.run()
    assert sum(words in one for one in graph.said) in (1, 2), graph.said
    late = len(made[0].waiting)
    assert late <= 3, "a scan waits for odometry for half a second"
    assert error_of(made[0], -1 - late) < limit


def test_scans_that_meet_nothing_are_said_and_the_first_that_meet_something_begin_the_map(
    graph: Graph,
) -> None:
    def blind(topic: str, number: int, message: Any) -> Any:
        if topic.endswith("scan") and number < 15:
            message.ranges = np.full(len(message.ranges), np.inf, dtype=np.float32)
        return message

    made = slam_on(graph)
    graph.drive(change=blind)
    graph.run()
    assert graph.said == ["10 scans have met nothing: is the scanner where it can see walls?"]
    assert len(made[0].slam.scans) > 20


def test_wheels_that_slip_are_said(graph: Graph) -> None:
    def slip(topic: str, number: int, message: Any) -> Any:
        if topic.endswith("odom") and number >= 30:
            message.pose.pose.position.x += 0.8
        return message

    made = slam_on(graph)
    graph.drive(change=slip)
    graph.run()
    assert any("odometry has slipped by 0." in one for one in graph.said), graph.said
    assert error_of(made[0]) < 0.1
