"""Launch files of ROS 2 in Python: read over their syntax tree and never executed."""

import pytest

from rigs.launch_files import LaunchBench, lost
from volery.base.errors import ModelError

HEAD = """
import os
from pathlib import Path
import yaml
from ament_index_python.packages import get_package_share_directory
from ament_index_python.resources import has_resource
from launch import LaunchDescription
from launch.actions import (DeclareLaunchArgument, ExecuteProcess, GroupAction, IncludeLaunchDescription,
    OpaqueFunction, RegisterEventHandler, SetEnvironmentVariable, TimerAction)
from launch.conditions import IfCondition, UnlessCondition, LaunchConfigurationEquals
from launch.event_handlers import OnProcessStart
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import (Command, FileContent, LaunchConfiguration, PathJoinSubstitution,
    PythonExpression)
from launch_ros.actions import ComposableNodeContainer, LoadComposableNodes, Node, PushRosNamespace
from launch_ros.descriptions import ComposableNode, ParameterValue
from launch_ros.substitutions import FindPackageShare
import launch_ros.actions
"""


@pytest.fixture
def bench(tmp_path):
    return LaunchBench(tmp_path)


def described(*actions):
    listed = "".join(f"        {one},\n" for one in actions)
    return f"{HEAD}\ndef generate_launch_description():\n    return LaunchDescription([\n{listed}    ])\n"


def test_a_node_with_all_that_it_may_state(bench):
    bench.write("config/p.yaml", "/**: {ros__parameters: {every: 1}}\n")
    text = described(
        'DeclareLaunchArgument("speed", default_value="2.5")',
        'GroupAction([PushRosNamespace("left"), Node(package="mine", executable="fly", name=["pi", "lot"], '
        'namespace="deep", remappings=[("in", "cmd")], arguments=["-v", LaunchConfiguration("speed")], '
        'respawn=True, respawn_delay=2.0, parameters=[{"speed": LaunchConfiguration("speed"), "n": 3, '
        '"gains": {"p": 1.0}, "text": ParameterValue(LaunchConfiguration("speed"), value_type=str)}, '
        'os.path.join(get_package_share_directory("mine"), "config", "p.yaml")])])',
    )
    node = bench.node("a.launch.py", text, speed="4")
    assert (node.name, node.namespace, node.remaps) == ("pilot", "/left/deep", {"in": "cmd"})
    assert node.arguments == ("-v", "4")
    assert (node.respawn, node.respawn_delay) == (True, 2.0)
    assert node.parameters == {"speed": 4, "n": 3, "gains.p": 1.0, "text": "4", "every": 1}


def test_a_description_that_is_built_step_by_step(bench):
    text = (
        HEAD
        + """
ROBOTS = ["a", "b"]

def pilot(name, number=1):
    return Node(package="mine", executable="fly", name=f"{name}_{number}", namespace=name)

def generate_launch_description():
    ld = LaunchDescription()
    share = Path(get_package_share_directory("mine"))
    with open(share / "config" / "p.yaml") as file:
        config = yaml.safe_load(file)
    for index, robot in enumerate(ROBOTS):
        if robot == "a":
            ld.add_action(pilot(robot))
        else:
            ld.add_action(pilot(robot, number=index + config["first"]))
    ld.add_action(launch_ros.actions.Node(package="mine", executable="fly", name="last"))
    others = [Node(package="mine", executable="fly", name=one) for one in ("x", "y")]
    others += [Node(package="mine", executable="fly", name="z")]
    return LaunchDescription([ld, *others]) if False else add(ld, others)

def add(ld, others):
    for one in others:
        ld.add_action(one)
    return ld
"""
    )
    bench.write("config/p.yaml", "first: 10\n")
    names = [one.name for one in bench.read("a.launch.py", text).nodes]
    assert names == ["a_1", "b_11", "last", "x", "y", "z"]


def test_a_function_that_is_called_with_the_arguments(bench):
    text = (
        HEAD
        + """
def setup(context, *args, **kwargs):
    count = int(LaunchConfiguration("count").perform(context))
    return [Node(package="mine", executable="fly", name="n" + str(i)) for i in range(count)]

def generate_launch_description():
    count = DeclareLaunchArgument("count", default_value="1")
    return LaunchDescription([count, OpaqueFunction(function=setup)])
"""
    )
    assert [one.name for one in bench.read("a.launch.py", text, count="3").nodes] == ["n0", "n1", "n2"]


