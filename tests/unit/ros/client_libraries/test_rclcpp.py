"""rclcpp without a compiler: generated headers, and the main() of a file that has none."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery.base.errors import UsageError
from volery.components.cpp.sources import find_sources
from volery.ros.client_libraries import rclcpp

HERE = Path(__file__)


def test_a_message_has_its_types_defaults_and_parts():
    texts = rclcpp.generate_headers(["geometry_msgs/msg/pose_stamped.hpp", "sensor_msgs/msg/image.hpp"], HERE)
    assert {"geometry_msgs/msg/quaternion.hpp", "std_msgs/msg/header.hpp"} <= set(texts)
    pose = texts["geometry_msgs/msg/pose_stamped.hpp"]
    assert '#include "std_msgs/msg/header.hpp"' in pose
    assert "::std_msgs::msg::Header header{};" in pose
    assert 'visit("pose", message.pose);' in pose
    assert "double w{static_cast<double>(1.0)};" in texts["geometry_msgs/msg/quaternion.hpp"]
    assert "std::vector<std::uint8_t> data{};" in texts["sensor_msgs/msg/image.hpp"]
    assert "seq" not in texts["std_msgs/msg/header.hpp"]


def test_services_and_actions_have_their_parts():
    names = ["std_srvs/srv/set_bool.hpp", "example_interfaces/action/fibonacci.hpp"]
    texts = rclcpp.generate_headers(names, HERE)
    assert "using Request = SetBool_Request;" in texts[names[0]]
    assert "bool data{};" in texts[names[0]]
    fibonacci = texts[names[1]]
    assert "using Feedback = example_interfaces::msg::Fibonacci_Feedback;" in fibonacci
    assert "using GetResultService = Fibonacci_GetResult;" in fibonacci
    assert '#include "unique_identifier_msgs/msg/uuid.hpp"' in fibonacci


def test_other_names_of_headers():
    texts = rclcpp.generate_headers(["std_msgs/msg/detail/string__struct.hpp", "rclcpp/duration.hpp"], HERE)
    assert '#include "std_msgs/msg/string.hpp"' in texts["std_msgs/msg/detail/string__struct.hpp"]
    assert '#include "rclcpp/time.hpp"' in texts["rclcpp/duration.hpp"]
    assert "builtin_interfaces/msg/time.hpp" in texts, "a header of volery includes it"


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("std_msgs/String.h", "it is a header of ROS 1; include <std_msgs/msg/string.hpp>"),
        ("std_msgs/msg/strings.hpp", "string.hpp"),
        ("ros/ros.h", "language: roscpp"),
        ("rclcpp/wait_set.hpp", "include <rclcpp/rclcpp.hpp>"),
        ("cv_bridge/cv_bridge.hpp", "read sensor_msgs::msg::Image::data"),
    ],
)
def test_what_is_not_offered_says_so(name, remedy):
    text = rclcpp.generate_headers([name, "vector", "own/header.hpp"], HERE, {"own/header.hpp"})[name]
    assert "is not offered" in text
    assert remedy in text


def test_the_main_of_a_file_without_one(tmp_path):
    file = tmp_path / "node.cpp"

    def main_for(text: str, node_class: str = "") -> str:
        file.write_text(text)
        return rclcpp.main_of(find_sources(file), node_class)

    assert main_for("int main() { return 0; }") == ""
    assert 'MAIN("")' in main_for("RCLCPP_COMPONENTS_REGISTER_NODE(a::Node)")
    assert 'MAIN("a::Node")' in main_for("RCLCPP_COMPONENTS_REGISTER_NODE(a::Node)", "a::Node")
    assert "MAIN(a::Node)" in main_for("namespace a { class Node : public rclcpp::Node {}; }", "a::Node")
    with pytest.raises(UsageError, match="no main"):
        main_for("class Node {};")
    with pytest.raises(UsageError, match="no class 'Nodes'"):
        main_for("class Node {};", "Nodes")
