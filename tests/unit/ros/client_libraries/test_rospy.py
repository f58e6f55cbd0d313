import textwrap
from types import SimpleNamespace
from typing import Any

import pytest

from volery.base.errors import UsageError
from volery.base.time import MS, S
from volery.kernel.processor import Processor
from volery.kernel.task import ExecutionContext
from volery.ros.client_libraries.rospy import Launch
from volery.trace.events import Activation, Call, Failure, Text

TALKER = """
from std_msgs.msg import String
rospy.init_node("talker")
publisher = rospy.Publisher("chatter", String, queue_size=10)
rate = rospy.Rate(10)
count = 0
while not rospy.is_shutdown() and count < {count}:
    publisher.publish("hello %d" % count)
    count += 1
    rate.sleep()
"""


def test_the_talker_and_the_listener_of_the_tutorials(stage: Any) -> None:
    stage.component(
        "listener",
        """
from std_msgs.msg import String
def callback(data):
    out((rospy.get_time(), data.data))
rospy.init_node("listener", anonymous=True)
rospy.Subscriber("chatter", String, callback)
rospy.spin()
""",
    )
    stage.component("talker", TALKER.format(count=3))
    assert stage.run(S) == [(0.0, "hello 0"), (0.1, "hello 1"), (0.2, "hello 2")]
    assert stage.graph.node_names() == ["/listener_1", "/talker"]


def test_callbacks_run_while_the_main_flow_sleeps_and_each_topic_by_itself(stage: Any) -> None:
    stage.component(
        "listener",
        """
from std_msgs.msg import String
rospy.init_node("listener")
def slow(data):
    rospy.sleep(10)
    out("slow")
rospy.Subscriber("chatter", String, slow)
rospy.Subscriber("chatter", String, lambda data, who: out(who + data.data), "me: ")
rospy.sleep(0.15)
out("main")
""",
    )
    stage.component("talker", TALKER.format(count=3))
    assert stage.run(5 * S) == ["me: hello 0", "me: hello 1", "main", "me: hello 2"]


def test_published_fields_may_be_given_directly(stage: Any) -> None:
    stage.component(
        "both",
        """
from geometry_msgs.msg import Point
from std_msgs.msg import String
rospy.init_node("both")
rospy.Subscriber("a", Point, lambda m: out((m.x, m.y, m.z)))
publisher = rospy.Publisher("a", Point)
publisher.publish(1.0, 2.0, 3.0)
publisher.publish(x=4.0)
publisher.publish(Point(5.0, 6.0, 7.0))
for wrong in (("x",) * 4, (String(),)):
    try:
        publisher.publish(*wrong)
    except (rospy.ROSSerializationException, TypeError) as error:
        out(type(error).__name__)
out((publisher.get_num_connections(), publisher.name))
rospy.sleep(1)
""",
    )
    refused = ["TypeError", "ROSSerializationException"]
    received = [(1.0, 2.0, 3.0), (4.0, 0.0, 0.0), (5.0, 6.0, 7.0)]
    assert stage.run() == [*refused, (1, "/a"), *received]


def test_a_latched_message_reaches_who_comes_late(stage: Any) -> None:
    stage.component(
        "both",
        """
from std_msgs.msg import Int32
rospy.init_node("both")
publisher = rospy.Publisher("map", Int32, latch=True)
publisher.publish(1)
publisher.publish(2)
out(rospy.wait_for_message("map", Int32, timeout=1).data)
""",
    )
    assert stage.run() == [2]


