"""Messages through C++ and back: the bytes are the same, whatever the type is made of."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from volery.components.cpp.build import CppComponent, LibraryHeaders, compile_component, operations
from volery.components.cpp.cpp_program import CppObject, CppProgram
from volery.kernel.virtual import VirtualKernel
from volery.model.components import Argument, Interface, Signature
from volery.ros import messages
from volery.ros.client_libraries import roscpp
from volery.ros.messages.encodings import FieldLayout, ros1_layout

pytestmark = pytest.mark.integration

TYPES = (
    "std_msgs/Bool", "std_msgs/Char", "std_msgs/Byte", "std_msgs/Int8", "std_msgs/UInt64", "std_msgs/Float32",
    "std_msgs/String", "std_msgs/Empty", "std_msgs/ColorRGBA", "std_msgs/UInt8MultiArray",
    "std_msgs/Float64MultiArray", "geometry_msgs/PoseWithCovarianceStamped", "geometry_msgs/PoseArray",
    "sensor_msgs/Imu", "sensor_msgs/LaserScan", "sensor_msgs/PointCloud2", "sensor_msgs/CameraInfo",
    "sensor_msgs/JointState", "sensor_msgs/NavSatFix", "sensor_msgs/BatteryState", "nav_msgs/Odometry",
    "nav_msgs/OccupancyGrid", "nav_msgs/Path", "mavros_msgs/State", "mavros_msgs/OverrideRCIn",
    "mavros_msgs/VFR_HUD", "mavros_msgs/WaypointList", "geographic_msgs/GeoPoseStamped",
    "std_srvs/SetBoolRequest", "std_srvs/SetBoolResponse",
)  # fmt: skip
ECHO = Interface(
    "Echoing",
    {"echo": Signature("echo", (Argument("type", "str"), Argument("data", "bytes")), "bytes")},
)
PROGRAM = """\
#include <volery/interfaces.h>
{includes}
#include <sstream>

template <class Message>
std::vector<std::uint8_t> again(const std::vector<std::uint8_t>& data) {{
    Message message;
    ros::detail::from_bytes({{reinterpret_cast<const char*>(data.data()), data.size()}}, message);
    std::ostringstream shown;
    shown << message;
    auto const bytes = ros::detail::to_bytes(message);
    return {{bytes.begin(), bytes.end()}};
}}

struct Echo : Echoing {{
    std::vector<std::uint8_t> echo(const std::string& type, const std::vector<std::uint8_t>& data) override {{
{cases}
        return {{}};
    }}
}};
"""


def _program() -> str:
    cases = (f'        if (type == "{one}") return again<{one.replace("/", "::")}>(data);' for one in TYPES)
    return PROGRAM.format(includes="\n".join(f"#include <{one}.h>" for one in TYPES), cases="\n".join(cases))


@pytest.fixture
def echo(tmp_path: Path) -> Any:
    (tmp_path / "echo.cpp").write_text(_program())
    component = CppComponent(
        "Echo", tmp_path / "echo.cpp", "Echo", operations(ECHO), (), {"Echoing": ECHO}, ("-O0", "-g0")
    )
    face = LibraryHeaders((roscpp.INCLUDE,), roscpp.FALLBACK, roscpp.generate_headers)
    kernel = VirtualKernel()
    made = CppProgram(kernel, "echo", compile_component(component, face)).make({})
    assert isinstance(made, CppObject)
    return made.echo


def test_messages_are_encoded_and_decoded_unchanged(echo):
    for name in TYPES:
        message = _filled(_ours(name), 1)
        data = messages.to_cdr(message)
        assert echo(name, data) == data, name
        empty = messages.to_cdr(messages.message_class(_ours(name))())
        assert echo(name, empty) == empty, name


def test_bytes_that_are_too_few_are_an_error(echo):
    with pytest.raises(Exception, match="too few bytes"):
        echo("std_msgs/String", b"\0\1\0\0\x10\0\0\0abc")


def _ours(name: str) -> str:
    package, _, label = name.partition("/")
    for half in ("Request", "Response"):
        if label.endswith(half):
            return f"{package}/srv/{label.removesuffix(half)}_{half}"
    return f"{package}/msg/{'VfrHud' if label == 'VFR_HUD' else label}"


def _filled(name: str, seed: int) -> Any:
    """A message of which every field says something, none of which is a round number of bytes long."""
    cls = messages.message_class(name)
    carried = [one for one in ros1_layout(name).fields if one.carried]
    names = cls.__match_args__
    values = (_value(one, seed + number) for number, one in enumerate(carried))
    return cls(**dict(zip(names, values, strict=True))) if carried else cls()


def _value(one: FieldLayout, seed: int) -> Any:
    if one.length is not None:
        count = one.length or 1 + seed % 3
        single = one._replace(length=None)
        return [_value(single, seed + index) for index in range(count)]
    if one.nested:
        return _filled(one.nested, seed)
    if one.base == "string":
        return "x" * (seed % 7) + "é"
    if one.base == "bool":
        return seed % 2 == 0
    return seed + 0.5 if one.base.startswith("float") else seed % 100
