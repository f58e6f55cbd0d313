"""The commands of docs/calibration.md in their order, on one host and one catalogue."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from volery.calibration.host_machine import this_machine
from volery.calibration.ros.call_costs import ProbeSample, Round
from volery.calibration.ros.campaign import CampaignLog, Conditions
from volery.cli.main import application

pytestmark = pytest.mark.integration

PAGE = Path(__file__).parents[3] / "docs" / "calibration.md"
QUICK = {
    "cost calibrate ros": [],  # continues after rounds that were kept, which are precise
    "cost calibrate python": ["--rounds", "2", "2"],
    "cost validate": ["--runs", "1", "--seconds", "1"],
}
LEFT_OUT = ("rclpy", "calibrate processor")
"""ROS 2 is in another environment; the node of the model is not in C++."""

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
MODEL = """
volery: 1
name: documented
components:
  Talker: {language: rospy, path: talker.py, active: true}
application:
  talker: {is: Talker}
environment:
  origin: {latitude: 43.47, longitude: -3.8}
platform:
  catalogues: catalogue.yaml
  processors: {host: {is: NAME, frequency: MHZ MHz}}
allocations:
  only: {talker: host}
"""


def kept_round() -> Round:
    """Return a round of a probe; the figures are of the size of a computer's."""
    idle = 70_000.0
    once = {"init": 2e5, "node_handle": 2e6, "advertise": 2e5, "subscribe": 3e5, "connect": 1e6}
    once |= {"service_client": 1e4, "advertise_service": 4e4, "settle": 0.0}
    samples = [ProbeSample("nothing", 0, 1, 100, 0, 0)]
    samples += [ProbeSample(name, 0, 1, 100, round(ns), round(ns / 2)) for name, ns in once.items()]
    samples += [ProbeSample("sleep", us, 1, 100, round(2e4 + us), 5000) for us in (1e4, 1e5)]
    for count in (1, 8):
        spent = round(idle + 7e4 + 2e4 * count)
        samples.append(ProbeSample("accept", count, 1, 100, round(2e5 + 5e5 * count), 0))
        samples += [
            ProbeSample("idle", 0, 1, 100, 70_000, 0),
            ProbeSample("publish", count, 1, 100, spent, 70_000),
        ]
        samples.append(ProbeSample("publish_alone", 0, 1, 100, round(idle), 0))
        samples.append(ProbeSample("publish_both", count, 1, 100, round(idle + 4e4 + 2e4 * count), 40_000))
    samples += [
        ProbeSample("spin_once_first", 0, 1, 100, 20_000, 0),
        ProbeSample("spin_once", 0, 1, 100, 155_000, 0),
    ]
    samples += [
        ProbeSample("wait", 0, 1, 10**9, 10**6, 0),
        ProbeSample("receive", 0, 20, 10**9, 3 * 10**6, 0),
    ]
    return tuple(samples)


def documented() -> list[list[str]]:
    """Return the commands of the page's first block."""
    block = re.search(r"```sh\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert block
    lines = [line.partition("#")[0].strip() for line in block[1].splitlines()]
    return [shlex.split(line)[1:] for line in lines if line and not any(one in line for one in LEFT_OUT)]


def test_the_sequence_runs_as_printed(ros: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    machine = this_machine()
    for client in ("roscpp", "rospy"):
        conditions = Conditions(client, machine.description, machine.frequency_mhz)
        log = CampaignLog(tmp_path / f"catalogue.yaml.{client}.rounds", conditions)
        for _ in range(10):
            log.keep(kept_round())
    (tmp_path / "talker.py").write_text(NODE, encoding="utf-8")
    model = MODEL.replace("NAME", machine.name).replace("MHZ", f"{machine.frequency_mhz:g}")
    (tmp_path / "model.yaml").write_text(model, encoding="utf-8")
    commands = documented()
    assert [command[1] for command in commands] == ["calibrate", "calibrate", "calibrate", "validate"]
    for command in commands:
        short = next(more for start, more in QUICK.items() if " ".join(command).startswith(start))
        done = CliRunner().invoke(application(), [one.replace("MODEL", ".") for one in command] + short)
        assert done.exit_code in (0, 1), (command, done.output)  # 1: not as certain as required
    assert "talker" in done.output
