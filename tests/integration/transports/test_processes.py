"""A model's components as processes on real ROS: they deliver, and what goes wrong is told by its name."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from volery.ros.messages import from_cdr
from volery.ros.transports.ros1 import Roscore
from volery.ros.transports.ros1.master import Master, master_answers
from volery.trace.events import Message, Published, Text
from volery.trace.reader import read

from .conftest import Ours, python_of, surroundings

pytestmark = pytest.mark.integration

DELIVERY = Path(__file__).parents[3] / "examples" / "delivery"
THE_WAY = ["ordered", "to_port", "at_port", "in_flight", "arrived", "last_mile", "delivered"]
VOLERY = "from volery.cli.main import main; main()"
LIMIT_S = 600

MODEL = """
volery: 1
name: pair
interfaces:
  Echo: {say: {args: {words: Words}, returns: Words}, fall: {}, die: {}}
components:
  Speaker: {language: python, path: speaker.py, requires: {other: Echo}, parameters: {ask: say}, active: true}
  Echoer: {language: python, path: echoer.py, provides: {voice: Echo}}
application:
  speaker: {is: Speaker, other: echoer.voice}
  echoer: {is: Echoer}
platform: {processors: {pc: {is: intel-i5-3470, frequency: 3000 MHz}}}
allocations: {all: {speaker: pc, echoer: pc}}
run: {duration: 3 s}
"""
WORDS = """
from dataclasses import dataclass

@dataclass(frozen=True)
class Words:
    text: str
    times: tuple
"""
SPEAKER = """
import volery
from words import Words

class Speaker:
    def __init__(self, other, ask):
        self._other, self._ask = other, ask

    def run(self):
        volery.log(repr(self._other.say(Words("hello", (1, 2)))))
        if self._ask != "say":
            try:
                getattr(self._other, self._ask)()
            except volery.VoleryError as error:
                volery.log(str(error))
        since = volery.now()
        volery.sleep(1.0)
        volery.log(f"slept {volery.now() - since:.1f} s")
        print("I have spoken", flush=True)
"""
WAITER = """
import rospy
from std_msgs.msg import String
from std_srvs.srv import Empty
rospy.init_node("waiter")
words = rospy.Publisher("words", String, queue_size=5)
rospy.Subscriber("words", String, print)
rospy.Subscriber("wordz", String, print)
rospy.Service("reset", Empty, print)
try:
    rospy.wait_for_service("resett", 1.5)
except rospy.ROSException:
    words.publish("none")
rospy.spin()
"""
ECHOER = """
import os
from words import Words

class Echoer:
    def say(self, words):
        return Words(words.text.upper(), words.times)

    def fall(self):
        raise ValueError("no voice")

    def die(self):
        os.kill(os.getpid(), 9)
"""


def simulate(
    python: str, model: Path, out: Path, *options: str, env: Mapping[str, str]
) -> subprocess.CompletedProcess[str]:
    command = [python, "-c", VOLERY, "simulate", str(model), "--quiet", "--out", str(out), *options]
    return subprocess.run(
        command, env=env, capture_output=True, text=True, timeout=LIMIT_S, check=False, cwd=out.parent
    )


# -- the delivery


def deliver(python: str, out: Path, graph: str, env: Mapping[str, str]) -> dict[str, Any]:
    """One parcel, by processes on *graph*; its run's record."""
    options = ("--scenario", "pocket", "--seed", "7", "--speed", "2.5", "--set", "run.duration=300 s")
    done = simulate(python, DELIVERY, out, "--graph", graph, *options, env=env)
    assert (out / "run.json").exists(), done.stderr
    record: dict[str, Any] = json.loads((out / "run.json").read_text())
    assert record["outcome"]["status"] == "completed", done.stderr
    return record


def assert_delivered(record: dict[str, Any], folder: Path) -> None:
    states = [step["state"] for step in record["notes"]["parcel"]["parcel-1"]["history"]]
    assert states == THE_WAY
    assert all(vehicle["landed"] for vehicle in record["vehicles"].values())
    assert record["requirements"]["delivered"]["met"]
    trace = read(folder / "trace.mcap")
    assert trace.complete
    speakers = {event.publisher for event in trace.events if isinstance(event, Published)}
    hearers = {event.subscriber for event in trace.events if isinstance(event, Message)}
    assert {"/drone_1/mavros", "/rover_depot/mavros", "/landing_1"} <= speakers
    assert {"/drone_control_1", "/landing_1", "/rover_control_north", "/drone_1/mavros"} <= hearers
    still = [one for one in trace.events if isinstance(one, Published) and one.topic == "/tf_static"]
    assert {one.publisher for one in still} >= {"/drone_1/mavros", "/rover_east/mavros"}
    [_, body] = from_cdr(still[0].type, still[0].data).transforms
    assert body.child_frame_id == f"{body.header.frame_id}_frd"


def test_the_pocket_scenario_delivers_on_a_roscore_that_is_started_for_it(tmp_path: Path) -> None:
    with socket.socket() as asked:
        asked.bind(("127.0.0.1", 0))
        port = asked.getsockname()[1]
    uri = f"http://127.0.0.1:{port}"
    env = {**os.environ, "ROS_MASTER_URI": uri, "ROS_IP": "127.0.0.1"}
    record = deliver(sys.executable, tmp_path / "out", "ros1", env)
    assert_delivered(record, tmp_path / "out")
    assert not master_answers(uri)


