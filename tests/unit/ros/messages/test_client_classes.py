"""Messages as rospy and rclpy have them: what these tests state was observed on the real libraries."""

from __future__ import annotations

import io
import pickle
from array import array
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from volery.ros.messages import client_classes, define, define_imported, modules, new, types
from volery.ros.messages.client_classes import (
    RCLPY,
    ROSPY,
    Library,
    adopt,
    message_of,
    receiving,
    take_odd_values,
)


def received(name: str, library: Library, /, **fields: Any) -> Any:
    """A message of one library's class that has gone over the graph."""
    return adopt(message_of(name, library)(**fields).copy(), library)


def test_lists_of_numbers_arrive_as_rospy_gives_them() -> None:
    scan = received("sensor_msgs/msg/LaserScan", ROSPY, ranges=[1, 2.5])
    assert scan.ranges == (1.0, 2.5)
    assert scan.ranges is scan.ranges  # converted once
    assert scan.intensities == ()
    assert received("sensor_msgs/msg/Image", ROSPY, data=[1, 2]).data == b"\x01\x02"
    assert received("std_msgs/msg/Int8MultiArray", ROSPY, data=[-1]).data == (-1,)
    assert received("geometry_msgs/msg/PoseWithCovariance", ROSPY).covariance == (0.0,) * 36
    assert received("sensor_msgs/msg/JointState", ROSPY, name=("a",)).name == ["a"]
    mine = message_of("sensor_msgs/msg/LaserScan", ROSPY)()
    assert mine.ranges == []
    mine.ranges = given = np.zeros(2)
    assert mine.ranges is given  # as assigned


def test_what_receives_a_class_is_written_once(monkeypatch: pytest.MonkeyPatch) -> None:
    take = {library: receiving(message_of("nav_msgs/msg/Odometry", library)) for library in (ROSPY, RCLPY)}
    written: list[str] = []
    monkeypatch.setattr(client_classes, "compile", lambda *_: written.append("again"), raising=False)
    for library, adopted in take.items():
        assert adopted is not None
        for _ in range(2):
            message = adopted(new("nav_msgs/msg/Odometry"))
            assert type(message) is message_of("nav_msgs/msg/Odometry", library)
    assert not written


def test_lists_of_numbers_are_arrays_in_rclpy() -> None:
    scan = message_of("sensor_msgs/msg/LaserScan", RCLPY)(ranges=(1, 2.5))
    assert scan.ranges == array("f", [1.0, 2.5])
    again = received("sensor_msgs/msg/LaserScan", RCLPY, ranges=[1.0])
    assert again.ranges + again.ranges == array("f", [1.0, 1.0])
    assert again.intensities == array("f")
    pose = received("geometry_msgs/msg/PoseWithCovariance", RCLPY)
    assert isinstance(pose.covariance, np.ndarray)
    status = received("diagnostic_msgs/msg/DiagnosticStatus", RCLPY, level=b"\x02")
    assert status.level == b"\x02" == type(status).ERROR
    with pytest.raises(TypeError):
        message_of("std_msgs/msg/Int32MultiArray", RCLPY)(data=[1.5])


@pytest.mark.parametrize(
    ("name", "given", "arrives"),
    [
        ("Float64", 2, 2.0),
        ("Float32", 0.1, 0.10000000149011612),
        ("Bool", 1, True),
        ("Int32", True, 1),
        ("Int32", np.int64(5), 5),
    ],
)
def test_rospy_numbers_are_those_of_the_encoding(name: str, given: Any, arrives: Any) -> None:
    got = received(f"std_msgs/msg/{name}", ROSPY, data=given).data
    assert (got, type(got)) == (arrives, type(arrives))


