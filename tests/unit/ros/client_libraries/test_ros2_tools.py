"""The small Python packages of ROS 2 that files import."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from volery.ros.client_libraries import ros2_tools
from volery.ros.messages.client_classes import RCLPY, message_of


@pytest.fixture
def tools() -> dict[str, Any]:
    return dict(ros2_tools.modules())


def test_packages_are_found_by_the_index_of_ament(
    tools: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    share = tmp_path / "share" / "arm"
    index = tmp_path / "share" / "ament_index" / "resource_index" / "packages"
    for folder in (share, index):
        folder.mkdir(parents=True)
    (share / "package.xml").write_text("<package><name>arm</name></package>")
    (index / "arm").write_text("")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    packages = tools["ament_index_python.packages"]
    assert packages.get_package_share_directory("arm") == str(share)
    assert packages.get_package_prefix("arm") == str(tmp_path)
    assert packages.get_resources("packages") == {"arm": str(tmp_path)}
    assert packages.get_resource("packages", "arm") == ("", str(tmp_path))
    with pytest.raises(packages.PackageNotFoundError, match=r"package 'amr' not found.*'arm'"):
        packages.get_package_share_directory("amr")
    with pytest.raises(ValueError, match="'a/b' is not a valid package name"):
        packages.get_package_prefix("a/b")


def test_a_cloud_of_points_is_written_and_read(tools: dict[str, Any]) -> None:
    clouds = tools["sensor_msgs_py.point_cloud2"]
    header = clouds.PointCloud2().header
    made = clouds.create_cloud_xyz32(header, [(1.0, 2.0, 3.0), (4.0, float("nan"), 6.0)])
    assert (made.width, made.height, made.point_step, made.row_step) == (2, 1, 12, 24)
    assert clouds.read_points(made)["x"].tolist() == [1.0, 4.0]
    assert clouds.read_points_list(made, ["x", "y"], skip_nans=True) == [(1.0, 2.0)]
    assert clouds.read_points_list(made, uvs=[1])[0].z == 6.0
    rows = np.arange(12, dtype=np.float32).reshape(2, 2, 3)
    organized = clouds.create_cloud_xyz32(header, rows)
    assert (organized.height, organized.width) == (2, 2)
    assert clouds.read_points(organized, reshape_organized_cloud=True)["y"].tolist() == [[1, 4], [7, 10]]
    assert clouds.read_points_numpy(organized).tolist() == rows.reshape(4, 3).tolist()
    with pytest.raises(AssertionError, match="as many values"):
        clouds.create_cloud_xyz32(header, [(1.0, 2.0)])


def test_messages_are_made_of_dictionaries_and_read_as_such(tools: dict[str, Any]) -> None:
    runtime = tools["rosidl_runtime_py"]
    path = tools["rosidl_runtime_py.utilities"].get_message("nav_msgs/msg/Path")()
    given = {"header": {"frame_id": "map"}, "poses": [{"pose": {"position": {"x": 2}}}]}
    runtime.set_message_fields(path, given)
    assert path.poses[0].pose.position.x == 2.0
    found = runtime.message_to_ordereddict(path)
    assert found["header"]["frame_id"] == "map"
    assert found["poses"][0]["pose"]["orientation"]["w"] == 1.0
    assert "frame_id: map" in runtime.message_to_yaml(path)
    with pytest.raises(AttributeError):
        runtime.set_message_fields(path, {"nothing": 1})


def test_the_types_of_fields_are_those_of_rosidl(tools: dict[str, Any]) -> None:
    kinds = tools["rosidl_parser.definition"]
    scan: Any = message_of("sensor_msgs/msg/LaserScan", RCLPY)
    header, *numbers, ranges, _ = scan.SLOT_TYPES
    assert header == kinds.NamespacedType(["std_msgs", "msg"], "Header")
    assert {one.typename for one in numbers} == {"float"}
    assert ranges == kinds.UnboundedSequence(kinds.BasicType("float"))
    pose: Any = message_of("geometry_msgs/msg/PoseWithCovariance", RCLPY)
    assert pose.SLOT_TYPES[1] == kinds.Array(kinds.BasicType("double"), 36)
    described: Any = message_of("rcl_interfaces/msg/ParameterDescriptor", RCLPY)
    assert isinstance(described.SLOT_TYPES[0], kinds.UnboundedString)
    assert described.SLOT_TYPES[-1].maximum_size == 1


def test_the_interfaces_of_a_package_are_listed(tools: dict[str, Any]) -> None:
    listed = tools["rosidl_runtime_py"]
    assert listed.get_service_interfaces(["std_srvs"]) == {
        "std_srvs": ["srv/Empty", "srv/SetBool", "srv/Trigger"]
    }
    assert "action/Fibonacci" in listed.get_interfaces(["example_interfaces"])["example_interfaces"]
    with pytest.raises(LookupError, match="Unknown package 'std_srv'"):
        listed.get_message_interfaces(["std_srv"])
