"""What follows when a component of a model ends: the others, the vehicles, the outcome of the run."""

import json

import pytest

from volery.base.errors import ModelError
from volery.base.time import S
from volery.run.result import Options
from volery.run.simulate import simulate
from volery.trace.events import Failure, Operation, Text
from volery.trace.reader import OpenTrace

SPEAKER = """
import rospy
from std_msgs.msg import String
rospy.init_node("speaker")
said = rospy.Publisher("/said", String, queue_size=1)
rospy.Subscriber("/heard", String, lambda message: print("speaker hears", message.data))
rospy.on_shutdown(lambda: print("speaker leaves at", rospy.get_time() // 1))
rospy.sleep(1.0)
said.publish("hello")
"""
LISTENER = """
import rospy
from std_msgs.msg import String
rospy.init_node("listener")
heard = rospy.Publisher("/heard", String, queue_size=1)
rate = rospy.Rate(1)
while not rospy.is_shutdown():
    heard.publish("%d, connected: %d" % (rospy.get_time(), heard.get_num_connections()))
    rate.sleep()
"""


@pytest.fixture
def runs(tmp_path):
    """Run rospy scripts by name for 4 s; return the run, its lines of text and its failures."""

    def run(components=None, environment=None, duration="4 s", **scripts):
        for name, text in scripts.items():
            (tmp_path / f"{name}.py").write_text(text)
        model = {
            "volery": 1,
            "name": "ends",
            "components": {
                name: {
                    "language": "rospy",
                    "path": f"{name}.py",
                    "active": True,
                    **(components or {}).get(name, {}),
                }
                for name in scripts
            },
            "application": {name: {"is": name} for name in scripts},
            "platform": {"processors": {"pc": {"is": "intel-i5-3470", "frequency": "3000 MHz"}}},
            "allocations": {
                "only": dict.fromkeys([*scripts, *(environment or {}).get("vehicles", ())], "pc")
            },
            "run": {"duration": duration},
        }
        if environment:
            model["environment"] = environment
        (tmp_path / "model.yaml").write_text(json.dumps(model))
        done = simulate(tmp_path, Options(out=tmp_path / "run", tell=run.told.append))
        with OpenTrace(tmp_path / "run" / "trace.mcap") as reading:
            events = list(reading.events())
        lines = [event.text for event in events if isinstance(event, Text) and event.source in scripts]
        return done, lines, events

    run.told = []
    return run


@pytest.mark.parametrize("end", ["", "import sys; sys.exit(0)", "import os; os._exit(0)"])
def test_a_script_that_ends_by_itself_leaves_the_graph_and_the_others_go_on(runs, end):
    done, lines, _ = runs(speaker=SPEAKER + end, listener=LISTENER)
    assert done.completed, done.record.outcome.reason
    assert done.record.sim_s == 4.0
    assert [line for line in lines if "leaves" in line] == (
        [] if "_exit" in end else ["speaker leaves at 1.0"]
    )
    assert not [line for line in lines if line.startswith("speaker hears") and int(line[14]) > 1]


@pytest.mark.parametrize(
    ("end", "reason"),
    [
        ("import sys; sys.exit(3)", "speaker: ended with exit status 3 (speaker.py:10)"),
        ("raise ValueError('lost')", "speaker: run raised ValueError: lost (speaker.py:10)"),
    ],
)
def test_a_script_that_fails_is_stopped_and_the_outcome_is_failed(runs, end, reason):
    done, _, events = runs(speaker=SPEAKER + end, listener=LISTENER)
    assert (done.record.outcome.status, done.record.outcome.reason) == ("failed", reason)
    assert str(done.error) == reason
    assert done.record.sim_s == 4.0
    assert [event.who for event in events if isinstance(event, Failure)] == ["speaker"]


TESTED = """
import unittest, rospy
class TestRate(unittest.TestCase):
    def test_time(self):
        rospy.sleep(1.5)
        self.assertEqual(rospy.get_time() // 1, 1)
    def test_wrong(self):
        self.fail("as meant")
if __name__ == "__main__":
    rospy.init_node("tested")
    unittest.main()
"""


def test_unittest_runs_the_tests_of_the_script_in_its_arguments_and_its_time(runs):
    done, _, events = runs(tested=TESTED)
    text = "\n".join(event.text for event in events if isinstance(event, Text))
    assert "Ran 2 tests in 1.50" in text
    assert "as meant" in text
    assert done.record.outcome.reason == "tested: ended with exit status 1 (tested.py:11)"


def test_a_failed_run_in_which_nothing_is_left_ends_at_once(runs):
    done, _, _ = runs(speaker=SPEAKER + "raise ValueError('lost')")
    assert done.record.outcome.status == "failed"
    assert 1.0 < done.record.sim_s < 1.1


def test_the_model_may_let_a_failure_end_the_run(runs):
    policy = {"speaker": {"on_failure": "end_run"}}
    done, _, _ = runs(policy, speaker=SPEAKER + "raise ValueError('lost')", listener=LISTENER)
    assert done.record.outcome.status == "failed"
    assert done.record.sim_s < 1.1


def test_a_component_is_started_again_as_often_as_the_model_says(runs):
    policy = {"speaker": {"on_failure": {"action": "restart", "max": 2, "delay": "100 ms"}}}
    often = SPEAKER.replace("sleep(1.0)", "sleep(0.4)") + "print('again'); raise ValueError('lost')"
    done, lines, events = runs(policy, speaker=often, listener=LISTENER)
    assert lines.count("again") == 3
    assert len([event for event in events if isinstance(event, Failure)]) == 3
    assert done.record.outcome.status == "failed"  # the last failure is not followed by a start


