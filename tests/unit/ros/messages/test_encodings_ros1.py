"""ROS 1's names, checksums and bytes; the sums are those that Debian's packages state."""

from collections.abc import Callable
from typing import Any

import pytest

from volery.base.errors import UsageError
from volery.ros import messages

SUMS = {
    "std_msgs/String": "992ce8a1687cec8c8bd883ec73ca41d1",
    "std_msgs/Header": "2176decaecbce78abc3b96ef049fabed",
    "std_msgs/Empty": "d41d8cd98f00b204e9800998ecf8427e",
    "sensor_msgs/NavSatFix": "2d3a8cd499b9b4a0249fb98fd05cfa48",
    "sensor_msgs/Imu": "6a62c6daae103f4ff57a132d6f95cec2",
    "sensor_msgs/CameraInfo": "c9a58c1b0b154e0e6da7578cb991d214",
    "geometry_msgs/PoseStamped": "d3812c3cbc69362b77dc0b19b345f8f5",
    "nav_msgs/Odometry": "cd5e73d190d741a2f92e81eda573aca7",
    "tf2_msgs/TFMessage": "94810edda583a504dfda3829e70d7eec",
    "rosgraph_msgs/Clock": "a9c97c1d230cfc112e270351a944ee47",
    "std_msgs/Time": "cd7166c74c552c311fbcc2fe5a7bc289",
    "std_msgs/Duration": "3e286caf4241d664e55f3ad380e2ae46",
}
SERVICES = {
    "std_srvs/Empty": "d41d8cd98f00b204e9800998ecf8427e",
    "std_srvs/SetBool": "09fb03525b03e7ea1fd3992bafd87e16",
    "std_srvs/Trigger": "937c9679a518e3a18d831e57125ea522",
    "mavros_msgs/CommandBool": "e09abbb4e5bae6b558e5010966eb6e9e",
    "dji_osdk_ros/GetDroneType": "87cc5c5bc9c0355af48cf3dac961c235",
    "dji_osdk_ros/InitWaypointV2Setting": "f07b42d879472cc58a4d50076253c8e6",
    "dji_osdk_ros/DownloadWaypointV2Mission": "4b9a6e8c58bda1e8d747c69006bbc940",
}


@pytest.mark.parametrize(("name", "checksum"), SUMS.items())
def test_checksum_of_a_message(name: str, checksum: str) -> None:
    assert messages.ros1_type(name)[:2] == (name, checksum)


@pytest.mark.parametrize(("name", "checksum"), SERVICES.items())
def test_checksum_of_a_service(name: str, checksum: str) -> None:
    kind = messages.ros1_service(name)
    assert (kind.name, kind.md5) == (name, checksum)
    assert kind.request.name == f"{name}Request"


def test_a_spelling_of_ros1() -> None:
    assert messages.ros1_type("mavros_msgs/VfrHud").name == "mavros_msgs/VFR_HUD"


def test_header_is_seen_from_the_type() -> None:
    assert messages.ros1_type("sensor_msgs/Imu").has_header
    assert not messages.ros1_type("std_msgs/String").has_header
    assert not messages.ros1_type("std_msgs/Empty").has_header


def test_the_encoding_of_a_string_and_a_header() -> None:
    assert messages.to_ros1(messages.new("std_msgs/String", data="ab")) == b"\x02\0\0\0ab"
    header = messages.new("std_msgs/Header", stamp={"sec": 3, "nanosec": 4}, frame_id="m")
    assert messages.to_ros1(header) == b"\0\0\0\0\x03\0\0\0\x04\0\0\0\x01\0\0\0m"
    assert messages.to_ros1(messages.new("std_msgs/Empty")) == b""


@pytest.mark.parametrize("name", messages.types())
def test_every_type_goes_there_and_back(name: str) -> None:
    message = messages.new(name)
    assert messages.from_ros1(name, messages.to_ros1(message)) == message


def test_a_type_with_other_fields_in_ros1_is_converted_by_their_names() -> None:
    """The sums are those of Noetic; texture and mesh file of a marker, and a variance, are not in it."""
    sums = (
        ("visualization_msgs/Marker", "4048c9de2a16f4ae8e0538085ebf1b97"),
        (
            "sensor_msgs/Range",
            "c005c34273dc426c67a020a87bc24148",
        ),
    )
    for name, checksum in sums:
        assert messages.ros1_type(name)[:2] == (name, checksum)
    marker = messages.new("visualization_msgs/Marker", ns="a", id=7, text="here", texture_resource="wood.png")
    marker.points = [messages.new("geometry_msgs/Point", x=1.5), messages.new("geometry_msgs/Point", z=-2.0)]
    marker.colors = [messages.new("std_msgs/ColorRGBA", g=0.5)]
    marker.pose.orientation.w = 0.25
    array = messages.new("visualization_msgs/MarkerArray", markers=[marker, marker])
    back = messages.from_ros1("visualization_msgs/MarkerArray", messages.to_ros1(array))
    marker.texture_resource = ""
    assert back == messages.new("visualization_msgs/MarkerArray", markers=[marker, marker])
    near = messages.new("sensor_msgs/Range", range=1.5, variance=0.25)
    assert messages.from_ros1("sensor_msgs/Range", messages.to_ros1(near)) == messages.new(
        "sensor_msgs/Range", range=1.5
    )


@pytest.mark.parametrize("data", [b"", b"\x02", b"\xff\xff\xff\x7fabc", b"\x01\0\0\0ab", b"\x01\0\0\0\xff"])
def test_bytes_that_are_no_message(data: bytes) -> None:
    with pytest.raises(UsageError, match=r"are no std_msgs/msg/String"):
        messages.from_ros1("std_msgs/String", data)


@pytest.mark.parametrize("decode", [messages.from_cdr, messages.from_ros1])
@pytest.mark.parametrize("name", ["geometry_msgs/PolygonStamped", "tf2_msgs/TFMessage"])
def test_a_count_of_elements_that_the_bytes_cannot_hold(decode: Callable[..., Any], name: str) -> None:
    """A count of 2^32 is refused at once."""
    data = bytes(4 if decode is messages.from_cdr else 0) + bytes(12) + b"\xff" * 40
    with pytest.raises(UsageError, match="bytes are no"):
        decode(name, data)