def test_services_take_what_rospy_takes(stage: Any) -> None:
    stage.component(
        "server",
        """
from std_srvs.srv import SetBool, SetBoolResponse, Trigger, Empty
rospy.init_node("server")
rospy.Service("response", SetBool, lambda request: SetBoolResponse(request.data, "response"))
rospy.Service("pair", SetBool, lambda request: (request.data, "pair"))
rospy.Service("dict", SetBool, lambda request: {"success": request.data, "message": "dict"})
rospy.Service("empty", Empty, lambda request: [])
rospy.Service("nothing", Empty, lambda request: None)
rospy.Service("misfit", Trigger, lambda request: (True, 5))
rospy.Service("none", Trigger, lambda request: None)
rospy.spin()
""",
    )
    stage.component(
        "client",
        """
from std_srvs.srv import SetBool, SetBoolRequest, Trigger, Empty
rospy.init_node("client")
for name in ("response", "pair", "dict"):
    rospy.wait_for_service(name)
    proxy = rospy.ServiceProxy(name, SetBool)
    out((proxy(True).message, proxy(data=True).success, proxy.call(SetBoolRequest(data=False)).success))
out(type(rospy.ServiceProxy("empty", Empty)()).__name__)
for name, kind in (("nothing", Empty), ("misfit", Trigger), ("none", Trigger), ("nowhere", Trigger)):
    try:
        rospy.ServiceProxy(name, kind)()
    except rospy.ServiceException as error:
        out(str(error).partition(": ")[0])
""",
    )
    assert stage.run(S) == [
        ("response", True, False),
        ("pair", True, False),
        ("dict", True, False),
        "Empty_Response",
        "service [/nothing]",
        "service [/misfit]",
        "service [/none]",
        "service [/nowhere]",
    ]
    assert {event.callee for event in stage.of(Call)} == {"server"}


def test_requests_are_served_at_the_same_time(stage: Any) -> None:
    stage.component(
        "server",
        """
from std_srvs.srv import Trigger
rospy.init_node("server")
def handle(request):
    rospy.sleep(1)
    return True, "done"
rospy.Service("work", Trigger, handle)
rospy.spin()
""",
    )
    client = """
from std_srvs.srv import Trigger
rospy.init_node("{name}")
rospy.wait_for_service("work")
rospy.ServiceProxy("work", Trigger)()
out((rospy.get_name(), rospy.get_time()))
"""
    stage.component("one", client.format(name="one"))
    stage.component("two", client.format(name="two"))
    assert stage.run(5 * S) == [("/one", 1.0), ("/two", 1.0)]


def test_what_a_callback_raises_is_logged_and_a_failure_of_the_component(stage: Any) -> None:
    stage.component("talker", TALKER.format(count=4))
    stage.component(
        "listener",
        """
from std_msgs.msg import String
rospy.init_node("listener")
def fail(data):
    raise ValueError("no battery")
rospy.Subscriber("chatter", String, fail)
rospy.sleep(5)
out("still here")
""",
    )
    assert stage.run() == ["still here"]
    [failure] = stage.of(Failure)
    assert failure.who == "listener"
    assert failure.what.startswith("callback of /chatter raised ValueError: no battery (line ")
    assert len([event for event in stage.of(Text) if "bad callback" in event.text]) >= 3


def test_a_callback_that_raises_what_is_no_exception_is_reported(stage: Any) -> None:
    stage.component(
        "talker",
        """
import rospy
from std_msgs.msg import String
rospy.init_node("talker")
words = rospy.Publisher("chatter", String, queue_size=1)
rospy.sleep(1)
words.publish("a")
""",
    )
    stage.component(
        "listener",
        """
import rospy
from std_msgs.msg import String
class Odd(BaseException):
    def __str__(self):
        raise RuntimeError("no words")
rospy.init_node("listener")
def fail(data):
    raise Odd
rospy.Subscriber("chatter", String, fail)
rospy.sleep(3)
out("still here")
""",
    )
    assert stage.run() == ["still here"]
    [failure] = stage.of(Failure)
    assert "raised Odd: (its __str__ raised RuntimeError) (line " in failure.what


def test_time_outs(stage: Any) -> None:
    stage.component(
        "n",
        """
from std_msgs.msg import String
rospy.init_node("n")
try:
    rospy.wait_for_message("nothing", String, timeout=0.5)
except rospy.ROSException as error:
    out((rospy.get_time(), str(error)))
try:
    rospy.wait_for_service("nothing", timeout=rospy.Duration(0, 500000000))
except rospy.ROSException as error:
    out((rospy.get_time(), str(error)))
""",
    )
    assert stage.run() == [
        (0.5, "timeout exceeded while waiting for message on topic /nothing"),
        (1.0, "timeout exceeded while waiting for service /nothing"),
    ]


