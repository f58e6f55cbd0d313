"""What no node takes or serves is found at the end of a run, with the name that was nearly right."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from volery.base.time import S
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.ros.graph import EmbeddedGraph, Node
from volery.ros.graph.interface import BEST_EFFORT, RELIABLE, QoS
from volery.ros.graph.unserved import KnownParticipants
from volery.ros.messages import new
from volery.trace.events import Unserved

TWIST, TEXT, TRIGGER = "geometry_msgs/msg/Twist", "std_msgs/msg/String", "std_srvs/srv/Trigger"


def found(
    body: Callable[[Node, Node], None], vehicles: Mapping[str, str] | None = None, without: str = ""
) -> dict[str, Unserved]:
    """Return what two nodes wait for after *body*, by name; other components are volery's own."""
    kernel = VirtualKernel()
    graph = EmbeddedGraph(kernel)
    with kernel.adopt("flyer"):
        ours = graph.node("flyer")
        theirs = graph.node("mavros", "/drone_1", context=ExecutionContext("drone_1/mavros"))
        kernel.sleep_until(2 * S)
        body(ours, theirs)
        around = KnownParticipants(["flyer"], vehicles or {}, [without] if without else [])
        seen = graph.unserved(around)
    graph.close()
    return {one.name: one for one in seen}


def ignore(_: object) -> None:
    """Take a message."""


def test_topics_of_one_side_are_named_with_the_topic_that_was_meant():
    def body(ours: Node, theirs: Node) -> None:
        publisher = ours.advertise("/cmd_vel", TWIST)
        for _ in range(3):
            publisher.publish(new(TWIST))
        theirs.subscribe("/robot/cmd_vel", TWIST, ignore)
        ours.subscribe("/words", TEXT, ignore)
        ours.advertise("/silent", TEXT)
        ours.advertise("/rosout", TEXT).publish(new(TEXT))

    seen = found(body)
    assert list(seen) == ["/words", "/cmd_vel"]
    assert seen["/cmd_vel"][1:] == (
        "publication", "/cmd_vel", TWIST, "/flyer", 3, 2 * S, "did you mean /robot/cmd_vel?",
    )  # fmt: skip
    assert seen["/words"].hint == ""


def test_what_was_taken_once_is_not_named():
    def body(ours: Node, theirs: Node) -> None:
        subscription = theirs.subscribe("/cmd_vel", TWIST, ignore)
        publisher = ours.advertise("/cmd_vel", TWIST)
        subscription.close()
        publisher.publish(new(TWIST))
        ours.wait_for_service("/later", 0)
        theirs.serve("/later", TRIGGER, ignore).close()

    assert found(body) == {}


def test_qos_that_does_not_match_is_the_reason():
    def body(ours: Node, theirs: Node) -> None:
        theirs.advertise("/pose", TWIST, QoS(reliability=BEST_EFFORT))
        ours.subscribe("/pose", TWIST, ignore, QoS(reliability=RELIABLE))

    assert "reliable is wanted, best effort offered" in found(body)["/pose"].hint


def test_services_are_named_if_they_are_asked_for():
    def body(ours: Node, theirs: Node) -> None:
        theirs.serve("/drone_1/land", TRIGGER, ignore)
        ours.client("/unused", TRIGGER)
        ours.client("/mavros/land", TRIGGER).ready()
        ours.wait_for_service("/nav/plan", 0)

    seen = found(body, {"drone_1": "mavros"})
    assert {name: one.hint for name, one in seen.items()} == {
        "/mavros/land": "did you mean /drone_1/land?", "/nav/plan": "",
    }  # fmt: skip


def test_an_action_is_one_line_for_its_client_and_none_for_its_server():
    def body(ours: Node, theirs: Node) -> None:
        ours.client("/dock/_action/send_goal", TRIGGER).ready()
        ours.client("/dock/_action/get_result", TRIGGER).ready()
        ours.subscribe("/dock/_action/feedback", TEXT, ignore)
        ours.subscribe("/mine/goal", "actionlib_msgs/msg/GoalID", ignore)
        ours.subscribe("/mine/cancel", "actionlib_msgs/msg/GoalID", ignore)

    seen = found(body)
    assert [(one.kind, one.name) for one in seen.values()] == [("action", "/dock")]


def test_names_of_dds_and_vehicles_without_a_node():
    def body(ours: Node, theirs: Node) -> None:
        ours.subscribe("/fmu/out/vehicle_status", TEXT, ignore)
        ours.wait_for_service("/mavros/set_mode", 0)

    seen = found(body, {"drone_1": "mavros"}, "rover")
    assert (
        seen["/fmu/out/vehicle_status"].hint
        == "a vehicle with 'names: px4' offers such topics; drone_1 has MAVROS's"
    )
    assert seen["/mavros/set_mode"].hint == "rover is in no allocation, so it has no MAVROS node"
