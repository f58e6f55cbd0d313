"""Names of rclpy beside those that every file uses. What is expected was observed on rclpy 7.1 (Jazzy)."""

from __future__ import annotations

import pytest

from volery.base.time import S
from volery.ros.client_libraries.library_base import Launch

from .conftest import Stage

NODE = """
import rclpy
from rclpy.node import Node
from std_msgs.msg import String
rclpy.init()
n = rclpy.create_node("n")
"""


def said(stage: Stage, text: str, until: int = 10 * S) -> list[object]:
    """Return what a file says that has a node ``n``."""
    stage.script("n", NODE + text)
    return stage.run(until)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("QoSProfile(depth=1) == QoSProfile(depth=1)", True),
        ("QoSProfile(depth=1) == QoSProfile(depth=2)", False),
        ("QoSProfile(history=HistoryPolicy.KEEP_ALL).depth", 10),
        ("qos_profile_system_default.depth", 0),
        ("QoSPresetProfiles.SENSOR_DATA.value.depth", 5),
        ("QoSPresetProfiles.PARAMETER_EVENTS.name", "PARAMETERS"),
        ("QoSPresetProfiles.get_from_short_key('parameters').depth", 1000),
        ("ReliabilityPolicy.RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT", 2),
        ("ReliabilityPolicy.get_from_short_key('best_effort')", 2),
        ("HistoryPolicy.KEEP_LAST.short_key", "keep_last"),
        ("qos_policy_name_from_kind(16)", "RELIABILITY"),
        (
            "qos_check_compatible(qos_profile_sensor_data, qos_profile_default)",
            "ERROR: Best effort publisher and reliable subscription;",
        ),
    ],
)
@pytest.mark.filterwarnings("ignore:.*is deprecated")
def test_profiles(stage: Stage, given: str, expected: object) -> None:
    names = (
        "QoSProfile, HistoryPolicy, ReliabilityPolicy, QoSPresetProfiles, qos_check_compatible, "
        "qos_policy_name_from_kind, qos_profile_default, qos_profile_sensor_data, qos_profile_system_default"
    )
    found = said(stage, f"from rclpy.qos import {names}\nout({given})")[0]
    assert (found[1] if isinstance(found, tuple) else found) == expected


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("QoSProfile()", "History and/or depth settings are required."),
        ("QoSProfile(depth='1')", "is no int"),
        ("QoSProfile(depth=1, deadline=2)", "is no Duration"),
        ("QoSProfile(depth=1, dept=2)", "Invalid arguments passed to constructor: dept"),
        ("ReliabilityPolicy.BEST", "ReliabilityPolicy.BEST is not there"),
        (
            "n.create_publisher(String, 'a b', 1)",
            "Invalid topic name: topic name must not contain characters",
        ),
        ("n.create_publisher(String, 'a/', 1)", "must not end with a forward slash:\n  'a/'\n    ^"),
        ("n.create_publisher(String, '1a', 1)", "token must not start with a number:\n  '1a'\n   ^"),
        ("n.create_subscription(String, 'a', None, 1)", "callback should be either be callable"),
        ("n.create_timer(-1.0, print)", "timer period must be non-negative"),
        ("n.get_publisher_names_and_types_by_node('x', '/')", "nonexistent node: /x"),
        ("n.add_waitable(None)", "use a guard condition"),
        ("rclpy.waitable", "rclpy.waitable is not there on the embedded graph; there is no wait set of rcl"),
        ("rclpy.qos.QoSProfil", "(did you mean 'QoSProfile'?)"),
    ],
)
def test_what_is_refused_says_why(stage: Stage, given: str, expected: str) -> None:
    text = f"""
from rclpy.qos import QoSProfile, ReliabilityPolicy
try:
    {given}
except Exception as error:
    out(str(error.args))
"""
    found = str(said(stage, text)[0])
    assert repr(expected)[1:-1] in found or expected in found
    assert len(found) < 330