def test_time_and_duration(stage: Any) -> None:
    stage.component(
        "n",
        """
from std_msgs.msg import Header
rospy.init_node("n")
rospy.sleep(rospy.Duration(1.5))
now = rospy.Time.now()
out((now.secs, now.nsecs, now.to_sec()))
header = Header(stamp=rospy.Time.from_sec(1.0))
age = now - header.stamp
later = header.stamp + rospy.Duration(2)
out((age.to_sec(), age > rospy.Duration(0.4), now == rospy.get_rostime(), later > now))
out(rospy.Time(1, 2500000000) == rospy.Time(3.5))
""",
    )
    assert stage.run() == [(1, 500_000_000, 1.5), (0.5, True, True, True), True]


def test_timers(stage: Any) -> None:
    stage.component(
        "n",
        """
rospy.init_node("n")
def tick(event):
    last = event.last_real.to_sec() if event.last_real else None
    out((event.current_expected.to_sec(), event.current_real.to_sec(), last))
timer = rospy.Timer(rospy.Duration(0.5), tick)
rospy.Timer(0.2, lambda event: out("once"), oneshot=True)
rospy.sleep(1.2)
timer.shutdown()
rospy.sleep(2)
""",
    )
    assert stage.run() == ["once", (0.5, 0.5, None), (1.0, 1.0, 0.5)]


def test_parameters(stage: Any) -> None:
    stage.launched["n"] = Launch(namespace="/drone_1", parameters={"height": 12, "gains": {"p": 1.0}})
    stage.component(
        "n",
        """
rospy.init_node("whatever")
out((rospy.get_param("~height"), rospy.get_param("~gains/p"), rospy.get_param("/none", 7)))
rospy.set_param("mode", "auto")
out((rospy.get_param("/drone_1/mode"), rospy.has_param("mode"), rospy.has_param("made")))
rospy.delete_param("mode")
for action in (rospy.get_param, rospy.delete_param):
    try:
        action("mode")
    except KeyError as error:
        out("no parameter" in str(error))
out(rospy.get_param_names())
""",
    )
    assert stage.run() == [
        (12, 1.0, 7),
        ("auto", True, False),
        True,
        True,
        ["/drone_1/whatever/gains/p", "/drone_1/whatever/height"],
    ]


def test_the_command_line_remaps_and_sets_parameters(stage: Any) -> None:
    given = (
        "node.py",
        "3",
        "cmd:=/fast/cmd",
        "_height:=2.5",
        "_names:=[1, 2]",
        "__ns:=/b",
        "__log:=x.log",
        "y",
    )
    stage.launched["n"] = Launch("/a", parameters={"height": 1, "/scale": 7}).given(given, ros=1)
    stage.component(
        "n",
        """
rospy.init_node("n")
out((rospy.get_name(), rospy.resolve_name("cmd"), rospy.get_param("~height"), rospy.get_param("~names")))
out((rospy.myargv(), rospy.myargv(["p", "a:=b"]), rospy.get_param("/scale")))
""",
    )
    assert stage.run() == [("/b/n", "/fast/cmd", 2.5, [1, 2]), (["node.py", "3", "y"], ["p"], 7)]


def test_arguments_of_ros_2_are_between_its_marks() -> None:
    line = "node.py a:=1 --ros-args -r n:cmd:=/fast -p on:=true --remap __ns:=/b __node:=x -p k:=c -- -p z:=1"
    made = Launch().given(line.split(), ros=2)
    assert made[:3] == ("/b", {"cmd": "/fast"}, {"on": True, "k": "c"})
    assert made.arguments == tuple(line.split())


