"""A launch file of ROS 1, read by volery and by roslaunch's own loader: the same nodes and parameters."""

import json
import shlex
import shutil
import subprocess

import pytest

from rigs.launch_files import LaunchBench, lost
from rigs.requirements import lacking

pytestmark = pytest.mark.integration

LOADER = """
import json, sys
from roslaunch.config import ROSLaunchConfig
from roslaunch.xmlloader import XmlLoader
config = ROSLaunchConfig()
XmlLoader().load(sys.argv[1], config, argv=sys.argv[2:], verbose=False)
nodes = [
    [one.package, one.type, one.name, one.namespace, one.args, dict(one.remap_args), one.respawn,
     one.respawn_delay, one.required]
    for one in config.nodes
]
print(json.dumps([nodes, {name: one.value for name, one in config.params.items()}]))
"""

FILE = """
<launch>
  <arg name="robots" default="1"/>
  <arg name="real" default="false"/>
  <arg name="prefix" value="$(eval 'r%d' % (arg('robots') + 1))"/>
  <param name="rate" value="$(arg robots).5"/>
  <param name="/text" type="str" value=" 12 "/>
  <rosparam command="load" file="$(find mine)/config/gains.yaml" ns="control"/>
  <rosparam param="list">[1, 2.5, x, yes]</rosparam>
  <remap from="/cmd" to="/all"/>
  <group ns="$(arg prefix)" if="$(eval robots > 1)">
    <remap from="odom" to="pose"/>
    <param name="shared" value="0x10"/>
    <include file="$(dirname)/part.launch" pass_all_args="true"><arg name="name" value="in"/></include>
    <node pkg="mine" type="fly.py" name="out" ns="deep" args="-v  '$(arg robots)' $(env HOME)" respawn="true"
          respawn_delay="2.5">
      <remap from="odom" to="own"/>
      <param name="on" value="True"/><param name="word" value=" a b "/><param name="n" value="1e3"/>
      <rosparam>{gains: {p: 1, d: 0.5}, away: no}</rosparam>
    </node>
  </group>
  <node pkg="mine" type="fly.py" name="last" required="true" unless="$(arg real)" clear_params="true">
    <param name="~deep/k" value="1"/>
  </node>
  <node pkg="mine" type="fly.py" name="never" if="$(arg real)"/>
</launch>
"""
PART = """
<launch>
  <arg name="name"/>
  <arg name="robots" default="9"/>
  <param name="here" value="$(arg robots)"/>
  <node pkg="mine" type="fly.py" name="$(arg name)" ns="/top"><remap from="a" to="$(arg name)/b"/></node>
  <node pkg="mine" type="fly.py" name="$(arg name)_2"/>
</launch>
"""


def test_it_starts_what_roslaunch_starts(tmp_path, monkeypatch):
    python = shutil.which("python3", path="/usr/bin")
    if shutil.which("roslaunch") is None or python is None:
        lacking("no roslaunch here (scripts/debian-packages ros1)")
    monkeypatch.setenv("HOME", "/home/mine")
    bench = LaunchBench(tmp_path)
    bench.write("config/gains.yaml", "p: 1.5\nlimits: {up: 3, names: [a, b]}\n")
    bench.write("launch/part.launch", PART)
    reading = bench.read("whole.launch", FILE, robots="3")
    assert lost(reading) == []

    environment = {"ROS_PACKAGE_PATH": str(bench.folder), "PATH": "/usr/bin:/bin", "HOME": "/home/mine"}
    command = [python, "-c", LOADER, str(bench.package / "launch/whole.launch"), "robots:=3"]
    asked = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert asked.returncode == 0, asked.stderr
    nodes, parameters = json.loads(asked.stdout)

    ours = {one.name: one for one in reading.nodes}
    assert list(ours) == [one[2] for one in nodes]
    for package, executable, name, namespace, words, remaps, respawn, delay, required in nodes:
        one = ours[name]
        assert (one.package, one.executable) == (package, executable)
        assert one.namespace == (namespace.rstrip("/") or "/"), name
        assert list(one.arguments) == shlex.split(words), name
        assert (one.remaps, one.respawn, one.respawn_delay) == (remaps, respawn, delay), name
        assert one.required == required
    flat = dict(reading.shared)
    for one in reading.nodes:
        full = f"{one.namespace.rstrip('/')}/{one.name}"
        flat |= {f"{full}/{key}": value for key, value in one.parameters.items()}
    assert flat == _flat(parameters)


def _flat(parameters):
    """Return roslaunch's parameters with dictionaries as names below names."""
    made = {}
    for name, value in parameters.items():
        below = {f"{name}/{key}": one for key, one in value.items()} if isinstance(value, dict) else None
        made |= {name: value} if below is None else _flat(below)
    return made
