"""Files written for roscpp, unmodified: in virtual time, with Boost and without, and with the real roscpp."""

from __future__ import annotations

import shutil
import subprocess
from itertools import count
from pathlib import Path

import pytest

from rigs.requirements import lacking
from volery.components.cpp.build import INCLUDE
from volery.ros.client_libraries import roscpp
from volery.ros.messages import from_cdr
from volery.trace.events import Charge, Published, Text

pytestmark = pytest.mark.integration

MODEL = """
volery: 1
name: keeping
components:
  Keeper:
    language: roscpp
    path: pose_keeper.cpp
    build: {flags: -O0}
    active: true
    at: {processor: intel-i5-3470, frequency: 3000 MHz}
    activation: {time: 10 us}
  Plant:
    language: roscpp
    path: plant.cpp
    build: {flags: -O0}
    active: true
    at: {processor: intel-i5-3470, frequency: 3000 MHz}
    activation: {time: 10 us}
application:
  keeper:
    is: Keeper
    namespace: /robot
    parameters: {goal_x: 0.5, goal_y: 1, tolerances: [0.1, 7]}
    remap: {poseupdate: where}
  plant: {is: Plant, namespace: /robot, remap: {poseupdate: where}}
platform: {processors: {pc: {is: intel-i5-3470, frequency: 3000 MHz}}}
allocations: {only: {keeper: pc, plant: pc}}
run: {duration: 60 s}
"""
FILES = Path(__file__).parent / "files"


def test_two_nodes_talk(run_model):
    outcome = run_model(MODEL, "pose_keeper.cpp", "plant.cpp", "robot_msgs")
    assert outcome.run.completed, outcome.run.record.outcome
    said = [(one.source, one.text) for one in outcome.of(Text)]
    assert ("plant", "enabled: go on") in said
    assert ("keeper", "gps at 43.5, status -1") in said
    assert ("keeper", "/robot/pose_keeper_1 has arrived") in said
    [stopped] = [text for source, text in said if source == "plant" and text.startswith("stopped after")]
    assert not [text for _, text in said if "no server of" in text]

    marks = [one for one in outcome.of(Published) if one.topic == "/robot/marks"]
    assert len(marks) == int(stopped.split()[2])
    last = from_cdr(marks[-1].type, marks[-1].data)
    assert (last.kind, list(last.numbers), list(last.weights)) == ("round", [len(marks) - 1, -1], [0, 0, 0])
    assert {one.topic for one in outcome.of(Published)} >= {"/robot/where", "/robot/cmd_vel", "/robot/errors"}

    kinds = {one.kind for one in outcome.of(Charge) if one.component == "keeper"}
    assert kinds >= {
        "ros:init",
        "ros:subscribe",
        "ros:advertise",
        "ros:spin_once",
        "ros:sleep",
        "ros:publish",
    }


QUEUES = """
volery: 1
name: queues
components:
  Queues:
    language: roscpp
    path: queues.cpp
    build: {flags: -O0}
    active: true
    at: {processor: intel-i5-3470, frequency: 3000 MHz}
    activation: {time: 10 us}
application: {queues: {is: Queues}}
platform: {processors: {pc: {is: intel-i5-3470, frequency: 3000 MHz}}}
allocations: {only: {queues: pc}}
run: {duration: 10 s}
"""
FORMS = ["pointer 7", "reference 7", "value 7", "fixed 7", "event 7 1", "changed 7", "function 7"]


def test_queues_spinners_and_forms_of_callbacks(run_model):
    outcome = run_model(QUEUES, "queues.cpp")
    assert outcome.run.completed, outcome.run.record.outcome
    said = [one.text for one in outcome.of(Text) if one.source == "queues"]
    first, second = said.index("own queue 7"), len(said) - said[::-1].index("own queue 7")
    assert said[0] == "welcome /queues on /greetings"
    assert sorted(said[1:8]) == sorted(FORMS), "two tasks spin"
    assert said[8:first] == ["disconnected", "nobody spins"]
    assert said[first:second] == ["own queue 7", "own queue 7"]
    expected = ["empty 1", "unlock", "thread 5 0", "search 1 /level", "out of range"]
    assert said[second : second + 5] == expected
    assert sorted(said[second + 5 : -1]) == sorted(FORMS)
    assert said[-1] == "tick"


