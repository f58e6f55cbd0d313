"""What a message costs the simulation in nodes of C++: from publish to callback, rclcpp against roscpp.

Both programs publish a pose to themselves and run the callback, on the embedded graph without prices. Times
are CPU time of this machine, medians over rounds that take turns. The ratio is to roscpp.

    python bench/cpp_nodes.py [--quick]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import process_time

from volery.components.cpp.build import CompiledComponent, CppComponent, LibraryHeaders, compile_component
from volery.components.cpp.cpp_program import CppProgram
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.ros.client_libraries import rclcpp, roscpp
from volery.ros.client_libraries.abi_codec import RequestHandlers
from volery.ros.client_libraries.library_base import Launch
from volery.ros.graph import EmbeddedGraph

ROSCPP = """
#include <ros/ros.h>
#include <geometry_msgs/PoseStamped.h>
void hear(const geometry_msgs::PoseStamped& message) { if (message.pose.position.x < 0) ros::shutdown(); }
int main(int argc, char** argv) {
    ros::init(argc, argv, "node");
    ros::NodeHandle node;
    auto publisher = node.advertise<geometry_msgs::PoseStamped>("pose", 10);
    auto subscriber = node.subscribe("pose", 10, hear);
    geometry_msgs::PoseStamped message;
    for (int count = std::stoi(argv[1]); count > 0; --count) {
        message.pose.position.x = count;
        publisher.publish(message);
        ros::spinOnce();
    }
    return 0;
}
"""
RCLCPP = """
#include <rclcpp/rclcpp.hpp>
#include <geometry_msgs/msg/pose_stamped.hpp>
using Pose = geometry_msgs::msg::PoseStamped;
int main(int argc, char** argv) {
    rclcpp::init(argc, argv);
    auto node = std::make_shared<rclcpp::Node>("node");
    auto publisher = node->create_publisher<Pose>("pose", 10);
    auto subscription = node->create_subscription<Pose>(
        "pose", 10, [](const Pose& message) { if (message.pose.position.x < 0) rclcpp::shutdown(); });
    rclcpp::executors::SingleThreadedExecutor executor;
    executor.add_node(node);
    Pose message;
    for (int count = std::stoi(argv[1]); count > 0; --count) {
        message.pose.position.x = count;
        publisher->publish(message);
        executor.spin_some();
    }
    return 0;
}
"""
LIBRARIES = {
    "roscpp": LibraryHeaders((roscpp.INCLUDE,), roscpp.FALLBACK, roscpp.generate_headers),
    "rclcpp": LibraryHeaders((rclcpp.INCLUDE,), rclcpp.FALLBACK, rclcpp.generate_headers),
}


def joined(language: str, graph: EmbeddedGraph) -> tuple[RequestHandlers, Callable[[], None]]:
    """Return the handlers of a new session, and its end."""
    if language == "rclcpp":
        ros2 = rclcpp.Session(graph, "node", Launch())
        return rclcpp.request_handlers(ros2), ros2.end
    session = roscpp.Session(graph, "node", Launch())
    return roscpp.request_handlers(session), session.end


def microseconds(language: str, compiled: CompiledComponent, count: int) -> float:
    """Return the CPU time of a message, us."""
    kernel = VirtualKernel()
    graph = EmbeddedGraph(kernel)
    program = CppProgram(kernel, "node", compiled, lambda: joined(language, graph), (str(count),))
    kernel.spawn(lambda: program.run(program.make({})), "node", ExecutionContext("node"))
    start = process_time()
    kernel.run(10**12)
    return (process_time() - start) / count * 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer messages and rounds")
    quick = parser.parse_args().quick
    count, rounds = (2_000, 3) if quick else (10_000, 9)
    with TemporaryDirectory() as folder:
        ready = {}
        for language, text in (("roscpp", ROSCPP), ("rclcpp", RCLCPP)):
            file = Path(folder, language, "node.cpp")
            file.parent.mkdir()
            file.write_text(text)
            component = CppComponent(language, file, flags=("-O2",))
            ready[language] = compile_component(component, LIBRARIES[language], print)
        taken: dict[str, list[float]] = {language: [] for language in ready}
        for _ in range(rounds):
            for language, compiled in ready.items():
                taken[language].append(microseconds(language, compiled, count))
    reference = median(taken["roscpp"])
    for language, values in taken.items():
        ratio = median(values) / reference
        print(f"{language} publish to callback {median(values):8.1f} us{ratio:8.2f} x roscpp")


if __name__ == "__main__":
    main()