@pytest.mark.parametrize(
    ("name", "given", "arrives"),
    [
        ("Float64", 0, 0.0),
        ("Float64", np.float64(3.5), 3.5),
        ("Float64", np.int64(3), 1.5e-323),
        ("Float64", np.float32(1.5), 5.28426686e-315),
        ("Float32", 3, 0.0),
        ("Float32", None, 0.0),
        ("Bool", 1, False),
        ("UInt8", 300, 44),
        ("Int8", 200, -56),
        ("Int32", 2**31, -(2**31)),
    ],
)
def test_rclpy_sends_what_it_reads_from_memory(name: str, given: Any, arrives: Any) -> None:
    message = message_of(f"std_msgs/msg/{name}", RCLPY)(data=given)
    got = message.copy().data
    assert got == arrives
    assert [(one.path, one.given) for one in take_odd_values(message)] == (
        [] if given == arrives else [("data", given)]
    )


def test_an_int_in_a_float_field_is_nearly_zero_in_rclpy() -> None:
    twist = message_of("geometry_msgs/msg/Twist", RCLPY)()
    twist.linear.x = 2
    assert 0 < twist.copy().linear.x < 1e-300
    assert [one.path for one in take_odd_values(twist)] == ["linear.x"]


def test_headers_of_ros_1() -> None:
    kind: Any = message_of("std_msgs/msg/Header", ROSPY)
    stamp: Any = message_of("builtin_interfaces/msg/Time", ROSPY)(1, 5)
    header = kind(7, stamp, "map")
    assert (header.seq, str(header.stamp), header.frame_id) == (7, "1000000005", "map")
    assert kind(seq=1).seq == 1
    assert adopt(header.copy(), ROSPY).seq == 7
    point = message_of("geometry_msgs/msg/PointStamped", ROSPY)(None, None)
    assert point == type(point)()
    with pytest.raises(TypeError, match="Invalid number of arguments"):
        kind(1, stamp)
    with pytest.raises(AttributeError, match="foo is not an attribute of Header"):
        kind(foo=1)
    assert not hasattr(message_of("std_msgs/msg/Header", RCLPY)(), "seq")


def test_what_rospy_classes_say_of_themselves() -> None:
    kind: Any = message_of("geometry_msgs/msg/Twist", ROSPY)
    assert (kind._type, kind.__slots__) == ("geometry_msgs/Twist", ["linear", "angular"])
    assert kind._md5sum == "9f195f881246fdfa2798d1d3eebca84a"
    assert kind._slot_types == ["geometry_msgs/Vector3", "geometry_msgs/Vector3"]
    buffer = io.BytesIO()
    stamped: Any = message_of("geometry_msgs/msg/PointStamped", ROSPY)
    sent = stamped()
    sent.header.seq, sent.point.x = 3, 1.5
    sent.serialize(buffer)
    back = stamped().deserialize(buffer.getvalue())
    assert back == sent
    states: Any = message_of("sensor_msgs/msg/JointState", ROSPY)
    assert str(states(name=["a"], position=[0.5])) == (
        "header: \n  seq: 0\n  stamp: \n    secs: 0\n    nsecs:         0\n  frame_id: ''\n"
        "name: \n  - a\nposition: [0.5]\nvelocity: []\neffort: []"
    )
    assert message_of("geometry_msgs/msg/Quaternion", ROSPY)().w == 0.0


def test_what_rclpy_classes_say_of_themselves() -> None:
    kind: Any = message_of("geometry_msgs/msg/Twist", RCLPY)
    zero = "geometry_msgs.msg.Vector3(x=0.0, y=0.0, z=0.0)"
    assert repr(kind()) == f"geometry_msgs.msg.Twist(linear={zero}, angular={zero})"
    assert kind.__slots__ == ["_linear", "_angular", "_check_fields"]
    assert kind.get_fields_and_field_types() == dict.fromkeys(("linear", "angular"), "geometry_msgs/Vector3")
    assert kind(unknown=1) == kind()
    stamp: Any = message_of("builtin_interfaces/msg/Time", RCLPY)(sec=1)
    assert not hasattr(stamp, "secs")
    with pytest.raises(TypeError):
        sorted([stamp, stamp])
    with pytest.raises(TypeError):
        sum([stamp, stamp], stamp)
    with pytest.raises(TypeError):
        hash(stamp)


