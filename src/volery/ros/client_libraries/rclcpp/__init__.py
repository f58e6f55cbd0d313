"""``rclcpp`` on a graph: headers that a C++ component includes, and handlers of the requests they make.

``include/`` holds ``rclcpp/rclcpp.hpp`` and related headers in place of rclcpp's own; ``generate_headers``
writes the headers of types; ``request_handlers`` executes the requests of the code on the graph. The
interface is that of ROS 2 Jazzy.

The first node has the name that the file gives it, unless the model states a ``node_name``, as a launch
file's ``name``.

Intended differences from the real library: what is not offered does not compile, or throws with a remedy;
the callbacks of an executor run in the order in which they became ready, not kind by kind; threads of
executors are tasks of the run, which change at requests only; all clocks show the time of the run; connecting
takes no time.
"""

from pathlib import Path

from volery.ros.client_libraries.rclcpp.component_main import main_of
from volery.ros.client_libraries.rclcpp.message_headers import INCLUDE, generate_headers
from volery.ros.client_libraries.rclcpp.requests import request_handlers
from volery.ros.client_libraries.rclcpp.session import Session

FALLBACK = (Path("/usr/include/eigen3"),)
"""Folders that are searched last: where ``find_package(Eigen3)`` finds Eigen."""

__all__ = ["FALLBACK", "INCLUDE", "Session", "generate_headers", "main_of", "request_handlers"]
