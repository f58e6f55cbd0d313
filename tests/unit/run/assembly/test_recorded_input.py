"""Recordings as inputs of a run: times, loops, remapping, stamps, and what is wrong with them."""

import pytest
from typer.testing import CliRunner

import volery
from volery.base.errors import ModelError, UsageError
from volery.base.time import MS, S
from volery.cli.main import application
from volery.ros.messages import new
from volery.ros.messages.bags import create_bag, open_bag

START = 1_700_000_000 * S
HEAR = """
import rclpy
from sensor_msgs.msg import Range
from std_msgs.msg import String


def main():
    rclpy.init()
    node = rclpy.create_node("hear")
    heard = node.create_publisher(String, "heard", 10)

    def take(message):
        stamp, now = message.header.stamp, node.get_clock().now().nanoseconds
        age = now - (stamp.sec * 10**9 + stamp.nanosec)
        heard.publish(String(data=f"{now / 1e9:.2f} {message.range:g} {age / 1e6:.0f}"))

    node.create_subscription(Range, "range", take, 10)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
"""
MODEL = """
volery: 1
name: replay
components:
  Hear: {language: rclpy, path: hear.py, active: true}
application:
  hear: {is: Hear}
environment:
  inputs: %s
platform:
  processors:
    onboard: {is: intel-i5-3470, frequency: 3 GHz}
allocations:
  all: {hear: onboard}
run: {duration: 2.05 s}
"""


def ranges(count=10):
    """Yield times and messages: one every 100 ms, with a stamp 20 ms before it."""
    for number in range(count):
        at = START + number * 100 * MS
        made = new("sensor_msgs/msg/Range", range=float(number))
        made.header.stamp.sec, made.header.stamp.nanosec = divmod(at - 20 * MS, S)
        yield at, made


def record(file, count=10):
    with create_bag(file) as writer:
        for at, message in ranges(count):
            writer.write("/range", at, message)
            writer.write("/other", at, new("std_msgs/msg/String", data="x"))


@pytest.fixture
def model(tmp_path):
    def write(inputs):
        (tmp_path / "hear.py").write_text(HEAR)
        (tmp_path / "model.yaml").write_text(MODEL % inputs)
        return tmp_path / "model.yaml"

    return write


def heard(file, folder):
    run = volery.simulate(file, volery.Options(fidelity="code", out=folder))
    assert run.error is None
    return [one.message.data.split() for one in open_bag(folder / "trace.mcap").messages(["/heard"])]


