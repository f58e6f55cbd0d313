"""Launch files of ROS 2 in XML and YAML."""

import pytest

from rigs.launch_files import LaunchBench, lost
from volery.base.errors import ModelError


@pytest.fixture
def bench(tmp_path):
    return LaunchBench(tmp_path)


XML = """<launch>
  <arg name="speed" default="2.5"/>
  <let name="where" value="left"/>
  <group>
    <push-ros-namespace namespace="$(var where)"/>
    <set_remap from="out" to="/all"/>
    <node pkg="mine" exec="fly" name="pilot" namespace="deep" args="-v 'two words'">
      <remap from="in" to="cmd"/>
      <param name="speed" value="$(var speed)"/>
      <param name="gains"><param name="p" value="1"/></param>
      <param name="names" value="a;b" value-sep=";"/>
      <param name="text" value="7" type="str"/>
      <param from="$(find-pkg-share mine)/config/p.yaml"/>
    </node>
  </group>
</launch>
"""
YAML = """launch:
- arg: {name: speed, default: "2.5"}
- let: {name: where, value: left}
- group:
  - push_ros_namespace: {namespace: $(var where)}
  - set_remap: {from: out, to: /all}
  - node:
      pkg: mine
      exec: fly
      name: pilot
      namespace: deep
      args: -v 'two words'
      remap: [{from: in, to: cmd}]
      param:
      - {name: speed, value: $(var speed)}
      - name: gains
        param: [{name: p, value: 1}]
      - {name: names, value: a;b, value-sep: ";"}
      - {name: text, value: "7", type: str}
      - {from: $(find-pkg-share mine)/config/p.yaml}
"""
PARAMETERS = """
/**: {ros__parameters: {every: 1}}
/left/deep/pilot: {ros__parameters: {own: {a: x}}}
/right/pilot: {ros__parameters: {other: 1}}
pilot: {ros__parameters: {unqualified: 1}}
/**/pilot: {ros__parameters: {any: 2}}
/*/*/pilot: {ros__parameters: {two: 3}}
left: {deep: {pilot: {ros__parameters: {nested: 4}}}}
"""


@pytest.mark.parametrize(("name", "text"), [("a.launch.xml", XML), ("a.launch.yaml", YAML)])
def test_xml_and_yaml_start_the_same_node(bench, name, text):
    bench.write("config/p.yaml", PARAMETERS)
    node = bench.node(name, text, speed="4")
    assert (node.package, node.executable, node.name, node.namespace) == (
        "mine",
        "fly",
        "pilot",
        "/left/deep",
    )
    assert node.remaps == {"out": "/all", "in": "cmd"}
    assert node.arguments == ("-v", "two words")
    assert node.parameters == {
        "speed": 4,
        "gains.p": 1,
        "names": ["a", "b"],
        "text": "7",
        "every": 1,
        "own.a": "x",
        "any": 2,
        "two": 3,
        "nested": 4,
    }


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("$(eval '1 + int(\\'$(var n)\\')')", "4"),
        ("$(eval \"'$(var mode)' == 'fly'\")", "True"),
        ("$(if $(equals $(var mode) fly) yes no)", "yes"),
        ("$(not $(var real))", "true"),
        ("$(and true $(not $(var real)))", "true"),
        ("$(env NOT_SET_HERE 'two words')", "two words"),
        ("$(file-content $(dirname)/../package.xml)", "</package>\n"),
        ("$(dirname)/x", "launch/x"),
        ("a $(var n) b", "a 3 b"),
        ("\\$(var n)", "$(var n)"),
        ("$(var $(var key))", "fly"),
    ],
)
def test_substitutions(bench, text, value):
    made = bench.node(
        "a.launch.xml",
        '<launch><arg name="n" default="3"/><arg name="mode" default="fly"/>'
        '<arg name="real" default="false"/>'
        '<arg name="key" default="mode"/><node pkg="mine" exec="fly" name="a"><param name="p" type="str" '
        f"value='{text.replace(chr(39), '&apos;')}'/></node></launch>",
    ).parameters["p"]
    assert made.endswith(value)


def test_a_container_and_its_composable_nodes(bench):
    text = """<launch>
      <node_container pkg="rclcpp_components" exec="component_container" name="box" namespace="/n">
        <composable_node pkg="mine" plugin="mine::Eye" name="eye"><remap from="a" to="b"/></composable_node>
      </node_container>
      <load_composable_node target="/n/box">
        <composable_node pkg="mine" plugin="mine::Ear" name="ear" namespace="m"/>
      </load_composable_node>
    </launch>"""
    box, eye, ear = bench.read("a.launch.xml", text).nodes
    assert (box.name, box.container) == ("box", "")
    assert (eye.executable, eye.name, eye.container, eye.remaps) == ("mine::Eye", "eye", "/n/box", {"a": "b"})
    assert (ear.executable, ear.namespace, ear.container) == ("mine::Ear", "/m", "/n/box")


def test_what_a_group_sets_ends_with_it_unless_it_is_not_scoped(bench):
    text = """<launch>
      <group><let name="x" value="1"/><push_ros_namespace namespace="a"/></group>
      <group scoped="false"><push_ros_namespace namespace="b"/></group>
      <node pkg="mine" exec="fly" name="a"><param name="x" value="$(var x 0)"/></node>
    </launch>"""
    node = bench.node("a.launch.xml", text)
    assert (node.namespace, node.parameters) == ("/b", {"x": 0})


@pytest.mark.parametrize(
    ("line", "note"),
    [
        (
            '<node pkg="mine" exec="fly" name="$(var nothing)"/>',
            "a node is left out: there is no argument 'nothing'",
        ),
        ('<node pkg="mine" name="a"/>', "a node is left out: <node> has no attribute 'exec'"),
        ('<node if="$(command date)" pkg="mine" exec="a"/>', "no command is executed"),
        ('<include file="$(find-pkg-share other)/a.py"/>', "there is no package 'other'"),
        ('<include file="gone.launch.py"/>', "cannot be read"),
        ('<executable cmd="date"/>', "<executable> is left out: it is no node"),
        ('<set_env name="E" value="1"/>', "the environment variable E is left out"),
        ('<arg name="needed"/>', "the argument 'needed' has no default: state needed:=VALUE"),
        ("<surprise/>", "<surprise> is left out"),
    ],
)
def test_what_does_not_map_is_named_with_its_line(bench, line, note):
    listed = lost(bench.read("a.launch.xml", f"<launch>\n{line}\n</launch>"))
    assert len(listed) == 1
    assert listed[0].startswith("2: ")
    assert note in listed[0]


@pytest.mark.parametrize(
    ("parameters", "note"),
    [
        ("a: 1\n", "has no key 'ros__parameters'"),
        ("[1]\n", "has no parameters"),
        ("a: [\n", "this is not YAML"),
    ],
)
def test_a_file_that_has_no_parameters_is_named_and_the_node_is_kept(bench, parameters, note):
    bench.write("config/p.yaml", parameters)
    text = """<launch><node pkg="mine" exec="fly" name="a">
    <param from="$(find-pkg-share mine)/config/p.yaml"/></node></launch>"""
    reading = bench.read("a.launch.xml", text)
    assert [one.name for one in reading.nodes] == ["a"]
    assert note in lost(reading)[0]


def test_a_yaml_file_without_a_launch_list_is_refused(bench):
    with pytest.raises(ModelError, match="a launch file in YAML has a list `launch`"):
        bench.read("a.launch.yaml", "nodes: []\n")