@pytest.mark.parametrize(
    "condition",
    [
        'IfCondition(LaunchConfiguration("real"))',
        'UnlessCondition(PythonExpression(["not ", LaunchConfiguration("real")]))',
        'IfCondition(PythonExpression(["\'", LaunchConfiguration("mode"), "\' == \'fly\'"]))',
        'LaunchConfigurationEquals("mode", "fly")',
    ],
)
@pytest.mark.parametrize("there", [True, False])
def test_conditions(bench, condition, there):
    text = described(
        'DeclareLaunchArgument("real")',
        'DeclareLaunchArgument("mode")',
        f'Node(package="mine", executable="fly", name="a", condition={condition})',
    )
    given = {"real": str(there), "mode": "fly" if there else "walk"}
    assert [one.name for one in bench.read("a.launch.py", text, **given).nodes] == (["a"] if there else [])


def test_includes_of_files_with_arguments(bench):
    bench.write(
        "launch/inner.launch.py",
        described(
            'DeclareLaunchArgument("who", default_value="nobody")',
            'Node(package="mine", executable="fly", name=LaunchConfiguration("who"))',
        ),
    )
    bench.write(
        "launch/inner.launch.xml", '<launch><node pkg="mine" exec="fly" name="$(var who)_2"/></launch>'
    )
    text = described(
        "IncludeLaunchDescription(PythonLaunchDescriptionSource(PathJoinSubstitution(["
        'FindPackageShare("mine"), "launch", "inner.launch.py"])), launch_arguments={"who": "me"}.items())',
        'IncludeLaunchDescription(os.path.join(os.path.dirname(__file__), "inner.launch.xml"))',
    )
    assert [one.name for one in bench.read("a.launch.py", text).nodes] == ["me", "me_2"]


def test_a_container_and_its_composable_nodes(bench):
    text = described(
        'ComposableNodeContainer(name="box", namespace="n", package="rclcpp_components", '
        'executable="component_container", composable_node_descriptions=[ComposableNode(package="mine", '
        'plugin="mine::Eye", name="eye", parameters=[{"a": 1}])])',
        'LoadComposableNodes(target_container="n/box", composable_node_descriptions=['
        'ComposableNode(package="mine", plugin="mine::Ear", name="ear")])',
    )
    _box, eye, ear = bench.read("a.launch.py", text).nodes
    assert (eye.executable, eye.container, eye.parameters) == ("mine::Eye", "/n/box", {"a": 1})
    assert (ear.executable, ear.container) == ("mine::Ear", "/n/box")


def test_what_starts_later_starts_with_the_others(bench):
    text = described(
        'TimerAction(period=5.0, actions=[Node(package="mine", executable="fly", name="late")])',
        "RegisterEventHandler(OnProcessStart(target_action=None, on_start=["
        'Node(package="mine", executable="fly", name="then")]))',
    )
    reading = bench.read("a.launch.py", text)
    assert [one.name for one in reading.nodes] == ["late", "then"]
    assert ["start" in one.what for one in reading.notes] == [True, True]


@pytest.mark.parametrize(
    ("action", "note"),
    [
        ("Node(package='mine', executable=unheard_of())", "a node is left out: 'unheard_of' is not known"),
        (
            "Node(package='mine', executable='a', name=os.popen('date').read())",
            "`os.popen('date')` is not evaluated",
        ),
        (
            "Node(package='mine', executable='a', parameters=[{'p': Command(['xacro'])}])",
            "no command is executed",
        ),
        (
            "Node(package='mine', executable='a', condition=IfCondition('maybe'))",
            "'maybe' is neither true nor",
        ),
        ("IncludeLaunchDescription(PythonLaunchDescriptionSource('gone.py'))", "cannot be read"),
        (
            "IncludeLaunchDescription(get_package_share_directory('other') + '/a.py')",
            "there is no package 'other'",
        ),
        ("ExecuteProcess(cmd=['gazebo'])", "ExecuteProcess is left out: it is no node"),
        ("SetEnvironmentVariable('E', '1')", "the environment variable E is left out"),
    ],
)
def test_what_does_not_map_is_named_with_its_line(bench, action, note):
    text = described(action)
    (listed,) = lost(bench.read("a.launch.py", text))
    assert listed.startswith(f"{text.splitlines().index(f'        {action},') + 1}: ")
    assert note in listed


