"""What a run keeps: everything, its summary, or nothing, with the same figures."""

from __future__ import annotations

from pathlib import Path

import pytest

import volery
from volery.base.errors import UsageError
from volery.cli.run_display import recorded_folder
from volery.report.graph_picture import graph_of_run
from volery.ros.messages import cdr_size, new
from volery.ros.messages.bags import open_bag
from volery.run.result import Options
from volery.trace.events import Omitted, Published, Text
from volery.trace.reader import read

STARTER = Path(__file__).parents[3] / "examples" / "starter"


def figures(run):
    return run.record.model_dump(exclude={"wall_s", "real_time_factor", "versions"})


def test_the_figures_are_the_same_whatever_is_kept(tmp_path):
    runs = {
        "full": Options(fidelity="code", out=tmp_path / "full"),
        "summary": Options(fidelity="code", out=tmp_path / "summary", record="summary"),
        "none": Options(fidelity="code"),
    }
    done = {name: volery.simulate(STARTER, options) for name, options in runs.items()}
    assert figures(done["full"]) == figures(done["summary"]) == figures(done["none"])
    assert {file.name for file in (tmp_path / "summary").iterdir()} == {"run.json"}
    assert {"run.json", "trace.mcap"} <= {file.name for file in (tmp_path / "full").iterdir()}
    assert done["none"].folder is None


def test_a_summary_removes_the_trace_of_an_earlier_run(tmp_path):
    (tmp_path / "trace.mcap").write_bytes(b"of another run")
    volery.simulate(STARTER, Options(out=tmp_path, record="summary"))
    assert not (tmp_path / "trace.mcap").exists()


def test_an_unknown_record_is_refused():
    with pytest.raises(UsageError, match="record all: there is full, summary or trace, or names of topics"):
        Options(record="all")
    with (
        pytest.raises(UsageError, match="--record all: there is full, none, summary or trace"),
        recorded_folder(None, "mission", "all"),
    ):
        pass


def test_no_folder_can_be_named_for_no_record(tmp_path):
    with pytest.raises(UsageError, match="leave out --out"), recorded_folder(tmp_path, "mission", "none"):
        pass


CAMERA = """
volery: 1
name: looking
components:
  Camera: {language: rospy, path: camera.py, active: true}
  Viewer: {language: rospy, path: viewer.py, active: true}
application: {camera: {is: Camera}, viewer: {is: Viewer}}
platform: {processors: {pc: {is: rpi4-cortex-a72, frequency: 1500 MHz}}}
allocations: {only: {camera: pc, viewer: pc}}
environment:
  origin: {latitude: 47, longitude: 8}
  places: {here: {east: 0 m, north: 0 m}}
  vehicles: {drone_1: {kind: multirotor, autopilot: px4, at: here}}
run: {duration: 2 s}
"""
CAMERA_FILE = """
import rospy
from sensor_msgs.msg import Image, LaserScan
rospy.init_node("camera")
images = rospy.Publisher("image", Image, queue_size=1)
scans = rospy.Publisher("scan", LaserScan, queue_size=1)
rate = rospy.Rate(10)
while not rospy.is_shutdown():
    images.publish(Image(width=320, height=240, data=bytes(230400)))
    scans.publish(LaserScan(ranges=[1.0] * 1080))
    rate.sleep()
"""
VIEWER_FILE = """
import rospy
from sensor_msgs.msg import Image
rospy.init_node("viewer")
rospy.Subscriber("image", Image, lambda image: None)
rospy.spin()
"""
IMAGE_SIZE = cdr_size(new("sensor_msgs/msg/Image", data=bytes(230400)).copy())


@pytest.fixture
def looking(tmp_path):
    (tmp_path / "camera.py").write_text(CAMERA_FILE)
    (tmp_path / "viewer.py").write_text(VIEWER_FILE)
    (tmp_path / "model.yaml").write_text(CAMERA)
    return tmp_path / "model.yaml"


def of_long(events, kind):
    return {one.topic for one in events if isinstance(one, kind) and one.topic in ("/image", "/scan")}


def test_long_messages_are_in_the_trace_without_their_content(looking, tmp_path):
    run = volery.simulate(looking, Options(out=tmp_path / "run"))
    assert run.completed
    trace = tmp_path / "run" / "trace.mcap"
    events = read(trace).events
    sent = [one for one in events if isinstance(one, Omitted)]
    assert {one.size for one in sent if one.topic == "/image"} == {IMAGE_SIZE}
    assert {(one.topic, one.publisher) for one in sent} == {("/image", "/camera"), ("/scan", "/camera")}
    assert len(sent) >= 40
    assert of_long(events, Published) == set()
    assert trace.stat().st_size < IMAGE_SIZE
    seen = {one.name: one for one in graph_of_run(tmp_path / "run").topics}
    assert (seen["/image"].type, seen["/image"].subscribers) == ("sensor_msgs/msg/Image", ("/viewer",))
    bag = open_bag(trace)
    assert list(bag.omitted) == ["/image", "/scan"]
    assert f"/scan ({bag.omitted['/scan']}); volery simulate --record /scan " in bag.omission(["/scan"])
    assert "--record /image records their content" in (tmp_path / "run" / "report.html").read_text()


def test_the_content_of_a_topic_or_of_all_is_recorded_when_asked_for(looking, tmp_path):
    for record, topics in (("/scan", {"/scan"}), ("full", {"/scan", "/image"})):
        out = tmp_path / topics.copy().pop().strip("/")
        volery.simulate(looking, Options(out=out, record=record))
        events = read(out / "trace.mcap").events
        assert of_long(events, Published) == topics
        assert of_long(events, Omitted) == {"/scan", "/image"} - topics
        assert set(open_bag(out / "trace.mcap").omitted) == {"/scan", "/image"} - topics


def test_taps_get_long_messages_as_they_are_recorded(looking, tmp_path):
    for options, kinds in (
        (Options(), set()),
        (Options(record="/image"), {Published}),
        (Options(out=tmp_path / "run"), {Omitted}),
    ):
        taken = []
        session = volery.RunSession(looking, options)
        session.tap(taken.append, Omitted, Published)
        session.run()
        assert {type(one) for one in taken if getattr(one, "topic", "") == "/image"} == kinds


def test_a_topic_that_nobody_publishes_is_named(looking, tmp_path):
    run = volery.simulate(looking, Options(out=tmp_path / "run", record="/image,/imege"))
    assert "record /imege: no node published this topic" in [
        one.text for one in read(tmp_path / "run" / "trace.mcap").events if isinstance(one, Text)
    ]
    assert run.completed
