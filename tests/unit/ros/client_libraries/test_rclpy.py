"""Files as they are written for rclpy, run on the embedded graph in virtual time."""

from __future__ import annotations

from typing import Any

import pytest

from volery.base.time import MS, S
from volery.trace.events import Published, Text

from .conftest import Stage

TALKER = """
import rclpy
from rclpy.node import Node
from std_msgs.msg import String

class Talker(Node):
    def __init__(self):
        super().__init__("talker_of_the_file")
        self.publisher = self.create_publisher(String, "chatter", 10)
        self.timer = self.create_timer(0.5, self.tick)
        self.count = 0

    def tick(self):
        message = String()
        message.data = f"Hello {self.count}"
        self.publisher.publish(message)
        self.get_logger().info(f"sent {message.data}")
        self.count += 1

def main(args=None):
    rclpy.init(args=args)
    node = Talker()
    rclpy.spin(node)
    node.destroy_node()
    rclpy.shutdown()

main()
"""

LISTENER = """
import rclpy
from rclpy.node import Node
from std_msgs.msg import String

class Listener(Node):
    def __init__(self):
        super().__init__("listener")
        self.create_subscription(String, "chatter", self.received, 10)

    def received(self, message):
        out((self.get_clock().now().nanoseconds, message.data))
        if message.data.endswith("3"):
            rclpy.shutdown()

rclpy.init()
rclpy.spin(Listener())
out("ended")
"""


def test_a_talker_and_a_listener(stage: Stage) -> None:
    stage.script("talker", TALKER)
    stage.script("listener", LISTENER)
    received = stage.run(5 * S)
    assert received == [(500 * MS * (n + 1), f"Hello {n}") for n in range(4)] + ["ended"]
    assert [text.text for text in stage.of(Text)][:2] == ["sent Hello 0", "sent Hello 1"]
    assert {event.topic for event in stage.of(Published)} == {"/chatter"}


def test_the_file_names_the_node_unless_the_model_does(stage: Stage) -> None:
    stage.launched["camera"] = stage_launch(namespace="/drone_1", remaps={"chatter": "words"})
    stage.launched["other"] = stage_launch(node_name="by_model")
    for name in stage.launched:
        stage.script(name, TALKER)
    stage.run(S)
    assert stage.graph.node_names() == ["/by_model", "/drone_1/talker_of_the_file"]
    assert stage.graph.topics()[1].name == "/drone_1/words"


def stage_launch(**given: Any) -> Any:
    from volery.ros.client_libraries.library_base import Launch

    return Launch(**given)


ADDER = """
import rclpy
from rclpy.node import Node
from example_interfaces.srv import AddTwoInts

class Adder(Node):
    def __init__(self):
        super().__init__("adder")
        self.create_service(AddTwoInts, "add_two_ints", self.add)

    def add(self, request, response):
        response.sum = request.a + request.b
        return response

rclpy.init()
rclpy.spin(Adder())
"""

ASKER = """
import rclpy
from rclpy.node import Node
from example_interfaces.srv import AddTwoInts

class Asker(Node):
    def __init__(self):
        super().__init__("asker")
        self.client = self.create_client(AddTwoInts, "add_two_ints")
        while not self.client.wait_for_service(timeout_sec=1.0):
            out("waiting")

    def ask(self, a, b):
        request = AddTwoInts.Request()
        request.a, request.b = a, b
        future = self.client.call_async(request)
        rclpy.spin_until_future_complete(self, future)
        return future.result()

rclpy.init()
asker = Asker()
out(asker.ask(2, 40).sum)
asker.destroy_node()
rclpy.shutdown()
"""


def test_a_service_and_its_client(stage: Stage) -> None:
    stage.script("asker", ASKER)
    stage.kernel.call_at(2500 * MS, lambda: stage.script("adder", ADDER))
    assert stage.run(5 * S) == ["waiting", "waiting", 42]


def test_a_blocking_call_needs_another_task_that_spins(stage: Stage) -> None:
    stage.script("adder", ADDER)
    stage.script(
        "asker",
        """
        import rclpy
        from example_interfaces.srv import AddTwoInts
        rclpy.init()
        node = rclpy.create_node("asker")
        client = node.create_client(AddTwoInts, "add_two_ints")
        try:
            client.call(AddTwoInts.Request(a=1, b=2), timeout_sec=1.0)
        except TimeoutError as error:
            out(str(error))
        """,
    )
    assert stage.run(5 * S) == ["no answer from /add_two_ints within 1.0 s"]


