"""Models as launch files, which are read again."""

import pytest

from rigs.launch_files import LaunchBench
from volery.base.errors import UsageError
from volery.components.package_search import PackageSearch
from volery.exchange.convert import export_model
from volery.exchange.launch.launch_model import read_launch
from volery.run.assembly.model_checks import vocabulary

MODEL = """
volery: 1
name: pair
components:
  Talk: {language: LANGUAGE, path: src/mine/scripts/talk.py, active: true, on_failure: restart}
  Own: {language: python, active: true}
application:
  talker:
    is: Talk
    node_name: speaker
    namespace: /left
    parameters: {rate: 2.5, count: 3, on: true, text: "a <b> & 'c' \\"d\\"", names: ["x", "y"], gains: {p: 1}}
    remap: {words: /all/words}
    arguments: [-v, two words]
  other: {is: Own}
environment:
  places: {home: {east: 0 m, north: 0 m}}
  vehicles: {drone: {kind: multirotor, autopilot: px4, at: home}}
platform:
  processors: {onboard: {is: rpi4-cortex-a72, frequency: 1500 MHz}}
allocations:
  all: {talker: onboard, other: onboard, drone: onboard}
"""


@pytest.fixture
def bench(tmp_path):
    return LaunchBench(tmp_path)


def exported(bench, name, ros):
    bench.write("scripts/talk.py", "")
    model = bench.folder.parent / "model.yaml"
    model.write_text(MODEL.replace("LANGUAGE", "rospy" if ros == 1 else "rclpy"))
    target = bench.folder.parent / name
    return target, [str(one) for one in export_model(model, target, vocabulary(), PackageSearch())]


@pytest.mark.parametrize(("name", "ros"), [("a.launch", 1), ("a.launch.xml", 2), ("a.launch.py", 2)])
def test_a_launch_file_that_was_written_starts_the_nodes_of_the_model(bench, name, ros):
    target, notes = exported(bench, name, ros)
    assert notes == [f"components in python, which are no nodes of ROS {ros}: other"]
    reading = read_launch(target, {"drone_url": "udp://:1@"}, PackageSearch([bench.folder]))
    assert [str(one) for one in reading.notes if one.lost] == []
    talker, mavros = reading.nodes
    assert (talker.package, talker.executable, talker.name) == ("mine", "talk.py", "speaker")
    assert (talker.namespace, talker.remaps) == ("/left", {"words": "/all/words"})
    assert talker.arguments == ("-v", "two words")
    assert talker.respawn
    text, separator = "a <b> & 'c' \"d\"", "/" if ros == 1 else "."
    assert talker.parameters == {
        "rate": 2.5,
        "count": 3,
        "on": True,
        "text": text,
        "names": ["x", "y"],
        f"gains{separator}p": 1,
    }
    assert (mavros.package, mavros.name, mavros.parameters) == ("mavros", "drone", {"fcu_url": "udp://:1@"})


def test_an_ending_that_is_none_is_refused(bench):
    with pytest.raises(UsageError, match="its ending chooses the format"):
        exported(bench, "a.txt", 1)
