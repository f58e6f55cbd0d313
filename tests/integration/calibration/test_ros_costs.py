"""Tiny campaigns on a real roscore: that everything is measured, written and compared, not how much it is."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from typer.testing import CliRunner

from volery.base.time import S
from volery.calibration.host_machine import Machine
from volery.calibration.node_comparison import prepare_nodes
from volery.calibration.node_processes import measurement_session
from volery.calibration.ros.call_costs import CallCost, call_costs
from volery.calibration.ros.campaign import Conditions, ros_law, write_entry
from volery.calibration.ros.probe_environment import Pace, probe_setup
from volery.cli.main import application
from volery.cost import load_catalogue
from volery.model.system_loader import load
from volery.ros.transports.ros1.master import own_roscore
from volery.run.assembly.model_checks import vocabulary

pytestmark = pytest.mark.integration

VOLERY = str(Path(sys.executable).with_name("volery"))
PACE = Pace(block_ms=100.0, periods_ms=(10.0, 40.0), sleeps_ms=(5.0, 20.0), counts=(1, 2))
MACHINE = Machine("here", "this machine", 2, 2000.0)
SAID = {
    "publish",
    "publish_next",
    "publish_often",
    "publish_next_often",
    "sleep",
    "wait",
    "receive",
    "receive_next",
    "receive_often",
    "receive_next_often",
    "connect",
    "accept",
    "init",
    "node_handle",
}
SAID |= {"advertise", "subscribe", "service_client", "advertise_service", "call_service", "serve"}

NODE = """
import rospy
from std_msgs.msg import String
rospy.init_node("talker")
words = rospy.Publisher("words", String, queue_size=5)
rate = rospy.Rate(20)
while not rospy.is_shutdown():
    words.publish(String("a word"))
    rate.sleep()
"""
CPP_NODE = """
#include <ros/ros.h>
#include <std_msgs/String.h>
int main(int argc, char** argv) {
  ros::init(argc, argv, "shouter");
  ros::NodeHandle node;
  ros::Publisher words = node.advertise<std_msgs::String>("words", 5);
  ros::Rate rate(20);
  for (std_msgs::String word; ros::ok(); rate.sleep()) words.publish(word);
}
"""
LISTENER = """
import rospy
from std_msgs.msg import String
rospy.init_node("listener")
rospy.Subscriber("words", String, lambda message: None)
rospy.spin()
"""
MODEL = """
volery: 1
name: a-node
components:
  Talker: {language: rospy, path: talker.py, active: true}
  Listener: {language: rospy, path: listener.py, active: true}
application:
  talker: {is: Talker}
environment:
  origin: {latitude: 43.47, longitude: -3.8}
  components:
    listener: {is: Listener}
platform:
  processors: {host: {is: intel-i5-3470, frequency: 3000 MHz}}
allocations:
  only: {talker: host}
"""


def measured(client: str) -> dict[str, CallCost]:
    with probe_setup(client) as here:
        return call_costs([here.probe(PACE)])


def test_both_libraries_are_calibrated(ros: None, tmp_path: Path) -> None:
    with ThreadPoolExecutor() as pool:
        found = dict(zip(("roscpp", "rospy"), pool.map(measured, ("roscpp", "rospy")), strict=True))
    assert set(found["roscpp"]) == SAID | {"spin_once_first", "spin_once_next"}
    assert set(found["rospy"]) == SAID
    for client, these in found.items():
        assert set(these["publish_often"].points) == {1.0, 2.0}
        assert set(these["sleep"].points) == {5000.0, 20000.0}
        assert these["init"].typical > 0.0
        assert these["sleep"].typical > 0.0
        assert set(these["publish_next_often"].points) == {2.0, 8.0}
        assert these["call_service"].typical > 0.0
        assert these["serve"].typical > 0.0
        under = Conditions(client, MACHINE.description, MACHINE.frequency_mhz)
        write_entry(tmp_path / "catalogue.yaml", MACHINE, ros_law(these, under))
    entry = load_catalogue(tmp_path / "catalogue.yaml").processor("here")
    assert entry.ros_law("rospy").warnings(2000.0) == ()
    assert entry.ros_law("rclpy").warnings(2000.0) != ()


def model(folder: Path, text: str) -> Path:
    files = {"talker.py": NODE, "shouter.cpp": CPP_NODE, "listener.py": LISTENER, "model.yaml": text}
    for name, content in files.items():
        (folder / name).write_text(content)
    return folder


def test_a_models_nodes_are_measured_and_estimated(ros: None, tmp_path: Path) -> None:
    command = ["cost", "validate", str(model(tmp_path, MODEL)), "--runs", "1", "--seconds", "1", "--json"]
    done = CliRunner().invoke(application(), command)
    [talker] = json.loads(done.stdout)["nodes"]
    assert (talker["node"], talker["language"]) == ("talker", "rospy")
    assert talker["calls"]["publish"] == pytest.approx(20, abs=1)
    assert 0.0 < talker["measured_s"] < 1.0
    assert talker["estimated_ros_s"] > 0.0


def test_a_program_in_cpp_is_measured_from_its_main_on(ros: None, tmp_path: Path) -> None:
    in_cpp = MODEL.replace("{language: rospy, path: talker.py", "{language: roscpp, path: shouter.cpp")
    system = load(model(tmp_path, in_cpp), vocabulary())
    with own_roscore() as core, measurement_session(prepare_nodes(system), core.uri, S // 2) as run:
        [(name, taken)] = run().items()
    assert name == "talker"
    assert 0 < taken < S // 2


def test_ctrl_c_leaves_a_campaign_to_go_on_with(ros: None, tmp_path: Path) -> None:
    out = tmp_path / "catalogue.yaml"
    command = [VOLERY, "cost", "calibrate", "ros", "--client", "rospy", "--out", str(out)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    rounds = tmp_path / "catalogue.yaml.rospy.rounds"
    end = time.monotonic() + 300
    while not rounds.exists() and time.monotonic() < end:
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=300)
    assert process.returncode == 2
    assert "0 rounds were measured, at least 3 are needed; the same command continues from" in said
    assert rounds.exists()
    assert not out.exists()