def test_defaults_that_a_definition_states() -> None:
    text = 'float32 gain 1.5 # a gain\nbool on true\nstring<=10 name "a # b"\nint32[] list [1, 2]\nuint8 A=3'
    define("values_test_msgs/msg/Gains", text)
    made: Any = message_of("values_test_msgs/msg/Gains", RCLPY)()
    assert (made.gain, made.on, made.name, made.list) == (1.5, True, "a # b", array("i", [1, 2]))
    assert message_of("sensor_msgs/msg/NavSatStatus", RCLPY)().status == -2  # type: ignore[attr-defined]
    assert message_of("sensor_msgs/msg/NavSatStatus", ROSPY)().status == 0  # type: ignore[attr-defined]


def test_a_known_package_gets_the_other_types_of_the_workspace(tmp_path: Path) -> None:
    folder = tmp_path / "roscopter"
    (folder / "msg").mkdir(parents=True)
    (folder / "package.xml").write_text("<package><name>roscopter</name></package>")
    (folder / "msg" / "RC.msg").write_text("int32 other\n")  # the vehicle's node fills another field
    (folder / "msg" / "ValuesTest.msg").write_text("int32 latitude\n")
    file = folder / "scripts" / "node.py"
    file.parent.mkdir()
    file.write_text("import roscopter.msg\n")
    assert define_imported(file) == ["roscopter"]
    assert "roscopter/msg/ValuesTest" in types()
    assert message_of("roscopter/msg/RC").__match_args__ == ("channel",)
    assert define_imported(file) == []


def test_a_type_that_cannot_be_defined_leaves_its_package_usable(tmp_path: Path) -> None:
    folder = tmp_path / "partly_msgs" / "msg"
    folder.mkdir(parents=True)
    (folder / "Plain.msg").write_text("float64 height\n")
    (folder / "Wide.msg").write_text("wstring text\n")
    (folder / "Far.msg").write_text("nowhere_msgs/Thing thing\n")
    (folder / "Farther.msg").write_text("Header header\nuint8 BAD=1\nFar[] far\n")
    file = tmp_path / "node.py"
    file.write_text("from partly_msgs.msg import Plain\n")
    assert define_imported(file) == ["partly_msgs"]
    partly: Any = modules("partly_msgs")["partly_msgs.msg"]
    assert partly.Plain(height=2.0).height == 2.0
    for name, why in (("Wide", "wstring"), ("Far", "nowhere_msgs/Thing"), ("Farther", "partly_msgs/Far")):
        with pytest.raises(AttributeError, match=why):
            getattr(partly, name)


def test_a_long_array_is_the_receiver_s_own_when_it_can_be_changed() -> None:
    data = bytes(5000)
    one, other = (received("sensor_msgs/msg/Image", ROSPY, data=data) for _ in range(2))
    assert one.data is other.data is data
    assert pickle.loads(pickle.dumps(one)) == one
    sent = message_of("sensor_msgs/msg/Image", ROSPY)(data=data).copy()
    one, other = (adopt(sent.copy(), RCLPY) for _ in range(2))
    one.data[0] = 7
    assert (one.data[0], other.data[0], data[0]) == (7, 0, 0)
    define("values_test_msgs/msg/Grid", "float64[600] cells")
    sent = message_of("values_test_msgs/msg/Grid")().copy()
    one, other = (adopt(sent.copy(), RCLPY) for _ in range(2))
    one.cells[0] = 7.0
    assert (type(one.cells), one.cells[0], other.cells[0]) == (np.ndarray, 7.0, 0.0)


def test_rclpy_keeps_the_array_that_is_assigned() -> None:
    made: Any = message_of("sensor_msgs/msg/Image", RCLPY)()
    made.data = given = array("B", [1, 2])
    assert made.data is given
    made.data = np.array([3, 4], np.uint8)
    assert made.data == array("B", [3, 4])