def test_names_are_checked_and_expanded(stage: Stage) -> None:
    text = """
from rclpy.expand_topic_name import expand_topic_name
from rclpy.topic_or_service_is_hidden import topic_or_service_is_hidden
from rclpy.validate_namespace import validate_namespace
from rclpy.validate_topic_name import validate_topic_name
for name in ("a", "~/a", "{node}/a", "{ns}/a", "/a"):
    out(expand_topic_name(name, "n", "/ns"))
out(validate_topic_name("a__b"))
out(topic_or_service_is_hidden("/a/_b"))
out(n.create_publisher(String, "cam__left", 1).topic_name)
out(n.create_publisher(String, "{node}/x", 1).topic_name)
try:
    validate_namespace("/a//b")
except Exception as error:
    out(type(error).__name__)
"""
    expanded = ["/ns/a", "/ns/n/a", "/ns/n/a", "/ns/a", "/a"]
    rest = [True, True, "/cam__left", "/n/x", "InvalidNamespaceException"]
    assert said(stage, text) == expanded + rest


def test_matched_and_incompatible_counterparts_are_reported(stage: Stage) -> None:
    text = """
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.qos import QoSProfile, ReliabilityPolicy
events = PublisherEventCallbacks(matched=lambda i: out((i.current_count, i.current_count_change)))
n.create_publisher(String, "a", 10, event_callbacks=events)
ears = [n.create_subscription(String, "a", print, 10) for _ in range(2)]
rclpy.spin_once(n, timeout_sec=1)
n.destroy_subscription(ears[0])
rclpy.spin_once(n, timeout_sec=1)
best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
n.create_publisher(String, "b", best_effort)
wanted = SubscriptionEventCallbacks(
    incompatible_qos=lambda i: out((i.total_count, i.last_policy_kind.name)), matched=lambda i: out("matched")
)
n.create_subscription(String, "b", print, 10, event_callbacks=wanted)
rclpy.spin_once(n, timeout_sec=1)
"""
    assert said(stage, text) == [(2, 2), (1, -1), (1, "RELIABILITY")]


def test_deadlines_leases_and_lifespans_count_in_virtual_time(stage: Stage) -> None:
    text = """
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile
profile = QoSProfile(depth=10, deadline=Duration(seconds=0.5), lifespan=Duration(seconds=1.0),
                     durability=DurabilityPolicy.TRANSIENT_LOCAL, liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
                     liveliness_lease_duration=Duration(seconds=0.7))
offered = PublisherEventCallbacks(liveliness=lambda i: out(("lost", i.total_count)))
p = n.create_publisher(String, "a", profile, event_callbacks=offered)
requested = SubscriptionEventCallbacks(
    deadline=lambda i: out(("deadline", i.total_count)),
    liveliness=lambda i: out(("alive", i.alive_count, i.not_alive_count)))
n.create_subscription(String, "a", lambda m: out(m.data), profile, event_callbacks=requested)
p.publish(String(data="x"))
end = n.get_clock().now() + Duration(seconds=0.9)
while n.get_clock().now() < end:
    rclpy.spin_once(n, timeout_sec=0.1)
n.get_clock().sleep_for(Duration(seconds=1.0))
n.create_subscription(String, "a", lambda m: out("too late"), profile)
rclpy.spin_once(n, timeout_sec=0.1)
"""
    found = said(stage, text)
    assert found[:5] == ["x", ("alive", 1, 0), ("deadline", 1), ("lost", 1), ("alive", 0, 1)]
    assert "too late" not in found


def test_parameters_override_a_profile(stage: Stage) -> None:
    text = """
from rclpy.parameter import Parameter
from rclpy.qos_overriding_options import QoSOverridingOptions
m = rclpy.create_node("m", parameter_overrides=[
    Parameter("qos_overrides./a.publisher.depth", value=3),
    Parameter("qos_overrides./a.publisher.reliability", value="best_effort")])
p = m.create_publisher(String, "a", 10, qos_overriding_options=QoSOverridingOptions.with_default_policies())
out((p.qos_profile.depth, p.qos_profile.reliability.short_key))
out(m.get_publishers_info_by_topic("a")[0].qos_profile.reliability.name)
"""
    assert said(stage, text) == [(3, "best_effort"), "BEST_EFFORT"]