def test_a_blocking_call_from_a_callback_under_threads(stage: Stage) -> None:
    stage.script("adder", ADDER)
    stage.script(
        "asker",
        """
        import rclpy
        from rclpy.callback_groups import ReentrantCallbackGroup
        from rclpy.executors import MultiThreadedExecutor
        from example_interfaces.srv import AddTwoInts
        rclpy.init()
        node = rclpy.create_node("asker")
        group = ReentrantCallbackGroup()
        client = node.create_client(AddTwoInts, "add_two_ints", callback_group=group)
        def tick():
            timer.cancel()
            out(client.call(AddTwoInts.Request(a=1, b=2)).sum)
            rclpy.shutdown()
        timer = node.create_timer(0.1, tick, callback_group=group)
        executor = MultiThreadedExecutor()
        executor.add_node(node)
        executor.spin()
        out("ended")
        """,
    )
    assert stage.run(5 * S) == [3, "ended"]


def test_an_exclusive_group_keeps_its_callbacks_apart(stage: Stage) -> None:
    text = """
        import rclpy
        from rclpy.callback_groups import {group}
        from rclpy.executors import MultiThreadedExecutor
        from rclpy.duration import Duration
        rclpy.init()
        node = rclpy.create_node("worker")
        group = {group}()
        def work(name):
            out(("begin", name))
            node.get_clock().sleep_for(Duration(seconds=1.0))
            out(("end", name))
        one = node.create_timer(1.0, lambda: (one.cancel(), work("one")), callback_group=group)
        two = node.create_timer(1.0, lambda: (two.cancel(), work("two")), callback_group=group)
        executor = MultiThreadedExecutor(2)
        executor.add_node(node)
        executor.spin()
        """
    stage.script("apart", text.format(group="MutuallyExclusiveCallbackGroup"))
    apart = stage.run(5 * S)
    assert apart == [("begin", "one"), ("end", "one"), ("begin", "two"), ("end", "two")]
    beside = Stage()
    beside.script("beside", text.format(group="ReentrantCallbackGroup"))
    assert [what for what, _ in beside.run(5 * S)] == ["begin", "begin", "end", "end"]


def test_coroutines_are_carried_on(stage: Stage) -> None:
    stage.script("adder", ADDER)
    stage.script(
        "asker",
        """
        import rclpy
        from example_interfaces.srv import AddTwoInts
        rclpy.init()
        node = rclpy.create_node("asker")
        client = node.create_client(AddTwoInts, "add_two_ints")
        async def tick():
            timer.cancel()
            first = await client.call_async(AddTwoInts.Request(a=1, b=2))
            second = await client.call_async(AddTwoInts.Request(a=first.sum, b=10))
            out(second.sum)
            rclpy.shutdown()
        timer = node.create_timer(0.5, tick)
        rclpy.spin(node)
        """,
    )
    assert stage.run(5 * S) == [13]


PARAMETERS = """
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.exceptions import ParameterNotDeclaredException, InvalidParameterTypeException
from rcl_interfaces.msg import SetParametersResult

rclpy.init()
node = Node("tuner")
node.declare_parameter("gain", 1.0)
node.declare_parameters("limits", [("low", -1), ("high", 1)])
out(node.get_parameter("gain").value)
out([one.value for one in node.get_parameters(["limits.low", "limits.high"])])
def check(parameters):
    return SetParametersResult(successful=all(one.value < 5 for one in parameters), reason="too much")
node.add_on_set_parameters_callback(check)
out(node.set_parameters([Parameter("gain", value=2.5)])[0].successful)
out(node.set_parameters([Parameter("gain", value=7.5)])[0].reason)
out("is of type" in node.set_parameters([Parameter("gain", value="much")])[0].reason or "type")
out(node.get_parameter("gain").value)
try:
    node.get_parameter("nothing")
except ParameterNotDeclaredException as error:
    out("undeclared")
"""


