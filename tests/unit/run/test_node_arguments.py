"""What roslaunch and ros2 launch tell a bridge: names, parameters, and MAVROS's addresses."""

import pytest

from volery.base.errors import UsageError
from volery.run.bridge import BridgeOptions
from volery.run.node_arguments import mavros_options, node_arguments, volery_address


def options_of(*words, url=""):
    notes: list[str] = []
    made = mavros_options(BridgeOptions(url=url, graph="ros1"), node_arguments(words), notes.append)
    return made, notes


def test_the_arguments_of_roslaunch():
    words = (
        "sim:px4",
        "state:=/s",
        "_fcu_url:=/dev/x",
        "_gcs_url:=udp://@",
        "__name:=mavros",
        "__log:=/tmp/l",
    )
    given = node_arguments((*words, "__ns:=/uav0", "_system_id:=7", "_tgt_system:=2"))
    assert (given.words, given.ros, given.full_name()) == (("sim:px4",), 1, "/uav0/mavros")
    made, notes = options_of(*words, "__ns:=/uav0", "_system_id:=7", "_tgt_system:=2")
    assert (made.url, made.namespace, made.system) == (
        "px4+serial:///dev/x?baud=57600&system=2",
        "/uav0/mavros",
        7,
    )
    assert made.remaps == {"state": "/s"}
    assert notes == ["parameters of MAVROS without effect here: gcs_url"]


def test_roslaunch_states_the_namespace_in_the_environment(monkeypatch):
    monkeypatch.setenv("ROS_NAMESPACE", "uav0/")
    assert node_arguments(["__name:=mavros"]).full_name() == "/uav0/mavros"


def test_the_arguments_of_ros2_launch(tmp_path):
    file = tmp_path / "p.yaml"
    file.write_text(
        "/**: {ros__parameters: {fcu_url: 'tcp://h:1', tgt_system: 3}}\n/other: {ros__parameters: {a: 1}}\n"
    )
    words = ("--ros-args", "-r", "__node:=mavros", "-r", "__ns:=/mavros", "-p", "system_id:=9")
    made, notes = options_of(
        *words, "--params-file", str(file), "-r", "state:=/s", "--", "sim:px4", url="sim:px4"
    )
    assert (made.url, made.namespace, made.system, made.remaps) == ("sim:px4", "/mavros", 9, {"state": "/s"})
    made, notes = options_of(*words, "--params-file", str(file))
    assert (made.url, notes) == ("px4+tcp://h:1?system=3", [])


def test_without_arguments_of_a_launcher_nothing_changes():
    given = node_arguments(["sim:px4"])
    assert (given.words, given.ros, given.parameters) == (("sim:px4",), 0, {})


@pytest.mark.parametrize(
    ("fcu_url", "address"),
    [
        ("/dev/ttyACM0:921600", "px4+serial:///dev/ttyACM0?baud=921600"),
        ("/dev/ttyACM0", "px4+serial:///dev/ttyACM0?baud=57600"),
        ("serial:///dev/ttyUSB0:57600?ids=1,240", "px4+serial:///dev/ttyUSB0?baud=57600"),
        ("udp://:14540@", "px4+udp://:14540"),
        ("udp://:14540@127.0.0.1:14557", "px4+udp://127.0.0.1:14557?from=14540"),
        ("udp://@10.0.0.2", "px4+udp://10.0.0.2:14550?from=14555"),
        ("udp://127.0.0.1:14551@", "px4+udp://:14551?bind=127.0.0.1"),
        ("tcp://", "px4+tcp://localhost:5760"),
        ("tcp://10.0.0.2:5763", "px4+tcp://10.0.0.2:5763"),
    ],
)
def test_addresses_of_mavros(fcu_url, address):
    assert volery_address(fcu_url, "px4") == address


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["_fcu_url:=mavlink"], "fcu_url 'mavlink': /dev/DEVICE:BAUD"),
        (["__name:=mavros"], "no address is given: state it, or MAVROS's parameter fcu_url"),
        (["_fcu_url:=sim:px4", "_system_id:=x"], "the parameter system_id is 'x'; a system id from 0 to 255"),
        (["--ros-args", "--params-file", "gone.yaml"], "--params-file gone.yaml: gone.yaml cannot be read"),
    ],
)
def test_what_cannot_be_used_is_said(words, what):
    with pytest.raises(UsageError, match=what):
        options_of(*words)
