"""Files written for rospy say the same on the embedded graph and on a real roscore, and meet Debian's."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from rigs.requirements import lacking
from volery.ros.transports.ros1 import Roscore
from volery.ros.transports.ros1.master import environment

from .conftest import HERE, LIMIT_S
from .files_on_ros import Case, compare, embedded, observed, running

pytestmark = pytest.mark.integration

FILES = HERE / "ros_files" / "ros1"
STRING = "std_msgs/msg/String"
GAINS = {"p": 2.0, "i": 0.1, "d": 0.07}  # those that the thesis flew with
CASES = {
    "topics": Case(
        {"listener": {"listeners": 0}, "talker": {"listeners": 1}},
        {"/chatter": (STRING, 20), "/heard": (STRING, 20)},
    ),
    "services": Case(
        {"adder": {}, "asker": {"listeners": 0}},
        {"/sums": ("std_msgs/msg/Int64", 4), "/people": ("tutorial_msgs/msg/Person", 1)},
    ),
    "parameters": Case({"parameters": {"rate": 10, "listeners": 0}}, {"/told": (STRING, 15)}),
    "filters": Case(
        {"pairs": {"listeners": 0}, "cameras": {"pairs": 1}},
        {"/pairs": (STRING, 20)},
    ),
    "controller": Case(
        {"controller": {"gains": GAINS, "listeners": 0}, "plant": {"steps": 250, "listeners": 1}},
        {
            "/pose": ("geometry_msgs/msg/PoseStamped", 250),
            "/cmd_vel": ("geometry_msgs/msg/Twist", 250),
            "/reached": ("std_msgs/msg/Int32", 4),
        },
    ),
}


@pytest.fixture(scope="module")
def tutorial_msgs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The classes of the package beside the files, made by genpy as a catkin workspace would."""
    made = tmp_path_factory.mktemp("generated")
    for kind in ("msg", "srv"):
        output = made / "tutorial_msgs" / kind
        sources = [str(one) for one in sorted((FILES / "tutorial_msgs" / kind).glob(f"*.{kind}"))]
        generator = f"/usr/lib/genpy/gen{kind}_py.py"
        include = ["-I", "std_msgs:/usr/share/std_msgs/msg", "-p", "tutorial_msgs", "-o", str(output)]
        for command in (sources, ["--initpy"]):
            subprocess.run(["/usr/bin/python3", generator, *command, *include], check=True, timeout=LIMIT_S)
    (made / "tutorial_msgs" / "__init__.py").touch()
    return made


@pytest.mark.parametrize("name", CASES)
def test_the_same_messages(name: str, roscore: Roscore, tutorial_msgs: Path, tmp_path: Path) -> None:
    case = CASES[name]
    programs = [
        ["/usr/bin/python3", str(FILES / f"{one}.py"), *(f"_{key}:={value}" for key, value in given.items())]
        for one, given in case.observed_files()
    ]
    surroundings = {
        **environment(roscore.uri),
        "PYTHONPATH": str(tutorial_msgs),
        "ROS_PACKAGE_PATH": str(FILES),
    }
    with (
        observed(sys.executable, "ros1", case, FILES, {**os.environ, **surroundings}) as said,
        running(programs, surroundings),
    ):
        real = said()
    compare(case, embedded(case, "rospy", FILES, tmp_path / "embedded"), real)


VOLERY = (sys.executable, "-c", "from volery.cli.main import main; main()")
ACTIONS = HERE / "ros_files" / "actions"
ACTIONS_MODEL = """
volery: 1
name: actions
files_from: {folder}
components: {{Base: {{language: rospy, path: {folder}/base.py, active: true}}}}
application: {{base: {{is: Base}}}}
platform: {{processors: {{pc: {{is: intel-i5-3470, frequency: 3000 MHz}}}}}}
allocations: {{only: {{base: pc}}}}
run: {{duration: 90 s}}
"""


def test_an_action_server_of_a_component_serves_a_client_of_debian(roscore: Roscore, tmp_path: Path) -> None:
    if not Path("/usr/lib/python3/dist-packages/actionlib").is_dir():
        lacking("no actionlib here (scripts/debian-packages ros1)")
    model = tmp_path / "model.yaml"
    model.write_text(ACTIONS_MODEL.format(folder=ACTIONS))
    options = ["--graph", "ros1", "--quiet", "--out", str(tmp_path / "run")]
    env = {**os.environ, "ROS_MASTER_URI": roscore.uri, "ROS_IP": "127.0.0.1"}
    with running([[*VOLERY, "simulate", str(model), *options]], env):
        done = subprocess.run(
            ["/usr/bin/python3", str(ACTIONS / "driver.py")],
            env=environment(roscore.uri),
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
            check=False,
        )
    assert done.returncode == 0, done.stderr
    ended = json.loads(done.stdout)
    assert [one[:2] for one in ended] == [["SUCCEEDED", "arrived"], ["PREEMPTED", "stopped on the way"]]
    for *_, reported in ended:  # feedback and result are topics of their own: the first or last may be missed
        assert len(reported) >= 2
        assert [one - reported[0] for one in reported] == [0.0, 1.0, 2.0][: len(reported)]
