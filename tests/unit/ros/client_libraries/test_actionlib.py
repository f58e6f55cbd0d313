"""actionlib: the protocol of goals on topics, seen by its files and on the wire."""

from __future__ import annotations

from typing import Any

import pytest

from volery.base.time import S
from volery.ros.client_libraries.actionlib import CommState, GoalStatus, steps
from volery.ros.messages import message_class, message_name, ros1_type
from volery.ros.messages.store import define_ros1_action
from volery.trace.events import Failure

SERVER = """
import actionlib
import rospy
from example_interfaces.msg import FibonacciAction, FibonacciFeedback, FibonacciResult


class Server:
    def __init__(self):
        self.server = actionlib.SimpleActionServer("fibonacci", FibonacciAction, self.execute, False)
        self.server.start()

    def execute(self, goal):
        found = [0, 1]
        if goal.order == 99:
            raise ValueError("no order of 99")
        for _ in range(goal.order):
            if self.server.is_preempt_requested():
                self.server.set_preempted(FibonacciResult(found), "enough")
                return
            found.append(found[-1] + found[-2])
            self.server.publish_feedback(FibonacciFeedback(found))
            rospy.sleep(0.5)
        if goal.order < 50:
            self.server.set_succeeded(FibonacciResult(found), "all")


rospy.init_node("server")
kept = Server()
rospy.spin()
"""
CLIENT = """
import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus
from example_interfaces.msg import FibonacciAction, FibonacciGoal
rospy.init_node("client")
client = actionlib.SimpleActionClient("fibonacci", FibonacciAction)
out(client.wait_for_server(rospy.Duration(5)))
"""


def test_a_goal_succeeds_with_feedback_and_result(stage: Any) -> None:
    stage.script("server", SERVER)
    stage.script(
        "client",
        CLIENT
        + """
def done(state, result):
    out((state, list(result.sequence)))
client.send_goal(FibonacciGoal(3), done, lambda: out("active"), lambda got: out(len(got.sequence)))
out(client.get_state() == GoalStatus.PENDING)
out(client.wait_for_result())
out((client.get_state(), client.get_goal_status_text(), rospy.get_time()))
out((actionlib.GoalStatus.to_string(client.get_state()), actionlib.CommState.to_string(6)))
out(client.send_goal_and_wait(FibonacciGoal(20), rospy.Duration(1.2)))
out((client.wait_for_result(rospy.Duration(0.1)), list(client.get_result().sequence)))
""",
    )
    found = stage.run(20 * S)
    assert found[:9] == [True, True, "active", 3, 4, 5, (3, [0, 1, 1, 2, 3]), True, (3, "all", 1.51)]
    assert found.pop(9) == ("SUCCEEDED", "PREEMPTING")
    assert found[9:] == [GoalStatus.PREEMPTED, (True, [0, 1, 1, 2, 3])]


def test_a_new_goal_preempts_the_one_before_and_exceptions_abort(stage: Any) -> None:
    stage.script("server", SERVER)
    stage.script(
        "client",
        CLIENT
        + """
client.send_goal(FibonacciGoal(20), lambda state, result: out("forgotten"))
rospy.sleep(1.2)
client.send_goal(FibonacciGoal(1))
client.wait_for_result()
out((client.get_state(), list(client.get_result().sequence)))
out((client.send_goal_and_wait(FibonacciGoal(99)), client.get_goal_status_text()))
out(actionlib.SimpleActionClient("nobody", FibonacciAction).wait_for_server(rospy.Duration(2)))
out(rospy.get_time() > 4.0)
try:
    actionlib.SimpleActionClient("fibonacci", FibonacciGoal)
except actionlib.ActionException as error:
    out("ends in Action" in str(error))
""",
    )
    found = stage.run(20 * S)
    text = "Exception in execute callback: no order of 99"
    assert found == [True, (3, [0, 1, 1]), (GoalStatus.ABORTED, text), False, True, True]
    assert "execute_cb raised ValueError: no order of 99" in str(stage.of(Failure)[0])