@pytest.mark.parametrize("name", ["in.bag", "in"])
def test_messages_come_at_their_recorded_times_as_live(model, tmp_path, name):
    record(tmp_path / name)
    file = model(f"{{field: {name}}}")
    lines = heard(file, tmp_path / "run")
    expected = [(f"{0.5 + n / 10:.2f}", f"{n}") for n in range(10)]
    assert [(time, value) for time, value, _ in lines] == expected
    assert {age for *_, age in lines} <= {"20", "21"}
    again = heard(file, tmp_path / "again")
    assert again == lines
    assert (tmp_path / "again/trace.mcap").read_bytes() == (tmp_path / "run/trace.mcap").read_bytes()


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ("rate: 2", [(0.5 + n / 20, n) for n in range(10)]),
        ("delay: 1 s, after: 0.3 s", [(1 + n / 10, n + 3) for n in range(7)]),
        ("loop: true, after: 0.5 s", [(0.5 + n // 5 * 0.4 + n % 5 / 10, 5 + n % 5) for n in range(18)]),
    ],
)
def test_rate_delay_beginning_and_loop(model, tmp_path, settings, expected):
    record(tmp_path / "in.bag")
    lines = heard(model(f"{{field: {{bag: in.bag, {settings}}}}}"), tmp_path / "run")
    wanted = [(f"{time:.2f}", f"{value:g}") for time, value in expected]
    assert [(time, value) for time, value, _ in lines][: len(wanted)] == wanted


def test_topics_are_chosen_and_renamed_and_stamps_kept(model, tmp_path):
    with create_bag(tmp_path / "in.bag") as writer:
        for at, message in ranges(3):
            writer.write("/sonar", at, message)
            writer.write("/other", at, new("std_msgs/msg/String", data="x"))
    text = "{field: {bag: in.bag, topics: [/sonar], remap: {/sonar: /range}, stamps: recorded}}"
    lines = heard(model(text), tmp_path / "run")
    assert [value for _, value, _ in lines] == ["0", "1", "2"]
    assert all(int(age) < -(10**12) for *_, age in lines)
    names = {one.name for one in open_bag(tmp_path / "run/trace.mcap").topics}
    assert "/other" not in names
    assert "/sonar" not in names


@pytest.mark.parametrize(
    ("inputs", "what"),
    [
        ("{field: gone.bag}", "there is no recording 'gone.bag' beside the model"),
        ("{field: ../in.bag}", "is outside the folder of the model"),
        ("{field: text.bag}", "text.bag"),
        ("{field: {bag: in.bag, topics: /rang}}", "has no topic '/rang' \\(did you mean '/range'\\?\\)"),
        ("{field: {bag: in.bag, after: 5 s}}", "lasts 0.9 s; `after` skips all of it"),
        ("{field: {bag: in.bag, after: 0.9 s, loop: true}}", "of one instant from `after` on"),
        ("{field: {bag: in.bag, rate: 0}}", "rate"),
        ("{field: {bag: in.bag, sped: 2}}", "sped"),
    ],
)
def test_what_is_wrong_is_said_before_the_run(model, tmp_path, inputs, what):
    record(tmp_path / "in.bag")
    (tmp_path / "text.bag").write_text("no bag")
    with pytest.raises(ModelError, match=what) as refused:
        volery.simulate(model(inputs), volery.Options(fidelity="code"))
    assert "model.yaml:9" in str(refused.value)


def test_a_topic_that_cannot_be_decoded_is_refused_by_name(model, tmp_path):
    from mcap.writer import Writer

    with (tmp_path / "in.mcap").open("wb") as out:
        writer = Writer(out)
        writer.start()
        schema = writer.register_schema("mine/msg/Strange", "protobuf", b"")
        channel = writer.register_channel("/strange", "protobuf", schema)
        writer.add_message(channel, log_time=1, data=b"x", publish_time=1)
        writer.finish()
    with pytest.raises(ModelError, match="/strange cannot be played"):
        volery.simulate(model("{field: {bag: in.mcap, topics: /strange}}"), volery.Options(fidelity="code"))
    with pytest.raises(ModelError, match="has no message that can be decoded"):
        volery.simulate(model("{field: in.mcap}"), volery.Options(fidelity="code"))


def test_an_option_adds_a_recording(model, tmp_path, monkeypatch):
    record(tmp_path / "elsewhere.bag")
    folder = tmp_path / "model"
    folder.mkdir()
    (folder / "hear.py").write_text(HEAR)
    (folder / "model.yaml").write_text(MODEL % "{}")
    monkeypatch.chdir(tmp_path)
    words = ["simulate", "model", "--bag", "elsewhere.bag", "--out", "run", "-q"]
    result = CliRunner().invoke(application(), words)
    assert result.exit_code == 0, result.stderr
    counts = {one.name: one.messages for one in open_bag(tmp_path / "run/trace.mcap").topics}
    assert counts["/heard"] == 10
    words[3] = "gone.bag"
    result = CliRunner().invoke(application(), words)
    assert (result.exit_code, "gone.bag" in result.stderr) == (2, True)


def test_a_mission_has_no_topics_to_record():
    with pytest.raises(UsageError, match="record /image: a mission has no topics of its own"):
        volery.fly(lambda drone: None, "sim:px4", volery.Options(record="/image"))