FIBONACCI = """
import rclpy
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.duration import Duration
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from example_interfaces.action import Fibonacci

class Server(Node):
    def __init__(self):
        super().__init__("server")
        self._server = ActionServer(self, Fibonacci, "fibonacci", self.work,
                                    cancel_callback=lambda goal: CancelResponse.ACCEPT,
                                    callback_group=ReentrantCallbackGroup())

    def work(self, goal):
        feedback = Fibonacci.Feedback(sequence=[0, 1])
        for _ in range(1, goal.request.order):
            if goal.is_cancel_requested:
                goal.canceled()
                return Fibonacci.Result(sequence=feedback.sequence)
            feedback.sequence.append(feedback.sequence[-1] + feedback.sequence[-2])
            goal.publish_feedback(feedback)
            self.get_clock().sleep_for(Duration(seconds=1.0))
        goal.succeed()
        return Fibonacci.Result(sequence=feedback.sequence)

rclpy.init()
executor = MultiThreadedExecutor()
executor.add_node(Server())
executor.spin()
"""

GOAL = """
import rclpy
from rclpy.action import ActionClient
from rclpy.node import Node
from example_interfaces.action import Fibonacci

class Client(Node):
    def __init__(self):
        super().__init__("client")
        self._client = ActionClient(self, Fibonacci, "fibonacci")
        self._cancel_after = {cancel_after}

    def go(self):
        self._client.wait_for_server()
        sent = self._client.send_goal_async(Fibonacci.Goal(order=5), feedback_callback=self.fed_back)
        sent.add_done_callback(self.answered)

    def answered(self, future):
        self._goal = future.result()
        out(self._goal.accepted)
        self._goal.get_result_async().add_done_callback(self.ended)

    def fed_back(self, message):
        out(list(message.feedback.sequence)[-1])
        if len(message.feedback.sequence) == self._cancel_after:
            self._goal.cancel_goal_async()

    def ended(self, future):
        out((future.result().status, list(future.result().result.sequence)))
        rclpy.shutdown()

rclpy.init()
client = Client()
client.go()
rclpy.spin(client)
"""


def test_an_action(stage: Stage) -> None:
    stage.script("server", FIBONACCI)
    stage.script("client", GOAL.format(cancel_after=99))
    assert stage.run(20 * S) == [True, 1, 2, 3, 5, (4, [0, 1, 1, 2, 3, 5])]


def test_an_action_that_is_cancelled(stage: Stage) -> None:
    stage.script("server", FIBONACCI)
    stage.script("client", GOAL.format(cancel_after=4))
    assert stage.run(20 * S) == [True, 1, 2, (5, [0, 1, 1, 2])]


def test_parameters(stage: Stage) -> None:
    stage.launched["tuner"] = stage_launch(parameters={"gain": 2.0, "limits.high": 3})
    stage.script("tuner", PARAMETERS)
    assert stage.run(S) == [2.0, [-1, 3], True, "too much", "type", 2.5, "undeclared"]


def test_a_parameter_is_not_converted_to_the_type_that_is_declared(stage: Stage) -> None:
    stage.launched["tuner"] = stage_launch(parameters={"rate": 50, "gains": (1, 2), "none": ()})
    stage.script(
        "tuner",
        """
        import rclpy
        from rclpy.exceptions import InvalidParameterTypeException
        rclpy.init()
        node = rclpy.create_node("tuner")
        for name, default in (("rate", 50.0), ("gains", [1.0, 2.0]), ("none", [1.0]), ("rate", 5)):
            try:
                out(node.declare_parameter(name, default).value)
            except InvalidParameterTypeException as error:
                out(str(error))
        """,
    )
    assert stage.run(S) == [
        "Trying to set parameter 'rate' to '50' of type 'INTEGER', expecting type 'DOUBLE': rate",
        "Trying to set parameter 'gains' to '[1, 2]' of type 'INTEGER_ARRAY', "
        "expecting type 'DOUBLE_ARRAY': gains",
        [],
        50,
    ]


def test_a_sequence_beyond_its_bound_is_not_published(stage: Stage) -> None:
    """Observed with Jazzy and Kilted on Fast DDS; a string may be longer than its bound."""
    stage.script(
        "bound",
        """
import rclpy
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
rclpy.init()
node = rclpy.create_node("bound")
node.create_subscription(ParameterDescriptor, "ranges", lambda one: out(len(one.floating_point_range)), 10)
ranges = node.create_publisher(ParameterDescriptor, "ranges", 10)
for length in (1, 2, 0):
    try:
        ranges.publish(ParameterDescriptor(floating_point_range=[FloatingPointRange()] * length))
    except RuntimeError as error:
        out(str(error))
    rclpy.spin_once(node, timeout_sec=0.1)
""",
    )
    why = "floating_point_range has 2 items, at most 1 are allowed"
    assert stage.run(2 * S) == [1, f"Failed to publish: cannot publish data: {why}", 0]