def test_handles_of_both_sides_and_the_wire(stage: Any) -> None:
    stage.script(
        "server",
        """
import actionlib
import rospy
from example_interfaces.msg import FibonacciAction
rospy.init_node("server")
goals = []
def take(handle):
    if handle.get_goal().order < 0:
        handle.set_rejected(text="negative")
        return
    handle.set_accepted("begun")
    goals.append(handle)
server = actionlib.ActionServer("fibonacci", FibonacciAction, take, lambda one: one.set_canceled(), False)
server.start()
rospy.sleep(3)
goals[-1].set_succeeded(text="late")
rospy.spin()
""",
    )
    stage.script(
        "client",
        """
import actionlib
import rospy
from actionlib_msgs.msg import GoalStatusArray
from example_interfaces.msg import FibonacciAction, FibonacciGoal
rospy.init_node("client")
statuses = []
rospy.Subscriber("fibonacci/status", GoalStatusArray, statuses.append)
client = actionlib.ActionClient("fibonacci", FibonacciAction)
client.wait_for_server()
states = [[], [], []]
handles = [
    client.send_goal(FibonacciGoal(order), lambda one, to=to: to.append(one.get_comm_state()))
    for order, to in zip((-1, 1, 2), states)
]
rospy.sleep(0.5)
handles[1].cancel()
rospy.sleep(4)
out(states)
out([one.get_terminal_state() for one in handles])
out([one.get_goal_status_text() for one in handles])
out(handles[0] == handles[1])
out([(one.goal_id.id, one.status) for one in statuses[-1].status_list])
rospy.sleep(6)
out(len(statuses[-1].status_list))
""",
    )
    waiting, pending, active = CommState.WAITING_FOR_RESULT, CommState.PENDING, CommState.ACTIVE
    found = stage.run(20 * S)
    assert found[0] == [
        [pending, waiting, CommState.DONE],
        [active, CommState.WAITING_FOR_CANCEL_ACK, CommState.PREEMPTING, waiting, CommState.DONE],
        [active, waiting, CommState.DONE],
    ]
    assert found[1] == [GoalStatus.REJECTED, GoalStatus.PREEMPTED, GoalStatus.SUCCEEDED]
    assert found[2:4] == [["negative", "", "late"], False]
    assert [status for _, status in found[4]] == [5, 2, 3]
    assert found[4][0][0].startswith("/client-1-0.")
    assert found[5] == 2  # the rejected one is held by nobody


def test_messages_are_those_that_ros1_makes_of_an_action() -> None:
    assert message_name("example_interfaces/FibonacciResult") == "example_interfaces/msg/FibonacciResult"
    assert define_ros1_action("example_interfaces", "FibonacciActionGoal")
    assert not define_ros1_action("example_interfaces", "FibonacciGoals")
    goal = message_class("example_interfaces/msg/FibonacciActionGoal")
    assert goal.__match_args__ == ("header", "goal_id", "goal")
    # of actionlib_tutorials 0.2.0, which has the same definition
    assert ros1_type("example_interfaces/msg/FibonacciActionGoal").md5 == "006871c7fa1d0e3d5fe2226bf17b2a94"
    assert ros1_type("example_interfaces/msg/FibonacciAction").md5 == "f59df5767bf7634684781c92598b2406"


@pytest.mark.parametrize(
    ("state", "status", "passed"),
    [
        (CommState.WAITING_FOR_GOAL_ACK, GoalStatus.PREEMPTED, (2, 6, 3)),
        (CommState.ACTIVE, GoalStatus.PENDING, None),
        (CommState.WAITING_FOR_RESULT, GoalStatus.ABORTED, ()),
        (CommState.WAITING_FOR_CANCEL_ACK, GoalStatus.RECALLED, (5, 3)),
    ],
)
def test_steps_of_a_client(state: int, status: int, passed: Any) -> None:
    assert steps(state, status) == passed