def test_parameters_of_other_nodes(stage: Stage) -> None:
    text = """
from rclpy.parameter_client import AsyncParameterClient
from rclpy.parameter_event_handler import ParameterEventHandler
handler = ParameterEventHandler(n)
handler.add_parameter_callback("a", "n", lambda p: out(p.value.integer_value))
handler.add_parameter_event_callback(
    lambda e: out(([p.name for p in e.new_parameters], [p.name for p in e.changed_parameters])))
n.declare_parameter("a", 1)
n.add_pre_set_parameters_callback(lambda ps: [rclpy.Parameter(p.name, value=p.value + 1) for p in ps])
n.add_post_set_parameters_callback(lambda ps: out(("set", ps[0].value)))
client = AsyncParameterClient(n, "n")
out(client.wait_for_services(1.0))
future = client.set_parameters([rclpy.Parameter("a", value=7)])
rclpy.spin_until_future_complete(n, future)
out(future.result().results[0].successful)
rclpy.spin_once(n, timeout_sec=1)
out(n.get_parameter("use_sim_time").value)
"""
    found = said(stage, text)
    assert found == [True, 1, (["a"], []), ("set", 8), 8, ([], ["a"]), True, False]


def test_guard_conditions_raw_messages_and_infos(stage: Stage) -> None:
    text = """
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.wait_for_message import wait_for_message
guard = n.create_guard_condition(lambda: out("guard"))
guard.trigger()
guard.trigger()
rclpy.spin_once(n, timeout_sec=1)
p = n.create_publisher(String, "a", 1)
n.create_subscription(String, "a", lambda m: out(deserialize_message(m, String).data), 1, raw=True)
n.create_subscription(String, "a", lambda m, info: out(info["reception_sequence_number"]), 1)
p.publish(String(data="x"))
for _ in range(2):
    rclpy.spin_once(n, timeout_sec=1)
p.publish(serialize_message(String(data="y")))
for _ in range(3):
    rclpy.spin_once(n, timeout_sec=0.1)
out(wait_for_message(String, n, "nobody", time_to_wait=0.2))
"""
    assert said(stage, text) == ["guard", "x", 1, "y", 2, (False, None)]


def test_an_executor_and_a_callback_group_of_the_user(stage: Stage) -> None:
    text = """
from rclpy.callback_groups import CallbackGroup
from rclpy.executors import Executor, TimeoutException

class Three(CallbackGroup):
    left = 3
    def can_execute(self, entity):
        return self.left > 0
    def beginning_execution(self, entity):
        self.left -= 1
        return True

class Own(Executor):
    def spin_once(self, timeout_sec=None):
        try:
            task, entity, node = self.wait_for_ready_callbacks(timeout_sec=timeout_sec)
        except TimeoutException:
            out("nothing")
            return
        out((type(entity).__name__, node is n))
        task()

n.create_timer(0.1, lambda: out("tick"), callback_group=Three())
executor = Own()
executor.add_node(n)
for _ in range(4):
    executor.spin_once(timeout_sec=1.0)
"""
    assert said(stage, text) == [("Timer", True), "tick"] * 3 + ["nothing"]


def test_coroutines_of_services_and_timers(stage: Stage) -> None:
    text = """
from std_srvs.srv import Trigger
gate = rclpy.Future()

async def serve(request, response):
    response.message = await gate
    return response

async def tick():
    out("tick")

n.create_service(Trigger, "t", serve)
n.create_timer(1.0, tick)
client = n.create_client(Trigger, "t")
future = client.call_async(Trigger.Request())
n.create_timer(2.5, lambda: gate.done() or gate.set_result("open"))
rclpy.spin_until_future_complete(n, future)
out(future.result().message)
"""
    assert said(stage, text) == ["tick", "tick", "open"]


