"""PX4: one driver with three backends: a MAVLink link, MAVROS on a graph, its own topics on ROS 2."""

from __future__ import annotations

from volery.vehicles.driver import DriverFactory
from volery.vehicles.drivers.mavlink.driver import DriverOpeners
from volery.vehicles.drivers.px4.backend import PX4Mavlink, PX4Mavros
from volery.vehicles.drivers.px4.driver import PX4
from volery.vehicles.drivers.px4.topics_backend import open_topics

__all__ = ["DRIVER", "PX4", "open_driver", "open_mavros", "open_topics"]

_OPENERS = DriverOpeners("px4", PX4, PX4Mavlink, PX4Mavros)

open_driver = _OPENERS.on_link
open_mavros = _OPENERS.on_graph

DRIVER = DriverFactory(on_link=open_driver, on_graph=open_mavros, on_ros2=open_topics)
