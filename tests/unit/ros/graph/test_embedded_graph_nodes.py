from functools import partial
from typing import Any

import pytest

from volery.base.errors import UsageError
from volery.base.time import MS, S
from volery.kernel.task import ExecutionContext
from volery.ros import messages
from volery.trace.events import Activation

EMPTY = "std_msgs/msg/Empty"


def test_names_are_resolved_below_the_namespace_and_remapped(rig: Any) -> None:
    node = rig.graph.node("nav", "/drone_1", remaps={"scan": "/lidar/scan", "~goal": "goal", "/tf": "tf"})
    assert node.name == "/drone_1/nav"
    assert node.resolve("pose") == "/drone_1/pose"
    assert node.resolve("/pose") == "/pose"
    assert node.resolve("~speed") == "/drone_1/nav/speed"
    assert node.resolve("scan") == "/lidar/scan"
    assert node.resolve("~goal") == "/drone_1/goal"
    assert node.resolve("/tf") == "/drone_1/tf"


@pytest.mark.parametrize("wrong", ["", "1a", "a//b", "a/", "/", "a-b", "a b", "~", "é", "a/1"])
def test_invalid_names_are_refused(rig: Any, wrong: str) -> None:
    node = rig.graph.node("nav")
    with pytest.raises(UsageError, match="no valid ROS"):
        node.resolve(wrong)


@pytest.mark.parametrize(
    ("name", "namespace"), [("a/b", "/"), ("", "/"), ("a", "b"), ("a", "/b/"), ("a", "//")]
)
def test_invalid_node_names_are_refused(rig: Any, name: str, namespace: str) -> None:
    with pytest.raises(UsageError, match="no valid ROS"):
        rig.graph.node(name, namespace)


def test_a_name_is_taken_until_its_node_leaves(rig: Any) -> None:
    first = rig.graph.node("nav", context=ExecutionContext("one"))
    with pytest.raises(UsageError, match=r"/nav is there already \(of component one\).*component two"):
        rig.graph.node("nav", context=ExecutionContext("two"))
    assert rig.graph.node("nav", "/other").name == "/other/nav"
    assert rig.graph.node("nav", anonymous=True).name == "/nav_1"
    assert rig.graph.node("nav", anonymous=True).name == "/nav_2"
    first.close()
    assert rig.graph.node("nav", context=ExecutionContext("two")).name == "/nav"
    assert rig.graph.node_names() == ["/nav", "/nav_1", "/nav_2", "/other/nav"]


def test_parameters_of_node_and_namespace(rig: Any) -> None:
    node = rig.graph.node("nav", "/drone_1")
    node.set_parameter("~speed", 3.5)
    node.set_parameter("limits", {"up": 2, "down": 1})
    assert node.get_parameter("/drone_1/nav/speed") == 3.5
    assert node.get_parameter("limits/up") == 2
    assert node.get_parameter("/drone_1/limits") == {"up": 2, "down": 1}
    assert node.get_parameter("~none", 7) == 7
    assert node.has_parameter("limits")
    assert rig.graph.parameters.names() == [
        "/drone_1/limits/down",
        "/drone_1/limits/up",
        "/drone_1/nav/speed",
    ]
    node.delete_parameter("limits/up")
    assert node.get_parameter("limits") == {"down": 1}
    with pytest.raises(
        UsageError, match=r"no parameter '/drone_1/nav/sped' \(did you mean '/drone_1/nav/speed'"
    ):
        node.get_parameter("~sped")
    with pytest.raises(UsageError):
        node.delete_parameter("limits/up")


def test_a_parameter_is_a_copy(rig: Any) -> None:
    node = rig.graph.node("nav")
    points = [1, 2]
    node.set_parameter("points", points)
    points.append(3)
    node.get_parameter("points").append(4)
    assert node.get_parameter("points") == [1, 2]


def test_a_rate_keeps_its_period_whatever_the_loop_takes(rig: Any) -> None:
    woke: list[int] = []

    def loop() -> None:
        node = rig.graph.node("loop")
        rate = node.rate(100 * MS)
        for _ in range(3):
            rig.kernel.sleep_until(rig.kernel.now() + 30 * MS)
            rate.sleep()
            woke.append(rig.kernel.now())

    rig.run(loop)
    assert woke == [100 * MS, 200 * MS, 300 * MS]
    assert [x for _, call, x in rig.asked if call == "sleep"] == [70_000.0] * 3


def test_a_late_loop_goes_on_at_once(rig: Any) -> None:
    def loop() -> None:
        node = rig.graph.node("loop")
        rate = node.rate(100 * MS)
        rig.kernel.sleep_until(150 * MS)
        rate.sleep()
        assert rig.kernel.now() == 150 * MS
        rate.sleep()
        assert rig.kernel.now() == 200 * MS

    rig.run(loop)
    assert [x for _, call, x in rig.asked if call == "sleep"] == [0.0, 50_000.0]


