"""Launch files of ROS 1: what roslaunch would start, or a note with the line."""

import pytest

from rigs.launch_files import LaunchBench, lost
from volery.base.errors import ModelError


@pytest.fixture
def bench(tmp_path):
    return LaunchBench(tmp_path)


def launch(*lines):
    return "\n".join(("<launch>", *lines, "</launch>"))


def test_a_node_with_all_that_it_may_state(bench):
    node = bench.node(
        "a.launch",
        launch(
            '<remap from="out" to="/all"/>',
            '<param name="~speed" value="2.5"/>',
            '<group ns="left">',
            '  <node pkg="mine" type="fly.py" name="pilot" ns="deep" args="-v \'two words\'" respawn="true"',
            '        respawn_delay="3">',
            '    <remap from="in" to="cmd"/>',
            '    <param name="count" value="3"/><param name="on" value="True"/>',
            '    <param name="word" value="a b"/>',
            '    <param name="number" type="str" value="7"/>',
            '    <rosparam param="list">[1, 2.5, x]</rosparam>',
            "    <rosparam>{gains: {p: 1, d: yes}}</rosparam>",
            "  </node>",
            "</group>",
        ),
    )
    assert (node.package, node.executable, node.name, node.namespace) == (
        "mine",
        "fly.py",
        "pilot",
        "/left/deep",
    )
    assert node.remaps == {"out": "/all", "in": "cmd"}
    assert node.arguments == ("-v", "two words")
    assert (node.respawn, node.respawn_delay, node.required) == (True, 3.0, False)
    assert node.parameters == {
        "speed": 2.5,
        "count": 3,
        "on": True,
        "word": "a b",
        "number": "7",
        "list": [1, 2.5, "x"],
        "gains/p": 1,
        "gains/d": True,
    }


def test_what_a_group_states_ends_with_it(bench):
    text = launch(
        '<group ns="a"><remap from="x" to="y"/><param name="~p" value="1"/></group>',
        '<node pkg="mine" type="fly.py" name="pilot"/>',
    )
    node = bench.node("a.launch", text)
    assert (node.namespace, node.remaps, node.parameters) == ("/", {}, {})


def test_parameters_of_no_node_have_absolute_names(bench):
    bench.write("config/gains.yaml", "pid: {p: 1.5}\n")
    text = launch(
        '<param name="/top" value="1"/>',
        '<group ns="left"><param name="own" value="x"/>',
        '<rosparam file="$(find mine)/config/gains.yaml" command="load" ns="tuned"/></group>',
    )
    assert bench.read("a.launch", text).shared == {"/top": 1, "/left/own": "x", "/left/tuned/pid/p": 1.5}


@pytest.mark.parametrize(
    ("given", "name"), [({}, "base_1"), ({"kind": "sim"}, "sim_1"), ({"kind": "sim", "number": "4"}, "sim_4")]
)
def test_arguments_have_defaults_that_the_command_line_replaces(bench, given, name):
    text = launch(
        '<arg name="kind" default="base"/><arg name="number" default="1"/>',
        '<arg name="name" value="$(arg kind)_$(arg number)"/>',
        '<node pkg="mine" type="fly.py" name="$(arg name)"/>',
    )
    assert bench.node("a.launch", text, **given).name == name


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("$(eval 1 + arg('n') * 2)", "7"),
        ("$(eval n == 3 and mode != 'x')", "True"),
        ("$(eval 'a' if real else mode.upper())", "FLY"),
        ("$(eval find('mine')[-4:])", "mine"),
        ("$(optenv NOT_SET_HERE two words)", "two words"),
        ("$(dirname)/x", "launch/x"),
        ("$(anon node)-$(anon node)", "node_1-node_1"),
    ],
)
def test_substitutions(bench, text, value):
    made = bench.node(
        "a.launch",
        launch(
            '<arg name="n" default="3"/><arg name="mode" default="fly"/><arg name="real" default="false"/>',
            f'<node pkg="mine" type="fly.py" name="a"><param name="p" type="str" value="{text}"/></node>',
        ),
    ).parameters["p"]
    assert made.endswith(value)


@pytest.mark.parametrize(
    ("condition", "there"), [("1", True), ("true", True), ("0", False), ("False", False)]
)
def test_conditions(bench, condition, there):
    text = launch(
        '<arg name="c"/>',
        '<node if="$(arg c)" pkg="mine" type="a.py" name="yes"/>',
        '<group unless="$(arg c)"><node pkg="mine" type="a.py" name="no"/></group>',
    )
    assert bench.node("a.launch", text, c=condition).name == ("yes" if there else "no")