def test_a_request_without_a_server_is_never_answered(stage: Stage) -> None:
    text = """
from rclpy.action import ActionClient
from example_interfaces.action import Fibonacci
from std_srvs.srv import Trigger
asked = [n.create_client(Trigger, "t").call_async(Trigger.Request()),
         ActionClient(n, Fibonacci, "f").send_goal_async(Fibonacci.Goal(order=1))]
for future in asked:
    future.add_done_callback(lambda one: out(one.result()))
    rclpy.spin_until_future_complete(n, future, timeout_sec=1.0)
    out(future.done())
try:
    n.create_client(Trigger, "t").call(Trigger.Request(), timeout_sec=1.0)
except TimeoutError:
    out("late")
"""
    assert said(stage, text) == [False, False, "late"]


def test_a_goal_has_the_states_and_the_codes_of_ros(stage: Stage) -> None:
    text = """
from rclpy.action import ActionClient, ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.duration import Duration
from rclpy.executors import MultiThreadedExecutor
from example_interfaces.action import Fibonacci

async def execute(goal):
    order = goal.request.order
    if order == 4:
        goal.abort()
    elif order == 5:
        while not goal.is_cancel_requested:
            n.get_clock().sleep_for(Duration(seconds=0.1))
        goal.canceled()
    elif order != 3:
        n.get_clock().sleep_for(Duration(seconds=0.5))
        goal.succeed()
    return Fibonacci.Result(sequence=[order])

group = ReentrantCallbackGroup()
allowed = lambda goal: CancelResponse.ACCEPT if goal.request.order == 5 else CancelResponse.REJECT
ActionServer(n, Fibonacci, "f", execute, callback_group=group, cancel_callback=allowed)
client = ActionClient(n, Fibonacci, "f", callback_group=group)
executor = MultiThreadedExecutor(4)
executor.add_node(n)

def wait(future):
    executor.spin_until_future_complete(future)
    return future.result()

for order in (1, 3, 4, 5):
    goal = wait(client.send_goal_async(Fibonacci.Goal(order=order)))
    codes = [wait(goal.cancel_goal_async()).return_code] if order in (1, 5) else []
    status = wait(goal.get_result_async()).status
    executor.spin_once(timeout_sec=0.1)
    codes.append(wait(goal.cancel_goal_async()).return_code)
    out((order, int(status), int(goal.status), [int(one) for one in codes]))
"""
    assert said(stage, text) == [(1, 4, 4, [0, 3]), (3, 6, 6, [3]), (4, 6, 6, [3]), (5, 5, 5, [0, 3])]


def test_a_parameter_may_be_named_like_the_namespace_of_others(stage: Stage) -> None:
    stage.launched["n"] = Launch(parameters={"pos.first": 2.0})
    text = """
from rclpy.parameter import Parameter
n.declare_parameter("pos", Parameter.Type.DOUBLE_ARRAY)
out(n.declare_parameter("pos.first", 1.0).value)
out(n.declare_parameter("a-b", 3).value)
"""
    assert said(stage, text) == [2.0, 3]


def test_what_a_launch_file_states_is_declared_if_the_node_asks_for_it(stage: Stage) -> None:
    stage.launched["n"] = Launch(parameters={"walk": {"axis": 1}, "walk.linear-x.scale": 0.5})
    own = """
import rclpy
rclpy.init()
n = rclpy.create_node("n", automatically_declare_parameters_from_overrides=True)
out(sorted(n._parameters))
out(n.get_parameter("walk.linear-x.scale").value)
"""
    stage.script("n", own)
    assert stage.run(S) == [["use_sim_time", "walk.axis", "walk.linear-x.scale"], 0.5]


