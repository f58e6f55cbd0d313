"""A vehicle as a ROS node under the names of MAVROS, roscopter, pprzros or its autopilot's own.

The package knows the graph, messages and links. It translates between ROS messages and frames as those
programs do, and does no more: it does not wait for the effect of a command and repeats no command.
``mavlink_adapter`` presents an autopilot that does not use MAVLink as one that does. The package must not
know worlds, simulated autopilots or any one driver.
"""

from volery.bridge.mavlink_adapter import MavlinkAdapter
from volery.bridge.naming_schemes import MAVLINK_SCHEMES, MAVROS, ROSCOPTER
from volery.bridge.node_interface import NamingScheme
from volery.bridge.vehicle_node import (
    PprzrosNode,
    VehicleNode,
    VehicleNodeOptions,
    serve_pprzros,
    serve_vehicle,
)

__all__ = [
    "MAVLINK_SCHEMES",
    "MAVROS",
    "ROSCOPTER",
    "MavlinkAdapter",
    "NamingScheme",
    "PprzrosNode",
    "VehicleNode",
    "VehicleNodeOptions",
    "serve_pprzros",
    "serve_vehicle",
]
