"""The model of a launch file: components with their code, instances, vehicles, and a run of it."""

import re

import pytest

import volery
from rigs.launch_files import LaunchBench, lost
from volery.base.errors import ModelError
from volery.components.package_search import PackageSearch
from volery.exchange.launch.launch_model import LaunchComputer, launch_tree, read_launch
from volery.model.system_loader import load
from volery.model.writing import model_text
from volery.run.assembly.model_checks import vocabulary

ONBOARD = LaunchComputer("rpi4-cortex-a72", 1.5e9)
SAY = """
import rospy
from std_msgs.msg import String
rospy.init_node("say")
publisher = rospy.Publisher("words", String, queue_size=1)
rate = rospy.Rate(rospy.get_param("~rate"))
while not rospy.is_shutdown():
    publisher.publish(rospy.get_param("~text") + rospy.get_param("/end"))
    rate.sleep()
"""
HEAR = """
import rospy
from std_msgs.msg import String
rospy.init_node("hear")
rospy.Subscriber("heard", String, lambda message: print(rospy.get_name(), message.data))
rospy.spin()
"""
TALK = """<launch>
  <param name="/end" value="!"/>
  <group ns="left">
    <node pkg="mine" type="say.py" name="speaker">
      <param name="rate" value="10"/><param name="text" value="10 m"/>
    </node>
    <node pkg="mine" type="hear.py" name="ear" required="true"><remap from="heard" to="words"/></node>
  </group>
</launch>
"""


@pytest.fixture
def bench(tmp_path):
    return LaunchBench(tmp_path)


def tree_of(bench, name, text, **given):
    source = bench.write(f"launch/{name}", text)
    reading = read_launch(source, given, PackageSearch())
    return launch_tree(reading, source, bench.folder.parent, ONBOARD), reading


def test_a_launch_file_runs_in_virtual_time(bench, capsys):
    bench.write("scripts/say.py", SAY)
    bench.write("scripts/hear.py", HEAR)
    tree, reading = tree_of(bench, "talk.launch", TALK)
    assert lost(reading) == []
    file = bench.folder.parent / "model.yaml"
    file.write_text(model_text(tree))
    run = volery.simulate(file, volery.Options(fidelity="code"), overrides=["run.duration=1 s"])
    assert run.error is None
    heard = [line for line in capsys.readouterr().err.splitlines() if line == "/left/ear 10 m!"]
    assert 9 <= len(heard) <= 11


def test_components_have_their_files_languages_and_functions(bench):
    bench.write("scripts/say.py", SAY)
    bench.write("src/fly.cpp", "int main(int argc, char** argv) { return 0; }\n")
    bench.write("mine/entry.py", "def start():\n    pass\n")
    bench.write("setup.py", "setup(entry_points={'console_scripts': ['begin = mine.entry:start']})\n")
    text = """<launch>
      <node pkg="mine" exec="fly" name="a"/><node pkg="mine" exec="begin" respawn="true" respawn_delay="2"/>
      <node pkg="mine" exec="fly" name="b" namespace="n"/>
    </launch>"""
    tree, reading = tree_of(bench, "a.launch.xml", text)
    assert lost(reading) == []
    assert tree["components"] == {
        "fly": {"language": "rclcpp", "path": "src/mine/src/fly.cpp", "active": True},
        "begin": {
            "language": "rclpy",
            "path": "src/mine/mine/entry.py",
            "main": "start",
            "active": True,
            "on_failure": {"action": "restart", "delay": "2 s"},
        },
    }
    assert tree["application"] == {
        "a": {"is": "fly", "node_name": "a"},
        "begin": {"is": "begin"},
        "b": {"is": "fly", "node_name": "b", "namespace": "/n"},
    }


def test_a_program_that_is_not_found_is_a_component_without_code_and_named(bench):
    text = """<launch>
<node pkg="mine" type="gone" name="a"/>
<node pkg="other" type="x" name="b"/>
</launch>"""
    tree, reading = tree_of(bench, "a.launch", text)
    assert tree["components"]["gone"] == {"language": "rospy", "active": True}
    assert lost(reading) == [
        "2: no source of gone is in package mine: its component has no code",
        "3: there is no package 'other', so x is a component without code: name its folder with --search",
    ]
    file = bench.folder.parent / "model.yaml"
    file.write_text(model_text(tree))
    assert [one.name for one in load(file, vocabulary()).instances] == ["a", "b"]


@pytest.mark.parametrize(
    ("name", "node", "vehicle"),
    [
        ("px4.launch", '<node pkg="mavros" type="mavros_node" name="mavros"/>', {"mavros": "px4"}),
        ("apm.launch", '<node pkg="mavros" type="mavros_node" name="mavros"/>', {"mavros": "ardupilot"}),
        ("px4.launch.xml", '<node pkg="mavros" exec="mavros_node" namespace="uas"/>', {"uas": "px4"}),
    ],
)
def test_mavros_is_the_node_of_a_vehicle(bench, name, node, vehicle):
    tree, reading = tree_of(bench, name, f"<launch>{node}</launch>")
    assert {key: one["autopilot"] for key, one in tree["environment"]["vehicles"].items()} == vehicle
    assert lost(reading) == []
    file = bench.folder.parent / "model.yaml"
    file.write_text(model_text(tree))
    assert [one.name for one in load(file, vocabulary()).vehicles] == list(vehicle)


def test_mavros_in_a_deeper_namespace_is_named(bench):
    text = '<launch><group ns="uav0"><node pkg="mavros" type="mavros_node" name="mavros"/></group></launch>'
    _tree, reading = tree_of(bench, "px4.launch", text)
    assert lost(reading) == ["1: the names of MAVROS are below /uav0_mavros in a run, not below /uav0/mavros"]


def test_two_nodes_of_one_name_are_two_instances(bench):
    text = '<node pkg="mine" type="a" name="n"/>'
    tree, _ = tree_of(bench, "a.launch", f'<launch>{text}<group ns="g">{text}{text}</group></launch>')
    assert list(tree["application"]) == ["n", "g_n", "g_n_2"]


def test_a_text_that_is_too_long_for_a_model_is_named(bench):
    bench.write("urdf/robot.urdf", "x" * 10_001)
    text = """<launch><param name="robot_description" textfile="$(find mine)/urdf/robot.urdf"/>
<node pkg="mine" type="a" name="n"/></launch>"""
    _tree, reading = tree_of(bench, "a.launch", text)
    assert "2: parameter /robot_description is left out: a text of 10001 characters" in lost(reading)


def test_a_file_that_starts_nothing_is_refused_with_the_reasons(bench):
    text = '<launch><include file="$(find other)/a.launch"/></launch>'
    with pytest.raises(ModelError, match=re.escape("nothing in it is a node that is started:")) as refused:
        tree_of(bench, "a.launch", text)
    assert "there is no package 'other'" in str(refused.value)