def test_a_node_serves_the_levels_of_its_loggers(stage: Stage) -> None:
    text = """
from rcl_interfaces.msg import LoggerLevel
from rcl_interfaces.srv import GetLoggerLevels, SetLoggerLevels
m = rclpy.create_node("m", enable_logger_service=True)
change = n.create_client(SetLoggerLevels, "/m/set_logger_levels")
ask = n.create_client(GetLoggerLevels, "/m/get_logger_levels")
executor = rclpy.executors.SingleThreadedExecutor()
executor.add_node(n)
executor.add_node(m)
level = LoggerLevel(name="m", level=LoggerLevel.LOG_LEVEL_ERROR)
for request in (change.call_async(SetLoggerLevels.Request(levels=[level])),
                ask.call_async(GetLoggerLevels.Request(names=["m", "other"]))):
    executor.spin_until_future_complete(request)
out([one.level for one in request.result().levels])
out(m.get_logger().info("quiet"))
"""
    assert said(stage, text) == [[40, 0], False]


def test_spin_returns_and_an_executor_raises_when_another_thread_shuts_down(stage: Stage) -> None:
    text = """
n.create_timer(1.0, rclpy.shutdown)
rclpy.spin(n)
out("returned")
rclpy.init()
m = rclpy.create_node("m")
executor = rclpy.executors.SingleThreadedExecutor()
executor.add_node(m)
n.context.spawn(rclpy.shutdown, "another thread")
try:
    executor.spin()
except rclpy.executors.ExternalShutdownException:
    out("raised")
"""
    assert said(stage, text) == ["returned", "raised"]


def test_futures_and_coroutines_of_transforms(stage: Stage) -> None:
    text = """
from geometry_msgs.msg import TransformStamped
from tf2_ros import Buffer, TransformBroadcaster, TransformListener
buffer = Buffer()
listener = TransformListener(buffer, n)
future = buffer.wait_for_transform_async("map", "base", rclpy.time.Time())
task = None

async def look():
    found = await buffer.lookup_transform_async("map", "base", rclpy.time.Time())
    out(found.transform.translation.x)

sent = TransformStamped(child_frame_id="base")
sent.header.frame_id, sent.transform.translation.x, sent.transform.rotation.w = "map", 2.0, 1.0
broadcaster = TransformBroadcaster(n)
executor = rclpy.executors.SingleThreadedExecutor()
executor.add_node(n)
task = executor.create_task(look)
n.create_timer(1.0, lambda: broadcaster.sendTransform(sent))
executor.spin_until_future_complete(future)
out(n.get_clock().now().nanoseconds // 10**9)
executor.spin_until_future_complete(task)
"""
    assert said(stage, text) == [1, 2.0]


def test_a_log_call_keeps_its_severity_and_its_filters(stage: Stage) -> None:
    text = """
from rclpy.duration import Duration
log = n.get_logger()
def attempt(call, *args, **options):
    try:
        out(call(*args, **options))
    except (TypeError, ValueError) as error:
        out(str(error))
for call in (log.info, log.error):
    try:
        call("a")
    except ValueError as error:
        out(str(error))
for options in ({}, {"once": True}):
    try:
        log.info("b", **options)
    except ValueError as error:
        out(str(error))
attempt(log.warning, 5)
attempt(lambda: log.info("c", twice=True))
out([log.info("d", once=True) for _ in range(3)])
out([log.info("e", skip_first=True) for _ in range(3)])
said = []
for _ in range(4):
    said.append(log.info(f"f {_}", throttle_duration_sec=1.0))
    n.get_clock().sleep_for(Duration(seconds=0.6))
out(said)
"""
    found = said(stage, text)
    assert found[:3] == [
        "Logger severity cannot be changed between calls.",
        "Requested logging filters cannot be changed between calls.",
        "a log line is a str, not 5; use str() or an f-string",
    ]
    assert "'twice' is not one of the recognized logging options" in str(found[3])
    assert found[4:] == [[True, False, False], [False, True, True], [True, False, True, False]]