@pytest.mark.parametrize(
    ("body", "note"),
    [
        ("    if os.path.getsize('x') > 1:\n        ld.add_action(1)", "is left out with what depends on it"),
        ("    for one in os.listdir('.'):\n        ld.add_action(one)", "`for one` is left out"),
        ("    while True:\n        pass", "a `while` loop is left out"),
        ("    unheard_of(ld)", "`unheard_of(ld)` is left out"),
    ],
)
def test_a_statement_that_is_not_followed_is_named(bench, body, note):
    text = (
        f"{HEAD}\ndef generate_launch_description():\n    ld = LaunchDescription()\n{body}\n    return ld\n"
    )
    assert note in lost(bench.read("a.launch.py", text))[0]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("def x(:\n", "a.launch.py:1: not Python"),
        ("x = 1\n", "there is no function generate_launch_description"),
        ("def generate_launch_description():\n    return made()\n", "'made' is not known"),
        ("def generate_launch_description():\n    return 3\n", "returns no LaunchDescription that is known"),
        (
            "def generate_launch_description():\n    return generate_launch_description()\n",
            "functions call each other too deeply",
        ),
        (
            "def generate_launch_description():\n    for a in range(900):\n        for b in range(900):\n"
            "            c = a + b\n",
            "it computes for too long",
        ),
    ],
)
def test_what_is_no_launch_file_is_refused(bench, text, what):
    with pytest.raises(ModelError, match=what):
        bench.read("a.launch.py", text)


def test_the_environment_and_files_are_read(bench, monkeypatch):
    monkeypatch.setenv("KIND_OF_ROBOT", "waffle")
    bench.write("config/waffle.txt", "text")
    text = described(
        'Node(package="mine", executable="fly", name=os.environ["KIND_OF_ROBOT"], condition=IfCondition(str('
        '"KIND_OF_ROBOT" in os.environ)), namespace=os.environ.get("NOT_SET_HERE", "n"), arguments=['
        'FindPackageShare("mine").find("mine") + os.path.join("/config", "")])',
    )
    node = bench.node("a.launch.py", text)
    assert (node.name, node.namespace) == ("waffle", "/n")
    assert node.arguments[0].endswith("mine/config/")


def test_nothing_is_executed(bench, tmp_path):
    text = described(f"open({str(tmp_path / 'made')!r}, 'w').write('x')")
    bench.read("a.launch.py", f"import os\nos.mkdir({str(tmp_path / 'folder')!r})\n{text}")
    assert sorted(one.name for one in tmp_path.iterdir()) == ["src"]


def test_values_of_parameters_that_are_read_or_empty(bench):
    bench.write("robot.urdf", "<robot/>")
    text = described(
        'DeclareLaunchArgument("word", default_value="")',
        'Node(package="mine", executable="fly", parameters=[{"word": LaunchConfiguration("word"), '
        '"description": FileContent(PathJoinSubstitution([FindPackageShare("mine"), "robot.urdf"])), '
        '"paths": "a" + os.pathsep + "b", "there": has_resource("packages", "mine"), '
        '"not": has_resource("packages", "nobodys")}])',
    )
    node = bench.node("a.launch.py", text)
    assert node.parameters == {
        "word": "",
        "description": "<robot/>",
        "paths": "a:b",
        "there": True,
        "not": False,
    }


def test_a_parameter_that_is_not_known_is_named_and_the_others_are_kept(bench):
    parameters = '[{"one": 1, "urdf": Command(["xacro x"]), "two": launch_ros.Odd()}, {"three": 3}]'
    text = described(f'Node(package="mine", executable="fly", parameters={parameters})')
    reading = bench.read("a.launch.py", text)
    (node,) = reading.nodes
    assert node.parameters == {"one": 1, "three": 3}
    line = text[: text.index("Node(package")].count("\n") + 1
    assert lost(reading) == [
        f"{line}: the parameter urdf of /fly is left out: no command is executed",
        f"{line}: the parameter two of /fly is left out: Odd is left out",
    ]


def test_a_file_of_parameters_for_several_nodes(bench):
    bench.write(
        "config/p.yaml",
        "/**: {fly: {ros__parameters: {a: 1, c: {d: 2}}}}\n/**: {other: {ros__parameters: {a: 3}}, "
        "fly: {ros__parameters: {b: 4}}}\n",
    )
    share = 'os.path.join(get_package_share_directory("mine"), "config", "p.yaml")'
    text = described(
        f'Node(package="mine", executable="fly", parameters=[{share}])',
        f'Node(package="mine", executable="x", name="other", parameters=[{share}])',
    )
    reading = bench.read("a.launch.py", text)
    assert [one.parameters for one in reading.nodes] == [{"a": 1, "c.d": 2, "b": 4}, {"a": 3}]
    [what] = lost(reading)
    assert what.endswith("parameters of /**/other are left out: no name is stated for /fly")