def test_a_file_names_its_node_unless_the_model_or_the_command_line_does(stage: Any) -> None:
    stage.launched["own"] = Launch()
    stage.launched["stated"] = Launch(node_name="by_model")
    stage.launched["remapped"] = Launch().given(("f", "__name:=by_argument"), ros=1)
    stage.launched["remapped_2"] = Launch().given(["f", "--ros-args", "-r", "__node:=by_remap"], ros=2)
    for name in stage.launched:
        stage.component(name, 'rospy.init_node("talker", anonymous=True)\nout(rospy.get_name())')
    assert stage.run() == ["/talker_1", "/by_model", "/by_argument", "/by_remap"]


def test_the_second_node_of_one_name_has_that_of_its_component(stage: Any) -> None:
    for name in ("left", "right"):
        stage.launched[name] = Launch("/fleet", remaps={"cmd": f"{name}/cmd"})
        stage.component(
            name,
            """
rospy.init_node("controller")
rospy.init_node("controller")
out((rospy.get_name(), rospy.get_namespace(), rospy.get_caller_id(), rospy.resolve_name("cmd")))
""",
        )
    assert stage.run() == [
        (f"/fleet/{node}", "/fleet/", f"/fleet/{node}", f"/fleet/{name}/cmd")
        for name, node in (("left", "controller"), ("right", "right"))
    ]
    assert [text.text for text in stage.of(Text)] == [
        "another node is named /fleet/controller, so this one is /fleet/right; state a `node_name`"
    ]


def test_a_node_that_is_there_already_is_taken_over(stage: Any) -> None:
    stage.launched["n"] = Launch(node_name="made_before")
    stage.nodes["n"] = stage.graph.node("made_before", context=ExecutionContext("n"))
    stage.component("n", 'rospy.init_node("n")\nout(rospy.get_name())')
    assert stage.run() == ["/made_before"]
    assert stage.graph.node_names() == ["/made_before"]


def test_shutting_down(stage: Any) -> None:
    stage.component(
        "n",
        """
from std_msgs.msg import String
rospy.init_node("n")
rospy.on_shutdown(lambda: out("hook"))
rospy.Publisher("a", String)
out(rospy.is_shutdown())
rospy.signal_shutdown("battery is empty")
out(rospy.is_shutdown())
rospy.spin()
try:
    rospy.sleep(1)
except rospy.ROSInterruptException as error:
    out(str(error))
""",
    )
    assert stage.run() == [False, "hook", True, "rospy shutdown: battery is empty"]
    assert stage.graph.node_names() == []


def test_log_lines_go_into_the_trace(stage: Any) -> None:
    stage.component(
        "n",
        """
rospy.init_node("n")
rospy.loginfo("height %.1f m", 2.0)
rospy.logwarn("plain 100%")
rospy.logerr("bad")
for _ in range(6):
    rospy.loginfo_throttle(1.0, "now and then")
    rospy.logdebug_once("first")
    rospy.sleep(0.25)
""",
    )
    stage.run()
    lines = [(event.at, event.severity, event.text) for event in stage.of(Text) if event.source == "n"]
    assert lines == [
        (0, 6, "height 2.0 m"),
        (0, 4, "plain 100%"),
        (0, 3, "bad"),
        (0, 6, "now and then"),
        (0, 7, "first"),
        (S, 6, "now and then"),
    ]


def test_what_is_not_there_is_named(stage: Any) -> None:
    rospy = stage.modules["rospy"]
    with pytest.raises(AttributeError, match=r"rospy\.Publsher is not there.*did you mean 'Publisher'"):
        _ = rospy.Publsher
    assert not hasattr(rospy, "__wrapped__")
    assert rospy.exceptions is stage.modules["rospy.exceptions"]


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        ("rospy.Publisher('a', str)", ValueError, "no message class"),
        ("rospy.Subscriber('a', None, out)", ValueError, "no message class"),
        ("rospy.Service('a', 'std_srvs/Empty', out)", AttributeError, "no service class"),
        ("rospy.Rate(0)", ZeroDivisionError, "above 0 Hz"),
        ("rospy.Publisher('not a name', Empty)", UsageError, "no valid ROS name"),
        ("rospy.init_node('m')", Exception, "already been called with different arguments: 'n'"),
        ("rospy.set_param('a', 2**31)", OverflowError, "a parameter has 32 bits"),
    ],
)
def test_wrong_calls_are_explained(stage: Any, call: str, error: type[Exception], words: str) -> None:
    stage.component("n", f"from std_msgs.msg import Empty\nrospy.init_node('n')\n{call}")
    with pytest.raises(error, match=words):
        stage.run()


