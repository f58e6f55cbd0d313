"""ArduPilot: one driver with three backends: a MAVLink link, MAVROS on a graph, its own topics on ROS 2."""

from __future__ import annotations

from volery.vehicles.driver import DriverFactory
from volery.vehicles.drivers.ardupilot.backend import ArduPilotMavlink, ArduPilotMavros
from volery.vehicles.drivers.ardupilot.driver import ArduPilot
from volery.vehicles.drivers.ardupilot.topics_backend import open_topics
from volery.vehicles.drivers.mavlink.driver import DriverOpeners

__all__ = ["DRIVER", "ArduPilot", "open_driver", "open_mavros", "open_topics"]

_OPENERS = DriverOpeners("ardupilot", ArduPilot, ArduPilotMavlink, ArduPilotMavros)

open_driver = _OPENERS.on_link
open_mavros = _OPENERS.on_graph

DRIVER = DriverFactory(on_link=open_driver, on_graph=open_mavros, on_ros2=open_topics)