def test_frames_of_tf_and_tf2(run_model):
    """The angles, the interpolated rotation and the inverse are those of tf2 0.7.6."""
    model = QUEUES.replace("queues.cpp", "frames.cpp").replace(
        "is: Queues", "is: Queues, arguments: [one, _rate:=7, two words]"
    )
    outcome = run_model(model, "frames.cpp")
    assert outcome.run.completed, outcome.run.record.outcome
    known = "There is base, camera or world"
    assert [one.text for one in outcome.of(Text) if one.source == "queues"] == [
        "argument one, rate 7",
        "argument two words, rate 7",
        "at first 0",
        "between 2.500000 0.000000 2.000000 yaw 0.250000",
        "camera 9.621610 0.783327 2.000000 yaw 2.470796",
        "point 1.000000 1.000000 base",
        "angles 0.220277 0.036965 0.294047",
        "slerp 0.585608 1.297457",
        "back -2.000000 1.000000 -3.000000",
        f'lookup: "nowhere" passed to lookupTransform argument source_frame does not exist. {known}',
        "extrapolation 0",
    ]


def test_filters_of_messages_and_values_of_parameters(run_model):
    """The sets are those of message_filters 1.15.15 for the same streams."""
    places = "{places: [{name: here, at: [1.5, 2.5], level: 3}, {name: far, at: [3.0, 4.0]}]}"
    model = QUEUES.replace("queues.cpp", "filters.cpp").replace(
        "is: Queues", f"is: Queues, parameters: {places}"
    )
    outcome = run_model(model, "filters.cpp")
    assert outcome.run.completed, outcome.run.record.outcome
    assert [one.text for one in outcome.of(Text) if one.source == "queues"] == [
        *("exact 0.1 0.1", "near 0.1 0.1", "known 0.1", "near 0.2 0.2", "exact 0.3 0.3", "near 0.3 0.3"),
        *("known 0.2", "near 0.4 0.5", "known 0.3", "known 0.4", "known 0.5"),
        "kept 0.400000000 to 0.500000000",
        "here 2.5",
        "far 4",
        "value {[at:{1.5,2.5},level:3,name:here],[at:{3,4},name:far]}",
        "wrong type error 3",
        "set 1",
        "at={3,4}",
        "name=there",
    ]


def test_actions(run_model):
    outcome = run_model(QUEUES.replace("queues.cpp", "actions.cpp"), "actions.cpp", "robot_msgs")
    assert outcome.run.completed, outcome.run.record.outcome
    said = [one.text for one in outcome.of(Text) if one.source == "queues"]
    assert said[:-1] == [
        *("server 1", "active", "at 1", "at 2", "at 3", "done SUCCEEDED 3", "in time 1", "in time 0"),
        "PREEMPTED 6 as you wish",
        "next SUCCEEDED",
        "the execute callback has returned without an end of its goal, which is aborted",
    ]
    assert said[-1] == "without an end ABORTED"


def test_it_compiles_without_boost(tmp_path):
    both = _includes("pose_keeper.cpp") + _includes("filters.cpp")
    headers = roscpp.generate_headers(both, FILES / "pose_keeper.cpp")
    for name, text in headers.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    folders = [f"-I{one}" for one in (roscpp.FALLBACK[0], tmp_path, roscpp.INCLUDE, *INCLUDE)]
    _check("pose_keeper.cpp", *folders)
    _check("filters.cpp", *folders)


def test_it_compiles_with_the_real_roscpp():
    if shutil.which("pkg-config") is None or subprocess.run(["pkg-config", "roscpp"], check=False).returncode:
        lacking("there is no roscpp (scripts/debian-packages roscpp)")
    flags = subprocess.run(["pkg-config", "--cflags", "roscpp"], capture_output=True, text=True, check=True)
    _check("pose_keeper.cpp", *flags.stdout.split())
    _check("queues.cpp", *flags.stdout.split())