@pytest.mark.long  # minutes of ten processes: a deployment delivers on ROS 2, and a pair talks there
def test_the_pocket_scenario_delivers_on_ros_2(tmp_path: Path) -> None:
    record = deliver(python_of("jazzy"), tmp_path / "out", "ros2", surroundings())
    assert_delivered(record, tmp_path / "out")


# -- a pair that talks


@pytest.fixture
def pair(tmp_path: Path) -> Path:
    folder = tmp_path / "pair"
    folder.mkdir()
    texts = {"model.yaml": MODEL, "words.py": WORDS, "speaker.py": SPEAKER, "echoer.py": ECHOER}
    for name, text in texts.items():
        (folder / name).write_text(text)
    return folder


def on_ros1(
    roscore: Roscore, model: Path, *options: str
) -> tuple[subprocess.CompletedProcess[str], list[str]]:
    """How it ended, and what the speaker has logged."""
    env = {**os.environ, "ROS_MASTER_URI": roscore.uri, "ROS_IP": "127.0.0.1"}
    out = model.parent / "out"
    done = simulate(sys.executable, model, out, "--graph", "ros1", *options, env=env)
    trace = out / "trace.mcap"
    texts = [event for event in read(trace).events if isinstance(event, Text)] if trace.exists() else []
    return done, [event.text for event in texts if event.source == "speaker"]


def test_what_a_component_raises_reaches_its_caller_in_another_process(roscore: Roscore, pair: Path) -> None:
    (pair / "waiter.py").write_text(WAITER)
    model = pair / "model.yaml"
    waiter = "  Waiter: {language: rospy, path: waiter.py, active: true}\n"
    waits = MODEL.replace("application:", f"{waiter}application:\n  waiter: {{is: Waiter}}")
    model.write_text(waits.replace("echoer: pc}", "echoer: pc, waiter: pc}"))
    done, said = on_ros1(roscore, pair, "--set", "components.Speaker.parameters.ask=fall")
    assert done.returncode == 0, done.stderr
    unserved = json.loads((pair.parent / "out" / "run.json").read_text())["unserved"]
    assert [(one["kind"], one["name"], one["who"], one["hint"]) for one in unserved] == [
        ("service", "/resett", "/waiter", "did you mean /reset?"),
        ("subscription", "/wordz", "/waiter", "did you mean /words?"),
    ]
    assert said[0] == "Words(text='HELLO', times=(1, 2))"
    assert said[1] == "echoer: fall raised ValueError: no voice (echoer.py:10)"
    assert float(said[2].removeprefix("slept ").removesuffix(" s")) >= 1.0  # longer on a busy machine
    assert (
        Master(roscore.uri, "/test").find("getParam", "/use_sim_time") is None
    )  # or others would stand still


def test_a_pair_talks_on_ros_2(pair: Path) -> None:
    out = pair.parent / "out"
    done = simulate(python_of("jazzy"), pair, out, "--graph", "ros2", env=surroundings())
    assert done.returncode == 0, done.stderr
    events = read(out / "trace.mcap").events
    said = [event.text for event in events if isinstance(event, Text) and event.source == "speaker"]
    assert said[0] == "Words(text='HELLO', times=(1, 2))"
    assert float(said[1].removeprefix("slept ").removesuffix(" s")) >= 1.0  # longer on a busy machine


def test_a_process_that_dies_ends_the_run_by_its_name(roscore: Roscore, pair: Path) -> None:
    done, _ = on_ros1(roscore, pair, "--set", "components.Speaker.parameters.ask=die")
    assert done.returncode == 1
    assert re.search(r"volery: echoer: its process \(\d+\) was ended by SIGKILL", done.stderr), done.stderr
    record = json.loads((pair.parent / "out" / "run.json").read_text())
    assert record["outcome"]["status"] == "failed"


def test_a_name_that_is_taken(ours: Ours, roscore: Roscore, pair: Path) -> None:
    ours.spinning("echoer")
    done, said = on_ros1(roscore, pair)
    assert done.returncode == 1
    assert re.search(r"volery: echoer: a node named /echoer is there already \(at http", done.stderr)
    assert said == []


def test_the_first_interrupt_ends_all_processes_in_order(roscore: Roscore, pair: Path) -> None:
    env = {**os.environ, "ROS_MASTER_URI": roscore.uri, "ROS_IP": "127.0.0.1"}
    out = pair.parent / "out"
    options = ("--graph", "ros1", "--set", "run.duration=10 min", "--out", str(out))
    command = [sys.executable, "-c", VOLERY, "simulate", str(pair), "--quiet", *options]
    process = subprocess.Popen(command, env=env, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    while process.stderr.readline() != "I have spoken\n":  # what components print goes there
        assert process.poll() is None
    ours = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    components = [int(one) for one in ours.read_text().split()]
    assert len(components) == 2
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=LIMIT_S)
    assert process.returncode == 1
    assert json.loads((out / "run.json").read_text())["outcome"]["status"] == "interrupted"
    assert not any(Path(f"/proc/{one}").exists() for one in components)


def test_ros_2_where_there_is_none(pair: Path) -> None:
    done = simulate(sys.executable, pair, pair.parent / "out", "--graph", "ros2", env=os.environ)
    assert done.returncode == 2
    assert "volery: ROS 2 needs rclpy" in done.stderr
    assert "Traceback" not in done.stderr
