"""ArduPilot: one driver with three backends: a MAVLink link, MAVROS on a graph, its own topics on ROS 2.

The backends on graphs are imported when they are opened: a flight over a link imports nothing of ROS.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from volery.kernel.api import Kernel
from volery.links.link import Link
from volery.vehicles.address import MAVLINK_OPTIONS, check_options
from volery.vehicles.driver import DriverFactory
from volery.vehicles.drivers.ardupilot.backend import ArduPilotMavlink
from volery.vehicles.drivers.ardupilot.driver import ArduPilot

if TYPE_CHECKING:
    from volery.ros.graph import Node

__all__ = ["DRIVER", "ArduPilot", "open_driver", "open_mavros", "open_topics"]


def open_driver(kernel: Kernel, link: Link, name: str, options: Mapping[str, str]) -> ArduPilot:
    """Open an ArduPilot on a MAVLink link; heartbeats are sent from now on.

    Args:
        kernel: clock and tasks.
        link: link to the autopilot.
        name: name of the vehicle.
        options: see ``MAVLINK_OPTIONS``.
    """
    check_options("ardupilot", options, *MAVLINK_OPTIONS)
    return ArduPilot(kernel, name, ArduPilotMavlink(kernel, link, name, options))


def open_mavros(kernel: Kernel, node: Node, name: str, options: Mapping[str, str]) -> ArduPilot:
    """See ``mavros_backend.open_mavros``."""
    from volery.vehicles.drivers.ardupilot import mavros_backend

    return mavros_backend.open_mavros(kernel, node, name, options)


def open_topics(kernel: Kernel, node: Node, name: str, options: Mapping[str, str]) -> ArduPilot:
    """See ``topics_backend.open_topics``."""
    from volery.vehicles.drivers.ardupilot import topics_backend

    return topics_backend.open_topics(kernel, node, name, options)


DRIVER = DriverFactory(on_link=open_driver, on_graph=open_mavros, on_ros2=open_topics)