ARGUMENTS = {
    "ros::DurationBase": "ros::Duration",
    "ros::TimeBase": "ros::Time, ros::Duration",
    "ros::MessageEvent": "Point const",
    "tf::Stamped": "tf::Vector3",
    "tf2::Stamped": "tf2::Vector3",
    "dynamic_reconfigure::Server": "Config",
    "message_filters::Synchronizer": "message_filters::sync_policies::ExactTime<Point, Point>",
    "message_filters::TimeSynchronizer": "Point, Point",
    "message_filters::sync_policies::": "Point, Point",
    "message_filters::": "Point",
    "ros::message_traits::": "Point",
    "tf::MessageFilter": "Point",
    "tf2_ros::MessageFilter": "Point",
    "actionlib::SimpleActionClient": "robot_msgs::CountAction",
    "actionlib::SimpleActionServer": "robot_msgs::CountAction",
}
PLAIN = ("message_filters::SubscriberBase", "tf::MessageFilterBase", "tf2_ros::MessageFilterBase")
"""Arguments of templates, by their names, or the namespaces that they are in."""


def test_all_names_that_are_listed_as_there_compile(tmp_path):
    lines = [f"#include <{name}>" for name in _every_header()]
    lines += ["#include <robot_msgs/CountAction.h>", "using Point = geometry_msgs::PointStamped;"]
    lines += ["struct Config : dynamic_reconfigure::ConfigBase<Config> {"]
    lines += ["    template <class V> static void each_(V&&) {}", "};"]
    numbers = count()
    for file in sorted((Path(__file__).parents[3] / "scripts/ros_surface/cpp").glob("*.txt")):
        for line in file.read_text().splitlines():
            owner, _, names = line.partition(": ")
            if not line.startswith(("#", "-")):
                lines += [_use(owner, name, next(numbers)) for name in names.split()]
    program = tmp_path / "program.cpp"
    program.write_text("\n".join(lines))
    shutil.copytree(FILES / "robot_msgs", tmp_path / "robot_msgs")
    included = [line.split("<")[1].rstrip(">") for line in lines if line.startswith("#include")]
    for name, text in roscpp.generate_headers(included, program).items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    folders = [f"-I{one}" for one in (tmp_path, roscpp.INCLUDE, *INCLUDE, *roscpp.FALLBACK[1:])]
    command = ["g++", "-std=c++17", "-fsyntax-only", *folders, str(program)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]


def _every_header() -> list[str]:
    """Return the names of all headers that come with volery; those for Eigen where it is installed."""
    eigen = any((folder / "Eigen").is_dir() for folder in roscpp.FALLBACK)
    names = sorted(str(file.relative_to(roscpp.INCLUDE)) for file in roscpp.INCLUDE.rglob("*.h"))
    names += ["angles/angles.h", "tf2/exceptions.h", "tf2/linear_math.h"]
    shared = INCLUDE[1]
    names += sorted(str(file.relative_to(shared)) for file in shared.glob("message_filters/**/*.h"))
    return [name for name in names if eigen or "eigen" not in name]


def _use(owner: str, name: str, number: int) -> str:
    """Return a line that compiles if there is such a name."""
    if owner == "macros":
        return f"\n#ifndef {name}\n#error {name}\n#endif"
    if owner == "XmlRpc" or owner.rpartition("::")[2].islower():
        return f"namespace names_{number} {{ using {owner}::{name}; }}"
    inside = owner[: owner.rfind("::") + 2]
    given = ARGUMENTS.get(owner, ARGUMENTS.get(inside, ""))
    base = f"{owner}<{given}>" if given and owner not in PLAIN else owner
    return f"struct Names_{number} : {base} {{ using Base = {base}; using Base::{name}; }};"


def _includes(name: str) -> list[str]:
    lines = (FILES / name).read_text().splitlines()
    return [line.split("<")[1].rstrip(">") for line in lines if line.startswith("#include")]


def _check(name: str, *options: str) -> None:
    command = ["g++", "-std=c++17", "-fsyntax-only", *options, str(FILES / name)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
