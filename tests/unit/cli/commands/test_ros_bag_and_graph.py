"""``volery ros bag`` and ``volery ros graph`` where no ROS is needed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from volery.cli.main import application
from volery.ros import messages
from volery.ros.messages.bags import create_bag, open_bag


def run(*arguments: object) -> Any:
    return CliRunner().invoke(application(), [str(one) for one in arguments])


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    path = tmp_path / "walk.bag"
    with create_bag(path) as made:
        for number in range(11):
            made.write("/steps", number * 100_000_000, messages.new("std_msgs/Int32", data=number))
            made.write("/words", number * 100_000_000, messages.new("std_msgs/String", data="on"))
    return path


def test_info(bag: Path) -> None:
    told = json.loads(run("ros", "bag", "info", bag, "--json").output)
    assert (told["format"], told["complete"]) == ("rosbag 1", True)
    assert told["topics"][0] == {"name": "/steps", "type": "std_msgs/msg/Int32", "messages": 11}
    assert "std_msgs/msg/String" in run("ros", "bag", "info", bag).output


@pytest.mark.parametrize("topic", ["/a[/b]", "/a[red]b", "/[link=x]y[/link]"])
def test_the_name_of_a_topic_is_no_markup(tmp_path: Path, topic: str) -> None:
    path = tmp_path / "marked.bag"
    with create_bag(path) as made:
        made.write(topic, 0, messages.new("std_msgs/Int32", data=1))
    done = run("ros", "bag", "info", path)
    assert done.exit_code == 0
    assert topic in "".join(done.output.split())


def test_converted_to_the_other_format_and_back(bag: Path, tmp_path: Path) -> None:
    assert run("ros", "bag", "convert", bag, tmp_path / "walk", "--topic", "/steps").exit_code == 0
    assert run("ros", "bag", "convert", tmp_path / "walk", tmp_path / "again.bag").exit_code == 0
    again = open_bag(tmp_path / "again.bag")
    assert [one.message.data for one in again.messages()] == list(range(11))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("ros", "bag", "info", "nowhere.bag"), "no recording nowhere.bag"),
        (("ros", "bag", "convert", "BAG", "BAG"), "is the recording itself"),
        (("ros", "bag", "play", "BAG", "--graph", "ros3"), "no graph 'ros3'"),
        (("ros", "bag", "record", "OUT", "--seconds", "-1"), "give a number above 0"),
        (("ros", "graph", "rso1"), "did you mean 'ros1'?"),
        (("ros", "graph", "ros1", "--within", "-1"), "seconds from 0 to 3600"),
        (("ros", "graph", "OUT"), "cannot read"),
    ],
)
def test_bad_input(bag: Path, tmp_path: Path, arguments: tuple[str, ...], said: str) -> None:
    places = {"BAG": bag, "OUT": tmp_path}
    result = run(*(places.get(one, one) for one in arguments))
    assert result.exit_code == 2
    assert said in " ".join(result.output.split())
    assert "Traceback" not in result.output