def test_an_include_has_its_own_arguments(bench):
    bench.write(
        "launch/inner.launch",
        launch(
            '<arg name="who"/><arg name="kind" default="plain"/>',
            '<node pkg="mine" type="fly.py" name="$(arg who)_$(arg kind)"/>',
        ),
    )
    for how, name in (("", "a_plain"), ('pass_all_args="true"', "a_special")):
        text = launch(
            '<arg name="kind" default="special"/>',
            f'<include file="$(find mine)/launch/inner.launch" ns="there" {how}>',
            '  <arg name="who" value="a"/></include>',
        )
        node = bench.node("outer.launch", text)
        assert (node.name, node.namespace) == (name, "/there")
        assert node.where.file.endswith("inner.launch")


@pytest.mark.parametrize(
    ("line", "note"),
    [
        (
            '<node pkg="mine" type="a.py" name="$(arg nothing)"/>',
            "<node> is left out: the argument 'nothing'",
        ),
        ('<node pkg="mine" name="a"/>', "<node> is left out: its attribute 'type' is missing"),
        (
            '<node if="maybe" pkg="mine" type="a" name="a"/>',
            "<node> is left out: 'maybe' is neither true nor",
        ),
        ('<include file="$(find other)/a.launch"/>', "<include> is left out: there is no package 'other'"),
        ('<include file="gone.launch"/>', "gone.launch cannot be read: No such file"),
        ('<param name="p" command="xacro a"/>', "parameter p: no command is executed"),
        ('<param name="p" type="int" value="x"/>', "parameter p: 'x' is no int"),
        ('<rosparam command="delete" param="p"/>', "command 'delete': parameters are only loaded"),
        ("<rosparam>[1, 2]</rosparam>", "its values have no names"),
        ("<rosparam>{a: [}</rosparam>", "this is not YAML"),
        ('<machine name="m" address="h"/>', "<machine> is left out"),
        ('<env name="E" value="1"/>', "the environment variable E is left out"),
        ('<test pkg="mine" type="t" test-name="t"/>', "<test> is left out"),
        ('<nodes pkg="mine"/>', "<nodes> is left out"),
        ('<param name="p" value="$(eval __import__(\'os\').getpid())"/>', "'__import__' is not known"),
        ('<param name="p" value="$(eval 9**9**9)"/>', "a power that is too great"),
        ('<param name="p" value="$(eval \'a\' * 99999999)"/>', "a text or a list that is too long"),
        ('<param name="p" value="$(eval \'{0.__class__}\'.format(1))"/>', "is not evaluated"),
        ('<param name="p" value="$(env NOT_SET_HERE)"/>', "the environment variable NOT_SET_HERE is not set"),
        ('<param name="p" value="$(bogus x)"/>', "$(bogus x) is no substitution of roslaunch"),
    ],
)
def test_what_does_not_map_is_named_with_its_line(bench, line, note):
    listed = lost(bench.read("a.launch", launch(line)))
    assert len(listed) == 1
    assert listed[0].startswith("2: ")
    assert note in listed[0]


def test_a_file_that_includes_itself_is_read_once(bench):
    text = launch('<include file="$(find mine)/launch/a.launch"/>')
    model = bench.read("a.launch", text)
    assert lost(model) == ["2: a.launch includes a.launch, with the same arguments: it is left out"]


def test_a_file_may_include_itself_with_another_argument(bench):
    inner = '<include file="$(find mine)/launch/a.launch"><arg name="n" value="$(eval n - 1)"/></include>'
    text = launch('<arg name="n" default="2"/>', f'<group if="$(eval n > 0)">{inner}</group>')
    assert not lost(bench.read("a.launch", text))
    assert lost(bench.read("a.launch", launch('<arg name="n" default="2"/>', inner))) == [
        "3: too many files are included: is there a circle? The rest is left out"
    ]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("<launch><node></launch>", "this is not XML"),
        ("<robot/>", "its root is <robot>; a launch file has <launch>"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><launch/>', "a document type or an entity is declared"),
    ],
)
def test_what_is_no_launch_file_is_refused(bench, text, what):
    with pytest.raises(ModelError, match=what):
        bench.read("a.launch", text)


def test_an_argument_that_no_file_declares_is_named(bench):
    text = launch('<node pkg="mine" type="a.py" name="a"/>')
    assert lost(bench.read("a.launch", text, sped="1")) == ["1: the file declares no argument 'sped'"]
