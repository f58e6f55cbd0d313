"""``roscpp`` on a graph: headers that a C++ component includes, and handlers of the requests they make.

``include/`` holds ``ros/ros.h`` and related headers in place of roscpp's own; ``generate_headers`` writes the
headers of messages; ``request_handlers`` executes the requests of the code on the graph. Where Boost is not
installed, the part of it that roscpp's interface needs is in ``fallback/``.

The node has the name that ``ros::init`` gets, unless the model states a ``node_name``, as a launch file's
``name``.

Intended differences from the real library: what is not offered does not compile; threads of spinners are
tasks of the run, which change at requests only; wall time is the time of the run; connecting takes no time;
``Header.seq`` is not transmitted.
"""

from pathlib import Path

from volery.ros.client_libraries.roscpp.message_headers import INCLUDE, generate_headers
from volery.ros.client_libraries.roscpp.requests import request_handlers
from volery.ros.client_libraries.roscpp.session import Session

FALLBACK = (Path(__file__).parent / "fallback", Path("/usr/include/eigen3"))
"""Folders that are searched last; the second one is where ``find_package(Eigen3)`` finds it."""

__all__ = ["FALLBACK", "INCLUDE", "Session", "generate_headers", "request_handlers"]