FLIES = """
import rospy, sys
from geometry_msgs.msg import PoseStamped
from mavros_msgs.srv import CommandBool, SetMode
rospy.init_node("flier")
out = rospy.Publisher("/drone/setpoint_position/local", PoseStamped, queue_size=1)
where = PoseStamped()
where.pose.position.z = 2.0
rate = rospy.Rate(20)
for step in range(300):
    out.publish(where)
    rate.sleep()
    if step == 100:
        rospy.ServiceProxy("/drone/set_mode", SetMode)(custom_mode="OFFBOARD")
        rospy.ServiceProxy("/drone/cmd/arming", CommandBool)(True)
sys.exit(1)
"""
PAD = {
    "origin": {"latitude": 47.3977, "longitude": 8.5456, "amsl": "488 m"},
    "places": {"pad": {"east": "0 m", "north": "0 m", "role": "pad"}},
    "vehicles": {"drone": {"autopilot": "px4", "kind": "multirotor", "at": "pad", "battery": "5 Ah"}},
}


def test_a_vehicle_whose_only_commander_fails_is_brought_to_rest_while_the_others_go_on(runs):
    done, _, events = runs(environment=PAD, duration="40 s", flier=FLIES, listener=LISTENER)
    landed = [event for event in events if isinstance(event, Operation) and event.operation == "come_to_rest"]
    assert [(event.vehicle, event.outcome) for event in landed[:1]] == [("drone", "ok")]
    assert landed[0].end < 35_000_000_000
    assert done.record.outcome.reason == "flier: ended with exit status 1 (flier.py:16)"
    assert done.record.sim_s >= 40.0


LOGS = """
import rospy
from std_msgs.msg import String
rospy.init_node("logs")
rospy.loginfo("fine")
rospy.logwarn("odd\\n  thing")
for number in range(8):
    rospy.logerr("number %d", number)
rospy.sleep(2)
rospy.logfatal("late")
"""


def test_warnings_and_errors_of_components_are_shown_at_once_and_counted(runs):
    done, _, _ = runs(logs=LOGS)
    assert done.completed
    words = [line.split(maxsplit=1)[1] for line in runs.told]
    assert words[:2] == ["warning logs: odd thing", "error   logs: number 0"]
    assert words[-2:] == [
        "error   logs: late",
        "4 more warnings and errors; the report and --log-file have them",
    ]
    assert len(words) == 7
    assert "logs logged 9 errors and 1 warnings, first: odd thing" in done.record.warnings


HEARS = """
import rospy
from std_msgs.msg import String
rospy.init_node("hears")
def heard(message):
    CONDITION
    print(message.nothing)
rospy.Subscriber("/heard", String, heard)
rospy.spin()
"""


def test_a_component_of_which_every_callback_fails_has_failed(runs):
    done, _, _ = runs(hears=HEARS.replace("CONDITION", ""), listener=LISTENER)
    assert done.record.outcome.status == "failed"
    assert done.record.outcome.reason.startswith("hears: every callback failed (3 of 3): callback of /heard")
    assert any("error   hears: bad callback: callback of /heard raised" in line for line in runs.told)


def test_one_callback_that_succeeds_is_enough(runs):
    sometimes = HEARS.replace("CONDITION", "if message.data.startswith('2'): return")
    assert runs(hears=sometimes, listener=LISTENER)[0].completed


def test_a_model_may_name_a_package_and_an_executable(runs, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "package.xml").write_text("<package><name>mine</name></package>")
    (tmp_path / "mine" / "talk").write_text("#!/usr/bin/env python3\nprint('said')\n")
    (tmp_path / "mine" / "talk").chmod(0o755)
    done, lines, _ = runs({"talker": {"path": "", "package": "mine", "executable": "talk"}}, talker="")
    assert (done.completed, lines) == (True, ["said"])
    with pytest.raises(ModelError, match="package mine has no executable 'tlak'; there is talk"):
        runs({"talker": {"path": "", "package": "mine", "executable": "tlak"}}, talker="")


def test_what_a_thread_raises_ends_the_thread_alone_but_the_run_has_failed(runs):
    thread = "import threading\nthreading.Thread(target=lambda: 1 / 0).start()\n"
    done, lines, _ = runs(speaker=SPEAKER.replace("rospy.sleep", f"{thread}rospy.sleep"), listener=LISTENER)
    assert done.record.outcome.status == "failed"
    assert "ZeroDivisionError" in done.record.outcome.reason
    assert "speaker leaves at 1.0" in lines


def test_what_the_main_flow_raises_is_told_before_its_threads_are_awaited(runs):
    raising = """
import rospy, threading
rospy.init_node("raising")
threading.Thread(target=rospy.spin).start()
raise ValueError("lost")
"""
    done, _, events = runs(raising=raising, listener=LISTENER)
    assert done.record.outcome.status == "failed"
    first = next(one for one in events if isinstance(one, Failure))
    assert first.what == "run raised ValueError: lost (raising.py:5)"
    assert first.at < S


def test_the_module_of_an_action_has_its_parts(runs):
    text = """
import inspect
from example_interfaces.action import Fibonacci
print(Fibonacci.__module__, inspect.getmodule(Fibonacci).Fibonacci_SendGoal is Fibonacci.Impl.SendGoalService)
"""
    _, lines, _ = runs({"asking": {"language": "rclpy"}}, asking=text)
    assert lines == ["example_interfaces.action._fibonacci True"]