def test_calls_before_init_node(stage: Any) -> None:
    stage.component("n", "out(rospy.is_shutdown())\nrospy.Rate(10)")
    with pytest.raises(stage.modules["rospy"].ROSInitException, match=r"n: call rospy\.init_node\(\) first"):
        stage.run()
    assert stage.out == [False]


def test_the_published_topics(stage: Any) -> None:
    stage.component(
        "n",
        """
from std_msgs.msg import Empty
rospy.init_node("n")
rospy.Publisher("/a/x", Empty)
rospy.Publisher("/b", Empty)
rospy.Subscriber("/c", Empty, None)
out(rospy.get_published_topics())
out(rospy.get_published_topics("/a"))
rospy.signal_shutdown("")
""",
    )
    assert stage.run() == [
        [["/a/x", "std_msgs/Empty"], ["/b", "std_msgs/Empty"]],
        [["/a/x", "std_msgs/Empty"]],
    ]


def test_helping_tasks_do_not_inherit_the_deadline_of_the_loop(stage: Any) -> None:
    text = """
import rospy
from std_msgs.msg import Empty
def main():
    rospy.init_node("n")
    rospy.Subscriber("a", Empty, lambda m: None)
    rate = rospy.Rate(10)
    publisher = rospy.Publisher("a", Empty)
    for _ in range(2):
        publisher.publish()
        rate.sleep()
"""
    stage.kernel.spawn(stage.load(text).main, "n", ExecutionContext("n", deadline=100 * MS))
    stage.kernel.run(150 * MS)
    deadlines = {(event.released, event.deadline) for event in stage.of(Activation)}
    assert (0, 100 * MS) in deadlines
    assert (100 * MS, -1) in deadlines


LATE_LOOPS = {
    "rospy.Rate": """
        import rospy
        rospy.init_node("n")
        rate = rospy.Rate(20)
        for _ in range(4):
            out(146)
            rate.sleep()
        """,
    "rospy clock": """
        import rospy
        rospy.init_node("n")
        due = rospy.get_time()
        for _ in range(4):
            out(146)
            due += 0.05
            if due > rospy.get_time():
                rospy.sleep(due - rospy.get_time())
        """,
    "rclpy.Rate": """
        import rclpy
        rclpy.init()
        rate = rclpy.create_node("n").create_rate(20)
        for _ in range(4):
            out(146)
            rate.sleep()
        """,
    "rclpy timer": """
        import rclpy
        rclpy.init()
        node = rclpy.create_node("n")
        node.create_timer(0.05, lambda: out(146))
        rclpy.spin(node)
        """,
}


@pytest.mark.parametrize("loop", LATE_LOOPS)
def test_each_release_of_a_loop_that_is_always_late_counts_and_is_missed(stage, loop):
    stage.out = SimpleNamespace(append=lambda ms: stage.kernel.consume(ms * MS))
    core = Processor(stage.kernel, "core")
    context = ExecutionContext("n", core, deadline=50 * MS, period=50 * MS)
    stage.kernel.spawn(lambda: stage.load(textwrap.dedent(LATE_LOOPS[loop])), "n", context)
    stage.kernel.run(650 * MS)
    late = [one for one in stage.events if isinstance(one, Activation) and one.finished > one.deadline]
    first = 50 if "timer" in loop else 0  # a timer fires for the first time after a period
    assert [one.finished // MS - first for one in late[:4]] == [146, 292, 438, 584]
    assert [(one.finished - one.released) // MS for one in late[:2]] == [146, 242]