def test_timers_call_back_when_spun(rig: Any) -> None:
    fired: list[int] = []

    def loop() -> None:
        node = rig.graph.node("loop")
        timer = node.timer(100 * MS, lambda: fired.append(rig.kernel.now()))
        for _ in range(3):
            assert node.spin_once()
        timer.cancel()
        assert not node.spin_once(within=S)
        with pytest.raises(UsageError, match="period"):
            node.timer(0, print)

    rig.run(loop)
    assert fired == [100 * MS, 200 * MS, 300 * MS]


def test_a_timer_skips_periods_in_which_its_group_was_not_spun(rig: Any) -> None:
    fired: list[int] = []

    def loop() -> None:
        node = rig.graph.node("loop")
        node.timer(100 * MS, lambda: fired.append(rig.kernel.now()))
        node.sleep(350 * MS)
        while node.spin_once(0):
            pass
        node.close()

    rig.run(loop)
    assert fired == [350 * MS]


def test_a_message_releases_an_activation(rig: Any) -> None:
    def listener() -> None:
        node = rig.graph.node("listener")
        node.subscribe("ping", EMPTY, lambda message: rig.kernel.sleep_until(rig.kernel.now() + 30 * MS))
        node.spin()

    def talker() -> None:
        node = rig.graph.node("talker")
        publisher = node.advertise("ping", EMPTY)
        for _ in range(2):  # the second one arrives while the first is worked on
            node.sleep(10 * MS)
            publisher.publish(messages.new(EMPTY))

    rig.task(listener, "listener")
    rig.task(talker, "talker")
    rig.kernel.run(9 * MS)
    rig.events.clear()
    with pytest.raises(Exception, match="listener for /listener"):
        rig.kernel.run(S)
    heard = [(e.released, e.finished) for e in rig.of(Activation) if e.component == "listener"]
    assert heard == [(10 * MS, 40 * MS), (20 * MS, 70 * MS)]


def test_polling_belongs_to_the_loop(rig: Any) -> None:
    def loop() -> None:
        node = rig.graph.node("loop")
        node.subscribe("ping", EMPTY, lambda message: None)
        publisher = node.advertise("ping", EMPTY)
        rate = node.rate(100 * MS)
        for _ in range(2):
            publisher.publish(messages.new(EMPTY))
            node.spin_once(0)
            rate.sleep()

    rig.run(loop)
    assert [(e.released, e.finished) for e in rig.of(Activation)] == [
        (0, 0),
        (100 * MS, 100 * MS),
        (200 * MS, 200 * MS),
    ]


def test_spin_returns_when_the_node_is_closed(rig: Any) -> None:
    ended: list[int] = []

    def loop() -> None:
        node = rig.graph.node("loop")
        rig.kernel.call_at(S, node.close)
        node.spin()
        ended.append(rig.kernel.now())
        for forbidden in (
            lambda: node.advertise("x", EMPTY),
            lambda: node.subscribe("x", EMPTY, print),
            lambda: node.serve("x", "std_srvs/Empty", print),
            lambda: node.client("x", "std_srvs/Empty"),
            lambda: node.timer(S, print),
        ):
            with pytest.raises(UsageError, match="/loop has left the graph"):
                forbidden()

    rig.run(loop)
    assert ended == [S]
    assert rig.graph.topics() == []


def test_groups_are_spun_beside_each_other(rig: Any) -> None:
    heard: list[tuple[str, int]] = []

    def slow() -> None:
        node = rig.graph.node("slow")
        beside = node.group()
        node.subscribe("ping", EMPTY, lambda message: node.sleep(S))
        node.subscribe(
            "ping", EMPTY, lambda message: heard.append(("beside", rig.kernel.now())), group=beside
        )
        rig.task(partial(beside.spin_once, None), "slow")
        publisher = node.advertise("ping", EMPTY)
        publisher.publish(messages.new(EMPTY))
        node.spin_once()
        heard.append(("own", rig.kernel.now()))
        with pytest.raises(UsageError, match="of another node"):
            rig.graph.node("other").subscribe("ping", EMPTY, print, group=beside)

    rig.run(slow)
    assert heard == [("beside", 0), ("own", S)]


def test_what_a_callback_raises_comes_out_of_the_spin(rig: Any) -> None:
    def loop() -> None:
        node = rig.graph.node("loop")

        def fail(message: Any) -> None:
            raise KeyError("battery")

        node.subscribe("ping", EMPTY, fail)
        node.advertise("ping", EMPTY).publish(messages.new(EMPTY))
        with pytest.raises(KeyError, match="battery"):
            node.spin_once()

    rig.run(loop)


def test_states_of_topics_and_services(rig: Any) -> None:
    node = rig.graph.node("nav")
    node.advertise("b", EMPTY)
    node.subscribe("a", EMPTY, print)
    node.serve("go", "std_srvs/Empty", print)
    assert [tuple(state) for state in rig.graph.topics()] == [
        ("/a", EMPTY, (), ("/nav",)),
        ("/b", EMPTY, ("/nav",), ()),
    ]
    assert [tuple(state) for state in rig.graph.services()] == [("/go", "std_srvs/srv/Empty", "/nav")]
