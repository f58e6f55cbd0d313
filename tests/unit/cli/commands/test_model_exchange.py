"""``volery model import`` of launch files: arguments, search folders, what was left out, bad input."""

import json

import pytest
from typer.testing import CliRunner

from rigs.launch_files import LaunchBench, write_package
from volery.cli.main import application

NODE = '<launch><arg name="who" default="a"/><node pkg="mine" type="a.py" name="$(arg who)"/></launch>'


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(*words):
        result = CliRunner().invoke(application(), ["model", "import", *map(str, words)])
        return result.exit_code, result

    return call


def test_arguments_and_the_computer_are_stated(run, tmp_path):
    bench = LaunchBench(tmp_path)
    bench.write("scripts/a.py", "")
    source = bench.write("launch/a.launch", NODE)
    status, shown = run(source, "who:=b", "--processor", "onboard=intel-i5-3470", "--json")
    assert (status, json.loads(shown.stdout)["model"]) == (0, "model.yaml")
    text = (tmp_path / "model.yaml").read_text()
    assert "b: {is: a, node_name: b}" in text
    assert "onboard: {is: intel-i5-3470, frequency: 3000 MHz}" in text


def test_packages_elsewhere_are_searched(run, tmp_path):
    write_package(tmp_path / "far", "mine", {"a.py": ""})
    (tmp_path / "a.launch").write_text(NODE)
    status, shown = run("a.launch")
    assert status == 3
    assert "a.launch:1: there is no package 'mine'" in shown.stderr
    status, _ = run("a.launch", "--replace", "--search", "far")
    assert status == 0
    assert "path: far/mine/a.py" in (tmp_path / "model.yaml").read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["gone.launch"], "gone.launch cannot be read: No such file or directory"),
        (["a.launch", "who=b"], "who=b: an argument of a launch file is NAME:=VALUE"),
        (["a.launch", "--search", "gone"], "--search gone: there is no such folder"),
        (["a.launch", "--processor", "x=rpi4-cortex-a72"], "is onboard=KIND"),
        (["a.uml", "who:=b"], "a.uml is no launch file: NAME:=VALUE and --search are for one"),
        (["a.launch", "--out", "a.launch"], "a.launch exists; --replace writes over it"),
    ],
)
def test_what_is_wrong_is_said(run, tmp_path, words, said):
    (tmp_path / "a.launch").write_text(NODE)
    (tmp_path / "a.uml").write_text("<x/>")
    status, shown = run(*words)
    assert (status, said in shown.stderr) == (2, True), shown.stderr