def test_time(stage: Stage) -> None:
    stage.script(
        "clock",
        """
        import rclpy
        from rclpy.duration import Duration
        from rclpy.time import Time
        rclpy.init()
        node = rclpy.create_node("clock")
        start = node.get_clock().now()
        rate = node.create_rate(10.0)
        for _ in range(3):
            rate.sleep()
        out((node.get_clock().now() - start).nanoseconds)
        out((Time(seconds=1) + Duration(seconds=0.5)).seconds_nanoseconds())
        out(Time.from_msg(start.to_msg()) == start)
        try:
            out(Time(seconds=1) < start)
        except TypeError as error:
            out(str(error))
        """,
    )
    expected = [300 * MS, (1, 500_000_000), True, "Can't compare times with different clock types"]
    assert stage.run(S) == expected


def test_what_is_not_there_says_so(stage: Stage) -> None:
    stage.script(
        "user",
        """
        import rclpy
        for name in ("components", "logging"):
            try:
                out(getattr(rclpy, name).__name__)
            except AttributeError as error:
                out(str(error).partition(";")[0])
        try:
            rclpy.create_node("too_early")
        except Exception as error:
            out(type(error).__name__)
        rclpy.init()
        try:
            rclpy.create_node("no name")
        except Exception as error:
            out(type(error).__name__)
        """,
    )
    assert stage.run(S) == [
        "rclpy.components is not there on the embedded graph",
        "rclpy.logging",
        "NotInitializedException",
        "InvalidNodeNameException",
    ]


def test_a_latched_topic_reaches_those_who_come_late(stage: Stage) -> None:
    stage.script(
        "map",
        """
        import rclpy
        from rclpy.qos import QoSProfile, DurabilityPolicy
        from std_msgs.msg import Int32
        rclpy.init()
        node = rclpy.create_node("map")
        qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_publisher(Int32, "map", qos).publish(Int32(data=7))
        node.get_clock().sleep_for(rclpy.duration.Duration(seconds=2))
        late = rclpy.create_node("late")
        late.create_subscription(Int32, "map", lambda message: out(message.data), qos)
        rclpy.spin_once(late, timeout_sec=1.0)
        """,
    )
    assert stage.run(5 * S) == [7]


def test_what_a_profile_leaves_to_the_middleware(stage: Stage) -> None:
    """As endpoints of rclpy Jazzy state it, on Fast DDS."""
    stage.script(
        "user",
        """
        import rclpy
        from rclpy.qos import qos_profile_sensor_data, qos_profile_system_default as default
        from std_msgs.msg import Int32
        rclpy.init()
        node = rclpy.create_node("user")
        node.create_subscription(Int32, "sensor", lambda message: out(message.data), default)
        node.create_publisher(Int32, "sensor", qos_profile_sensor_data).publish(Int32(data=1))
        rclpy.spin_once(node, timeout_sec=1.0)
        node.create_publisher(Int32, "map", default)
        [writer] = node.get_publishers_info_by_topic("/map")
        [reader] = node.get_subscriptions_info_by_topic("/sensor")
        for one in (writer.qos_profile, reader.qos_profile):
            out((one.reliability.name, one.durability.name))
        """,
    )
    assert stage.run(5 * S) == [1, ("RELIABLE", "TRANSIENT_LOCAL"), ("BEST_EFFORT", "VOLATILE")]


@pytest.mark.parametrize("given", ["'ten'", "True", "-1"])
def test_a_quality_of_service_that_is_none(stage: Stage, given: str) -> None:
    stage.script(
        "user",
        f"""
        import rclpy
        from std_msgs.msg import Int32
        rclpy.init()
        try:
            rclpy.create_node("user").create_publisher(Int32, "numbers", {given})
        except (TypeError, ValueError) as error:
            out(type(error).__name__)
        """,
    )
    assert stage.run(S) == ["ValueError" if given == "-1" else "TypeError"]
